//! Repairing a plan: weak options choose and learn again, from the states in which they are entered.

use std::collections::BTreeSet;
use std::sync::Arc;

use rayon::prelude::*;
use sharp_drive::{ChainRun, Driver, SuccessCount};
use sharp_guide::{GuidedOption, LegId};
use sharp_sim::RobotState;

use crate::files::FileError;
use crate::learn::{LearningTask, LearntPolicy, initial_states, task};
use crate::policies::Policies;
use crate::problem::PlanningProblem;
use crate::query::OptionMonitor;
use crate::search::Search;
use crate::verify::{drivers, of_option, of_plan, run_chain};

/// An option that was entered less often than this in the runs of a plan has shown nothing.
pub(crate) const ENTERED_MIN: u32 = 50;
/// Way after a repaired option by which its arrivals are judged, metres.
const TAIL_M: f64 = 4.0;
/// Names the random stream of the runs that repairs are judged by.
const REPAIR: &str = "repair";
/// Gain below which a repaired policy counts as no better, share of episodes: chance explains less.
const GAIN_MIN: f64 = 0.003;

/// A plan under repair, and where its options came from.
pub(crate) struct Repair<'a> {
    pub(crate) problem: &'a PlanningProblem<'a>,
    pub(crate) plan: &'a [Arc<GuidedOption>],
    pub(crate) search: &'a Search<'a>,
}

/// Makes a plan succeed more often until it succeeds as wanted or nothing helps. Every change is tried on the same
/// runs, and taken back if they say so. Returns false if it was stopped.
pub(crate) fn repair(repair: &Repair<'_>, policies: &mut Policies<'_>) -> Result<bool, FileError> {
    let settings = repair.problem.method.repair;
    if settings.rounds == 0 {
        return Ok(true);
    }
    let mut runs = run_plan(repair, policies);
    let mut tried = BTreeSet::new();
    for round in 0..settings.rounds {
        if repair.problem.monitor.should_stop() {
            return Ok(false);
        }
        if of_plan(&runs).count.rate() >= settings.wanted_success {
            break;
        }
        let before: Vec<LearntPolicy> =
            repair.plan.iter().map(|option| policies.learnt(option.id).clone()).collect();
        let is_better = relearn_weak(repair, policies, &runs, (u64::from(round), &mut tried))?;
        if repair.problem.monitor.should_stop() {
            return Ok(false);
        }
        if !is_better {
            break;
        }
        let anew = run_plan(repair, policies);
        if cost_s(repair, &anew) >= cost_s(repair, &runs) {
            for (option, learnt) in repair.plan.iter().zip(before) {
                keep(repair, policies, option, learnt)?;
            }
            break;
        }
        runs = anew;
    }
    Ok(true)
}

/// What a plan costs that ran like `runs`, seconds.
fn cost_s(repair: &Repair<'_>, runs: &[ChainRun]) -> f64 {
    of_plan(runs).cost_s(repair.problem.method.failure_cost_s)
}

/// The runs that repairs are judged by: always the same episodes.
fn run_plan(repair: &Repair<'_>, policies: &Policies<'_>) -> Vec<ChainRun> {
    let episodes = repair.problem.method.repair.episodes;
    run_chain(repair.problem, &drivers(repair.plan, policies), episodes, REPAIR)
}

fn keep(
    repair: &Repair<'_>,
    policies: &mut Policies<'_>,
    option: &GuidedOption,
    learnt: LearntPolicy,
) -> Result<(), FileError> {
    let alone = repair.search.option(option.id).unwrap_or(option);
    policies.keep(alone, learnt, &repair.problem.world.grid)
}

/// Learns the weak options again on the states in which they were entered in `runs`; those that were `tried` before are not
/// trained once more. Returns false if no option became better.
fn relearn_weak(
    repair: &Repair<'_>,
    policies: &mut Policies<'_>,
    runs: &[ChainRun],
    (round, tried): (u64, &mut BTreeSet<LegId>),
) -> Result<bool, FileError> {
    let plan = repair.plan;
    // n options that each fail at most a share (1 - wanted) / n make a plan that succeeds as wanted.
    let wanted = 1.0 - (1.0 - repair.problem.method.repair.wanted_success) / plan.len() as f64;
    let on_arrival: Vec<SuccessCount> = (0..plan.len()).map(|index| of_option(runs, index).count).collect();
    // A single failure is chance: an option is weak if what is wanted lies above its 95 % interval.
    let is_weak = |count: &SuccessCount| count.episodes >= ENTERED_MIN && count.upper95() < wanted;
    // An option that arrives badly is as much to blame as the one that cannot cope with it.
    let is_to_blame =
        |index: usize| is_weak(&on_arrival[index]) || on_arrival.get(index + 1).is_some_and(is_weak);
    let weak: Vec<usize> = (0..plan.len()).filter(|&index| is_to_blame(index)).collect();
    let shared = &*policies;
    let relearn = |&index: &usize| {
        let is_new = !tried.contains(&plan[index].id);
        let weak = Weak { index, on_arrival: on_arrival[index], wanted, round, is_new };
        relearn(repair, shared, runs, &weak)
    };
    let results: Vec<_> = weak.par_iter().map(relearn).collect();
    tried.extend(weak.iter().map(|&index| plan[index].id));
    let mut better = false;
    for (index, learnt) in weak.into_iter().zip(results) {
        if let Some(learnt) = learnt {
            better = true;
            repair.problem.monitor.learnt(&plan[index], &learnt);
            keep(repair, policies, &plan[index], learnt)?;
        }
    }
    Ok(better)
}

/// An option that succeeds too rarely.
struct Weak {
    index: usize,
    on_arrival: SuccessCount,
    wanted: f64,
    round: u64,
    /// Not tried in an earlier round.
    is_new: bool,
}

/// A policy for a weak option that succeeds more often than its present one on what `runs` arrived with.
fn relearn(
    repair: &Repair<'_>,
    policies: &Policies<'_>,
    runs: &[ChainRun],
    weak: &Weak,
) -> Option<LearntPolicy> {
    let Repair { problem, plan, .. } = *repair;
    let Weak { index, on_arrival, wanted, round, is_new } = *weak;
    let (option, learner) = (&plan[index], &problem.method.learner);
    let seed = problem.seed.child(&format!("repair {}", option.id), round);
    let states = initial_states(problem, option, seed).with_arrivals(entries(runs, index));
    let drivers = drivers(plan, policies);
    let tail = tail(&drivers[index + 1..]);
    let next = plan.get(index + 1);
    let task = LearningTask {
        next,
        tail: &tail,
        wanted_success: wanted,
        estimate_episodes: problem.method.repair.judge_episodes,
        ..task(problem, option, states, seed)
    };
    let old = policies.learnt(option.id);
    let SuccessCount { episodes, successes } = task.judge(&old.policy).count;
    let failures_allowed = (1.0 - wanted) * f64::from(episodes);
    if f64::from(episodes - successes) <= failures_allowed {
        return None;
    }
    let gain = (GAIN_MIN * f64::from(episodes)).ceil() as u32;
    let beaten = SuccessCount { episodes, successes: (successes + gain).min(episodes) - 1 };
    // Training is for options that are weak themselves, and once only; how a tight start is left is not learnt.
    let may_train = is_new
        && old.gradient_steps == 0
        && option.departure.is_none()
        && on_arrival.rate() < learner.train_below();
    let monitor = OptionMonitor { monitor: problem.monitor, option, file: None };
    let new = learner.improve(&task, beaten, may_train, &monitor).ok()??;
    let (env_steps, gradient_steps) =
        (new.env_steps + old.env_steps, new.gradient_steps + old.gradient_steps);
    Some(LearntPolicy { env_steps, gradient_steps, ..new })
}

/// The beginning of `drivers`, as far as how they were entered can matter.
fn tail<'a>(drivers: &[Driver<'a>]) -> Vec<Driver<'a>> {
    let mut left_m = TAIL_M;
    let mut tail = Vec::new();
    for driver in drivers {
        if left_m <= 0.0 {
            break;
        }
        let mut driver = driver.clone();
        driver.link.until_m = left_m;
        left_m -= driver.link.option.guide.length_m();
        tail.push(driver);
    }
    tail
}

/// The states in which option number `index` was entered.
fn entries(runs: &[ChainRun], index: usize) -> Vec<RobotState> {
    runs.iter().filter_map(|run| run.visits.get(index).map(|visit| visit.entry)).collect()
}
