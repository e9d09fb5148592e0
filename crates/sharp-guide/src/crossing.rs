//! The direction in which an option crosses an interface.

use sharp_options::Endpoint;
use sharp_rbvd::StateId;
use sharp_space::{Heading, RobotGeometry};

/// Samples before and behind an interface that tell in which direction it has most clearance: 0.8 m.
const SAMPLES: i32 = 8;
const SAMPLE_M: f64 = 0.1;
/// Turns from the normal that are tried to either side, and the step between them: 60 degrees in all.
const TURNS: i32 = 12;
const TURN_RAD: f64 = std::f64::consts::PI / 36.0;
/// Clearance beyond the outline's circle of which more makes no difference, metres.
const CLEARANCE_ENOUGH_M: f64 = 0.25;
/// Clearance that keeping to the normal is worth, metres a radian.
const NORMAL_M_PER_RAD: f64 = 0.1;

/// The direction in which `endpoint` is crossed into the state `into`: the one with most clearance before and
/// behind, or the border's normal where all have enough. A centroid has none.
#[must_use]
pub fn crossing_heading(geometry: &dyn RobotGeometry, endpoint: &Endpoint, into: StateId) -> Option<Heading> {
    let normal_rad = endpoint.normal?.radians();
    let towards = if endpoint.states.last() == Some(&into) { 0.0 } else { std::f64::consts::PI };
    let field = geometry.clearance();
    let enough_m = geometry.footprint().circumscribed_radius_m() + CLEARANCE_ENOUGH_M;
    let worth = |turn_rad: f64| {
        let unit = Heading::new(normal_rad + turn_rad).unit();
        let along = (-SAMPLES..=SAMPLES).map(|sample| SAMPLE_M * f64::from(sample));
        let clearance_m = along.map(|ahead_m| field.sample(endpoint.center + unit * ahead_m));
        clearance_m.fold(enough_m, f64::min) - NORMAL_M_PER_RAD * turn_rad.abs()
    };
    let turns_rad = (0..=2 * TURNS).map(|i| f64::from(i - TURNS) * TURN_RAD);
    let best_rad = turns_rad.max_by(|&a, &b| worth(a).total_cmp(&worth(b)))?;
    Some(Heading::new(normal_rad + best_rad + towards))
}
