//! What solving, running and measuring report, as objects that serialise to JSON. Keys are a contract: once printed, a
//! key keeps its meaning.

use serde::{Deserialize, Serialize};
use sharp_drive::{EpisodeEnd, EpisodeRecord, SuccessCount};
use sharp_guide::Role;
use sharp_plan::{Execution, Plan, PlannedOption, Solution, Training, TrainingPoint};
use sharp_rl::StopReason;
use sharp_space::OccupancyGrid;

use crate::times::{DecisionTimes, Reuse, SolveTimes};

/// Which map it was.
#[derive(Clone, Debug, Serialize)]
pub struct MapReport {
    /// Its name.
    pub name: String,
    /// The hash of its cells.
    pub hash: String,
    /// Its width, metres.
    pub width_m: f64,
    /// Its height, metres.
    pub height_m: f64,
    /// The side of a cell, metres.
    pub resolution_m: f64,
}

impl MapReport {
    /// The map `grid` under the name `name`.
    #[must_use]
    pub fn new(name: &str, grid: &OccupancyGrid) -> Self {
        let frame = grid.frame();
        Self {
            name: name.to_owned(),
            hash: sharp_plan::map_hash(grid),
            width_m: frame.width_m(),
            height_m: frame.height_m(),
            resolution_m: frame.resolution_m,
        }
    }
}

/// A count of successes with the lower end of its interval.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Verified {
    /// Episodes.
    pub episodes: u32,
    /// Those that succeeded.
    pub successes: u32,
    /// The lower end of the two-sided 95 % interval of the share.
    pub lower95: f64,
}

impl From<SuccessCount> for Verified {
    fn from(count: SuccessCount) -> Self {
        Self { episodes: count.episodes, successes: count.successes, lower95: count.lower95() }
    }
}

/// How a policy was trained.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrainingReport {
    /// Why training ended: `rule` if an evaluation met its stop rule, `steps` if its budget was used up.
    pub stop: StopReason,
    /// Mean return of the policy that was kept, when it was evaluated.
    pub mean_return: f64,
    /// The evaluations on the way.
    pub evaluations: Vec<EvaluationReport>,
}

/// One evaluation in the course of a training.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct EvaluationReport {
    /// Environment steps of training before it.
    pub env_steps: u64,
    /// Mean return of its episodes.
    pub mean_return: f64,
    /// Share of its episodes that succeeded, by the training's own rule for contacts.
    pub success: f64,
    /// Share of as many others that succeeded where a contact is a failure.
    pub without_contact: f64,
}

/// How far the training of an option was when time was up.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct UnsolvedTraining {
    /// The option.
    pub option: String,
    /// Length of its guide, metres.
    pub length_m: f64,
    /// Environment steps so far.
    pub env_steps: u64,
    /// Why its training ended; `null` if it was under way.
    pub stop: Option<StopReason>,
    /// The evaluations so far.
    pub evaluations: Vec<EvaluationReport>,
}

impl From<&Training> for TrainingReport {
    fn from(training: &Training) -> Self {
        Self {
            stop: training.stop,
            mean_return: training.mean_return,
            evaluations: training.points.iter().map(EvaluationReport::from).collect(),
        }
    }
}

impl From<&TrainingPoint> for EvaluationReport {
    fn from(point: &TrainingPoint) -> Self {
        Self {
            env_steps: point.env_steps,
            mean_return: point.mean_return,
            success: point.success.rate(),
            without_contact: point.without_contact.rate(),
        }
    }
}

/// One use of an option in a plan.
#[derive(Clone, Debug, Serialize)]
pub struct OptionReport {
    /// Its id.
    pub option: String,
    /// The state it leaves.
    pub from: u32,
    /// The state it enters.
    pub to: u32,
    /// Its place in the plan.
    pub role: Role,
    /// Whether its policy existed before the problem began.
    pub reused: bool,
    /// The kind of its policy.
    pub policy: &'static str,
    /// Environment steps that its policy was learnt from.
    pub env_steps: u64,
    /// Gradient steps that its policy was learnt with.
    pub gradient_steps: u64,
    /// How its policy was trained, where it was.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub training: Option<TrainingReport>,
    /// On its own initiation set.
    pub verified: Verified,
    /// On the states in which the option before arrives.
    pub on_arrival: Verified,
    /// Length of its guide, metres.
    pub length_m: f64,
    /// Mean simulated time of a success when entered the way the option before arrives, seconds.
    pub time_s: Option<f64>,
    /// What the search counts: time per success, and the price of failures, seconds; null where it never succeeded and failures
    /// have no price.
    pub cost_s: Option<f64>,
    /// What the search took it to cost before it was measured, seconds.
    pub price_s: f64,
}

impl OptionReport {
    /// The options of `plan` in order.
    pub(crate) fn all(plan: &Plan) -> Vec<Self> {
        let steps = plan.solution.steps.iter().zip(plan.prices_s());
        steps.map(|(step, price_s)| Self::new(step, price_s, plan)).collect()
    }

    fn new(planned: &PlannedOption, price_s: f64, plan: &Plan) -> Self {
        let PlannedOption { option, learnt, reused, on_arrival, arrival_time_s } = planned;
        Self {
            option: option.id.to_string(),
            from: option.from.0,
            to: option.to.0,
            role: option.id.role(),
            reused: *reused,
            policy: learnt.policy.kind(),
            env_steps: learnt.env_steps,
            gradient_steps: learnt.gradient_steps,
            training: learnt.training.as_ref().map(TrainingReport::from),
            verified: learnt.estimate.count.into(),
            on_arrival: (*on_arrival).into(),
            length_m: option.guide.length_m(),
            time_s: arrival_time_s.is_finite().then_some(*arrival_time_s),
            cost_s: Some(learnt.cost_s(plan.method.failure_cost_s)).filter(|cost_s| cost_s.is_finite()),
            price_s,
        }
    }
}

/// What a plan says of itself.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct Predicted {
    /// What it was counted on: `runs` of the whole plan, or `composed` of what its parts are known to hold.
    pub basis: &'static str,
    /// How many runs; composed, as many as would tell as much.
    pub episodes: u32,
    /// Probability of success.
    pub success: f64,
    /// The lower end of its two-sided 95 % interval.
    pub lower95: f64,
    /// Mean simulated time of a success, seconds.
    pub sim_time_s: f64,
    /// Runs in which the robot may plan anew on the way, as `sharp run` does, where without that it arrives in less than
    /// 98 % of them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub with_recovery: Option<Verified>,
    /// Runs in which the robot may touch walls, which is no failure in the paper; only for methods that learn so.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub with_contact: Option<Verified>,
}

impl Predicted {
    fn of(solution: &Solution) -> Self {
        let Solution { predicted, predicted_time_s, composed, .. } = solution;
        let (success, lower95) = match composed {
            Some(odds) => (odds.success, odds.lower95),
            None => (predicted.rate(), predicted.lower95()),
        };
        Self {
            basis: if composed.is_some() { "composed" } else { "runs" },
            episodes: predicted.episodes,
            success,
            lower95,
            sim_time_s: *predicted_time_s,
            with_recovery: None,
            with_contact: None,
        }
    }
}

/// One of several goals in a row.
#[derive(Clone, Debug, Serialize)]
pub struct GoalReport {
    /// Where it is, metres.
    pub goal: [f64; 2],
    /// The success that the plan from the goal before predicts by itself.
    pub success: f64,
    /// How many options of the whole plan lead to it.
    pub legs: usize,
}

/// `sharp.solve/1`: what solving one problem gave.
#[derive(Clone, Debug, Serialize)]
pub struct SolveReport {
    /// The name and version of the format.
    pub schema: &'static str,
    /// `solved`, `no_plan`, `timeout`, or `below_min_success` beside a plan.
    pub status: &'static str,
    /// Why it is not `solved`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub reason: Option<String>,
    /// The name of the robot.
    pub robot: String,
    /// The kind of option.
    pub options: &'static str,
    /// The name of the method.
    pub learning: String,
    /// `on` if measured costs flowed back into the search, else `off`.
    pub cost_update: &'static str,
    /// The name of the noise.
    pub noise: String,
    /// Where policies were learnt and the plan was verified.
    pub simulator: String,
    /// Root of all randomness.
    pub seed: u64,
    /// The folder of the library, or `none`.
    pub library: String,
    /// The map.
    pub map: MapReport,
    /// Where critical regions came from.
    pub regions: String,
    /// Number of abstract states.
    pub states: usize,
    /// Number of options between them.
    pub options_available: usize,
    /// The goals in a row, where there are several.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub goals: Vec<GoalReport>,
    /// The options of the plan in order.
    pub plan: Vec<OptionReport>,
    /// The trainings until time was up, where it was up before there was a plan.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub trainings: Vec<UnsolvedTraining>,
    /// How many of them had been learnt before.
    pub reuse: Reuse,
    /// What the plan says of itself.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub predicted: Option<Predicted>,
    /// Wall time by phase.
    pub time_s: SolveTimes,
    /// The folder of the plan.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plan_dir: Option<String>,
}

impl SolveReport {
    /// The same with what `plan` says.
    pub(crate) fn with_plan(self, plan: &Plan) -> Self {
        let solution = &plan.solution;
        let (uses, reused) = solution.reuse();
        Self {
            status: "solved",
            plan: OptionReport::all(plan),
            reuse: Reuse { uses, reused },
            predicted: Some(Predicted::of(solution)),
            ..self
        }
    }
}

/// `sharp.run/1`: how often a plan succeeded.
#[derive(Clone, Debug, Serialize)]
pub struct RunReport {
    /// The name and version of the format.
    pub schema: &'static str,
    /// Executions.
    pub episodes: u32,
    /// Executions that reached the goal.
    pub successes: u32,
    /// Their share.
    pub success_rate: f64,
    /// The lower end of the two-sided 95 % interval of the share.
    pub lower95: f64,
    /// Its upper end.
    pub upper95: f64,
    /// Contacts of all executions.
    pub collisions: u32,
    /// Executions that ran out of time or lost their way.
    pub timeouts: u32,
    /// Actions outside the states that their option may use, of all executions.
    pub strays: u32,
    /// New plans on the way, of all executions.
    pub recoveries: u32,
    /// Mean simulated time of the executions that reached the goal, seconds; 0 if none did.
    pub mean_sim_time_s: f64,
    /// Mean way driven of the executions that reached the goal, metres; 0 if none did.
    pub mean_path_m: f64,
    /// The success that the plan predicts.
    pub predicted_success: f64,
    /// Wall time of a decision.
    pub decision_us: DecisionTimes,
}

impl RunReport {
    /// Counts `executions` of `plan`.
    #[must_use]
    pub fn new(plan: &Plan, executions: &[Execution]) -> Self {
        Self::predicted(plan.solution.success(), executions)
    }

    /// Counts `executions` of what was predicted to have this chance of `success`.
    #[must_use]
    pub fn predicted(success: f64, executions: &[Execution]) -> Self {
        let count = sharp_plan::success(executions);
        let ended = |end: EpisodeEnd| executions.iter().filter(|run| run.end == end).count() as u32;
        let sum = |of: fn(&Execution) -> u32| executions.iter().map(of).sum();
        let runs = || executions.iter().map(|run| (run.end, &run.record));
        Self {
            schema: "sharp.run/1",
            episodes: count.episodes,
            successes: count.successes,
            success_rate: count.rate(),
            lower95: count.lower95(),
            upper95: count.upper95(),
            collisions: sum(|run| run.record.contacts),
            timeouts: ended(EpisodeEnd::TimedOut) + ended(EpisodeEnd::Lost),
            strays: sum(|run| run.events.strays),
            recoveries: sum(|run| run.events.recoveries),
            mean_sim_time_s: mean_of_successes(runs(), |record| record.time_s),
            mean_path_m: mean_of_successes(runs(), |record| record.path_m),
            predicted_success: success,
            decision_us: DecisionTimes::of(runs().map(|(_, record)| record)),
        }
    }
}

/// Mean of `value` over the episodes that reached the goal, 0 if none did.
pub(crate) fn mean_of_successes<'a>(
    episodes: impl Iterator<Item = (EpisodeEnd, &'a EpisodeRecord)>,
    value: fn(&EpisodeRecord) -> f64,
) -> f64 {
    let values = episodes.filter(|(end, _)| *end == EpisodeEnd::Reached).map(|(_, record)| value(record));
    let (sum, count) = values.fold((0.0, 0_u32), |(sum, count), value| (sum + value, count + 1));
    sum / f64::from(count.max(1))
}

/// Wall time of a baseline by phase, seconds. `plan` and `learn` are what one execution needs before and while it
/// drives; `drive` is what simulating all of them took, their planning included.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct BaselineTimes {
    /// Reading map and robot.
    pub load: f64,
    /// Planning of one execution.
    pub plan: f64,
    /// Learning.
    pub learn: f64,
    /// Simulating all executions.
    pub drive: f64,
    /// Everything.
    pub total: f64,
}

/// `sharp.baseline/1`: how often a baseline succeeded.
#[derive(Clone, Debug, Serialize)]
pub struct BaselineReport {
    /// The name and version of the format.
    pub schema: &'static str,
    /// The name of the baseline.
    pub method: &'static str,
    /// `driven`, `no_plan` if no path leads to the goal, or `timeout` if it was stopped before the last execution.
    pub status: &'static str,
    /// The name of the robot.
    pub robot: String,
    /// The name of the noise.
    pub noise: String,
    /// The simulator that it drove in.
    pub simulator: String,
    /// Root of all randomness.
    pub seed: u64,
    /// The map.
    pub map: MapReport,
    /// Executions that came to an end: with the status `timeout` fewer than were asked for.
    pub episodes: u32,
    /// Executions that reached the goal.
    pub successes: u32,
    /// Their share.
    pub success_rate: f64,
    /// The lower end of the two-sided 95 % interval of the share.
    pub lower95: f64,
    /// Its upper end.
    pub upper95: f64,
    /// Contacts of all executions.
    pub collisions: u32,
    /// Executions that ran out of time or gave up.
    pub timeouts: u32,
    /// Always 0: a baseline has no states that it may leave.
    pub strays: u32,
    /// New plans on the way, of all executions.
    pub recoveries: u32,
    /// Mean simulated time of the executions that reached the goal, seconds; 0 if none did.
    pub mean_sim_time_s: f64,
    /// Mean way driven of the executions that reached the goal, metres; 0 if none did.
    pub mean_path_m: f64,
    /// Environment steps that it learnt from.
    pub env_steps: u64,
    /// Gradient steps that it learnt with.
    pub gradient_steps: u64,
    /// Wall time of a decision.
    pub decision_us: DecisionTimes,
    /// Wall time by phase.
    pub time_s: BaselineTimes,
}
