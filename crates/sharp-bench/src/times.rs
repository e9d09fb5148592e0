//! What a result says of time and of reuse.

use serde::{Deserialize, Serialize};
use sharp_drive::EpisodeRecord;

/// How many of the options that a plan uses had been learnt before.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub struct Reuse {
    /// Options in the plan, each as often as it is used.
    pub uses: usize,
    /// Those whose policy existed before the problem began.
    pub reused: usize,
}

/// Wall time by phase, seconds.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct SolveTimes {
    /// Reading map and robot.
    pub load: f64,
    /// Finding critical regions.
    pub regions: f64,
    /// Building the diagram and the options.
    pub abstraction: f64,
    /// Searching for plans.
    pub search: f64,
    /// Planning guide paths.
    pub guide: f64,
    /// Learning or choosing policies.
    pub learn: f64,
    /// Estimating success.
    pub verify: f64,
    /// What one execution of a baseline plans before and while it drives.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub plan: f64,
    /// Simulating all executions; no part of the total of solving.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub drive: f64,
    /// All of solving.
    pub total: f64,
}

/// Serde asks with a reference.
fn is_zero(seconds: &f64) -> bool {
    *seconds == 0.0
}

/// Wall time of one decision, microseconds.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub struct DecisionTimes {
    /// Median.
    pub p50: f64,
    /// 99 % take no longer.
    pub p99: f64,
}

impl DecisionTimes {
    /// Those of all decisions in `records`; 0 if there were none.
    pub(crate) fn of<'a>(records: impl Iterator<Item = &'a EpisodeRecord>) -> Self {
        let mut times: Vec<f64> = records.flat_map(|record| record.decisions_us.iter().copied()).collect();
        times.sort_by(f64::total_cmp);
        let quantile = |share: f64| {
            let last = times.len().saturating_sub(1);
            times.get(((times.len() as f64 * share) as usize).min(last)).copied().unwrap_or(0.0)
        };
        Self { p50: quantile(0.5), p99: quantile(0.99) }
    }
}
