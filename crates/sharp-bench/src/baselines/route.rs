//! A path that the robot can drive from end to end.
//!
//! The clearance search of `sharp-guide` plans the path over the whole free space and checks outline and bends;
//! where it cannot, hybrid A* searches. Both try the robot with the largest safety margin first.

use sharp_drive::World;
use sharp_guide::{
    ClearanceSearch, GuideEnd, GuidePath, GuidePlanner, GuideRequest, GuideRobot, GuideSettings, Steering,
};
use sharp_motion::{HybridSettings, Path, hybrid_astar};
use sharp_plan::Query;
use sharp_space::{Heading, Point, Pose, Seed};

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
        let query = Query { start, goal: self.goal };
        let goal_radius_m = 0.5 * self.world.robot.goal_tolerance_m;
        self.robots(start)
            .find_map(|robot| ridge(&robot, &query).or_else(|| searched(&robot, &query, goal_radius_m)))
    }

    /// The robot with the safety margins that it has room for at `start`, the largest first.
    pub(crate) fn robots(&self, start: Pose) -> impl Iterator<Item = GuideRobot<'a>> + use<'a> {
        self.world.guide_robot().inflated_at(Some(start))
    }
}

/// Along the ridge of clearance.
fn ridge(robot: &GuideRobot<'_>, query: &Query) -> Option<GuidePath> {
    let request = GuideRequest {
        start: GuideEnd { position: query.start.position, heading: Some(query.start.heading) },
        goal: GuideEnd { position: query.goal.position, heading: None },
        allowed: &|_| true,
    };
    // No sampling: hybrid A* finds shorter paths, and finds them always.
    let settings = GuideSettings { margins: false, ..GuideSettings::default().unsampled() };
    let unused = &mut Seed(0).stream("route", 0);
    ClearanceSearch { settings }.plan(&request, robot, unused).ok()
}

/// By hybrid A*.
fn searched(robot: &GuideRobot<'_>, query: &Query, goal_radius_m: f64) -> Option<GuidePath> {
    let settings = HybridSettings { goal_radius_m, ..HybridSettings::default() };
    let query = sharp_motion::MotionQuery { start: query.start, goal: query.goal };
    let path = hybrid_astar(&query, robot.geometry, &robot.steering, &settings).path()?;
    as_guide(&path, &robot.steering)
}

/// The path as a guide: a car's with its headings; otherwise the corners at which the robot turns in
/// place stay sharp, and headings follow the direction of travel.
fn as_guide(path: &Path, steering: &Steering) -> Option<GuidePath> {
    let spacing_m = GuideSettings::default().spacing_m;
    if matches!(steering, Steering::Dubins { .. }) {
        return GuidePath::new(path.resample(0.99 * spacing_m).poses().to_vec(), spacing_m).ok();
    }
    let mut positions: Vec<Point> = path.poses().iter().map(|pose| pose.position).collect();
    positions.dedup_by(|a, b| (*a - *b).norm() < 1e-9);
    let last = positions.len() - 1;
    let tangent = |i: usize| Heading::of(positions[(i + 1).min(last)] - positions[i.min(last.max(1) - 1)]);
    let poses = (0..=last).map(|i| Pose::at(positions[i], tangent(i))).collect();
    GuidePath::new(poses, spacing_m).ok()
}
