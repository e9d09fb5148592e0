//! How good regions are: the score of Learn and Link, and the overlap with the labels.

use rand::RngExt;
use serde::Serialize;
use sharp_maps::FloorplanKind;
use sharp_space::{Cell, DistanceField, GridFrame, OccupancyGrid, Region, RegionId, Seed, Stream};

use crate::geometric::disc_around;
use crate::labels::{CRITICAL_MIN, LabelRobot, LabelSettings, Labels};
use crate::recipe::Recipe;

/// How well regions match the places that plans pass.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct RegionScore {
    /// Number of regions.
    pub regions: f64,
    /// Sum over the regions of the share of plans that pass, over the area in square metres
    /// (Molina, Kumar and Srivastava, "Learn and Link", 2020, with metres instead of pixels).
    pub mu: f64,
    /// Visits of the average pixel inside the regions over those of the average pixel outside walls:
    /// about 1 for regions at random places.
    pub density: f64,
    /// Share of the regions' area that is critical by the labels.
    pub precision: f64,
    /// Share of the critical area that lies in regions.
    pub recall: f64,
    /// Critical area in regions over the area that is either.
    pub iou: f64,
}

/// The score of `regions` on a map at `frame` with these labels.
#[must_use]
pub fn score_regions(regions: &[Region], frame: &GridFrame, labels: &Labels) -> RegionScore {
    let pixels = labels.frame;
    let mut owner = vec![None; frame.len()];
    for (index, region) in regions.iter().enumerate() {
        region.cells.iter().for_each(|&cell| owner[frame.index(cell)] = Some(index));
    }
    let criticality = labels.criticality();
    let mut share = vec![0.0_f64; regions.len()];
    let (mut both, mut predicted, mut critical) = (0.0, 0.0, 0.0);
    let (mut inside, mut all, mut open) = (0.0, 0.0, 0.0);
    for (pixel, (&visits, criticality)) in labels.visits.iter().zip(criticality).enumerate() {
        let visits = f64::from(visits);
        let region = frame.cell_at(pixels.center(pixels.cell(pixel))).and_then(|c| owner[frame.index(c)]);
        let is_critical = f64::from(u8::from(criticality >= CRITICAL_MIN));
        critical += is_critical;
        all += visits;
        open += f64::from(u8::from(visits > 0.0));
        if let Some(index) = region {
            // A plan that passes a region visits its busiest pixel or one beside it.
            share[index] = share[index].max(visits);
            predicted += 1.0;
            both += is_critical;
            inside += visits;
        }
    }
    let ratio = |a: f64, b: f64| if b > 0.0 { a / b } else { 0.0 };
    RegionScore {
        regions: regions.len() as f64,
        mu: regions.iter().zip(share).map(|(region, share)| share / region.area_m2(frame)).sum(),
        density: ratio(ratio(inside, predicted), ratio(all, open)),
        precision: ratio(both, predicted),
        recall: ratio(both, critical),
        iou: ratio(both, predicted + critical - both),
    }
}

impl RegionScore {
    /// The mean of `scores`; zero of none.
    #[must_use]
    pub fn mean(scores: &[Self]) -> Self {
        let mean = |of: fn(&Self) -> f64| scores.iter().map(of).sum::<f64>() / scores.len().max(1) as f64;
        Self {
            regions: mean(|s| s.regions),
            mu: mean(|s| s.mu),
            density: mean(|s| s.density),
            precision: mean(|s| s.precision),
            recall: mean(|s| s.recall),
            iou: mean(|s| s.iou),
        }
    }
}

/// `count` discs of `radius_m` in the robot's free space, uniformly at random. Any predictor must do
/// better.
#[must_use]
pub fn random_regions(
    clearance: &DistanceField,
    min_clearance_m: f64,
    count: usize,
    radius_m: f64,
    rng: &mut Stream,
) -> Vec<Region> {
    let frame = clearance.frame();
    let open: Vec<Cell> =
        (0..frame.len()).map(|i| frame.cell(i)).filter(|&c| clearance.at(c) >= min_clearance_m).collect();
    let mut taken = vec![false; frame.len()];
    let mut regions = Vec::new();
    for _ in 0..if open.is_empty() { 0 } else { count } {
        let center = open[rng.random_range(0..open.len())];
        let cells = disc_around(center, clearance, min_clearance_m, radius_m, &mut taken);
        regions.extend(Region::new(RegionId(regions.len() as u32), cells, clearance));
    }
    regions
}

/// Discs of `radius_m` on a square lattice whose spacing is chosen so that about `count` of them lie in
/// the robot's free space. Any predictor must do better.
#[must_use]
pub fn grid_regions(
    clearance: &DistanceField,
    min_clearance_m: f64,
    count: usize,
    radius_m: f64,
) -> Vec<Region> {
    let frame = clearance.frame();
    let is_open = |cell: Cell| clearance.at(cell) >= min_clearance_m.max(f64::MIN_POSITIVE);
    let open = (0..frame.len()).filter(|&i| is_open(frame.cell(i))).count();
    // With less than a radius between them, discs would cover each other.
    let least = radius_m / frame.resolution_m;
    let spacing = (open as f64 / count.max(1) as f64).sqrt().max(least).max(1.0);
    let line = |side: usize| {
        (0..).map(move |i| ((f64::from(i) + 0.5) * spacing) as usize).take_while(move |&v| v < side)
    };
    let nodes = line(frame.height).flat_map(|row| line(frame.width).map(move |col| Cell::new(col, row)));
    let mut taken = vec![false; frame.len()];
    let mut regions = Vec::new();
    for node in nodes.filter(|&node| count > 0 && is_open(node)) {
        let cells = disc_around(node, clearance, min_clearance_m, radius_m, &mut taken);
        regions.extend(Region::new(RegionId(regions.len() as u32), cells, clearance));
    }
    regions
}

/// Labelled maps of the given kinds that training with any seed does not see.
#[must_use]
pub fn scoring_maps(
    kinds: &[FloorplanKind],
    robot: &LabelRobot,
    settings: LabelSettings,
    seed: Seed,
) -> Vec<(OccupancyGrid, Labels)> {
    let seed = seed.child("scoring", 0);
    let recipes =
        kinds.iter().enumerate().map(|(i, &kind)| Recipe::new(kind, i as u64, robot, settings, seed));
    let labelled = |recipe: Recipe| {
        let grid = recipe.map();
        let labels = recipe.label(&grid, robot);
        (grid, labels)
    };
    recipes.map(labelled).collect()
}

#[cfg(test)]
mod tests {
    use sharp_space::Pose;

    use super::*;

    fn labels() -> Labels {
        let side = 40;
        let frame =
            GridFrame { origin: Pose::new(0.0, 0.0, 0.0), resolution_m: 0.125, width: side, height: side };
        // Plans cross the map in a band four pixels wide.
        let visits =
            (0..side * side).map(|i| if (18..22).contains(&(i / side)) { 0.5 } else { 0.05 }).collect();
        Labels { frame, visits, headings: vec![0; side * side * crate::labels::FINE_BINS], solved: 10 }
    }

    fn score(rows: std::ops::Range<usize>) -> RegionScore {
        let labels = labels();
        let clearance = DistanceField::from_mask(labels.frame, |_| false);
        let cells = rows.flat_map(|row| (10..20).map(move |col| Cell::new(col, row))).collect();
        score_regions(&[Region::new(RegionId(0), cells, &clearance).unwrap()], &labels.frame, &labels)
    }

    #[test]
    fn a_region_on_the_plans_beats_one_beside_them() {
        let (on, beside) = (score(18..22), score(4..8));
        assert_eq!((on.precision, beside.precision), (1.0, 0.0));
        assert!((on.recall - 0.25).abs() < 1e-9, "a quarter of the band: {on:?}");
        assert!((on.mu - 0.5 / (40.0 * 0.125 * 0.125)).abs() < 1e-6, "share over area: {on:?}");
        assert!(on.density > 4.0 && beside.density < 1.0, "{on:?} {beside:?}");
    }

    #[test]
    fn a_lattice_has_about_as_many_discs_as_asked_for() {
        let frame = labels().frame;
        let clearance = DistanceField::from_mask(frame, |i| i % 40 == 20);
        for count in [0, 1, 9, 30] {
            let found = grid_regions(&clearance, 0.2, count, 0.3).len();
            assert!(found.abs_diff(count) <= count / 2 + 1, "{found} discs for {count}");
        }
        let blocked = DistanceField::from_mask(frame, |_| true);
        assert_eq!(grid_regions(&blocked, 0.2, 9, 0.3), [], "no free space");
    }

    #[test]
    fn no_regions_score_nothing() {
        let labels = labels();
        assert_eq!(score_regions(&[], &labels.frame, &labels), RegionScore::default());
    }
}
