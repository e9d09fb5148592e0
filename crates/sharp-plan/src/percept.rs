//! What policies see: the workspace, the robot's state and what it just felt.

use std::sync::Arc;

use serde::{Deserialize, Serialize};
use sharp_guide::GuidePath;
use sharp_sim::{ActionSettings, Drive, NoiseModel, ObstacleMap, RobotModel, RobotState};
use sharp_space::{CollisionChecker, FootprintChecker, Heading, OccupancyGrid, Pose, Vector, trig};

use crate::belief::Belief;
use crate::model::Model;
use crate::policy::{GuideView, PolarWaypoint};
use crate::spare::Spare;

/// Rays around the robot that feel for walls.
const RAYS: usize = 12;
/// How far a ray reaches, metres: two seconds of driving.
const RAY_LENGTH_M: f64 = 2.0;
/// Where along the guide the policy looks, metres ahead of the robot.
const LOOK_AHEAD_M: [f64; 4] = [0.4, 0.8, 1.4, 2.2];
/// Points of the outline that feel the room around them, in units of its half length and half width.
const OUTLINE: [(f64, f64); 8] =
    [(1.0, 1.0), (1.0, 0.0), (1.0, -1.0), (0.0, 1.0), (0.0, -1.0), (-1.0, 1.0), (-1.0, 0.0), (-1.0, -1.0)];
/// Room that is as good as any, metres: beside the outline, and along the guide.
const ROOM_MAX_M: [f64; 2] = [0.4, 0.8];
/// Share of what was felt before that is kept from one action to the next.
const FELT_KEPT: f64 = 0.8;
/// Length of [`guide_observation`].
pub(crate) const GUIDE_OBSERVATION_LEN: usize =
    7 + 3 * LOOK_AHEAD_M.len() + RAYS + OUTLINE.len() + 7 + Expectation::LEN;
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
    pub world: Arc<ObstacleMap>,
    /// Larger and clumsier robots, for whom paths are drawn first.
    pub(crate) spares: Arc<[Spare]>,
    /// What its actions do, as policies imagine it.
    pub(crate) model: Arc<Model>,
}

impl Workspace {
    /// A workspace of `robot` in `grid`.
    #[must_use]
    pub fn new(grid: OccupancyGrid, robot: RobotModel) -> Self {
        let checker = Arc::new(FootprintChecker::new(&grid, robot.footprint));
        let world = Arc::new(ObstacleMap::new(&grid, robot.footprint));
        let model = Arc::new(Model::new(&robot));
        let spares = Spare::all(&robot, &checker).into();
        Self { grid: Arc::new(grid), robot: Arc::new(robot), checker, world, spares, model }
    }

    /// The spares that could stand at `start`, the most to spare first; the robot itself is the last.
    pub(crate) fn spares_at(&self, start: Option<Pose>) -> impl Iterator<Item = &Spare> {
        self.spares.iter().filter(move |spare| start.is_none_or(|start| spare.checker.is_free(start)))
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
    /// What noise did of late: turn beyond the bearing asked for, radians an action, and distance
    /// driven as a share of what was asked for; means in which older actions count less.
    pub felt: [f64; 2],
    /// What all actions of the episode say of the robot's slip and pull, where anybody asks.
    pub(crate) belief: Option<Belief>,
}

/// What a learnt policy is told before it drives: how careful to be and which noise to expect.
///
/// One network then serves every noise and every trade of time against risk. Each entry is from 0
/// to about 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Expectation {
    /// How much a contact matters, 0 to 1.
    pub caution: f32,
    /// Standard deviation of the waypoint, decimetres.
    pub waypoint: f32,
    /// Pull to one side, 0.3 rad/s at 1 m/s.
    pub drift: f32,
    /// Share of speed and turn that may be lost, halves.
    pub slip: f32,
    /// Deviation of the gains, 0.3.
    pub gain: f32,
}

impl Expectation {
    const LEN: usize = 5;

    /// What `noise` lets a policy expect that is told to be as careful as `caution`.
    #[must_use]
    pub fn new(noise: &NoiseModel, caution: f32) -> Self {
        let extra = noise.slippery_patches.map_or(0.0, |patches| patches.share * patches.extra_slip);
        let entry = |value: f64, unit: f64| (value / unit).min(2.0) as f32;
        Self {
            caution,
            waypoint: entry(noise.waypoint_sd_m, 0.1),
            drift: entry(noise.drift_sd_radps + noise.drift_bias_radps, 0.3),
            slip: entry(noise.slip_max + extra, 0.5),
            gain: entry(noise.gain_sd, 0.3),
        }
    }

    const fn entries(&self) -> [f32; Self::LEN] {
        [self.caution, self.waypoint, self.drift, self.slip, self.gain]
    }
}

impl Percept {
    /// The percept of a robot that has not acted yet.
    #[must_use]
    pub fn first(state: RobotState, noise: &NoiseModel) -> Self {
        let last_command = PolarWaypoint { reach_m: 0.0, bearing_rad: 0.0, speed_mps: 0.0 };
        let belief = Some(Belief::new(noise));
        Self { state, last_displacement: [0.0; 3], last_command, felt: [0.0, 1.0], belief }
    }

    /// The same for policies that make up for nothing: beliefs take as long as the simulation.
    pub(crate) fn without_belief(self) -> Self {
        Self { belief: None, ..self }
    }

    /// The percept after `command` moved the robot of `workspace` to `after`.
    #[must_use]
    pub fn next(&self, workspace: &Workspace, command: PolarWaypoint, after: RobotState) -> Self {
        let before = &self.state.pose;
        let moved = before.to_local(after.pose.position);
        let turn = before.heading.turn_to(after.pose.heading);
        let asked_m = command.speed_mps.mul_add(ActionSettings::default().action_s, 0.05);
        let now = [turn - command.bearing_rad.clamp(-1.0, 1.0), moved.norm() / asked_m];
        let felt = [0, 1].map(|i| FELT_KEPT * self.felt[i] + (1.0 - FELT_KEPT) * now[i]);
        let belief = self.belief.map(|belief| belief.after(&workspace.model, (&self.state, command), &after));
        Self {
            state: after,
            last_displacement: [moved.x, moved.y, turn],
            last_command: command,
            felt,
            belief,
        }
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
/// points ahead (x, y in the robot's frame, room beside the robot there), twelve rays, room at eight
/// points of the outline, last displacement (3), last command (2), what noise did of late (2), and
/// what to expect (5).
pub(crate) fn guide_observation(
    workspace: &Workspace,
    percept: &Percept,
    tracker: &Tracker,
    (view, expectation): (&GuideView<'_>, &Expectation),
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
    let (sin, cos) = trig::sin_cos(error);
    put(sin);
    put(cos);
    put(percept.state.velocity.x / robot.max_speed_mps);
    put(percept.state.yaw_rate_radps / robot.max_yaw_rate_radps);
    put(match robot.drive {
        Drive::Ackermann { max_steer_rad, .. } => percept.state.steer_rad / max_steer_rad,
        Drive::Differential { .. } => 0.0,
    });
    let field = workspace.checker.field();
    let [beside_max_m, ahead_max_m] = ROOM_MAX_M;
    for ahead_m in LOOK_AHEAD_M {
        let ahead = view.ahead(tracker.arc_m + ahead_m).position;
        let local = pose.to_local(ahead);
        put(local.x.clamp(-3.0, 3.0) / 2.0);
        put(local.y.clamp(-3.0, 3.0) / 2.0);
        let room_m = field.sample(ahead) - robot.footprint.inscribed_radius_m();
        put(room_m.clamp(0.0, ahead_max_m) / ahead_max_m);
    }
    for ray in 0..RAYS {
        let angle = pose.heading.radians() + std::f64::consts::TAU * ray as f64 / RAYS as f64;
        put(ray_length_m(workspace, pose, angle) / RAY_LENGTH_M);
    }
    let (half_length_m, half_width_m) = (robot.footprint.half_length_m(), robot.footprint.half_width_m());
    for (ahead, left) in OUTLINE {
        let point = pose.to_world(Vector::new(ahead * half_length_m, left * half_width_m));
        put(field.sample(point).clamp(0.0, beside_max_m) / beside_max_m);
    }
    let [dx, dy, turn] = percept.last_displacement;
    put(dx / robot.waypoint_reach_m);
    put(dy / robot.waypoint_reach_m);
    put(turn);
    put(percept.last_command.speed_mps / robot.max_speed_mps);
    put(percept.last_command.bearing_rad / std::f64::consts::PI);
    put(percept.felt[0]);
    put(percept.felt[1].min(2.0));
    expectation.entries().into_iter().for_each(|entry| put(f64::from(entry)));
}

/// Free length from the robot's centre along `angle_rad`, metres, by sphere tracing.
fn ray_length_m(workspace: &Workspace, pose: &Pose, angle_rad: f64) -> f64 {
    let field = workspace.checker.field();
    let half_cell_m = 0.5 * field.frame().resolution_m;
    let (sin, cos) = trig::sin_cos(angle_rad);
    let direction = Vector::new(cos, sin);
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
        let percept = Percept::first(state, &NoiseModel::harsh());
        let tracker = Tracker::start(&guide, &state.pose);
        let mut observation = [f32::NAN; GUIDE_OBSERVATION_LEN];
        let view = GuideView { guide: &guide, next: None };
        let expectation = Expectation::new(&NoiseModel::harsh(), 1.0);
        guide_observation(&workspace, &percept, &tracker, (&view, &expectation), &mut observation);
        assert!(observation.iter().all(|entry| entry.abs() <= 1.5), "{observation:?}");
        let mut absolute = [f32::NAN; ABSOLUTE_OBSERVATION_LEN];
        absolute_observation(&percept, &guide, &mut absolute);
        assert_eq!(&absolute[..2], &[2.0, 2.3], "the configuration");
        assert!((absolute[4] + 0.3).abs() < 1e-6, "the vector to the nearest guide point: {absolute:?}");
    }

    #[test]
    fn displacements_are_felt_in_the_frame_before_the_action() {
        let (workspace, _) = world(HALL, OptionKind::Centroid);
        let state = RobotState::at_rest(Pose::new(1.0, 1.0, std::f64::consts::FRAC_PI_2));
        let before = Percept::first(state, &NoiseModel::harsh());
        let command = PolarWaypoint { reach_m: 0.5, bearing_rad: 0.0, speed_mps: 1.0 };
        let after = before.next(&workspace, command, RobotState::at_rest(Pose::new(0.9, 1.4, 2.0)));
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
