//! The prior as it is, to compare with: nothing to choose from and no training.

use super::{LearnFailure, LearningMonitor, LearningTask, LearntPolicy, OptionLearner};

/// Takes the prior at full caution.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PriorOnly;

impl OptionLearner for PriorOnly {
    fn learn(
        &self,
        task: &LearningTask<'_>,
        _monitor: &dyn LearningMonitor,
    ) -> Result<LearntPolicy, LearnFailure> {
        let robot = &task.world.robot;
        let policy = task.world.prior().policy(robot, &task.conditions.noise);
        let judged = task.judge(&policy);
        let estimate = task.estimate_alone(&policy, judged);
        Ok(LearntPolicy::untrained(policy, estimate))
    }
}
