//! n-step returns: sums rewards over several steps of one episode before a transition is stored.

use crate::buffer::ReplayTransition;
use crate::environment::{EnvironmentSpec, Step};

/// The last steps of one episode, not yet stored.
#[derive(Clone, Debug, PartialEq)]
pub struct NStep {
    spec: EnvironmentSpec,
    steps: usize,
    gamma: f32,
    observations: Vec<f32>,
    actions: Vec<f32>,
    rewards: Vec<f32>,
}

impl NStep {
    /// A window of `steps` steps discounted by `gamma`.
    ///
    /// # Panics
    /// If `steps` is not 1 to 255.
    #[must_use]
    pub fn new(spec: EnvironmentSpec, steps: usize, gamma: f32) -> Self {
        assert!((1..=255).contains(&steps), "an n-step return over {steps} steps");
        Self { spec, steps, gamma, observations: Vec::new(), actions: Vec::new(), rewards: Vec::new() }
    }

    /// Records the `step` that `action` made from `observation` to `next_observation`.
    ///
    /// `store` receives the transition that is now complete. At the end of an episode it receives the
    /// shorter ones as well.
    pub fn push(
        &mut self,
        observation: &[f32],
        action: &[f32],
        step: Step,
        next_observation: &[f32],
        mut store: impl FnMut(ReplayTransition<'_>),
    ) {
        self.observations.extend_from_slice(observation);
        self.actions.extend_from_slice(action);
        self.rewards.push(step.reward);
        while self.rewards.len() == self.steps || (step.is_last() && !self.rewards.is_empty()) {
            store(ReplayTransition {
                observation: &self.observations[..self.spec.observation_len],
                action: &self.actions[..self.spec.action_len],
                reward: self.rewards.iter().rev().fold(0.0, |sum, reward| reward + self.gamma * sum),
                steps: self.rewards.len() as u8,
                next_observation,
                terminated: step.terminated,
                truncated: step.truncated,
            });
            self.observations.drain(..self.spec.observation_len);
            self.actions.drain(..self.spec.action_len);
            self.rewards.remove(0);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPEC: EnvironmentSpec = EnvironmentSpec { observation_len: 1, action_len: 1 };

    /// Feeds the rewards 1, 2, 4, ... and lists (first observation, return, steps, next).
    fn returns(steps: usize, episode_len: usize, last: Step) -> Vec<(f32, f32, u8, f32)> {
        let mut window = NStep::new(SPEC, steps, 0.5);
        let mut stored = Vec::new();
        for i in 0..episode_len {
            let end = if i + 1 == episode_len { last } else { Step::default() };
            let step = Step { reward: 2.0_f32.powi(i as i32), ..end };
            window.push(&[i as f32], &[0.0], step, &[i as f32 + 1.0], |t| {
                assert_eq!(t.terminated, last.terminated && t.next_observation[0] == episode_len as f32);
                stored.push((t.observation[0], t.reward, t.steps, t.next_observation[0]));
            });
        }
        stored
    }

    #[test]
    fn a_window_of_one_step_stores_every_step() {
        let stored = returns(1, 3, Step::default());
        assert_eq!(stored, [(0.0, 1.0, 1, 1.0), (1.0, 2.0, 1, 2.0), (2.0, 4.0, 1, 3.0)]);
    }

    #[test]
    fn windows_of_three_steps_shorten_at_the_end() {
        // With γ = ½ and doubling rewards, every further step adds the first reward once more.
        let expected = [(0.0, 3.0, 3, 3.0), (1.0, 6.0, 3, 4.0), (2.0, 8.0, 2, 4.0), (3.0, 8.0, 1, 4.0)];
        for last in
            [Step { terminated: true, ..Step::default() }, Step { truncated: true, ..Step::default() }]
        {
            assert_eq!(returns(3, 4, last), expected, "{last:?}");
        }
    }

    #[test]
    fn the_last_steps_of_an_unfinished_episode_are_not_stored() {
        assert_eq!(returns(3, 4, Step::default()), [(0.0, 3.0, 3, 3.0), (1.0, 6.0, 3, 4.0)]);
    }

    #[test]
    fn an_episode_shorter_than_the_window_is_stored_whole() {
        let last = Step { terminated: true, ..Step::default() };
        assert_eq!(returns(5, 2, last), [(0.0, 2.0, 2, 2.0), (1.0, 2.0, 1, 2.0)]);
    }
}
