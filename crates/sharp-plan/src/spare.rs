//! Room and radius to spare: a path that a larger and clumsier robot could drive.

use sharp_motion::Steering;
use sharp_sim::RobotModel;
use sharp_space::{Footprint, FootprintChecker};

/// What is tried in turn: metres added to the outline on each side, and the turning radius in units of
/// the robot's own. A car that slips cannot follow its tightest bend.
const SPARES: [(f64, f64); 7] =
    [(0.10, 2.5), (0.10, 2.0), (0.10, 1.5), (0.06, 1.5), (0.06, 1.25), (0.03, 1.25), (0.0, 1.0)];

/// An outline and a turning radius with something to spare.
#[derive(Clone, Debug)]
pub(crate) struct Spare {
    pub(crate) checker: FootprintChecker,
    pub(crate) steering: Steering,
}

impl Spare {
    /// What is worth trying for `robot`, whose own outline `checker` tests: the most to spare first, none last.
    pub(crate) fn all(robot: &RobotModel, checker: &FootprintChecker) -> Vec<Self> {
        let mut spares = SPARES.to_vec();
        if robot.can_turn_in_place() {
            spares.dedup_by_key(|spare| spare.0);
        }
        let of = |&(margin_m, bend): &(f64, f64)| {
            let own = &robot.footprint;
            let (length_m, width_m) = (own.half_length_m() + margin_m, own.half_width_m() + margin_m);
            let outline = Footprint::rectangle(length_m, width_m).unwrap_or(*own);
            let steering = Steering::of(bend * robot.min_turning_radius_m());
            Self { checker: checker.with_footprint(outline), steering }
        };
        spares.iter().map(of).collect()
    }
}

#[cfg(test)]
mod tests {
    use sharp_options::OptionKind;

    use super::*;
    use crate::drawn::{HALL, world};

    #[test]
    fn the_most_to_spare_comes_first_and_the_robot_itself_last() {
        let (workspace, _) = world(HALL, OptionKind::Centroid);
        for robot in [RobotModel::husky(), RobotModel::limo()] {
            let checker = workspace.checker.with_footprint(robot.footprint);
            let spares = Spare::all(&robot, &checker);
            let widths_m: Vec<f64> =
                spares.iter().map(|spare| spare.checker.footprint().half_width_m()).collect();
            assert!(widths_m.is_sorted_by(|a, b| a >= b), "{}: {widths_m:?}", robot.name);
            let last = &spares[spares.len() - 1];
            assert_eq!(*last.checker.footprint(), robot.footprint, "{}", robot.name);
            assert_eq!(last.steering, Steering::of(robot.min_turning_radius_m()), "{}", robot.name);
            assert_eq!(spares.len(), if robot.can_turn_in_place() { 4 } else { 7 }, "{}", robot.name);
        }
    }
}
