//! Option endpoints: where an option starts and where it ends.
//!
//! From a diagram's states and portals an [`OptionSet`] synthesises all centroid options `O_c` or
//! all interface options `O_i` of the paper. Each [`OptionSpec`] names two [`Endpoint`]s, the
//! initiation set I and the termination set β; what happens between them is learned elsewhere.
//! Endpoints are shared: where one option ends, the next begins (`β_i = I_{i+1}`), which is what
//! lets learned options be composed. An [`OptionId`] is stable text such as `i:3-7-9`, so that a
//! policy learned today is found again tomorrow.
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

mod centroid;
mod endpoint;
mod id;
mod interface;
mod set;
#[cfg(test)]
mod tests;

pub use endpoint::{Endpoint, EndpointId, EndpointSite};
pub use id::{OptionId, OptionIdError, OptionKind};
pub use set::{AllowedRule, OptionSet, OptionSettings, OptionSpec};
