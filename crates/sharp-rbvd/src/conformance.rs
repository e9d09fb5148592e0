//! What every [`StateAbstraction`] promises, as a check that any implementation can be run through.
//!
//! ```
//! use sharp_rbvd::{Rbvd, RbvdSettings, conformance::check_abstraction};
//! use sharp_space::{DistanceField, OccupancyGrid};
//!
//! let grid = OccupancyGrid::from_ascii(0.5, "......\n......").unwrap();
//! let rbvd = Rbvd::build(&DistanceField::new(&grid), &[], &RbvdSettings::default()).unwrap();
//! assert_eq!(check_abstraction(&rbvd), Ok(()));
//! ```

use sharp_space::{Cell, GridFrame, Region};
use thiserror::Error;

use crate::abstraction::StateAbstraction;
use crate::diagram::StateId;
use crate::portal::{Portal, PortalId};

/// How far a portal's point may be from the middle of its cell's side, metres: rounding only.
const POINT_TOLERANCE_M: f64 = 1e-6;

/// A promise of [`StateAbstraction`] that an implementation breaks.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum AbstractionViolation {
    /// α of a cell's centre is not α of the cell, or differs between two calls.
    #[error("column {}, row {}: state_at of the centre is not state_of the cell", cell.col, cell.row)]
    AlphaDisagrees {
        /// The cell.
        cell: Cell,
    },
    /// α has a value at a point outside the grid.
    #[error("a point outside the grid has state {}", state.0)]
    AlphaOutside {
        /// The state there.
        state: StateId,
    },
    /// A cell or a portal names a state that does not exist.
    #[error("state {} is named but there are {count} states", state.0)]
    UnknownState {
        /// The state.
        state: StateId,
        /// Number of states.
        count: usize,
    },
    /// A region is not called by its position.
    #[error("region at position {position} is called {}", id)]
    RegionName {
        /// Position in the list, from 0.
        position: usize,
        /// The name found.
        id: u32,
    },
    /// A region has no cell, one outside the grid, or a representative that is none of its cells.
    #[error("region of state {} is empty, leaves the grid or has a representative outside itself", state.0)]
    RegionCells {
        /// Its state.
        state: StateId,
    },
    /// The centre of a region lies in another state, or in none.
    #[error("centre of the region of state {} lies in {found:?}", state.0)]
    RegionElsewhere {
        /// The state.
        state: StateId,
        /// The state at the centre.
        found: Option<StateId>,
    },
    /// The cells of a state are not connected.
    #[error("state {} is not connected: column {}, row {} is cut off from its region", state.0, cell.col, cell.row)]
    Disconnected {
        /// The state.
        state: StateId,
        /// The first of its cells that is cut off.
        cell: Cell,
    },
    /// A portal is not called by its position, joins a state to itself, names its states in falling
    /// order, or stands before one with lower states.
    #[error("portal at position {position} is out of order")]
    PortalOrder {
        /// Position in the list, from 0.
        position: usize,
    },
    /// A portal's cell is not one of its lower state beside one of its higher state, or its point is
    /// not the middle of their common side.
    #[error("portal {} does not lie on the border of its states", id.0)]
    PortalElsewhere {
        /// The portal.
        id: PortalId,
    },
    /// A portal's width or direction is not finite, or its width is negative.
    #[error("portal {} has no sound width or direction", id.0)]
    PortalShape {
        /// The portal.
        id: PortalId,
    },
    /// The neighbours of a state are not sorted, or not the states that portals join it to.
    #[error("neighbours of state {} are not those that its portals say", state.0)]
    Neighbors {
        /// The state.
        state: StateId,
    },
    /// V(a, b) differs from V(b, a), or V(a, a) is 1.
    #[error("state {} has {} as a neighbour, but not the other way round", a.0, b.0)]
    Asymmetric {
        /// One state.
        a: StateId,
        /// The other, or the same.
        b: StateId,
    },
    /// The portals between two states are not exactly those of the list.
    #[error("portals between states {} and {} are not those of the list", a.0, b.0)]
    PortalsBetween {
        /// One state.
        a: StateId,
        /// The other.
        b: StateId,
    },
}

/// Checks all that [`StateAbstraction`] promises: α is defined on the grid only and names known states,
/// the centre of every region lies in its own state, states are connected, V is symmetric and
/// irreflexive, and portals are sorted and lie on the border of the two states that they join.
///
/// A state without any cell is allowed (a region that lies in a wall), if it has no neighbours.
///
/// # Errors
/// Returns the first promise that is broken.
pub fn check_abstraction(states: &dyn StateAbstraction) -> Result<(), AbstractionViolation> {
    check_alpha(states)?;
    check_regions(states)?;
    check_connected(states)?;
    check_portals(states)?;
    check_neighbors(states)
}

fn check_alpha(states: &dyn StateAbstraction) -> Result<(), AbstractionViolation> {
    let frame = states.frame();
    for cell in cells(frame) {
        let state = states.state_of(cell);
        if states.state_at(frame.center(cell)) != state || states.cells().state_of(cell) != state {
            return Err(AbstractionViolation::AlphaDisagrees { cell });
        }
        if let Some(state) = state {
            known(states, state)?;
        }
    }
    let (bounds, far_m) = (frame.bounds(), frame.width_m() + frame.height_m());
    for corner in [bounds.min, bounds.max] {
        let middle = frame.center(Cell::new(frame.width / 2, frame.height / 2));
        let outside = corner + (corner - middle).normalize() * far_m;
        if let Some(state) = states.state_at(outside) {
            return Err(AbstractionViolation::AlphaOutside { state });
        }
    }
    Ok(())
}

fn known(states: &dyn StateAbstraction, state: StateId) -> Result<(), AbstractionViolation> {
    let count = states.len();
    if (state.0 as usize) < count { Ok(()) } else { Err(AbstractionViolation::UnknownState { state, count }) }
}

fn check_regions(states: &dyn StateAbstraction) -> Result<(), AbstractionViolation> {
    let frame = states.frame();
    let mut is_placed = vec![false; states.len()];
    for state in cells(frame).filter_map(|cell| states.state_of(cell)) {
        is_placed[state.0 as usize] = true;
    }
    for (position, region) in states.regions().iter().enumerate() {
        let state = StateId(position as u32);
        if region.id.0 != state.0 {
            return Err(AbstractionViolation::RegionName { position, id: region.id.0 });
        }
        if !is_sound(region, frame) {
            return Err(AbstractionViolation::RegionCells { state });
        }
        let found = states.state_at(states.center(state));
        let is_buried = !is_placed[position] && states.neighbors(state).is_empty();
        if found != Some(state) && !is_buried {
            return Err(AbstractionViolation::RegionElsewhere { state, found });
        }
    }
    Ok(())
}

fn is_sound(region: &Region, frame: &GridFrame) -> bool {
    let is_inside = |cell: &Cell| cell.col < frame.width && cell.row < frame.height;
    region.cells.iter().all(is_inside) && region.cells.contains(&region.representative)
}

fn check_connected(states: &dyn StateAbstraction) -> Result<(), AbstractionViolation> {
    let frame = states.frame();
    let mut seen = vec![false; frame.len()];
    for state in states.states() {
        let mut open = vec![states.region(state).representative];
        while let Some(cell) = open.pop() {
            let index = frame.index(cell);
            if states.state_of(cell) == Some(state) && !seen[index] {
                seen[index] = true;
                open.extend(frame.neighbors8(cell));
            }
        }
    }
    for cell in cells(frame).filter(|&cell| !seen[frame.index(cell)]) {
        if let Some(state) = states.state_of(cell) {
            return Err(AbstractionViolation::Disconnected { state, cell });
        }
    }
    Ok(())
}

fn check_portals(states: &dyn StateAbstraction) -> Result<(), AbstractionViolation> {
    let portals = states.portals();
    for (position, portal) in portals.iter().enumerate() {
        let (low, high) = portal.between;
        known(states, low)?;
        known(states, high)?;
        let is_sorted = position == 0 || portals[position - 1].between <= portal.between;
        if portal.id != PortalId(position as u32) || low >= high || !is_sorted {
            return Err(AbstractionViolation::PortalOrder { position });
        }
        let is_number = portal.width_m.is_finite() && portal.normal.radians().is_finite();
        if !is_number || portal.width_m < 0.0 {
            return Err(AbstractionViolation::PortalShape { id: portal.id });
        }
        if !is_on_border(states, portal) {
            return Err(AbstractionViolation::PortalElsewhere { id: portal.id });
        }
    }
    Ok(())
}

fn is_on_border(states: &dyn StateAbstraction, portal: &Portal) -> bool {
    let (frame, (low, high)) = (states.frame(), portal.between);
    if portal.cell.col >= frame.width || portal.cell.row >= frame.height {
        return false;
    }
    let here = frame.center(portal.cell);
    let side = |cell| here + (frame.center(cell) - here) / 2.0;
    let mut across = frame.neighbors4(portal.cell).filter(|&cell| states.state_of(cell) == Some(high));
    states.state_of(portal.cell) == Some(low)
        && across.any(|cell| (side(cell) - portal.point).norm() <= POINT_TOLERANCE_M)
}

fn check_neighbors(states: &dyn StateAbstraction) -> Result<(), AbstractionViolation> {
    for a in states.states() {
        let neighbors = states.neighbors(a);
        let mut joined: Vec<StateId> = states.portals().iter().filter_map(|p| p.other_side(a)).collect();
        joined.sort_unstable();
        joined.dedup();
        for &b in &neighbors {
            known(states, b)?;
            if a == b || !states.neighbors(b).contains(&a) {
                return Err(AbstractionViolation::Asymmetric { a, b });
            }
            let listed = states.portals().iter().filter(|portal| portal.other_side(a) == Some(b));
            if !states.portals_between(a, b).iter().eq(listed) {
                return Err(AbstractionViolation::PortalsBetween { a, b });
            }
        }
        if neighbors != joined {
            return Err(AbstractionViolation::Neighbors { state: a });
        }
    }
    Ok(())
}

/// All cells of a grid, row by row.
fn cells(frame: &GridFrame) -> impl Iterator<Item = Cell> + use<> {
    let frame = *frame;
    (0..frame.len()).map(move |index| frame.cell(index))
}
