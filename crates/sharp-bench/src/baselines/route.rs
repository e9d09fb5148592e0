//! A path that the robot can drive from end to end.

use sharp_drive::World;
use sharp_guide::{GuidePath, GuideRobot, routes};
use sharp_space::Pose;

/// Poses that a search for a route expands before it gives up; no indoor map has as many.
const EXPANSIONS: usize = 2_000_000;

/// Plans routes to one goal for one robot in one map.
#[derive(Clone, Debug)]
pub struct RoutePlanner<'a> {
    world: &'a World,
    goal: Pose,
}

impl<'a> RoutePlanner<'a> {
    /// A planner for the robot and the map of `world`, to `goal`'s position.
    #[must_use]
    pub const fn new(world: &'a World, goal: Pose) -> Self {
        Self { world, goal }
    }

    /// A path from `start` that the robot can drive, or `None` where there is none.
    #[must_use]
    pub fn plan_from(&self, start: Pose) -> Option<GuidePath> {
        let goal_radius_m = 0.5 * self.world.robot.goal_tolerance_m;
        routes(&self.world.guide_robot(), start, (self.goal.position, goal_radius_m), EXPANSIONS).next()
    }

    /// The robot with the safety margins that it has room for at `start`, the largest first.
    pub(crate) fn robots(&self, start: Pose) -> impl Iterator<Item = GuideRobot<'a>> + use<'a> {
        self.world.guide_robot().inflated_at(Some(start))
    }
}
