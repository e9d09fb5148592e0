//! Changes to a map that was read: keep-out masks and coarser cells.

use sharp_space::{Cell, GridFrame, Occupancy, OccupancyGrid, Vector};

use super::error::MapError;
use super::load::{MapFile, SIDE_MAX};

/// How far a mask's cell may reach into a map's cell without touching it, in cells: frames are not exact.
const TOUCH: f64 = 1e-6;

/// Cells of a map that is drawn finer, at most: 4000 x 4000.
const REFINED_MAX_CELLS: usize = 16_000_000;

impl MapFile {
    /// Occupies every cell that an occupied cell of `mask` overlaps, as a keep-out mask of Nav2 does, and returns how many
    /// cells were not occupied before. The mask has its own frame and resolution. Its free and unknown cells change nothing.
    ///
    /// # Errors
    /// If the result is no grid; a map that was read always gives one.
    pub fn keep_out(&mut self, mask: &OccupancyGrid) -> Result<usize, MapError> {
        let frame = *self.grid.frame();
        let mut cells = self.grid.cells().to_vec();
        let mut kept_out = 0;
        for (index, _) in mask.cells().iter().enumerate().filter(|(_, cell)| **cell == Occupancy::Occupied) {
            for cell in overlapped(&frame, mask.frame(), mask.frame().cell(index)) {
                let before = std::mem::replace(&mut cells[frame.index(cell)], Occupancy::Occupied);
                kept_out += usize::from(before != Occupancy::Occupied);
            }
        }
        self.set_grid(frame, cells)?;
        Ok(kept_out)
    }

    /// Makes cells of `factor` x `factor` cells. A coarse cell is occupied if any of its cells is, or if it reaches beyond
    /// the map; else unknown if any is.
    ///
    /// # Errors
    /// If the cells become larger than 1000 m.
    pub fn downsample(&mut self, factor: usize) -> Result<(), MapError> {
        let fine = *self.grid.frame();
        let factor = factor.max(1);
        let frame = GridFrame {
            resolution_m: fine.resolution_m * factor as f64,
            width: fine.width.div_ceil(factor),
            height: fine.height.div_ceil(factor),
            ..fine
        };
        let of = |row: usize, col: usize| {
            let (rows, cols) = (row * factor..(row + 1) * factor, col * factor..(col + 1) * factor);
            if rows.end > fine.height || cols.end > fine.width {
                return Occupancy::Occupied;
            }
            let mut coarse = Occupancy::Free;
            for row in rows {
                for cell in &self.grid.cells()[row * fine.width..][cols.clone()] {
                    match cell {
                        Occupancy::Occupied => return Occupancy::Occupied,
                        Occupancy::Unknown => coarse = Occupancy::Unknown,
                        Occupancy::Free => {}
                    }
                }
            }
            coarse
        };
        let cells = (0..frame.len()).map(|index| of(index / frame.width, index % frame.width)).collect();
        self.set_grid(frame, cells)
    }

    /// The grid, its cells divided so that none is wider than `most_m` metres, as far as 16 million cells and the longest side
    /// of a grid allow: the same map drawn finer.
    #[must_use]
    pub fn grid_with_cells(&self, most_m: f64) -> OccupancyGrid {
        let coarse = *self.grid.frame();
        let wanted = (coarse.resolution_m / most_m - 1e-9).ceil().max(1.0);
        let allowed = (REFINED_MAX_CELLS as f64 / coarse.len() as f64).sqrt().max(1.0);
        let longest = SIDE_MAX / coarse.width.max(coarse.height);
        let factor = (wanted.min(allowed).floor() as usize).min(longest);
        if factor == 1 {
            return self.grid.clone();
        }
        let frame = GridFrame {
            resolution_m: coarse.resolution_m / factor as f64,
            width: coarse.width * factor,
            height: coarse.height * factor,
            ..coarse
        };
        let of = |index: usize| {
            let Cell { col, row } = frame.cell(index);
            self.grid.get(Cell::new(col / factor, row / factor))
        };
        let cells = (0..frame.len()).map(of).collect();
        OccupancyGrid::new(frame, cells).expect("a grid stays one when its cells are divided")
    }

    fn set_grid(&mut self, frame: GridFrame, cells: Vec<Occupancy>) -> Result<(), MapError> {
        self.grid = OccupancyGrid::new(frame, cells).map_err(|source| MapError::grid(&self.name, source))?;
        Ok(())
    }
}

/// The cells of `frame` in the smallest rectangle around `cell` of `mask`: exactly those it overlaps unless one grid is
/// turned against the other, then a few more.
fn overlapped(frame: &GridFrame, mask: &GridFrame, cell: Cell) -> impl Iterator<Item = Cell> + use<> {
    let corner = |col: usize, row: usize| {
        frame.to_grid(mask.from_grid(Vector::new((cell.col + col) as f64, (cell.row + row) as f64)))
    };
    let corners = [corner(0, 0), corner(1, 0), corner(0, 1), corner(1, 1)];
    let range = |of: fn(&Vector) -> f64, count: usize| {
        let low = corners.iter().map(of).fold(f64::INFINITY, f64::min) + TOUCH;
        let high = corners.iter().map(of).fold(f64::NEG_INFINITY, f64::max) - TOUCH;
        low.floor().max(0.0) as usize..(high.ceil().max(0.0) as usize).min(count)
    };
    let (cols, rows) = (range(|c| c.x, frame.width), range(|c| c.y, frame.height));
    rows.flat_map(move |row| cols.clone().map(move |col| Cell::new(col, row)))
}

#[cfg(test)]
mod tests {
    use sharp_space::Pose;

    use super::*;

    fn map(drawing: &str) -> MapFile {
        let grid = OccupancyGrid::from_ascii(0.5, drawing).expect("a drawing");
        let picture = *grid.frame();
        MapFile { name: "drawn".to_owned(), grid, problems: vec![], warnings: vec![], picture }
    }

    fn at(drawing: &str, resolution_m: f64, origin: Pose) -> OccupancyGrid {
        let grid = OccupancyGrid::from_ascii(resolution_m, drawing).expect("a drawing");
        let frame = GridFrame { origin, resolution_m, ..*grid.frame() };
        OccupancyGrid::new(frame, grid.cells().to_vec()).expect("a grid")
    }

    #[test]
    fn a_mask_occupies_the_cells_that_it_overlaps_and_no_others() {
        let mut kept = map("......\n......\n......\n......");
        // Cells of a metre, half a metre off to the right: columns 1 to 4.
        let mask = at("#.\n?#", 1.0, Pose::new(0.5, 0.0, 0.0));
        assert_eq!(kept.keep_out(&mask).expect("a grid"), 8);
        assert_eq!(kept.grid.to_string(), ".##...\n.##...\n...##.\n...##.\n");
        let mut turned = map("....\n....\n....\n....");
        let mask = at("#", 0.5, Pose::new(1.0, 0.8, std::f64::consts::FRAC_PI_4));
        let count = turned.keep_out(&mask).expect("a grid");
        assert!((4..=6).contains(&count), "a turned cell touches its neighbours:\n{}", turned.grid);
        let mut far = map("....");
        assert_eq!(far.keep_out(&at("#", 0.5, Pose::new(50.0, 0.0, 0.0))).expect("a grid"), 0);
        assert_eq!(far.grid.to_string(), "....\n");
    }

    #[test]
    fn coarse_cells_are_occupied_if_anything_in_them_is() {
        let mut coarse = map("....?..\n...#...\n.......\n.......\n.......");
        coarse.downsample(2).expect("a grid");
        // The upper row and the right column reach beyond the map.
        assert_eq!(coarse.grid.to_string(), "####\n.#.#\n...#\n");
        assert_eq!(coarse.grid.frame().resolution_m, 1.0, "metres a cell");
        let mut same = map("..#\n?..");
        same.downsample(1).expect("a grid");
        assert_eq!(same.grid.to_string(), "..#\n?..\n");
        let mut unknown = map("..?.\n....");
        unknown.downsample(2).expect("a grid");
        assert_eq!(unknown.grid.to_string(), ".?\n");
    }

    #[test]
    fn a_map_drawn_finer_has_the_same_walls_in_the_same_places() {
        let coarse = map("#..\n.?#");
        let fine = coarse.grid_with_cells(0.2);
        let frame = fine.frame();
        assert_eq!((frame.width, frame.height), (9, 6), "cells of 0.5 m in three");
        for index in 0..frame.len() {
            let cell = frame.cell(index);
            let before = coarse.grid.frame().cell_at(frame.center(cell)).expect("inside");
            assert_eq!(fine.get(cell), coarse.grid.get(before), "{cell:?}");
        }
        assert_eq!(coarse.grid_with_cells(0.5), coarse.grid, "fine enough as it is");
    }
}
