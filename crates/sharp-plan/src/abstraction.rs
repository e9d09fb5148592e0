//! Lines 4 to 7 of Algorithm 1: from a map to states and options.

use std::sync::Arc;

use serde::{Deserialize, Serialize};
use sharp_drive::World;
use sharp_guide::OptionSpace;
use sharp_options::{AllowedRule, OptionFamily, OptionSet, OptionSettings};
use sharp_rbvd::{CellMetric, Rbvd, RbvdError, RbvdSettings, StateAbstraction};
use sharp_space::{Detection, Region, RegionDetector};

use crate::query::{Monitor, Phase};

/// Radius of endpoints for a car, in units of its goal tolerance: it has to round the corners of its plans in them.
const CAR_ENDPOINT_FACTOR: f64 = 2.0;

/// States and options of one map for one robot: Φ, Ψ and O.
#[derive(Clone, Debug)]
pub struct Abstraction {
    /// The abstract states, hence α.
    pub states: Arc<dyn StateAbstraction>,
    /// The options synthesised from them.
    pub options: Arc<OptionSet>,
}

impl Abstraction {
    /// The abstraction of `states` with the options of `family`.
    #[must_use]
    pub fn new(
        states: Arc<dyn StateAbstraction>,
        family: &dyn OptionFamily,
        settings: &OptionSettings,
    ) -> Self {
        let options = Arc::new(family.synthesize(&*states, settings));
        Self { states, options }
    }

    /// The space that guided options live in under `rule`.
    #[must_use]
    pub fn space(&self, rule: AllowedRule) -> OptionSpace {
        OptionSpace { states: Arc::clone(&self.states), options: Arc::clone(&self.options), rule }
    }
}

/// How an abstraction is built.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct AbstractionSettings {
    /// Which region counts as nearest to a cell.
    pub metric: CellMetric,
    /// How options are made.
    pub options: OptionSettings,
}

impl AbstractionSettings {
    /// The settings for the robot of `world`.
    #[must_use]
    pub fn new(world: &World) -> Self {
        let factor = if world.robot.can_turn_in_place() { 1.0 } else { CAR_ENDPOINT_FACTOR };
        let mut options = OptionSettings::default();
        options.endpoint_radius_m = factor * world.robot.goal_tolerance_m;
        Self { metric: CellMetric::default(), options }
    }

    /// The region-based Voronoi diagram of `regions` (line 6).
    ///
    /// # Errors
    /// If the map has no room for the robot.
    pub fn diagram(&self, world: &World, regions: &[Region]) -> Result<Rbvd, RbvdError> {
        let resolution_m = world.grid.frame().resolution_m;
        // Half a cell is what distances may be wrong by.
        let margin_m = 0.5 * resolution_m;
        let mut settings = RbvdSettings::for_footprint(&world.robot.footprint, margin_m, resolution_m);
        settings.metric = self.metric;
        Rbvd::build(world.geometry.clearance(), regions, &settings)
    }
}

/// Lines 5 to 7: critical regions Φ, the diagram Ψ, the options O. The detection is returned for pictures.
///
/// # Errors
/// If the map has no room for the robot.
pub fn construct(
    world: &World,
    detector: &dyn RegionDetector,
    family: &dyn OptionFamily,
    settings: &AbstractionSettings,
    monitor: &dyn Monitor,
) -> Result<(Abstraction, Detection), RbvdError> {
    monitor.phase(Phase::Regions);
    let detection = detector.detect(&world.grid, &world.robot.footprint);
    monitor.phase(Phase::Abstraction);
    let states = Arc::new(settings.diagram(world, &detection.regions)?);
    Ok((Abstraction::new(states, family, &settings.options), detection))
}
