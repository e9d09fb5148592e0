//! The goal of a problem: a disc, as far as a free way inside it leads.

use std::collections::{BTreeSet, VecDeque};
use std::sync::Arc;

use sharp_space::{Cell, DistanceField, GridFrame, Heading, Point, Pose};

/// Clearance beside the outline with which a robot arrives easily, metres.
const EASY_M: f64 = 0.2;
/// The part of the radius within which an easier place is looked for: the rest is for the noise of arriving.
const EASY_SHARE: f64 = 0.5;

/// The goal of a problem.
#[derive(Clone, Debug, PartialEq)]
pub struct Goal {
    /// Its position.
    pub point: Point,
    /// Distance within which it counts as reached, metres.
    pub radius_m: f64,
    /// The heading in which the robot has to stand there, and how far off it may be, radians; `None` for any.
    pub heading: Option<(Heading, f64)>,
    /// Cells within that distance which no free way inside it joins to the goal: those behind a wall.
    cut_off: Arc<BTreeSet<Cell>>,
    frame: GridFrame,
}

impl Goal {
    /// The goal at `point`, which counts as reached within `radius_m` along free space; `clearance` is the distance of
    /// every cell to the nearest obstacle.
    #[must_use]
    pub fn new(point: Point, radius_m: f64, clearance: &DistanceField) -> Self {
        let frame = *clearance.frame();
        let near = cells_near(&frame, point, radius_m + frame.resolution_m);
        let is_free = |cell: &Cell| near.contains(cell) && clearance.at(*cell) > 0.0;
        let mut joined: BTreeSet<Cell> = frame.cell_at(point).into_iter().collect();
        let mut open: VecDeque<Cell> = joined.iter().copied().collect();
        while let Some(Cell { col, row }) = open.pop_front() {
            let beside =
                [(col.wrapping_sub(1), row), (col + 1, row), (col, row.wrapping_sub(1)), (col, row + 1)];
            for cell in beside.map(|(col, row)| Cell::new(col, row)) {
                if is_free(&cell) && joined.insert(cell) {
                    open.push_back(cell);
                }
            }
        }
        let cut_off = near.difference(&joined).copied().filter(|&cell| clearance.at(cell) > 0.0).collect();
        Self { point, radius_m, heading: None, cut_off: Arc::new(cut_off), frame }
    }

    /// The same, where the robot has to stand in the direction of `heading`, at most `tolerance_rad` off.
    #[must_use]
    pub fn with_heading(self, heading: Heading, tolerance_rad: f64) -> Self {
        Self { heading: Some((heading, tolerance_rad)), ..self }
    }

    /// Returns true if a robot at `pose` has arrived: at the place, and in the direction that is asked for.
    #[must_use]
    pub fn is_reached(&self, pose: &Pose) -> bool {
        self.contains(pose.position) && self.turn_left_rad(pose) == 0.0
    }

    /// How far a robot at `pose` has to turn for the direction that is asked for, radians, left positive; 0 where it stands
    /// well enough.
    #[must_use]
    pub fn turn_left_rad(&self, pose: &Pose) -> f64 {
        let Some((heading, tolerance_rad)) = self.heading else { return 0.0 };
        let turn_rad = pose.heading.turn_to(heading);
        if turn_rad.abs() <= tolerance_rad { 0.0 } else { turn_rad }
    }

    /// Returns true if `point` is at the place: nearer than the radius, and not behind a wall.
    #[must_use]
    pub fn contains(&self, point: Point) -> bool {
        let is_near = (point - self.point).norm() < self.radius_m;
        is_near && self.frame.cell_at(point).is_none_or(|cell| !self.cut_off.contains(&cell))
    }

    /// Where a guide for a robot of `inscribed_m` (the radius inside its outline, metres) should end: the goal itself,
    /// or where that is close to a wall, the nearest place in it that is easier to reach.
    #[must_use]
    pub fn easiest_end(&self, clearance: &DistanceField, inscribed_m: f64) -> Point {
        let wanted_m = inscribed_m + EASY_M;
        if clearance.sample(self.point) >= wanted_m {
            return self.point;
        }
        let near = cells_near(&self.frame, self.point, EASY_SHARE * self.radius_m);
        let places =
            near.into_iter().map(|cell| self.frame.center(cell)).filter(|&place| self.contains(place));
        let lack_m = |place: &Point| (wanted_m - clearance.sample(*place)).max(0.0);
        let off_m = |place: &Point| (place - self.point).norm();
        let better =
            |a: &Point, b: &Point| lack_m(a).total_cmp(&lack_m(b)).then(off_m(a).total_cmp(&off_m(b)));
        let place = places.min_by(better);
        place.filter(|place| lack_m(place) < lack_m(&self.point)).unwrap_or(self.point)
    }
}

/// The cells of `frame` whose centre is within `radius_m` of `point`.
fn cells_near(frame: &GridFrame, point: Point, radius_m: f64) -> BTreeSet<Cell> {
    let at = frame.to_grid(point);
    let reach = radius_m / frame.resolution_m + 1.0;
    let range = |middle: f64, end: usize| {
        let last = (middle + reach).clamp(0.0, end as f64) as usize;
        (middle - reach).max(0.0) as usize..last
    };
    let rows = range(at.y, frame.height);
    rows.flat_map(|row| range(at.x, frame.width).map(move |col| Cell::new(col, row)))
        .filter(|&cell| (frame.center(cell) - point).norm() <= radius_m)
        .collect()
}

#[cfg(test)]
mod tests {
    use sharp_space::OccupancyGrid;

    use super::*;

    /// Two rooms with a wall of one cell between them; cells of 0.1 m.
    fn rooms() -> DistanceField {
        let row = format!("#{0}#{0}#", ".".repeat(14));
        let wall = "#".repeat(31);
        let rows: Vec<String> =
            std::iter::once(wall.clone()).chain((0..18).map(|_| row.clone())).chain([wall]).collect();
        let grid = OccupancyGrid::from_ascii(0.1, &rows.join("\n")).expect("a sound drawing");
        DistanceField::new(&grid)
    }

    #[test]
    fn a_goal_is_not_reached_through_a_wall() {
        let field = rooms();
        let goal = Goal::new(Point::new(1.7, 1.0), 0.4, &field);
        assert!(goal.contains(Point::new(1.9, 1.0)), "beside it");
        assert!(!goal.contains(Point::new(1.4, 1.0)), "0.3 m away behind the wall");
        assert!(!goal.contains(Point::new(2.2, 1.0)), "0.5 m away");
    }

    #[test]
    fn a_heading_is_asked_for_on_request_only() {
        let field = rooms();
        let goal = Goal::new(Point::new(2.3, 1.0), 0.4, &field);
        let at = |heading: f64| Pose::new(2.2, 1.0, heading);
        assert!(goal.is_reached(&at(2.0)), "any heading");
        let goal = goal.with_heading(Heading::new(3.0), 0.3);
        assert_eq!([2.6, 2.8, -3.1].map(|heading| goal.is_reached(&at(heading))), [false, true, true]);
        assert!((goal.turn_left_rad(&at(2.0)) - 1.0).abs() < 1e-12, "a radian to the left");
        assert!(!goal.is_reached(&Pose::new(1.5, 1.0, 3.0)), "the place counts as before");
    }

    #[test]
    fn a_guide_ends_where_it_is_easy() {
        let field = rooms();
        let end = |x| Goal::new(Point::new(x, 1.0), 0.4, &field).easiest_end(&field, 0.3);
        assert_eq!(end(2.3), Point::new(2.3, 1.0), "there is room");
        let moved = end(1.9);
        assert!(
            moved.x > 1.98 && (moved - Point::new(1.9, 1.0)).norm() <= 0.2,
            "away from the wall: {moved:?}"
        );
    }
}
