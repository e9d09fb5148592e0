//! The region network as a detector.

use sharp_space::{Detection, Footprint, OccupancyGrid, RegionDetector};

use crate::network::predict::predict_regions;
use crate::network::predictor::RegionPredictor;
use crate::prediction::RegionSettings;

/// Finds critical regions with a trained network (paper, "Learning Critical Regions"), and with the
/// geometric detector where the network finds nothing usable.
#[derive(Clone, Debug)]
pub struct NetworkDetector {
    /// The network.
    pub predictor: RegionPredictor,
    /// How regions are taken from what it says.
    pub settings: RegionSettings,
}

impl NetworkDetector {
    /// A detector with default settings.
    #[must_use]
    pub fn new(predictor: RegionPredictor) -> Self {
        Self { predictor, settings: RegionSettings::default() }
    }

    /// The shipped network of the robot whose width is nearest to that of `footprint`.
    #[must_use]
    pub fn shipped_for(footprint: &Footprint) -> Self {
        Self::new(RegionPredictor::shipped_for(footprint))
    }
}

impl RegionDetector for NetworkDetector {
    /// The source is `net`, or `geometric` where the fallback was used; the criticality is the
    /// network's in both cases, unless the map is too large for it.
    fn detect(&self, grid: &OccupancyGrid, footprint: &Footprint) -> Detection {
        predict_regions(grid, footprint, &self.predictor, &self.settings).into()
    }
}

#[cfg(test)]
mod tests {
    use sharp_space::conformance::check_region_detector;

    use super::*;
    use crate::network::predictor::tests::untrained;

    #[test]
    fn network_detectors_conform_trained_or_not() {
        let shipped = RegionPredictor::shipped("husky").expect("the network is shipped");
        for predictor in [untrained(), shipped] {
            assert_eq!(check_region_detector(&NetworkDetector::new(predictor)), Ok(()));
        }
    }

    #[test]
    fn a_detection_names_who_found_the_regions() {
        let drawing = "#########\n#...#...#\n#.......#\n#...#...#\n#########";
        let grid = OccupancyGrid::from_ascii(0.5, drawing).unwrap();
        let robot = Footprint::rectangle(0.3, 0.2).unwrap();
        let mut detector = NetworkDetector::shipped_for(&robot);
        let settings = detector.settings;
        let found = predict_regions(&grid, &robot, &detector.predictor, &settings);
        assert_eq!(detector.detect(&grid, &robot), found.into(), "the same as the function");
        detector.settings.pixels_max = 10;
        assert_eq!(detector.detect(&grid, &robot).source, "geometric", "the map is too large");
    }
}
