//! Map files: one module per format, and the environments that come with the crate.

mod doors;
mod edit;
mod error;
mod files;
mod floor_plan;
mod load;
mod movingai;
mod named;
mod picture;
mod ros;
mod save;
mod scenario;
mod value_mask;

#[cfg(test)]
mod drivable;
#[cfg(test)]
mod statistics;

pub use doors::{Door, load_doors};
pub use error::MapError;
pub use load::{LoadOptions, MapFile, Problem, load};
pub use named::named_maps;
pub use ros::image_of;
pub use save::save_ros;
pub use scenario::{MovingAiProblem, load_scenario};
pub use value_mask::{ValueMask, load_values};
