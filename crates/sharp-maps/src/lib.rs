//! Reads, writes and generates maps.
//!
//! [`load`] takes what a user types: a ROS map (YAML and image), a `MovingAI` map, a plain image, a drawn
//! floor plan, or the letter of one of the project's own environments. It gives a [`MapFile`]: an occupancy
//! grid, and for the own environments the [`Problem`]s posed in them. [`save_ros`] writes the files that
//! ROS's map saver would. A broken file gives a [`MapError`] that names the file, the field, its value and
//! what is allowed. Sizes are checked before memory is spent on them. [`generate`] draws random floor plans.
//!
//! The default feature `files` holds everything but the generator. Whoever needs generated plans only leaves it
//! out, and with it the image decoder and the YAML parser.
//!
//! ```
//! # #[cfg(feature = "files")]
//! # {
//! use sharp_maps::{LoadOptions, load};
//!
//! let map = load("a", &LoadOptions::default()).unwrap();
//! assert_eq!(map.grid.frame().width_m(), 15.0);
//! assert_eq!(map.problems.len(), 5);
//! # }
//! ```

mod generate;

#[cfg(feature = "files")]
mod formats;

#[cfg(feature = "files")]
pub use formats::{
    Door, LoadOptions, MapError, MapFile, MovingAiProblem, Problem, ValueMask, image_of, load, load_doors,
    load_scenario, load_values, named_maps, save_ros,
};
pub use generate::{FloorplanKind, generate, turned_from};
