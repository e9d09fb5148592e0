//! Passes of soft actor-critic written by hand, without allocation.
//!
//! Compared with plain autodiff, the actor's pass saves two things: it computes no weight gradients
//! of the critics, and each sample goes back only through the critic with the smaller value.

use crate::actor::{Actor, LOG_STD_MAX, LOG_STD_MIN, layer_sizes, log_density};
use crate::buffer::Batch;
use crate::environment::EnvironmentSpec;
use crate::gradients::{ActorLoss, CriticLoss, SacGradients};
use crate::network::{InputSeed, Tape};
use crate::sac_state::SacState;
use crate::settings::SacSettings;

/// [`SacGradients`] written by hand.
#[derive(Debug)]
pub(crate) struct FusedSac {
    spec: EnvironmentSpec,
    actor_tape: Tape,
    critic_tapes: [Tape; 2],
    /// Batch x (observation, action): the input of the critics.
    inputs: Vec<f32>,
    policy: PolicySample,
    /// Batch x action: derivatives of min Q with respect to the action.
    action_gradient: Vec<f32>,
    /// For each critic, the rows where its value is the smaller one.
    rows: [Vec<usize>; 2],
}

impl FusedSac {
    /// Buffers for batches and networks as `settings` describe them.
    pub(crate) fn new(spec: EnvironmentSpec, settings: &SacSettings) -> Self {
        let EnvironmentSpec { observation_len, action_len } = spec;
        let batch = settings.batch;
        let actor_sizes = layer_sizes(observation_len, &settings.hidden, 2 * action_len);
        let critic_sizes = layer_sizes(observation_len + action_len, &settings.hidden, 1);
        Self {
            spec,
            actor_tape: Tape::new(&actor_sizes, batch),
            critic_tapes: [Tape::new(&critic_sizes, batch), Tape::new(&critic_sizes, batch)],
            inputs: vec![0.0; batch * (observation_len + action_len)],
            policy: PolicySample {
                actions: vec![0.0; batch * action_len],
                log_probabilities: vec![0.0; batch],
            },
            action_gradient: vec![0.0; batch * action_len],
            rows: [Vec::with_capacity(batch), Vec::with_capacity(batch)],
        }
    }

    /// Draws actions at `observations` with the given noise and writes the input of the critics.
    fn sample_policy(&mut self, actor: &Actor, observations: &[f32], noise: &[f32]) {
        actor.network().forward(observations, &mut self.actor_tape);
        self.policy.draw(self.actor_tape.output(), noise, self.spec.action_len);
        join_rows(self.spec, observations, &self.policy.actions, &mut self.inputs);
    }
}

impl SacGradients for FusedSac {
    fn targets(&mut self, state: &SacState, batch: &Batch, targets: &mut [f32]) {
        self.sample_policy(&state.actor, &batch.next_observations, &batch.next_noise);
        for (critic, tape) in state.targets.iter().zip(&mut self.critic_tapes) {
            critic.forward(&self.inputs, tape);
        }
        let alpha = state.alpha();
        let [first, second] = self.critic_tapes.each_ref().map(Tape::output);
        for (row, target) in targets.iter_mut().enumerate() {
            let value = smaller(first[row], second[row]) - alpha * self.policy.log_probabilities[row];
            *target = batch.rewards[row] + batch.discounts[row] * value;
        }
    }

    fn critic_gradients(
        &mut self,
        state: &SacState,
        batch: &Batch,
        targets: &[f32],
        gradients: &mut [Vec<f32>; 2],
    ) -> CriticLoss {
        join_rows(self.spec, &batch.observations, &batch.actions, &mut self.inputs);
        let scale = 1.0 / batch.len as f32;
        let mut loss = 0.0;
        for ((critic, tape), gradient) in state.critics.iter().zip(&mut self.critic_tapes).zip(gradients) {
            critic.forward(&self.inputs, tape);
            let (output, delta) = tape.output_and_delta();
            for ((delta, q), y) in delta.iter_mut().zip(output).zip(targets) {
                *delta = scale * (q - y);
                loss += 0.5 * scale * (q - y) * (q - y);
            }
            critic.backward(&self.inputs, tape, gradient);
        }
        CriticLoss { loss, mean_q: scale * self.critic_tapes[0].output().iter().sum::<f32>() }
    }

    fn actor_gradient(&mut self, state: &SacState, batch: &Batch, gradient: &mut [f32]) -> ActorLoss {
        self.sample_policy(&state.actor, &batch.observations, &batch.noise);
        for (critic, tape) in state.critics.iter().zip(&mut self.critic_tapes) {
            critic.forward(&self.inputs, tape);
        }
        let (alpha, scale) = (state.alpha(), 1.0 / batch.len as f32);
        let sum_q = self.choose_rows();
        let EnvironmentSpec { observation_len, action_len } = self.spec;
        let seed = InputSeed { scale: 1.0, columns: observation_len..observation_len + action_len };
        for ((critic, tape), rows) in state.critics.iter().zip(&mut self.critic_tapes).zip(&self.rows) {
            critic.input_gradient(tape, rows, &seed, &mut self.action_gradient);
        }
        let (outputs, delta) = self.actor_tape.output_and_delta();
        let weights = LossWeights { alpha, scale };
        self.policy.back(outputs, &batch.noise, &self.action_gradient, weights, delta);
        state.actor.network().backward(&batch.observations, &mut self.actor_tape, gradient);
        let mean_log_probability = scale * self.policy.log_probabilities.iter().sum::<f32>();
        ActorLoss { loss: alpha * mean_log_probability - scale * sum_q, mean_log_probability }
    }
}

impl FusedSac {
    /// Sorts the rows by the critic with the smaller value; returns the sum of the smaller values.
    fn choose_rows(&mut self) -> f32 {
        let [first, second] = self.critic_tapes.each_ref().map(Tape::output);
        self.rows.iter_mut().for_each(Vec::clear);
        for (row, (a, b)) in first.iter().zip(second).enumerate() {
            self.rows[usize::from(b < a)].push(row);
        }
        first.iter().zip(second).map(|(a, b)| smaller(*a, *b)).sum()
    }
}

/// Actions drawn from the policy and their log densities, one row for each observation.
#[derive(Debug)]
struct PolicySample {
    /// Batch x action.
    actions: Vec<f32>,
    log_probabilities: Vec<f32>,
}

/// The factors of the actor's loss.
#[derive(Clone, Copy)]
struct LossWeights {
    alpha: f32,
    /// One over the batch.
    scale: f32,
}

impl PolicySample {
    /// a = tanh(μ + σ ε); `outputs` is batch x (means, log deviations).
    fn draw(&mut self, outputs: &[f32], noise: &[f32], len: usize) {
        let rows = outputs.chunks_exact(2 * len).zip(noise.chunks_exact(len));
        let results = self.actions.chunks_exact_mut(len).zip(&mut self.log_probabilities);
        for ((output, noise), (actions, log_probability)) in rows.zip(results) {
            let (means, log_stds) = output.split_at(len);
            *log_probability = 0.0;
            for (((action, mean), log_std), noise) in actions.iter_mut().zip(means).zip(log_stds).zip(noise) {
                let log_std = log_std.clamp(LOG_STD_MIN, LOG_STD_MAX);
                let u = mean + log_std.exp() * noise;
                *action = u.tanh();
                *log_probability += log_density(*noise, log_std, u);
            }
        }
    }

    /// Derivatives of the loss with respect to means and log deviations.
    ///
    /// With u = μ + σ ε and a = tanh u: ∂L/∂u = (2 α a - ∂Q/∂a (1 - a²)) / B, which is also
    /// ∂L/∂μ. ∂L/∂log σ = σ ε ∂L/∂u - α / B, and zero where log σ is clamped.
    fn back(&self, outputs: &[f32], noise: &[f32], dq: &[f32], weights: LossWeights, delta: &mut [f32]) {
        let LossWeights { alpha, scale } = weights;
        let len = self.actions.len() / self.log_probabilities.len();
        for (index, (&action, &noise)) in self.actions.iter().zip(noise).enumerate() {
            let mean_at = index / len * 2 * len + index % len;
            let log_std = outputs[mean_at + len];
            let du = scale * (2.0 * alpha * action - dq[index] * (1.0 - action * action));
            let free = (LOG_STD_MIN..=LOG_STD_MAX).contains(&log_std);
            delta[mean_at] = du;
            delta[mean_at + len] = if free { log_std.exp() * noise * du - alpha * scale } else { 0.0 };
        }
    }
}

/// The smaller number, or NaN if either is NaN. `f32::min` would hide a NaN.
fn smaller(a: f32, b: f32) -> f32 {
    if a < b || a.is_nan() { a } else { b }
}

/// Writes each observation followed by its action into a row of `inputs`.
fn join_rows(spec: EnvironmentSpec, observations: &[f32], actions: &[f32], inputs: &mut [f32]) {
    let rows = observations.chunks_exact(spec.observation_len).zip(actions.chunks_exact(spec.action_len));
    for (input, (observation, action)) in
        inputs.chunks_exact_mut(spec.observation_len + spec.action_len).zip(rows)
    {
        input[..spec.observation_len].copy_from_slice(observation);
        input[spec.observation_len..].copy_from_slice(action);
    }
}
