//! The networks that come with the library; `assets/README.md` of this crate says how they were made.

use sharp_space::Footprint;

use crate::network::device::ComputeDevice;
use crate::network::predictor::RegionPredictor;

/// Robots by the names of their files.
const SHIPPED: [(&str, &[u8]); 2] = [
    ("husky", include_bytes!("../../assets/regions-husky.safetensors")),
    ("limo", include_bytes!("../../assets/regions-limo.safetensors")),
];

impl RegionPredictor {
    /// The shipped network of the robot called `husky` or `limo`; `None` for other names.
    #[must_use]
    pub fn shipped(robot: &str) -> Option<Self> {
        SHIPPED.iter().find(|(name, _)| *name == robot).map(|(_, bytes)| Self::embedded(bytes))
    }

    /// The shipped network of the robot whose width is nearest to that of `footprint`.
    #[must_use]
    pub fn shipped_for(footprint: &Footprint) -> Self {
        let off = |predictor: &Self| (predictor.card().half_width_m - footprint.half_width_m()).abs();
        let all = SHIPPED.iter().map(|(_, bytes)| Self::embedded(bytes));
        all.min_by(|a, b| off(a).total_cmp(&off(b))).expect("there are shipped networks")
    }

    fn embedded(bytes: &[u8]) -> Self {
        Self::from_bytes(bytes, ComputeDevice::default()).expect("a test reads every shipped network")
    }
}

#[cfg(test)]
mod tests {
    use sharp_motion::Steering;
    use sharp_space::{DistanceField, Seed};

    use super::*;
    use crate::{
        HELD_OUT_KINDS, LabelRobot, LabelSettings, RegionScore, RegionSettings, Source, predict_regions,
        random_regions, score_regions, scoring_maps,
    };

    #[test]
    fn every_shipped_network_is_sound_and_small() {
        for (name, bytes) in SHIPPED {
            let predictor = RegionPredictor::shipped(name).unwrap();
            assert_eq!(predictor.to_bytes(), bytes, "{name} as it was written");
            assert!(bytes.len() < 2_000_000, "{name} has {} bytes", bytes.len());
        }
        assert!(RegionPredictor::shipped("r2d2").is_none(), "an unknown robot");
    }

    #[test]
    fn other_robots_get_the_network_of_the_nearest_width() {
        for (half_width_m, expected) in [(0.05, 0.11), (0.2, 0.11), (0.3, 0.335), (2.0, 0.335)] {
            let footprint = Footprint::rectangle(1.0, half_width_m).unwrap();
            let card = RegionPredictor::shipped_for(&footprint).card().clone();
            assert_eq!(card.half_width_m, expected, "for a robot {half_width_m} m to either side");
        }
    }

    #[test]
    fn the_shipped_network_beats_random_regions_on_kinds_it_never_saw() {
        let footprint = Footprint::rectangle(0.5, 0.335).unwrap();
        let robot = LabelRobot { footprint, steering: Steering::RotateTranslate };
        let labels = LabelSettings { goals: 8, starts: 10, ..LabelSettings::default() };
        let predictor = RegionPredictor::shipped("husky").unwrap();
        let mut scores = [Vec::new(), Vec::new()];
        for (grid, labels) in scoring_maps(&HELD_OUT_KINDS, &robot, labels, Seed(11)) {
            let found = predict_regions(&grid, &footprint, &predictor, &RegionSettings::default());
            assert_eq!(found.source, Source::Network, "the fallback was used");
            let clearance = DistanceField::new(&grid);
            let mut rng = Seed(11).stream("random", 0);
            let random = random_regions(&clearance, 0.335, found.regions.len(), 0.5, &mut rng);
            scores[0].push(score_regions(&found.regions, grid.frame(), &labels));
            scores[1].push(score_regions(&random, grid.frame(), &labels));
        }
        let [network, random] = scores.map(|scores| RegionScore::mean(&scores));
        assert!(network.density > 2.0 * random.density, "{network:?} against {random:?}");
        assert!(network.mu > 1.5 * random.mu, "{network:?} against {random:?}");
        assert!(network.precision > 0.3, "{network:?}");
    }
}
