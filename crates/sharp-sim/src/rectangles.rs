//! Blocked cells merged into few rectangles.
//!
//! In an engine, a robot that grazes a wall of single cells gets stuck at the seams between them. Long
//! rectangles have few seams and cost less time.

use sharp_space::{Cell, OccupancyGrid};

/// A block of cells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct CellRectangle {
    /// Its lower-left cell.
    pub(crate) corner: Cell,
    /// Number of columns.
    pub(crate) width: usize,
    /// Number of rows.
    pub(crate) height: usize,
}

/// Covers everything in `grid` that is not free by rectangles that do not overlap.
///
/// Greedy, in row-major order: each rectangle grows to the right, then upwards or the other way
/// round, whichever covers more.
pub(crate) fn merge_blocked_cells(grid: &OccupancyGrid) -> Vec<CellRectangle> {
    let frame = grid.frame();
    let mut open: Vec<bool> = (0..frame.len()).map(|i| !grid.is_free(frame.cell(i))).collect();
    let mut rectangles = Vec::new();
    for index in 0..frame.len() {
        if !open[index] {
            continue;
        }
        let corner = frame.cell(index);
        let is_open = |col: usize, row: usize| {
            col < frame.width && row < frame.height && open[frame.index(Cell::new(col, row))]
        };
        let rectangle = grow(corner, &is_open);
        for row in corner.row..corner.row + rectangle.height {
            let start = frame.index(Cell::new(corner.col, row));
            open[start..start + rectangle.width].fill(false);
        }
        rectangles.push(rectangle);
    }
    rectangles
}

/// The larger of "right, then up" and "up, then right".
fn grow(corner: Cell, is_open: &dyn Fn(usize, usize) -> bool) -> CellRectangle {
    let Cell { row, col } = corner;
    let run = |test: &dyn Fn(usize) -> bool| (1..).take_while(|&i| test(i)).count() + 1;
    let wide = run(&|i| is_open(col + i, row));
    let wide_height = run(&|j| (0..wide).all(|i| is_open(col + i, row + j)));
    let tall = run(&|j| is_open(col, row + j));
    let tall_width = run(&|i| (0..tall).all(|j| is_open(col + i, row + j)));
    if wide * wide_height >= tall * tall_width {
        CellRectangle { corner, width: wide, height: wide_height }
    } else {
        CellRectangle { corner, width: tall_width, height: tall }
    }
}

#[cfg(test)]
mod tests {
    use sharp_space::Occupancy;

    use super::*;

    fn check(grid: &OccupancyGrid) {
        let mut covered = vec![0; grid.frame().len()];
        for rectangle in merge_blocked_cells(grid) {
            for row in 0..rectangle.height {
                for col in 0..rectangle.width {
                    let cell = Cell::new(rectangle.corner.col + col, rectangle.corner.row + row);
                    covered[grid.frame().index(cell)] += 1;
                }
            }
        }
        for (index, count) in covered.into_iter().enumerate() {
            let cell = grid.frame().cell(index);
            assert_eq!(count, usize::from(!grid.is_free(cell)), "{cell:?} in\n{grid}");
        }
    }

    #[test]
    fn rectangles_cover_exactly_the_blocked_cells() {
        arbtest::arbtest(|u| {
            let (width, height) = (u.int_in_range(1..=12)?, u.int_in_range(1..=12)?);
            let mut cells = vec![Occupancy::Free; width * height];
            for cell in &mut cells {
                *cell = *u.choose(&[Occupancy::Free, Occupancy::Occupied, Occupancy::Unknown])?;
            }
            let frame = sharp_space::GridFrame {
                origin: sharp_space::Pose::new(0.0, 0.0, 0.0),
                resolution_m: 1.0,
                width,
                height,
            };
            check(&OccupancyGrid::new(frame, cells).expect("a sound grid"));
            Ok(())
        });
    }

    #[test]
    fn a_room_needs_four_rectangles() {
        let grid = OccupancyGrid::from_ascii(
            1.0,
            "
            ########
            #......#
            #......#
            ########",
        )
        .unwrap();
        assert_eq!(merge_blocked_cells(&grid).len(), 4, "one for each wall");
    }
}
