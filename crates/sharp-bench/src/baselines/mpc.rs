//! Model-predictive path integral control along a planned path ([`Mppi`]).

use sharp_drive::{Controller, Mppi, MppiSettings, RouteController, World};
use sharp_guide::GuidePath;
use sharp_plan::Query;
use sharp_sim::{NoiseModel, RobotState};
use sharp_space::Seed;

use super::route::RoutePlanner;
use crate::contender::Contender;

/// The baseline `mppi`.
#[derive(Clone, Debug)]
pub struct Mpc<'a> {
    /// Map and robot.
    pub world: &'a World,
    /// Plans anew on the way.
    pub planner: &'a RoutePlanner<'a>,
    /// The problem.
    pub query: Query,
    /// The path of every episode's beginning.
    pub route: GuidePath,
    /// Sampling and cost.
    pub settings: MppiSettings,
    /// The noise that the robot expects.
    pub noise: NoiseModel,
    /// Root of the perturbations.
    pub seed: Seed,
}

impl Contender for Mpc<'_> {
    fn controller(&self, start: RobotState, episode: u64) -> Box<dyn Controller + '_> {
        let policy = Box::new(Mppi::new(self.settings, self.seed.child("mppi", episode)));
        let controller = RouteController::new(self.world, self.route.clone(), policy, start, &self.noise);
        Box::new(
            controller
                .with_replanning(self.query.goal.position, Box::new(|pose| self.planner.plan_from(pose))),
        )
    }
}
