//! Recipes: a generated map and its labels, from a kind of floor plan, a robot and a seed.

use serde::{Deserialize, Serialize};
use sharp_maps::{FloorplanKind, generate};
use sharp_space::{OccupancyGrid, Seed};

use crate::labels::{LabelRobot, LabelSettings, Labels, label_map};

/// Kinds of floor plans that training never sees: scores are measured on them.
pub const HELD_OUT_KINDS: [FloorplanKind; 3] =
    [FloorplanKind::CrossCorridors, FloorplanKind::Islands, FloorplanKind::BentCorridor];

/// Kinds that neither training nor scores see: settings are tuned on them.
pub const VALIDATION_KINDS: [FloorplanKind; 2] = [FloorplanKind::Gaps, FloorplanKind::RoomsAndClutter];

/// The version of recipes and of the files of samples.
pub(crate) const FORMAT: u32 = 1;

/// A map of a dataset, and everything its labels depend on.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Recipe {
    format: u32,
    pub(crate) kind: FloorplanKind,
    pub(crate) number: u64,
    pub(crate) size_m: f64,
    pub(crate) resolution_m: f64,
    half_length_m: f64,
    half_width_m: f64,
    radius_m: f64,
    labels: LabelSettings,
    pub(crate) seed: Seed,
}

impl Recipe {
    pub(crate) fn new(
        kind: FloorplanKind,
        number: u64,
        robot: &LabelRobot,
        labels: LabelSettings,
        seed: Seed,
    ) -> Self {
        Self {
            format: FORMAT,
            kind,
            number,
            size_m: 15.0,
            // 220 cells: no whole number of cells is a pixel, as with most real maps.
            resolution_m: 15.0 / 220.0,
            half_length_m: robot.footprint.half_length_m(),
            half_width_m: robot.footprint.half_width_m(),
            radius_m: robot.steering.radius_m(),
            labels,
            seed,
        }
    }

    /// The map, without its labels.
    pub(crate) fn map(&self) -> OccupancyGrid {
        let mut rng = self.seed.stream("floorplan", self.number);
        generate(self.kind, self.size_m, self.resolution_m, &mut rng)
    }

    /// The labels of `grid`, which is this recipe's map.
    pub(crate) fn label(&self, grid: &OccupancyGrid, robot: &LabelRobot) -> Labels {
        label_map(grid, robot, &self.labels, self.seed.child("labels", self.number))
    }
}
