//! What a search for critical regions gives, and the settings of that search.

use serde::{Deserialize, Serialize};
use sharp_space::{Detection, DistanceField, Footprint, OccupancyGrid, Region};

use crate::extract::ExtractSettings;
use crate::geometric::{GeometricSettings, detect_geometric};
use crate::heatmap::Heatmap;

/// How regions are found.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
#[non_exhaustive]
pub struct RegionSettings {
    /// From the heat map to regions.
    pub extract: ExtractSettings,
    /// The fallback.
    pub geometric: GeometricSettings,
    /// A place is in reach of a region if the way there is at most this long, metres.
    pub reach_m: f64,
    /// The fallback is used if its regions are in reach of a larger share of the robot's free space
    /// than the network's, by more than this.
    pub unreached_max: f64,
    /// On maps with more pixels of 0.125 m than this the fallback is used; 16 million take the network
    /// about half a minute.
    pub pixels_max: usize,
}

impl Default for RegionSettings {
    fn default() -> Self {
        Self {
            extract: ExtractSettings::default(),
            geometric: GeometricSettings::default(),
            reach_m: 6.0,
            unreached_max: 0.2,
            pixels_max: 16_000_000,
        }
    }
}

/// What found the regions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Source {
    /// The network.
    Network,
    /// The geometric detector: there was no network, or it found nothing usable.
    Geometric,
}

impl Source {
    /// Its name in results and files.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Network => "net",
            Self::Geometric => "geometric",
        }
    }
}

/// The critical regions of a map.
#[derive(Clone, Debug)]
pub struct Prediction {
    /// How critical each cell is: the network's answer, even where the fallback found the regions.
    pub heatmap: Heatmap,
    /// The regions Φ, numbered from 0.
    pub regions: Vec<Region>,
    /// What found them.
    pub source: Source,
}

impl From<Prediction> for Detection {
    fn from(prediction: Prediction) -> Self {
        let Prediction { heatmap, regions, source } = prediction;
        Self::new(regions, source.name()).with_criticality(heatmap.into_values())
    }
}

/// The critical regions of `grid` by geometry alone.
#[must_use]
pub fn geometric_regions(
    grid: &OccupancyGrid,
    footprint: &Footprint,
    settings: &GeometricSettings,
) -> Prediction {
    let regions = detect_geometric(&DistanceField::new(grid), footprint, settings);
    Prediction { heatmap: Heatmap::from_regions(*grid.frame(), &regions), regions, source: Source::Geometric }
}
