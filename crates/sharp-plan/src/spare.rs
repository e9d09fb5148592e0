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
