//! Exact Euclidean distance transform of an occupancy grid.
//!
//! Two passes of lower envelopes of parabolas (Felzenszwalb and Huttenlocher, "Distance Transforms of Sampled
//! Functions", 2012): linear in the number of cells, exact between cell centres. Every cell outside the grid
//! counts as blocked, because a robot may not leave the map.

use std::sync::OnceLock;

use crate::grid::{Cell, GridFrame, OccupancyGrid};
use crate::pose::Point;
use crate::widest_paths::WidestPaths;

/// For each cell, the distance from its centre to the centre of the nearest blocked cell.
#[derive(Clone, Debug)]
pub struct DistanceField {
    frame: GridFrame,
    /// Metres, row-major.
    distances: Vec<f32>,
    /// Made when they are first asked for.
    widest_paths: OnceLock<WidestPaths>,
}

impl DistanceField {
    /// The distance field of everything in `grid` that is not free.
    #[must_use]
    pub fn new(grid: &OccupancyGrid) -> Self {
        Self::from_mask(*grid.frame(), |index| grid.cells()[index] != crate::Occupancy::Free)
    }

    /// The distance field of the cells for which `blocked` holds.
    #[must_use]
    pub fn from_mask(frame: GridFrame, blocked: impl Fn(usize) -> bool) -> Self {
        let (width, height) = (frame.width, frame.height);
        let mut squared = vec![0.0_f32; frame.len()];
        // Distance within the column; the rows just outside the grid are blocked.
        for col in 0..width {
            let mut run = 0.0_f32;
            for row in 0..height {
                run = if blocked(row * width + col) { 0.0 } else { run + 1.0 };
                squared[row * width + col] = run;
            }
            run = 0.0;
            for row in (0..height).rev() {
                let cell = &mut squared[row * width + col];
                run = if *cell == 0.0 { 0.0 } else { run + 1.0 };
                *cell = cell.min(run);
            }
        }
        let mut line = LowerEnvelope::new(width + 2);
        for row in squared.chunks_exact_mut(width) {
            line.transform_row(row);
        }
        let resolution = frame.resolution_m as f32;
        for distance in &mut squared {
            *distance = distance.sqrt() * resolution;
        }
        Self { frame, distances: squared, widest_paths: OnceLock::new() }
    }

    /// The frame of the grid it was made from.
    #[inline]
    #[must_use]
    pub const fn frame(&self) -> &GridFrame {
        &self.frame
    }

    /// Metres from the centre of `cell` to the centre of the nearest blocked cell; 0 in a blocked cell.
    ///
    /// # Panics
    /// If `cell` lies outside the grid.
    #[inline]
    #[must_use]
    pub fn at(&self, cell: Cell) -> f64 {
        f64::from(self.distances[self.frame.index(cell)])
    }

    /// The widest ways between cells, made when they are first asked for.
    pub fn widest_paths(&self) -> &WidestPaths {
        self.widest_paths.get_or_init(|| WidestPaths::new(self))
    }

    /// The same if somebody asked for them before.
    #[must_use]
    pub fn made_widest_paths(&self) -> Option<&WidestPaths> {
        self.widest_paths.get()
    }

    /// Bilinear interpolation at `point`, metres; 0 outside the grid.
    #[inline]
    #[must_use]
    pub fn sample(&self, point: Point) -> f64 {
        let g = self.frame.to_grid(point);
        let (width, height) = (self.frame.width as f64, self.frame.height as f64);
        let inside = g.x >= 0.0 && g.y >= 0.0 && g.x < width && g.y < height;
        if !inside {
            return 0.0;
        }
        let (x, y) = ((g.x - 0.5).clamp(0.0, width - 1.0), (g.y - 0.5).clamp(0.0, height - 1.0));
        let (col, row) = (x as usize, y as usize);
        let (col1, row1) = ((col + 1).min(self.frame.width - 1), (row + 1).min(self.frame.height - 1));
        let (tx, ty) = (x - col as f64, y - row as f64);
        let at = |col, row| self.at(Cell::new(col, row));
        let low = at(col, row) * (1.0 - tx) + at(col1, row) * tx;
        let high = at(col, row1) * (1.0 - tx) + at(col1, row1) * tx;
        low * (1.0 - ty) + high * ty
    }

    /// A lower bound of the distance from `point` to the nearest blocked *area*, metres.
    ///
    /// Centre-to-centre distances overestimate by up to half a diagonal at either end, so both halves are
    /// subtracted. The bound is 0 outside the grid.
    #[must_use]
    pub fn clearance_lower_bound(&self, point: Point) -> f64 {
        self.frame
            .cell_at(point)
            .map_or(0.0, |cell| (self.at(cell) - std::f64::consts::SQRT_2 * self.frame.resolution_m).max(0.0))
    }
}

/// Lower envelope of parabolas over one row with a blocked cell at either side.
struct LowerEnvelope {
    heights: Vec<f32>,
    vertices: Vec<usize>,
    /// In double precision: squares of columns beyond 4,096 do not fit into single precision.
    bounds: Vec<f64>,
}

impl LowerEnvelope {
    fn new(len: usize) -> Self {
        Self { heights: vec![0.0; len], vertices: vec![0; len], bounds: vec![0.0; len + 1] }
    }

    /// Replaces column distances (in cells) by squared Euclidean distances (in cells).
    fn transform_row(&mut self, row: &mut [f32]) {
        let len = row.len() + 2;
        self.heights[0] = 0.0;
        self.heights[len - 1] = 0.0;
        for (height, value) in self.heights[1..len - 1].iter_mut().zip(row.iter()) {
            *height = value * value;
        }
        let mut last = 0;
        self.vertices[0] = 0;
        self.bounds[0] = f64::NEG_INFINITY;
        for q in 1..len {
            loop {
                let v = self.vertices[last];
                let (qf, vf) = (q as f64, v as f64);
                let rise = f64::from(self.heights[q]) - f64::from(self.heights[v]);
                let meet = 0.5 * (rise / (qf - vf) + qf + vf);
                if meet <= self.bounds[last] && last > 0 {
                    last -= 1;
                    continue;
                }
                if meet > self.bounds[last] {
                    last += 1;
                }
                self.vertices[last] = q;
                self.bounds[last] = meet;
                break;
            }
        }
        let mut k = 0;
        for (col, value) in row.iter_mut().enumerate() {
            let q = (col + 1) as f32;
            while k < last && self.bounds[k + 1] < f64::from(q) {
                k += 1;
            }
            let d = q - self.vertices[k] as f32;
            *value = d * d + self.heights[self.vertices[k]];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pose::Pose;
    use crate::trig;

    fn brute_force(frame: &GridFrame, mask: &[bool], cell: Cell) -> f64 {
        let outside = [cell.col + 1, cell.row + 1, frame.width - cell.col, frame.height - cell.row];
        let border = outside.into_iter().min().unwrap_or(0) as f64;
        let inside = (0..frame.len()).filter(|&i| mask[i]).map(|i| {
            let other = frame.cell(i);
            trig::hypot(cell.col as f64 - other.col as f64, cell.row as f64 - other.row as f64)
        });
        inside.fold(border, f64::min) * frame.resolution_m
    }

    #[test]
    fn agrees_with_brute_force_on_random_masks() {
        arbtest::arbtest(|u| {
            let (width, height) = (u.int_in_range(1..=17)?, u.int_in_range(1..=13)?);
            let frame = GridFrame { origin: Pose::new(0.0, 0.0, 0.0), resolution_m: 0.25, width, height };
            let mask = (0..frame.len()).map(|_| u.ratio(1, 9)).collect::<Result<Vec<bool>, _>>()?;
            let field = DistanceField::from_mask(frame, |i| mask[i]);
            for index in 0..frame.len() {
                let cell = frame.cell(index);
                let expected = brute_force(&frame, &mask, cell);
                assert!(
                    (field.at(cell) - expected).abs() < 1e-5,
                    "{cell:?}: {} not {expected}",
                    field.at(cell)
                );
            }
            Ok(())
        });
    }

    #[test]
    fn outside_the_grid_the_clearance_is_zero() {
        let frame = GridFrame { origin: Pose::new(0.0, 0.0, 0.0), resolution_m: 1.0, width: 5, height: 5 };
        let field = DistanceField::from_mask(frame, |_| false);
        assert_eq!(field.sample(Point::new(-0.1, 2.0)), 0.0, "left of the map");
        assert_eq!(field.at(Cell::new(2, 2)), 3.0, "the nearest blocked cell lies outside the border");
    }
    #[test]
    fn between_centres_the_clearance_is_that_of_four_cells() {
        let (frame, mask) = (
            GridFrame { origin: Pose::new(0.0, 0.0, 0.0), resolution_m: 0.5, width: 7, height: 6 },
            [10, 11, 25, 38],
        );
        let field = DistanceField::from_mask(frame, |i| mask.contains(&i));
        let at = |col, row| field.at(Cell::new(col, row));
        for (col, row) in (0..6).flat_map(|col| (0..5).map(move |row| (col, row))) {
            for (tx, ty) in [(0.0, 0.0), (0.25, 0.0), (0.0, 0.75), (0.5, 0.5), (0.875, 0.125)] {
                let low = at(col, row) + tx * (at(col + 1, row) - at(col, row));
                let high = at(col, row + 1) + tx * (at(col + 1, row + 1) - at(col, row + 1));
                let point = Point::new((col as f64 + 0.5 + tx) * 0.5, (row as f64 + 0.5 + ty) * 0.5);
                let (found, expected) = (field.sample(point), low + ty * (high - low));
                assert!((found - expected).abs() < 1e-9, "{point:?}: {found}, expected {expected}");
            }
        }
        // There is no cell beyond the outermost centres.
        assert_eq!(field.sample(Point::new(0.01, 0.01)), at(0, 0), "lower left");
        assert_eq!(field.sample(Point::new(3.49, 2.99)), at(6, 5), "upper right");
        assert_eq!(field.sample(Point::new(3.5, 1.0)), 0.0, "on the border it is outside");
        assert_eq!(field.sample(Point::new(1.0, 3.0)), 0.0, "on the border it is outside");
    }
}
