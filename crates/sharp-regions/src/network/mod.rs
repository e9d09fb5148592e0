//! All that needs burn: the network, its training, and regions by network.
//!
//! The feature `network` holds this folder; the rest of the crate never names burn.

mod batch;
mod conv;
mod detector;
mod device;
mod image;
mod loss;
mod predict;
mod predictor;
mod samples;
mod settings;
mod shipped;
mod store;
mod train;
mod unet;

pub use detector::NetworkDetector;
pub use device::ComputeDevice;
pub use predict::predict_regions;
pub use predictor::RegionPredictor;
pub use samples::DatasetError;
pub use settings::RegionTrainSettings;
pub use store::{ModelCard, ModelError};
pub use train::{RegionTrainError, TrainFolder, TrainObserver, TrainProgress, train_regions};
pub use unet::{Activation, UNetConfig};
