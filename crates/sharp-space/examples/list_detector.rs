//! A detector that reads the places of its regions from a list, checked by the conformance suite.
//!
//! `cargo run --release -p sharp-space --example list_detector`

use sharp_space::conformance::check_region_detector;
use sharp_space::{
    Detection, DistanceField, Footprint, OccupancyGrid, Point, Region, RegionDetector, RegionId,
};

/// Places in the world, metres, one region each.
struct Places(Vec<Point>);

impl Places {
    /// Reads one place per line: x and y, separated by a blank.
    fn read(list: &str) -> Option<Self> {
        let place = |line: &str| {
            let (x, y) = line.trim().split_once(' ')?;
            Some(Point::new(x.parse().ok()?, y.parse().ok()?))
        };
        list.lines().map(place).collect::<Option<_>>().map(Self)
    }
}

impl RegionDetector for Places {
    fn detect(&self, grid: &OccupancyGrid, footprint: &Footprint) -> Detection {
        let (frame, field) = (grid.frame(), DistanceField::new(grid));
        let has_room = |cell: &_| field.at(*cell) >= footprint.inscribed_radius_m();
        let mut regions = Vec::new();
        for cell in self.0.iter().filter_map(|place| frame.cell_at(*place)).filter(has_room) {
            let cells = frame.neighbors8(cell).filter(has_room).chain([cell]).collect();
            regions.extend(Region::new(RegionId(regions.len() as u32), cells, &field));
        }
        Detection::new(regions, "places")
    }
}

fn main() {
    let drawing = "###########\n#....#....#\n#.........#\n#....#....#\n###########";
    let grid = OccupancyGrid::from_ascii(1.0, drawing).expect("the drawing is sound");
    let robot = Footprint::rectangle(0.5, 0.3).expect("the sizes are positive");
    let detector = Places::read("5.5 2.5\n2.5 2.5\n5.5 1.5").expect("the list is sound");
    assert_eq!(check_region_detector(&detector), Ok(()));
    let detection = detector.detect(&grid, &robot);
    assert_eq!(detection.regions.len(), 2, "the third place lies in the wall");
    println!("{} regions from {}", detection.regions.len(), detection.source);
}
