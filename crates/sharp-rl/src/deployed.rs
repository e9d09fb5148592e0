//! Networks laid out for one decision at a time.
//!
//! Training works on batches and keeps weights as outputs x inputs. A decision is one vector. Here a layer is the sum
//! of its columns, each scaled by one input: the sums of a block of outputs stay in registers, no sum runs across a
//! register, and inputs that `ReLU` made zero are passed over.

use crate::actor::Actor;
use crate::network::Mlp;

/// Outputs that are summed together: eight registers of four, or four of eight.
const BLOCK: usize = 32;

/// A network for one input vector at a time.
#[derive(Clone, Debug, PartialEq)]
pub struct DeployedMlp {
    inputs: usize,
    layers: Vec<Columns>,
}

/// The deployed, deterministic policy of an [`Actor`].
#[derive(Clone, Debug, PartialEq)]
pub struct DeployedActor {
    /// What observations are shifted by, and scaled by after that.
    shift: Vec<f32>,
    scale: Vec<f32>,
    network: DeployedMlp,
    action_len: usize,
}

/// A dense layer as columns.
#[derive(Clone, Debug, PartialEq)]
struct Columns {
    outputs: usize,
    blocks: Vec<OutputBlock>,
}

/// The biases of a block of outputs, and for each input its weights; padded with zeros.
#[derive(Clone, Debug, PartialEq)]
struct OutputBlock {
    bias: [f32; BLOCK],
    columns: Vec<[f32; BLOCK]>,
}

/// Memory that decisions write into, so that none is allocated.
#[derive(Clone, Debug, Default)]
pub struct DeployedScratch {
    input: Vec<f32>,
    output: Vec<f32>,
    /// The inputs of a layer that are not zero, and their numbers.
    used: Vec<(usize, f32)>,
}

impl DeployedMlp {
    /// The network `network` as it is now.
    #[must_use]
    pub fn new(network: &Mlp) -> Self {
        let layers = (0..network.layer_count()).map(|index| Columns::new(network, index)).collect();
        Self { inputs: network.sizes()[0], layers }
    }

    /// The outputs for `input`, as [`Mlp::predict`] gives them up to rounding.
    ///
    /// # Panics
    /// If `input` has another length than the network's.
    pub fn predict<'a>(&self, input: &[f32], scratch: &'a mut DeployedScratch) -> &'a [f32] {
        scratch.input.clear();
        scratch.input.extend_from_slice(input);
        self.predict_scratch(scratch);
        &scratch.input
    }

    /// Replaces the input in `scratch` by the outputs.
    fn predict_scratch(&self, scratch: &mut DeployedScratch) {
        let DeployedScratch { input, output, used } = scratch;
        assert_eq!(input.len(), self.inputs, "length of the network's input");
        for (index, layer) in self.layers.iter().enumerate() {
            layer.apply(input, used, output);
            if index + 1 < self.layers.len() {
                // Written so that NaN passes through. `f32::max` would turn it into zero.
                output.iter_mut().for_each(|value| *value = if *value < 0.0 { 0.0 } else { *value });
            }
            std::mem::swap(input, output);
        }
    }
}

impl DeployedActor {
    /// The policy of `actor` as it is now.
    #[must_use]
    pub fn new(actor: &Actor) -> Self {
        let normaliser = actor.normaliser();
        Self {
            shift: normaliser.mean().to_vec(),
            scale: normaliser.std().iter().map(|std| 1.0 / std).collect(),
            network: DeployedMlp::new(actor.network()),
            action_len: actor.spec().action_len,
        }
    }

    /// Writes tanh of the mean, as [`Actor::act_mean`] does up to rounding.
    ///
    /// # Panics
    /// If `observation` or `action` has another length than the actor's.
    pub fn act(&self, observation: &[f32], scratch: &mut DeployedScratch, action: &mut [f32]) {
        assert_eq!(observation.len(), self.shift.len(), "length of the observation");
        assert_eq!(action.len(), self.action_len, "length of the action");
        scratch.input.clear();
        let scaled = observation.iter().zip(&self.shift).zip(&self.scale);
        scratch.input.extend(scaled.map(|((value, shift), scale)| (value - shift) * scale));
        self.network.predict_scratch(scratch);
        for (action, mean) in action.iter_mut().zip(&scratch.input) {
            // Not the system's: that differs from machine to machine.
            *action = libm::tanhf(*mean);
        }
    }
}

impl Columns {
    fn new(network: &Mlp, index: usize) -> Self {
        let (inputs, outputs) = (network.sizes()[index], network.sizes()[index + 1]);
        let layer = network.layer(index);
        let block = |first: usize| {
            let count = BLOCK.min(outputs - first);
            let column = |input: usize| {
                let mut column = [0.0; BLOCK];
                for (lane, weight) in column[..count].iter_mut().enumerate() {
                    *weight = layer.weights[(first + lane) * inputs + input];
                }
                column
            };
            let mut bias = [0.0; BLOCK];
            bias[..count].copy_from_slice(&layer.bias[first..first + count]);
            OutputBlock { bias, columns: (0..inputs).map(column).collect() }
        };
        Self { outputs, blocks: (0..outputs).step_by(BLOCK).map(block).collect() }
    }

    fn apply(&self, input: &[f32], used: &mut Vec<(usize, f32)>, output: &mut Vec<f32>) {
        // Written without a branch, because which inputs are zero cannot be guessed.
        used.resize(input.len(), (0, 0.0));
        let mut count = 0;
        for (index, &value) in input.iter().enumerate() {
            used[count] = (index, value);
            count += usize::from(value != 0.0);
        }
        output.clear();
        for block in &self.blocks {
            let mut sums = block.bias;
            for &(index, value) in &used[..count] {
                for (sum, weight) in sums.iter_mut().zip(&block.columns[index]) {
                    *sum += value * weight;
                }
            }
            output.extend_from_slice(&sums);
        }
        output.truncate(self.outputs);
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};

    use super::*;
    use crate::{ActorScratch, EnvironmentSpec, Normaliser, Stream};

    #[test]
    fn a_deployed_actor_acts_as_the_actor_does() {
        let mut rng = Stream::seed_from_u64(1);
        for (observation_len, hidden, action_len) in
            [(72, vec![128, 128], 2), (3, vec![5], 1), (40, vec![33, 64, 7], 3)]
        {
            let mut actor = Actor::new(EnvironmentSpec { observation_len, action_len }, &hidden, &mut rng);
            let mean = (0..observation_len).map(|_| rng.random_range(-1.0..1.0)).collect();
            let std = (0..observation_len).map(|_| rng.random_range(0.1..2.0)).collect();
            actor.set_normaliser(Normaliser::new(mean, std).expect("positive deviations"));
            let deployed = DeployedActor::new(&actor);
            let (mut scratch, mut deployed_scratch) = (ActorScratch::default(), DeployedScratch::default());
            for _ in 0..50 {
                let observation: Vec<f32> =
                    (0..observation_len).map(|_| rng.random_range(-2.0..2.0)).collect();
                let (mut expected, mut found) = (vec![0.0; action_len], vec![0.0; action_len]);
                actor.act_mean(&observation, &mut scratch, &mut expected);
                deployed.act(&observation, &mut deployed_scratch, &mut found);
                for (found, expected) in found.iter().zip(&expected) {
                    assert!((found - expected).abs() < 1e-5, "{found}, expected {expected}: {hidden:?}");
                }
            }
        }
    }

    #[test]
    fn nan_shows_in_the_action() {
        let spec = EnvironmentSpec { observation_len: 2, action_len: 1 };
        let actor = Actor::new(spec, &[8], &mut Stream::seed_from_u64(2));
        let mut action = [0.0];
        DeployedActor::new(&actor).act(&[f32::NAN, 0.0], &mut DeployedScratch::default(), &mut action);
        assert!(action[0].is_nan(), "{action:?}");
    }
}
