//! The regions that a network finds on a map, with the geometric detector as the fallback.

use sharp_space::{Cell, DistanceField, Footprint, OccupancyGrid, Region};

use crate::doorways::find_regions;
use crate::geometric::detect_geometric;
use crate::network::predictor::RegionPredictor;
use crate::pixel::PIXEL_M;
use crate::prediction::{Prediction, RegionSettings, Source, geometric_regions};

/// The critical regions of `grid` for a robot with `footprint`.
///
/// Falls back to the geometric detector if that detector's regions are in reach of much more of the
/// robot's free space than the network's, or if the map is too large. A map without free space, or an
/// open hall, has no regions.
#[must_use]
pub fn predict_regions(
    grid: &OccupancyGrid,
    footprint: &Footprint,
    predictor: &RegionPredictor,
    settings: &RegionSettings,
) -> Prediction {
    let pixels = grid.frame().width_m() / PIXEL_M * (grid.frame().height_m() / PIXEL_M);
    if pixels > settings.pixels_max as f64 {
        return geometric_regions(grid, footprint, &settings.geometric);
    }
    let clearance = DistanceField::new(grid);
    let heatmap = predictor.heatmap(grid, &clearance);
    let min_clearance_m = footprint.inscribed_radius_m();
    let regions = find_regions(&heatmap, &clearance, footprint, settings);
    let reached = |regions: &[Region]| reached_share(regions, &clearance, min_clearance_m, settings.reach_m);
    let enough = reached(&regions) + settings.unreached_max;
    if enough < 1.0 {
        let geometric = detect_geometric(&clearance, footprint, &settings.geometric);
        if reached(&geometric) > enough {
            return Prediction { heatmap, regions: geometric, source: Source::Geometric };
        }
    }
    Prediction { heatmap, regions, source: Source::Network }
}

/// The share of the robot's free space from which a region is at most `reach_m` away, along the grid.
fn reached_share(regions: &[Region], clearance: &DistanceField, min_clearance_m: f64, reach_m: f64) -> f64 {
    let frame = clearance.frame();
    let open = |cell: Cell| clearance.at(cell) >= min_clearance_m;
    let mut seen = vec![false; frame.len()];
    let mut wave: Vec<Cell> = Vec::new();
    for &cell in regions.iter().flat_map(|region| &region.cells) {
        if !std::mem::replace(&mut seen[frame.index(cell)], true) {
            wave.push(cell);
        }
    }
    let mut reached = wave.len();
    for _ in 0..(reach_m / frame.resolution_m) as usize {
        let mut next = Vec::new();
        for cell in wave.iter().flat_map(|&cell| frame.neighbors8(cell)) {
            if !seen[frame.index(cell)] && open(cell) {
                seen[frame.index(cell)] = true;
                next.push(cell);
            }
        }
        reached += next.len();
        wave = next;
    }
    let all = (0..frame.len()).filter(|&index| open(frame.cell(index))).count();
    reached as f64 / all.max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::predictor::tests::untrained;

    fn robot() -> Footprint {
        Footprint::rectangle(0.3, 0.2).unwrap()
    }

    #[test]
    fn degenerate_maps_get_an_answer() {
        let specks = ["#..".repeat(100), "...".repeat(100), "...".repeat(100)].join("\n");
        let maps = ["#", ".", "?", "....\n....", "####\n####", ".........", &vec![specks; 100].join("\n")];
        for drawing in maps {
            let grid = OccupancyGrid::from_ascii(0.1, drawing).unwrap();
            let found = predict_regions(&grid, &robot(), &untrained(), &RegionSettings::default());
            let free = |region: &Region| region.cells.iter().all(|&cell| grid.is_free(cell));
            assert!(
                found.regions.iter().all(free),
                "a region in a wall of {}",
                &drawing[..drawing.len().min(9)]
            );
        }
    }

    #[test]
    fn reach_is_measured_along_free_space() {
        let drawing = "#########\n#...#...#\n#...#...#\n#...#...#\n#########";
        let grid = OccupancyGrid::from_ascii(1.0, drawing).unwrap();
        let clearance = DistanceField::new(&grid);
        let region = Region::new(sharp_space::RegionId(0), vec![Cell::new(1, 1)], &clearance).unwrap();
        let reached = |reach_m| reached_share(std::slice::from_ref(&region), &clearance, 0.5, reach_m);
        assert_eq!(reached(0.0), 1.0 / 18.0, "the region itself");
        assert_eq!(reached(1.0), 4.0 / 18.0, "its neighbours too");
        assert_eq!(reached(100.0), 0.5, "never the room behind the wall");
    }

    #[test]
    fn a_map_that_is_too_large_is_left_to_geometry() {
        let drawing = "#########\n#...#...#\n#.......#\n#...#...#\n#########";
        let grid = OccupancyGrid::from_ascii(0.5, drawing).unwrap();
        let settings = RegionSettings { pixels_max: 10, ..RegionSettings::default() };
        let found = predict_regions(&grid, &robot(), &untrained(), &settings);
        assert_eq!((found.source, found.regions.len()), (Source::Geometric, 1));
    }
}
