//! Reads and writes map files.
//!
//! [`load`] takes what a user types: a ROS map (YAML and image), a `MovingAI` map, a plain image, a
//! drawn floor plan, or the letter of one of the project's own environments. It gives a
//! [`MapFile`]: an occupancy grid, and for the own environments the [`Problem`]s posed in them.
//! [`save_ros`] writes the files that ROS's map saver would. Whatever is broken becomes a
//! [`MapError`] that names the file, the field, its value and what would be right; sizes are
//! checked before memory is spent on them.
//!
//! ```
//! use sharp_maps::{LoadOptions, load};
//!
//! let map = load("a", &LoadOptions::default()).unwrap();
//! assert_eq!(map.grid.frame().width_m(), 15.0);
//! assert_eq!(map.problems.len(), 5);
//! ```

mod doors;
mod error;
mod files;
mod floor_plan;
mod load;
mod movingai;
mod named;
mod picture;
mod ros;
mod save;

#[cfg(test)]
mod drivable;
#[cfg(test)]
mod statistics;

pub use doors::{Door, load_doors};
pub use error::MapError;
pub use load::{LoadOptions, MapFile, Problem, load};
pub use named::named_maps;
pub use save::save_ros;
