//! How good a policy is: episodes of its deterministic form, each on a stream of its own.

use rand::SeedableRng;
use serde::{Deserialize, Serialize};

use crate::actor::{Actor, ActorScratch};
use crate::environment::{Environment, Step, Stream};
use crate::error::{TrainError, check_observation, check_reward};

/// Steps after which an episode counts as endless: a time limit is the environment's duty.
pub(crate) const EPISODE_LIMIT: u64 = 1_000_000;

/// The result of evaluation episodes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Evaluation {
    /// Episodes run.
    pub episodes: usize,
    /// Episodes in which a step reported success.
    pub successes: usize,
    /// Mean return over the episodes, neither discounted nor scaled.
    pub mean_return: f64,
    /// Mean steps in an episode.
    pub mean_steps: f64,
    /// Environment steps of training behind the policy; 0 outside training.
    pub env_steps: u64,
    /// Gradient steps behind the policy; 0 outside training.
    pub updates: u64,
}

impl Evaluation {
    /// The share of successful episodes, 0 to 1; 0 if there were no episodes.
    #[must_use]
    pub fn success_rate(&self) -> f64 {
        if self.episodes == 0 { 0.0 } else { self.successes as f64 / self.episodes as f64 }
    }

    /// Environment steps of the evaluation itself, all episodes together.
    #[must_use]
    pub fn steps(&self) -> u64 {
        (self.mean_steps * self.episodes as f64).round() as u64
    }

    /// This evaluation and `other`, of the same policy, as one.
    #[must_use]
    pub fn pooled(&self, other: &Self) -> Self {
        let episodes = self.episodes + other.episodes;
        let share = |own: f64, others: f64| {
            (own * self.episodes as f64 + others * other.episodes as f64) / episodes.max(1) as f64
        };
        Self {
            episodes,
            successes: self.successes + other.successes,
            mean_return: share(self.mean_return, other.mean_return),
            mean_steps: share(self.mean_steps, other.mean_steps),
            ..*self
        }
    }

    /// Returns true if this policy is better than `other`: by success rate, then by mean return.
    #[must_use]
    pub fn beats(&self, other: &Self) -> bool {
        let key = |evaluation: &Self| (evaluation.success_rate(), evaluation.mean_return);
        key(self) > key(other)
    }
}

/// Runs `episodes` episodes of the deterministic policy, on the environments in turn.
///
/// Each episode has a stream of its own, forked from `rng`. So no episode depends on the length of
/// the one before.
///
/// # Errors
/// If an observation or a reward is not finite, or if an episode does not end.
///
/// # Panics
/// If there are no environments, or if their spec is not the actor's.
pub fn evaluate<E: Environment>(
    environments: &mut [E],
    actor: &Actor,
    episodes: usize,
    rng: &mut Stream,
) -> Result<Evaluation, TrainError> {
    assert!(!environments.is_empty(), "evaluation without environments");
    let count = environments.len();
    let mut result = Evaluation { episodes, ..Evaluation::default() };
    let (mut sum_return, mut sum_steps) = (0.0, 0_u64);
    let mut scratch = ActorScratch::default();
    for episode in 0..episodes {
        let mut stream = Stream::from_rng(rng);
        let index = episode % count;
        let sums = run_episode(&mut environments[index], index, actor, &mut stream, &mut scratch)?;
        sum_return += sums.total;
        sum_steps += sums.steps;
        result.successes += usize::from(sums.success);
    }
    result.mean_return = sum_return / episodes.max(1) as f64;
    result.mean_steps = sum_steps as f64 / episodes.max(1) as f64;
    Ok(result)
}

/// Sums over one episode.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct EpisodeSums {
    pub(crate) steps: u64,
    /// The return, neither discounted nor scaled.
    pub(crate) total: f64,
    /// A step reported success.
    pub(crate) success: bool,
}

impl EpisodeSums {
    pub(crate) fn add(&mut self, step: Step) {
        self.steps += 1;
        self.total += f64::from(step.reward);
        self.success |= step.success;
    }
}

/// Runs one episode; errors name the environment by its `index`.
fn run_episode<E: Environment>(
    environment: &mut E,
    index: usize,
    actor: &Actor,
    rng: &mut Stream,
    scratch: &mut ActorScratch,
) -> Result<EpisodeSums, TrainError> {
    let spec = environment.spec();
    assert_eq!(spec, actor.spec(), "lengths of environment {index} and of the actor");
    let (mut observation, mut action) = (vec![0.0; spec.observation_len], vec![0.0; spec.action_len]);
    environment.reset(rng, &mut observation);
    check_observation(&observation, index, 0)?;
    let mut sums = EpisodeSums::default();
    loop {
        actor.act_mean(&observation, scratch, &mut action);
        let step = environment.step(&action, &mut observation);
        sums.add(step);
        check_reward(step.reward, index, sums.steps)?;
        check_observation(&observation, index, sums.steps)?;
        if step.is_last() {
            return Ok(sums);
        }
        if sums.steps >= EPISODE_LIMIT {
            return Err(TrainError::Endless { environment: index, steps: sums.steps });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::environment::EnvironmentSpec;
    use crate::toy::Identity;

    fn evaluation(episodes: usize, successes: usize, mean_return: f64) -> Evaluation {
        Evaluation { episodes, successes, mean_return, mean_steps: 4.0, ..Evaluation::default() }
    }

    #[test]
    fn two_samples_are_weighted_by_their_episodes() {
        let pooled = evaluation(10, 5, 1.0).pooled(&evaluation(30, 30, 5.0));
        assert_eq!((pooled.episodes, pooled.successes, pooled.mean_return), (40, 35, 4.0));
        assert_eq!(pooled.steps(), 160);
    }

    #[test]
    fn success_counts_before_return() {
        assert!(evaluation(10, 6, 0.0).beats(&evaluation(10, 5, 9.0)), "more successes");
        assert!(evaluation(10, 5, 1.0).beats(&evaluation(10, 5, 0.0)), "a higher return");
        assert!(!evaluation(10, 5, 1.0).beats(&evaluation(10, 5, 1.0)), "equal");
    }

    #[test]
    fn equal_streams_give_equal_evaluations() {
        let spec = EnvironmentSpec { observation_len: 2, action_len: 2 };
        let actor = Actor::new(spec, &[8], &mut Stream::seed_from_u64(1));
        let run = |seed| {
            let mut environments = [Identity::new(2), Identity::new(2)];
            evaluate(&mut environments, &actor, 5, &mut Stream::seed_from_u64(seed)).expect("evaluates")
        };
        assert_eq!(run(1), run(1));
        assert_ne!(run(1), run(2));
        assert_eq!(run(1).steps(), 50, "five episodes of ten steps");
    }
}
