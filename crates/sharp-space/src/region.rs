//! Critical regions φ ∈ Φ, from a detector or a list.

use serde::{Deserialize, Serialize};

use crate::distance_field::DistanceField;
use crate::grid::{Cell, GridFrame};
use crate::pose::Point;
use crate::trig;

/// Names a region; equal to its position in the set Φ.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct RegionId(pub u32);

/// A connected set of free cells that many solutions pass and few uniform samples hit.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Region {
    /// Its name.
    pub id: RegionId,
    /// Its cells, sorted, without repetition, never empty.
    pub cells: Vec<Cell>,
    /// The member cell that stands for the region: the one with the most clearance.
    ///
    /// The paper takes the centroid, which may lie in a wall when the region is not convex.
    pub representative: Cell,
}

impl Region {
    /// A region of `cells`, represented by the one with the most clearance (ties: the one nearest
    /// to the mean of the cells, then the lowest). `None` if there is no cell.
    #[must_use]
    pub fn new(id: RegionId, mut cells: Vec<Cell>, clearance: &DistanceField) -> Option<Self> {
        cells.sort_unstable();
        cells.dedup();
        let count = cells.len() as f64;
        let mean_col = cells.iter().map(|c| c.col as f64).sum::<f64>() / count;
        let mean_row = cells.iter().map(|c| c.row as f64).sum::<f64>() / count;
        let off_center = |c: &Cell| trig::hypot(c.col as f64 - mean_col, c.row as f64 - mean_row);
        let representative = *cells.iter().min_by(|a, b| {
            let by_clearance = clearance.at(**b).total_cmp(&clearance.at(**a));
            by_clearance.then(off_center(a).total_cmp(&off_center(b))).then(a.cmp(b))
        })?;
        Some(Self { id, cells, representative })
    }

    /// The representative's place in the world.
    #[must_use]
    pub fn center(&self, frame: &GridFrame) -> Point {
        frame.center(self.representative)
    }

    /// Its area, square metres.
    #[must_use]
    pub fn area_m2(&self, frame: &GridFrame) -> f64 {
        self.cells.len() as f64 * frame.resolution_m * frame.resolution_m
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::OccupancyGrid;

    #[test]
    fn the_representative_is_the_member_with_most_clearance() {
        let grid = OccupancyGrid::from_ascii(1.0, ".....\n.....\n.....\n.....\n.....").unwrap();
        let field = DistanceField::new(&grid);
        let cells = vec![Cell::new(0, 0), Cell::new(2, 2), Cell::new(1, 1), Cell::new(0, 0)];
        let region = Region::new(RegionId(0), cells, &field).unwrap();
        assert_eq!(region.representative, Cell::new(2, 2));
        assert_eq!(region.cells.len(), 3, "the repeated cell counts once");
        assert_eq!(Region::new(RegionId(0), vec![], &field), None, "an empty region is none");
    }
}
