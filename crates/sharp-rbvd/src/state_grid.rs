//! The abstraction function α as data: one state, or none, for each cell of a grid.

use sharp_space::{Cell, GridFrame, Point};
use thiserror::Error;

use crate::diagram::StateId;
use crate::space::NONE;

/// The abstraction function α on the cells of a grid.
///
/// ```
/// use sharp_rbvd::{StateGrid, StateId};
/// use sharp_space::{GridFrame, Point, Pose};
///
/// let frame = GridFrame { origin: Pose::new(0.0, 0.0, 0.0), resolution_m: 0.5, width: 3, height: 1 };
/// let states = [Some(StateId(0)), None, Some(StateId(1))];
/// let cells = StateGrid::new(frame, states, 0.0).unwrap();
/// assert_eq!(cells.state_at(Point::new(1.2, 0.2)), Some(StateId(1)));
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct StateGrid {
    frame: GridFrame,
    fringe_clearance_m: f64,
    /// For each cell its state or [`NONE`], row-major from the lower-left cell.
    states: Vec<u32>,
}

impl StateGrid {
    /// A grid whose cells have these `states`, row-major from the lower-left cell.
    ///
    /// `fringe_clearance_m` is the clearance below which a cell has no state because the robot's
    /// centre cannot be there, metres. It says how far the next obstacle is from a cell without state.
    ///
    /// # Errors
    /// Returns an error if there is not one entry for each cell, if the frame has no finite origin or no
    /// positive resolution, if the clearance is negative or not finite, or if a state is called
    /// `u32::MAX`, which stands for "none".
    pub fn new(
        frame: GridFrame,
        states: impl IntoIterator<Item = Option<StateId>>,
        fringe_clearance_m: f64,
    ) -> Result<Self, StateGridError> {
        let mut names = Vec::new();
        for state in states {
            if state == Some(StateId(NONE)) {
                return Err(StateGridError::Name { position: names.len() });
            }
            names.push(state.map_or(NONE, |state| state.0));
        }
        Self::from_names(frame, names, fringe_clearance_m)
    }

    /// A grid whose cells have these states; [`NONE`] stands for none.
    pub(crate) fn from_names(
        frame: GridFrame,
        states: Vec<u32>,
        fringe_clearance_m: f64,
    ) -> Result<Self, StateGridError> {
        let is_positive = frame.resolution_m.is_finite() && frame.resolution_m > 0.0;
        if !(is_positive && frame.origin.is_finite()) {
            return Err(StateGridError::Frame);
        }
        let expected = frame.width.saturating_mul(frame.height);
        if states.len() != expected {
            return Err(StateGridError::Length { found: states.len(), expected });
        }
        if !(fringe_clearance_m.is_finite() && fringe_clearance_m >= 0.0) {
            return Err(StateGridError::Clearance { value: fringe_clearance_m });
        }
        Ok(Self { frame, fringe_clearance_m, states })
    }

    /// α: the state of `cell`, if it has one.
    ///
    /// # Panics
    /// If `cell` lies outside the grid.
    #[must_use]
    pub fn state_of(&self, cell: Cell) -> Option<StateId> {
        Some(self.states[self.frame.index(cell)]).filter(|&state| state != NONE).map(StateId)
    }

    /// α: the state of the cell that contains `point`; `None` outside the grid too.
    #[must_use]
    pub fn state_at(&self, point: Point) -> Option<StateId> {
        self.frame.cell_at(point).and_then(|cell| self.state_of(cell))
    }

    /// Where the grid lies in the world.
    #[must_use]
    pub const fn frame(&self) -> &GridFrame {
        &self.frame
    }

    /// The clearance below which a cell has no state, metres.
    #[must_use]
    pub const fn fringe_clearance_m(&self) -> f64 {
        self.fringe_clearance_m
    }

    /// For each cell its state or [`NONE`], row-major.
    pub(crate) fn names(&self) -> &[u32] {
        &self.states
    }

    /// For tests that break a sound grid on purpose.
    #[cfg(test)]
    pub(crate) fn names_mut(&mut self) -> &mut [u32] {
        &mut self.states
    }
}

/// Why a grid of states was refused.
#[derive(Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum StateGridError {
    /// The frame has no finite origin or no positive resolution.
    #[error("grid's frame needs a finite origin and a positive resolution")]
    Frame,
    /// There is not one state for each cell.
    #[error("grid has {found} states, its frame has {expected} cells")]
    Length {
        /// Number of states.
        found: usize,
        /// Number of cells.
        expected: usize,
    },
    /// The clearance of the fringe is out of range.
    #[error("fringe_clearance_m is {value}, must be finite and at least 0")]
    Clearance {
        /// Its value, metres.
        value: f64,
    },
    /// A state has the name that stands for "none".
    #[error("state at position {position} is called {}, expected a lower number", u32::MAX)]
    Name {
        /// Position in the list, from 0.
        position: usize,
    },
}

#[cfg(test)]
mod tests {
    use sharp_space::Pose;

    use super::*;

    #[test]
    fn broken_grids_are_refused_with_the_culprit() {
        let frame = GridFrame { origin: Pose::new(0.0, 0.0, 0.0), resolution_m: 0.5, width: 2, height: 1 };
        let refused = |frame, states: &[Option<StateId>], clearance_m| {
            StateGrid::new(frame, states.iter().copied(), clearance_m).unwrap_err().to_string()
        };
        let (state, none) = (Some(StateId(0)), None);
        assert_eq!(refused(frame, &[state], 0.0), "grid has 1 states, its frame has 2 cells");
        let message = "fringe_clearance_m is -1, must be finite and at least 0";
        assert_eq!(refused(frame, &[state, none], -1.0), message);
        let flat = GridFrame { resolution_m: 0.0, ..frame };
        let message = "grid's frame needs a finite origin and a positive resolution";
        assert_eq!(refused(flat, &[state, none], 0.0), message);
        let message = "state at position 1 is called 4294967295, expected a lower number";
        assert_eq!(refused(frame, &[none, Some(StateId(u32::MAX))], 0.0), message);
    }
}
