//! Critical regions: places that most plans pass and few random samples hit.
//!
//! [`geometric_regions`] finds doorways, junctions and mouths of corridors on a map. With the feature
//! `network`, a [`RegionPredictor`] holds a trained network, and [`predict_regions`] turns a map into a
//! [`Prediction`]: a [`Heatmap`] and the regions in it, by geometry where the network finds nothing
//! usable. [`train_regions`] trains the network for a robot on the plans of that robot on generated
//! maps.
//!
//! Planning asks for a `RegionDetector` of sharp-space. [`NetworkDetector`], [`GeometricDetector`],
//! [`GridDetector`], [`RandomDetector`] and [`ListDetector`] are ours.
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
//! - `network` (on by default): the network, its training, and the two that are shipped. Without it the
//!   crate does not depend on burn.
//! - `ndarray`: burn's older CPU backend as a second [`ComputeDevice`].
#![cfg_attr(
    not(feature = "network"),
    allow(rustdoc::broken_intra_doc_links, reason = "links into `network`")
)]

mod detectors;
mod doors;
mod doorways;
mod extract;
mod geometric;
mod heatmap;
mod labels;
#[cfg(feature = "network")]
mod network;
mod pixel;
mod prediction;
mod recipe;
mod score;
mod skeleton;

pub use detectors::{
    BLIND_RADIUS_M, GeometricDetector, GridDetector, ListDetector, PlaceError, RandomDetector, RegionCount,
};
pub use doors::{DoorScore, score_doors};
pub use doorways::find_regions;
pub use extract::ExtractSettings;
pub use geometric::{GeometricSettings, detect_geometric};
pub use heatmap::{HEADING_BINS, Heatmap};
pub use labels::{LabelRobot, LabelSettings, Labels, label_map};
#[cfg(feature = "network")]
pub use network::{
    Activation, ComputeDevice, DatasetError, ModelCard, ModelError, NetworkDetector, RegionPredictor,
    RegionTrainError, RegionTrainSettings, TrainFolder, TrainObserver, TrainProgress, UNetConfig,
    predict_regions, train_regions,
};
pub use prediction::{Prediction, RegionSettings, Source, geometric_regions};
pub use recipe::{HELD_OUT_KINDS, VALIDATION_KINDS};
pub use score::{RegionScore, grid_regions, random_regions, score_regions, scoring_maps};
