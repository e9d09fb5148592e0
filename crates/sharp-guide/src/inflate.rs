//! Safety margin: guides are planned for a larger robot with wider bends first.

use std::sync::Arc;

use sharp_motion::Steering;
use sharp_space::{Pose, RobotGeometry};

/// What is tried in turn: metres added to the outline on each side, and the turning radius in units of the
/// robot's own. A car that slips cannot follow its tightest bend.
const MARGINS: [(f64, f64); 7] =
    [(0.10, 2.5), (0.10, 2.0), (0.10, 1.5), (0.06, 1.5), (0.06, 1.25), (0.03, 1.25), (0.0, 1.0)];

/// A robot with a safety margin: a larger outline and a wider turning radius.
#[derive(Clone, Debug)]
pub struct InflatedRobot {
    /// Where the larger outline fits.
    pub geometry: Arc<dyn RobotGeometry>,
    /// How it steers.
    pub steering: Steering,
}

/// A robot as guides are planned for it.
#[derive(Clone, Copy, Debug)]
pub struct GuideRobot<'a> {
    /// Where its outline fits.
    pub geometry: &'a dyn RobotGeometry,
    /// How it steers.
    pub steering: Steering,
    /// The same robot with safety margins, the largest first and the robot itself last; may be empty.
    pub inflated: &'a [InflatedRobot],
}

impl<'a> GuideRobot<'a> {
    /// The robot without margins.
    #[must_use]
    pub const fn new(geometry: &'a dyn RobotGeometry, steering: Steering) -> Self {
        Self { geometry, steering, inflated: &[] }
    }

    /// The robots with margins that could stand at `start`, the largest first; all if there is no `start`.
    pub fn inflated_at(&self, start: Option<Pose>) -> impl Iterator<Item = GuideRobot<'a>> + use<'a> {
        let fits = move |robot: &&InflatedRobot| start.is_none_or(|start| robot.geometry.is_free(start));
        self.inflated.iter().filter(fits).map(|robot| GuideRobot::new(&*robot.geometry, robot.steering))
    }
}

/// The robot of `geometry` with safety margins, the largest first and the robot itself last. Its turning radius
/// is `radius_m`, metres; 0 if it turns in place.
#[must_use]
pub fn inflated_robots(geometry: &Arc<dyn RobotGeometry>, radius_m: f64) -> Vec<InflatedRobot> {
    let mut margins = MARGINS.to_vec();
    if radius_m == 0.0 {
        margins.dedup_by_key(|margin| margin.0);
    }
    let mut robots: Vec<InflatedRobot> = Vec::with_capacity(margins.len());
    for (index, &(margin_m, bend)) in margins.iter().enumerate() {
        // Robots of one outline share it: what is planned for one holds for the others as far as they steer alike.
        let same = index.checked_sub(1).filter(|&before| margins[before].0 == margin_m);
        let geometry =
            same.map_or_else(|| geometry.inflated(margin_m), |before| Arc::clone(&robots[before].geometry));
        robots.push(InflatedRobot { geometry, steering: Steering::of(bend * radius_m) });
    }
    robots
}

#[cfg(test)]
mod tests {
    use sharp_space::{Footprint, FootprintChecker, OccupancyGrid};

    use super::*;

    #[test]
    fn the_largest_margin_comes_first_and_the_robot_itself_last() {
        let grid =
            OccupancyGrid::from_ascii(0.5, &["....................."; 9].join("\n")).expect("a drawing");
        for (radius_m, count) in [(0.0, 4), (0.4, 7)] {
            let footprint = Footprint::rectangle(0.5, 0.335).expect("an outline");
            let geometry: Arc<dyn RobotGeometry> = Arc::new(FootprintChecker::new(&grid, footprint));
            let inflated = inflated_robots(&geometry, radius_m);
            let widths_m: Vec<f64> =
                inflated.iter().map(|robot| robot.geometry.footprint().half_width_m()).collect();
            assert!(widths_m.is_sorted_by(|a, b| a >= b), "radius {radius_m}: {widths_m:?}");
            let last = &inflated[inflated.len() - 1];
            assert_eq!(*last.geometry.footprint(), footprint, "radius {radius_m}");
            assert_eq!(last.steering, Steering::of(radius_m), "radius {radius_m}");
            assert_eq!(inflated.len(), count, "radius {radius_m}");
            let robot = GuideRobot { geometry: &*geometry, steering: last.steering, inflated: &inflated };
            let beside_border = Pose::new(5.0, 0.36, 0.0);
            assert!(robot.inflated_at(Some(beside_border)).count() < count, "some do not fit there");
        }
    }
}
