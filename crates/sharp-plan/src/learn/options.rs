//! Lines 11 and 13 to 19 of Algorithm 1: what a plan lacks is taken from the library or learnt.

use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, Mutex, PoisonError};

use sharp_drive::{Driver, InitialStates, SuccessCount, SuccessEstimate};
use sharp_guide::{GuidedOption, Role};
use sharp_sim::RobotState;
use sharp_space::Seed;

use super::{LearnFailure, LearningTask, LearntPolicy, TrainingFile};
use crate::files::FileError;
use crate::method::LearningOrder;
use crate::policies::{Policies, corridor};
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
        let seed = option_seed(problem, option, policies);
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
        let (next, seed) = (plan.get(index + 1), option_seed(problem, option, policies));
        if policies.get(option.id).is_none() {
            let states = initial_states(problem, option, seed).with_arrivals(arrivals.clone());
            let task = LearningTask { next, ..task(problem, option, states, seed) };
            let lesson = learn(problem, &task, policies.trainings());
            if !take(problem, option, lesson, search, policies)? {
                return Ok(false);
            }
        }
        let driver = Driver::new(option, &policies.learnt(option.id).policy, next);
        let trial = problem.conditions.monte_carlo(problem.world).with_seed(seed);
        arrivals = trial.arrivals(&driver, &arrivals);
    }
    Ok(true)
}

/// Each option on its own and side by side, one a thread: the paper's way.
fn learn_independent(
    problem: &PlanningProblem<'_>,
    missing: &[&Arc<GuidedOption>],
    search: &Search<'_>,
    policies: &mut Policies<'_>,
) -> Result<bool, FileError> {
    let folder = policies.trainings();
    let learn_alone = |option: &Arc<GuidedOption>| {
        let seed = option_seed(problem, option, policies);
        let task = task(problem, option, initial_states(problem, option, seed), seed);
        // The others go on: what can be learnt is learnt.
        learn(problem, &task, folder)
    };
    let lessons = side_by_side(missing, learn_alone);
    let mut finished = true;
    for (option, lesson) in missing.iter().zip(lessons) {
        finished &= take(problem, option, lesson, search, policies)?;
    }
    Ok(finished)
}

/// What came of a task, and the file of its training where trainings are kept.
type Lesson = (Result<LearntPolicy, LearnFailure>, Option<TrainingFile>);

/// Learns what `task` asks for, unless the `folder` of trainings has it, and tells the monitor.
fn learn(problem: &PlanningProblem<'_>, task: &LearningTask<'_>, folder: Option<&Path>) -> Lesson {
    let new_file = |folder| TrainingFile::new(folder, task.option.id, &decides_training(problem, task));
    let file = folder.map(new_file);
    let result = learn_or_find(problem, task, file.as_ref());
    if let Ok(learnt) = &result {
        problem.monitor.learnt(task.option, learnt);
    }
    (result, file)
}

/// Does `learn` with each of `options` on as many threads as there are; what comes first on a long list are the longest
/// guides, which take longest to learn. The results are in the order of `options`.
fn side_by_side<R: Send>(
    options: &[&Arc<GuidedOption>],
    learn: impl Fn(&Arc<GuidedOption>) -> R + Sync,
) -> Vec<R> {
    let mut order: Vec<usize> = (0..options.len()).collect();
    let length_m = |index: &usize| options[*index].guide.length_m();
    order.sort_by(|a, b| length_m(b).total_cmp(&length_m(a)));
    let results: Vec<Mutex<Option<R>>> = options.iter().map(|_| Mutex::default()).collect();
    let next = AtomicUsize::new(0);
    // A thread that waits for a part of an estimate must not begin another option meanwhile, as it might with a parallel
    // iterator: so each thread has one task, which takes option after option.
    rayon::scope(|scope| {
        for _ in 0..rayon::current_num_threads().min(options.len()) {
            scope.spawn(|_| {
                while let Some(&index) = order.get(next.fetch_add(1, Ordering::Relaxed)) {
                    let result = learn(options[index]);
                    *results[index].lock().unwrap_or_else(PoisonError::into_inner) = Some(result);
                }
            });
        }
    });
    let done = |result: Mutex<Option<R>>| result.into_inner().unwrap_or_else(PoisonError::into_inner);
    results.into_iter().map(|result| done(result).expect("every option had its turn")).collect()
}

/// Learns what `task` asks for, unless `file` has what an interrupted solve learnt.
fn learn_or_find(
    problem: &PlanningProblem<'_>,
    task: &LearningTask<'_>,
    file: Option<&TrainingFile>,
) -> Result<LearntPolicy, LearnFailure> {
    let found = file.map_or(Ok(None), TrainingFile::finished).map_err(LearnFailure::File)?;
    if let Some(learnt) = found {
        return Ok(learnt);
    }
    if problem.monitor.should_stop() {
        return Err(LearnFailure::Stopped);
    }
    let monitor = OptionMonitor { monitor: problem.monitor, option: task.option, file };
    let learnt = problem.method.learner.learn(task, &monitor)?;
    file.map_or(Ok(()), |file| file.finish(&learnt)).map_err(LearnFailure::File)?;
    Ok(learnt)
}

/// A text of everything that decides the training of `task`, apart from map and simulator.
fn decides_training(problem: &PlanningProblem<'_>, task: &LearningTask<'_>) -> String {
    let PlanningProblem { world, method, conditions, .. } = problem;
    let LearningTask { option, next, states, seed, .. } = task;
    let corridors = [Some(*option), *next].map(|option| option.map(|option| corridor(option, &world.grid)));
    let (learner, episodes) = (&method.learner, method.estimate_episodes);
    format!(
        "{:?} {:?} {corridors:?} {states:?} {seed:?} {learner:?} {episodes}",
        world.robot, conditions.noise
    )
}

/// Keeps what was learnt of `option`; false if learning was stopped.
fn take(
    problem: &PlanningProblem<'_>,
    option: &Arc<GuidedOption>,
    (result, file): Lesson,
    search: &Search<'_>,
    policies: &mut Policies<'_>,
) -> Result<bool, FileError> {
    let mut learnt = match result {
        Ok(learnt) => learnt,
        Err(LearnFailure::Stopped) => {
            return file.and_then(TrainingFile::into_failure).map_or(Ok(false), Err);
        }
        // A broken task cannot be learnt: its edge goes, the search goes on.
        Err(LearnFailure::File(error)) => return Err(error),
        Err(LearnFailure::Broken(_)) => LearntPolicy::useless(&problem.world.robot),
    };
    if let Some(training) = &mut learnt.training {
        training.failed_before = policies.failed_trainings(option.id);
    }
    // The option of a plan may have been joined to its neighbours; the library keeps it as it is alone.
    policies.keep(search.option(option.id).unwrap_or(option), learnt, &problem.world.grid)?;
    if let Some(file) = file {
        policies.note_training(option.id, file.path());
        file.into_failure().map_or(Ok(()), Err)?;
    }
    Ok(true)
}

/// The root of the random streams for learning `option`; another one after each training that failed.
fn option_seed(problem: &PlanningProblem<'_>, option: &GuidedOption, policies: &Policies<'_>) -> Seed {
    problem.seed.child(&format!("leg {}", option.id), policies.failed_trainings(option.id).into())
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
