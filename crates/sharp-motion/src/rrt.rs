//! RRT (`LaValle` 1998) with goal bias: the planner of the paper's baseline "RRT with replanning".

use rand::RngExt;
use sharp_space::{CollisionChecker, Stream};

use crate::path::Path;
use crate::query::{Outcome, Query, RrtSettings};
use crate::sampler::Sampler;
use crate::steering::Steering;
use crate::tree::{Direction, Reach, Scene, Tree, poses_along};

/// Grows one tree from the start until an extension ends at the goal.
pub fn rrt(
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
    let mut tree = Tree::new(query.start, Direction::Forward, settings);
    for _ in 0..settings.budget.iterations {
        let to_goal = rng.random::<f64>() < settings.goal_bias;
        let target = if to_goal { query.goal } else { sampler.sample(rng) };
        let near = tree.nearest(&scene, target);
        if let Reach::Reached(node) = tree.extend(&scene, near, target)
            && to_goal
        {
            let poses = poses_along(query.start, &tree.edges(node), settings.check_step_m);
            return Outcome::Solved(Path::new(poses).expect("it holds the start"));
        }
    }
    Outcome::Exhausted { iterations: settings.budget.iterations }
}
