//! Can a robot get there? A coarse forward search with the full footprint, for the tests of the
//! own environments.
//!
//! States are poses, one kept per bin of place and heading; both robots only drive forward, the
//! Husky also turns in place, the Limo steers along arcs. A path found here is a proof; none found
//! is a strong hint only.

use std::collections::VecDeque;
use std::f64::consts::TAU;

use sharp_space::{CollisionChecker, Footprint, FootprintChecker, OccupancyGrid, Pose, Vector};

const HEADINGS: usize = 24;
const STEP_M: f64 = 0.15;

/// A robot as far as this search needs it.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Robot {
    /// 1.0 x 0.67 m, turns in place.
    Husky,
    /// 0.32 x 0.22 m, turns on arcs of 0.45 m and wider.
    Limo,
}

impl Robot {
    /// The outline, `margin_m` larger on each side.
    pub(crate) fn checker(self, grid: &OccupancyGrid, margin_m: f64) -> FootprintChecker {
        let (half_length_m, half_width_m) = match self {
            Self::Husky => (0.5, 0.335),
            Self::Limo => (0.16, 0.11),
        };
        let outline = Footprint::rectangle(half_length_m + margin_m, half_width_m + margin_m);
        FootprintChecker::new(grid, outline.expect("the robots' sizes are sound"))
    }

    fn moves(self) -> [(f64, f64); 3] {
        match self {
            Self::Husky => [(STEP_M, 0.0), (0.0, TAU / HEADINGS as f64), (0.0, -TAU / HEADINGS as f64)],
            Self::Limo => [(STEP_M, 0.0), (STEP_M, STEP_M / 0.45), (STEP_M, -STEP_M / 0.45)],
        }
    }
}

/// The length of a path from `start` to within 0.25 m of `goal`, metres, if one is found.
pub(crate) fn drive_m(
    robot: Robot,
    checker: &FootprintChecker,
    bin_m: f64,
    start: Pose,
    goal: Pose,
) -> Option<f64> {
    let frame = checker.field().frame();
    let (cols, rows) = ((frame.width_m() / bin_m) as usize + 1, (frame.height_m() / bin_m) as usize + 1);
    let bin = |pose: &Pose| {
        let (col, row) = ((pose.position.x / bin_m) as usize, (pose.position.y / bin_m) as usize);
        let turn = (pose.heading.radians() / TAU * HEADINGS as f64).round();
        (row.min(rows - 1) * cols + col.min(cols - 1)) * HEADINGS
            + turn.rem_euclid(HEADINGS as f64) as usize % HEADINGS
    };
    let mut seen = vec![false; cols * rows * HEADINGS];
    let mut queue = VecDeque::from([(start, 0.0)]);
    if !checker.is_free(start) {
        return None;
    }
    while let Some((pose, length_m)) = queue.pop_front() {
        if pose.distance_m(&goal) < 0.25 {
            return Some(length_m);
        }
        for (ahead_m, turn_rad) in robot.moves() {
            let half_turned = Pose::at(pose.position, (pose.heading.radians() + 0.5 * turn_rad).into());
            let next = Pose::at(
                half_turned.to_world(Vector::new(ahead_m, 0.0)),
                (pose.heading.radians() + turn_rad).into(),
            );
            if checker.is_free(next) && !std::mem::replace(&mut seen[bin(&next)], true) {
                // Turns in place come first: they add no length.
                if ahead_m == 0.0 {
                    queue.push_front((next, length_m));
                } else {
                    queue.push_back((next, length_m + ahead_m));
                }
            }
        }
    }
    None
}
