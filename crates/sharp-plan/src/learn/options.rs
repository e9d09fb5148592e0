//! Lines 11 and 13 to 19 of Algorithm 1: what a plan lacks is taken from the library or learnt.

use std::sync::Arc;

use rayon::prelude::*;
use sharp_drive::{Driver, InitialStates, SuccessCount, SuccessEstimate};
use sharp_guide::{GuidedOption, Role};
use sharp_sim::RobotState;
use sharp_space::Seed;

use super::{LearnFailure, LearningTask, LearntPolicy};
use crate::files::FileError;
use crate::method::LearningOrder;
use crate::policies::Policies;
use crate::problem::PlanningProblem;
use crate::query::{OptionMonitor, Phase};
use crate::search::Search;

/// Runs that show how an option arrives.
const ARRIVALS: usize = 64;
/// Initial states kept of each option.
const STATE_POOL: usize = 128;

/// Learns the policies of `plan` that neither the library nor an earlier attempt has (lines 11, 14 to 16, 19).
/// Returns false if it was stopped.
pub(crate) fn learn_missing(
    problem: &PlanningProblem<'_>,
    plan: &[Arc<GuidedOption>],
    search: &Search<'_>,
    policies: &mut Policies<'_>,
) -> Result<bool, FileError> {
    for option in plan {
        policies.adopt(search.option(option.id).unwrap_or(option), &problem.world.grid)?;
    }
    let is_composed = problem.method.verify_episodes == 0;
    if is_composed {
        take_at_hand(problem, plan, search, policies)?;
    }
    let missing: Vec<&Arc<GuidedOption>> =
        plan.iter().filter(|option| policies.get(option.id).is_none()).collect();
    problem.monitor.phase(Phase::Learn(missing.len()));
    if missing.is_empty() {
        return Ok(true);
    }
    match problem.method.order {
        // Without runs of the whole plan nobody learns from where it arrives.
        LearningOrder::Chained if is_composed => learn_independent(problem, &missing, search, policies),
        LearningOrder::Chained => learn_chained(problem, plan, search, policies),
        LearningOrder::Independent => learn_independent(problem, &missing, search, policies),
    }
}

/// Gives the first and the last leg of `plan` what drives them without an episode, where the learner has it.
fn take_at_hand(
    problem: &PlanningProblem<'_>,
    plan: &[Arc<GuidedOption>],
    search: &Search<'_>,
    policies: &mut Policies<'_>,
) -> Result<(), FileError> {
    for option in plan.iter().filter(|option| option.id.role() != Role::Option) {
        if policies.get(option.id).is_some() {
            continue;
        }
        let seed = option_seed(problem, option);
        let states = InitialStates::exactly(RobotState::at_rest(option.guide.start()));
        if let Some(policy) = problem.method.learner.at_hand(&task(problem, option, states, seed)) {
            let estimate = SuccessEstimate { count: SuccessCount::default(), mean_time_s: f64::INFINITY };
            let learnt = LearntPolicy::untrained(policy, estimate);
            policies.keep(search.option(option.id).unwrap_or(option), learnt, &problem.world.grid)?;
        }
    }
    Ok(())
}

/// One option after the other, each from where the one before it arrives and with the next in view.
fn learn_chained(
    problem: &PlanningProblem<'_>,
    plan: &[Arc<GuidedOption>],
    search: &Search<'_>,
    policies: &mut Policies<'_>,
) -> Result<bool, FileError> {
    let mut arrivals = vec![RobotState::at_rest(problem.query.start); ARRIVALS];
    for (index, option) in plan.iter().enumerate() {
        let (next, seed) = (plan.get(index + 1), option_seed(problem, option));
        if policies.get(option.id).is_none() {
            let states = initial_states(problem, option, seed).with_arrivals(arrivals.clone());
            let task = LearningTask { next, ..task(problem, option, states, seed) };
            let monitor = OptionMonitor { monitor: problem.monitor, option };
            let result = problem.method.learner.learn(&task, &monitor);
            if !take(problem, option, result, search, policies)? {
                return Ok(false);
            }
        }
        let driver = Driver::new(option, &policies.learnt(option.id).policy, next);
        let trial = problem.conditions.monte_carlo(problem.world).with_seed(seed);
        arrivals = trial.arrivals(&driver, &arrivals);
    }
    Ok(true)
}

/// Each option on its own and all at once: the paper's way.
fn learn_independent(
    problem: &PlanningProblem<'_>,
    missing: &[&Arc<GuidedOption>],
    search: &Search<'_>,
    policies: &mut Policies<'_>,
) -> Result<bool, FileError> {
    let learn = |option: &&Arc<GuidedOption>| {
        let seed = option_seed(problem, option);
        let task = task(problem, option, initial_states(problem, option, seed), seed);
        let monitor = OptionMonitor { monitor: problem.monitor, option };
        problem.method.learner.learn(&task, &monitor)
    };
    let results: Vec<_> = missing.par_iter().map(learn).collect();
    let mut finished = true;
    for (option, result) in missing.iter().zip(results) {
        finished &= take(problem, option, result, search, policies)?;
    }
    Ok(finished)
}

/// Keeps what was learnt of `option`; false if learning was stopped.
fn take(
    problem: &PlanningProblem<'_>,
    option: &Arc<GuidedOption>,
    result: Result<LearntPolicy, LearnFailure>,
    search: &Search<'_>,
    policies: &mut Policies<'_>,
) -> Result<bool, FileError> {
    let learnt = match result {
        Ok(learnt) => learnt,
        Err(LearnFailure::Stopped) => return Ok(false),
        // A broken task cannot be learnt: its edge goes, the search goes on.
        Err(LearnFailure::Broken(_)) => LearntPolicy::useless(&problem.world.robot),
    };
    problem.monitor.learnt(option, &learnt);
    // The option of a plan may have been joined to its neighbours; the library keeps it as it is alone.
    policies.keep(search.option(option.id).unwrap_or(option), learnt, &problem.world.grid)?;
    Ok(true)
}

fn option_seed(problem: &PlanningProblem<'_>, option: &GuidedOption) -> Seed {
    problem.seed.child(&format!("leg {}", option.id), 0)
}

/// The task of learning `option` from `states`, with nothing known of what comes after it.
pub(crate) fn task<'a>(
    problem: &PlanningProblem<'a>,
    option: &'a Arc<GuidedOption>,
    states: InitialStates,
    seed: Seed,
) -> LearningTask<'a> {
    LearningTask {
        world: problem.world,
        conditions: problem.conditions,
        option,
        next: None,
        tail: &[],
        states: Arc::new(states),
        wanted_success: problem.method.option_success,
        failure_cost_s: problem.method.failure_cost_s,
        estimate_episodes: problem.method.estimate_episodes,
        seed,
    }
}

/// Where `option` begins: at the initial configuration, or spread over its initiation set.
pub(crate) fn initial_states(
    problem: &PlanningProblem<'_>,
    option: &GuidedOption,
    seed: Seed,
) -> InitialStates {
    InitialStates::of_option(problem.world, option, problem.query.start, STATE_POOL, seed)
}
