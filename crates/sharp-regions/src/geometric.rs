//! Critical regions from geometry alone: doorways, junctions, bends and mouths of corridors.
//!
//! This detector is the fallback if there is no network or the network finds nothing. It places a
//! region wherever the medial axis of the robot's free space passes a narrowing between two wider
//! places, or branches or bends inside a narrow place. This approximates the paper's criticality
//! (many solutions, small volume) without solving any problem.

use serde::{Deserialize, Serialize};
use sharp_space::{Cell, DistanceField, Footprint, Region, RegionId, trig};

use crate::skeleton::{Ridge, Skeleton};

/// What counts as narrow, and how far apart regions lie.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
#[non_exhaustive]
pub struct GeometricSettings {
    /// The widest passage that counts as narrow, metres from wall to wall.
    pub passage_max_m: f64,
    /// How many times wider than a narrowing the places on both its sides must be.
    pub widening: f64,
    /// Least distance between two regions, metres.
    pub spacing_m: f64,
    /// Longest stretch of a narrow corridor without a region, metres.
    pub stretch_max_m: f64,
    /// Largest radius of a region, metres; the walls may cut it down.
    pub radius_m: f64,
}

impl Default for GeometricSettings {
    fn default() -> Self {
        // 1.12 lies below the 1.17 of a right-angled bend and the 1.25 of a T-junction.
        Self { passage_max_m: 2.4, widening: 1.12, spacing_m: 1.5, stretch_max_m: 4.0, radius_m: 0.6 }
    }
}

/// Why a site was chosen. If two sites are too close, the one of the earlier kind stays.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum SiteKind {
    Doorway,
    Junction,
    Mouth,
    Stretch,
}

#[derive(Clone, Copy, Debug)]
struct Site {
    kind: SiteKind,
    cell: Cell,
}

/// Finds doorways, junctions, bends and mouths of corridors that `footprint` can enter.
///
/// Regions come in row-major order of the places they were found at, do not overlap and are numbered in
/// that order; an open hall or a map without free space has none.
#[must_use]
pub fn detect_geometric(
    clearance: &DistanceField,
    footprint: &Footprint,
    settings: &GeometricSettings,
) -> Vec<Region> {
    let reach = footprint.inscribed_radius_m();
    let sites = sites(clearance, footprint, settings);
    let mut cells = thin_sites(sites, clearance, settings.spacing_m);
    cells.sort_unstable();
    let mut taken = vec![false; clearance.frame().len()];
    cells
        .into_iter()
        .map(|cell| disc_around(cell, clearance, reach, settings.radius_m, &mut taken))
        .filter(|cells| !cells.is_empty())
        .enumerate()
        .filter_map(|(id, cells)| Region::new(RegionId(id as u32), cells, clearance))
        .collect()
}

/// The cells of all doorways, junctions, bends and mouths of corridors, however close together.
pub(crate) fn landmarks(
    clearance: &DistanceField,
    footprint: &Footprint,
    settings: &GeometricSettings,
) -> Vec<Cell> {
    let sites = sites(clearance, footprint, settings).into_iter();
    sites.filter(|site| site.kind != SiteKind::Stretch).map(|site| site.cell).collect()
}

/// The middles of short narrowings, the narrower first where two are closer than the spacing.
pub(crate) fn doorways(
    clearance: &DistanceField,
    footprint: &Footprint,
    settings: &GeometricSettings,
) -> Vec<Cell> {
    let sites = sites(clearance, footprint, settings).into_iter();
    let doors = sites.filter(|site| site.kind == SiteKind::Doorway).collect();
    let mut cells = thin_sites(doors, clearance, settings.spacing_m);
    cells.sort_unstable();
    cells
}

fn sites(clearance: &DistanceField, footprint: &Footprint, settings: &GeometricSettings) -> Vec<Site> {
    let skeleton = Skeleton::new(clearance, footprint.inscribed_radius_m(), settings.widening);
    let mut sites = junctions(&skeleton, clearance, settings);
    for ridge in &skeleton.ridges {
        sites.extend(narrowings(ridge, &skeleton, clearance, settings));
    }
    sites
}

/// Nodes in narrow places where at least two ridges meet.
fn junctions(skeleton: &Skeleton, clearance: &DistanceField, settings: &GeometricSettings) -> Vec<Site> {
    // A junction is wider than the corridors that meet there, by 1.41 for a right-angled crossing.
    let widest = settings.passage_max_m / 2.0 * std::f64::consts::SQRT_2;
    let narrow = |cell| clearance.at(cell) <= widest;
    let nodes = skeleton.nodes.iter().filter(|node| node.degree >= 2 && narrow(node.cell));
    nodes.map(|node| Site { kind: SiteKind::Junction, cell: node.cell }).collect()
}

/// The sites along one ridge, if it is narrow: one in a short narrowing; both mouths of a long
/// one and more between them.
fn narrowings(
    ridge: &Ridge,
    skeleton: &Skeleton,
    clearance: &DistanceField,
    settings: &GeometricSettings,
) -> Vec<Site> {
    let Some((low, least_m)) = narrowest(ridge, clearance) else { return Vec::new() };
    let end_height = |end: Option<usize>| end.map_or(least_m, |node| clearance.at(skeleton.nodes[node].cell));
    let rim = end_height(ridge.ends[0]).min(end_height(ridge.ends[1]));
    if least_m > settings.passage_max_m / 2.0 || rim < settings.widening * least_m {
        return Vec::new();
    }
    // The stretch of the ridge that is nearly as narrow as its narrowest cell.
    let flat = |i: &usize| clearance.at(ridge.cells[*i]) <= settings.widening * least_m;
    let first = (0..=low).rev().take_while(flat).last().unwrap_or(low);
    let last = (low..ridge.cells.len()).take_while(flat).last().unwrap_or(low);
    let step_m = clearance.frame().resolution_m;
    let length_m = (last - first) as f64 * step_m;
    let site = |kind, index: usize| Site { kind, cell: ridge.cells[index] };
    if length_m <= 2.0 * settings.spacing_m {
        return vec![site(SiteKind::Doorway, usize::midpoint(first, last))];
    }
    let pieces = (length_m / settings.stretch_max_m).ceil() as usize;
    let mut sites = vec![site(SiteKind::Mouth, first), site(SiteKind::Mouth, last)];
    sites.extend((1..pieces).map(|i| site(SiteKind::Stretch, first + (last - first) * i / pieces)));
    sites
}

/// The position and clearance of the narrowest cell; the middle one if several are equal.
fn narrowest(ridge: &Ridge, clearance: &DistanceField) -> Option<(usize, f64)> {
    let least_m = ridge.cells.iter().map(|&c| clearance.at(c)).reduce(f64::min)?;
    let at_least: Vec<usize> =
        (0..ridge.cells.len()).filter(|&i| clearance.at(ridge.cells[i]) <= least_m).collect();
    Some((at_least[at_least.len() / 2], least_m))
}

/// Keeps sites at least `spacing_m` apart, better kinds and narrower places first.
fn thin_sites(mut sites: Vec<Site>, clearance: &DistanceField, spacing_m: f64) -> Vec<Cell> {
    sites.sort_by(|a, b| {
        let by_width = clearance.at(a.cell).total_cmp(&clearance.at(b.cell));
        a.kind.cmp(&b.kind).then(by_width).then(a.cell.cmp(&b.cell))
    });
    let frame = clearance.frame();
    let spacing_cells = spacing_m / frame.resolution_m;
    let buckets = Buckets::new(spacing_cells.max(1.0));
    let mut kept = buckets;
    for site in sites {
        kept.insert_if_apart(site.cell);
    }
    kept.cells()
}

/// Points on a lattice of squares as wide as the least distance between them.
struct Buckets {
    spacing_cells: f64,
    squares: std::collections::BTreeMap<(i64, i64), Vec<Cell>>,
}

impl Buckets {
    const fn new(spacing_cells: f64) -> Self {
        Self { spacing_cells, squares: std::collections::BTreeMap::new() }
    }

    fn insert_if_apart(&mut self, cell: Cell) {
        let square = |v: usize| (v as f64 / self.spacing_cells) as i64;
        let (x, y) = (square(cell.col), square(cell.row));
        let close = |other: &Cell| {
            let (dc, dr) = (other.col as f64 - cell.col as f64, other.row as f64 - cell.row as f64);
            trig::hypot(dc, dr) < self.spacing_cells
        };
        let around = (-1..=1).flat_map(|dx| (-1..=1).map(move |dy| (x + dx, y + dy)));
        if !around.filter_map(|key| self.squares.get(&key)).flatten().any(close) {
            self.squares.entry((x, y)).or_default().push(cell);
        }
    }

    fn cells(self) -> Vec<Cell> {
        self.squares.into_values().flatten().collect()
    }
}

/// The cells of the robot's free space within `radius_m` of `center` that are not taken and connected
/// to it inside that disc. They are taken afterwards.
pub(crate) fn disc_around(
    center: Cell,
    clearance: &DistanceField,
    min_clearance_m: f64,
    radius_m: f64,
    taken: &mut [bool],
) -> Vec<Cell> {
    let frame = clearance.frame();
    let reach = radius_m / frame.resolution_m;
    let belongs = |cell: Cell| {
        let (dc, dr) = (cell.col as f64 - center.col as f64, cell.row as f64 - center.row as f64);
        trig::hypot(dc, dr) <= reach && clearance.at(cell) >= min_clearance_m
    };
    if taken[frame.index(center)] || !belongs(center) {
        return Vec::new();
    }
    taken[frame.index(center)] = true;
    let mut cells = vec![center];
    let mut next = 0;
    while next < cells.len() {
        for cell in frame.neighbors4(cells[next]) {
            if !taken[frame.index(cell)] && belongs(cell) {
                taken[frame.index(cell)] = true;
                cells.push(cell);
            }
        }
        next += 1;
    }
    cells
}

#[cfg(test)]
mod tests {
    use expect_test::{Expect, expect};
    use sharp_space::OccupancyGrid;

    use super::*;

    fn detect(drawing: &str) -> (OccupancyGrid, Vec<Region>) {
        let grid = OccupancyGrid::from_ascii(0.5, drawing).unwrap();
        let footprint = Footprint::rectangle(0.3, 0.3).unwrap();
        let regions = detect_geometric(&DistanceField::new(&grid), &footprint, &GeometricSettings::default());
        (grid, regions)
    }

    #[expect(clippy::needless_pass_by_value, reason = "expectations are written inline")]
    fn check(drawing: &str, expected: Expect) {
        let (grid, regions) = detect(drawing);
        let mut rows: Vec<Vec<char>> = grid.to_string().lines().map(|row| row.chars().collect()).collect();
        for region in &regions {
            let Cell { row, col } = region.representative;
            rows[grid.frame().height - 1 - row][col] = 'R';
        }
        let drawn =
            rows.into_iter().map(|row| row.into_iter().collect::<String>() + "\n").collect::<String>();
        expected.assert_eq(&drawn);
    }

    #[test]
    fn a_door_between_two_rooms_is_a_region() {
        check(
            "
            #################
            #.......#.......#
            #.......#.......#
            #.......#.......#
            #...............#
            #...............#
            #.......#.......#
            #.......#.......#
            #################",
            expect![[r#"
                #################
                #.......#.......#
                #.......#.......#
                #.......#.......#
                #......R........#
                #...............#
                #.......#.......#
                #.......#.......#
                #################
            "#]],
        );
    }

    #[test]
    fn a_corridor_has_mouths_and_a_junction() {
        check(
            "
            ###############################
            #......##################.....#
            #......##################.....#
            #.............................#
            #.............................#
            #......########..########.....#
            #......########..########.....#
            #......########..########.....#
            ###########........############
            ###########........############
            ###########........############
            ###########........############
            ###############################",
            expect![[r#"
                ###############################
                #......##################.....#
                #......##################.....#
                #.....R.......R..R.......R....#
                #.............................#
                #......########..########.....#
                #......########.R########.....#
                #......########..########.....#
                ###########........############
                ###########........############
                ###########........############
                ###########........############
                ###############################
            "#]],
        );
    }

    #[test]
    fn degenerate_maps_have_no_region() {
        for drawing in ["#", ".", "....\n....", "####\n####"] {
            assert_eq!(detect(drawing).1, [], "in {drawing:?}");
        }
    }
}
