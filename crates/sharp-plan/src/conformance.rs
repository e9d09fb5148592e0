//! The suite that every [`OptionLearner`] must pass, ours and anybody's.

use std::sync::Arc;

use sharp_drive::{InitialStates, SuccessCount, SuccessEstimate, World};
use sharp_guide::{Goal, GuidePath, GuidedOption, LegId};
use sharp_options::{AllowedRule, InterfaceOptions, OptionSettings};
use sharp_rbvd::{Rbvd, RbvdSettings, StateId};
use sharp_sim::{NoiseModel, RobotModel, RobotState};
use sharp_space::{Cell, DistanceField, OccupancyGrid, Pose, Region, RegionId, Seed};
use thiserror::Error;

use crate::abstraction::Abstraction;
use crate::conditions::Conditions;
use crate::learn::{LearnFailure, LearningTask, LearntPolicy, OptionLearner};

/// How a learner of options breaks its promise.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum OptionLearnerViolation {
    /// The task is sound and nobody stopped it, and yet there is no policy.
    #[error("no policy for a sound task: {0}")]
    Failed(String),
    /// The estimate counts another number of episodes than the task asks for, or impossible successes.
    #[error("{counted:?} counted, {asked} episodes were asked for")]
    Count {
        /// What was counted.
        counted: SuccessCount,
        /// Episodes of the task.
        asked: u32,
    },
    /// The mean time of the successes is no time.
    #[error("{successes} successes took {mean_time_s} s each")]
    Time {
        /// Successes that were counted.
        successes: u32,
        /// Their mean time, seconds.
        mean_time_s: f64,
    },
    /// Fresh episodes show something else than the estimate: their 95 % intervals lie apart.
    #[error("the estimate says {claimed:?}, fresh episodes say {measured:?}")]
    Estimate {
        /// What the learner says.
        claimed: SuccessCount,
        /// What fresh episodes say.
        measured: SuccessCount,
    },
    /// The same task gives another estimate.
    #[error("the same seed gives {first:?}, then {second:?}")]
    Random {
        /// The estimate of the first time.
        first: SuccessEstimate,
        /// The estimate of the second time.
        second: SuccessEstimate,
    },
    /// It trained although it was told to stop, or was told not to train.
    #[error("{0} environment steps of training that nobody wanted")]
    Trained(u64),
    /// A policy that should be better than another is worse.
    #[error("{improved:?} as an improvement of {beaten:?}")]
    Worse {
        /// What was to be beaten.
        beaten: SuccessCount,
        /// What [`judge`](LearningTask::judge) says of the improvement.
        improved: SuccessCount,
    },
    /// [`train_below`](OptionLearner::train_below) is no share.
    #[error("trains below a success of {0}, expected a share from 0 to 1")]
    TrainBelow(f64),
}

/// Episodes of every estimate: few, since only the contract is tested and not how good the learner is.
const EPISODES: u32 = 64;

/// Lets `learner` learn one option, straight through an empty hall under nominal noise, and improve it.
///
/// A learner that trains does so twice here, as long as its settings say.
///
/// # Errors
/// Says which promise is broken.
pub fn check_option_learner(learner: &dyn OptionLearner) -> Result<(), OptionLearnerViolation> {
    let (world, option) = hall();
    let conditions = Conditions::new(&world, NoiseModel::nominal());
    let task = LearningTask {
        world: &world,
        conditions: &conditions,
        option: &option,
        next: None,
        tail: &[],
        states: Arc::new(InitialStates::exactly(RobotState::at_rest(option.guide.start()))),
        wanted_success: 0.99,
        failure_cost_s: sharp_drive::FAILURE_COST_S,
        estimate_episodes: EPISODES,
        seed: Seed(1),
    };
    let learnt = learn(learner, &task)?;
    check_estimate(&learnt, &task)?;
    let second = learn(learner, &task)?.estimate;
    if second != learnt.estimate {
        return Err(OptionLearnerViolation::Random { first: learnt.estimate, second });
    }
    check_stop(learner, &task)?;
    // Whatever works beats a policy that never succeeds; what was learnt is hard to beat.
    let none = SuccessCount { episodes: EPISODES, successes: 0 };
    check_improvement(learner, &task, none)?;
    check_improvement(learner, &task, task.judge(&learnt.policy).count)?;
    match learner.train_below() {
        share if (0.0..=1.0).contains(&share) => Ok(()),
        share => Err(OptionLearnerViolation::TrainBelow(share)),
    }
}

fn learn(
    learner: &dyn OptionLearner,
    task: &LearningTask<'_>,
) -> Result<LearntPolicy, OptionLearnerViolation> {
    learner.learn(task, &|| false).map_err(|failure| OptionLearnerViolation::Failed(format!("{failure:?}")))
}

fn check_estimate(learnt: &LearntPolicy, task: &LearningTask<'_>) -> Result<(), OptionLearnerViolation> {
    let SuccessEstimate { count, mean_time_s } = learnt.estimate;
    if count.episodes < task.estimate_episodes || count.successes > count.episodes {
        return Err(OptionLearnerViolation::Count { counted: count, asked: task.estimate_episodes });
    }
    let is_time = mean_time_s > 0.0 && (mean_time_s.is_finite() || count.successes == 0);
    if !is_time {
        return Err(OptionLearnerViolation::Time { successes: count.successes, mean_time_s });
    }
    let fresh = LearningTask { seed: task.seed.child("conformance", 0), ..task.clone() };
    let measured = fresh.estimate(&learnt.policy).count;
    if measured.upper95() < count.lower95() || count.upper95() < measured.lower95() {
        return Err(OptionLearnerViolation::Estimate { claimed: count, measured });
    }
    Ok(())
}

/// Who is told to stop from the first moment may have a policy at hand, but must not train.
fn check_stop(learner: &dyn OptionLearner, task: &LearningTask<'_>) -> Result<(), OptionLearnerViolation> {
    match learner.learn(task, &|| true) {
        Ok(learnt) if learnt.env_steps > 0 => Err(OptionLearnerViolation::Trained(learnt.env_steps)),
        Ok(_) | Err(LearnFailure::Stopped) => Ok(()),
        Err(failure) => Err(OptionLearnerViolation::Failed(format!("{failure:?}"))),
    }
}

fn check_improvement(
    learner: &dyn OptionLearner,
    task: &LearningTask<'_>,
    beaten: SuccessCount,
) -> Result<(), OptionLearnerViolation> {
    let improved = learner.improve(task, beaten, false, &|| false);
    let improved = improved.map_err(|failure| OptionLearnerViolation::Failed(format!("{failure:?}")))?;
    let Some(improved) = improved else { return Ok(()) };
    if improved.env_steps > 0 {
        return Err(OptionLearnerViolation::Trained(improved.env_steps));
    }
    let judged = task.judge(&improved.policy).count;
    if judged.successes < beaten.successes {
        return Err(OptionLearnerViolation::Worse { beaten, improved: judged });
    }
    Ok(())
}

/// The Husky in a hall of 12 by 6 m, and the option that leads straight through it.
fn hall() -> (World, Arc<GuidedOption>) {
    let grid =
        OccupancyGrid::from_ascii(0.5, &["........................"; 12].join("\n")).expect("a drawing");
    let field = DistanceField::new(&grid);
    let region = Region::new(RegionId(0), vec![Cell::new(12, 6)], &field).expect("one cell");
    let states = Rbvd::build(&field, &[region], &RbvdSettings::default()).expect("a region in free space");
    let abstraction = Abstraction::new(Arc::new(states), &InterfaceOptions, &OptionSettings::default());
    let poses = (0..=40).map(|i| Pose::new(2.0 + 0.2 * f64::from(i), 3.0, 0.0)).collect();
    let guide = GuidePath::new(poses, 0.25).expect("short gaps");
    let goal = Goal::new(guide.end().position, 0.3, &field);
    let space = abstraction.space(AllowedRule::Code);
    let option = GuidedOption::new(&space, LegId::Direct, (StateId(0), StateId(0)), guide, goal);
    (World::new(grid, RobotModel::husky()), Arc::new(option))
}

#[cfg(test)]
mod tests {
    use sharp_drive::{Follower, OptionPolicy};
    use sharp_rl::{StopRule, TrainSettings};

    use super::*;
    use crate::learn::{LearningMonitor, PaperProtocol, PriorOnly, Selection};

    /// The paper's protocol with a budget that only shows that it runs.
    fn tiny_paper() -> PaperProtocol {
        PaperProtocol::new(TrainSettings::default().with(|train| {
            train.sac.hidden = vec![16, 16];
            train.sac.batch = 32;
            train.max_env_steps = 600;
            train.evaluate_every = 300;
            train.evaluation_episodes = 2;
            train.stop = StopRule::Never;
        }))
    }

    #[test]
    fn our_learners_conform() {
        let selection = Selection { screening_episodes: 20, ..Selection::default() };
        let learners: [&dyn OptionLearner; 3] = [&PriorOnly, &selection, &tiny_paper()];
        for learner in learners {
            assert_eq!(check_option_learner(learner), Ok(()), "{learner:?}");
        }
    }

    /// Says that it succeeds always, whatever it does.
    #[derive(Debug)]
    struct Boaster {
        episodes: u32,
    }

    impl OptionLearner for Boaster {
        fn learn(
            &self,
            task: &LearningTask<'_>,
            _: &dyn LearningMonitor,
        ) -> Result<LearntPolicy, LearnFailure> {
            let policy =
                OptionPolicy::Follower(Follower { speed_mps: 0.0, ..Follower::cautious(&task.world.robot) });
            let count = SuccessCount { episodes: self.episodes, successes: self.episodes };
            Ok(LearntPolicy::untrained(policy, SuccessEstimate { count, mean_time_s: 5.0 }))
        }
    }

    #[test]
    fn who_claims_too_much_is_found_out() {
        let boast = check_option_learner(&Boaster { episodes: EPISODES });
        assert!(matches!(boast, Err(OptionLearnerViolation::Estimate { .. })), "{boast:?}");
        let few = check_option_learner(&Boaster { episodes: 3 });
        assert!(matches!(few, Err(OptionLearnerViolation::Count { asked: EPISODES, .. })), "{few:?}");
    }
}
