//! Regions from a heat map: threshold, connected pieces, and a limit on their size.
//!
//! The paper labels connected critical pixels and takes them as regions. A corridor that is
//! critical from end to end would then be one region. Here the threshold rises inside a piece that
//! is too long until the piece splits; a piece that no threshold splits is covered by discs.

use serde::{Deserialize, Serialize};
use sharp_space::{Cell, DistanceField, GridFrame, Region, RegionId, trig};

use crate::geometric::disc_around;
use crate::heatmap::Heatmap;

/// When a hot piece of a map becomes a region.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
#[non_exhaustive]
pub struct ExtractSettings {
    /// Least criticality of a cell, 0 to 1.
    pub threshold: f64,
    /// Least criticality within a disc around a doorway that makes the doorway a region; above 1
    /// none does.
    pub doorway_threshold: f64,
    /// Least area of a region, square metres.
    pub area_min_m2: f64,
    /// Longest side of a region's bounding box, metres; longer pieces are split.
    pub extent_max_m: f64,
    /// Least distance between the discs that cover a piece no threshold can split, metres.
    pub disc_spacing_m: f64,
    /// Radius of those discs, metres.
    pub disc_radius_m: f64,
}

impl Default for ExtractSettings {
    fn default() -> Self {
        Self {
            threshold: 0.5,
            doorway_threshold: 0.15,
            area_min_m2: 0.15,
            extent_max_m: 2.5,
            disc_spacing_m: 2.5,
            disc_radius_m: 0.6,
        }
    }
}

/// Step by which the threshold rises inside a piece that is too long.
const THRESHOLD_STEP: f64 = 0.04;

/// The regions of `heatmap` where the clearance is at least `min_clearance_m`, the radius of the
/// robot's inscribed disc.
///
/// Regions are connected, disjoint, and numbered in row-major order of their representatives. They are at least
/// `area_min_m2` large, but for the discs that cover a long piece: what is left at its end may be smaller.
///
/// # Panics
/// If the heat map and the clearance belong to grids of different sizes.
#[must_use]
pub(crate) fn extract_regions(
    heatmap: &Heatmap,
    clearance: &DistanceField,
    min_clearance_m: f64,
    settings: &ExtractSettings,
) -> Vec<Region> {
    let frame = heatmap.frame();
    assert_eq!(frame.len(), clearance.frame().len(), "heat map and clearance are of one map");
    let free = |&cell: &Cell| clearance.at(cell) >= min_clearance_m.max(f64::MIN_POSITIVE);
    let open: Vec<Cell> = (0..frame.len()).map(|index| frame.cell(index)).filter(free).collect();
    let mut split = Split { heatmap, clearance, min_clearance_m, settings, mark: vec![false; frame.len()] };
    let mut pieces = Vec::new();
    split.above(&open, settings.threshold, &mut pieces);
    number(pieces.into_iter().filter_map(|cells| Region::new(RegionId(0), cells, clearance)).collect())
}

/// Numbers `regions` in row-major order of their representatives.
pub(crate) fn number(mut regions: Vec<Region>) -> Vec<Region> {
    regions.sort_by_key(|region| region.representative);
    for (id, region) in regions.iter_mut().enumerate() {
        region.id = RegionId(id as u32);
    }
    regions
}

struct Split<'a> {
    heatmap: &'a Heatmap,
    clearance: &'a DistanceField,
    min_clearance_m: f64,
    settings: &'a ExtractSettings,
    /// Working memory: cells of the set that is being split.
    mark: Vec<bool>,
}

impl Split<'_> {
    /// Adds the pieces of `cells` that are at least as hot as `threshold`.
    fn above(&mut self, cells: &[Cell], threshold: f64, pieces: &mut Vec<Vec<Cell>>) {
        let hot: Vec<Cell> = cells.iter().copied().filter(|&c| self.heatmap.at(c) >= threshold).collect();
        let frame = *self.heatmap.frame();
        let min_cells = self.settings.area_min_m2 / (frame.resolution_m * frame.resolution_m);
        let components = components(&frame, &hot, &mut self.mark);
        let large = components.into_iter().filter(|component| component.len() as f64 >= min_cells);
        for component in large.collect::<Vec<_>>() {
            if extent_cells(&component) as f64 * frame.resolution_m <= self.settings.extent_max_m {
                pieces.push(component);
            } else if threshold + THRESHOLD_STEP < 1.0 {
                self.above_next(&component, threshold + THRESHOLD_STEP, pieces);
            } else {
                self.cover(&component, pieces);
            }
        }
    }

    /// Splits a long piece by a higher threshold, or by discs where that would lose it whole.
    fn above_next(&mut self, component: &[Cell], threshold: f64, pieces: &mut Vec<Vec<Cell>>) {
        let found = pieces.len();
        self.above(component, threshold, pieces);
        if pieces.len() == found {
            self.cover(component, pieces);
        }
    }

    /// Covers a piece with discs around its hottest cells, ties to the clearer one.
    fn cover(&self, component: &[Cell], pieces: &mut Vec<Vec<Cell>>) {
        let frame = self.heatmap.frame();
        let mut order = component.to_vec();
        order.sort_by(|&a, &b| {
            let by_heat = self.heatmap.at(b).total_cmp(&self.heatmap.at(a));
            by_heat.then(self.clearance.at(b).total_cmp(&self.clearance.at(a))).then(a.cmp(&b))
        });
        let mut taken = vec![true; frame.len()];
        component.iter().for_each(|&cell| taken[frame.index(cell)] = false);
        let mut centers: Vec<Cell> = Vec::new();
        let spacing = self.settings.disc_spacing_m / frame.resolution_m;
        for cell in order {
            let apart = |c: &Cell| {
                trig::hypot(c.col as f64 - cell.col as f64, c.row as f64 - cell.row as f64) >= spacing
            };
            if centers.iter().all(apart) {
                centers.push(cell);
                let radius = self.settings.disc_radius_m;
                pieces.push(disc_around(cell, self.clearance, self.min_clearance_m, radius, &mut taken));
            }
        }
    }
}

/// The 8-connected pieces of `cells`, each in the order of discovery; `mark` is false before and after.
pub(crate) fn components(frame: &GridFrame, cells: &[Cell], mark: &mut [bool]) -> Vec<Vec<Cell>> {
    cells.iter().for_each(|&cell| mark[frame.index(cell)] = true);
    let mut found = Vec::new();
    for &seed in cells {
        if !std::mem::take(&mut mark[frame.index(seed)]) {
            continue;
        }
        let mut piece = vec![seed];
        let mut next = 0;
        while next < piece.len() {
            for cell in frame.neighbors8(piece[next]) {
                if std::mem::take(&mut mark[frame.index(cell)]) {
                    piece.push(cell);
                }
            }
            next += 1;
        }
        found.push(piece);
    }
    found
}

/// The longer side of the bounding box, cells.
fn extent_cells(cells: &[Cell]) -> usize {
    let span = |of: fn(&Cell) -> usize| {
        let low = cells.iter().map(of).min().unwrap_or(0);
        cells.iter().map(of).max().unwrap_or(0) + 1 - low
    };
    span(|c| c.col).max(span(|c| c.row))
}

#[cfg(test)]
mod tests {
    use sharp_space::OccupancyGrid;

    use super::*;

    fn open_map(width: usize, height: usize) -> (DistanceField, GridFrame) {
        let drawing = vec![".".repeat(width); height].join("\n");
        let grid = OccupancyGrid::from_ascii(0.1, &drawing).unwrap();
        (DistanceField::new(&grid), *grid.frame())
    }

    fn extract(size: (usize, usize), heat: impl Fn(Cell) -> f32) -> (Vec<Region>, GridFrame) {
        let (clearance, frame) = open_map(size.0, size.1);
        let values = (0..frame.len()).map(|index| heat(frame.cell(index))).collect();
        let heatmap = Heatmap::from_values(frame, values);
        (extract_regions(&heatmap, &clearance, 0.1, &ExtractSettings::default()), frame)
    }

    #[test]
    fn hot_pieces_become_regions_and_specks_do_not() {
        let inside = |c: Cell, col: usize, row: usize, side: usize| {
            (col..col + side).contains(&c.col) && (row..row + side).contains(&c.row)
        };
        let (regions, frame) = extract((100, 60), |c| {
            f32::from(u8::from(inside(c, 10, 10, 8) || inside(c, 60, 30, 12) || inside(c, 40, 40, 2)))
        });
        let areas: Vec<usize> = regions.iter().map(|r| r.cells.len()).collect();
        assert_eq!(areas, [64, 144], "two squares, the speck dropped");
        assert!((regions[1].area_m2(&frame) - 1.44).abs() < 1e-9, "area in square metres");
    }

    #[test]
    fn a_long_piece_splits_where_it_is_cooler() {
        let bump = |c: Cell, at: f64| (-((c.col as f64 - at) / 8.0).powi(2)).exp();
        let (regions, _) = extract((100, 30), |c| {
            let band = (10..20).contains(&c.row);
            if band { (0.55 + 0.4 * (bump(c, 20.0) + bump(c, 75.0))) as f32 } else { 0.0 }
        });
        assert_eq!(regions.len(), 2, "{regions:?}");
        for (region, at) in regions.iter().zip([20, 75]) {
            assert!(region.cells.iter().all(|c| c.col.abs_diff(at) < 13), "one bump each");
        }
    }

    #[test]
    fn a_flat_corridor_is_covered_by_discs() {
        let (regions, _) = extract((120, 30), |c| if (10..20).contains(&c.row) { 1.0 } else { 0.0 });
        assert!((4..=6).contains(&regions.len()), "12 m at a disc every 2.5 m gave {}", regions.len());
        let mut cells: Vec<Cell> = regions.iter().flat_map(|r| r.cells.clone()).collect();
        let count = cells.len();
        cells.sort_unstable();
        cells.dedup();
        assert_eq!(cells.len(), count, "regions are disjoint");
    }

    #[test]
    fn degenerate_heat_has_a_sensible_answer() {
        assert_eq!(extract((1, 1), |_| 1.0).0, [], "one cell is smaller than a region");
        assert_eq!(extract((50, 50), |_| 0.0).0, [], "cold");
        assert_eq!(extract((50, 50), |_| f32::NAN).0, [], "NaN counts as cold");
        let specks = extract((300, 300), |c| f32::from(u8::from(c.col % 3 == 0 && c.row % 3 == 0))).0;
        assert_eq!(specks, [], "10,000 specks");
    }
}
