//! The configuration space of a robot on a floor.
//!
//! The types that every other crate shares: a [`Pose`] in SE(2), an [`OccupancyGrid`] and its
//! [`DistanceField`], a robot's [`Footprint`], a critical [`Region`], and the named random streams of a
//! [`Seed`]. Three traits let others bring their own parts: [`CollisionChecker`] and [`RobotGeometry`] decide
//! where a robot fits, a [`RegionDetector`] finds critical regions. Nothing here knows dynamics, learning or
//! files.
//!
//! ```
//! use sharp_space::{CollisionChecker, Footprint, FootprintChecker, OccupancyGrid, Pose};
//!
//! let grid = OccupancyGrid::from_ascii(1.0, "#####\n#...#\n#####").unwrap();
//! let checker = FootprintChecker::new(&grid, Footprint::rectangle(0.8, 0.4).unwrap());
//! assert!(checker.is_free(Pose::new(2.5, 1.5, 0.0)));
//! assert!(!checker.is_free(Pose::new(2.5, 1.5, 1.57)), "too long to stand across the corridor");
//! ```

mod ascii;
mod bounds;
mod collision;
mod detector;
mod distance_field;
mod footprint;
mod footprint_text;
mod geometry;
mod grid;
mod pose;
mod region;
mod seed;
mod widest_paths;

pub mod conformance;
pub mod trig;

pub use bounds::Bounds;
pub use collision::{CollisionChecker, FootprintChecker};
pub use detector::{Detection, RegionDetector};
pub use distance_field::DistanceField;
pub use footprint::{Footprint, FootprintError, FootprintShape};
pub use geometry::RobotGeometry;
pub use grid::{Cell, GridError, GridFrame, Occupancy, OccupancyGrid};
pub use pose::{Heading, Point, Pose, PoseFrame, Vector, wrap_angle};
pub use region::{Region, RegionId};
pub use seed::{Seed, Stream};
pub use widest_paths::WidestPaths;
