//! What a learning algorithm is: environments and a budget in, a policy out.
//!
//! [`SacLearner`](crate::SacLearner) is soft actor-critic. Any other algorithm whose result is an
//! [`Actor`] can take its place: implement [`Learner`] and run it through
//! [`check_learner`](crate::conformance::check_learner).

use std::fmt;
use std::ops::ControlFlow;

use crate::actor::Actor;
use crate::environment::{Environment, Stream};
use crate::error::TrainError;
use crate::evaluation::Evaluation;
use crate::sac_state::SacState;
use crate::stop::{StopReason, StopRule};

/// A learning algorithm with its settings and its budget.
///
/// It searches the policy π that maximises the expected (discounted) return
/// E\[Σ γᵗ r(sₜ, aₜ)\] over the episodes of the environments (Algorithm 1, line 16).
pub trait Learner: fmt::Debug + Send + Sync {
    /// Learns one policy for all of `environments` together.
    ///
    /// The environments have equal specs; each runs episodes of its own, so an algorithm may step
    /// them one after the other or as a batch. It may leave them anywhere in an episode. Evaluation
    /// runs on copies (`environments.to_vec()`).
    ///
    /// * All randomness comes from `rng`: equal streams give equal weights, bit for bit.
    /// * `observer` is called regularly, at least once every few thousand environment steps. When it
    ///   breaks, learning ends without another call. The best policy so far is returned, with
    ///   [`StopReason::Observer`].
    /// * The budget (environment steps) belongs to the algorithm's settings.
    ///
    /// # Errors
    /// If there are no environments, if their specs differ, if an observation or a reward is not
    /// finite, if an episode does not end, if the settings are out of range, or if learning
    /// diverges. None of these panics.
    fn learn(
        &self,
        environments: &mut [Box<dyn Environment>],
        rng: &mut Stream,
        observer: &mut Observer<'_>,
    ) -> Result<Trained, TrainError>;

    /// Continues the run that wrote `checkpoint` ([`Progress::checkpoint`]) on the environments of that run, bit for bit as
    /// if it had not been interrupted. `None` if these bytes are not of this algorithm, or if it cannot continue.
    ///
    /// # Errors
    /// As [`learn`](Self::learn), and if the environments or settings are not those of the run.
    fn resume(
        &self,
        _checkpoint: &[u8],
        _environments: &mut [Box<dyn Environment>],
        _observer: &mut Observer<'_>,
    ) -> Option<Result<Trained, TrainError>> {
        None
    }
}

/// Sees the progress of training. Breaking ends training.
pub type Observer<'a> = dyn FnMut(&Progress<'_>) -> ControlFlow<()> + 'a;

/// The result of learning: the best policy that was evaluated, not the last.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Trained {
    /// The best policy.
    pub actor: Actor,
    /// How the best policy did.
    pub evaluation: Evaluation,
    /// Why training ended.
    pub stop: StopReason,
    /// Environment steps of training, all environments together. Evaluation is not counted.
    pub env_steps: u64,
    /// Gradient steps, or what the algorithm has in their place.
    pub updates: u64,
    /// Episodes finished in training.
    pub episodes: u64,
    /// Critics and optimisers of soft actor-critic around `actor`, for fine-tuning; `None` from
    /// other algorithms.
    pub sac: Option<SacState>,
}

impl Trained {
    /// A result after `env_steps` steps, with its other counters at zero and without networks for
    /// fine-tuning.
    #[must_use]
    pub const fn new(actor: Actor, evaluation: Evaluation, stop: StopReason, env_steps: u64) -> Self {
        Self { actor, evaluation, stop, env_steps, updates: 0, episodes: 0, sac: None }
    }
}

/// What the observer sees of a training run.
///
/// A learner builds it with [`Progress::new`] and fills in what it knows.
#[derive(Clone, Copy)]
#[non_exhaustive]
pub struct Progress<'a> {
    /// The policy as it is now.
    pub actor: &'a Actor,
    /// Environment steps so far, all environments together. Evaluation is not counted.
    pub env_steps: u64,
    /// Environment steps after which the networks that learn now began; above 0 where the learner gave up and began anew.
    pub began_at: u64,
    /// Gradient steps so far, or what the algorithm has in their place.
    pub updates: u64,
    /// Training episodes finished so far.
    pub episodes: u64,
    /// The evaluation since the last call, if there was one.
    pub evaluation: Option<Evaluation>,
    /// Mean return of recent training episodes; 0 before the first.
    pub recent_return: f64,
    /// Success rate of recent training episodes; 0 before the first.
    pub recent_success_rate: f64,
    /// Mean number of steps of recent training episodes; 0 before the first.
    pub recent_steps: f64,
    /// Numbers that only this algorithm has, by name: losses, temperature, learning rate.
    ///
    /// Names are those of Stable-Baselines3 without `train/`. Empty before the first update.
    pub metrics: &'a [(&'static str, f64)],
    /// Environment steps after which training ends; `None` if there is no such budget.
    pub max_env_steps: Option<u64>,
    /// The rule that ends it earlier; `None` if there is none, or one that has no name here.
    pub stop: Option<StopRule>,
    pub(crate) checkpoint: Option<&'a dyn Fn() -> Vec<u8>>,
}

impl<'a> Progress<'a> {
    /// The progress of a run that has `actor` after `env_steps` steps, and nothing else to report.
    #[must_use]
    pub const fn new(actor: &'a Actor, env_steps: u64) -> Self {
        Self {
            actor,
            env_steps,
            began_at: 0,
            updates: 0,
            episodes: 0,
            evaluation: None,
            recent_return: 0.0,
            recent_success_rate: 0.0,
            recent_steps: 0.0,
            metrics: &[],
            max_env_steps: None,
            stop: None,
            checkpoint: None,
        }
    }

    /// The same with a function that writes all that is needed to continue the run.
    #[must_use]
    pub const fn with_checkpoint(mut self, checkpoint: &'a dyn Fn() -> Vec<u8>) -> Self {
        self.checkpoint = Some(checkpoint);
        self
    }

    /// The bytes from which the same algorithm continues this run; `None` if it cannot.
    ///
    /// Those of soft actor-critic are read by [`TrainState::from_bytes`](crate::TrainState::from_bytes).
    #[must_use]
    pub fn checkpoint(&self) -> Option<Vec<u8>> {
        self.checkpoint.map(|write| write())
    }
}

impl fmt::Debug for Progress<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Progress")
            .field("env_steps", &self.env_steps)
            .field("updates", &self.updates)
            .field("episodes", &self.episodes)
            .field("evaluation", &self.evaluation)
            .field("recent_return", &self.recent_return)
            .field("recent_success_rate", &self.recent_success_rate)
            .field("recent_steps", &self.recent_steps)
            .field("metrics", &self.metrics)
            .finish_non_exhaustive()
    }
}
