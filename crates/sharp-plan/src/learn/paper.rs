//! The paper's protocol: every option is trained from nothing (Sec. 4.3 and 5).

use std::sync::Arc;

use sharp_drive::PolicyInterface;
use sharp_guide::PseudoReward;
use sharp_rl::TrainSettings;

use super::sac::{SacTraining, train_network};
use super::{LearnFailure, LearningMonitor, LearningTask, LearntPolicy, OptionLearner};

/// Soft actor-critic on absolute poses with the pseudo-reward of definition 9: at most 150,000 steps, an
/// evaluation of 20 episodes each 10,000, one environment.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct PaperProtocol {
    /// Budget and hyperparameters.
    pub train: TrainSettings,
}

impl OptionLearner for PaperProtocol {
    fn learn(
        &self,
        task: &LearningTask<'_>,
        monitor: &dyn LearningMonitor,
    ) -> Result<LearntPolicy, LearnFailure> {
        let training = SacTraining {
            interface: PolicyInterface::Absolute { reach_m: task.world.robot.waypoint_reach_m },
            reward: Arc::new(PseudoReward::default()),
            networks: None,
            settings: &self.train,
            environments: 1,
        };
        train_network(task, &training, monitor)
    }
}
