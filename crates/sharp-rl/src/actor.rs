//! The policy: a diagonal Gaussian squashed by tanh, over actions in \[-1, 1\].

use std::f32::consts::{LN_2, TAU};

use rand::RngExt;
use rand_distr::StandardNormal;
use thiserror::Error;

use crate::environment::{EnvironmentSpec, Stream};
use crate::network::{Mlp, NetworkError, Scratch};
use crate::normaliser::Normaliser;

/// Bounds of the logarithm of a standard deviation (Stable-Baselines3).
pub(crate) const LOG_STD_MIN: f32 = -20.0;
pub(crate) const LOG_STD_MAX: f32 = 2.0;

/// A policy ready for use: a network and the normaliser of its observations.
#[derive(Clone, Debug, PartialEq)]
pub struct Actor {
    network: Mlp,
    normaliser: Normaliser,
}

/// Why a network and a normaliser do not make an actor.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
#[error(
    "network sizes {sizes:?} do not fit a normaliser of {normaliser_len} components and pairs of outputs"
)]
pub struct ActorError {
    /// Layer sizes of the network.
    pub sizes: Vec<usize>,
    /// Components of the normaliser.
    pub normaliser_len: usize,
}

impl Actor {
    /// A fresh actor with `ReLU` layers of the widths `hidden`.
    ///
    /// # Panics
    /// If a width is zero.
    #[must_use]
    pub fn new(spec: EnvironmentSpec, hidden: &[usize], rng: &mut Stream) -> Self {
        let sizes = layer_sizes(spec.observation_len, hidden, 2 * spec.action_len);
        Self { network: Mlp::new(&sizes, rng), normaliser: Normaliser::identity(spec.observation_len) }
    }

    /// An actor from its parts. The network's outputs are the means, then the log deviations.
    ///
    /// # Errors
    /// If the lengths do not fit each other.
    pub fn from_parts(network: Mlp, normaliser: Normaliser) -> Result<Self, ActorError> {
        let sizes = network.sizes();
        let outputs = sizes[sizes.len() - 1];
        if sizes[0] != normaliser.mean().len() || !outputs.is_multiple_of(2) {
            return Err(ActorError { sizes: sizes.to_vec(), normaliser_len: normaliser.mean().len() });
        }
        Ok(Self { network, normaliser })
    }

    /// The lengths of observations and actions.
    #[must_use]
    pub fn spec(&self) -> EnvironmentSpec {
        let sizes = self.network.sizes();
        EnvironmentSpec { observation_len: sizes[0], action_len: sizes[sizes.len() - 1] / 2 }
    }

    /// All weights and biases of the network, in one vector (see [`Mlp::parameters`]).
    #[must_use]
    pub fn parameters(&self) -> &[f32] {
        self.network.parameters()
    }

    /// Replaces all weights and biases of the network.
    ///
    /// # Errors
    /// If there are more or fewer than [`Self::parameters`] has, or if one is not finite.
    pub fn set_parameters(&mut self, parameters: &[f32]) -> Result<(), NetworkError> {
        self.network.set_parameters(parameters)
    }

    /// The network behind the policy.
    #[must_use]
    pub const fn network(&self) -> &Mlp {
        &self.network
    }

    /// The network behind the policy, for training.
    pub const fn network_mut(&mut self) -> &mut Mlp {
        &mut self.network
    }

    /// The scaling of observations before the network.
    #[must_use]
    pub const fn normaliser(&self) -> &Normaliser {
        &self.normaliser
    }

    /// Replaces the normaliser.
    ///
    /// # Panics
    /// If it has another length.
    pub fn set_normaliser(&mut self, normaliser: Normaliser) {
        assert_eq!(normaliser.mean().len(), self.normaliser.mean().len(), "length of the normaliser");
        self.normaliser = normaliser;
    }

    /// Writes tanh of the mean, the action of the deployed, deterministic policy.
    ///
    /// # Panics
    /// If `observation` or `action` has another length than [`Self::spec`].
    pub fn act_mean(&self, observation: &[f32], scratch: &mut ActorScratch, action: &mut [f32]) {
        let outputs = self.outputs(observation, scratch, action.len());
        for (action, mean) in action.iter_mut().zip(outputs) {
            *action = mean.tanh();
        }
    }

    /// Draws an action from the policy, as training does.
    ///
    /// # Panics
    /// If `observation` or `action` has another length than [`Self::spec`].
    pub fn act_sample(
        &self,
        observation: &[f32],
        rng: &mut Stream,
        scratch: &mut ActorScratch,
        action: &mut [f32],
    ) {
        let (means, log_stds) = self.outputs(observation, scratch, action.len()).split_at(action.len());
        for ((action, mean), log_std) in action.iter_mut().zip(means).zip(log_stds) {
            let noise: f32 = rng.sample(StandardNormal);
            *action = (mean + log_std.clamp(LOG_STD_MIN, LOG_STD_MAX).exp() * noise).tanh();
        }
    }

    /// Means, then log deviations.
    fn outputs<'a>(
        &self,
        observation: &[f32],
        scratch: &'a mut ActorScratch,
        action_len: usize,
    ) -> &'a [f32] {
        assert_eq!(2 * action_len, self.network.sizes()[self.network.layer_count()], "length of the action");
        scratch.observation.clear();
        scratch.observation.extend_from_slice(observation);
        self.normaliser.apply(&mut scratch.observation);
        self.network.predict(&scratch.observation, &mut scratch.network)
    }
}

/// Buffers that decisions reuse.
#[derive(Clone, Debug, Default)]
pub struct ActorScratch {
    observation: Vec<f32>,
    network: Scratch,
}

/// Log density of one component at `u`, its value before tanh.
///
/// It is the Gaussian's log density minus log(1 - tanh² u), the change of variables. The latter is
/// written as 2 (ln 2 - u - softplus(-2u)), which is exact even where tanh² u rounds to 1.
pub(crate) fn log_density(noise: f32, log_std: f32, u: f32) -> f32 {
    let softplus = (-2.0 * u).max(0.0) + (-2.0 * u.abs()).exp().ln_1p();
    -0.5 * (noise * noise + TAU.ln()) - log_std - 2.0 * (LN_2 - u - softplus)
}

/// Layer sizes from input to output.
pub(crate) fn layer_sizes(inputs: usize, hidden: &[usize], outputs: usize) -> Vec<usize> {
    let mut sizes = vec![inputs];
    sizes.extend_from_slice(hidden);
    sizes.push(outputs);
    sizes
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    #[test]
    fn the_squashed_density_integrates_to_one() {
        // Over actions: p(a) = p(u) / (1 - a²), so the sum runs over a on a fine grid.
        for (mean, log_std) in [(0.0_f32, 0.0_f32), (0.8, -1.0), (-1.5, -0.5)] {
            let cells = 20_000;
            let total: f64 = (0..cells)
                .map(|cell| {
                    let u = (-1.0 + 2.0 * (cell as f64 + 0.5) / f64::from(cells)).atanh() as f32;
                    let noise = (u - mean) / log_std.exp();
                    f64::from(log_density(noise, log_std, u).exp()) * 2.0 / f64::from(cells)
                })
                .sum();
            assert!((total - 1.0).abs() < 2e-3, "mean {mean}, log deviation {log_std}: {total}");
        }
    }

    #[test]
    fn the_density_stays_finite_where_tanh_is_one() {
        for u in [-50.0, 50.0] {
            assert!(log_density(0.0, 0.0, u).is_finite(), "at {u}");
        }
    }

    #[test]
    fn half_of_the_samples_lie_above_the_mean() {
        let spec = EnvironmentSpec { observation_len: 3, action_len: 2 };
        let mut rng = Stream::seed_from_u64(1);
        let actor = Actor::new(spec, &[16], &mut rng);
        let mut scratch = ActorScratch::default();
        let (mut mean, mut action, mut above) = ([0.0; 2], [0.0; 2], 0);
        actor.act_mean(&[0.1, 0.2, 0.3], &mut scratch, &mut mean);
        for _ in 0..1000 {
            actor.act_sample(&[0.1, 0.2, 0.3], &mut rng, &mut scratch, &mut action);
            assert!(action.iter().all(|a| a.abs() <= 1.0), "{action:?} within bounds");
            above += usize::from(action[0] > mean[0]);
        }
        assert!((430..570).contains(&above), "{above} of 1000 above the median");
    }
}
