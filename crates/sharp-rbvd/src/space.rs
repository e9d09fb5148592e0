//! The free cells of a grid and the moves between them.
//!
//! A move goes to one of the eight surrounding cells. A diagonal move needs both cells beside it to
//! be free, because a robot that cuts a corner hits it. So two cells that moves connect are also
//! connected by moves across the sides of cells.

use sharp_space::{DistanceField, GridFrame};

/// The state of a cell that has none.
pub(crate) const NONE: u32 = u32::MAX;

/// Length of a move along a side; 99/70 is √2 to 5e-5, and whole numbers make ties exact.
pub(crate) const STRAIGHT: u32 = 70;
/// Length of a diagonal move.
pub(crate) const DIAGONAL: u32 = 99;

/// The cells a robot may be in.
pub(crate) struct FreeSpace {
    pub(crate) frame: GridFrame,
    free: Vec<bool>,
}

impl FreeSpace {
    /// The unblocked cells whose clearance is at least `min_clearance_m`.
    pub(crate) fn new(clearance: &DistanceField, min_clearance_m: f64) -> Self {
        let frame = *clearance.frame();
        let is_free = |index| {
            let distance = clearance.at(frame.cell(index));
            distance > 0.0 && distance >= min_clearance_m
        };
        Self { frame, free: (0..frame.len()).map(is_free).collect() }
    }

    /// Returns true if the cell number `index` is free.
    pub(crate) fn is_free(&self, index: usize) -> bool {
        self.free[index]
    }

    /// The cells one move away from `index`, sides first, each with the length of the move.
    pub(crate) fn moves(&self, index: usize) -> impl Iterator<Item = (usize, u32)> + use<> {
        let width = self.frame.width;
        let col = index % width;
        let right = col + 1 < width && self.free[index + 1];
        let left = col > 0 && self.free[index - 1];
        let up = index + width < self.free.len() && self.free[index + width];
        let down = index >= width && self.free[index - width];
        let corner = |open: bool, ahead: usize| (open && self.free[ahead]).then_some((ahead, DIAGONAL));
        [
            right.then_some((index + 1, STRAIGHT)),
            left.then(|| (index - 1, STRAIGHT)),
            up.then_some((index + width, STRAIGHT)),
            down.then(|| (index - width, STRAIGHT)),
            corner(right && up, index + width + 1),
            corner(left && up, (index + width).wrapping_sub(1)),
            corner(right && down, (index + 1).wrapping_sub(width)),
            corner(left && down, index.wrapping_sub(width + 1)),
        ]
        .into_iter()
        .flatten()
    }

    /// The cells that moves through cells satisfying `admit` connect to `start`, in the order found.
    ///
    /// `seen` remembers visited cells between calls; `start` must not be among them.
    pub(crate) fn flood(&self, start: usize, seen: &mut [bool], admit: impl Fn(usize) -> bool) -> Vec<usize> {
        let mut found = vec![start];
        seen[start] = true;
        let mut next = 0;
        while let Some(&index) = found.get(next) {
            next += 1;
            for (other, _) in self.moves(index) {
                if !seen[other] && admit(other) {
                    seen[other] = true;
                    found.push(other);
                }
            }
        }
        found
    }
}

#[cfg(test)]
mod tests {
    use sharp_space::OccupancyGrid;

    use super::*;

    fn space(drawing: &str) -> FreeSpace {
        let grid = OccupancyGrid::from_ascii(1.0, drawing).unwrap();
        FreeSpace::new(&DistanceField::new(&grid), 0.0)
    }

    #[test]
    fn an_open_cell_has_eight_moves() {
        let moves: Vec<_> = space("...\n...\n...").moves(4).collect();
        let cells: Vec<usize> = moves.iter().map(|m| m.0).collect();
        assert_eq!(cells, [5, 3, 7, 1, 8, 6, 2, 0]);
        assert_eq!(moves[0].1, STRAIGHT);
        assert_eq!(moves[7].1, DIAGONAL);
    }

    #[test]
    fn moves_cut_no_corner_and_stay_on_the_grid() {
        let count = |drawing, index| space(drawing).moves(index).count();
        assert_eq!(count("..\n#.", 1), 1, "from the lower right only up: the diagonal cuts the corner");
        assert_eq!(count("..\n..", 0), 3, "lower left corner");
        assert_eq!(count("..\n..", 3), 3, "upper right corner");
    }
}
