//! A check of Definition 2. It is slow and simple, and shares only the free cells and the moves between them with the construction
//! of diagrams.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use sharp_space::{Cell, DistanceField, Region};
use thiserror::Error;

use crate::diagram::{CellMetric, Rbvd, StateId};
use crate::space::FreeSpace;

/// How a diagram breaks the definition.
#[derive(Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum DefinitionViolation {
    /// A cell where the robot cannot be has a state.
    #[error("column {}, row {} has state {} but no room for the robot", cell.col, cell.row, state.0)]
    Blocked {
        /// The cell.
        cell: Cell,
        /// Its state.
        state: StateId,
    },
    /// A cell does not have the state of the nearest region.
    #[error("column {}, row {} has state {}, nearest is the region of state {}", cell.col, cell.row, found.0, expected.0)]
    NotNearest {
        /// The cell.
        cell: Cell,
        /// Its state.
        found: StateId,
        /// The state of the nearest region.
        expected: StateId,
    },
    /// The cells of a state are not connected.
    #[error("state {} is not connected: nothing leads from its region to column {}, row {}", state.0, cell.col, cell.row)]
    Disconnected {
        /// The state.
        state: StateId,
        /// The first of its cells that cannot be reached from its region.
        cell: Cell,
    },
    /// A cell has no state although one of the cells around it has.
    #[error("column {}, row {} has no state but a neighbour with one", cell.col, cell.row)]
    Uncovered {
        /// The cell.
        cell: Cell,
    },
}

/// Checks that states lie in free space, are connected, leave no gaps, and hold the cells nearest
/// to their region under the diagram's metric (ties: the lowest state).
///
/// Under [`CellMetric::Euclidean`] the last holds for cells that their nearest region can reach
/// through cells of the same kind; pieces cut off by walls are exempt. The time is that of one
/// search for each state.
///
/// # Errors
/// Returns the first violation found.
pub fn check_definition(rbvd: &Rbvd, clearance: &DistanceField) -> Result<(), DefinitionViolation> {
    let settings = rbvd.settings();
    let space = FreeSpace::new(clearance, settings.min_clearance_m);
    let fringe = FreeSpace::new(clearance, settings.fringe_clearance_m.min(settings.min_clearance_m));
    check_coverage(rbvd, &fringe)?;
    check_connected(rbvd, &fringe)?;
    check_nearest(rbvd, &space)
}

fn check_coverage(rbvd: &Rbvd, space: &FreeSpace) -> Result<(), DefinitionViolation> {
    for index in 0..space.frame.len() {
        let cell = space.frame.cell(index);
        match rbvd.state_of(cell) {
            Some(state) if !space.is_free(index) => return Err(DefinitionViolation::Blocked { cell, state }),
            None if space.is_free(index) => {
                let covered = |(other, _)| rbvd.state_of(space.frame.cell(other)).is_some();
                if space.moves(index).any(covered) {
                    return Err(DefinitionViolation::Uncovered { cell });
                }
            }
            _ => {}
        }
    }
    Ok(())
}

fn check_connected(rbvd: &Rbvd, space: &FreeSpace) -> Result<(), DefinitionViolation> {
    let state_of = |index| rbvd.state_of(space.frame.cell(index));
    let mut seen = vec![false; space.frame.len()];
    for state in rbvd.states() {
        let start = space.frame.index(rbvd.region(state).representative);
        if state_of(start) == Some(state) {
            space.flood(start, &mut seen, |index| state_of(index) == Some(state));
        }
    }
    for (index, _) in seen.iter().enumerate().filter(|(_, seen)| !**seen) {
        if let Some(state) = state_of(index) {
            return Err(DefinitionViolation::Disconnected { state, cell: space.frame.cell(index) });
        }
    }
    Ok(())
}

fn check_nearest(rbvd: &Rbvd, space: &FreeSpace) -> Result<(), DefinitionViolation> {
    let frame = &space.frame;
    let is_placed = |&state: &StateId| rbvd.state_of(rbvd.region(state).representative) == Some(state);
    let mut nearest: Vec<(u64, Option<StateId>)> = vec![(u64::MAX, None); frame.len()];
    let counts =
        |state: &StateId| rbvd.settings().metric == CellMetric::Geodesic || !rbvd.is_synthetic(*state);
    for state in rbvd.states().filter(counts).filter(is_placed) {
        let distances = match rbvd.settings().metric {
            CellMetric::Geodesic => geodesic(space, rbvd.region(state)),
            CellMetric::Euclidean => straight(space, rbvd.region(state)),
        };
        for (best, distance) in nearest.iter_mut().zip(distances) {
            if distance < best.0 {
                *best = (distance, Some(state));
            }
        }
    }
    let mut seen = vec![false; frame.len()];
    for state in rbvd.states().filter(counts).filter(is_placed) {
        let start = frame.index(rbvd.region(state).representative);
        for index in space.flood(start, &mut seen, |index| nearest[index].1 == Some(state)) {
            let (cell, expected) = (frame.cell(index), state);
            // `check_coverage` looks at the cells without a state.
            if let Some(found) = rbvd.state_of(cell).filter(|&found| found != expected) {
                return Err(DefinitionViolation::NotNearest { cell, found, expected });
            }
        }
    }
    Ok(())
}

/// For each cell the length of the shortest way from `region`, by Dijkstra's algorithm.
fn geodesic(space: &FreeSpace, region: &Region) -> Vec<u64> {
    let mut distances = vec![u64::MAX; space.frame.len()];
    let mut queue: BinaryHeap<Reverse<(u64, usize)>> =
        region.cells.iter().map(|&cell| Reverse((0, space.frame.index(cell)))).collect();
    while let Some(Reverse((distance, index))) = queue.pop() {
        if distance < distances[index] {
            distances[index] = distance;
            queue.extend(
                space.moves(index).map(|(next, length)| Reverse((distance + u64::from(length), next))),
            );
        }
    }
    distances
}

/// For each free cell the squared straight distance from `region`, cells.
fn straight(space: &FreeSpace, region: &Region) -> Vec<u64> {
    let nearest = |index| {
        let cell = space.frame.cell(index);
        let squared = |c: &Cell| (c.col.abs_diff(cell.col).pow(2) + c.row.abs_diff(cell.row).pow(2)) as u64;
        region.cells.iter().map(squared).min().unwrap_or(u64::MAX)
    };
    (0..space.frame.len()).map(|i| if space.is_free(i) { nearest(i) } else { u64::MAX }).collect()
}
