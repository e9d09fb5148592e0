//! RRT-Connect (Kuffner and `LaValle` 2000) for directed motions: the goal's tree grows backwards.

use sharp_space::{CollisionChecker, Stream};

use crate::path::Path;
use crate::query::{Outcome, Query, RrtSettings};
use crate::sampler::Sampler;
use crate::steering::Steering;
use crate::tree::{Direction, Reach, Scene, Tree, poses_along};

/// Grows a tree from either end, one step at a time, and connects the other tree to each new node.
pub fn rrt_connect(
    query: &Query,
    checker: &(impl CollisionChecker + ?Sized),
    steering: &Steering,
    sampler: &mut (impl Sampler + ?Sized),
    settings: &RrtSettings,
    rng: &mut Stream,
) -> Outcome {
    if let Some(outcome) = query.blocked_end(checker) {
        return outcome;
    }
    let scene = Scene { checker, steering, settings };
    let mut start = Tree::new(query.start, Direction::Forward, settings);
    let mut goal = Tree::new(query.goal, Direction::Backward, settings);
    for iteration in 0..settings.budget.iterations {
        // The first target is the other end: in the open no sample is needed.
        let from_start = iteration % 2 == 0;
        let target = if iteration == 0 { query.goal } else { sampler.sample(rng) };
        let (growing, other) = if from_start { (&mut start, &mut goal) } else { (&mut goal, &mut start) };
        let near = growing.nearest(&scene, target);
        let new = match growing.extend(&scene, near, target) {
            Reach::Trapped => continue,
            Reach::Advanced(new) | Reach::Reached(new) => new,
        };
        if let Some(met) = other.connect(&scene, growing.pose(new)) {
            let (in_start, in_goal) = if from_start { (new, met) } else { (met, new) };
            let edges = [start.edges(in_start), goal.edges(in_goal)].concat();
            let poses = poses_along(query.start, &edges, settings.check_step_m);
            return Outcome::Solved(Path::new(poses).expect("it holds the start"));
        }
    }
    Outcome::Exhausted { iterations: settings.budget.iterations }
}
