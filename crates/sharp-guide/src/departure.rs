//! How a robot leaves a tight place: nose at a wall it backs off first, close beside a wall it drives a gentle curve.
//!
//! A guide begins where the robot can turn and steer. Where it stands closer to an obstacle than that, something has to
//! come before. The paper has nothing of the kind: its robots start in the open.

use serde::{Deserialize, Serialize};
use sharp_motion::Primitive;
use sharp_space::{CollisionChecker, Pose, Vector};

use crate::context::CHECK_STEP_M;
use crate::inflate::GuideRobot;

/// Distances of backing off that are tried, in units of how far the robot backs off from a wall at once. Beyond the first it
/// is the map that says that there is room, not the robot that has just come from there.
const BACK_OFFS: [f64; 7] = [0.25, 0.5, 0.75, 1.0, 1.5, 2.0, 2.5];
/// Radii that are tried for each piece of a curve, metres, the tightest first.
const RADII_M: [f64; 7] = [0.5, 1.0, 2.0, 4.0, 8.0, 16.0, f64::INFINITY];
/// The longest curve, metres.
const CURVE_MAX_M: f64 = 3.0;
/// Share of the room beside the robot at the start that a curve leaves for noise; the second where the first does not
/// lead into the open. A Husky 2 cm beside a wall touches it in 3 of 1,000 runs with the first, in 90 with the second.
const ROOM_LEFT: [f64; 2] = [0.8, 0.5];
/// Room beside the robot at which a place is no longer tight, metres.
const TIGHT_M: f64 = 0.2;
/// Room below which it is not told apart from none, metres.
const ROOM_STEP_M: f64 = 0.005;

/// What a robot does at the start of a plan before it follows the guide.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Departure {
    /// It backs off straight by so much, metres; the guide begins there.
    pub back_off_m: f64,
    /// It drives so much of the guide slowly, towards far waypoints, metres.
    pub careful_m: f64,
}

impl Departure {
    /// Returns true if the robot follows its guide at once.
    #[must_use]
    pub fn is_none(&self) -> bool {
        *self == Self::default()
    }

    /// Where a robot at `start` stands after it has backed off.
    #[must_use]
    pub fn after_back_off(&self, start: Pose) -> Pose {
        Pose::at(start.to_world(Vector::new(-self.back_off_m, 0.0)), start.heading)
    }
}

/// Returns true if an obstacle is so near to `robot` at `start` that no guide begins there without care.
#[must_use]
pub fn is_tight(robot: &GuideRobot<'_>, start: Pose) -> bool {
    !robot.geometry.inflated(TIGHT_M).is_free(start)
}

/// The ways in which `robot` can leave `start`, each with the poses that come before the guide, the last of which is
/// where the guide begins. `back_off_m` is how far it backs off from a wall at once; it may do so 2.5 times as far.
#[must_use]
pub fn departures(robot: &GuideRobot<'_>, start: Pose, back_off_m: f64) -> Vec<(Departure, Vec<Pose>)> {
    let mut ways = back_offs(robot, start, back_off_m);
    let furthest = ways.last().map(|(departure, _)| *departure);
    ways.extend(curves(robot, start, Departure::default()));
    ways.extend(furthest.into_iter().flat_map(|departure| curves(robot, start, departure)));
    ways
}

fn back_offs(robot: &GuideRobot<'_>, start: Pose, at_once_m: f64) -> Vec<(Departure, Vec<Pose>)> {
    let distances =
        BACK_OFFS.into_iter().map(|share| share * at_once_m).filter(|&back_off_m| back_off_m > 0.0);
    let ways = distances.map(|back_off_m| {
        let departure = Departure { back_off_m, careful_m: 0.0 };
        (departure, vec![departure.after_back_off(start)])
    });
    ways.take_while(|(_, lead)| robot.geometry.is_segment_free(start, lead[0], CHECK_STEP_M)).collect()
}

/// On each side the curve that turns away as fast as the room beside the robot allows, up to where it is no longer
/// tight.
fn curves(robot: &GuideRobot<'_>, start: Pose, after: Departure) -> Vec<(Departure, Vec<Pose>)> {
    let start = after.after_back_off(start);
    let room_m = room_m(robot, start);
    if room_m >= TIGHT_M {
        return vec![];
    }
    let sides = [1.0, -1.0].into_iter();
    let curve =
        |side| ROOM_LEFT.into_iter().find_map(|share| curve(robot, (start, after), share * room_m, side));
    sides.filter_map(curve).collect()
}

/// The curve to one `side` that leaves `left_m` of room beside the robot.
fn curve(
    robot: &GuideRobot<'_>,
    (start, after): (Pose, Departure),
    left_m: f64,
    side: f64,
) -> Option<(Departure, Vec<Pose>)> {
    let noisy = robot.geometry.inflated(left_m);
    let wide = robot.geometry.inflated(TIGHT_M);
    let least_m = 1.1 * robot.steering.radius_m();
    let mut lead = vec![start];
    for i in 1..=(CURVE_MAX_M / CHECK_STEP_M) as usize {
        let here = lead[lead.len() - 1];
        let bend = |radius_m: f64| {
            Primitive { travel_m: CHECK_STEP_M, turn_rad: side * CHECK_STEP_M / radius_m }.advance(here, 1.0)
        };
        let mut bends = RADII_M.into_iter().filter(|&radius_m| radius_m >= least_m).map(bend);
        // Half-way a corner of the outline may cut one of an obstacle.
        let is_clear =
            |pose: Pose| noisy.is_free(pose) && robot.geometry.is_free(here.interpolate(&pose, 0.5));
        let pose = bends.find(|&pose| is_clear(pose))?;
        lead.push(pose);
        if wide.is_free(pose) {
            return Some((Departure { careful_m: i as f64 * CHECK_STEP_M, ..after }, lead));
        }
    }
    None
}

/// How much larger the outline could be on all sides at `pose`, metres, [`TIGHT_M`] at most.
fn room_m(robot: &GuideRobot<'_>, pose: Pose) -> f64 {
    let steps = (TIGHT_M / ROOM_STEP_M).round() as usize;
    let room = |i: &usize| robot.geometry.inflated(*i as f64 * ROOM_STEP_M).is_free(pose);
    (1..=steps).take_while(room).last().map_or(0.0, |i| i as f64 * ROOM_STEP_M)
}

#[cfg(test)]
mod tests {
    use sharp_motion::Steering;
    use sharp_space::{Footprint, FootprintChecker, OccupancyGrid, RobotGeometry};

    use super::*;

    /// An empty room of 6 m x 4 m, cells of 0.1 m, and a robot of 1 m x 0.67 m in it.
    fn room() -> FootprintChecker {
        let row = |i: usize| if i == 0 || i == 39 { "#".repeat(60) } else { format!("#{}#", ".".repeat(58)) };
        let drawing: Vec<String> = (0..40).map(row).collect();
        let grid = OccupancyGrid::from_ascii(0.1, &drawing.join("\n")).expect("a sound drawing");
        FootprintChecker::new(&grid, Footprint::rectangle(0.5, 0.335).expect("a sound outline"))
    }

    #[test]
    fn a_robot_with_its_nose_at_a_wall_can_only_back_off() {
        let checker = room();
        let robot = GuideRobot::new(&checker, Steering::RotateTranslate);
        // Half a metre to the nose, 8 cm to the wall at 5.9 m.
        let start = Pose::new(5.32, 2.0, 0.0);
        let ways = departures(&robot, start, 0.4);
        let backs: Vec<f64> = ways.iter().map(|(departure, _)| departure.back_off_m).collect();
        assert_eq!(backs.len(), 7, "0.1 m to 1 m: {ways:?}");
        assert!(
            ways.iter().all(|(departure, _)| departure.careful_m == 0.0),
            "no curve leads through the wall"
        );
        let (furthest, lead) = &ways[6];
        assert!((lead[0].position.x - 4.32).abs() < 1e-9, "{furthest:?} ends at {:?}", lead[0]);
        assert_eq!(departures(&robot, start, 0.0), vec![], "a robot that never reverses stays");
    }

    #[test]
    fn a_robot_close_beside_a_wall_leaves_it_on_a_curve() {
        let checker = room();
        let robot = GuideRobot::new(&checker, Steering::RotateTranslate);
        // The wall is 3 cm to the right.
        let start = Pose::new(2.0, 0.465, 0.0);
        let ways = departures(&robot, start, 0.0);
        assert_eq!(ways.len(), 1, "to the left only: {ways:?}");
        let (departure, lead) = &ways[0];
        let end = lead[lead.len() - 1];
        assert!(end.heading.radians() > 0.0 && departure.careful_m > 0.3, "{departure:?}");
        assert!(lead.iter().all(|&pose| checker.inflated(0.01).is_free(pose)), "it keeps 1 cm");
        assert!(checker.inflated(TIGHT_M).is_free(end), "it ends in the open");
        let open = Pose::new(3.0, 2.0, 0.0);
        assert_eq!(departures(&robot, open, 0.0), vec![], "nothing to leave");
        assert_eq!([start, open].map(|pose| is_tight(&robot, pose)), [true, false]);
    }
}
