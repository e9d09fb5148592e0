//! Best-first search with the full footprint: can a robot get there? For the tests of the own environments.
//!
//! States are poses, one kept per bin of place and heading; both robots only drive forward, the Husky also
//! turns in place, the Limo steers along arcs. Distances along the cells that are wide enough for the robot
//! guide the search. A path that it finds is a proof. If it finds none, that is only a strong hint.

use std::cmp::Reverse;
use std::collections::{BinaryHeap, VecDeque};
use std::f64::consts::TAU;

use sharp_space::{CollisionChecker, Footprint, FootprintChecker, OccupancyGrid, Pose, Vector};

const HEADINGS: usize = 24;
const BIN_M: f64 = 0.1;
/// Longer than a bin's diagonal, so that each step leaves the bin it starts in.
const STEP_M: f64 = 0.15;

/// A robot as far as this search needs it.
#[derive(Clone, Copy, Debug)]
pub(crate) enum DrivableRobot {
    /// 1.0 x 0.67 m, turns in place.
    Husky,
    /// 0.32 x 0.22 m, turns on arcs of 0.45 m.
    Limo,
}

impl DrivableRobot {
    /// The outline, `margin_m` larger on each side.
    pub(crate) fn checker(self, grid: &OccupancyGrid, margin_m: f64) -> FootprintChecker {
        let (half_length_m, half_width_m) = match self {
            Self::Husky => (0.5, 0.335),
            Self::Limo => (0.16, 0.11),
        };
        let outline = Footprint::rectangle(half_length_m + margin_m, half_width_m + margin_m);
        FootprintChecker::new(grid, outline.expect("the robots' sizes are sound"))
    }

    /// Steps as (metres ahead, radians turned).
    fn moves(self) -> [(f64, f64); 3] {
        match self {
            Self::Husky => [(STEP_M, 0.0), (0.0, TAU / HEADINGS as f64), (0.0, -TAU / HEADINGS as f64)],
            Self::Limo => [(STEP_M, 0.0), (STEP_M, STEP_M / 0.45), (STEP_M, -STEP_M / 0.45)],
        }
    }
}

/// The length of some path from `start` to within 0.25 m of `goal`, metres, if one is found.
pub(crate) fn drive_m(
    robot: DrivableRobot,
    checker: &FootprintChecker,
    start: Pose,
    goal: Pose,
) -> Option<f64> {
    let frame = checker.field().frame();
    let to_goal_m = distances_m(checker, goal);
    let (cols, rows) = ((frame.width_m() / BIN_M) as usize + 1, (frame.height_m() / BIN_M) as usize + 1);
    let mut seen = vec![false; cols * rows * HEADINGS];
    let bin = |pose: &Pose| {
        let (col, row) = ((pose.position.x / BIN_M) as usize, (pose.position.y / BIN_M) as usize);
        let turn = (pose.heading.radians() / TAU * HEADINGS as f64).round() as isize;
        (row * cols + col) * HEADINGS + turn.rem_euclid(HEADINGS as isize) as usize
    };
    let mut nodes = vec![(start, 0.0)];
    let mut open = BinaryHeap::from([(Reverse(0), 0)]);
    while let Some((_, node)) = open.pop() {
        let (pose, length_m): (Pose, f64) = nodes[node];
        if pose.distance_m(&goal) < 0.25 {
            return Some(length_m);
        }
        for (ahead_m, turn_rad) in robot.moves() {
            let chord = Pose::at(pose.position, (pose.heading.radians() + 0.5 * turn_rad).into());
            let heading = (pose.heading.radians() + turn_rad).into();
            let next = Pose::at(chord.to_world(Vector::new(ahead_m, 0.0)), heading);
            if !checker.is_free(next) || std::mem::replace(&mut seen[bin(&next)], true) {
                continue;
            }
            let cell = frame.cell_at(next.position).expect("free poses lie in the map");
            let Some(rest_m) = to_goal_m[frame.index(cell)] else { continue };
            let length_m = length_m + ahead_m;
            open.push((Reverse(((length_m + rest_m) * 1000.0) as u64), nodes.len()));
            nodes.push((next, length_m));
        }
    }
    None
}

/// For each cell the metres to `goal` in steps across cell sides, where a disc of the robot's width
/// fits; a guide, not a bound.
fn distances_m(checker: &FootprintChecker, goal: Pose) -> Vec<Option<f64>> {
    let (field, frame) = (checker.field(), checker.field().frame());
    // The field measures to the centre of the blocked cell, beyond its side: this errs on the wide.
    let radius_m = checker.footprint().inscribed_radius_m();
    let mut distances = vec![None; frame.len()];
    let goal = frame.cell_at(goal.position).expect("goals lie in the map");
    distances[frame.index(goal)] = Some(0.0);
    let mut queue = VecDeque::from([(goal, 0.0)]);
    while let Some((cell, distance_m)) = queue.pop_front() {
        let next_m = distance_m + frame.resolution_m;
        for next in frame.neighbors4(cell) {
            let distance = &mut distances[frame.index(next)];
            if distance.is_none() && field.at(next) > radius_m {
                *distance = Some(next_m);
                queue.push_back((next, next_m));
            }
        }
    }
    distances
}
