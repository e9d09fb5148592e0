//! Ways as few straight lines, none of which meets an obstacle.

use sharp_drive::World;
use sharp_space::{Cell, CollisionChecker, Heading, OccupancyGrid, Point, Pose};

/// How far a line may be from the way that it stands for, metres: half a cell of most maps.
const OFF_MAX_M: f64 = 0.05;
/// The distance between two looks at the outline along a line, metres.
const CHECK_STEP_M: f64 = 0.05;

/// Returns true if every cell that the line from `from` to `to` touches is known to be free; a line that leaves the
/// map is not.
#[must_use]
pub fn is_line_free(grid: &OccupancyGrid, from: Point, to: Point) -> bool {
    let frame = grid.frame();
    let (a, b) = (frame.to_grid(from), frame.to_grid(to));
    let (low, high) = if a.y <= b.y { (a, b) } else { (b, a) };
    // The column at height `y` of the line, which within one row it crosses from one side to the other.
    let column = |y: f64| {
        let share = if high.y > low.y { (y - low.y) / (high.y - low.y) } else { 0.0 };
        low.x + share.clamp(0.0, 1.0) * (high.x - low.x)
    };
    let is_free = |row: i64, col: i64| {
        let is_inside = (0..frame.height as i64).contains(&row) && (0..frame.width as i64).contains(&col);
        is_inside && grid.is_free(Cell::new(col as usize, row as usize))
    };
    (low.y.floor() as i64..=high.y.floor() as i64).all(|row| {
        let (enters, leaves) = match high.y > low.y {
            true => (column(row as f64), column(row as f64 + 1.0)),
            false => (low.x, high.x),
        };
        let (left, right) = (enters.min(leaves).floor() as i64, enters.max(leaves).floor() as i64);
        (left..=right).all(|col| is_free(row, col))
    })
}

/// The corners of `points` without those that lie nearly on a line between others. A line is drawn where the robot of
/// `world` fits all along it, else the way keeps its own points.
pub(crate) fn corners(world: &World, points: &[Point]) -> Vec<Point> {
    let mut kept: Vec<Point> = points.first().copied().into_iter().collect();
    let mut from = 0;
    while from + 1 < points.len() {
        let reaches = |&to: &usize| to == from + 1 || is_drawn(world, &points[from..=to]);
        let to = (from + 1..points.len()).rev().find(reaches).expect("the next point is always reached");
        kept.push(points[to]);
        from = to;
    }
    kept
}

/// Whether one line stands well for all of `points`.
fn is_drawn(world: &World, points: &[Point]) -> bool {
    let (from, to) = (points[0], points[points.len() - 1]);
    let line = to - from;
    let length_m = line.norm();
    if length_m <= 0.0 {
        return false;
    }
    let unit = line / length_m;
    let mut along_m = 0.0;
    for point in points {
        let offset = point - from;
        let ahead_m = offset.dot(&unit);
        // A way that turns back is more than a line.
        if ahead_m < along_m - OFF_MAX_M || (offset - unit * ahead_m).norm() > OFF_MAX_M {
            return false;
        }
        along_m = along_m.max(ahead_m);
    }
    is_line_free(&world.grid, from, to) && has_room(world, from, to)
}

/// Whether the robot of `world` fits all along the line from `from` to `to` when it drives that way.
pub(crate) fn has_room(world: &World, from: Point, to: Point) -> bool {
    let heading = Heading::of(to - from);
    world.geometry.is_segment_free(Pose::at(from, heading), Pose::at(to, heading), CHECK_STEP_M)
}

#[cfg(test)]
mod tests {
    use sharp_sim::RobotModel;

    use super::*;

    fn grid() -> OccupancyGrid {
        OccupancyGrid::from_ascii(1.0, ".....\n..#..\n....?").expect("a drawing")
    }

    #[test]
    fn a_line_meets_the_cells_that_it_touches() {
        for (from, to, is_free) in [
            ((0.5, 0.5), (0.5, 2.5), true),
            ((0.5, 1.5), (4.5, 1.5), false),
            ((0.5, 0.5), (4.4, 2.5), false),
            ((1.5, 2.5), (3.5, 2.5), true),
            // Through the corner of the wall, and along its side.
            ((1.0, 1.0), (3.5, 1.0), false),
            ((0.5, 0.2), (3.9, 0.9), true),
            ((3.5, 0.5), (4.5, 0.5), false),
            ((3.5, 0.5), (3.5, 3.5), false),
        ] {
            let (a, b) = (Point::new(from.0, from.1), Point::new(to.0, to.1));
            assert_eq!(is_line_free(&grid(), a, b), is_free, "{from:?} to {to:?}");
            assert_eq!(is_line_free(&grid(), b, a), is_free, "{to:?} to {from:?}");
        }
    }

    #[test]
    fn straight_pieces_become_one_line_and_bends_stay() {
        let drawing = [".".repeat(60).as_str(); 60].join("\n");
        let world = World::new(OccupancyGrid::from_ascii(0.1, &drawing).expect("a hall"), RobotModel::limo());
        let mut points: Vec<Point> = (0..=10).map(|i| Point::new(1.0 + 0.2 * f64::from(i), 1.0)).collect();
        points.extend((1..=10).map(|i| Point::new(3.0, 1.0 + 0.2 * f64::from(i))));
        let kept = corners(&world, &points);
        assert_eq!(kept, [Point::new(1.0, 1.0), Point::new(3.0, 1.0), Point::new(3.0, 3.0)]);
        assert_eq!(corners(&world, &[]), []);
    }
}
