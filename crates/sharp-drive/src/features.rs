//! Situations as vectors, for networks.

use std::sync::LazyLock;

use sharp_guide::GuidePath;
use sharp_sim::Drive;
use sharp_space::{Heading, Point, Pose, Vector, trig};

use crate::network::PolicyContext;
use crate::situation::{Observation, Situation};
use crate::world::World;

/// Rays around the robot that measure the free length.
const RAYS: usize = 12;
/// How far a ray reaches, metres: two seconds of driving.
const RAY_LENGTH_M: f64 = 2.0;
/// Where along the guide the policy looks, metres ahead of the robot.
const LOOK_AHEAD_M: [f64; 4] = [0.4, 0.8, 1.4, 2.2];
/// Points of the outline at which the clearance is measured, in units of its half length and half width.
const OUTLINE: [(f64, f64); 12] = [
    (1.0, 1.0),
    (1.0, 0.0),
    (1.0, -1.0),
    (0.5, 1.0),
    (0.5, -1.0),
    (0.0, 1.0),
    (0.0, -1.0),
    (-0.5, 1.0),
    (-0.5, -1.0),
    (-1.0, 1.0),
    (-1.0, 0.0),
    (-1.0, -1.0),
];
/// Clearance beyond which more makes no difference, metres: beside the outline, and along the guide.
const CLEARANCE_MAX_M: [f64; 2] = [0.4, 0.8];

/// The rays' directions in the robot's frame, the first straight ahead.
static RAY_DIRECTIONS: LazyLock<[Vector; RAYS]> = LazyLock::new(|| {
    let angle_rad = |ray| std::f64::consts::TAU * ray as f64 / RAYS as f64;
    std::array::from_fn(|ray| Heading::new(angle_rad(ray)).unit())
});

/// Length of [`guide_features`].
pub(crate) const GUIDE_FEATURES: usize =
    7 + 6 * LOOK_AHEAD_M.len() + 3 + RAYS + OUTLINE.len() + 9 + PolicyContext::LEN;
/// Length of [`absolute_features`].
pub(crate) const ABSOLUTE_FEATURES: usize = 5;

/// Writes one value after the other.
struct Writer<'a>(std::slice::IterMut<'a, f32>);

impl Writer<'_> {
    fn put(&mut self, value: f64) {
        if let Some(entry) = self.0.next() {
            *entry = value as f32;
        }
    }
}

/// The situation in the guide's frame; every entry is about one in size.
///
/// Remaining arc, cross-track distance, heading error (sine, cosine), speed, yaw rate, steering angle; four guide
/// points ahead (x, y and heading in the robot's frame, clearance there and at the robot's left and right flank);
/// the guide's end (x, y) and whether it is the last; twelve rays; clearance at twelve points of the outline; last
/// displacement (3), last command (2), residuals (2), residuals of the whole episode (2); and the context (5).
pub(crate) fn guide_features(situation: &Situation<'_>, context: &PolicyContext, features: &mut [f32]) {
    let mut to = Writer(features.iter_mut());
    put_motion(situation, &mut to);
    put_guide(situation, &mut to);
    put_surroundings(situation, &mut to);
    put_memory(situation, &mut to);
    context.entries().into_iter().for_each(|entry| to.put(f64::from(entry)));
}

fn put_motion(situation: &Situation<'_>, to: &mut Writer<'_>) {
    let Situation { world, observation: Observation { state, .. }, progress, .. } = situation;
    let robot = &world.robot;
    let error = progress.tangent.turn_to(state.pose.heading);
    to.put(progress.remaining_m.min(4.0) / 4.0);
    to.put(progress.cross_track_m.clamp(-1.0, 1.0));
    let (sin, cos) = trig::sin_cos(error);
    to.put(sin);
    to.put(cos);
    to.put(state.velocity.x / robot.max_speed_mps);
    to.put(state.yaw_rate_radps / robot.max_yaw_rate_radps);
    to.put(match robot.drive {
        Drive::Ackermann { max_steer_rad, .. } => state.steer_rad / max_steer_rad,
        Drive::Differential { .. } => 0.0,
    });
}

fn put_guide(situation: &Situation<'_>, to: &mut Writer<'_>) {
    let Situation { world, observation, progress, guide } = situation;
    let (field, ahead_max_m) = (world.geometry.clearance(), CLEARANCE_MAX_M[1]);
    let (pose, half_width_m) = (&observation.state.pose, world.robot.footprint.half_width_m());
    let robot = pose.frame();
    for ahead_m in LOOK_AHEAD_M {
        let ahead = guide.ahead(progress.arc_m + ahead_m);
        let local = robot.to_local(ahead.position);
        to.put(local.x.clamp(-3.0, 3.0) / 2.0);
        to.put(local.y.clamp(-3.0, 3.0) / 2.0);
        to.put(pose.heading.turn_to(ahead.heading) / std::f64::consts::PI);
        let clearance_m = field.sample(ahead.position) - world.robot.footprint.inscribed_radius_m();
        to.put(clearance_m.clamp(0.0, ahead_max_m) / ahead_max_m);
        let along = ahead.frame();
        for side_m in [half_width_m, -half_width_m] {
            let flank = along.to_world(Vector::new(0.0, side_m));
            to.put(field.sample(flank).clamp(0.0, ahead_max_m) / ahead_max_m);
        }
    }
    let end = robot.to_local(guide.current.end().position);
    to.put(end.x.clamp(-4.0, 4.0) / 4.0);
    to.put(end.y.clamp(-4.0, 4.0) / 4.0);
    to.put(f64::from(u8::from(guide.next.is_none())));
}

fn put_surroundings(situation: &Situation<'_>, to: &mut Writer<'_>) {
    let (world, pose) = (situation.world, &situation.observation.state.pose);
    let robot = pose.frame();
    for direction in &*RAY_DIRECTIONS {
        to.put(ray_length_m(world, pose.position, robot.turn(*direction)) / RAY_LENGTH_M);
    }
    let (field, beside_max_m) = (world.geometry.clearance(), CLEARANCE_MAX_M[0]);
    let footprint = &world.robot.footprint;
    for (ahead, left) in OUTLINE {
        let corner = Vector::new(ahead * footprint.half_length_m(), left * footprint.half_width_m());
        to.put(field.sample(robot.to_world(corner)).clamp(0.0, beside_max_m) / beside_max_m);
    }
}

fn put_memory(situation: &Situation<'_>, to: &mut Writer<'_>) {
    let Observation { last_displacement: [dx, dy, turn], last_command, residuals, long_residuals, .. } =
        situation.observation;
    let robot = &situation.world.robot;
    to.put(dx / robot.waypoint_reach_m);
    to.put(dy / robot.waypoint_reach_m);
    to.put(*turn);
    to.put(last_command.speed_mps / robot.max_speed_mps);
    to.put(last_command.bearing_rad / std::f64::consts::PI);
    for [turn, share] in [residuals, long_residuals] {
        to.put(*turn);
        to.put(share.min(2.0));
    }
}

/// Free length from `start` along the unit vector `direction`, metres, by sphere tracing.
fn ray_length_m(world: &World, start: Point, direction: Vector) -> f64 {
    let field = world.geometry.clearance();
    let half_cell_m = 0.5 * field.frame().resolution_m;
    let mut length_m = 0.0;
    while length_m < RAY_LENGTH_M {
        let point = start + direction * length_m;
        let distance_m = field.frame().cell_at(point).map_or(0.0, |cell| field.at(cell));
        if distance_m <= half_cell_m {
            return length_m;
        }
        length_m += distance_m;
    }
    RAY_LENGTH_M
}

/// The paper's observation: the configuration and the vector to the nearest guide point, raw.
pub(crate) fn absolute_features(pose: &Pose, guide: &GuidePath, features: &mut [f32]) {
    let nearest = guide.poses()[guide.nearest(pose.position)].position - pose.position;
    let values = [pose.position.x, pose.position.y, pose.heading.radians(), nearest.x, nearest.y];
    for (entry, value) in features.iter_mut().zip(values) {
        *entry = value as f32;
    }
}

#[cfg(test)]
mod tests {
    use sharp_sim::{NoiseModel, RobotState};

    use super::*;
    use crate::situation::{GuideProgress, GuideView};
    use crate::test_worlds::{hall, straight};

    #[test]
    fn rays_end_at_the_walls_of_a_hall() {
        let world = hall();
        // The hall's inside reaches from 0.4 to 9.6 m and from 0.4 to 3.6 m.
        for (x, y, angle, expected_m) in
            [(1.0, 2.0, std::f64::consts::PI, 0.6), (5.0, 1.0, -1.57, 0.6), (5.0, 2.0, 0.0, RAY_LENGTH_M)]
        {
            let length_m = ray_length_m(&world, Point::new(x, y), Heading::new(angle).unit());
            assert!((length_m - expected_m).abs() < 0.4, "from ({x}, {y}) at {angle}: {length_m} m");
        }
    }

    #[test]
    fn features_fill_their_vectors_with_moderate_numbers() {
        let world = hall();
        let guide = straight((1.0, 2.0), (9.0, 2.0));
        let state = RobotState::rolling(Pose::new(2.0, 2.3, 0.4), 0.5);
        let observation = Observation::first(state, &NoiseModel::harsh());
        let progress = GuideProgress::start(&guide, &state.pose);
        let mut features = [f32::NAN; GUIDE_FEATURES];
        let view = GuideView { current: &guide, next: None };
        let context = PolicyContext::new(&NoiseModel::harsh(), 1.0);
        let situation =
            Situation { world: &world, observation: &observation, progress: &progress, guide: view };
        guide_features(&situation, &context, &mut features);
        assert!(features.iter().all(|entry| entry.abs() <= 1.5), "{features:?}");
        let mut absolute = [f32::NAN; ABSOLUTE_FEATURES];
        absolute_features(&state.pose, &guide, &mut absolute);
        assert_eq!(&absolute[..2], &[2.0, 2.3], "the configuration");
        assert!((absolute[4] + 0.3).abs() < 1e-6, "the vector to the nearest guide point: {absolute:?}");
    }
}
