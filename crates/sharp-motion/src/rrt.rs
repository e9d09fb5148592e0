//! RRT (`LaValle` 1998) with goal bias: the planner of the paper's baseline "RRT with replanning".

use rand::RngExt;
use sharp_space::{CollisionChecker, Stream};

use crate::path::Path;
use crate::query::{MotionQuery, PathOutcome, RrtSettings};
use crate::sampler::Sampler;
use crate::steering::Steering;
use crate::tree::{Direction, Extender, ExtensionEnd, PoseTree, poses_along};

/// Grows one tree from the start until an extension ends at the goal.
pub fn rrt(
    query: &MotionQuery,
    checker: &(impl CollisionChecker + ?Sized),
    steering: &Steering,
    sampler: &mut (impl Sampler + ?Sized),
    settings: &RrtSettings,
    rng: &mut Stream,
) -> PathOutcome {
    if let Some(outcome) = query.blocked_end(checker) {
        return outcome;
    }
    let extender = Extender { checker, steering, settings };
    let mut tree = PoseTree::new(query.start, Direction::Forward, settings);
    for _ in 0..settings.budget.iterations {
        let to_goal = rng.random::<f64>() < settings.goal_bias;
        let target = if to_goal { query.goal } else { sampler.sample(rng) };
        let near = tree.nearest(&extender, target);
        if let ExtensionEnd::Reached(node) = tree.extend(&extender, near, target)
            && to_goal
        {
            let poses = poses_along(query.start, &tree.edges(node), settings.check_step_m);
            return PathOutcome::Solved(Path::new(poses).expect("it holds the start"));
        }
    }
    PathOutcome::Exhausted { iterations: settings.budget.iterations }
}
