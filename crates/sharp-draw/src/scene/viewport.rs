//! The part of the map that a picture shows, and how the world lies in it.

use sharp_space::{Cell, GridFrame, Occupancy, OccupancyGrid, Point, Vector};

/// Width or height of the map in the picture, pixels, whichever is longer.
const SIDE_PX: f64 = 1000.0;
/// Margin of unknown land kept around the known cells, as a share of their longer side.
const MARGIN: f64 = 0.02;

/// A rectangle of cells, line 0 at the top of the map.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Viewport {
    frame: GridFrame,
    left: usize,
    top: usize,
    width: usize,
    height: usize,
}

impl Viewport {
    /// The rectangle around all known cells with a margin; everything if nothing is known.
    pub(crate) fn of_known(grid: &OccupancyGrid) -> Self {
        let frame = *grid.frame();
        let known = (0..frame.len()).filter(|&index| grid.cells()[index] != Occupancy::Unknown);
        let (mut low, mut high) = ((frame.width, frame.height), (0, 0));
        for Cell { col, row } in known.map(|index| frame.cell(index)) {
            low = (low.0.min(col), low.1.min(row));
            high = (high.0.max(col + 1), high.1.max(row + 1));
        }
        if high == (0, 0) {
            return Self { frame, left: 0, top: 0, width: frame.width, height: frame.height };
        }
        let margin = ((high.0 - low.0).max(high.1 - low.1) as f64 * MARGIN).ceil() as usize;
        let (left, bottom) = (low.0.saturating_sub(margin), low.1.saturating_sub(margin));
        let (right, top) = ((high.0 + margin).min(frame.width), (high.1 + margin).min(frame.height));
        Self { frame, left, top: frame.height - top, width: right - left, height: top - bottom }
    }

    /// Left, top, width and height, cells.
    pub(crate) fn in_cells(&self) -> [f64; 4] {
        [self.left, self.top, self.width, self.height].map(|cells| cells as f64)
    }

    /// Width and height in the picture, pixels.
    pub(super) fn size_px(&self) -> [f64; 2] {
        [self.width, self.height].map(|cells| cells as f64 / self.pixel())
    }

    /// The length of one pixel, cells.
    pub(super) fn pixel(&self) -> f64 {
        self.width.max(self.height) as f64 / SIDE_PX
    }

    /// Pixels of one metre.
    pub(super) fn px_per_m(&self) -> f64 {
        1.0 / (self.pixel() * self.frame.resolution_m)
    }

    /// A point of the world in cells, y downwards.
    pub(super) fn cells(&self, point: Point) -> Vector {
        let on_grid = self.frame.to_grid(point);
        Vector::new(on_grid.x, self.frame.height as f64 - on_grid.y)
    }

    /// A point of the world in pixels from the top left corner of the window.
    pub(super) fn pixels(&self, point: Point) -> [f64; 2] {
        let at = self.cells(point);
        [(at.x - self.left as f64) / self.pixel(), (at.y - self.top as f64) / self.pixel()]
    }

    /// The cell of the map under a place in the window, pixels; `None` outside the map.
    pub(super) fn cell_at(&self, [x, y]: [f64; 2]) -> Option<Cell> {
        let (col, line) = (x * self.pixel() + self.left as f64, y * self.pixel() + self.top as f64);
        let is_inside =
            col >= 0.0 && line >= 0.0 && col < self.frame.width as f64 && line < self.frame.height as f64;
        is_inside.then(|| Cell::new(col as usize, self.frame.height - 1 - line as usize))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_picture_is_cut_to_what_is_known() {
        let unknown_margin = OccupancyGrid::from_ascii(1.0, "?????\n??.#?\n?????\n?????").unwrap();
        assert_eq!(Viewport::of_known(&unknown_margin).in_cells(), [1.0, 0.0, 4.0, 3.0]);
        let nothing = OccupancyGrid::from_ascii(1.0, "??\n??").unwrap();
        assert_eq!(Viewport::of_known(&nothing).in_cells(), [0.0, 0.0, 2.0, 2.0]);
    }

    #[test]
    fn pixels_lead_back_to_their_cell() {
        let grid = OccupancyGrid::from_ascii(0.5, "????\n?..?\n?..?\n????").unwrap();
        let view = Viewport::of_known(&grid);
        for cell in [Cell::new(1, 1), Cell::new(2, 2), Cell::new(0, 3)] {
            let place = view.pixels(grid.frame().center(cell));
            assert_eq!(view.cell_at(place), Some(cell), "at {place:?}");
        }
        assert_eq!(view.cell_at([-1.0, 5.0]), None);
        assert_eq!(view.px_per_m() * 2.0, view.size_px()[0], "four cells of half a metre are two metres");
    }
}
