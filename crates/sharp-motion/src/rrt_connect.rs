//! RRT-Connect (Kuffner and `LaValle` 2000) for directed motions: the goal's tree grows backwards.

use sharp_space::{CollisionChecker, Stream};

use crate::path::Path;
use crate::query::{MotionQuery, PathOutcome, RrtSettings};
use crate::sampler::Sampler;
use crate::steering::Steering;
use crate::tree::{Direction, Extender, ExtensionEnd, PoseTree, poses_along};

/// Grows one tree from each end, one step at a time, and connects the other tree to each new node.
pub fn rrt_connect(
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
    let mut start = PoseTree::new(query.start, Direction::Forward, settings);
    let mut goal = PoseTree::new(query.goal, Direction::Backward, settings);
    for iteration in 0..settings.budget.iterations {
        // The first target is the other end: without obstacles no sample is needed.
        let from_start = iteration % 2 == 0;
        let target = if iteration == 0 { query.goal } else { sampler.sample(rng) };
        let (growing, other) = if from_start { (&mut start, &mut goal) } else { (&mut goal, &mut start) };
        let near = growing.nearest(&extender, target);
        let new = match growing.extend(&extender, near, target) {
            ExtensionEnd::Trapped => continue,
            ExtensionEnd::Advanced(new) | ExtensionEnd::Reached(new) => new,
        };
        if let Some(met) = other.connect(&extender, growing.pose(new)) {
            let (in_start, in_goal) = if from_start { (new, met) } else { (met, new) };
            let edges = [start.edges(in_start), goal.edges(in_goal)].concat();
            let poses = poses_along(query.start, &edges, settings.check_step_m);
            return PathOutcome::Solved(Path::new(poses).expect("it holds the start"));
        }
    }
    PathOutcome::Exhausted { iterations: settings.budget.iterations }
}
