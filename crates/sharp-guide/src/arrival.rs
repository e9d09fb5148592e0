//! How a car arrives in a direction that its guide does not have: a Dubins curve takes the place of the guide's end.
//!
//! A robot that turns in place needs none of this: it turns at the goal.

use sharp_motion::Steering;
use sharp_space::{Heading, Pose};

use crate::context::CHECK_STEP_M;
use crate::inflate::GuideRobot;
use crate::path::GuidePath;

/// How far before the end of the guide the curve may begin, metres.
const BACK_MAX_M: f64 = 5.0;
/// The distance between two places where it may begin, metres.
const BACK_STEP_M: f64 = 0.25;
/// Radius of the curve in units of the robot's own: at its tightest a car cannot correct itself.
const RADIUS_FACTOR: f64 = 1.2;

/// `guide` with an end that arrives at the same place in the direction of `heading`; `None` where no curve is free.
#[must_use]
pub fn arriving(robot: &GuideRobot<'_>, guide: &GuidePath, heading: Heading) -> Option<GuidePath> {
    let goal = Pose::at(guide.end().position, heading);
    robot.inflated_at(None).find_map(|robot| {
        let curve = Steering::Dubins { radius_m: RADIUS_FACTOR * robot.steering.radius_m() };
        let length_m = guide.length_m();
        let steps = (BACK_MAX_M.min(length_m) / BACK_STEP_M).floor() as usize;
        let start = (length_m <= BACK_MAX_M).then_some(0.0);
        let ends = (0..=steps).map(|i| length_m - i as f64 * BACK_STEP_M).chain(start);
        let curves = ends.map(|arc_m| (arc_m, curve.maneuver(guide.pose_at(arc_m), goal)));
        let free = curves.filter(|(_, curve)| curve.all(CHECK_STEP_M, |pose| robot.geometry.is_free(pose)));
        let total_m = |(arc_m, curve): &(f64, sharp_motion::Maneuver)| arc_m + curve.travel_m();
        let (arc_m, curve) = free.min_by(|a, b| total_m(a).total_cmp(&total_m(b)))?;
        let kept = (0..guide.poses().len()).filter(|&i| guide.arc_m(i) < arc_m - 1e-3);
        let mut poses: Vec<Pose> = kept.map(|i| guide.poses()[i]).collect();
        poses.extend(curve.poses(CHECK_STEP_M));
        GuidePath::new(poses, guide.spacing_m()).ok()
    })
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use sharp_space::{Footprint, FootprintChecker, OccupancyGrid, RobotGeometry};

    use super::*;
    use crate::inflate::inflated_robots;

    #[test]
    fn a_car_arrives_in_any_direction_where_there_is_room() {
        let grid = OccupancyGrid::from_ascii(0.1, &[".".repeat(80).as_str(); 60].join("\n")).expect("a hall");
        let outline = Footprint::rectangle(0.16, 0.11).expect("an outline");
        let geometry: Arc<dyn RobotGeometry> = Arc::new(FootprintChecker::new(&grid, outline));
        let inflated = inflated_robots(&geometry, 0.4);
        let steering = Steering::of(0.4);
        let robot = GuideRobot { geometry: &*geometry, steering, inflated: &inflated };
        let straight = (0..=20).map(|i| Pose::new(2.0 + 0.2 * f64::from(i), 3.0, 0.0)).collect();
        let guide = GuidePath::new(straight, 0.25).expect("a path");
        for heading in [0.0, 1.57, 3.1, -1.57] {
            let arrived = arriving(&robot, &guide, Heading::new(heading)).expect("there is room");
            assert!(arrived.end().heading.turn_to(Heading::new(heading)).abs() < 1e-6, "{heading}");
            assert!((arrived.end().position - guide.end().position).norm() < 1e-6, "{heading}: elsewhere");
            assert_eq!(arrived.start(), guide.start(), "{heading}: begins elsewhere");
            let bends = arrived.poses().windows(2);
            let tightest = bends.map(|pair| {
                pair[0].heading.turn_to(pair[1].heading).abs() * 0.4 / pair[0].distance_m(&pair[1]).max(1e-9)
            });
            assert!(tightest.fold(0.0, f64::max) < 1.1, "{heading}: too tight a bend");
        }
    }
}
