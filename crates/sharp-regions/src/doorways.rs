//! Doorways that the network hints at.
//!
//! Few plans pass the door of one office among twenty. So the network rates the door lower than the
//! corridor outside, and a threshold low enough for the door also takes most of the corridor. A
//! narrowing of the free space is evidence too: where the medial axis passes one, a lower threshold
//! is enough.

use sharp_space::{Cell, DistanceField, Footprint, Region, RegionId, trig};

use crate::extract::{extract_regions, number};
use crate::geometric::{disc_around, doorways};
use crate::heatmap::Heatmap;
use crate::prediction::RegionSettings;

/// The regions of `heatmap` for a robot with `footprint`: hot pieces of the map, and doorways between
/// them that are at least warm.
///
/// Regions are disjoint, connected, and numbered in row-major order of their representatives.
///
/// # Panics
/// If the heat map and the clearance belong to grids of different sizes.
#[must_use]
pub fn find_regions(
    heatmap: &Heatmap,
    clearance: &DistanceField,
    footprint: &Footprint,
    settings: &RegionSettings,
) -> Vec<Region> {
    let min_clearance_m = footprint.inscribed_radius_m();
    let mut regions = extract_regions(heatmap, clearance, min_clearance_m, &settings.extract);
    let warm = settings.extract.doorway_threshold;
    if warm > 1.0 {
        return regions;
    }
    let frame = clearance.frame();
    let radius_m = settings.extract.disc_radius_m;
    let mut taken = vec![false; frame.len()];
    for &cell in regions.iter().flat_map(|region| &region.cells) {
        taken[frame.index(cell)] = true;
    }
    for door in doorways(clearance, footprint, &settings.geometric) {
        let around = around(door, clearance, radius_m);
        let is_near_region = around.iter().any(|&cell| taken[frame.index(cell)]);
        if is_near_region || around.iter().all(|&cell| heatmap.at(cell) < warm) {
            continue;
        }
        let cells = disc_around(door, clearance, min_clearance_m, radius_m, &mut taken);
        regions.extend(Region::new(RegionId(0), cells, clearance));
    }
    number(regions)
}

/// The cells within `radius_m` of `center`, walls or not.
fn around(center: Cell, clearance: &DistanceField, radius_m: f64) -> Vec<Cell> {
    let frame = clearance.frame();
    let reach = (radius_m / frame.resolution_m) as usize;
    let span = |at: usize, side: usize| at.saturating_sub(reach)..(at + reach + 1).min(side);
    let square = span(center.row, frame.height)
        .flat_map(|row| span(center.col, frame.width).map(move |col| Cell::new(col, row)));
    let is_near = |cell: &Cell| {
        trig::hypot(cell.col as f64 - center.col as f64, cell.row as f64 - center.row as f64) <= reach as f64
    };
    square.filter(is_near).collect()
}

#[cfg(test)]
mod tests {
    use sharp_space::OccupancyGrid;

    use super::*;

    /// Regions of two rooms with a door between them, whose cells are as hot as `door` says.
    fn find(door: f32, hot_room: bool) -> Vec<Region> {
        let room = format!("#{0}#{0}#", ".".repeat(20));
        let open = format!("#{}#", ".".repeat(41));
        let wall = "#".repeat(43);
        let rows =
            [vec![wall.as_str()], vec![&room; 15], vec![&open; 6], vec![&room; 15], vec![&wall]].concat();
        let grid = OccupancyGrid::from_ascii(0.2, &rows.join("\n")).unwrap();
        let heat = |cell: Cell| match (cell.col, cell.row) {
            (18..=24, 16..=21) => door,
            (5..10, 5..10) if hot_room => 1.0,
            _ => 0.0,
        };
        let frame = *grid.frame();
        let values = (0..frame.len()).map(|index| heat(frame.cell(index))).collect();
        let footprint = Footprint::rectangle(0.4, 0.3).unwrap();
        let heatmap = Heatmap::from_values(frame, values);
        find_regions(&heatmap, &DistanceField::new(&grid), &footprint, &RegionSettings::default())
    }

    #[test]
    fn a_warm_doorway_is_a_region_and_a_cold_one_is_not() {
        let warm = RegionSettings::default().extract.doorway_threshold as f32 + 0.01;
        assert_eq!(find(warm, false).len(), 1, "warm");
        assert_eq!(find(0.0, false), [], "cold");
        assert_eq!(find(1.0, false).len(), 1, "hot: one region, not two");
    }

    #[test]
    fn regions_are_numbered_in_order() {
        let found = find(0.3, true);
        let ids: Vec<u32> = found.iter().map(|region| region.id.0).collect();
        assert_eq!(ids, [0, 1], "the room's and the door's");
        assert!(found[0].representative < found[1].representative, "{found:?}");
    }
}
