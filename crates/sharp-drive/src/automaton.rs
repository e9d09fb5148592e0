//! The automaton of a chain of guided options: `q_i → q_{i+1}` as soon as `x ∈ I_{o_{i+1}}`.
//!
//! It keeps the books of an episode: which option runs, what the robot knows, where it is on the guide, how long
//! each option took. It does not move a robot, so that it serves a simulator and a real robot alike.

use std::sync::Arc;

use sharp_guide::{Departure, GuidePath, GuidedOption};
use sharp_sim::RobotState;

use crate::departure::{careful, turning};
use crate::episode::{Decision, Motion};
use crate::situation::{GuideProgress, GuideView, Observation, Situation};
use crate::world::World;

/// A guided option in a chain.
#[derive(Clone, Debug)]
pub struct Link {
    /// The option.
    pub option: Arc<GuidedOption>,
    /// The option after it, where it is known: policies look ahead into its guide.
    pub next: Option<Arc<GuidedOption>>,
    /// Arc length of the guide from which on the option counts as done, metres; infinite where only its
    /// termination set ends it.
    pub until_m: f64,
}

impl Link {
    /// `option`, with `next` after it.
    #[must_use]
    pub const fn new(option: Arc<GuidedOption>, next: Option<Arc<GuidedOption>>) -> Self {
        Self { option, next, until_m: f64::INFINITY }
    }

    /// The links of options that follow one another.
    pub fn chain(options: &[Arc<GuidedOption>]) -> Vec<Self> {
        let next = |index: usize| options.get(index + 1).cloned();
        options.iter().enumerate().map(|(index, option)| Self::new(Arc::clone(option), next(index))).collect()
    }

    /// Its guide, and the one after it where it is known.
    #[must_use]
    pub fn guide(&self) -> GuideView<'_> {
        let next: Option<&GuidePath> = self.next.as_deref().map(|next| &next.guide);
        GuideView { current: &self.option.guide, next }
    }
}

/// One option of an episode: how it was entered, and how long it has run.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Visit {
    /// The state in which it was entered.
    pub entry: RobotState,
    /// Simulated time since then, seconds.
    pub time_s: f64,
    /// The part of it until the middle of the guide was passed, seconds; `None` before that.
    pub half_s: Option<f64>,
}

/// The state of a chain of options that is being executed.
#[derive(Clone, Debug)]
pub struct Automaton {
    links: Arc<[Link]>,
    visits: Vec<Visit>,
    observation: Observation,
    progress: GuideProgress,
    actions: u32,
    /// How many of the actions do not count, because a speed limit made them short.
    spared: f64,
}

impl Automaton {
    /// The automaton at the beginning of `links`, for a robot that knows `observation`.
    ///
    /// # Panics
    /// If there are no links.
    #[must_use]
    pub fn new(links: Arc<[Link]>, observation: Observation) -> Self {
        assert!(!links.is_empty(), "a chain has options");
        let progress = GuideProgress::default();
        let mut this = Self { links, visits: Vec::new(), observation, progress, actions: 0, spared: 0.0 };
        this.enter();
        this
    }

    /// The link that runs.
    #[must_use]
    pub fn link(&self) -> &Link {
        &self.links[self.index()]
    }

    /// The number of the link that runs, from 0.
    #[must_use]
    pub fn index(&self) -> usize {
        self.visits.len() - 1
    }

    /// All links.
    #[must_use]
    pub const fn links(&self) -> &Arc<[Link]> {
        &self.links
    }

    /// The options entered so far.
    #[must_use]
    pub fn visits(&self) -> &[Visit] {
        &self.visits
    }

    /// What the robot knows of itself.
    #[must_use]
    pub const fn observation(&self) -> &Observation {
        &self.observation
    }

    /// Where the robot is on the guide.
    #[must_use]
    pub const fn progress(&self) -> &GuideProgress {
        &self.progress
    }

    /// What a policy sees.
    #[must_use]
    pub fn situation<'a>(&'a self, world: &'a World) -> Situation<'a> {
        let Self { observation, progress, .. } = self;
        Situation { world, observation, progress, guide: self.link().guide() }
    }

    /// Returns true if the option that runs is done, or has passed its termination set on the way into the next one.
    #[must_use]
    pub fn is_done(&self) -> bool {
        let Link { option, next, until_m } = self.link();
        let pose = &self.observation.state.pose;
        let is_passed = |next: &Arc<GuidedOption>| option.is_passed(pose, self.progress.remaining_m, next);
        option.is_done(pose) || self.progress.arc_m >= *until_m || next.as_ref().is_some_and(is_passed)
    }

    /// Goes on to the next option while the one that runs is done; returns false if the last one is.
    pub fn advance(&mut self) -> bool {
        while self.is_done() {
            if self.visits.len() == self.links.len() {
                return false;
            }
            self.enter();
        }
        true
    }

    /// Takes in what came of an action.
    pub fn observe(&mut self, world: &World, motion: &Motion) {
        self.observation = self.observation.after(world, motion);
        let index = self.index();
        let (guide, pose) = (&self.links[index].option.guide, &motion.after.pose);
        self.progress.update(guide, pose);
        let visit = &mut self.visits[index];
        visit.time_s += motion.time_s;
        if visit.half_s.is_none() && self.progress.arc_m >= 0.5 * guide.length_m() {
            visit.half_s = Some(visit.time_s);
        }
        self.actions += 1;
        self.spared += 1.0 - world.action_share(motion.after.pose.position);
    }

    /// What the robot has to do that no policy does: leave the tight place in which the plan begins, and turn in place at a
    /// goal that asks for a heading. `None` where a policy drives.
    #[must_use]
    pub fn maneuver(&self, world: &World) -> Option<Decision> {
        let Departure { back_off_m, careful_m } = self.link().option.departure;
        if self.actions == 0 && back_off_m > 0.0 {
            return Some(Decision::BackOff { distance_m: back_off_m });
        }
        if self.progress.arc_m < careful_m {
            return Some(Decision::Drive(careful(&self.situation(world))));
        }
        let (pose, goal) = (&self.observation.state.pose, self.link().option.target.goal()?);
        let turns = world.robot.can_turn_in_place() && goal.contains(pose.position);
        let turn_rad = goal.turn_left_rad(pose);
        (turns && turn_rad != 0.0).then(|| Decision::Drive(turning(turn_rad)))
    }

    /// Returns true if the option that runs has used up its horizon.
    #[must_use]
    pub fn is_late(&self) -> bool {
        self.actions() >= self.link().option.horizon_actions()
    }

    /// Actions since the option that runs was entered, as they count against its horizon: where the robot or a speed limit is
    /// slow, less than one each.
    #[must_use]
    pub const fn actions(&self) -> u32 {
        self.actions - self.spared as u32
    }

    fn enter(&mut self) {
        let state = self.observation.state;
        let guide = &self.links[self.visits.len()].option.guide;
        self.progress = GuideProgress::start(guide, &state.pose);
        self.visits.push(Visit { entry: state, time_s: 0.0, half_s: None });
        (self.actions, self.spared) = (0, 0.0);
    }
}
