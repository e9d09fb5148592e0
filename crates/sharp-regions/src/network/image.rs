//! A map as the network sees it: pixels of one physical size, whatever the map's resolution.

use sharp_space::{Cell, DistanceField, GridFrame, OccupancyGrid, Vector};

use crate::pixel::{PIXEL_M, pixel_frame};

/// Clearance beyond which the network sees no difference, metres.
const CLEARANCE_MAX_M: f64 = 2.0;

/// The input planes of a map.
#[derive(Clone, Debug)]
pub(crate) struct Image {
    /// Where the pixels lie in the world.
    pub frame: GridFrame,
    /// Share of each pixel that is blocked, row-major.
    pub blocked: Vec<f32>,
    /// Clearance at each pixel's centre, 0 to 1 for 0 to [`CLEARANCE_MAX_M`].
    pub clearance: Vec<f32>,
}

impl Image {
    pub(crate) fn new(grid: &OccupancyGrid, clearance: &DistanceField) -> Self {
        let frame = pixel_frame(grid.frame());
        let near = |index: usize| {
            let distance_m = clearance.sample(frame.center(frame.cell(index)));
            (distance_m / CLEARANCE_MAX_M).min(1.0) as f32
        };
        Self { frame, blocked: coverage(grid, &frame), clearance: (0..frame.len()).map(near).collect() }
    }
}

/// The share of each pixel that is blocked or lies outside the grid.
fn coverage(grid: &OccupancyGrid, frame: &GridFrame) -> Vec<f32> {
    let scale = PIXEL_M / grid.frame().resolution_m;
    let columns: Vec<_> = (0..frame.width).map(|i| overlaps(i, scale, grid.frame().width)).collect();
    let rows: Vec<_> = (0..frame.height).map(|i| overlaps(i, scale, grid.frame().height)).collect();
    let mut blocked = Vec::with_capacity(frame.len());
    for row in &rows {
        for column in &columns {
            let free: f64 = row
                .iter()
                .flat_map(|&(r, high)| column.iter().map(move |&(c, wide)| (Cell::new(c, r), high * wide)))
                .filter(|&(cell, _)| grid.is_free(cell))
                .map(|(_, share)| share)
                .sum();
            blocked.push((1.0 - free) as f32);
        }
    }
    blocked
}

/// The cells that pixel `index` overlaps along one axis, and the share of the pixel each takes.
fn overlaps(index: usize, scale: f64, cells: usize) -> Vec<(usize, f64)> {
    let (from, to) = (index as f64 * scale, (index + 1) as f64 * scale);
    (from as usize..cells.min(to.ceil() as usize))
        .map(|cell| (cell, (to.min(cell as f64 + 1.0) - from.max(cell as f64)) / scale))
        .filter(|&(_, share)| share > 1e-9)
        .collect()
}

/// Bilinear interpolation of a row-major plane of pixels at `pixel` (column and row from the
/// lower-left corner of the plane, in pixels).
pub(crate) fn sample_plane(plane: &[f32], frame: &GridFrame, pixel: Vector) -> f32 {
    let clamp = |v: f64, side: usize| (v - 0.5).clamp(0.0, side as f64 - 1.0);
    let (x, y) = (clamp(pixel.x, frame.width), clamp(pixel.y, frame.height));
    let (col, row) = (x as usize, y as usize);
    let (col1, row1) = ((col + 1).min(frame.width - 1), (row + 1).min(frame.height - 1));
    let (tx, ty) = ((x - col as f64) as f32, (y - row as f64) as f32);
    let at = |col: usize, row: usize| plane[row * frame.width + col];
    let low = at(col, row) * (1.0 - tx) + at(col1, row) * tx;
    let high = at(col, row1) * (1.0 - tx) + at(col1, row1) * tx;
    low * (1.0 - ty) + high * ty
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image(resolution_m: f64, drawing: &str) -> Image {
        let grid = OccupancyGrid::from_ascii(resolution_m, drawing).unwrap();
        Image::new(&grid, &DistanceField::new(&grid))
    }

    #[test]
    fn every_resolution_gives_pixels_of_one_size() {
        assert_eq!(image(0.0625, "#.#.\n....").blocked, [0.25, 0.25], "two cells a pixel");
        assert_eq!(image(0.25, "#.").blocked, [1.0, 1.0, 0.0, 0.0, 1.0, 1.0, 0.0, 0.0], "two pixels a cell");
        let cut = image(0.1, "..").blocked;
        assert_eq!(cut.len(), 2, "0.2 m are two pixels");
        assert!((cut[1] - (1.0 - 0.6 * 0.8)).abs() < 1e-6, "outside counts as blocked: {cut:?}");
    }

    #[test]
    fn planes_are_interpolated_between_pixel_centres() {
        let frame = image(0.125, "..\n..").frame;
        let plane = [0.0, 1.0, 2.0, 3.0];
        for (x, y, expected) in [(0.5, 0.5, 0.0), (1.0, 0.5, 0.5), (1.0, 1.0, 1.5), (9.0, 9.0, 3.0)] {
            assert_eq!(sample_plane(&plane, &frame, Vector::new(x, y)), expected, "at {x}, {y}");
        }
    }
}
