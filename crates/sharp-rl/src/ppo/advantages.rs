//! The second phase: generalised advantage estimation (Schulman et al. 2016) for both heads of the critic.
//!
//! With the temporal difference δₜ = rₜ + γ V(sₜ₊₁) - V(sₜ) the advantage is Aₜ = δₜ + γ λ Aₜ₊₁, and Aₜ + V(sₜ) is
//! what the critic should have said. The head of failures has γ = 1 and a reward of 1 for a failure, so that its
//! value is the chance of one. Together: A = A₁ - C A₂, where C is the price of a failure.

use super::rollout::RolloutRows;
use super::settings::PpoSettings;
use crate::network::{Mlp, Tape};

/// Rows that the critic judges at once.
const ROWS: usize = 512;

/// What the rollout says about its actions and about the critic, one entry for each row.
#[derive(Debug, Default)]
pub(crate) struct Advantages {
    /// Of the actions, normalised.
    pub(crate) actions: Vec<f32>,
    /// What the critic should say: the discounted reward that follows, and the chance of a failure.
    pub(crate) targets: Vec<[f32; 2]>,
    /// What the critic said.
    values: Vec<[f32; 2]>,
    last_values: Vec<[f32; 2]>,
    cut_values: Vec<[f32; 2]>,
}

impl Advantages {
    /// Computes all of it for `rollout`; `progress` is the share of training that is done.
    pub(crate) fn estimate(
        &mut self,
        rollout: &RolloutRows,
        critic: &Mlp,
        settings: &PpoSettings,
        progress: f32,
    ) {
        let mut tape = Tape::new(critic.sizes(), ROWS);
        judge(critic, &rollout.inputs, &mut tape, &mut self.values);
        judge(critic, &rollout.last_inputs, &mut tape, &mut self.last_values);
        judge(critic, &rollout.cut_inputs, &mut tape, &mut self.cut_values);
        self.actions.clear();
        self.actions.resize(rollout.len(), 0.0);
        self.targets.clear();
        self.targets.resize(rollout.len(), [0.0; 2]);
        for slot in 0..rollout.spec.slots {
            self.estimate_slot(rollout, settings, slot, progress);
        }
        self.normalise(rollout, settings);
    }

    /// Goes through the steps of one slot, the last first.
    fn estimate_slot(&mut self, rollout: &RolloutRows, settings: &PpoSettings, slot: usize, progress: f32) {
        let discounts = [settings.gamma, 1.0];
        let mut next = self.last_values[slot];
        let mut advantage = [0.0_f32; 2];
        for row in (slot..rollout.len()).step_by(rollout.spec.slots).rev() {
            let (step, value) = (&rollout.steps[row], self.values[row]);
            if step.is_last() {
                // Nothing follows an end; what follows a cut is the critic's guess.
                next = rollout.cut_rows.binary_search(&row).map_or([0.0; 2], |cut| self.cut_values[cut]);
                advantage = [0.0; 2];
            }
            let rewards = [step.reward, f32::from(u8::from(step.failed))];
            for head in 0..2 {
                let difference = rewards[head] + discounts[head] * next[head] - value[head];
                advantage[head] = difference + discounts[head] * settings.lambda * advantage[head];
            }
            self.targets[row] = [advantage[0] + value[0], (advantage[1] + value[1]).clamp(0.0, 1.0)];
            let price = settings.failure_price.at(step.caution, progress);
            self.actions[row] = advantage[0] - price * advantage[1];
            next = value;
        }
    }

    /// Gives the advantages of each bin of caution mean 0 and deviation 1: what a failure costs differs by orders of
    /// magnitude, and the careful episodes would outvote the others.
    fn normalise(&mut self, rollout: &RolloutRows, settings: &PpoSettings) {
        let (bin_count, most) = (settings.caution_bins, settings.advantage_max);
        let bin_of = |caution: f32| ((caution * bin_count as f32) as usize).min(bin_count - 1);
        let mut sums = vec![(0.0_f64, 0.0_f64, 0.0_f64); bin_count];
        for (advantage, step) in self.actions.iter().zip(&rollout.steps) {
            let (count, sum, squares) = &mut sums[bin_of(step.caution)];
            *count += 1.0;
            *sum += f64::from(*advantage);
            *squares += f64::from(*advantage).powi(2);
        }
        let scales: Vec<(f32, f32)> = sums
            .into_iter()
            .map(|(count, sum, squares)| {
                let mean = sum / count.max(1.0);
                let variance = (squares / count.max(1.0) - mean * mean).max(0.0);
                (mean as f32, 1.0 / (variance.sqrt() as f32 + 1e-6))
            })
            .collect();
        for (advantage, step) in self.actions.iter_mut().zip(&rollout.steps) {
            let (mean, scale) = scales[bin_of(step.caution)];
            *advantage = ((*advantage - mean) * scale).clamp(-most, most);
        }
    }
}

/// What `critic` says about each row of `inputs`: the discounted reward, and the chance of a failure.
fn judge(critic: &Mlp, inputs: &[f32], tape: &mut Tape, values: &mut Vec<[f32; 2]>) {
    values.clear();
    let len = critic.sizes()[0];
    for rows in inputs.chunks(ROWS * len) {
        tape.resize(critic.sizes(), rows.len() / len);
        critic.forward(rows, tape);
        values.extend(tape.output().chunks_exact(2).map(|output| [output[0], sigmoid(output[1])]));
    }
}

/// 1 / (1 + e⁻ˣ).
pub(crate) fn sigmoid(x: f32) -> f32 {
    1.0 / (1.0 + (-x).exp())
}

#[cfg(test)]
mod tests {
    use super::super::batch::{BatchSpec, BatchStep};
    use super::*;
    use crate::environment::EnvironmentSpec;

    /// A critic that says `value` and a chance of one half everywhere.
    fn constant_critic(value: f32) -> Mlp {
        Mlp::from_parameters(&[1, 2], vec![0.0, 0.0, value, 0.0]).expect("a network")
    }

    /// One slot in which `steps` happened.
    fn rollout(steps: Vec<BatchStep>) -> RolloutRows {
        let lengths = EnvironmentSpec { observation_len: 1, action_len: 1 };
        let spec = BatchSpec { slots: 1, lengths, privileged_len: 0 };
        let cut_rows: Vec<usize> = (0..steps.len()).filter(|&i| steps[i].truncated).collect();
        RolloutRows {
            inputs: vec![0.0; steps.len()],
            last_inputs: vec![0.0],
            cut_inputs: vec![0.0; cut_rows.len()],
            cut_rows,
            steps,
            ..RolloutRows::new(spec)
        }
    }

    fn estimate(rollout: &RolloutRows, value: f32, lambda: f32) -> Advantages {
        let settings = PpoSettings::default().with(|s| {
            s.gamma = 0.5;
            s.lambda = lambda;
        });
        let mut advantages = Advantages::default();
        advantages.estimate(rollout, &constant_critic(value), &settings, 0.0);
        advantages
    }

    #[test]
    fn with_lambda_one_the_target_is_the_discounted_return() {
        let step = |reward| BatchStep { reward, ..BatchStep::default() };
        let end = BatchStep { terminated: true, ..step(4.0) };
        // The second episode goes on behind the rollout: the critic's 8 stands for what follows.
        let found = estimate(&rollout(vec![step(1.0), step(2.0), end, step(1.0)]), 8.0, 1.0);
        let seconds: Vec<f32> = found.targets.iter().map(|target| target[0]).collect();
        assert_eq!(seconds, [1.0 + 0.5 * (2.0 + 0.5 * 4.0), 2.0 + 0.5 * 4.0, 4.0, 1.0 + 0.5 * 8.0]);
    }

    #[test]
    fn a_cut_goes_on_and_an_end_does_not() {
        let cut = BatchStep { reward: 1.0, truncated: true, ..BatchStep::default() };
        let end = BatchStep { reward: 1.0, terminated: true, ..BatchStep::default() };
        let found = estimate(&rollout(vec![cut, end]), 6.0, 0.9);
        assert_eq!(found.targets[0], [1.0 + 0.5 * 6.0, 0.5], "bootstrapped, with the critic's chance");
        assert_eq!(found.targets[1], [1.0, 0.0], "over, and no failure");
    }

    #[test]
    fn a_failure_is_not_discounted() {
        let step = BatchStep::default();
        let failed = BatchStep { failed: true, ..step };
        let found = estimate(&rollout(vec![step, step, step, failed]), 0.0, 1.0);
        assert!(found.targets.iter().all(|target| target[1] == 1.0), "{:?}", found.targets);
    }

    #[test]
    fn advantages_are_normalised_within_their_bins() {
        let step = |reward: f32, caution: f32| BatchStep { reward, caution, ..BatchStep::default() };
        let steps = vec![step(1.0, 0.1), step(100.0, 0.9), step(3.0, 0.2), step(500.0, 0.8)];
        let settings = PpoSettings::default().with(|s| {
            (s.gamma, s.lambda, s.caution_bins) = (1e-6, 0.0, 2);
        });
        let mut found = Advantages::default();
        found.estimate(&rollout(steps), &constant_critic(0.0), &settings, 0.0);
        for (advantage, expected) in found.actions.iter().zip([-1.0, -1.0, 1.0, 1.0]) {
            assert!((advantage - expected).abs() < 1e-3, "{:?}", found.actions);
        }
    }
}
