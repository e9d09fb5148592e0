//! What every [`RegionDetector`] promises.

use std::panic::{AssertUnwindSafe, catch_unwind};

use thiserror::Error;

use crate::detector::{Detection, RegionDetector};
use crate::footprint::Footprint;
use crate::grid::{GridFrame, Occupancy, OccupancyGrid};
use crate::pose::Pose;
use crate::region::{Region, RegionId};

/// Two rooms, a door and a corridor, drawn in cells of half a metre.
const ROOMS: &str = "
    ####################
    #........#.........#
    #........#.........#
    #..................#
    #..................#
    #........#.........#
    #........#.........#
    #####..#########..##
    #..................#
    #..................#
    ####################";

/// A promise of [`RegionDetector`] that an implementation does not keep.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum DetectorViolation {
    /// `detect` panicked.
    #[error("the detector panics on {map}")]
    Panic {
        /// The map of the suite.
        map: &'static str,
    },
    /// Two calls with the same arguments gave different answers.
    #[error("the detector answers differently when asked twice about {map}")]
    NotDeterministic {
        /// The map of the suite.
        map: &'static str,
    },
    /// The source is empty or has a line break.
    #[error("the source on {map} is {source_name:?}, must be a short word")]
    Source {
        /// The map of the suite.
        map: &'static str,
        /// What the detection names as its source.
        source_name: String,
    },
    /// The id of a region is not its position in the list.
    #[error("region {position} of {map} has the id {id}, must be its position in the list")]
    Id {
        /// The map of the suite.
        map: &'static str,
        /// Position in the list of regions, from 0.
        position: usize,
        /// The id found there.
        id: u32,
    },
    /// The cells of a region are not what a [`Region`] holds.
    #[error("region {id} of {map} {problem}")]
    Cells {
        /// The map of the suite.
        map: &'static str,
        /// The region's id.
        id: u32,
        /// What is wrong with its cells.
        problem: &'static str,
    },
    /// There is not one value of criticality for each cell.
    #[error("{map} has {cells} cells, but {values} values of criticality")]
    CriticalityLength {
        /// The map of the suite.
        map: &'static str,
        /// Cells of the map.
        cells: usize,
        /// Values in the detection.
        values: usize,
    },
    /// A value of criticality is not in [0, 1].
    #[error("the criticality of cell {index} of {map} is {value}, must be from 0 to 1")]
    CriticalityRange {
        /// The map of the suite.
        map: &'static str,
        /// Number of the cell in row-major order.
        index: usize,
        /// Its criticality.
        value: f32,
    },
}

/// Runs `detector` on a blocked map, a free map and a map with rooms, for a robot of 0.8 m by 0.5 m.
///
/// # Errors
/// Returns the first promise of [`RegionDetector`] that `detector` does not keep.
pub fn check_region_detector(detector: &dyn RegionDetector) -> Result<(), DetectorViolation> {
    let footprint = Footprint::rectangle(0.4, 0.25).expect("the numbers are in range");
    let rooms = OccupancyGrid::from_ascii(0.5, ROOMS).expect("the drawing is sound");
    for (map, grid) in [
        ("the blocked map", uniform(Occupancy::Occupied)),
        ("the free map", uniform(Occupancy::Free)),
        ("the map with rooms", rooms),
    ] {
        check_on(detector, map, &grid, &footprint)?;
    }
    Ok(())
}

/// A map of 12 m by 9 m whose cells are all the same.
fn uniform(occupancy: Occupancy) -> OccupancyGrid {
    let frame = GridFrame { origin: Pose::new(-3.0, 2.0, 0.0), resolution_m: 0.5, width: 24, height: 18 };
    OccupancyGrid::new(frame, vec![occupancy; frame.len()]).expect("the frame is sound")
}

fn check_on(
    detector: &dyn RegionDetector,
    map: &'static str,
    grid: &OccupancyGrid,
    footprint: &Footprint,
) -> Result<(), DetectorViolation> {
    let ask = || {
        let answer = catch_unwind(AssertUnwindSafe(|| detector.detect(grid, footprint)));
        answer.map_err(|_| DetectorViolation::Panic { map })
    };
    let detection = ask()?;
    if ask()? != detection {
        return Err(DetectorViolation::NotDeterministic { map });
    }
    let Detection { regions, source, criticality } = detection;
    if source.is_empty() || source.contains('\n') {
        return Err(DetectorViolation::Source { map, source_name: source });
    }
    for (position, region) in regions.iter().enumerate() {
        let RegionId(id) = region.id;
        if id as usize != position {
            return Err(DetectorViolation::Id { map, position, id });
        }
        if let Some(problem) = broken_cells(region, grid) {
            return Err(DetectorViolation::Cells { map, id, problem });
        }
    }
    criticality.map_or(Ok(()), |values| check_criticality(map, grid, &values))
}

/// What is wrong with the cells of `region`, if anything is.
fn broken_cells(region: &Region, grid: &OccupancyGrid) -> Option<&'static str> {
    let Region { cells, representative, .. } = region;
    let frame = grid.frame();
    if cells.is_empty() {
        return Some("has no cell");
    }
    if cells.iter().any(|cell| cell.col >= frame.width || cell.row >= frame.height) {
        return Some("has a cell outside the grid");
    }
    if !cells.is_sorted_by(|a, b| a < b) {
        return Some("has cells that are not sorted or that repeat");
    }
    if !cells.iter().all(|&cell| grid.is_free(cell)) {
        return Some("has a cell that is not free");
    }
    (!cells.contains(representative)).then_some("has a representative that is not one of its cells")
}

fn check_criticality(
    map: &'static str,
    grid: &OccupancyGrid,
    values: &[f32],
) -> Result<(), DetectorViolation> {
    let cells = grid.frame().len();
    if values.len() != cells {
        return Err(DetectorViolation::CriticalityLength { map, cells, values: values.len() });
    }
    match values.iter().enumerate().find(|(_, value)| !(0.0..=1.0).contains(*value)) {
        Some((index, &value)) => Err(DetectorViolation::CriticalityRange { map, index, value }),
        None => Ok(()),
    }
}
