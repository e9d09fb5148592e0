//! A learner of one's own: every option is driven by the same cautious follower, nothing is learnt.
//!
//! `cargo run --release -p sharp-plan --example always_follow`

use std::sync::Arc;

use sharp_drive::{Follower, OptionPolicy, World};
use sharp_plan::conformance::check_option_learner;
use sharp_plan::{Answer, LearnFailure, LearningMonitor, LearningTask, LearntPolicy, Method, OptionLearner};
use sharp_plan::{Query, Sharp};
use sharp_sim::{NoiseModel, RobotModel};
use sharp_space::{
    Cell, Detection, DistanceField, Footprint, OccupancyGrid, Pose, Region, RegionDetector, RegionId,
};

/// Takes the cautious follower and says how often it succeeds.
#[derive(Debug)]
struct AlwaysFollow;

impl OptionLearner for AlwaysFollow {
    fn learn(&self, task: &LearningTask<'_>, _: &dyn LearningMonitor) -> Result<LearntPolicy, LearnFailure> {
        let policy = OptionPolicy::Follower(Follower::cautious(&task.world.robot));
        let estimate = task.estimate(&policy);
        Ok(LearntPolicy::untrained(policy, estimate))
    }
}

/// Finds one region in the middle of each half of the map.
struct Halves;

impl RegionDetector for Halves {
    fn detect(&self, grid: &OccupancyGrid, _: &Footprint) -> Detection {
        let (frame, field) = (grid.frame(), DistanceField::new(grid));
        let column = |id: u32| frame.width * (1 + 2 * id as usize) / 4;
        let region = |id| Region::new(RegionId(id), vec![Cell::new(column(id), frame.height / 2)], &field);
        Detection::new((0..2).filter_map(region).collect(), "halves")
    }
}

fn main() -> Result<(), Box<dyn std::error::Error>> {
    check_option_learner(&AlwaysFollow)?;

    let grid = OccupancyGrid::from_ascii(0.4, &["........................."; 10].join("\n"))?;
    let world = World::new(grid, RobotModel::husky());
    let method = Method::fast().with_learner("follow", Arc::new(AlwaysFollow)).with_episodes(100, 100, 100);
    let mut sharp = Sharp::new(world, Halves).with_method(method).with_noise(NoiseModel::none());
    let query = Query { start: Pose::new(1.5, 2.0, 0.0), goal: Pose::new(8.5, 2.0, 0.0) };
    let Answer::Solved(plan) = sharp.solve(query, &())? else { return Err("no plan through a hall".into()) };
    let mut steps = plan.solution.steps.iter();
    assert!(steps.all(|step| step.learnt.policy.kind() == "follower"), "nothing else drives");
    assert_eq!(plan.solution.predicted.failures(), 0, "there is no noise");
    Ok(())
}
