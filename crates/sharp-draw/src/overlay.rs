//! Layers of a map as pixels and outlines, for pages that put them together themselves.
//!
//! All of them lie over each other: line 0 is at the top of the map, and one unit is a cell. A pixel is a cell, or on a
//! large map a square of [`cells_per_pixel`] cells.

use resvg::tiny_skia::{ColorU8, Pixmap};
use sharp_space::{Cell, GridFrame, Occupancy, OccupancyGrid, Region};

use crate::color::{STATES, color_states};
use crate::outline::outline;
use crate::png::PngError;
use crate::scene::Viewport;

/// Longest side of a layer, pixels: more than a screen shows.
const SIDE_MAX_PX: usize = 2048;
/// How opaque unknown land is, of 255.
const UNKNOWN_ALPHA: u8 = 64;

/// How many cells the side of a pixel is, for layers of a map with `frame`.
#[must_use]
pub const fn cells_per_pixel(frame: &GridFrame) -> usize {
    let side = if frame.width > frame.height { frame.width } else { frame.height };
    if side > SIDE_MAX_PX { side.div_ceil(SIDE_MAX_PX) } else { 1 }
}

/// The rectangle around all known cells with a margin: left, top, width and height, in cells; the whole map if nothing
/// is known.
#[must_use]
pub fn known_cells(grid: &OccupancyGrid) -> [f64; 4] {
    Viewport::of_known(grid).in_cells()
}

/// Walls as a PNG file: black, opaque where a cell is occupied, a quarter opaque where it is unknown, else
/// transparent. A pixel of several cells shows the most opaque of them.
///
/// # Errors
/// If there is not enough memory, or the pixels cannot be encoded.
pub fn walls_png(grid: &OccupancyGrid) -> Result<Vec<u8>, PngError> {
    layer(grid.frame(), |cells| {
        let alpha = |cell| match grid.get(cell) {
            Occupancy::Occupied => 255,
            Occupancy::Unknown => UNKNOWN_ALPHA,
            Occupancy::Free => 0,
        };
        ColorU8::from_rgba(0, 0, 0, cells.iter().map(|&cell| alpha(cell)).max().unwrap_or(0))
    })
}

/// The cells of each state as a PNG file in the colours of [`Scene::states`](crate::Scene::states), transparent
/// where there is no state.
///
/// # Errors
/// As [`walls_png`].
pub fn states_png(grid: &OccupancyGrid, state_of: &dyn Fn(Cell) -> Option<u32>) -> Result<Vec<u8>, PngError> {
    let frame = grid.frame();
    let states: Vec<Option<u32>> = (0..frame.len()).map(|index| state_of(frame.cell(index))).collect();
    let color_of = color_states(frame, &states);
    layer(frame, |cells| {
        let state = cells.iter().find_map(|&cell| states[frame.index(cell)]);
        state.map_or(ColorU8::from_rgba(0, 0, 0, 0), |state| {
            let [red, green, blue] = STATES[color_of[&state]].rgb();
            ColorU8::from_rgba(red, green, blue, 255)
        })
    })
}

/// The outline of all cells of `regions` as the data of an SVG path, in cells.
#[must_use]
pub fn regions_outline(frame: &GridFrame, regions: &[Region]) -> String {
    let mut is_member = vec![false; frame.len()];
    for cell in regions.iter().flat_map(|region| &region.cells) {
        is_member[frame.index(*cell)] = true;
    }
    outline(frame.width, frame.height, |col, line| {
        is_member[frame.index(Cell::new(col, frame.height - 1 - line))]
    })
}

/// A PNG file whose pixels get the colour that `color` gives to their cells.
fn layer(frame: &GridFrame, color: impl Fn(&[Cell]) -> ColorU8) -> Result<Vec<u8>, PngError> {
    let side = cells_per_pixel(frame);
    let (width, height) = (frame.width.div_ceil(side), frame.height.div_ceil(side));
    let size = PngError::Size { max_side_px: width.max(height) as u32 };
    let mut pixmap = Pixmap::new(width as u32, height as u32).ok_or(size)?;
    let mut cells = Vec::with_capacity(side * side);
    for (index, pixel) in pixmap.pixels_mut().iter_mut().enumerate() {
        let (left, top) = (index % width * side, index / width * side);
        cells.clear();
        for line in top..(top + side).min(frame.height) {
            let row = frame.height - 1 - line;
            cells.extend((left..(left + side).min(frame.width)).map(|col| Cell::new(col, row)));
        }
        *pixel = color(&cells).premultiply();
    }
    pixmap.encode_png().map_err(|error| PngError::Encoding(error.to_string()))
}

#[cfg(test)]
mod tests {
    use image::{GenericImageView, Rgba};
    use sharp_space::{DistanceField, RegionId};

    use super::*;

    #[test]
    fn a_pixel_is_a_cell_with_line_0_at_the_top() {
        let grid = OccupancyGrid::from_ascii(0.5, "#..\n..?").unwrap();
        let walls = image::load_from_memory(&walls_png(&grid).unwrap()).unwrap();
        assert_eq!(walls.dimensions(), (3, 2));
        let alphas: Vec<u8> = walls.pixels().map(|(_, _, Rgba([.., alpha]))| alpha).collect();
        assert_eq!(alphas, [255, 0, 0, 0, 0, 64]);
        // The state is the column, and only the upper row has states.
        let state_of = |cell: Cell| (cell.row == 1).then_some(cell.col as u32);
        let states = image::load_from_memory(&states_png(&grid, &state_of).unwrap()).unwrap();
        let [left, middle] = [0, 1].map(|col| states.get_pixel(col, 0));
        assert_ne!(left, middle, "neighbours differ");
        assert_eq!((left[3], states.get_pixel(0, 1)[3]), (255, 0), "transparent where there is no state");
    }

    #[test]
    fn on_a_large_map_a_pixel_is_several_cells_and_loses_no_wall() {
        let mut cells = vec![Occupancy::Free; 3000 * 2];
        cells[2999] = Occupancy::Occupied;
        let frame = GridFrame {
            origin: sharp_space::Pose::new(0.0, 0.0, 0.0),
            resolution_m: 0.1,
            width: 3000,
            height: 2,
        };
        assert_eq!(cells_per_pixel(&frame), 2);
        let grid = OccupancyGrid::new(frame, cells).unwrap();
        let walls = image::load_from_memory(&walls_png(&grid).unwrap()).unwrap();
        assert_eq!(walls.dimensions(), (1500, 1));
        assert_eq!((walls.get_pixel(1499, 0)[3], walls.get_pixel(1498, 0)[3]), (255, 0));
    }

    #[test]
    fn regions_are_outlined_in_cells() {
        let grid = OccupancyGrid::from_ascii(1.0, "...\n...\n...").unwrap();
        let cells = vec![Cell::new(1, 2)];
        let region = Region::new(RegionId(0), cells, &DistanceField::new(&grid)).unwrap();
        assert_eq!(regions_outline(grid.frame(), &[region]), "M1 0h1v1h-1z");
    }
}
