//! How good a policy is: episodes with its most likely actions, on streams of their own.

use rand::SeedableRng;
use serde::{Deserialize, Serialize};

use crate::actor::{Actor, ActorScratch};
use crate::environment::{Environment, Stream};
use crate::train::{EPISODE_LIMIT, TrainError, check_observation, check_reward};

/// The outcome of evaluation episodes.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Evaluation {
    /// Episodes run.
    pub episodes: usize,
    /// Episodes in which a step reported success.
    pub successes: usize,
    /// Mean undiscounted, unscaled return.
    pub mean_return: f64,
    /// Mean steps in an episode.
    pub mean_steps: f64,
    /// Environment steps of training behind the policy; 0 outside training.
    pub env_steps: u64,
    /// Gradient steps behind the policy; 0 outside training.
    pub updates: u64,
}

impl Evaluation {
    /// The share of successful episodes; 0 if there were none at all.
    #[must_use]
    pub fn success_rate(&self) -> f64 {
        if self.episodes == 0 { 0.0 } else { self.successes as f64 / self.episodes as f64 }
    }

    /// Both samples of the same policy as one.
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

    /// Returns true if this is the better policy: by success rate, then by mean return.
    #[must_use]
    pub fn beats(&self, other: &Self) -> bool {
        let key = |evaluation: &Self| (evaluation.success_rate(), evaluation.mean_return);
        key(self) > key(other)
    }
}

/// Runs `episodes` episodes of the deterministic policy, on the environments in turn.
///
/// Each episode has a stream of its own, forked from `rng`, so that none depends on the length of
/// the one before.
///
/// # Errors
/// If an observation or reward is not finite, or an episode does not end.
///
/// # Panics
/// If there are no environments or their spec is not the actor's.
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
    for index in 0..episodes {
        let mut stream = Stream::from_rng(rng);
        let place = index % count;
        let episode = run_episode(&mut environments[place], place, actor, &mut stream, &mut scratch)?;
        sum_return += episode.total;
        sum_steps += episode.steps;
        result.successes += usize::from(episode.success);
    }
    result.mean_return = sum_return / episodes.max(1) as f64;
    result.mean_steps = sum_steps as f64 / episodes.max(1) as f64;
    Ok(result)
}

/// Sums over one episode.
struct Episode {
    total: f64,
    steps: u64,
    success: bool,
}

fn run_episode<E: Environment>(
    environment: &mut E,
    index: usize,
    actor: &Actor,
    rng: &mut Stream,
    scratch: &mut ActorScratch,
) -> Result<Episode, TrainError> {
    let spec = environment.spec();
    assert_eq!(spec, actor.spec(), "lengths of environment {index} and of the actor");
    let (mut observation, mut action) = (vec![0.0; spec.observation_len], vec![0.0; spec.action_len]);
    environment.reset(rng, &mut observation);
    check_observation(&observation, index, 0)?;
    let mut episode = Episode { total: 0.0, steps: 0, success: false };
    loop {
        actor.act_mean(&observation, scratch, &mut action);
        let step = environment.step(&action, &mut observation);
        episode.steps += 1;
        check_reward(step.reward, index, episode.steps)?;
        check_observation(&observation, index, episode.steps)?;
        episode.total += f64::from(step.reward);
        episode.success |= step.success;
        if step.is_last() {
            return Ok(episode);
        }
        if episode.steps >= EPISODE_LIMIT {
            return Err(TrainError::Endless { environment: index, steps: episode.steps });
        }
    }
}
