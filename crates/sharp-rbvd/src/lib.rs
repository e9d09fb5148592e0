//! Region-based Voronoi diagram: from critical regions to abstract states.
//!
//! An [`Rbvd`] (Definition 2 of the paper) cuts the configuration space into cells, one for each
//! critical region. Cells and abstract states share one name, the [`StateId`], so the bijection ℓ
//! is the identity and the abstraction function α is [`Rbvd::state_at`]. Where two cells meet, a
//! [`Portal`] says where a robot can cross and how wide the crossing is; two states are neighbours
//! (V of the paper) if a portal joins them. [`check_definition`] compares a diagram with the
//! definition, independently of how it was built.
//!
//! Whatever is built on states asks for the trait [`StateAbstraction`], of which the diagram is one
//! implementation. `examples/tiles.rs` brings another, and [`conformance`] checks any of them.
//!
//! ```
//! use sharp_rbvd::{Rbvd, RbvdSettings, StateId};
//! use sharp_space::{Cell, DistanceField, OccupancyGrid, Point, Region, RegionId};
//!
//! let grid = OccupancyGrid::from_ascii(1.0, "#########\n#.......#\n#########").unwrap();
//! let clearance = DistanceField::new(&grid);
//! let region = |id, col| Region::new(RegionId(id), vec![Cell::new(col, 1)], &clearance).unwrap();
//!
//! let settings = RbvdSettings::default();
//! let rbvd = Rbvd::build(&clearance, &[region(0, 2), region(1, 6)], &settings).unwrap();
//! assert_eq!(rbvd.state_at(Point::new(1.5, 1.5)), Some(StateId(0)));
//! assert_eq!(rbvd.neighbors(StateId(0)), [StateId(1)]);
//! assert_eq!(rbvd.portals()[0].width_m, 1.0);
//! ```

mod abstraction;
mod check;
mod diagram;
mod grow;
mod nearest;
mod portal;
mod regions;
mod space;
mod state_grid;
mod store;
#[cfg(test)]
mod tests;

pub mod conformance;

pub use abstraction::{StateAbstraction, StateIds};
pub use check::{DefinitionViolation, check_definition};
pub use diagram::{CellMetric, Rbvd, RbvdError, RbvdSettings, StateId};
pub use portal::{Portal, PortalId, PortalSettings, find_portals};
pub use state_grid::{StateGrid, StateGridError};
