//! Several goals in a row: one plan for each, driven one after the other.
//!
//! Each plan begins where the guide of the one before it ends, so a robot that has reached a goal drives on to that place.
//! Where it comes to stand elsewhere, the way from there is planned anew. How often the whole succeeds is counted on fresh
//! runs from the first start to the last goal.

use std::fmt;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use sharp_drive::{
    Command, Controller, Decision, Episode, EpisodeEnd, EpisodeRules, Motion, SuccessCount, SuccessEstimate,
    Supervisor, TIME_LIMIT_MIN_S,
};
use sharp_guide::GuidedOption;
use sharp_sim::{ActionSettings, RobotState, Simulator};
use sharp_space::{Heading, OccupancyGrid, Point, Pose, Seed};

use crate::composed::{ComposedPolicy, Events};
use crate::execute::{Execution, RunSettings, TIME_LIMIT_FACTOR, rules};
use crate::files::{self, FileError};
use crate::plan_file::{PLAN_FILE, Plan};

pub(crate) const TOUR_FILE: &str = "tour.ron";
/// A robot drives on to the end of the guide after it has reached a goal that is not the last, until it is this near, metres,
/// or gets no nearer, or for so many actions: the next plan begins there.
const END_WITHIN_M: f64 = 0.1;
const ACTIONS_TO_END_MAX: u32 = 8;
/// Its speed there, metres per second, at most.
const APPROACH_MPS: f64 = 0.3;
/// Distance between two tests of the outline on the way there, metres.
const CHECK_STEP_M: f64 = 0.05;
/// Where it is then nearer to the start of the next plan than this, metres and radians, that plan holds as it is.
const START_WITHIN: (f64, f64) = (0.25, 0.4);
/// Most runs that a prediction is counted on: each plans anew at every goal, which takes far longer than driving.
const VERIFIED_MAX: u32 = 200;
/// More plans in a row are a broken file.
const PLANS_MAX: usize = 1000;

/// Plans that are driven one after the other, at least one.
#[derive(Clone, Debug)]
pub struct Tour {
    /// The plans, each from where the one before it ends.
    pub plans: Vec<Arc<Plan>>,
    /// Fresh runs through all of them, without recovery and without contact.
    pub predicted: SuccessCount,
    /// Mean simulated time of the successful ones, seconds; 0 without any.
    pub predicted_time_s: f64,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct TourFile {
    plans: usize,
    predicted: SuccessCount,
    predicted_time_s: f64,
}

impl From<Arc<Plan>> for Tour {
    fn from(plan: Arc<Plan>) -> Self {
        let (predicted, predicted_time_s) = (plan.solution.predicted, plan.solution.predicted_time_s);
        Self { plans: vec![plan], predicted, predicted_time_s }
    }
}

impl Tour {
    /// Runs `plans` from end to end in forks of `simulator`, as many times as their method verifies plans, at most 200; 200
    /// times where it verifies none.
    ///
    /// # Panics
    /// If there is no plan.
    #[must_use]
    pub fn verified(plans: Vec<Arc<Plan>>, simulator: &dyn Simulator) -> Self {
        let first = plans.first().expect("a tour has a plan");
        // Plans that were not run say nothing of the hand-overs between them, so the tour is run.
        let episodes = match first.method.verify_episodes {
            0 => VERIFIED_MAX,
            wanted => wanted.min(VERIFIED_MAX),
        };
        let settings = RunSettings {
            episodes,
            simulator: simulator.fork(),
            noise: first.noise.clone(),
            recovery: false,
            contact_ends: true,
            time_limit_s: f64::INFINITY,
            seed: first.seed.child("tour", plans.len() as u64),
        };
        let tour = Self { plans, predicted: SuccessCount::default(), predicted_time_s: 0.0 };
        let runs = tour.drive(&settings, EpisodeRules::default(), &|| 0.0);
        let runs = runs.iter().map(|run| (run.end == EpisodeEnd::Reached, run.record.time_s));
        let SuccessEstimate { count, mean_time_s } = SuccessEstimate::of(runs);
        let predicted_time_s = if mean_time_s.is_finite() { mean_time_s } else { 0.0 };
        Self { predicted: count, predicted_time_s, ..tour }
    }

    /// The predicted chance of success: composed where the plan was not run, else the share of its runs.
    #[must_use]
    pub fn predicted_success(&self) -> f64 {
        match &self.plans[..] {
            [plan] => plan.solution.success(),
            _ => self.predicted.rate(),
        }
    }

    /// The lower end of the two-sided 95 % interval of that chance.
    #[must_use]
    pub fn predicted_lower95(&self) -> f64 {
        match &self.plans[..] {
            [plan] => plan.solution.composed.as_ref().map_or(self.predicted.lower95(), |odds| odds.lower95),
            _ => self.predicted.lower95(),
        }
    }

    /// `episodes` of the tour as the project measures them: see [`RunSettings::new`].
    #[must_use]
    pub fn run_settings(&self, episodes: u32, seed: Seed) -> RunSettings {
        let time_limit_s = (TIME_LIMIT_FACTOR * self.predicted_time_s).max(TIME_LIMIT_MIN_S);
        RunSettings { time_limit_s, ..RunSettings::new(&self.plans[0], episodes, seed) }
    }

    /// Runs the tour; `clock_us` tells the wall time in microseconds. Executions come in order.
    #[must_use]
    pub fn run(&self, settings: &RunSettings, clock_us: &(dyn Fn() -> f64 + Sync)) -> Vec<Execution> {
        self.drive(settings, rules(settings).with_trace(), clock_us)
    }

    fn drive(
        &self,
        settings: &RunSettings,
        rules: EpisodeRules,
        clock_us: &(dyn Fn() -> f64 + Sync),
    ) -> Vec<Execution> {
        let supervisor = Supervisor { clock_us, ..Supervisor::silent() };
        self.episodes(settings, rules, |mut episode, mut policy| {
            let end = episode.drive(&mut policy, &supervisor);
            Execution { end, record: episode.into_record(), events: policy.events() }
        })
    }

    /// Begins all episodes of `settings`, lets `drive` end each of them, and returns what it made of them, in order.
    pub(crate) fn episodes<T: Send>(
        &self,
        settings: &RunSettings,
        rules: EpisodeRules,
        drive: impl Fn(Episode, TourPolicy) -> T + Sync,
    ) -> Vec<T> {
        let first = &self.plans[0];
        let vehicle = first.world.vehicle(&*settings.simulator, &settings.noise, settings.contact_ends);
        let episode = Episode::new(vehicle, rules);
        let start = RobotState::at_rest(first.solution.query.start);
        let begin = |number: u32| {
            let mut episode = episode.clone();
            episode.begin(start, settings.seed, u64::from(number));
            drive(episode, TourPolicy::new(self.plans.clone(), start, settings.recovery))
        };
        (0..settings.episodes).into_par_iter().map(begin).collect()
    }

    /// The folder of plan number `index` of the tour in `folder`.
    #[must_use]
    pub fn plan_folder(folder: &Path, index: usize) -> PathBuf {
        folder.join(format!("goal-{}", index + 1))
    }

    /// Returns true if `folder` holds a plan or a tour.
    #[must_use]
    pub fn is_in(folder: &Path) -> bool {
        [TOUR_FILE, PLAN_FILE].iter().any(|file| folder.join(file).exists())
    }

    /// Removes the tour in `folder`, if there is one, so that the plans in its folders may be replaced.
    ///
    /// # Errors
    /// Returns an error that names the file that could not be removed.
    pub fn remove(folder: &Path) -> Result<(), FileError> {
        files::remove(&folder.join(TOUR_FILE))
    }

    /// Writes what is not in the plans' own folders into `folder`, in place of any plan there.
    ///
    /// # Errors
    /// Returns an error that names the file that could not be written.
    pub fn save(&self, folder: &Path) -> Result<(), FileError> {
        let Self { plans, predicted, predicted_time_s } = self;
        let (predicted, predicted_time_s) = (*predicted, *predicted_time_s);
        let file = TourFile { plans: plans.len(), predicted, predicted_time_s };
        files::write_ron(&folder.join(TOUR_FILE), &file)?;
        files::remove(&folder.join(PLAN_FILE))
    }

    /// Reads the plan or the tour in `folder`, made in `grid`.
    ///
    /// # Errors
    /// Returns an error that names the file that is missing, damaged, of another format or for another map.
    pub fn load(folder: &Path, grid: &OccupancyGrid) -> Result<Self, FileError> {
        let path = folder.join(TOUR_FILE);
        if !path.exists() {
            return Ok(Arc::new(Plan::load(folder, grid.clone())?).into());
        }
        let TourFile { plans, predicted, predicted_time_s } = files::read_ron(&path)?;
        if !(1..=PLANS_MAX).contains(&plans) {
            return Err(FileError::content(&path, format!("plans is {plans}, expected 1 to {PLANS_MAX}")));
        }
        let load = |index| Plan::load(&Self::plan_folder(folder, index), grid.clone()).map(Arc::new);
        let plans = (0..plans).map(load).collect::<Result<_, _>>()?;
        Ok(Self { plans, predicted, predicted_time_s })
    }
}

/// Where a plan that follows `plan` begins: at the end of its last guide.
#[must_use]
pub fn end_of(plan: &Plan) -> Pose {
    let last = plan.solution.steps.last().and_then(|step| step.option.guide.poses().last().copied());
    last.unwrap_or(plan.solution.query.start)
}

/// A tour that is being driven: the policy of one plan after the other.
pub struct TourPolicy {
    /// The plans that come after the one that runs, the next one last.
    to_come: Vec<Arc<Plan>>,
    current: ComposedPolicy,
    recovery: bool,
    /// What went otherwise than planned in the plans before.
    before: Events,
    /// Actions since the present goal was reached, and the least distance from the end of the guide, metres.
    since_reached: (u32, f64),
}

impl fmt::Debug for TourPolicy {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("TourPolicy").field("to_come", &self.to_come.len()).finish_non_exhaustive()
    }
}

impl TourPolicy {
    /// The policy of `plans` for a robot in `state`.
    ///
    /// # Panics
    /// If there is no plan.
    #[must_use]
    pub fn new(mut plans: Vec<Arc<Plan>>, state: RobotState, recovery: bool) -> Self {
        plans.reverse();
        let first = plans.pop().expect("a tour has a plan");
        let current = begin(first, state, recovery);
        Self {
            to_come: plans,
            current,
            recovery,
            before: Events::default(),
            since_reached: (0, f64::INFINITY),
        }
    }

    /// The option that is running.
    #[must_use]
    pub fn option(&self) -> &GuidedOption {
        self.current.option()
    }

    /// Whether a robot that has reached its present goal still comes nearer to the end of the guide.
    fn is_nearing_the_end(&mut self) -> bool {
        let end = self.current.option().guide.end();
        let off_m = self.current.observation().state.pose.distance_m(&end);
        let (actions, least_m) = self.since_reached;
        self.since_reached = (actions + 1, off_m.min(least_m));
        self.has_room_to(end.position)
            && off_m > END_WITHIN_M
            && off_m < least_m
            && actions < ACTIONS_TO_END_MAX
    }

    /// Whether the robot fits all along the straight line to `place`, with a margin. Else the next plan begins where it stands.
    fn has_room_to(&self, place: Point) -> bool {
        let (world, at) = (&self.current.plan().world, self.current.observation().state.pose.position);
        let heading = Heading::of(place - at);
        world.guide_robot().inflated_at(None).next().is_some_and(|robot| {
            robot.geometry.is_segment_free(Pose::at(at, heading), Pose::at(place, heading), CHECK_STEP_M)
        })
    }

    /// Slowly to the end of the guide, so that the robot stands there as the next plan supposes.
    fn approach(&self) -> Command {
        let pose = &self.current.observation().state.pose;
        let end = self.current.option().guide.end().position;
        let command = Command::of(pose, end, 0.0);
        let world = &self.current.plan().world;
        let slowly_mps = APPROACH_MPS.min(world.robot.max_speed_mps);
        let speed_mps = (command.reach_m / (2.0 * ActionSettings::default().action_s)).min(slowly_mps);
        world.held(pose, Command { speed_mps, ..command })
    }

    /// How far the present plan is: the number of its leg, from 0, and the share of its guide that is driven.
    #[must_use]
    pub fn progress(&self) -> (usize, f64) {
        self.current.progress()
    }

    /// The robot was carried to `state`: it drives to its present goal from there. False if no way leads there.
    pub(crate) fn relocate(&mut self, state: RobotState) -> bool {
        self.since_reached = (0, f64::INFINITY);
        self.current.relocate(state)
    }

    /// Goals that come after the present one.
    #[must_use]
    pub const fn goals_to_come(&self) -> usize {
        self.to_come.len()
    }

    /// Returns true if the last decision came with a new plan.
    #[must_use]
    pub const fn is_recovering(&self) -> bool {
        self.current.is_recovering()
    }

    /// What went otherwise than planned so far.
    #[must_use]
    pub const fn events(&self) -> Events {
        let now = self.current.events();
        Events {
            strays: self.before.strays + now.strays,
            recoveries: self.before.recoveries + now.recoveries,
        }
    }
}

/// The policy of `plan` for a robot in `state`, which finds its own way where that is not the plan's start.
fn begin(plan: Arc<Plan>, state: RobotState, recovery: bool) -> ComposedPolicy {
    let start = plan.solution.query.start;
    let (within_m, within_rad) = START_WITHIN;
    let is_there = state.pose.distance_m(&start) < within_m
        && state.pose.heading.turn_to(start.heading).abs() < within_rad;
    let begin = if is_there { ComposedPolicy::new } else { ComposedPolicy::arriving };
    begin(plan, state, recovery)
}

impl Controller for TourPolicy {
    fn decide(&mut self) -> Decision {
        loop {
            let decision = self.current.decide();
            if decision != Decision::Reached {
                return decision;
            }
            let Some(next) = self.to_come.last().cloned() else { return decision };
            if self.is_nearing_the_end() {
                return Decision::Drive(self.approach());
            }
            self.to_come.pop();
            self.before = self.events();
            self.since_reached = (0, f64::INFINITY);
            let state = self.current.observation().state;
            self.current = begin(next, state, self.recovery);
        }
    }

    fn observe(&mut self, motion: &Motion) {
        self.current.observe(motion);
    }
}

#[cfg(test)]
mod tests {
    use sharp_options::OptionKind;
    use sharp_sim::SimulatorKind;

    use super::*;
    use crate::execute::success;
    use crate::test_worlds::plan;

    fn twice() -> Tour {
        // Both drive the same way: after the first, the robot has to come back to the start of the guide.
        let plan = plan(OptionKind::Centroid);
        let simulator = plan.world.simulator(SimulatorKind::Kinematic);
        let mut short = (*plan).clone();
        short.method = short.method.with_episodes(50, 50, 50);
        Tour::verified(vec![Arc::new(short), plan], &*simulator)
    }

    #[test]
    fn a_tour_of_plans_that_were_not_run_is_run() {
        let plan = Plan::clone(&plan(OptionKind::Centroid));
        let simulator = plan.world.simulator(SimulatorKind::Kinematic);
        let plan = Arc::new(Plan { method: plan.method.clone().composed(), ..plan });
        let tour = Tour::verified(vec![Arc::clone(&plan), plan], &*simulator);
        assert_eq!(tour.predicted, SuccessCount { episodes: VERIFIED_MAX, successes: VERIFIED_MAX });
        assert!(tour.predicted_time_s > 5.0, "8 m and back in {} s", tour.predicted_time_s);
    }

    #[test]
    fn one_plan_is_a_tour_that_runs_as_the_plan_does() {
        let plan = plan(OptionKind::Interface);
        let settings = RunSettings::new(&plan, 5, Seed(3));
        let alone = crate::execute::run(&plan, &settings, &|| 0.0);
        let tour = Tour::from(plan);
        let same = tour.run(&tour.run_settings(5, Seed(3)), &|| 0.0);
        let traces = |runs: &[Execution]| runs.iter().map(|run| run.record.trace.clone()).collect::<Vec<_>>();
        assert_eq!(traces(&alone), traces(&same));
    }

    #[test]
    fn the_second_plan_begins_where_the_first_ends() {
        let tour = twice();
        assert_eq!(
            tour.predicted,
            SuccessCount { episodes: 50, successes: 50 },
            "as many runs as the method says"
        );
        let runs = tour.run(&tour.run_settings(3, Seed(1)), &|| 0.0);
        let alone = Tour::from(Arc::clone(&tour.plans[0])).run(&tour.run_settings(3, Seed(1)), &|| 0.0);
        assert_eq!(success(&alone).successes, 3, "one plan holds without noise");
        for (run, alone) in runs.iter().zip(&alone) {
            let shared = alone.record.trace.len();
            assert!(run.record.trace.len() >= shared, "it goes on where one plan ends");
            assert_eq!(run.record.trace[..shared], alone.record.trace[..], "the same first part");
        }
    }
}
