//! The objects that `--json` prints. Keys are a contract: once printed, a key keeps its meaning.

use serde::Serialize;
use sharp_bench::{DecisionTimes, Reuse, SolveTimes};
use sharp_drive::{EpisodeEnd, SuccessCount};
use sharp_guide::Role;
use sharp_plan::{Execution, Plan, PlannedOption};
use sharp_space::{GridFrame, OccupancyGrid};

use crate::progress::Stopwatch;

#[derive(Debug, Serialize)]
pub(crate) struct MapReport {
    pub(crate) name: String,
    pub(crate) hash: String,
    pub(crate) width_m: f64,
    pub(crate) height_m: f64,
    pub(crate) resolution_m: f64,
}

impl MapReport {
    pub(crate) fn new(name: &str, grid: &OccupancyGrid) -> Self {
        let frame: &GridFrame = grid.frame();
        Self {
            name: name.to_owned(),
            hash: sharp_plan::map_hash(grid),
            width_m: frame.width_m(),
            height_m: frame.height_m(),
            resolution_m: frame.resolution_m,
        }
    }
}

/// A tally with the lower end of its interval.
#[derive(Debug, Serialize)]
pub(crate) struct Verified {
    pub(crate) episodes: u32,
    pub(crate) successes: u32,
    pub(crate) lower95: f64,
}

impl From<SuccessCount> for Verified {
    fn from(tally: SuccessCount) -> Self {
        Self { episodes: tally.episodes, successes: tally.successes, lower95: tally.lower95() }
    }
}

#[derive(Debug, Serialize)]
pub(crate) struct LegReport {
    pub(crate) option: String,
    pub(crate) from: u32,
    pub(crate) to: u32,
    pub(crate) role: Role,
    pub(crate) reused: bool,
    pub(crate) policy: &'static str,
    pub(crate) env_steps: u64,
    pub(crate) gradient_steps: u64,
    pub(crate) verified: Verified,
    /// On the states in which the leg before arrives.
    pub(crate) on_arrival: Verified,
    pub(crate) length_m: f64,
    /// Mean simulated time of a success when entered the way the option before arrives, seconds.
    pub(crate) time_s: Option<f64>,
    /// What the search counts: time per success, and the price of failures, seconds.
    pub(crate) cost_s: f64,
}

impl LegReport {
    fn new(planned: &PlannedOption, failure_cost_s: f64) -> Self {
        let PlannedOption { option: leg, learnt, reused, on_arrival, arrival_time_s } = planned;
        Self {
            option: leg.id.to_string(),
            from: leg.from.0,
            to: leg.to.0,
            role: leg.id.role(),
            reused: *reused,
            policy: learnt.policy.kind(),
            env_steps: learnt.env_steps,
            gradient_steps: learnt.gradient_steps,
            verified: learnt.estimate.count.into(),
            on_arrival: (*on_arrival).into(),
            length_m: leg.guide.length_m(),
            time_s: arrival_time_s.is_finite().then_some(*arrival_time_s),
            cost_s: learnt.cost_s(failure_cost_s),
        }
    }
}

#[derive(Debug, Serialize)]
pub(crate) struct Predicted {
    pub(crate) success: f64,
    pub(crate) lower95: f64,
    pub(crate) sim_time_s: f64,
}

impl From<&Stopwatch> for SolveTimes {
    fn from(watch: &Stopwatch) -> Self {
        Self {
            load: watch.spent_s("load"),
            regions: watch.spent_s("regions"),
            abstraction: watch.spent_s("abstraction"),
            search: watch.spent_s("search"),
            guide: watch.spent_s("guide"),
            learn: watch.spent_s("learn"),
            verify: watch.spent_s("verify"),
            plan: watch.spent_s("plan"),
            drive: watch.spent_s("drive"),
            total: watch.total_s(),
        }
    }
}

/// `sharp.solve/1`.
#[derive(Debug, Serialize)]
pub(crate) struct SolveReport {
    pub(crate) schema: &'static str,
    pub(crate) status: &'static str,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) reason: Option<String>,
    pub(crate) robot: String,
    pub(crate) options: &'static str,
    pub(crate) learning: &'static str,
    pub(crate) cost_update: &'static str,
    pub(crate) noise: String,
    /// Where policies were learnt and the plan was verified.
    pub(crate) simulator: String,
    pub(crate) seed: u64,
    /// The folder of the library, or "none".
    pub(crate) library: String,
    pub(crate) map: MapReport,
    pub(crate) regions: String,
    pub(crate) states: usize,
    pub(crate) options_available: usize,
    pub(crate) plan: Vec<LegReport>,
    pub(crate) reuse: Reuse,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) predicted: Option<Predicted>,
    pub(crate) time_s: SolveTimes,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(crate) plan_dir: Option<String>,
}

impl SolveReport {
    /// Fills in what a solved plan says.
    pub(crate) fn with_plan(mut self, plan: &Plan, plan_dir: &std::path::Path) -> Self {
        let solution = &plan.solution;
        let (uses, reused) = solution.reuse();
        self.status = "solved";
        self.plan =
            solution.steps.iter().map(|step| LegReport::new(step, plan.method.failure_cost_s)).collect();
        self.reuse = Reuse { uses, reused };
        self.predicted = Some(Predicted {
            success: solution.predicted.rate(),
            lower95: solution.predicted.lower95(),
            sim_time_s: solution.predicted_time_s,
        });
        self.plan_dir = Some(plan_dir.display().to_string());
        self
    }
}

/// `sharp.run/1`.
#[derive(Debug, Serialize)]
pub(crate) struct RunReport {
    pub(crate) schema: &'static str,
    pub(crate) episodes: u32,
    pub(crate) successes: u32,
    pub(crate) success_rate: f64,
    pub(crate) lower95: f64,
    pub(crate) upper95: f64,
    pub(crate) collisions: u32,
    pub(crate) timeouts: u32,
    pub(crate) strays: u32,
    pub(crate) recoveries: u32,
    pub(crate) mean_sim_time_s: f64,
    pub(crate) mean_path_m: f64,
    pub(crate) predicted_success: f64,
    pub(crate) decision_us: DecisionTimes,
}

impl RunReport {
    pub(crate) fn new(plan: &Plan, episodes: &[Execution]) -> Self {
        let tally = sharp_plan::success(episodes);
        let count = |end: EpisodeEnd| episodes.iter().filter(|episode| episode.end == end).count() as u32;
        let sum = |of: fn(&Execution) -> u32| episodes.iter().map(of).sum();
        let reached: Vec<&Execution> =
            episodes.iter().filter(|episode| episode.end == EpisodeEnd::Reached).collect();
        let mean = |of: fn(&Execution) -> f64| {
            reached.iter().map(|episode| of(episode)).sum::<f64>() / reached.len().max(1) as f64
        };
        let mut decisions: Vec<f64> =
            episodes.iter().flat_map(|episode| episode.record.decisions_us.iter().copied()).collect();
        decisions.sort_by(f64::total_cmp);
        let quantile = |q: f64| {
            decisions
                .get(((decisions.len() as f64 * q) as usize).min(decisions.len().saturating_sub(1)))
                .copied()
                .unwrap_or(0.0)
        };
        Self {
            schema: "sharp.run/1",
            episodes: tally.episodes,
            successes: tally.successes,
            success_rate: tally.rate(),
            lower95: tally.lower95(),
            upper95: tally.upper95(),
            collisions: sum(|episode| episode.record.contacts),
            timeouts: count(EpisodeEnd::TimedOut) + count(EpisodeEnd::Lost),
            strays: sum(|episode| episode.events.strays),
            recoveries: sum(|episode| episode.events.recoveries),
            mean_sim_time_s: mean(|episode| episode.record.time_s),
            mean_path_m: mean(|episode| episode.record.path_m),
            predicted_success: plan.solution.predicted.rate(),
            decision_us: DecisionTimes { p50: quantile(0.5), p99: quantile(0.99) },
        }
    }
}

/// `sharp.abstract/1`.
#[derive(Debug, Serialize)]
pub(crate) struct AbstractReport {
    pub(crate) schema: &'static str,
    pub(crate) map: MapReport,
    pub(crate) robot: String,
    pub(crate) regions: String,
    pub(crate) states: usize,
    pub(crate) neighbors: usize,
    pub(crate) options_centroid: usize,
    pub(crate) options_interface: usize,
    pub(crate) covered: f64,
    pub(crate) components: usize,
    pub(crate) time_s: SolveTimes,
}
