//! The state abstraction: α, V and the regions (Definition 2) as a trait.
//!
//! Options, guides and plans ask for a [`StateAbstraction`], not for the diagram. A diagram ([`Rbvd`])
//! is one; a grid of tiles or the rooms of a floor plan are others. An implementation hands over three
//! tables (cells, regions, portals), and the trait answers all questions from them.
//! [`conformance`](crate::conformance) checks that the tables agree with each other.

use std::fmt::Debug;
use std::iter::Map;
use std::ops::Range;
use std::sync::Arc;

use sharp_space::{Cell, GridFrame, Point, Region};

use crate::diagram::{Rbvd, StateId};
use crate::portal::{Portal, PortalId};
use crate::state_grid::StateGrid;

/// The states of an abstraction in order, as [`StateAbstraction::states`] gives them.
pub type StateIds = Map<Range<u32>, fn(u32) -> StateId>;

/// An abstraction function α : X → S with one region for each state and the neighbourhood V.
///
/// Implement the three tables; the rest follows.
pub trait StateAbstraction: Send + Sync + Debug {
    /// α: the state, or none, of each cell (Definition 2: the cell ψ of a state).
    ///
    /// A state's cells are connected, by sides or corners, and hold the centre of its region.
    fn cells(&self) -> &StateGrid;

    /// One critical region for each state, in the order of their states: `regions()[i].id` is `i`.
    fn regions(&self) -> &[Region];

    /// The places where a robot can cross from one state to another, sorted by the states they
    /// join: `portals()[i].id` is `i`. V(s, s') = 1 if and only if a portal joins s and s'.
    fn portals(&self) -> &[Portal];

    /// Where the grid lies in the world.
    fn frame(&self) -> &GridFrame {
        self.cells().frame()
    }

    /// α: the state of `cell`, if it has one.
    ///
    /// # Panics
    /// If `cell` lies outside the grid.
    fn state_of(&self, cell: Cell) -> Option<StateId> {
        self.cells().state_of(cell)
    }

    /// α: the state whose cell holds `point`, if any.
    fn state_at(&self, point: Point) -> Option<StateId> {
        self.cells().state_at(point)
    }

    /// The number of states.
    fn len(&self) -> usize {
        self.regions().len()
    }

    /// Returns true if there is no state.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// All states, in order.
    fn states(&self) -> StateIds {
        (0..self.len() as u32).map(StateId)
    }

    /// The region of `state`.
    ///
    /// # Panics
    /// If there is no such state.
    fn region(&self, state: StateId) -> &Region {
        &self.regions()[state.0 as usize]
    }

    /// The centre of the region of `state` in the world.
    ///
    /// # Panics
    /// If there is no such state.
    fn center(&self, state: StateId) -> Point {
        self.region(state).center(self.frame())
    }

    /// The states s' with V(`state`, s') = 1, sorted.
    fn neighbors(&self, state: StateId) -> Vec<StateId> {
        let mut found: Vec<StateId> =
            self.portals().iter().filter_map(|portal| portal.other_side(state)).collect();
        found.sort_unstable();
        found.dedup();
        found
    }

    /// The portal called `id`.
    ///
    /// # Panics
    /// If there is no such portal.
    fn portal(&self, id: PortalId) -> &Portal {
        &self.portals()[id.0 as usize]
    }

    /// The portals between two states, whichever is named first.
    fn portals_between(&self, a: StateId, b: StateId) -> &[Portal] {
        portals_between(self.portals(), a, b)
    }

    /// The diagram that this is, if it is one: what [`Rbvd::from_abstraction`] then copies.
    fn as_rbvd(&self) -> Option<&Rbvd> {
        None
    }
}

/// The run of `portals`, which are sorted by their states, between `a` and `b`.
pub(crate) fn portals_between(portals: &[Portal], a: StateId, b: StateId) -> &[Portal] {
    let between = (a.min(b), a.max(b));
    let first = portals.partition_point(|portal| portal.between < between);
    let count = portals[first..].partition_point(|portal| portal.between == between);
    &portals[first..first + count]
}

impl StateAbstraction for Rbvd {
    fn cells(&self) -> &StateGrid {
        &self.cells
    }

    fn regions(&self) -> &[Region] {
        &self.regions
    }

    fn portals(&self) -> &[Portal] {
        &self.portals
    }

    fn neighbors(&self, state: StateId) -> Vec<StateId> {
        self.neighbors[state.0 as usize].clone()
    }

    fn as_rbvd(&self) -> Option<&Rbvd> {
        Some(self)
    }
}

/// Forwards to the abstraction behind a reference; `neighbors` too, since it may be faster there.
macro_rules! forward {
    () => {
        fn cells(&self) -> &StateGrid {
            (**self).cells()
        }

        fn regions(&self) -> &[Region] {
            (**self).regions()
        }

        fn portals(&self) -> &[Portal] {
            (**self).portals()
        }

        fn neighbors(&self, state: StateId) -> Vec<StateId> {
            (**self).neighbors(state)
        }

        fn as_rbvd(&self) -> Option<&Rbvd> {
            (**self).as_rbvd()
        }
    };
}

impl<A: StateAbstraction + ?Sized> StateAbstraction for &A {
    forward!();
}

impl<A: StateAbstraction + ?Sized> StateAbstraction for Arc<A> {
    forward!();
}
