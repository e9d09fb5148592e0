//! Critical regions: where most plans pass and few random samples fall.
//!
//! A [`RegionPredictor`] holds a trained network; [`predict_regions`] turns a map into a
//! [`Prediction`]: a [`Heatmap`] and the regions in it. Where the network has nothing usable to say,
//! [`detect_geometric`] finds doorways, junctions and mouths of corridors, and the prediction says
//! so. [`train_regions`] makes the network for a robot from the plans of that robot on generated
//! maps.
//!
//! ```
//! use sharp_regions::{GeometricSettings, Source, geometric_regions};
//! use sharp_space::{Footprint, OccupancyGrid};
//!
//! let rooms = "###########\n#....#....#\n#.........#\n#....#....#\n###########";
//! let grid = OccupancyGrid::from_ascii(0.5, rooms).unwrap();
//! let robot = Footprint::rectangle(0.25, 0.2).unwrap();
//! let found = geometric_regions(&grid, &robot, &GeometricSettings::default());
//! assert_eq!(found.regions.len(), 1, "the door");
//! assert_eq!(found.source, Source::Geometric);
//! ```
//!
//! # Features
//!
//! `ndarray` adds burn's older CPU backend as a second [`ComputeDevice`].

mod batch;
mod conv;
mod dataset;
mod device;
mod doors;
mod doorways;
mod extract;
mod geometric;
mod heatmap;
mod image;
mod labels;
mod loss;
mod predict;
mod score;
mod shipped;
mod skeleton;
mod store;
mod train;
mod unet;

pub use dataset::DatasetError;
pub use device::ComputeDevice;
pub use doors::{DoorScore, score_doors};
pub use doorways::find_regions;
pub use extract::ExtractSettings;
pub use geometric::{GeometricSettings, detect_geometric};
pub use heatmap::{HEADING_BINS, Heatmap};
pub use labels::{LabelRobot, LabelSettings, Labels, label_map};
pub use predict::{Prediction, RegionPredictor, RegionSettings, Source, geometric_regions, predict_regions};
pub use score::{RegionScore, grid_regions, random_regions, score_regions, scoring_maps};
pub use store::{ModelCard, ModelError};
pub use train::{
    HELD_OUT_KINDS, TrainError, TrainFolder, TrainObserver, TrainProgress, TrainSettings, VALIDATION_KINDS,
    train_regions,
};
pub use unet::{Activation, UNetConfig};
