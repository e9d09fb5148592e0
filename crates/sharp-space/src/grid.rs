//! The occupancy matrix of an environment and its place in the world.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::bounds::Bounds;
use crate::pose::{Point, Pose, Vector};

/// The side length above which Nav2 refuses a map; larger grids are broken input.
pub(crate) const SIDE_MAX: usize = 32_767;

/// What is known of one cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
pub enum Occupancy {
    /// Known to be free.
    Free,
    /// Known to be occupied.
    Occupied,
    /// Never observed; blocks the robot like an obstacle.
    Unknown,
}

/// A cell of a grid; row 0 is the bottom row, column 0 the left one.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct Cell {
    /// Row, upwards.
    pub row: usize,
    /// Column, to the right.
    pub col: usize,
}

impl Cell {
    /// The cell in column `col` and row `row`.
    #[must_use]
    pub const fn new(col: usize, row: usize) -> Self {
        Self { row, col }
    }
}

/// Where a grid lies in the world: cell ↔ metres.
///
/// The origin is the pose of the lower-left corner of the lower-left cell, as in ROS; its heading
/// turns the whole grid.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct GridFrame {
    /// Pose of the lower-left corner.
    pub origin: Pose,
    /// Side of a cell, metres.
    pub resolution_m: f64,
    /// Number of columns.
    pub width: usize,
    /// Number of rows.
    pub height: usize,
}

impl GridFrame {
    /// The centre of `cell` in the world.
    #[must_use]
    pub fn center(&self, cell: Cell) -> Point {
        self.from_grid(Vector::new(cell.col as f64 + 0.5, cell.row as f64 + 0.5))
    }

    /// The cell that contains `point`, or `None` outside the grid or for a point that is not finite.
    #[inline]
    #[must_use]
    pub fn cell_at(&self, point: Point) -> Option<Cell> {
        let g = self.to_grid(point);
        let inside = g.x >= 0.0 && g.y >= 0.0 && g.x < self.width as f64 && g.y < self.height as f64;
        inside.then(|| Cell::new(g.x as usize, g.y as usize))
    }

    /// `point` in units of cells from the lower-left corner (column direction, row direction).
    #[inline]
    #[must_use]
    pub fn to_grid(&self, point: Point) -> Vector {
        self.origin.to_local(point) / self.resolution_m
    }

    /// The inverse of [`to_grid`](Self::to_grid).
    #[must_use]
    #[allow(clippy::wrong_self_convention, reason = "the pair to_grid and from_grid names the direction")]
    pub fn from_grid(&self, grid: Vector) -> Point {
        self.origin.to_world(grid * self.resolution_m)
    }

    /// Number of cells.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.width * self.height
    }

    /// Returns true if the grid has no cell.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The position of `cell` in row-major order, the x axis running fastest.
    #[inline]
    #[must_use]
    pub const fn index(&self, cell: Cell) -> usize {
        cell.row * self.width + cell.col
    }

    /// The inverse of [`index`](Self::index).
    #[must_use]
    pub const fn cell(&self, index: usize) -> Cell {
        Cell::new(index % self.width, index / self.width)
    }

    /// The (up to four) cells that share a side with `cell`: right, left, up, down.
    pub fn neighbors4(&self, cell: Cell) -> impl Iterator<Item = Cell> + use<> {
        let (width, height) = (self.width, self.height);
        [(1, 0), (-1, 0), (0, 1), (0, -1)]
            .into_iter()
            .filter_map(move |step| offset(cell, step, width, height))
    }

    /// The (up to eight) cells that share a side or a corner with `cell`, sides first.
    pub fn neighbors8(&self, cell: Cell) -> impl Iterator<Item = Cell> + use<> {
        let (width, height) = (self.width, self.height);
        [(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, 1), (1, -1), (-1, -1)]
            .into_iter()
            .filter_map(move |step| offset(cell, step, width, height))
    }

    /// The smallest axis-aligned rectangle of the world that holds the grid.
    #[must_use]
    pub fn bounds(&self) -> Bounds {
        let (w, h) = (self.width as f64, self.height as f64);
        let corners =
            [(0.0, 0.0), (w, 0.0), (0.0, h), (w, h)].map(|(x, y)| self.from_grid(Vector::new(x, y)));
        let fold = |f: fn(f64, f64) -> f64| {
            Point::new(
                corners.iter().map(|c| c.x).reduce(f).unwrap_or(0.0),
                corners.iter().map(|c| c.y).reduce(f).unwrap_or(0.0),
            )
        };
        Bounds { min: fold(f64::min), max: fold(f64::max) }
    }

    /// Extent along the columns, metres.
    #[must_use]
    pub fn width_m(&self) -> f64 {
        self.width as f64 * self.resolution_m
    }

    /// Extent along the rows, metres.
    #[must_use]
    pub fn height_m(&self) -> f64 {
        self.height as f64 * self.resolution_m
    }
}

fn offset(cell: Cell, (dc, dr): (isize, isize), width: usize, height: usize) -> Option<Cell> {
    let col = cell.col.checked_add_signed(dc).filter(|&c| c < width)?;
    let row = cell.row.checked_add_signed(dr).filter(|&r| r < height)?;
    Some(Cell::new(col, row))
}

/// Why a grid was refused.
#[derive(Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum GridError {
    /// A side is zero or longer than 32 767 cells.
    #[error("map is {width} x {height} cells, each side must be 1 to 32767")]
    Size {
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
    },
    /// The number of cells does not match the size.
    #[error("map has {cells} cells, expected {width} x {height}")]
    Length {
        /// Cells given.
        cells: usize,
        /// Columns.
        width: usize,
        /// Rows.
        height: usize,
    },
    /// The resolution is not a usable number.
    #[error("resolution is {0} m, must be finite and between 1e-6 and 1000")]
    Resolution(f64),
    /// The origin is not finite.
    #[error("origin is not finite")]
    Origin,
    /// A character of a drawn map is unknown.
    #[error("map row {row} has the character {found:?} in column {col}, expected '#', '.', '?' or a space")]
    Character {
        /// Row from the top, from 0.
        row: usize,
        /// Column from the left, from 0.
        col: usize,
        /// The character found.
        found: char,
    },
    /// A row of a drawn map has the wrong length.
    #[error("map row {row} has {found} cells, expected {expected}")]
    RowLength {
        /// Row from the top, from 0.
        row: usize,
        /// Cells found.
        found: usize,
        /// Cells in row 0.
        expected: usize,
    },
}

/// The occupancy matrix of an environment.
#[derive(Clone, Debug, PartialEq)]
pub struct OccupancyGrid {
    frame: GridFrame,
    cells: Vec<Occupancy>,
}

impl OccupancyGrid {
    /// Builds a grid from its frame and its cells, row-major from the lower-left cell.
    ///
    /// # Errors
    /// Returns an error if the size, the resolution or the origin is out of range or the number of
    /// cells does not match the frame.
    pub fn new(frame: GridFrame, cells: Vec<Occupancy>) -> Result<Self, GridError> {
        let GridFrame { width, height, resolution_m, origin } = frame;
        if !(1..=SIDE_MAX).contains(&width) || !(1..=SIDE_MAX).contains(&height) {
            return Err(GridError::Size { width, height });
        }
        if cells.len() != width * height {
            return Err(GridError::Length { cells: cells.len(), width, height });
        }
        if !(1e-6..=1000.0).contains(&resolution_m) {
            return Err(GridError::Resolution(resolution_m));
        }
        if !origin.is_finite() {
            return Err(GridError::Origin);
        }
        Ok(Self { frame, cells })
    }

    /// Where the grid lies in the world.
    #[must_use]
    pub const fn frame(&self) -> &GridFrame {
        &self.frame
    }

    /// What is known of `cell`.
    ///
    /// # Panics
    /// If `cell` lies outside the grid.
    #[must_use]
    pub fn get(&self, cell: Cell) -> Occupancy {
        self.cells[self.frame.index(cell)]
    }

    /// All cells, row-major from the lower-left one.
    #[must_use]
    pub fn cells(&self) -> &[Occupancy] {
        &self.cells
    }

    /// Returns true if `cell` is known to be free.
    #[must_use]
    pub fn is_free(&self, cell: Cell) -> bool {
        self.get(cell) == Occupancy::Free
    }

    /// The same grid with every unknown cell taken as free.
    #[must_use]
    pub fn with_unknown_free(mut self) -> Self {
        for cell in &mut self.cells {
            if *cell == Occupancy::Unknown {
                *cell = Occupancy::Free;
            }
        }
        self
    }

    /// The number of free cells.
    #[must_use]
    pub fn free_count(&self) -> usize {
        self.cells.iter().filter(|&&c| c == Occupancy::Free).count()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frame(origin: Pose) -> GridFrame {
        GridFrame { origin, resolution_m: 0.5, width: 4, height: 3 }
    }

    #[test]
    fn cells_and_metres_round_trip_in_a_turned_frame() {
        let frame = frame(Pose::new(-3.0, 7.0, 1.0));
        for index in 0..frame.len() {
            let cell = frame.cell(index);
            assert_eq!(frame.cell_at(frame.center(cell)), Some(cell), "center of {cell:?}");
            assert_eq!(frame.index(cell), index, "index of {cell:?}");
        }
    }

    #[test]
    fn points_outside_have_no_cell() {
        let frame = frame(Pose::new(0.0, 0.0, 0.0));
        for point in [(-0.01, 0.5), (2.0, 0.5), (0.5, 1.5), (f64::NAN, 0.5), (f64::INFINITY, 0.5)] {
            assert_eq!(frame.cell_at(Point::new(point.0, point.1)), None, "{point:?}");
        }
    }

    #[test]
    fn neighbors_are_the_cells_around_sides_first() {
        let frame = frame(Pose::new(0.0, 0.0, 0.0));
        for cell in (0..frame.len()).map(|index| frame.cell(index)) {
            let off = |other: &Cell| (other.col.abs_diff(cell.col), other.row.abs_diff(cell.row));
            let all: Vec<Cell> = (0..frame.len()).map(|index| frame.cell(index)).collect();
            let count =
                |reach: &[(usize, usize)]| all.iter().filter(|other| reach.contains(&off(other))).count();
            let (sides, around): (Vec<Cell>, Vec<Cell>) =
                (frame.neighbors4(cell).collect(), frame.neighbors8(cell).collect());
            assert_eq!(sides.len(), count(&[(0, 1), (1, 0)]), "{cell:?}: {sides:?}");
            assert_eq!(around.len(), count(&[(0, 1), (1, 0), (1, 1)]), "{cell:?}: {around:?}");
            assert_eq!(around[..sides.len()], sides, "{cell:?}: sides come first");
            let mut distinct = around.clone();
            distinct.sort_unstable_by_key(|other| frame.index(*other));
            distinct.dedup();
            assert_eq!(distinct.len(), around.len(), "{cell:?}: each once: {around:?}");
            assert!(around.iter().all(|other| off(other).0.max(off(other).1) == 1), "{cell:?}: {around:?}");
        }
    }

    #[test]
    fn free_cells_are_counted() {
        let grid = OccupancyGrid::from_ascii(0.5, "#.?\n..#").expect("a sound drawing");
        assert_eq!(grid.free_count(), 3);
    }

    #[test]
    fn broken_grids_are_refused() {
        let free = vec![Occupancy::Free; 12];
        let base = frame(Pose::new(0.0, 0.0, 0.0));
        let with = |change: fn(&mut GridFrame)| {
            let mut frame = base;
            change(&mut frame);
            OccupancyGrid::new(frame, free.clone()).err()
        };
        assert_eq!(with(|_| ()), None, "a sound grid");
        assert_eq!(with(|f| f.width = 0), Some(GridError::Size { width: 0, height: 3 }), "no columns");
        assert_eq!(
            with(|f| f.width = 5),
            Some(GridError::Length { cells: 12, width: 5, height: 3 }),
            "short"
        );
        assert!(
            matches!(with(|f| f.resolution_m = f64::NAN), Some(GridError::Resolution(_))),
            "NaN resolution"
        );
        assert_eq!(with(|f| f.origin.position.x = f64::INFINITY), Some(GridError::Origin), "infinite origin");
    }
}
