//! The board that plans are drawn on, in metres, and its rectangles.

use sharp_space::{GridFrame, Occupancy, OccupancyGrid, Point, Pose};

/// A square drawing board.
pub(super) struct Blueprint {
    side: usize,
    resolution_m: f64,
    border_m: f64,
    blocked: Vec<bool>,
}

impl Blueprint {
    pub(super) fn new(side: usize, resolution_m: f64, border_m: f64) -> Self {
        // At least one cell of border, however coarse the grid.
        let border_m = border_m.max(resolution_m);
        let mut plan = Self { side, resolution_m, border_m, blocked: vec![true; side * side] };
        plan.set(plan.inside(), false);
        plan
    }

    /// What lies within the border walls.
    pub(super) fn inside(&self) -> Rect {
        let size = self.side as f64 * self.resolution_m;
        Rect { x0: 0.0, x1: size, y0: 0.0, y1: size }.shrunk(self.border_m)
    }

    /// Blocks the cells of `rect`, at least one cell across.
    pub(super) fn fill(&mut self, rect: Rect) {
        self.set(rect, true);
    }

    pub(super) fn clear(&mut self, rect: Rect) {
        self.set(rect, false);
    }

    fn set(&mut self, rect: Rect, blocked: bool) {
        let inside = self.span(self.border_m, self.side as f64 * self.resolution_m - self.border_m);
        let clip = |(a, b): (usize, usize)| (a.max(inside.0), b.min(inside.1));
        let (cols, rows) = (clip(self.span(rect.x0, rect.x1)), clip(self.span(rect.y0, rect.y1)));
        for row in rows.0..rows.1 {
            if cols.0 < cols.1 {
                self.blocked[row * self.side + cols.0..row * self.side + cols.1].fill(blocked);
            }
        }
    }

    /// The cells between two coordinates, at least one.
    fn span(&self, from_m: f64, to_m: f64) -> (usize, usize) {
        let from = (from_m / self.resolution_m).round().max(0.0) as usize;
        let to = ((to_m / self.resolution_m).round().max(0.0) as usize).max(from + 1);
        (from.min(self.side), to.min(self.side))
    }

    /// Blocks the four walls inside `rect`.
    pub(super) fn outline(&mut self, rect: Rect, wall: f64) {
        self.fill(Rect { x1: rect.x0 + wall, ..rect });
        self.fill(Rect { x0: rect.x1 - wall, ..rect });
        self.fill(Rect { y1: rect.y0 + wall, ..rect });
        self.fill(Rect { y0: rect.y1 - wall, ..rect });
    }

    pub(super) fn fill_where(&mut self, solid: impl Fn(Point) -> bool) {
        for index in 0..self.blocked.len() {
            let (col, row) = (index % self.side, index / self.side);
            let center =
                Point::new((col as f64 + 0.5) * self.resolution_m, (row as f64 + 0.5) * self.resolution_m);
            self.blocked[index] |= solid(center);
        }
    }

    /// The map, turned by one of the eight symmetries of the square.
    pub(super) fn into_grid(self, symmetry: usize) -> OccupancyGrid {
        let side = self.side;
        let cells = (0..side * side).map(|index| {
            if self.blocked[turned_from(index, side, symmetry)] {
                Occupancy::Occupied
            } else {
                Occupancy::Free
            }
        });
        let origin = Pose::new(0.0, 0.0, 0.0);
        let frame = GridFrame { origin, resolution_m: self.resolution_m, width: side, height: side };
        OccupancyGrid::new(frame, cells.collect()).expect("the side was checked on entry")
    }
}

/// A rectangle in metres from the map's lower-left corner.
#[derive(Clone, Copy, Debug)]
pub(super) struct Rect {
    pub(super) x0: f64,
    pub(super) x1: f64,
    pub(super) y0: f64,
    pub(super) y1: f64,
}

impl Rect {
    pub(super) fn width(&self) -> f64 {
        self.x1 - self.x0
    }

    pub(super) fn height(&self) -> f64 {
        self.y1 - self.y0
    }

    pub(super) fn shrunk(&self, by: f64) -> Self {
        Self { x0: self.x0 + by, x1: self.x1 - by, y0: self.y0 + by, y1: self.y1 - by }
    }

    /// The parts before and after a wall `at` metres in, upright or level, and the wall.
    pub(super) fn cut(self, upright: bool, at: f64, wall: f64) -> (Self, Self, Self) {
        let half = wall / 2.0;
        if upright {
            let x = self.x0 + at;
            let partition = Self { x0: x - half, x1: x + half, ..self };
            (Self { x1: x - half, ..self }, Self { x0: x + half, ..self }, partition)
        } else {
            let y = self.y0 + at;
            let partition = Self { y0: y - half, y1: y + half, ..self };
            (Self { y1: y - half, ..self }, Self { y0: y + half, ..self }, partition)
        }
    }

    /// The opening of `door` metres, `start` metres along this wall.
    pub(super) fn door(self, upright: bool, start: f64, door: f64) -> Self {
        // A little deeper than the wall, so that rounding to cells leaves no sill.
        const SILL_M: f64 = 0.05;
        if upright {
            let y0 = self.y0 + start;
            Self { x0: self.x0 - SILL_M, x1: self.x1 + SILL_M, y0, y1: y0 + door }
        } else {
            let x0 = self.x0 + start;
            Self { x0, x1: x0 + door, y0: self.y0 - SILL_M, y1: self.y1 + SILL_M }
        }
    }
}

/// The cell of a square of `side` by `side` cells that comes to cell number `index` when the square is
/// turned by one of its eight symmetries, 0 to 7.
#[must_use]
pub const fn turned_from(index: usize, side: usize, symmetry: usize) -> usize {
    let (mut col, mut row) = (index % side, index / side);
    if symmetry & 1 != 0 {
        col = side - 1 - col;
    }
    if symmetry & 2 != 0 {
        row = side - 1 - row;
    }
    if symmetry & 4 != 0 {
        (col, row) = (row, col);
    }
    row * side + col
}
