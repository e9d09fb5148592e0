//! The format in which a diagram is stored: runs of equal cells, and nothing that can be derived.

use serde::{Deserialize, Serialize};
use sharp_space::{Cell, GridFrame, Region, RegionId};
use thiserror::Error;

use crate::diagram::{CELLS_MAX, Rbvd, RbvdSettings, neighbors};
use crate::portal::{Portal, PortalId};
use crate::space::NONE;
use crate::state_grid::{StateGrid, StateGridError};

/// The version written; a reader refuses any other.
const VERSION: u32 = 1;

/// A diagram as it is written to a file.
#[derive(Serialize, Deserialize)]
pub(crate) struct StoredRbvd {
    version: u32,
    frame: GridFrame,
    settings: RbvdSettings,
    given_count: usize,
    component_count: usize,
    free_count: usize,
    regions: Vec<StoredRegion>,
    portals: Vec<Portal>,
    /// State, or `None`, and length of each run of cells, row by row.
    cells: Vec<(Option<u32>, usize)>,
}

/// A region as it is written to a file.
#[derive(Serialize, Deserialize)]
struct StoredRegion {
    representative: usize,
    /// First cell and length of each run.
    cells: Vec<(usize, usize)>,
}

/// Why a stored diagram was refused.
#[derive(Debug, Error, PartialEq)]
pub(crate) enum StoredRbvdError {
    #[error("diagram has format version {0}, expected {VERSION}")]
    Version(u32),
    #[error(transparent)]
    Cells(#[from] StateGridError),
    #[error("diagram covers {found} cells, its frame has {expected}")]
    Length { found: usize, expected: usize },
    #[error("diagram names state {state}, has {count} states")]
    State { state: u32, count: usize },
    #[error("region {0} has no cells or reaches out of the grid")]
    Region(usize),
    #[error("portal {0} is out of order or out of the grid")]
    Portal(usize),
}

impl From<Rbvd> for StoredRbvd {
    fn from(rbvd: Rbvd) -> Self {
        let runs = rbvd.cells.names().chunk_by(|a, b| a == b);
        let cells = runs.map(|run| (Some(run[0]).filter(|&state| state != NONE), run.len())).collect();
        Self {
            version: VERSION,
            regions: rbvd.regions.iter().map(|region| StoredRegion::new(region, rbvd.frame())).collect(),
            frame: *rbvd.cells.frame(),
            settings: rbvd.settings,
            given_count: rbvd.given_count,
            component_count: rbvd.component_count,
            free_count: rbvd.free_count,
            portals: rbvd.portals,
            cells,
        }
    }
}

impl TryFrom<StoredRbvd> for Rbvd {
    type Error = StoredRbvdError;

    fn try_from(stored: StoredRbvd) -> Result<Self, StoredRbvdError> {
        if stored.version != VERSION {
            return Err(StoredRbvdError::Version(stored.version));
        }
        let states = stored.states()?;
        let cells = StateGrid::from_names(stored.frame, states, stored.settings.fringe_clearance_m)?;
        stored.check_portals()?;
        let (frame, count) = (stored.frame, stored.regions.len());
        let regions = stored.regions.iter().enumerate();
        let regions = regions
            .map(|(position, region)| {
                region.restore(position, &frame).ok_or(StoredRbvdError::Region(position))
            })
            .collect::<Result<Vec<Region>, StoredRbvdError>>()?;
        Ok(Self {
            neighbors: neighbors(&stored.portals, count),
            cells,
            settings: stored.settings,
            regions,
            given_count: stored.given_count,
            component_count: stored.component_count,
            free_count: stored.free_count,
            portals: stored.portals,
        })
    }
}

impl StoredRbvd {
    /// The state of each cell; lengths are checked before memory is asked for.
    fn states(&self) -> Result<Vec<u32>, StoredRbvdError> {
        let lengths = self.cells.iter().map(|run| run.1);
        let found = lengths.fold(0, usize::saturating_add);
        let expected = self.frame.width.saturating_mul(self.frame.height);
        if found != expected || expected > CELLS_MAX {
            return Err(StoredRbvdError::Length { found, expected });
        }
        let count = self.regions.len();
        if let Some(state) = self.cells.iter().filter_map(|run| run.0).find(|&s| s as usize >= count) {
            return Err(StoredRbvdError::State { state, count });
        }
        let runs = self.cells.iter().map(|&(state, length)| (state.unwrap_or(NONE), length));
        Ok(runs.flat_map(|(state, length)| std::iter::repeat_n(state, length)).collect())
    }

    fn check_portals(&self) -> Result<(), StoredRbvdError> {
        let (frame, count) = (&self.frame, self.regions.len());
        for (position, portal) in self.portals.iter().enumerate() {
            let (low, high) = portal.between;
            let in_order = portal.id == PortalId(position as u32)
                && low < high
                && (position == 0 || self.portals[position - 1].between <= portal.between);
            if !in_order || portal.cell.col >= frame.width || portal.cell.row >= frame.height {
                return Err(StoredRbvdError::Portal(position));
            }
            if high.0 as usize >= count {
                return Err(StoredRbvdError::State { state: high.0, count });
            }
        }
        Ok(())
    }
}

impl StoredRegion {
    fn new(region: &Region, frame: &GridFrame) -> Self {
        let indices: Vec<usize> = region.cells.iter().map(|&cell| frame.index(cell)).collect();
        let runs = indices.chunk_by(|a, b| a + 1 == *b);
        Self {
            representative: frame.index(region.representative),
            cells: runs.map(|run| (run[0], run.len())).collect(),
        }
    }

    /// The region, or `None` if it has no cell, one outside the grid or one twice.
    fn restore(&self, position: usize, frame: &GridFrame) -> Option<Region> {
        let mut end = 0;
        for &(first, length) in &self.cells {
            if first < end || length == 0 {
                return None;
            }
            end = first.checked_add(length).filter(|&end| end <= frame.len())?;
        }
        let cells = self.cells.iter().flat_map(|&(first, length)| first..first + length);
        let cells: Vec<Cell> = cells.map(|index| frame.cell(index)).collect();
        let representative = (self.representative < end).then(|| frame.cell(self.representative))?;
        Some(Region { id: RegionId(position as u32), cells, representative })
    }
}

#[cfg(test)]
mod tests {
    use sharp_space::{DistanceField, OccupancyGrid, Point};

    use super::*;

    fn stored() -> String {
        let grid = OccupancyGrid::from_ascii(0.5, "#########\n#...#...#\n#.......#\n#########").unwrap();
        let field = DistanceField::new(&grid);
        let region = |id, col| Region::new(RegionId(id), vec![Cell::new(col, 1)], &field).unwrap();
        let rbvd = Rbvd::build(&field, &[region(0, 2), region(1, 6)], &RbvdSettings::default()).unwrap();
        let text = ron::to_string(&rbvd).unwrap();
        assert_eq!(ron::from_str::<Rbvd>(&text).unwrap(), rbvd, "a diagram survives a round trip");
        assert!(rbvd.state_at(Point::new(0.75, 0.75)).is_some(), "and is not empty");
        text
    }

    #[test]
    fn broken_files_are_refused_with_the_culprit() {
        let text = stored();
        let refused = |from: &str, to: &str, message: &str| {
            assert!(text.contains(from), "{from} is not in {text}");
            let error = ron::from_str::<Rbvd>(&text.replacen(from, to, 1)).unwrap_err().to_string();
            assert!(error.contains(message), "{from} -> {to}: {error}");
        };
        refused("version:1", "version:7", "format version 7");
        refused("resolution_m:0.5", "resolution_m:0.0", "frame");
        refused("(None,10)", "(None,11)", "covers 37 cells, its frame has 36");
        refused("(Some(1),", "(Some(9),", "names state 9");
        refused("cells:[(11,1)]", "cells:[]", "region 0");
        refused("cells:[(11,1)]", "cells:[(35,2)]", "region 0");
        refused("between:(0,1)", "between:(1,0)", "portal 0");
        refused("between:(0,1)", "between:(1,1)", "portal 0");
        refused("between:(0,1)", "between:(0,5)", "names state 5");
    }
}
