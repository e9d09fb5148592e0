//! The trait of motion planners, and ours behind it for callers that choose one at run time.

use sharp_space::{Bounds, CollisionChecker, Pose, Stream};

use crate::learn_and_link::learn_and_link;
use crate::query::{MotionQuery, PathOutcome, RrtSettings};
use crate::rrt::rrt;
use crate::rrt_connect::rrt_connect;
use crate::sampler::Uniform;
use crate::steering::Steering;

/// Answers motion planning queries.
pub trait MotionPlanner {
    /// A free path from the query's start to its goal, or why there is none.
    fn plan(&self, query: &MotionQuery, checker: &dyn CollisionChecker, rng: &mut Stream) -> PathOutcome;
}

/// Which algorithm answers.
#[derive(Clone, Debug, PartialEq)]
pub enum Algorithm {
    /// One tree from the start: [`rrt`].
    Rrt,
    /// One tree from each end: [`rrt_connect`].
    RrtConnect,
    /// One tree from each end and from each seed: [`learn_and_link`].
    LearnAndLink {
        /// Poses in critical regions.
        seeds: Vec<Pose>,
    },
}

/// An algorithm for one robot that samples uniformly over one map.
#[derive(Clone, Debug, PartialEq)]
pub struct SamplingPlanner {
    /// Which algorithm.
    pub algorithm: Algorithm,
    /// What the robot can drive.
    pub steering: Steering,
    /// Where to sample.
    pub bounds: Bounds,
    /// Budget and step sizes.
    pub settings: RrtSettings,
}

impl MotionPlanner for SamplingPlanner {
    fn plan(&self, query: &MotionQuery, checker: &dyn CollisionChecker, rng: &mut Stream) -> PathOutcome {
        let Self { algorithm, steering, bounds, settings } = self;
        let mut sampler = Uniform { bounds: *bounds };
        match algorithm {
            Algorithm::Rrt => rrt(query, checker, steering, &mut sampler, settings, rng),
            Algorithm::RrtConnect => rrt_connect(query, checker, steering, &mut sampler, settings, rng),
            Algorithm::LearnAndLink { seeds } => {
                learn_and_link(query, seeds, checker, steering, &mut sampler, settings, rng)
            }
        }
    }
}
