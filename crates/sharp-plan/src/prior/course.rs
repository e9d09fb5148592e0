//! What a prior is trained on: a few legs in a row, of many plans in many maps.
//!
//! An episode begins somewhere in a plan and runs on over the hand-overs: what counts is not to
//! finish a leg but to arrive so that the next can be driven as well.

use std::sync::Arc;

use rand::RngExt;
use sharp_guide::{ShapedReward, StepEvents};
use sharp_rl::{Environment, EnvironmentSpec, Step};
use sharp_sim::{KinematicSim, NoiseModel, RobotState, Vehicle};
use sharp_space::{Seed, Stream};

use crate::certify::{Certificate, Trial};
use crate::leg::{Leg, LegId};
use crate::percept::{Expectation, Percept, Tracker, Workspace};
use crate::planner::{Abstraction, Planner, Query, SearchSettings};
use crate::policy::{Form, GuideView, OptionPolicy};
use crate::prior::form;
use crate::rollout::Driver;
use crate::starts::{StartSpread, Starts};

/// Legs that an episode runs through at most.
const LEGS_MAX: usize = 3;
/// Start states kept of each leg.
const START_POOL: usize = 48;
/// Strength of the noises trained with, as shares of the built-in ones.
const STRENGTHS: std::ops::Range<f64> = 0.5..1.1;
/// Reward of a contact at no and at full caution.
const CONTACT: [f64; 2] = [-3.0, -20.0];

/// A plan in a map: legs that follow one another, and where each may begin.
#[derive(Clone, Debug)]
pub struct Course {
    workspace: Workspace,
    legs: Vec<Arc<Leg>>,
    starts: Vec<Starts>,
}

impl Course {
    /// Number of legs.
    #[must_use]
    pub fn len(&self) -> usize {
        self.legs.len()
    }

    /// Returns true if it has no legs; no planned course is.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.legs.is_empty()
    }

    /// What `policy` holds on each leg under `noise`.
    #[must_use]
    pub fn certify(
        &self,
        policy: &OptionPolicy,
        noise: &NoiseModel,
        episodes: u32,
        seed: Seed,
    ) -> Vec<Certificate> {
        let trial = Trial { workspace: &self.workspace, noise, episodes, seed };
        let next = |index: usize| self.legs.get(index + 1).map(AsRef::as_ref);
        let legs = self.legs.iter().zip(&self.starts).enumerate();
        legs.map(|(index, (leg, starts))| trial.of_leg(&Driver::new(leg, policy, next(index)), starts))
            .collect()
    }
}

/// The plans for `queries` in one map. Queries without a plan are left out.
#[must_use]
pub fn courses(
    workspace: &Workspace,
    abstraction: &Abstraction,
    queries: &[Query],
    seed: Seed,
) -> Vec<Course> {
    let settings = SearchSettings { passing: false, ..SearchSettings::new(workspace) };
    let course = |query: &Query| {
        let mut planner = Planner::new(workspace, abstraction, settings, *query, [], seed).ok()?;
        let legs = planner.plan(&|_| None, &())?;
        let starts = legs.iter().map(|leg| starts(workspace, leg, query, seed)).collect();
        Some(Course { workspace: workspace.clone(), legs, starts })
    };
    queries.iter().filter_map(course).collect()
}

fn starts(workspace: &Workspace, leg: &Leg, query: &Query, seed: Seed) -> Starts {
    match leg.id {
        LegId::First(_) | LegId::Direct => Starts::exactly(RobotState::at_rest(query.start)),
        LegId::Option(_) | LegId::Last(..) => {
            Starts::spread(workspace, leg, &StartSpread::default(), START_POOL, seed)
        }
    }
}

/// Driving through parts of courses as a Markov decision process for [`sharp_rl`].
#[derive(Clone, Debug)]
pub struct CourseTask {
    courses: Arc<Vec<Course>>,
    noises: Arc<Vec<NoiseModel>>,
    seed: Seed,
    now: Option<Episode>,
}

/// An episode under way.
#[derive(Clone, Debug)]
struct Episode {
    course: usize,
    leg: usize,
    last: usize,
    form: Form,
    reward: ShapedReward,
    vehicle: Vehicle<KinematicSim>,
    percept: Percept,
    tracker: Tracker,
    actions: u32,
}

impl CourseTask {
    /// A task on `courses` under `noises`, some of each; episodes draw their noise from `seed`.
    ///
    /// # Panics
    /// If there are no courses or no noises.
    #[must_use]
    pub fn new(courses: Arc<Vec<Course>>, noises: Arc<Vec<NoiseModel>>, seed: Seed) -> Self {
        assert!(!courses.is_empty() && !noises.is_empty(), "a task needs courses and noises");
        Self { courses, noises, seed, now: None }
    }

    fn begin(&self, rng: &mut Stream) -> Episode {
        let course = rng.random_range(0..self.courses.len());
        let Course { workspace, legs, starts } = &self.courses[course];
        let leg = rng.random_range(0..legs.len());
        let last = (leg + LEGS_MAX).min(legs.len()) - 1;
        let noise = &self.noises[rng.random_range(0..self.noises.len())];
        let noise = noise.scaled(rng.random_range(STRENGTHS));
        let caution: f64 = rng.random();
        let form = form(&workspace.robot, Expectation::new(&noise, caution as f32));
        let contact = CONTACT[0] + (CONTACT[1] - CONTACT[0]) * caution;
        let reward = ShapedReward { contact, success: 1.0, stray: 0.0, ..ShapedReward::default() };
        let state = starts[leg].draw(rng);
        let mut vehicle = crate::learn::kinematic_vehicle(workspace, &noise, true);
        vehicle.reset(state, self.seed, rng.random());
        let percept = Percept::first(state, &noise).without_belief();
        let tracker = Tracker::start(&legs[leg].guide, &state.pose);
        Episode { course, leg, last, form, reward, vehicle, percept, tracker, actions: 0 }
    }
}

impl Episode {
    fn view<'a>(&self, legs: &'a [Arc<Leg>]) -> GuideView<'a> {
        GuideView { guide: &legs[self.leg].guide, next: legs.get(self.leg + 1).map(|leg| &leg.guide) }
    }

    fn observe(&self, course: &Course, observation: &mut [f32]) {
        let view = self.view(&course.legs);
        self.form.observe(&course.workspace, &self.percept, &self.tracker, &view, observation);
    }

    fn step(&mut self, course: &Course, action: &[f32]) -> Step {
        let legs = &course.legs;
        let pose = self.percept.state.pose;
        let view = self.view(legs);
        let command = self.form.waypoint(&course.workspace.robot, &pose, &self.tracker, &view, action);
        let report = self.vehicle.act_at(command.to_world(&pose), command.speed_mps);
        self.percept = self.percept.next(&course.workspace, command, report.after);
        let (before, pose) = (self.tracker, self.percept.state.pose);
        self.tracker.update(&legs[self.leg].guide, &pose);
        self.actions += 1;
        let done = !report.contact && legs[self.leg].is_done(&pose);
        let events = StepEvents { success: done, contact: report.contact, stray: false };
        let deviation_m = self.tracker.cross_track_m.abs() - before.cross_track_m.abs();
        let reward = self.reward.value(self.tracker.arc_m - before.arc_m, deviation_m, events);
        let success = done && self.leg == self.last;
        let late = self.actions >= legs[self.leg].horizon_actions(crate::SLOWEST_REACH_M);
        if done && !success {
            self.leg += 1;
            self.tracker = Tracker::start(&legs[self.leg].guide, &pose);
            self.actions = 0;
        }
        let terminated = success || report.contact;
        Step { reward: reward as f32, terminated, truncated: !terminated && !done && late, success }
    }
}

impl Environment for CourseTask {
    fn spec(&self) -> EnvironmentSpec {
        EnvironmentSpec { observation_len: crate::percept::GUIDE_OBSERVATION_LEN, action_len: 2 }
    }

    fn reset(&mut self, rng: &mut Stream, observation: &mut [f32]) {
        let episode = self.begin(rng);
        episode.observe(&self.courses[episode.course], observation);
        self.now = Some(episode);
    }

    fn step(&mut self, action: &[f32], observation: &mut [f32]) -> Step {
        let episode = self.now.as_mut().expect("reset comes before step");
        let course = &self.courses[episode.course];
        let step = episode.step(course, action);
        episode.observe(course, observation);
        step
    }
}
