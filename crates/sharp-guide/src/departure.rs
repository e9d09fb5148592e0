//! How a robot leaves a tight place: nose at a wall it backs off first, close beside a wall it drives a gentle arc.
//!
//! A guide begins where the robot can turn and steer. Where it stands closer to an obstacle than that, something has to
//! come before. The paper has nothing of the kind: its robots start in the open.

use serde::{Deserialize, Serialize};
use sharp_motion::Primitive;
use sharp_space::{CollisionChecker, Pose, Vector};

use crate::context::CHECK_STEP_M;
use crate::inflate::GuideRobot;

/// Distance between two ways of backing off, metres.
const BACK_OFF_STEP_M: f64 = 0.1;
/// Radii of the arcs that are tried, metres, the tightest first.
const RADII_M: [f64; 7] = [0.5, 1.0, 2.0, 4.0, 8.0, 12.0, 20.0];
/// The longest arc, metres.
const ARC_MAX_M: f64 = 3.0;
/// Share of the room beside the robot at the start that an arc leaves for noise.
const ROOM_LEFT: f64 = 0.5;
/// Room beside the robot at which a place is no longer tight, metres.
pub const TIGHT_M: f64 = 0.1;
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

/// The ways in which `robot` can leave `start`, each with the poses that come before the guide, the last of which is
/// where the guide begins. It backs off by `back_off_max_m` at most.
#[must_use]
pub fn departures(robot: &GuideRobot<'_>, start: Pose, back_off_max_m: f64) -> Vec<(Departure, Vec<Pose>)> {
    let mut ways = back_offs(robot, start, back_off_max_m);
    ways.extend(arcs(robot, start));
    ways
}

fn back_offs(robot: &GuideRobot<'_>, start: Pose, most_m: f64) -> Vec<(Departure, Vec<Pose>)> {
    let count = (most_m / BACK_OFF_STEP_M + 1e-9).floor() as usize;
    let ways = (1..=count).map(|i| {
        let departure = Departure { back_off_m: i as f64 * BACK_OFF_STEP_M, careful_m: 0.0 };
        (departure, vec![departure.after_back_off(start)])
    });
    ways.take_while(|(_, lead)| robot.geometry.is_segment_free(start, lead[0], CHECK_STEP_M)).collect()
}

/// On each side the tightest arc that leaves half of the room, up to where it is no longer tight.
fn arcs(robot: &GuideRobot<'_>, start: Pose) -> Vec<(Departure, Vec<Pose>)> {
    let room_m = room_m(robot, start);
    if room_m >= TIGHT_M {
        return vec![];
    }
    let noisy = robot.geometry.inflated(ROOM_LEFT * room_m);
    let wide = robot.geometry.inflated(TIGHT_M);
    let arc = |radius_m: f64| {
        let mut lead = vec![start];
        for i in 1..=(ARC_MAX_M / CHECK_STEP_M) as usize {
            let travel_m = i as f64 * CHECK_STEP_M;
            let pose = Primitive { travel_m, turn_rad: travel_m / radius_m }.advance(start, 1.0);
            if !noisy.is_free(pose) {
                return None;
            }
            lead.push(pose);
            if wide.is_free(pose) {
                return Some((Departure { back_off_m: 0.0, careful_m: travel_m }, lead));
            }
        }
        None
    };
    let least_m = 1.1 * robot.steering.radius_m();
    let radii = || RADII_M.into_iter().filter(|&radius_m| radius_m >= least_m);
    [1.0, -1.0].into_iter().filter_map(|side| radii().find_map(|radius_m| arc(side * radius_m))).collect()
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
    use sharp_space::{Footprint, FootprintChecker, OccupancyGrid};

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
        let ways = departures(&robot, start, 0.45);
        let backs: Vec<f64> = ways.iter().map(|(departure, _)| departure.back_off_m).collect();
        assert_eq!(backs.len(), 4, "0.1 m to 0.4 m: {ways:?}");
        assert!(
            ways.iter().all(|(departure, _)| departure.careful_m == 0.0),
            "no arc leads through the wall"
        );
        let (furthest, lead) = &ways[3];
        assert!((lead[0].position.x - 4.92).abs() < 1e-9, "{furthest:?} ends at {:?}", lead[0]);
        assert_eq!(departures(&robot, start, 0.0), vec![], "a robot that never reverses stays");
    }

    #[test]
    fn a_robot_close_beside_a_wall_leaves_it_on_an_arc() {
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
    }
}
