//! Option endpoints: where an option starts and where it ends.
//!
//! From the states and portals of an abstraction an [`OptionFamily`] makes an [`OptionSet`]: all
//! centroid options `O_c` or all interface options `O_i` of the paper, or options of your own. Each
//! [`OptionSpec`] names two [`Endpoint`]s, the initiation set I and the termination set β; what
//! happens between them is learned elsewhere. Endpoints are shared: where one option ends, the next
//! begins (`β_i = I_{i+1}`), so learned options can be composed. An [`OptionId`] is stable text such
//! as `i:3-7-9`, so that a stored policy is found again later.
//!
//! `examples/two_steps.rs` is a family from outside, and [`conformance`] checks any family.
//!
//! ```
//! use sharp_options::{OptionKind, OptionSet, OptionSettings};
//! use sharp_rbvd::{Rbvd, RbvdSettings};
//! use sharp_space::{Cell, DistanceField, OccupancyGrid, Region, RegionId};
//!
//! let grid = OccupancyGrid::from_ascii(0.5, "###########\n#.........#\n###########").unwrap();
//! let clearance = DistanceField::new(&grid);
//! let region = |id, col| Region::new(RegionId(id), vec![Cell::new(col, 1)], &clearance).unwrap();
//! let regions = [region(0, 1), region(1, 5), region(2, 9)];
//! let rbvd = Rbvd::build(&clearance, &regions, &RbvdSettings::default()).unwrap();
//!
//! let names = |kind| {
//!     let set = OptionSet::synthesize(&rbvd, kind, &OptionSettings::default());
//!     set.options().iter().map(|option| option.id.to_string()).collect::<Vec<_>>()
//! };
//! assert_eq!(names(OptionKind::Centroid), ["c:0-1", "c:1-0", "c:1-2", "c:2-1"]);
//! assert_eq!(names(OptionKind::Interface), ["i:0-1-2", "i:2-1-0"]);
//! ```

mod bypass;
mod centroid;
mod endpoint;
mod family;
mod id;
mod interface;
mod set;
#[cfg(test)]
mod tests;

pub mod conformance;

pub use bypass::BypassOptions;
pub use centroid::CentroidOptions;
pub use endpoint::{Endpoint, EndpointId, EndpointSite};
pub use family::OptionFamily;
pub use id::{OptionId, OptionIdError, OptionKind};
pub use interface::InterfaceOptions;
pub use set::{AllowedRule, OptionSet, OptionSetError, OptionSettings, OptionSpec};
