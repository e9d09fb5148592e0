//! The prior as it is, to compare with: nothing to choose from and no training.

use sharp_drive::OptionPolicy;

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
        let policy = prior(task);
        let judged = task.judge(&policy);
        let estimate = task.estimate_alone(&policy, judged);
        Ok(LearntPolicy::untrained(policy, estimate))
    }

    fn at_hand(&self, task: &LearningTask<'_>) -> Option<OptionPolicy> {
        Some(prior(task))
    }
}

fn prior(task: &LearningTask<'_>) -> OptionPolicy {
    let robot = &task.world.robot;
    task.world.prior().policy(robot, &task.conditions.noise)
}
