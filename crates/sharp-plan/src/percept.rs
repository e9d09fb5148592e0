//! What policies see: the workspace, the robot's state and what it just felt.

use std::sync::Arc;

use sharp_guide::GuidePath;
use sharp_sim::{Drive, RobotModel, RobotState, World};
use sharp_space::{FootprintChecker, Heading, OccupancyGrid, Pose, Vector};

use crate::policy::{GuideView, PolarWaypoint};

/// Rays around the robot that feel for walls.
const RAYS: usize = 12;
/// How far a ray reaches, metres: two seconds of driving.
const RAY_LENGTH_M: f64 = 2.0;
/// Where along the guide the policy looks, metres ahead of the robot.
const LOOK_AHEAD_M: [f64; 4] = [0.4, 0.8, 1.4, 2.2];
/// Length of [`guide_observation`].
pub(crate) const GUIDE_OBSERVATION_LEN: usize = 7 + 2 * LOOK_AHEAD_M.len() + RAYS + 5;
/// Length of [`absolute_observation`].
pub(crate) const ABSOLUTE_OBSERVATION_LEN: usize = 5;

/// A map and a robot in it: what never changes while problems come and go.
#[derive(Clone, Debug)]
pub struct Workspace {
    /// The occupancy matrix.
    pub grid: Arc<OccupancyGrid>,
    /// The robot.
    pub robot: Arc<RobotModel>,
    /// The collision function for the robot in the map.
    pub checker: Arc<FootprintChecker>,
    /// The map as the simulators see it.
    pub world: Arc<World>,
}

impl Workspace {
    /// A workspace of `robot` in `grid`.
    #[must_use]
    pub fn new(grid: OccupancyGrid, robot: RobotModel) -> Self {
        let checker = Arc::new(FootprintChecker::new(&grid, robot.footprint));
        let world = Arc::new(World::new(&grid, robot.footprint));
        Self { grid: Arc::new(grid), robot: Arc::new(robot), checker, world }
    }
}

/// What the robot knows of itself at the moment of a decision.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Percept {
    /// Pose and motion.
    pub state: RobotState,
    /// How the last action moved it, in the frame it had before: ahead, left (metres), turn (radians).
    pub last_displacement: [f64; 3],
    /// The last waypoint asked for, as it was seen then.
    pub last_command: PolarWaypoint,
}

impl Percept {
    /// The percept of a robot that has not acted yet.
    #[must_use]
    pub const fn first(state: RobotState) -> Self {
        let last_command = PolarWaypoint { reach_m: 0.0, bearing_rad: 0.0, speed_mps: 0.0 };
        Self { state, last_displacement: [0.0; 3], last_command }
    }

    /// The percept after `command` moved the robot to `after`.
    #[must_use]
    pub fn next(&self, command: PolarWaypoint, after: RobotState) -> Self {
        let before = &self.state.pose;
        let moved = before.to_local(after.pose.position);
        let turn = before.heading.turn_to(after.pose.heading);
        Self { state: after, last_displacement: [moved.x, moved.y, turn], last_command: command }
    }
}

/// How far along its guide the robot has come.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub struct Tracker {
    /// Arc length of the projection onto the guide, metres; never runs back far.
    pub arc_m: f64,
    /// Signed distance from the guide, metres, left positive.
    pub cross_track_m: f64,
    /// Arc length still to go, metres.
    pub remaining_m: f64,
    /// Direction of the guide there.
    pub tangent: Heading,
}

impl Tracker {
    /// The projection of a robot that starts at `pose`.
    #[must_use]
    pub fn start(guide: &GuidePath, pose: &Pose) -> Self {
        let mut tracker = Self::default();
        tracker.update(guide, pose);
        tracker
    }

    /// Follows the robot to `pose`.
    pub fn update(&mut self, guide: &GuidePath, pose: &Pose) {
        let projection = guide.project(pose.position, self.arc_m);
        self.arc_m = projection.arc_m;
        self.cross_track_m = projection.cross_track_m;
        self.remaining_m = projection.remaining_m;
        self.tangent = projection.tangent;
    }
}

/// The observation in the guide's frame; every entry is about one in size.
///
/// remaining arc, cross-track, heading error (sin, cos), speed, yaw rate, steering, four guide
/// points ahead (x, y in the robot's frame), twelve rays, last displacement (3), last command (2).
pub(crate) fn guide_observation(
    workspace: &Workspace,
    percept: &Percept,
    tracker: &Tracker,
    view: &GuideView<'_>,
    observation: &mut [f32],
) {
    let robot = &workspace.robot;
    let pose = &percept.state.pose;
    let error = tracker.tangent.turn_to(pose.heading);
    let mut entries = observation.iter_mut();
    let mut put = |value: f64| {
        if let Some(entry) = entries.next() {
            *entry = value as f32;
        }
    };
    put(tracker.remaining_m.min(4.0) / 4.0);
    put(tracker.cross_track_m.clamp(-1.0, 1.0));
    put(error.sin());
    put(error.cos());
    put(percept.state.velocity.x / robot.max_speed_mps);
    put(percept.state.yaw_rate_radps / robot.max_yaw_rate_radps);
    put(match robot.drive {
        Drive::Ackermann { max_steer_rad, .. } => percept.state.steer_rad / max_steer_rad,
        Drive::Differential { .. } => 0.0,
    });
    for ahead_m in LOOK_AHEAD_M {
        let local = pose.to_local(view.ahead(tracker.arc_m + ahead_m).position);
        put(local.x.clamp(-3.0, 3.0) / 2.0);
        put(local.y.clamp(-3.0, 3.0) / 2.0);
    }
    for ray in 0..RAYS {
        let angle = pose.heading.radians() + std::f64::consts::TAU * ray as f64 / RAYS as f64;
        put(ray_length_m(workspace, pose, angle) / RAY_LENGTH_M);
    }
    let [dx, dy, turn] = percept.last_displacement;
    put(dx / robot.waypoint_reach_m);
    put(dy / robot.waypoint_reach_m);
    put(turn);
    put(percept.last_command.speed_mps / robot.max_speed_mps);
    put(percept.last_command.bearing_rad / std::f64::consts::PI);
}

/// Free length from the robot's centre along `angle_rad`, metres, by sphere tracing.
fn ray_length_m(workspace: &Workspace, pose: &Pose, angle_rad: f64) -> f64 {
    let field = workspace.checker.field();
    let half_cell_m = 0.5 * field.frame().resolution_m;
    let direction = Vector::new(angle_rad.cos(), angle_rad.sin());
    let mut length_m = 0.0;
    while length_m < RAY_LENGTH_M {
        let point = pose.position + direction * length_m;
        let distance_m = field.frame().cell_at(point).map_or(0.0, |cell| field.at(cell));
        if distance_m <= half_cell_m {
            return length_m;
        }
        length_m += distance_m;
    }
    RAY_LENGTH_M
}

/// The paper's observation: the configuration and the vector to the nearest guide point, raw.
pub(crate) fn absolute_observation(percept: &Percept, guide: &GuidePath, observation: &mut [f32]) {
    let pose = &percept.state.pose;
    let nearest = guide.poses()[guide.nearest(pose.position)].position - pose.position;
    let values = [pose.position.x, pose.position.y, pose.heading.radians(), nearest.x, nearest.y];
    for (entry, value) in observation.iter_mut().zip(values) {
        *entry = value as f32;
    }
}

#[cfg(test)]
mod tests {
    use sharp_options::OptionKind;

    use super::*;
    use crate::drawn::{HALL, straight, world};

    #[test]
    fn rays_feel_the_walls_of_a_hall() {
        let (workspace, _) = world(HALL, OptionKind::Centroid);
        // The hall's inside reaches from 0.4 to 9.6 m and from 0.4 to 3.6 m.
        for (x, y, angle, expected_m) in
            [(1.0, 2.0, std::f64::consts::PI, 0.6), (5.0, 1.0, -1.57, 0.6), (5.0, 2.0, 0.0, RAY_LENGTH_M)]
        {
            let length_m = ray_length_m(&workspace, &Pose::new(x, y, 0.0), angle);
            assert!((length_m - expected_m).abs() < 0.4, "from ({x}, {y}) at {angle}: {length_m} m");
        }
    }

    #[test]
    fn observations_fill_their_vectors_with_moderate_numbers() {
        let (workspace, _) = world(HALL, OptionKind::Centroid);
        let guide = straight((1.0, 2.0), (9.0, 2.0));
        let state = RobotState::rolling(Pose::new(2.0, 2.3, 0.4), 0.5);
        let percept = Percept::first(state);
        let tracker = Tracker::start(&guide, &state.pose);
        let mut observation = [f32::NAN; GUIDE_OBSERVATION_LEN];
        let view = GuideView { guide: &guide, next: None };
        guide_observation(&workspace, &percept, &tracker, &view, &mut observation);
        assert!(observation.iter().all(|entry| entry.abs() <= 1.5), "{observation:?}");
        let mut absolute = [f32::NAN; ABSOLUTE_OBSERVATION_LEN];
        absolute_observation(&percept, &guide, &mut absolute);
        assert_eq!(&absolute[..2], &[2.0, 2.3], "the configuration");
        assert!((absolute[4] + 0.3).abs() < 1e-6, "the vector to the nearest guide point: {absolute:?}");
    }

    #[test]
    fn displacements_are_felt_in_the_frame_before_the_action() {
        let before = Percept::first(RobotState::at_rest(Pose::new(1.0, 1.0, std::f64::consts::FRAC_PI_2)));
        let command = PolarWaypoint { reach_m: 0.5, bearing_rad: 0.0, speed_mps: 1.0 };
        let after = before.next(command, RobotState::at_rest(Pose::new(0.9, 1.4, 2.0)));
        let [ahead, left, turn] = after.last_displacement;
        assert!((ahead - 0.4).abs() < 1e-9 && (left - 0.1).abs() < 1e-9, "{ahead} ahead, {left} left");
        assert!((turn - (2.0 - std::f64::consts::FRAC_PI_2)).abs() < 1e-9, "{turn}");
        assert_eq!(after.last_command, command);
    }

    #[test]
    fn a_tracker_goes_along_with_the_robot() {
        let guide = straight((0.0, 0.0), (4.0, 0.0));
        let mut tracker = Tracker::start(&guide, &Pose::new(0.0, 0.2, 0.0));
        for (x, y) in [(0.5, 0.1), (1.5, -0.2), (2.5, 0.0)] {
            tracker.update(&guide, &Pose::new(x, y, 0.0));
            assert!((tracker.arc_m - x).abs() < 1e-9, "{tracker:?} at {x} m");
            assert!((tracker.cross_track_m - y).abs() < 1e-9, "{tracker:?} beside {y} m");
            assert!((tracker.arc_m + tracker.remaining_m - 4.0).abs() < 1e-9, "{tracker:?} of 4 m");
        }
    }
}
