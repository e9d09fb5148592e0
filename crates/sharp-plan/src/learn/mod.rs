//! How an option gets its policy (Algorithm 1, lines 11, 16 and 19).
//!
//! [`OptionLearner`] is the seam. Ours: [`PaperProtocol`] trains a network for every option, [`Selection`] takes
//! the cheapest of what is at hand and trains only where a plan falls short, [`PriorOnly`] takes the prior.

mod network;
mod options;
mod paper;
mod prior_only;
mod selection;
mod training;

use std::fmt::Debug;
use std::sync::Arc;

use sharp_drive::{
    Driver, Follower, InitialStates, MonteCarlo, OptionPolicy, SuccessCount, SuccessEstimate, World,
};
use sharp_guide::GuidedOption;
use sharp_rl::{Progress, TrainError};
use sharp_sim::RobotModel;
use sharp_space::Seed;

pub(crate) use options::{initial_states, learn_missing, task};
pub use paper::PaperProtocol;
pub use prior_only::PriorOnly;
pub use selection::Selection;
pub use training::{InterruptedTraining, Training, TrainingFile, TrainingPoint};

use crate::conditions::Conditions;
use crate::files::FileError;

/// Gives an option its policy. Implement [`learn`](Self::learn); improving is for those who can.
pub trait OptionLearner: Debug + Send + Sync {
    /// Learns a policy for the option of `task`; `monitor` may stop it.
    ///
    /// A policy that merely falls short is returned with its estimate: the search decides what it is worth.
    ///
    /// # Errors
    /// Says whether it was stopped or what broke.
    fn learn(
        &self,
        task: &LearningTask<'_>,
        monitor: &dyn LearningMonitor,
    ) -> Result<LearntPolicy, LearnFailure>;

    /// A policy for the option of `task` that succeeds more often than `beaten`, as
    /// [`judge`](LearningTask::judge) counts; `None` where there is none. It may train only if `may_train`.
    ///
    /// # Errors
    /// Says whether it was stopped or what broke.
    fn improve(
        &self,
        _task: &LearningTask<'_>,
        _beaten: SuccessCount,
        _may_train: bool,
        _monitor: &dyn LearningMonitor,
    ) -> Result<Option<LearntPolicy>, LearnFailure> {
        Ok(None)
    }

    /// A policy for the option of `task` that is at hand without an episode, where there is one: what drives the first and the
    /// last leg of a plan whose options are known already.
    fn at_hand(&self, _task: &LearningTask<'_>) -> Option<OptionPolicy> {
        None
    }

    /// Whether a follower may take the place of what is [`at_hand`](Self::at_hand) where that does poorly.
    fn has_stand_in(&self) -> bool {
        false
    }

    /// Success below which [`improve`](Self::improve) wants to train, share of episodes.
    fn train_below(&self) -> f64 {
        0.0
    }
}

/// A policy and what was measured of it.
#[derive(Clone, Debug)]
pub struct LearntPolicy {
    /// The policy.
    pub policy: OptionPolicy,
    /// What fresh episodes of the option alone showed.
    pub estimate: SuccessEstimate,
    /// Environment steps that learning took.
    pub env_steps: u64,
    /// Gradient steps that learning took.
    pub gradient_steps: u64,
    /// How it was trained, where it was.
    pub training: Option<Training>,
}

impl LearntPolicy {
    /// `policy` with its `estimate`, without any training.
    #[must_use]
    pub const fn untrained(policy: OptionPolicy, estimate: SuccessEstimate) -> Self {
        Self { policy, estimate, env_steps: 0, gradient_steps: 0, training: None }
    }

    /// Stands for an option that cannot be learnt: it never succeeds.
    pub(crate) fn useless(robot: &RobotModel) -> Self {
        let policy = OptionPolicy::Follower(Follower::cautious(robot));
        let count = SuccessCount { episodes: 1, successes: 0 };
        Self::untrained(policy, SuccessEstimate { count, mean_time_s: f64::INFINITY })
    }

    /// How many trainings of the option came to nothing in a row, this one included: 0 if it has a success, or was not trained.
    pub(crate) fn failed_trainings(&self) -> u32 {
        let SuccessCount { episodes, successes } = self.estimate.count;
        let failed = self.training.as_ref().filter(|_| episodes > 0 && successes == 0);
        failed.map_or(0, |training| training.failed_before + 1)
    }

    /// The cost that A* uses (line 17), seconds: mean time per success, and `failure_cost_s` for each failure.
    ///
    /// The paper takes the mean number of steps, which knows no failure: 0.
    #[must_use]
    pub fn cost_s(&self, failure_cost_s: f64) -> f64 {
        self.estimate.cost_s(failure_cost_s)
    }
}

/// Why an option has no policy.
#[derive(Debug)]
#[non_exhaustive]
pub enum LearnFailure {
    /// The caller asked to stop.
    Stopped,
    /// Something was wrong with the task: a NaN, an impossible observation.
    Broken(TrainError),
    /// A file of an interrupted training cannot be used.
    File(FileError),
}

/// Watches the learning of one option and may stop it. A closure only stops.
pub trait LearningMonitor: Sync {
    /// Asked often; true gives up.
    fn should_stop(&self) -> bool;
    /// A training took a step.
    fn trained(&self, _progress: &Progress<'_>) {}
    /// A training was evaluated; one that goes on tells its evaluations again.
    fn evaluated(&self, _point: &TrainingPoint) {}
    /// Where the training is kept while it runs, so that it can go on after a kill; `None` for nowhere.
    fn training_file(&self) -> Option<&TrainingFile> {
        None
    }
}

impl<F: Fn() -> bool + Sync> LearningMonitor for F {
    fn should_stop(&self) -> bool {
        self()
    }
}

/// One option to be learnt.
#[derive(Clone, Debug)]
pub struct LearningTask<'a> {
    /// Map and robot.
    pub world: &'a World,
    /// Simulator and noise.
    pub conditions: &'a Conditions,
    /// The option.
    pub option: &'a Arc<GuidedOption>,
    /// The option after it, where one is known: policies look ahead into its guide.
    pub next: Option<&'a Arc<GuidedOption>>,
    /// The options after it with their policies, where they are known: how a policy arrives matters to them. The
    /// first of them is `next`.
    pub tail: &'a [Driver<'a>],
    /// Where its episodes begin.
    pub states: Arc<InitialStates>,
    /// Success that is wanted, share of episodes.
    pub wanted_success: f64,
    /// What a failure costs, seconds.
    pub failure_cost_s: f64,
    /// Fresh episodes of an estimate, at least.
    pub estimate_episodes: u32,
    /// The root of the task's random streams.
    pub seed: Seed,
}

impl LearningTask<'_> {
    /// `episodes` on the streams named `purpose` and `index`.
    #[must_use]
    pub fn monte_carlo(&self, episodes: u32, purpose: &str, index: u64) -> MonteCarlo<'_> {
        let seed = self.seed.child(purpose, index);
        self.conditions.monte_carlo(self.world).with_episodes(episodes).with_seed(seed)
    }

    /// The option under `policy`, and what comes after it.
    #[must_use]
    pub fn drivers<'b>(&'b self, policy: &'b OptionPolicy) -> Vec<Driver<'b>> {
        let first = Driver::new(self.option, policy, self.next);
        std::iter::once(first).chain(self.tail.iter().cloned()).collect()
    }

    /// How often `policy` succeeds on the task's fresh episodes.
    #[must_use]
    pub fn estimate(&self, policy: &OptionPolicy) -> SuccessEstimate {
        let trial = self.monte_carlo(self.estimate_episodes, "certify", 0);
        trial.estimate(&self.drivers(policy)[..1], &self.states)
    }

    /// What `policy` is worth to the plan: how often it and the options after it succeed, on fresh episodes.
    #[must_use]
    pub fn judge(&self, policy: &OptionPolicy) -> SuccessEstimate {
        self.judge_while(policy, u32::MAX)
    }

    /// The same, but stops soon after more than `failures_max` failures.
    #[must_use]
    pub fn judge_while(&self, policy: &OptionPolicy, failures_max: u32) -> SuccessEstimate {
        let trial = self.monte_carlo(self.estimate_episodes, "certify", 0);
        trial.estimate_while(&self.drivers(policy), &self.states, failures_max)
    }

    /// The estimate of `policy` alone, where `judged` is what [`judge`](Self::judge) said of it.
    pub(crate) fn estimate_alone(&self, policy: &OptionPolicy, judged: SuccessEstimate) -> SuccessEstimate {
        if self.tail.is_empty() { judged } else { self.estimate(policy) }
    }
}
