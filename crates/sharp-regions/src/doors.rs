//! Do the regions of a map lie at its doors? This measure does not depend on labels or training.
//!
//! The doors come from a survey of the building. A door is found if a region is near it. A region is
//! false if it is near no door, no junction and no narrowing.

use serde::Serialize;
use sharp_space::{DistanceField, Footprint, GridFrame, Point, Region};

use crate::geometric::{GeometricSettings, landmarks};

/// A region is at a door, a junction or a narrowing if a cell of it is at most this far away, metres.
const NEAR_M: f64 = 1.0;

/// How well regions match doors.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct DoorScore {
    /// Number of doors.
    pub doors: usize,
    /// Doors whose middle has a region within a metre.
    pub found: usize,
    /// Doors whose middle has a region's centre within a metre, which is stricter.
    pub found_by_centers: usize,
    /// Share of the doors that are found.
    pub door_recall: f64,
    /// Number of regions.
    pub regions: usize,
    /// Regions at no door, junction or narrowing.
    pub false_regions: usize,
    /// False regions over doors found; infinite if no door is found.
    pub false_per_door: f64,
}

/// The score of `regions` on the map with this `clearance`, for doors with these middles.
///
/// Junctions and narrowings are those of the medial axis of the robot's free space.
#[must_use]
pub fn score_doors(
    regions: &[Region],
    clearance: &DistanceField,
    footprint: &Footprint,
    doors: &[Point],
) -> DoorScore {
    let frame = clearance.frame();
    let marks: Vec<Point> = landmarks(clearance, footprint, &GeometricSettings::default())
        .into_iter()
        .map(|cell| frame.center(cell))
        .chain(doors.iter().copied())
        .collect();
    let count_doors = |is_near: &dyn Fn(&Region, Point) -> bool| {
        doors.iter().filter(|&&door| regions.iter().any(|region| is_near(region, door))).count()
    };
    let found = count_doors(&|region, door| is_at(region, frame, door));
    let false_regions =
        regions.iter().filter(|region| !marks.iter().any(|&mark| is_at(region, frame, mark))).count();
    DoorScore {
        doors: doors.len(),
        found,
        found_by_centers: count_doors(&|region, door| (region.center(frame) - door).norm() <= NEAR_M),
        door_recall: found as f64 / doors.len().max(1) as f64,
        regions: regions.len(),
        false_regions,
        false_per_door: if found == 0 { f64::INFINITY } else { false_regions as f64 / found as f64 },
    }
}

/// Returns true if a cell of `region` has its centre within [`NEAR_M`] of `place`.
fn is_at(region: &Region, frame: &GridFrame, place: Point) -> bool {
    region.cells.iter().any(|&cell| (frame.center(cell) - place).norm() <= NEAR_M)
}

#[cfg(test)]
mod tests {
    use sharp_space::{Cell, OccupancyGrid, RegionId};

    use super::*;

    /// Two rooms of 6 m with a door at (6.25, 3.25), and a region around each of `places`.
    fn score(places: &[(f64, f64)]) -> DoorScore {
        let wall = "#".repeat(25);
        let (room, door) = (format!("#{0}#{0}#", ".".repeat(11)), format!("#{}#", ".".repeat(23)));
        let rows =
            [vec![wall.as_str()], vec![&room; 5], vec![&door; 2], vec![&room; 5], vec![&wall]].concat();
        let grid = OccupancyGrid::from_ascii(0.5, &rows.join("\n")).unwrap();
        let clearance = DistanceField::new(&grid);
        let region = |(id, &(x, y)): (usize, &(f64, f64))| {
            let cell = grid.frame().cell_at(Point::new(x, y)).unwrap();
            Region::new(RegionId(id as u32), vec![cell, Cell::new(cell.col, cell.row + 1)], &clearance)
                .unwrap()
        };
        let regions: Vec<Region> = places.iter().enumerate().map(region).collect();
        let footprint = Footprint::rectangle(0.3, 0.3).unwrap();
        score_doors(&regions, &clearance, &footprint, &[Point::new(6.25, 3.25)])
    }

    #[test]
    fn a_region_in_the_door_finds_it_and_one_in_a_room_is_false() {
        let both = score(&[(6.25, 3.1), (2.0, 1.0)]);
        assert_eq!((both.found, both.false_regions, both.false_per_door), (1, 1, 1.0), "{both:?}");
        let beside = score(&[(2.0, 1.0)]);
        assert_eq!((beside.door_recall, beside.false_per_door), (0.0, f64::INFINITY), "{beside:?}");
    }

    #[test]
    fn no_regions_are_no_mistake_but_find_nothing() {
        let none = score(&[]);
        assert_eq!((none.doors, none.found, none.false_regions), (1, 0, 0), "{none:?}");
    }
}
