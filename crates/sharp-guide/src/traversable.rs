//! The traversable mask: the part of the map that one guide may use, in units of cells.

use sharp_space::{Cell, DistanceField, GridFrame, Point, Vector};

/// Cells that are allowed and have enough clearance for the robot's centre.
#[derive(Clone, Copy)]
pub(crate) struct TraversableMask<'a> {
    pub(crate) field: &'a DistanceField,
    pub(crate) allowed: &'a dyn Fn(Cell) -> bool,
    /// The least clearance that a cell must have, metres.
    pub(crate) least_m: f64,
    /// The clearance beyond which more makes no difference, metres.
    pub(crate) comfort_m: f64,
}

impl TraversableMask<'_> {
    pub(crate) const fn frame(&self) -> &GridFrame {
        self.field.frame()
    }

    /// Metres from the centre of `cell` to the side of the nearest blocked cell (in a straight wall).
    pub(crate) fn clearance_m(&self, cell: Cell) -> f64 {
        self.field.at(cell) - 0.5 * self.frame().resolution_m
    }

    pub(crate) fn is_open(&self, cell: Cell) -> bool {
        let clearance_m = self.clearance_m(cell);
        // What is asked for can be less than nothing where cells are large against the robot.
        clearance_m > 0.0 && clearance_m >= self.least_m && (self.allowed)(cell)
    }

    /// The open cell nearest to `point` within `reach_m`; ties go to the lower cell.
    pub(crate) fn nearest_open(&self, point: Point, reach_m: f64) -> Option<Cell> {
        let frame = self.frame();
        let center = frame.to_grid(point);
        let reach = reach_m / frame.resolution_m;
        let range = |at: f64, len: usize| {
            (at - reach).max(0.0) as usize..len.min((at + reach + 1.0).max(0.0) as usize)
        };
        let mut best = None;
        for row in range(center.y, frame.height) {
            for col in range(center.x, frame.width) {
                let distance = (Vector::new(col as f64 + 0.5, row as f64 + 0.5) - center).norm();
                let nearer = best.is_none_or(|(_, least)| distance < least);
                if nearer && distance <= reach && self.is_open(Cell::new(col, row)) {
                    best = Some((Cell::new(col, row), distance));
                }
            }
        }
        best.map(|(cell, _)| cell)
    }

    /// The cell that holds the grid position `at`, if it is open.
    pub(crate) fn is_open_at(&self, at: Vector) -> bool {
        let frame = self.frame();
        let inside = at.x >= 0.0 && at.y >= 0.0 && at.x < frame.width as f64 && at.y < frame.height as f64;
        inside && self.is_open(Cell::new(at.x as usize, at.y as usize))
    }

    /// Clearance at the grid position `at`, metres, and its gradient, metres per metre: bilinear.
    pub(crate) fn clearance_and_gradient(&self, at: Vector) -> (f64, Vector) {
        let frame = self.frame();
        let along = |x: f64, len: usize| {
            let x = (x - 0.5).clamp(0.0, len as f64 - 1.0);
            let low = (x as usize).min(len.saturating_sub(2));
            (low, (low + 1).min(len - 1), x - low as f64)
        };
        let (left, right, tx) = along(at.x, frame.width);
        let (below, above, ty) = along(at.y, frame.height);
        let at_cell = |col, row| self.clearance_m(Cell::new(col, row));
        let (a, b, c, d) =
            (at_cell(left, below), at_cell(right, below), at_cell(left, above), at_cell(right, above));
        let value = (a * (1.0 - tx) + b * tx) * (1.0 - ty) + (c * (1.0 - tx) + d * tx) * ty;
        let dx = (b - a) * (1.0 - ty) + (d - c) * ty;
        let dy = (c - a) * (1.0 - tx) + (d - b) * tx;
        (value, Vector::new(dx, dy) / frame.resolution_m)
    }
}
