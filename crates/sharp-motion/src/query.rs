//! The motion planning problem and its answers (paper, "Background").

use sharp_space::{CollisionChecker, Pose};

use crate::path::Path;

/// Asks for a path from one pose to another.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotionQuery {
    /// Where the robot stands.
    pub start: Pose,
    /// Where it must arrive.
    pub goal: Pose,
}

impl MotionQuery {
    /// The outcome that is known before any search: a blocked end.
    pub(crate) fn blocked_end(&self, checker: &(impl CollisionChecker + ?Sized)) -> Option<PathOutcome> {
        if !checker.is_free(self.start) {
            return Some(PathOutcome::InvalidStart);
        }
        (!checker.is_free(self.goal)).then_some(PathOutcome::InvalidGoal)
    }
}

/// How long a planner may try. The limit is a count, not a time, so that a run can be repeated.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Budget {
    /// Samples drawn.
    pub iterations: usize,
}

/// The settings shared by all tree planners.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RrtSettings {
    /// When to give up.
    pub budget: Budget,
    /// The longest edge, metres of travel.
    pub range_m: f64,
    /// The distance between two collision checks along an edge, metres.
    pub check_step_m: f64,
    /// The share of samples that are the goal itself; only [`rrt`](crate::rrt) uses it.
    pub goal_bias: f64,
}

impl Default for RrtSettings {
    fn default() -> Self {
        Self {
            budget: Budget { iterations: 10_000 },
            range_m: 1.0,
            // Under a map's cell (0.067 m): a wall cannot slip between two checks.
            check_step_m: 0.05,
            goal_bias: 0.05,
        }
    }
}

/// What a planner found. To find no path is an outcome, not an error.
#[derive(Clone, Debug, PartialEq)]
pub enum PathOutcome {
    /// A collision-free path from the start to the goal.
    Solved(Path),
    /// The start is in collision or outside the map.
    InvalidStart,
    /// The goal is in collision or outside the map.
    InvalidGoal,
    /// The budget ran out.
    Exhausted {
        /// Samples drawn.
        iterations: usize,
    },
}

impl PathOutcome {
    /// The path, if there is one.
    #[must_use]
    pub fn path(self) -> Option<Path> {
        match self {
            Self::Solved(path) => Some(path),
            Self::InvalidStart | Self::InvalidGoal | Self::Exhausted { .. } => None,
        }
    }
}
