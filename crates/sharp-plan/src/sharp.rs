//! Algorithm 1: from an abstraction and a problem to a policy composed of options.

mod joining;
mod learning;
mod repair;

use std::collections::BTreeMap;
use std::sync::Arc;

use sharp_options::OptionKind;
use sharp_rl::Progress;
use sharp_sim::{NoiseModel, RobotState};
use sharp_space::Seed;

use crate::certify::{Certificate, Trial};
use crate::files::FileError;
use crate::learn::{LearnSettings, LearningMode, Learnt, Lesson, LessonMonitor};
use crate::leg::{Leg, LegId, Role};
use crate::library::OptionLibrary;
use crate::percept::Workspace;
use crate::planner::{Abstraction, Planner, Query, SearchSettings, Unplaced};
use crate::rollout::{ChainRun, Driver, LegOutcome};
use crate::starts::{StartSpread, Starts};
use crate::stats::Tally;

/// Start states kept of each leg.
const START_POOL: usize = 256;
/// Plans looked at before the best so far is taken.
const ATTEMPTS_MAX: usize = 24;
/// Plans run from end to end before the best of them is taken.
const VERIFIED_MAX: usize = 4;
/// A hand-over that was tried less often has shown nothing.
const ENTERED_MIN: u32 = 50;

/// All settings of [`solve`].
#[derive(Clone, Debug)]
pub struct SolveSettings {
    /// How policies are learnt.
    pub learn: LearnSettings,
    /// How plans are searched.
    pub search: SearchSettings,
    /// The noise that policies are learnt and verified under.
    pub noise: NoiseModel,
    /// Runs through the whole plan that look for weak legs, each round.
    pub repair_episodes: u32,
    /// Rounds of repair; 0 is the paper's rule.
    pub repair_rounds: u32,
    /// Success wanted of the whole plan; its legs share the failures that are left.
    pub wanted_success: f64,
    /// Fresh runs through the whole plan that its predicted success is counted on.
    pub verify_episodes: u32,
    /// Smooths the guides of a plan together; false is the paper's rule.
    pub join_guides: bool,
    /// A plan that holds less often than this makes the search try other ways.
    pub retry_below: f64,
    /// A leg that holds less often than this makes the search look for a better way.
    pub usable_success: f64,
    /// The root of all randomness.
    pub seed: Seed,
}

impl SolveSettings {
    /// The settings of `mode` for the robot of `workspace`.
    #[must_use]
    pub fn new(workspace: &Workspace, mode: LearningMode, noise: NoiseModel, seed: Seed) -> Self {
        let mut search = SearchSettings::new(workspace);
        if mode == LearningMode::Paper {
            search.untrained_surcharge_s = 0.0;
            search.spares = false;
            search.passing = false;
        }
        Self {
            learn: LearnSettings::new(mode),
            search,
            noise,
            repair_episodes: 1000,
            // Only where there is something to choose from can a leg choose again.
            repair_rounds: if mode == LearningMode::Fast { 3 } else { 0 },
            wanted_success: 0.99,
            verify_episodes: 1000,
            join_guides: mode != LearningMode::Paper,
            retry_below: if mode == LearningMode::Fast { 0.97 } else { 0.0 },
            // The paper keeps whatever was learnt.
            usable_success: if mode == LearningMode::Paper { 0.0 } else { 0.9 },
            seed,
        }
    }
}

/// What [`solve`] is busy with; a new phase ends the one before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// A* over options.
    Search,
    /// The guides that the search asked for.
    Guide,
    /// Learning the policies of this many legs.
    Learn(usize),
    /// Running the whole plan, and repairing weak legs.
    Verify,
    /// Nothing any more.
    Done,
}

/// Watches [`solve`] and may stop it. `()` watches nothing.
pub trait Monitor: Sync {
    /// A phase begins.
    fn phase(&self, _phase: Phase) {}
    /// The training of a leg took a step; several legs may train at once.
    fn trained(&self, _leg: &Leg, _progress: &Progress<'_>) {}
    /// A leg was learnt.
    fn learnt(&self, _leg: &Leg, _learnt: &Learnt) {}
    /// Asked often; true ends the search as soon as possible. What was learnt is kept.
    fn should_stop(&self) -> bool {
        false
    }
}

impl Monitor for () {}

/// A monitor, on one leg.
struct LegMonitor<'a> {
    monitor: &'a dyn Monitor,
    leg: &'a Leg,
}

impl LessonMonitor for LegMonitor<'_> {
    fn should_stop(&self) -> bool {
        self.monitor.should_stop()
    }

    fn trained(&self, progress: &Progress<'_>) {
        self.monitor.trained(self.leg, progress);
    }
}

/// A leg of a solution.
#[derive(Clone, Debug)]
pub struct PlannedLeg {
    /// The leg and its guide.
    pub leg: Arc<Leg>,
    /// Its policy.
    pub learnt: Learnt,
    /// True for an option whose policy existed before this problem.
    pub reused: bool,
    /// How often it held when entered the way the leg before it arrives.
    pub on_arrival: Tally,
}

/// A policy composed of options with its measured odds.
#[derive(Clone, Debug)]
pub struct Solution {
    /// The problem.
    pub query: Query,
    /// `π_0`, the options, `π_{n+1}`.
    pub legs: Vec<PlannedLeg>,
    /// Fresh runs through the whole plan, without recovery and without contact.
    pub predicted: Tally,
    /// Mean simulated time of the successful ones, seconds.
    pub predicted_time_s: f64,
}

impl Solution {
    fn certificate(&self) -> Certificate {
        Certificate { tally: self.predicted, mean_time_s: self.predicted_time_s }
    }

    /// Option uses and how many of them found their policy in the library.
    #[must_use]
    pub fn reuse(&self) -> (usize, usize) {
        let options = self.legs.iter().filter(|planned| planned.leg.id.role() == Role::Option);
        options.fold((0, 0), |(uses, reused), planned| (uses + 1, reused + usize::from(planned.reused)))
    }
}

/// How [`solve`] ended.
#[derive(Debug)]
pub enum Outcome {
    /// With a policy.
    Solved(Box<Solution>),
    /// There is no plan; says why.
    NoPlan(String),
    /// The monitor stopped it; what was learnt is in the library.
    Stopped,
}

/// Algorithm 1 from line 8 on: `abstraction` is what lines 4 to 7 built.
///
/// # Errors
/// Returns an error if the library cannot be written.
pub fn solve(
    workspace: &Workspace,
    abstraction: &Abstraction,
    query: Query,
    settings: &SolveSettings,
    library: &mut OptionLibrary,
    monitor: &dyn Monitor,
) -> Result<Outcome, FileError> {
    monitor.phase(Phase::Search);
    let known: Vec<_> =
        library.iter().map(|(id, stored)| (LegId::Option(id), stored.guide.clone())).collect();
    let planner = match Planner::new(workspace, abstraction, settings.search, query, known, settings.seed) {
        Ok(planner) => planner,
        Err(unplaced) => return Ok(Outcome::NoPlan(describe_unplaced(unplaced).to_owned())),
    };
    let before = library.iter().map(|(id, _)| LegId::Option(id)).collect();
    let mut run =
        Run { workspace, query, settings, library, monitor, planner, before, learnt: BTreeMap::new() };
    let outcome = run.solve();
    monitor.phase(Phase::Done);
    outcome
}

fn describe_unplaced(unplaced: Unplaced) -> &'static str {
    match unplaced {
        Unplaced::Start => "the start lies in no abstract state: the robot cannot leave it",
        Unplaced::Goal => "the goal lies in no abstract state: the robot cannot reach it",
    }
}

/// One call of [`solve`].
struct Run<'a> {
    workspace: &'a Workspace,
    query: Query,
    settings: &'a SolveSettings,
    library: &'a mut OptionLibrary,
    monitor: &'a dyn Monitor,
    planner: Planner<'a>,
    before: Vec<LegId>,
    /// Everything with a policy in this problem: from the library, or learnt now.
    learnt: BTreeMap<LegId, Learnt>,
}

impl Run<'_> {
    fn solve(&mut self) -> Result<Outcome, FileError> {
        self.learnt
            .extend(self.library.iter().map(|(id, stored)| (LegId::Option(id), stored.learnt.clone())));
        let mut best: Option<Solution> = None;
        let mut verified = 0;
        for _ in 0..ATTEMPTS_MAX {
            let Some(legs) = self.search() else { break };
            let legs = self.join(legs);
            if self.monitor.should_stop() || !self.learn_missing(&legs)? {
                return Ok(Outcome::Stopped);
            }
            // A leg that falls short has become dear: there may be a better way by now.
            let falls_short = |leg: &Arc<Leg>| self.falls_short(self.learnt[&leg.id].verified);
            if legs.iter().any(falls_short) && self.search().is_none_or(|again| ids(&again) != ids(&legs)) {
                continue;
            }
            let Some(solution) = self.verify(&legs)? else { return Ok(Outcome::Stopped) };
            verified += 1;
            let is_weak = self.is_weak(&solution);
            if is_weak {
                self.charge_joins(&solution.legs);
            }
            let cost_s = |solution: &Solution| self.cost_s(solution.certificate());
            if best.as_ref().is_none_or(|best| cost_s(&solution) < cost_s(best)) {
                best = Some(solution);
            }
            if !is_weak
                || verified == VERIFIED_MAX
                || self.search().is_none_or(|again| ids(&again) == ids(&legs))
            {
                break;
            }
        }
        // A plan that never holds is none, unless whatever was learnt is to be kept.
        let keeps_all = self.settings.usable_success == 0.0;
        match best.filter(|solution| keeps_all || solution.predicted.successes > 0) {
            Some(solution) => Ok(Outcome::Solved(Box::new(solution))),
            None => Ok(Outcome::NoPlan(self.describe_no_plan())),
        }
    }

    /// What whatever `certificate` tells of costs here, seconds.
    fn cost_s(&self, certificate: Certificate) -> f64 {
        certificate.cost_s(self.settings.learn.failure_cost_s)
    }

    /// The cheapest plan by all that is known by now.
    fn search(&mut self) -> Option<Vec<Arc<Leg>>> {
        let failure_cost_s = self.settings.learn.failure_cost_s;
        let Self { planner, learnt, monitor, .. } = self;
        let cost = |id: LegId| learnt.get(&id).map(|learnt| learnt.cost_s(failure_cost_s));
        planner.plan(&cost, *monitor)
    }

    /// `legs` with guides that join smoothly, unless the paper's way is wanted.
    fn join(&self, legs: Vec<Arc<Leg>>) -> Vec<Arc<Leg>> {
        if !self.settings.join_guides {
            return legs;
        }
        joining::join_guides(self.workspace, &self.query, legs, &self.settings.search.guide)
    }

    fn falls_short(&self, tally: Tally) -> bool {
        tally.episodes > 0 && tally.rate() < self.settings.usable_success
    }

    /// What legs hold less often on arrival than by themselves is the price of their hand-overs.
    fn charge_joins(&mut self, legs: &[PlannedLeg]) {
        for pair in legs.windows(2) {
            let [before, after] = pair else { continue };
            let loss = after.learnt.verified.rate() - after.on_arrival.rate();
            if after.on_arrival.episodes >= ENTERED_MIN && loss > 0.0 {
                self.planner.charge(before.leg.id, after.leg.id, self.settings.learn.failure_cost_s * loss);
            }
        }
    }

    /// Returns true if another way may be better than `solution`.
    fn is_weak(&self, solution: &Solution) -> bool {
        solution.predicted.rate() < self.settings.retry_below
    }

    /// Repairs the plan of `legs` and counts how often it holds; `None` if stopped.
    fn verify(&mut self, legs: &[Arc<Leg>]) -> Result<Option<Solution>, FileError> {
        self.monitor.phase(Phase::Verify);
        if self.settings.repair_rounds > 0 && !self.repair(legs)? {
            return Ok(None);
        }
        let runs = self.run_chain(&self.drivers(legs), self.settings.verify_episodes, "verify");
        let on_arrival = tallies(&runs, legs.len());
        Ok(Some(self.solution(legs, &runs, &on_arrival)))
    }

    fn lesson<'b>(&'b self, leg: &'b Arc<Leg>, starts: Starts, seed: Seed) -> Lesson<'b> {
        let (workspace, noise, settings) = (self.workspace, &self.settings.noise, &self.settings.learn);
        let starts = Arc::new(starts);
        Lesson { workspace, leg, next: None, tail: &[], starts, noise, settings, seed }
    }

    fn starts(&self, leg: &Leg, seed: Seed) -> Starts {
        match leg.id {
            LegId::First(_) | LegId::Direct => Starts::exactly(RobotState::at_rest(self.query.start)),
            LegId::Option(_) | LegId::Last(..) => {
                Starts::spread(self.workspace, leg, &StartSpread::default(), START_POOL, seed)
            }
        }
    }

    fn drivers<'b>(&'b self, legs: &'b [Arc<Leg>]) -> Vec<Driver<'b>> {
        let driver = |(index, leg): (usize, &'b Arc<Leg>)| {
            Driver::new(leg, &self.learnt[&leg.id].policy, legs.get(index + 1).map(AsRef::as_ref))
        };
        legs.iter().enumerate().map(driver).collect()
    }

    fn run_chain(&self, drivers: &[Driver<'_>], episodes: u32, purpose: &str) -> Vec<ChainRun> {
        let seed = self.settings.seed.child(purpose, 0);
        let trial = Trial { workspace: self.workspace, noise: &self.settings.noise, episodes, seed };
        trial.of_chain(drivers, RobotState::at_rest(self.query.start))
    }

    fn solution(&self, legs: &[Arc<Leg>], runs: &[ChainRun], on_arrival: &[Tally]) -> Solution {
        let planned = |(leg, &on_arrival): (&Arc<Leg>, &Tally)| PlannedLeg {
            leg: Arc::clone(leg),
            learnt: self.learnt[&leg.id].clone(),
            reused: self.before.contains(&leg.id),
            on_arrival,
        };
        let Certificate { tally, mean_time_s } = certificate(runs);
        Solution {
            query: self.query,
            legs: legs.iter().zip(on_arrival).map(planned).collect(),
            predicted: tally,
            predicted_time_s: if mean_time_s.is_finite() { mean_time_s } else { 0.0 },
        }
    }

    fn describe_no_plan(&self) -> String {
        let unguided = self.planner.unguided().count();
        let first = self.planner.unguided().next();
        match first {
            Some((id, reason)) => format!(
                "no sequence of options leads from the start to the goal; {unguided} legs have no guide, among them {id}: {reason}"
            ),
            None => "no sequence of options leads from the start to the goal".to_owned(),
        }
    }
}

/// The names of `legs`.
fn ids(legs: &[Arc<Leg>]) -> Vec<LegId> {
    legs.iter().map(|leg| leg.id).collect()
}

/// How often all legs held, and how long that took.
fn certificate(runs: &[ChainRun]) -> Certificate {
    Certificate::of(runs.iter().map(|run| (run.outcome == LegOutcome::Done, run.times_s.iter().sum())))
}

/// For each leg: how often it was entered, and how often it then held.
fn tallies(runs: &[ChainRun], legs: usize) -> Vec<Tally> {
    let entered = |index: usize| runs.iter().filter(move |run| run.entries.len() > index);
    (0..legs).map(|index| Tally::count(entered(index).map(|run| run.passed(index)))).collect()
}

/// The letter that names a kind of option in files and flags.
#[must_use]
pub const fn kind_name(kind: OptionKind) -> &'static str {
    kind.name()
}

#[cfg(test)]
mod tests {
    use std::sync::Mutex;

    use super::*;
    use crate::drawn::{HALL, SEALED, along, world};
    use crate::percept::Expectation;
    use crate::policy::OptionPolicy;
    use crate::prior;
    use sharp_space::Pose;

    fn settings(workspace: &Workspace) -> SolveSettings {
        let noise = NoiseModel::by_name("nominal").expect("a built-in noise");
        let settings = SolveSettings::new(workspace, LearningMode::Fast, noise, Seed(1));
        let learn = LearnSettings { screening_episodes: 50, certify_episodes: 200, ..settings.learn };
        SolveSettings { learn, repair_episodes: 100, verify_episodes: 100, ..settings }
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
        fn learnt(&self, leg: &Leg, _: &Learnt) {
            self.learnt.lock().expect("no other panic").push(leg.id);
        }
        fn should_stop(&self) -> bool {
            self.stops
        }
    }

    #[test]
    fn a_hall_is_solved_and_the_options_stay_in_the_library() {
        let (workspace, abstraction) = world(HALL, OptionKind::Centroid);
        let (mut library, notes) = (OptionLibrary::in_memory(), Notes::default());
        let outcome = solve(&workspace, &abstraction, along(), &settings(&workspace), &mut library, &notes)
            .expect("no files");
        let Outcome::Solved(solution) = outcome else { panic!("{outcome:?}") };
        assert_eq!(solution.legs.len(), 4, "first, two options, last");
        assert_eq!(solution.reuse(), (2, 0), "nothing was there before");
        assert!(solution.predicted.rate() > 0.9, "an open hall holds {:?}", solution.predicted);
        assert_eq!(library.len(), 2, "only options are kept");
        let phases = notes.phases.into_inner().expect("no other panic");
        assert_eq!((phases.first(), phases.last()), (Some(&Phase::Search), Some(&Phase::Done)), "{phases:?}");
        assert!(notes.learnt.into_inner().expect("no other panic").len() >= 4, "every leg was told");
    }

    #[test]
    fn the_prior_alone_is_certified_and_neither_trained_nor_repaired() {
        let (workspace, abstraction) = world(HALL, OptionKind::Centroid);
        let prior = SolveSettings::new(&workspace, LearningMode::Prior, NoiseModel::nominal(), Seed(1));
        let learn = LearnSettings { certify_episodes: 100, ..prior.learn };
        let settings = SolveSettings { learn, verify_episodes: 100, ..prior };
        let mut library = OptionLibrary::in_memory();
        let outcome = solve(&workspace, &abstraction, along(), &settings, &mut library, &());
        let Ok(Outcome::Solved(solution)) = outcome else { panic!("{outcome:?}") };
        let middle = prior::form(&workspace.robot, Expectation::new(&NoiseModel::nominal(), 0.5));
        for PlannedLeg { leg, learnt, .. } in &solution.legs {
            let OptionPolicy::Learnt { form, .. } = learnt.policy else { panic!("{}: a follower", leg.id) };
            assert_eq!(form, middle, "{}", leg.id);
            assert_eq!((learnt.verified.episodes, learnt.gradient_steps), (100, 0), "{}", leg.id);
        }
        assert!(solution.predicted.rate() > 0.8, "an open hall holds {:?}", solution.predicted);
    }

    #[test]
    fn no_plan_is_an_outcome_with_a_reason() {
        let (workspace, abstraction) = world(SEALED, OptionKind::Interface);
        let through = Query { start: Pose::new(2.0, 1.4, 0.0), goal: Pose::new(6.0, 1.4, 0.0) };
        for (query, needle) in [
            (through, "no sequence of options"),
            (Query { start: Pose::new(-9.0, 0.0, 0.0), ..through }, "start lies in no abstract state"),
            (Query { goal: Pose::new(-9.0, 0.0, 0.0), ..through }, "goal lies in no abstract state"),
        ] {
            let mut library = OptionLibrary::in_memory();
            let outcome = solve(&workspace, &abstraction, query, &settings(&workspace), &mut library, &());
            let Ok(Outcome::NoPlan(reason)) = outcome else { panic!("{outcome:?}") };
            assert!(reason.contains(needle), "{reason:?} does not say {needle:?}");
        }
    }

    #[test]
    fn a_stop_is_heard() {
        let (workspace, abstraction) = world(HALL, OptionKind::Centroid);
        let notes = Notes { stops: true, ..Notes::default() };
        let mut library = OptionLibrary::in_memory();
        let outcome = solve(&workspace, &abstraction, along(), &settings(&workspace), &mut library, &notes);
        assert!(matches!(outcome, Ok(Outcome::Stopped)), "{outcome:?}");
    }

    #[test]
    fn legs_are_counted_only_where_they_were_entered() {
        let at = |count| vec![RobotState::at_rest(Pose::new(0.0, 0.0, 0.0)); count];
        let run = |count, outcome| ChainRun { entries: at(count), times_s: vec![1.0; count], outcome };
        let runs = [run(2, LegOutcome::Done), run(2, LegOutcome::Contact), run(1, LegOutcome::TimedOut)];
        let tally = |episodes, successes| Tally { episodes, successes };
        assert_eq!(tallies(&runs, 2), [tally(3, 2), tally(2, 1)]);
    }
}
