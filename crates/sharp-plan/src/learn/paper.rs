//! The paper's protocol: every option is trained from nothing (Sec. 4.3 and 5).

use std::sync::Arc;

use sharp_drive::PolicyInterface;
use sharp_guide::{PseudoReward, Reward};
use sharp_rl::{Learner, SacLearner, TrainSettings};

use super::network::{NetworkTraining, train_network};
use super::{LearnFailure, LearningMonitor, LearningTask, LearntPolicy, OptionLearner};

/// Soft actor-critic on absolute poses with the pseudo-reward of definition 9: at most 150,000 steps, an
/// evaluation of 20 episodes each 10,000, one environment.
#[derive(Clone, Debug)]
pub struct PaperProtocol {
    /// The learner.
    pub learner: Arc<dyn Learner>,
    /// What it is paid.
    pub reward: Arc<dyn Reward>,
    /// Whether an episode in which the robot stands still is out of time; false is the paper's rule.
    pub ends_at_standstill: bool,
}

impl PaperProtocol {
    /// Soft actor-critic with these settings.
    #[must_use]
    pub fn new(settings: TrainSettings) -> Self {
        Self {
            learner: Arc::new(SacLearner::new(settings)),
            reward: Arc::new(PseudoReward::default()),
            ends_at_standstill: false,
        }
    }

    /// The same with another learner.
    #[must_use]
    pub fn with_learner(self, learner: Arc<dyn Learner>) -> Self {
        Self { learner, ..self }
    }

    /// The same, but an episode in which the robot stands still is out of time.
    #[must_use]
    pub fn ending_at_standstill(self) -> Self {
        Self { ends_at_standstill: true, ..self }
    }

    /// The same with another reward.
    #[must_use]
    pub fn with_reward(self, reward: Arc<dyn Reward>) -> Self {
        Self { reward, ..self }
    }
}

impl Default for PaperProtocol {
    fn default() -> Self {
        Self::new(TrainSettings::paper())
    }
}

impl OptionLearner for PaperProtocol {
    fn learn(
        &self,
        task: &LearningTask<'_>,
        monitor: &dyn LearningMonitor,
    ) -> Result<LearntPolicy, LearnFailure> {
        let training = NetworkTraining {
            interface: PolicyInterface::Absolute { reach_m: task.world.robot.waypoint_reach_m },
            reward: Arc::clone(&self.reward),
            learner: &*self.learner,
            ends_at_standstill: self.ends_at_standstill,
            environments: 1,
        };
        train_network(task, &training, monitor)
    }
}
