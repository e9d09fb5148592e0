//! Detectors that need no network: by geometry, on a lattice, at random, from a list.
//!
//! All are a [`RegionDetector`], as is [`NetworkDetector`](crate::NetworkDetector) with the feature
//! `network`.

use std::fmt;
use std::sync::Arc;

use sharp_space::{
    Cell, Detection, DistanceField, Footprint, OccupancyGrid, Point, Region, RegionDetector, RegionId, Seed,
};
use thiserror::Error;

use crate::geometric::GeometricSettings;
use crate::heatmap::Heatmap;
use crate::prediction::geometric_regions;
use crate::score::{grid_regions, random_regions};

/// Radius of the regions that [`GridDetector`] and [`RandomDetector`] place, metres: a doorway's size.
pub const BLIND_RADIUS_M: f64 = 0.5;

/// Finds doorways, junctions, bends and mouths of corridors by geometry alone.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct GeometricDetector {
    /// What counts as narrow, and how far apart regions lie.
    pub settings: GeometricSettings,
}

impl RegionDetector for GeometricDetector {
    /// The source is `geometric`; a cell's criticality is 1 inside a region and 0 outside.
    fn detect(&self, grid: &OccupancyGrid, footprint: &Footprint) -> Detection {
        geometric_regions(grid, footprint, &self.settings).into()
    }
}

/// How many regions a detector places that knows nothing of the map.
#[derive(Clone)]
pub enum RegionCount {
    /// This many on every map.
    Fixed(usize),
    /// As many as another detector finds on the same map.
    Like(Arc<dyn RegionDetector>),
}

impl fmt::Debug for RegionCount {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Fixed(count) => f.debug_tuple("Fixed").field(count).finish(),
            Self::Like(_) => f.debug_tuple("Like").finish_non_exhaustive(),
        }
    }
}

impl RegionCount {
    fn on(&self, grid: &OccupancyGrid, footprint: &Footprint) -> usize {
        match self {
            Self::Fixed(count) => *count,
            Self::Like(detector) => detector.detect(grid, footprint).regions.len(),
        }
    }
}

/// Places discs on a square lattice in the robot's free space. It knows nothing of the map: any
/// predictor must do better.
#[derive(Clone, Debug)]
pub struct GridDetector {
    /// About how many regions to place.
    pub count: RegionCount,
}

impl RegionDetector for GridDetector {
    /// The source is `grid`; a cell's criticality is 1 inside a region and 0 outside.
    fn detect(&self, grid: &OccupancyGrid, footprint: &Footprint) -> Detection {
        let (clearance, count) = (DistanceField::new(grid), self.count.on(grid, footprint));
        let regions = grid_regions(&clearance, footprint.inscribed_radius_m(), count, BLIND_RADIUS_M);
        blind(grid, regions, "grid")
    }
}

/// Places discs uniformly at random in the robot's free space. It knows nothing of the map: any
/// predictor must do better.
#[derive(Clone, Debug)]
pub struct RandomDetector {
    /// How many regions to place; fewer if discs would overlap.
    pub count: RegionCount,
    /// The root of the random places: equal seeds give equal regions.
    pub seed: Seed,
}

impl RegionDetector for RandomDetector {
    /// The source is `random`; a cell's criticality is 1 inside a region and 0 outside.
    fn detect(&self, grid: &OccupancyGrid, footprint: &Footprint) -> Detection {
        let (clearance, count) = (DistanceField::new(grid), self.count.on(grid, footprint));
        let mut rng = self.seed.stream("random regions", 0);
        let least_m = footprint.inscribed_radius_m();
        let regions = random_regions(&clearance, least_m, count, BLIND_RADIUS_M, &mut rng);
        blind(grid, regions, "random")
    }
}

fn blind(grid: &OccupancyGrid, regions: Vec<Region>, source: &str) -> Detection {
    let heatmap = Heatmap::from_regions(*grid.frame(), &regions);
    Detection::new(regions, source).with_criticality(heatmap.into_values())
}

/// Regions around a list of places: one region of a cell and its neighbours for each place.
#[derive(Clone, Debug, PartialEq)]
pub struct ListDetector {
    /// The places in the world, in the order of the regions.
    pub places: Vec<Point>,
    /// What detections name as their source, such as the file that holds the list.
    pub source: String,
}

impl ListDetector {
    /// A detector for `places` with the source `list`.
    #[must_use]
    pub fn new(places: Vec<Point>) -> Self {
        Self { places, source: "list".to_owned() }
    }

    /// The same with another source.
    #[must_use]
    pub fn with_source(self, source: impl Into<String>) -> Self {
        Self { source: source.into(), ..self }
    }

    /// The regions on a map in which every place must have room for the robot.
    ///
    /// # Errors
    /// Returns the first place that lies outside the map or too near to an obstacle.
    pub fn regions(&self, grid: &OccupancyGrid, footprint: &Footprint) -> Result<Vec<Region>, PlaceError> {
        let clearance = DistanceField::new(grid);
        let place = |(position, &place): (usize, &Point)| {
            region_around(place, position, &clearance, footprint).ok_or(PlaceError { position, place })
        };
        self.places.iter().enumerate().map(place).collect()
    }
}

impl RegionDetector for ListDetector {
    /// Leaves out places without room for the robot; [`ListDetector::regions`] reports them. The
    /// criticality of cells is not known.
    fn detect(&self, grid: &OccupancyGrid, footprint: &Footprint) -> Detection {
        let clearance = DistanceField::new(grid);
        let mut regions = Vec::with_capacity(self.places.len());
        for &place in &self.places {
            regions.extend(region_around(place, regions.len(), &clearance, footprint));
        }
        Detection::new(regions, self.source.clone())
    }
}

/// The cell at `place` and those around it where the robot has room; `None` if it has none at `place`.
fn region_around(
    place: Point,
    position: usize,
    clearance: &DistanceField,
    footprint: &Footprint,
) -> Option<Region> {
    let frame = clearance.frame();
    let has_room = |&cell: &Cell| clearance.at(cell) >= footprint.inscribed_radius_m();
    let middle = frame.cell_at(place).filter(has_room)?;
    let cells = std::iter::once(middle).chain(frame.neighbors8(middle).filter(has_room)).collect();
    Region::new(RegionId(position as u32), cells, clearance)
}

/// A place in a list where the robot has no room.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[error("entry {position} is ({}, {}), expected a place with room for the robot", place.x, place.y)]
pub struct PlaceError {
    /// Position in the list, from 0.
    pub position: usize,
    /// The place.
    pub place: Point,
}

#[cfg(test)]
mod tests {
    use sharp_space::conformance::check_region_detector;

    use super::*;

    #[test]
    fn every_detector_conforms() {
        let geometric = GeometricDetector::default();
        let like = || RegionCount::Like(Arc::new(geometric));
        let places = vec![Point::new(2.0, 2.0), Point::new(0.1, 0.1), Point::new(7.0, 4.0)];
        let detectors: [&dyn RegionDetector; 6] = [
            &geometric,
            &GridDetector { count: RegionCount::Fixed(9) },
            &GridDetector { count: like() },
            &RandomDetector { count: RegionCount::Fixed(9), seed: Seed(1) },
            &RandomDetector { count: like(), seed: Seed(1) },
            &ListDetector::new(places),
        ];
        for (number, detector) in detectors.iter().enumerate() {
            assert_eq!(check_region_detector(detector), Ok(()), "detector {number}");
        }
    }

    fn two_rooms() -> (OccupancyGrid, Footprint) {
        let drawing = "###########\n#....#....#\n#.........#\n#....#....#\n###########";
        (OccupancyGrid::from_ascii(0.5, drawing).unwrap(), Footprint::rectangle(0.25, 0.2).unwrap())
    }

    #[test]
    fn a_list_names_the_place_without_room() {
        let (grid, robot) = two_rooms();
        let list = ListDetector::new(vec![Point::new(1.2, 1.2), Point::new(2.7, 0.7), Point::new(4.2, 1.2)]);
        let refused = list.regions(&grid, &robot).unwrap_err().to_string();
        assert_eq!(refused, "entry 1 is (2.7, 0.7), expected a place with room for the robot");
        let found = list.with_source("doors.ron").detect(&grid, &robot);
        let names: Vec<u32> = found.regions.iter().map(|region| region.id.0).collect();
        assert_eq!((names, found.source.as_str()), (vec![0, 1], "doors.ron"), "the wall is left out");
        assert_eq!(found.regions[0].cells.len(), 9, "the cell and its neighbours");
    }

    #[test]
    fn blind_detectors_place_as_many_regions_as_another_finds() {
        let (grid, robot) = two_rooms();
        let count = RegionCount::Like(Arc::new(GeometricDetector::default()));
        let found = RandomDetector { count, seed: Seed(1) }.detect(&grid, &robot);
        assert_eq!((found.regions.len(), found.source.as_str()), (1, "random"));
        let hot = found.criticality.unwrap().iter().filter(|&&value| value == 1.0).count();
        assert_eq!(hot, found.regions[0].cells.len(), "hot inside the region only");
    }
}
