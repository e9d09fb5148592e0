//! What all steps of solving one problem share.

use sharp_drive::World;
use sharp_space::Seed;

use crate::conditions::Conditions;
use crate::method::Method;
use crate::query::{Monitor, Query};

/// A problem, how it is to be solved, and who watches.
#[derive(Clone, Copy)]
pub struct PlanningProblem<'a> {
    /// Map and robot.
    pub world: &'a World,
    /// How it is solved.
    pub method: &'a Method,
    /// What policies are learnt and verified under.
    pub conditions: &'a Conditions,
    /// From where to where.
    pub query: Query,
    /// The root of all randomness.
    pub seed: Seed,
    /// Who watches, and may stop it.
    pub monitor: &'a dyn Monitor,
}

impl std::fmt::Debug for PlanningProblem<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("PlanningProblem")
            .field("query", &self.query)
            .field("seed", &self.seed)
            .finish_non_exhaustive()
    }
}
