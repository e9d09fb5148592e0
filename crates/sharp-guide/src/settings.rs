//! Settings of the guide planners.

use serde::{Deserialize, Serialize};
use sharp_motion::{Budget, RrtSettings};

/// Which planner plans the guide path.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PlannerKind {
    /// [`ClearanceSearch`](crate::ClearanceSearch).
    #[default]
    ClearanceSearch,
    /// [`LearnAndLink`](crate::LearnAndLink), as in the paper.
    LearnAndLink,
}

/// How guides are planned.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct GuideSettings {
    /// The threshold t of Definition 8, metres.
    pub spacing_m: f64,
    /// Which planner.
    pub planner: PlannerKind,
    /// Plan for a robot with a safety margin first; false asks for no more than the robot needs.
    pub margins: bool,
    /// How much more a metre with no room to spare costs than a metre with comfortable room.
    pub clearance_weight: f64,
    /// Room beyond the circumscribed radius that is comfortable, metres.
    pub comfort_m: f64,
    /// Room beyond the inscribed radius that every cell of the path has, metres.
    pub margin_m: f64,
    /// Curvature (1/m) at which the path comes to rest per metre of comfortable room that it lacks.
    pub pull_per_m2: f64,
    /// The length over which the path resists bending, metres: shorter kinks are ironed out.
    pub stiffness_m: f64,
    /// A robot whose heading is further off the path's than this is led onto it by a curve of its
    /// own, radians; one that can turn in place there just turns.
    pub start_turn_rad: f64,
    /// Budget and steps of the sampling planner; files do not keep it.
    #[serde(skip)]
    pub sampling: RrtSettings,
    /// Seeds of Learn and Link: places with more clearance than their surroundings.
    pub seeds: usize,
}

impl GuideSettings {
    /// The same without the sampling planner.
    #[must_use]
    pub fn unsampled(self) -> Self {
        let sampling = RrtSettings { budget: Budget { iterations: 0 }, ..self.sampling };
        Self { sampling, seeds: 0, ..self }
    }
}

impl Default for GuideSettings {
    fn default() -> Self {
        Self {
            spacing_m: 0.25,
            planner: PlannerKind::ClearanceSearch,
            margins: true,
            clearance_weight: 8.0,
            comfort_m: 0.25,
            // Half a cell: what the grid's distances may be wrong by.
            margin_m: 0.03,
            pull_per_m2: 12.0,
            stiffness_m: 0.6,
            start_turn_rad: 30.0_f64.to_radians(),
            sampling: RrtSettings { budget: Budget { iterations: 3_000 }, ..RrtSettings::default() },
            seeds: 24,
        }
    }
}
