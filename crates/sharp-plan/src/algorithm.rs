//! Algorithm 1: from an abstraction and a problem to a policy composed of options.
//!
//! The numbers in `algorithm_1` are the lines of the paper's Algorithm 1. Lines 1 to 3 come before: the predictor of
//! critical regions is a [`RegionDetector`](sharp_space::RegionDetector), and it comes trained. Lines 4 to 7 are
//! [`construct`](crate::construct). What goes beyond the paper is marked, and [`Method::paper`](crate::Method::paper)
//! switches it off.

use std::sync::Arc;

use sharp_drive::SuccessEstimate;
use sharp_guide::{GuidedOption, LegId, join_guides, shortest_way_m};

use crate::abstraction::Abstraction;
use crate::files::FileError;
use crate::known::KnownOptions;
use crate::learn::learn_missing;
use crate::library::OptionLibrary;
use crate::odds::{ComposedOdds, refine};
use crate::policies::Policies;
use crate::problem::PlanningProblem;
use crate::query::Phase;
use crate::reason::{Gap, fits, narrowest_gap, obstruction, unturned};
use crate::repair::{ENTERED_MIN, Repair, repair};
use crate::search::Search;
use crate::verify::{Solution, composed, predict, verify};

/// Plans looked at before the best so far is taken.
const ATTEMPTS_MAX: usize = 24;
/// Plans run from end to end before the best of them is taken.
const VERIFIED_MAX: usize = 4;
/// The same where odds are composed.
const COMPOSED_MAX: usize = 2;
/// Composed plans are compared with the direct way if they succeed less often than this as a whole, or between their first
/// and last pieces: it takes half of the time of an answer to guide and to drive, and is seldom better where they do well.
const COMPOSED_WELL: [f64; 2] = [0.95, 0.98];
/// And only if start and goal are no further apart, metres: the guide of a longer way takes longer than the rest of an answer.
const COMPOSED_DIRECT_M: f64 = 25.0;
/// A composed plan that succeeds less often than this is compared with one that the usual method makes and runs.
const COMPOSED_USABLE: f64 = 0.95;
/// Composed plans that are longer than this many times the shortest way are compared with the direct way too.
const DETOUR: f64 = 1.35;

/// A plan that succeeds less often is no plan, share of runs.
const LEAST_SUCCESS: f64 = 0.01;

/// How solving ended.
#[derive(Debug)]
pub enum Outcome {
    /// With a policy.
    Solved(Box<Solution>),
    /// There is no plan; says why.
    NoPlan(String),
    /// The monitor stopped it; what was learnt is in the library.
    Stopped,
}

/// Algorithm 1 from line 8 on: `abstraction` is what lines 4 to 7 built. What is learnt stays in `library`.
///
/// # Errors
/// Returns an error if the library cannot be written.
pub fn solve(
    problem: &PlanningProblem<'_>,
    abstraction: &Abstraction,
    library: &mut OptionLibrary,
) -> Result<Outcome, FileError> {
    let PlanningProblem { world, method, .. } = *problem;
    let known = KnownOptions::new(world, abstraction, method, library);
    solve_with(problem, abstraction, library, &Arc::new(known))
}

/// The same, where `known` was made of the library beforehand, for this abstraction and method.
///
/// # Errors
/// Returns an error if the library cannot be written.
pub(crate) fn solve_with(
    problem: &PlanningProblem<'_>,
    abstraction: &Abstraction,
    library: &mut OptionLibrary,
    known: &Arc<KnownOptions>,
) -> Result<Outcome, FileError> {
    let mut policies = Policies::new(library);
    let outcome = answer(problem, abstraction, &mut policies, known);
    library.end_problem(matches!(outcome, Ok(Outcome::Solved(_) | Outcome::NoPlan(_))));
    problem.monitor.phase(Phase::Done);
    outcome
}

/// Algorithm 1, and where its odds were composed and are poor, once more by the usual method.
fn answer(
    problem: &PlanningProblem<'_>,
    abstraction: &Abstraction,
    policies: &mut Policies<'_>,
    known: &Arc<KnownOptions>,
) -> Result<Outcome, FileError> {
    let PlanningProblem { world, method, query, .. } = *problem;
    let mut outcome = algorithm_1(problem, abstraction, policies, known)?;
    let gap = matches!(outcome, Outcome::NoPlan(_)).then(|| narrowest_gap(world, &query)).flatten();
    let is_poor = match &outcome {
        Outcome::Solved(solution) => !method.keeps_all() && solution.success() < COMPOSED_USABLE,
        // What quick guides cannot reach may be reached by manoeuvring, unless the robot does not fit.
        Outcome::NoPlan(_) => fits(world, gap.as_ref()),
        Outcome::Stopped => false,
    };
    if let Some(usual) = method.usual().filter(|_| is_poor) {
        // What this pass learns is for this problem alone: an option of the library that changed would no longer be the one
        // whose hand-overs were driven, and the answer to a question would depend on those before it.
        policies.leave_library();
        let usual = PlanningProblem { method: &usual, ..*problem };
        let other = algorithm_1(&usual, abstraction, policies, known)?;
        outcome = cheaper(outcome, other, method.failure_cost_s);
    }
    if let Outcome::NoPlan(reason) = &mut outcome {
        *reason = describe(problem, gap.as_ref(), reason);
    }
    Ok(outcome)
}

/// The one of two outcomes of a problem that costs less; `second` where neither is a plan.
fn cheaper(first: Outcome, second: Outcome, failure_cost_s: f64) -> Outcome {
    match (first, second) {
        (Outcome::Solved(first), Outcome::Solved(second)) => {
            let is_better = second.cost_s(failure_cost_s) < first.cost_s(failure_cost_s);
            Outcome::Solved(if is_better { second } else { first })
        }
        (first @ Outcome::Solved(_), _) => first,
        (_, second) => second,
    }
}

/// The algorithm itself, at most 60 lines.
fn algorithm_1(
    problem: &PlanningProblem<'_>,
    abstraction: &Abstraction,
    policies: &mut Policies<'_>,
    known: &Arc<KnownOptions>,
) -> Result<Outcome, FileError> {
    let PlanningProblem { world, method, conditions, query, seed, monitor } = *problem;
    monitor.phase(Phase::Search);
    // 8: s_i, s_g <- get_abstract_states(x_i, x_g)
    let mut search = match Search::new(world, abstraction, method, &conditions.noise, query, [], seed) {
        // Composed odds are for those in a hurry.
        Ok(search) => {
            let is_hurried = method.verify_episodes == 0;
            search.with_known(Arc::clone(known)).with_trials(conditions, is_hurried)
        }
        Err(unplaced) => return Ok(Outcome::NoPlan(unplaced.to_string())),
    };
    let mut most = if method.verify_episodes == 0 { COMPOSED_MAX } else { VERIFIED_MAX };
    let mut best: Option<Solution> = None;
    let (mut chosen, mut measured): (_, Vec<Vec<LegId>>) = (vec![], vec![]);
    let mut other = None;
    for attempt in 1..=ATTEMPTS_MAX {
        // 9: p <- A*_search(O, s_i, s_g), and 15: G <- compute_option_guide(I_o, beta_o) for each option of p
        let Some((_, p)) = other.take().or_else(|| cheapest(problem, &mut search, policies)) else {
            if monitor.should_stop() && best.is_none() {
                return Ok(Outcome::Stopped);
            }
            // Where the robot fits through, a motion planner may know a way that no options know.
            if search.fits() && search.offer_direct() {
                continue;
            }
            break;
        };
        // Beyond the paper: the guides of p are joined to one smooth path.
        let p = join(problem, p);
        // 10 to 20: Pi <- pi_0, o.policy for each o in p, pi_{n+1}; who has no policy (14) is trained (11, 16, 19)
        if monitor.should_stop() || !learn_missing(problem, &p, &search, policies)? {
            // Whoever stops the search gets the best plan so far.
            if best.is_some() {
                break;
            }
            return Ok(Outcome::Stopped);
        }
        // 17: the cost of an option is now what was measured, so a weak one may have a better alternative.
        let is_composed = method.verify_episodes == 0;
        let may_go_on = attempt < ATTEMPTS_MAX || best.is_some();
        if !is_composed && may_go_on && has_weak_option(problem, &p, policies) {
            let tried: Vec<_> = measured.iter().cloned().chain([names(&p)]).collect();
            other =
                cheapest(problem, &mut search, policies).filter(|other| !tried.contains(&names(&other.1)));
            if other.is_some() {
                continue;
            }
        }
        // Beyond the paper: Pi is repaired and measured, and the search looks again while another plan seems cheaper.
        monitor.phase(Phase::Verify);
        let is_stopped = !is_composed && !repair(&Repair { problem, plan: &p, search: &search }, policies)?;
        let solution = match is_composed {
            true => predict(problem, &p, policies, known),
            false => verify(problem, &p, policies),
        };
        measured.push(names(&p));
        let is_near = query.start.distance_m(&query.goal) <= COMPOSED_DIRECT_M;
        let may_be_poor = || solution.composed.as_ref().is_some_and(fails_often) || is_detour(problem, &p);
        if !is_composed || (is_near && may_be_poor()) {
            most += usize::from(search.offer_direct() && is_composed);
        }
        charge_hand_overs(&mut search, &solution, method.failure_cost_s);
        let cost_s = |solution: &Solution| solution.cost_s(method.failure_cost_s);
        if best.as_ref().is_none_or(|best| cost_s(&solution) < cost_s(best)) {
            best = Some(solution);
            chosen.clone_from(&p);
        }
        let best_s = best.as_ref().map_or(f64::INFINITY, cost_s);
        if is_stopped || measured.len() == most {
            break;
        }
        let is_new = |other: &(f64, Vec<Arc<GuidedOption>>)| !measured.contains(&names(&other.1));
        other = cheapest(problem, &mut search, policies).filter(is_new);
        if other.is_none() {
            other = search.direct(&|id| policies.estimate(id), problem.monitor).filter(is_new);
        }
        if other.as_ref().is_none_or(|(other_s, _)| best_s <= method.retry_above * other_s) {
            break;
        }
    }
    if let Some(odds) = best.as_ref().and_then(|best| best.composed.as_ref()) {
        let odds = refine(problem, &chosen, policies, odds)?;
        best = Some(composed(problem, &chosen, policies, odds));
    }
    // 21: return Pi. A plan that hardly ever succeeds is none, unless whatever was learnt is to be kept.
    Ok(match best.filter(|solution| method.keeps_all() || solution.predicted.rate() >= LEAST_SUCCESS) {
        Some(solution) => Outcome::Solved(Box::new(solution)),
        None => Outcome::NoPlan(describe_search(&search)),
    })
}

/// Whether a plan fails so often that the direct way may be better.
fn fails_often(odds: &ComposedOdds) -> bool {
    let [whole, on_the_way] = COMPOSED_WELL;
    let known = odds.pieces.len().saturating_sub(1);
    let between = odds.pieces.iter().take(known).skip(1).map(|piece| piece.success);
    odds.success < whole || between.product::<f64>() < on_the_way
}

/// Whether `plan` is so much longer than the shortest way that the direct way may be better.
fn is_detour(problem: &PlanningProblem<'_>, plan: &[Arc<GuidedOption>]) -> bool {
    let PlanningProblem { world, query, .. } = *problem;
    let shortest_m = shortest_way_m(&world.guide_robot(), query.start.position, query.goal.position);
    let plan_m: f64 = plan.iter().map(|leg| leg.guide.length_m()).sum();
    shortest_m.is_ok_and(|shortest_m| plan_m > DETOUR * shortest_m)
}

fn names(plan: &[Arc<GuidedOption>]) -> Vec<LegId> {
    plan.iter().map(|option| option.id).collect()
}

/// The cheapest plan by all that is known by now, and its cost in seconds.
fn cheapest(
    problem: &PlanningProblem<'_>,
    search: &mut Search<'_>,
    policies: &Policies<'_>,
) -> Option<(f64, Vec<Arc<GuidedOption>>)> {
    search.plan(&|id| policies.estimate(id), problem.monitor)
}

fn join(problem: &PlanningProblem<'_>, plan: Vec<Arc<GuidedOption>>) -> Vec<Arc<GuidedOption>> {
    let PlanningProblem { world, method, query, .. } = *problem;
    if !method.join_guides {
        return plan;
    }
    join_guides(plan, query.start, &world.guide_robot(), &method.search.guide)
}

fn has_weak_option(
    problem: &PlanningProblem<'_>,
    plan: &[Arc<GuidedOption>],
    policies: &Policies<'_>,
) -> bool {
    let is_weak = |option: &Arc<GuidedOption>| {
        let SuccessEstimate { count, .. } = policies.learnt(option.id).estimate;
        count.episodes > 0 && count.rate() < problem.method.usable_success
    };
    plan.iter().any(is_weak)
}

/// What options succeed less often on arrival than by themselves is the price of their hand-overs.
fn charge_hand_overs(search: &mut Search<'_>, solution: &Solution, failure_cost_s: f64) {
    let steps = &solution.steps;
    for (number, pair) in steps.windows(2).enumerate() {
        let [before, after] = pair else { continue };
        // What a composed piece of several hand-overs loses belongs to its last leg.
        let ends_here =
            |odds: &ComposedOdds| odds.pieces.iter().any(|piece| piece.until == number as f64 + 1.5);
        let is_last = number + 2 == steps.len();
        if !is_last && solution.composed.as_ref().is_some_and(|odds| !ends_here(odds)) {
            continue;
        }
        // A few episodes say little: only what they rule out is charged.
        let loss = after.learnt.estimate.count.lower95() - after.on_arrival.rate();
        if after.on_arrival.episodes >= ENTERED_MIN && loss > 0.0 {
            search.charge(before.option.id, after.option.id, failure_cost_s * loss);
        }
    }
}

/// Why there is no plan: what the map says, where that is enough, else what the search knows.
fn describe(problem: &PlanningProblem<'_>, gap: Option<&Gap>, known: &str) -> String {
    let PlanningProblem { world, query, method, .. } = problem;
    let asks_heading = method.search.goal_heading_tolerance_rad.is_some();
    let found = obstruction(world, query, gap).or_else(|| unturned(world, query, asks_heading));
    found.unwrap_or_else(|| known.to_owned())
}

fn describe_search(search: &Search<'_>) -> String {
    let nothing = "no plan that was tried reaches the goal";
    match search.unguided().next() {
        Some((id, reason)) => {
            let count = search.unguided().count();
            let options = if count == 1 { "option has" } else { "options have" };
            format!("{nothing}; {count} {options} no guide, among them {id}: {reason}")
        }
        None => nothing.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use sharp_drive::{NetworkPolicy, OptionPolicy, PolicyContext, prior_interface};
    use sharp_guide::Role;
    use sharp_options::OptionKind;
    use sharp_rl::StopReason;
    use sharp_sim::NoiseModel;
    use sharp_space::{Pose, Seed};

    use super::*;
    use crate::conditions::Conditions;
    use crate::learn::{
        LearnFailure, LearningMonitor, LearningTask, LearntPolicy, OptionLearner, Selection, Training,
    };
    use crate::method::{Method, RepairSettings};
    use crate::query::{Monitor, Query};
    use crate::test_worlds::{HALL, SEALED, along, world};

    /// The default method with fewer episodes.
    fn quick() -> Method {
        let learner = Selection { screening_episodes: 50, judge_episodes: 200, ..Selection::default() };
        let fast = Method::fast().with_episodes(100, 100, 100);
        let repair = RepairSettings { judge_episodes: 200, ..fast.repair };
        Method { learner: Arc::new(learner), repair, ..fast }
    }

    /// Solves `query` in `drawing` under nominal noise.
    fn solved(
        (drawing, kind): (&str, OptionKind),
        query: Query,
        method: &Method,
        monitor: &dyn Monitor,
    ) -> (Outcome, OptionLibrary) {
        let (world, abstraction) = world(drawing, kind);
        let conditions = Conditions::new(&world, NoiseModel::nominal());
        let problem =
            PlanningProblem { world: &world, method, conditions: &conditions, query, seed: Seed(1), monitor };
        let mut library = OptionLibrary::in_memory();
        let outcome = solve(&problem, &abstraction, &mut library).expect("no files");
        (outcome, library)
    }

    /// Notes what happens and stops when told to.
    #[derive(Default)]
    struct Notes {
        phases: Mutex<Vec<Phase>>,
        learnt: Mutex<Vec<LegId>>,
        stops: bool,
    }

    impl Monitor for Notes {
        fn phase(&self, phase: Phase) {
            self.phases.lock().expect("no other panic").push(phase);
        }

        fn learnt(&self, option: &GuidedOption, _: &LearntPolicy) {
            self.learnt.lock().expect("no other panic").push(option.id);
        }

        fn should_stop(&self) -> bool {
            self.stops
        }
    }

    #[test]
    fn a_hall_is_solved_and_the_options_stay_in_the_library() {
        let notes = Notes::default();
        let mut method = quick();
        // In an empty hall nothing beats the direct way.
        method.search.direct = false;
        let (outcome, library) = solved((HALL, OptionKind::Centroid), along(), &method, &notes);
        let Outcome::Solved(solution) = outcome else { panic!("{outcome:?}") };
        assert_eq!(solution.steps.len(), 4, "first, two options, last");
        assert_eq!(solution.reuse(), (2, 0), "nothing was there before");
        assert!(solution.predicted.rate() > 0.9, "an open hall is crossed {:?}", solution.predicted);
        assert_eq!(library.len(), 2, "only options are kept");
        let phases = notes.phases.into_inner().expect("no other panic");
        assert_eq!((phases.first(), phases.last()), (Some(&Phase::Search), Some(&Phase::Done)), "{phases:?}");
        assert!(notes.learnt.into_inner().expect("no other panic").len() >= 4, "every option was told");
    }

    #[test]
    fn the_prior_alone_is_estimated_and_neither_trained_nor_repaired() {
        let method = Method::prior().with_episodes(100, 100, 1000);
        let (outcome, _) = solved((HALL, OptionKind::Centroid), along(), &method, &());
        let Outcome::Solved(solution) = outcome else { panic!("{outcome:?}") };
        let context = PolicyContext::new(&NoiseModel::nominal(), 1.0);
        let cautious = prior_interface(&sharp_sim::RobotModel::husky(), context);
        for crate::PlannedOption { option, learnt, .. } in &solution.steps {
            let OptionPolicy::Network(NetworkPolicy { interface, .. }) = &learnt.policy else {
                panic!("{}: a follower", option.id)
            };
            assert_eq!(*interface, cautious, "{}", option.id);
            let effort = (learnt.estimate.count.episodes, learnt.gradient_steps);
            assert_eq!(effort, (100, 0), "{}", option.id);
        }
        assert!(solution.predicted.rate() > 0.8, "an open hall is crossed {:?}", solution.predicted);
    }

    /// Trains in vain, and notes what it was asked for.
    #[derive(Debug, Default)]
    struct Hopeless(Mutex<Vec<(LegId, Seed)>>);

    impl OptionLearner for Hopeless {
        fn learn(
            &self,
            task: &LearningTask<'_>,
            _: &dyn LearningMonitor,
        ) -> Result<LearntPolicy, LearnFailure> {
            self.0.lock().unwrap().push((task.option.id, task.seed));
            let training =
                Training { stop: StopReason::Steps, mean_return: -1.0, points: vec![], failed_before: 0 };
            let useless = LearntPolicy::useless(&task.world.robot);
            Ok(LearntPolicy { env_steps: 100, training: Some(training), ..useless })
        }
    }

    #[test]
    fn a_failed_training_is_tried_again_with_another_seed_and_not_for_ever() {
        let (world, abstraction) = world(HALL, OptionKind::Centroid);
        let conditions = Conditions::new(&world, NoiseModel::nominal());
        let learner = Arc::new(Hopeless::default());
        let method =
            Method::paper().with_learner("hopeless", Arc::clone(&learner) as _).with_episodes(1, 1, 0);
        let mut library = OptionLibrary::in_memory();
        let mut asked = || {
            let problem = PlanningProblem {
                world: &world,
                method: &method,
                conditions: &conditions,
                query: along(),
                seed: Seed(1),
                monitor: &(),
            };
            let outcome = solve(&problem, &abstraction, &mut library).expect("no files");
            (matches!(outcome, Outcome::Solved(_)), std::mem::take(&mut *learner.0.lock().unwrap()))
        };
        let tried: Vec<_> = (0..3).map(|_| asked()).collect();
        assert!(tried.iter().all(|(is_solved, _)| *is_solved), "the paper keeps whatever was learnt");
        // Options are learnt side by side, in any order.
        let option = |(_, legs): &(bool, Vec<(LegId, Seed)>)| {
            let options = legs.iter().filter(|(id, _)| id.role() == Role::Option);
            *options.min_by_key(|(id, _)| *id).expect("one is trained")
        };
        let [first, second, third] = [0, 1, 2].map(|index| option(&tried[index]));
        assert_eq!((first.0, first.0), (second.0, third.0), "the same plan each time");
        assert!(first.1 != second.1 && second.1 != third.1 && first.1 != third.1, "other seeds");
        let (_, legs) = asked();
        assert!(legs.iter().all(|(id, _)| *id != first.0), "it counts as impossible now: {legs:?}");
    }

    #[test]
    fn no_plan_is_an_outcome_with_a_reason() {
        let through = Query { start: Pose::new(2.0, 1.4, 0.0), goal: Pose::new(6.0, 1.4, 0.0) };
        for (query, needle) in [
            (through, "separate parts of the free space"),
            (Query { start: Pose::new(-9.0, 0.0, 0.0), ..through }, "the start lies outside the map"),
            (Query { goal: Pose::new(-9.0, 0.0, 0.0), ..through }, "the goal lies outside the map"),
        ] {
            let (outcome, _) = solved((SEALED, OptionKind::Interface), query, &quick(), &());
            let Outcome::NoPlan(reason) = outcome else { panic!("{outcome:?}") };
            assert!(reason.contains(needle), "{reason:?} does not say {needle:?}");
        }
    }

    #[test]
    fn a_stop_is_heard() {
        let notes = Notes { stops: true, ..Notes::default() };
        let (outcome, _) = solved((HALL, OptionKind::Centroid), along(), &quick(), &notes);
        assert!(matches!(outcome, Outcome::Stopped), "{outcome:?}");
    }
}
