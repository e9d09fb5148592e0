//! Losses of proximal policy optimisation and their gradients on one minibatch.
//!
//! Actor, with the ratio ρ = π(a|s) / π′(a|s) to the policy π′ that collected, and the advantage A:
//! -mean min(ρ A, clip(ρ, 1 - ε, 1 + ε) A). The policy is normal around m = tanh μ(s) with a deviation σ that is given,
//! so log ρ = ((a - m′)² - (a - m)²) / 2σ² and ∂ρ/∂μ = ρ (a - m) / σ² (1 - m²). Critic: ½ mean (V - y)² for the reward,
//! and the cross-entropy of the chance of failure, whose derivative is p - y.

use super::advantages::{Advantages, sigmoid};
use super::rollout::RolloutRows;
use super::state::PpoState;
use crate::network::{Mlp, Tape};

/// Rows that go through the networks at once: their activations stay in the cache.
const ROWS: usize = 512;

/// What a minibatch showed; sums over rows.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct MinibatchSums {
    pub(crate) rows: f64,
    pub(crate) actor_loss: f64,
    pub(crate) value_loss: f64,
    pub(crate) failure_loss: f64,
    /// Divergence of the policy from the one that collected, nats.
    pub(crate) kl: f64,
    /// Rows on which the ratio was clipped.
    pub(crate) clipped: f64,
}

impl MinibatchSums {
    pub(crate) fn add(&mut self, other: &Self) {
        self.rows += other.rows;
        self.actor_loss += other.actor_loss;
        self.value_loss += other.value_loss;
        self.failure_loss += other.failure_loss;
        self.kl += other.kl;
        self.clipped += other.clipped;
    }
}

/// The policy that collected the rollout, and how far from it the ratio may go.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PolicyBounds {
    pub(crate) deviation: f32,
    pub(crate) clip: f32,
}

/// Gradients of both networks on a minibatch, and the buffers that they take.
#[derive(Debug)]
pub(crate) struct PpoGradients {
    /// Of the actor's parameters.
    pub(crate) actor: Vec<f32>,
    /// Of the critic's parameters.
    pub(crate) critic: Vec<f32>,
    actor_part: Vec<f32>,
    critic_part: Vec<f32>,
    actor_inputs: Vec<f32>,
    critic_inputs: Vec<f32>,
    actor_tape: Tape,
    critic_tape: Tape,
}

impl PpoGradients {
    pub(crate) fn new(state: &PpoState) -> Self {
        let actor = state.actor.network();
        let zeros = |network: &Mlp| vec![0.0; network.parameters().len()];
        Self {
            actor: zeros(actor),
            critic: zeros(&state.critic),
            actor_part: zeros(actor),
            critic_part: zeros(&state.critic),
            actor_inputs: Vec::new(),
            critic_inputs: Vec::new(),
            actor_tape: Tape::new(actor.sizes(), ROWS),
            critic_tape: Tape::new(state.critic.sizes(), ROWS),
        }
    }

    /// Writes the gradients of both losses on `rows` of the rollout.
    pub(crate) fn compute(
        &mut self,
        state: &PpoState,
        (rollout, advantages): (&RolloutRows, &Advantages),
        rows: &[usize],
        bounds: PolicyBounds,
    ) -> MinibatchSums {
        self.actor.fill(0.0);
        self.critic.fill(0.0);
        let mut sums = MinibatchSums { rows: rows.len() as f64, ..MinibatchSums::default() };
        let scale = 1.0 / rows.len() as f32;
        for part in rows.chunks(ROWS) {
            self.gather(rollout, part);
            self.actor_rows(state, (rollout, advantages), (part, scale), bounds, &mut sums);
            self.critic_rows(state, advantages, (part, scale), &mut sums);
        }
        sums
    }

    /// Copies the inputs of `rows` for both networks.
    fn gather(&mut self, rollout: &RolloutRows, rows: &[usize]) {
        let (critic_len, actor_len) = (rollout.spec.critic_len(), rollout.spec.lengths.observation_len);
        self.actor_inputs.clear();
        self.critic_inputs.clear();
        for &row in rows {
            let input = &rollout.inputs[row * critic_len..][..critic_len];
            self.actor_inputs.extend_from_slice(&input[..actor_len]);
            self.critic_inputs.extend_from_slice(input);
        }
    }

    fn actor_rows(
        &mut self,
        state: &PpoState,
        (rollout, advantages): (&RolloutRows, &Advantages),
        (rows, scale): (&[usize], f32),
        bounds: PolicyBounds,
        sums: &mut MinibatchSums,
    ) {
        let network = state.actor.network();
        self.actor_tape.resize(network.sizes(), rows.len());
        network.forward(&self.actor_inputs, &mut self.actor_tape);
        let len = rollout.spec.lengths.action_len;
        let (output, delta) = self.actor_tape.output_and_delta();
        let outputs = output.chunks_exact(2 * len).zip(delta.chunks_exact_mut(2 * len));
        for ((output, delta), &row) in outputs.zip(rows) {
            let at = row * len;
            let (actions, old) = (&rollout.actions[at..][..len], &rollout.means[at..][..len]);
            actor_row(&output[..len], (actions, old), (advantages.actions[row], scale), bounds, delta, sums);
        }
        network.backward(&self.actor_inputs, &mut self.actor_tape, &mut self.actor_part);
        add(&mut self.actor, &self.actor_part);
    }

    fn critic_rows(
        &mut self,
        state: &PpoState,
        advantages: &Advantages,
        (rows, scale): (&[usize], f32),
        sums: &mut MinibatchSums,
    ) {
        self.critic_tape.resize(state.critic.sizes(), rows.len());
        state.critic.forward(&self.critic_inputs, &mut self.critic_tape);
        let (output, delta) = self.critic_tape.output_and_delta();
        let outputs = output.chunks_exact(2).zip(delta.chunks_exact_mut(2));
        for ((output, delta), &row) in outputs.zip(rows) {
            let [value, chance] = advantages.targets[row];
            let miss = output[0] - value;
            delta[0] = scale * miss;
            delta[1] = scale * (sigmoid(output[1]) - chance);
            sums.value_loss += f64::from(0.5 * miss * miss);
            sums.failure_loss += f64::from(softplus(output[1]) - chance * output[1]);
        }
        state.critic.backward(&self.critic_inputs, &mut self.critic_tape, &mut self.critic_part);
        add(&mut self.critic, &self.critic_part);
    }
}

/// One row of the actor's loss: writes its derivative by the outputs (means, then deviations, which are given).
fn actor_row(
    outputs: &[f32],
    (actions, old_means): (&[f32], &[f32]),
    (advantage, scale): (f32, f32),
    PolicyBounds { deviation, clip }: PolicyBounds,
    delta: &mut [f32],
    sums: &mut MinibatchSums,
) {
    let precision = 1.0 / (deviation * deviation);
    let mut log_ratio = 0.0;
    for ((output, action), old) in outputs.iter().zip(actions).zip(old_means) {
        let mean = output.tanh();
        log_ratio += 0.5 * precision * ((action - old).powi(2) - (action - mean).powi(2));
        sums.kl += f64::from(0.5 * precision * (mean - old).powi(2));
    }
    // No policy of one iteration comes near this ratio; it keeps the loss finite.
    let ratio = log_ratio.min(20.0).exp();
    let clipped = ratio.clamp(1.0 - clip, 1.0 + clip);
    sums.actor_loss -= f64::from((ratio * advantage).min(clipped * advantage));
    // Where the clipped term is the smaller one it does not depend on the policy.
    let is_free = ratio * advantage <= clipped * advantage;
    sums.clipped += f64::from(u8::from(clipped != ratio));
    delta.fill(0.0);
    if is_free {
        for ((delta, output), action) in delta.iter_mut().zip(outputs).zip(actions) {
            let mean = output.tanh();
            *delta = -scale * advantage * ratio * (action - mean) * precision * (1.0 - mean * mean);
        }
    }
}

/// log(1 + eˣ).
fn softplus(x: f32) -> f32 {
    x.max(0.0) + (-x.abs()).exp().ln_1p()
}

fn add(to: &mut [f32], part: &[f32]) {
    for (to, part) in to.iter_mut().zip(part) {
        *to += part;
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::super::batch::{BatchSpec, BatchStep};
    use super::super::settings::PpoSettings;
    use super::*;
    use crate::environment::{EnvironmentSpec, Stream};

    const ROWS: usize = 24;

    fn ramp(len: usize, phase: f32) -> Vec<f32> {
        (0..len).map(|i| (i as f32 * 0.71 + phase).sin()).collect()
    }

    /// Networks with a rollout that another policy collected, and what it says about the actions.
    fn example() -> (PpoState, RolloutRows, Advantages) {
        let lengths = EnvironmentSpec { observation_len: 3, action_len: 2 };
        let spec = BatchSpec { slots: 1, lengths, privileged_len: 2 };
        let settings = PpoSettings::default().with(|s| s.hidden = vec![12, 12]);
        let mut state = PpoState::new(&spec, &settings, &mut Stream::seed_from_u64(1));
        let values = ramp(state.actor.parameters().len(), 0.3).iter().map(|v| 0.25 * v).collect::<Vec<_>>();
        state.actor.set_parameters(&values).expect("finite");
        let values = ramp(state.critic.parameters().len(), 0.9).iter().map(|v| 0.4 * v).collect::<Vec<_>>();
        state.critic.set_parameters(&values).expect("finite");
        let rollout = RolloutRows {
            inputs: ramp(ROWS * 5, 0.0),
            actions: ramp(ROWS * 2, 1.0),
            means: ramp(ROWS * 2, 1.1).iter().map(|v| 0.2 * v).collect(),
            steps: vec![BatchStep::default(); ROWS],
            ..RolloutRows::new(spec)
        };
        let mut advantages = Advantages::default();
        advantages.actions = ramp(ROWS, 2.0);
        advantages.targets = (0..ROWS).map(|i| [(i as f32).sin(), 0.5 + 0.5 * (i as f32).cos()]).collect();
        (state, rollout, advantages)
    }

    #[test]
    fn gradients_agree_with_finite_differences() {
        let (mut state, rollout, advantages) = example();
        let rows: Vec<usize> = (0..ROWS).rev().collect();
        let bounds = PolicyBounds { deviation: 0.9, clip: 0.2 };
        let mut gradients = PpoGradients::new(&state);
        let sums = gradients.compute(&state, (&rollout, &advantages), &rows, bounds);
        assert!(sums.clipped > 2.0 && sums.clipped < 20.0, "some ratios are clipped: {sums:?}");
        let analytic = (gradients.actor.clone(), gradients.critic.clone());
        let losses = |state: &PpoState, gradients: &mut PpoGradients| {
            let sums = gradients.compute(state, (&rollout, &advantages), &rows, bounds);
            [sums.actor_loss / sums.rows, (sums.value_loss + sums.failure_loss) / sums.rows]
        };
        for network in 0..2 {
            let gradient = if network == 0 { &analytic.0 } else { &analytic.1 };
            for index in (0..gradient.len()).step_by(5) {
                let mut shifted = |by: f32| {
                    let mlp = if network == 0 { state.actor.network_mut() } else { &mut state.critic };
                    mlp.parameters_mut()[index] += by;
                    losses(&state, &mut gradients)[network]
                };
                let (high, low) = (shifted(1e-3), shifted(-2e-3));
                shifted(1e-3);
                let numeric = (high - low) / 2e-3;
                let error = (f64::from(gradient[index]) - numeric).abs();
                let what = format!("network {network}, parameter {index}");
                assert!(error < 5e-2 * numeric.abs().max(0.05), "{what}: {} and {numeric}", gradient[index]);
            }
        }
    }

    #[test]
    fn the_gradient_does_not_depend_on_how_rows_are_cut() {
        let (state, rollout, advantages) = example();
        let bounds = PolicyBounds { deviation: 0.9, clip: 0.2 };
        let mut gradients = PpoGradients::new(&state);
        let rows: Vec<usize> = (0..ROWS).collect();
        gradients.compute(&state, (&rollout, &advantages), &rows, bounds);
        let whole = gradients.actor.clone();
        let mut halves = vec![0.0; whole.len()];
        for half in rows.chunks(ROWS / 2) {
            gradients.compute(&state, (&rollout, &advantages), half, bounds);
            add(&mut halves, &gradients.actor);
        }
        for (whole, halves) in whole.iter().zip(&halves) {
            assert!((whole - 0.5 * halves).abs() < 1e-4, "{whole} and {halves} / 2");
        }
    }
}
