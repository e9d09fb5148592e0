//! The legs of a plan as plain data.

use serde::Serialize;
use sharp_guide::Role;
use sharp_plan::PlannedOption;

/// A step of a plan.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(crate) struct Leg {
    option: String,
    role: Role,
    policy: &'static str,
    length_m: f64,
    /// Mean time of a success on arrival, seconds; left out without any.
    #[serde(skip_serializing_if = "Option::is_none")]
    time_s: Option<f64>,
    /// Share of successes when it is entered the way the leg before it arrives.
    success: f64,
    episodes: u32,
}

/// What is known of `step`.
pub(crate) fn leg(step: &PlannedOption) -> Leg {
    Leg {
        option: step.option.id.to_string(),
        role: step.option.id.role(),
        policy: step.learnt.policy.kind(),
        length_m: step.option.guide.length_m(),
        time_s: Some(step.arrival_time_s).filter(|seconds| seconds.is_finite()),
        success: step.on_arrival.rate(),
        episodes: step.on_arrival.episodes,
    }
}
