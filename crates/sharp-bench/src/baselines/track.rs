//! A planned path and closed-loop tracking: what an engineer would use today.
//!
//! A [`ProfiledFollower`] steers. The route is planned anew when the robot leaves it or stands still.

use sharp_drive::{Controller, ProfiledFollower, RouteController, RouteFollower, World};
use sharp_guide::GuidePath;
use sharp_plan::Query;
use sharp_sim::{NoiseModel, RobotState};

use super::route::RoutePlanner;
use crate::contender::Contender;

/// The baseline `track`.
#[derive(Clone, Debug)]
pub struct Track<'a> {
    /// Map and robot.
    pub world: &'a World,
    /// Plans anew on the way.
    pub planner: &'a RoutePlanner<'a>,
    /// The problem.
    pub query: Query,
    /// The path of every episode's beginning.
    pub route: GuidePath,
    /// How it is tracked.
    pub follower: ProfiledFollower,
    /// The noise that the robot expects.
    pub noise: NoiseModel,
}

impl Contender for Track<'_> {
    fn controller(&self, start: RobotState, _episode: u64) -> Box<dyn Controller + '_> {
        let policy = Box::new(RouteFollower::new(self.follower));
        let controller = RouteController::new(self.world, self.route.clone(), policy, start, &self.noise);
        Box::new(
            controller
                .with_replanning(self.query.goal.position, Box::new(|pose| self.planner.plan_from(pose))),
        )
    }
}
