//! A field over the free cells as sheets of colour.

use sharp_space::{Occupancy, OccupancyGrid};

use crate::color::ramp;
use crate::outline::outline;
use crate::svg::Svg;

/// Blocks along the longer side of a heat map: finer detail than two pixels is not worth bytes.
const HEAT_BLOCKS: usize = 500;
/// Steps of the ramp: more cannot be told apart.
const HEAT_LEVELS: usize = 24;

/// A field averaged over square blocks of free cells, line 0 at the top.
#[derive(Debug)]
pub(super) struct HeatBlocks {
    side: usize,
    width: usize,
    height: usize,
    values: Vec<f64>,
}

impl HeatBlocks {
    /// Blocks without a free cell and values that are not finite count as the lowest.
    pub(super) fn average(grid: &OccupancyGrid, field: &[f32]) -> Self {
        let frame = grid.frame();
        let side = frame.width.max(frame.height).div_ceil(HEAT_BLOCKS);
        let (width, height) = (frame.width.div_ceil(side), frame.height.div_ceil(side));
        let mut sums = vec![(0.0, 0_u32); width * height];
        for (index, &value) in field.iter().enumerate() {
            if grid.cells()[index] == Occupancy::Free && value.is_finite() {
                let cell = frame.cell(index);
                let (sum, count) = &mut sums[(frame.height - 1 - cell.row) / side * width + cell.col / side];
                *sum += f64::from(value);
                *count += 1;
            }
        }
        let values = sums.iter().map(|(sum, count)| sum / f64::from((*count).max(1))).collect();
        Self { side, width, height, values }
    }

    /// The largest value, where the ramp ends.
    pub(super) fn top(&self) -> f64 {
        self.values.iter().copied().fold(f64::MIN_POSITIVE, f64::max)
    }

    /// Levels lie on top of each other like sheets, so no seam can show between them.
    pub(super) fn draw(&self, svg: &mut Svg) {
        let top = self.top();
        svg.open("g", &[("transform", format!("scale({})", self.side))]);
        for level in 0..HEAT_LEVELS {
            let share = level as f64 / HEAT_LEVELS as f64;
            let reaches = |col: usize, line: usize| self.values[line * self.width + col] >= share * top;
            let d = outline(self.width, self.height, reaches);
            if !d.is_empty() {
                let color = ramp(level as f64 / (HEAT_LEVELS - 1) as f64);
                svg.element("path", &[("d", d), ("fill", color.into())]);
            }
        }
        svg.close();
    }
}
