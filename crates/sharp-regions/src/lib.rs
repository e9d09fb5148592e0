//! Critical regions: labels, network, prediction.

mod extract;
mod geometric;
mod heatmap;
mod skeleton;

pub use extract::{ExtractSettings, extract_regions};
pub use geometric::{GeometricSettings, detect_geometric};
pub use heatmap::{HEADING_BINS, Heatmap};
