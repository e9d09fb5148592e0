//! THE loop: one robot on its way, action by action.
//!
//! [`Episode::act`] is the only place in this project that steps a vehicle, and [`Episode::drive`] is the only
//! loop around it. Predictions, learning tasks, executions and baselines are all made of these two, so that what
//! is predicted and what is learnt is what runs.
//!
//! The rules, the same for all: an action ends at the first contact if contact ends the episode; then the end is
//! [`EpisodeEnd::Collided`], even within the goal's tolerance. An option may take as many actions as its horizon
//! and not one more. A goal is reached within its tolerance, the border not included (d < t, as in definition 3).

use std::fmt;

use sharp_sim::{ActionReport, EpisodeBias, RobotState};
use sharp_space::{Pose, Seed};

use crate::command::Command;
use crate::world::AnyVehicle;

/// What came of an action.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    /// The command that was carried out; `None` where the robot backed off.
    pub command: Option<Command>,
    /// The state after it.
    pub after: RobotState,
    /// True if the robot was in contact with an obstacle; after backing off: still is.
    pub contact: bool,
    /// Simulated time that it took, seconds.
    pub time_s: f64,
    /// Distance driven, metres.
    pub path_m: f64,
}

impl Motion {
    /// The motion of a robot outside, which nobody measured but its end: `command` led to `after`.
    #[must_use]
    pub const fn commanded(command: Command, after: RobotState) -> Self {
        Self { command: Some(command), after, contact: false, time_s: 0.0, path_m: 0.0 }
    }

    const fn of(command: Option<Command>, report: &ActionReport) -> Self {
        let ActionReport { after, contact, time_s, path_m, .. } = *report;
        Self { command, after, contact, time_s, path_m }
    }
}

/// What a controller wants.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Decision {
    /// Drive towards a waypoint for one action.
    Drive(Command),
    /// Reverse straight, as far as the robot's data allow.
    BackOff {
        /// How far, metres.
        distance_m: f64,
    },
    /// Nothing more: the goal is reached.
    Reached,
    /// Nothing more: no way leads on, or time is up.
    Lost,
}

/// What came of looking for a plan before a decision.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Readiness {
    /// The plan at hand still holds.
    Ready,
    /// There is a new plan; at half the robot's top speed it takes this long, seconds.
    Planned {
        /// Simulated time, seconds.
        nominal_time_s: f64,
    },
}

/// Drives an episode: decides, and is told what came of it. Implement both; planning is for those who plan.
pub trait Controller {
    /// What to do next. It is asked before every action, and once more at the end.
    fn decide(&mut self) -> Decision;

    /// What came of the last decision.
    fn observe(&mut self, motion: &Motion);

    /// Looks at where the robot is and plans where that is due; comes before every decision, and its time is
    /// counted apart from the time of decisions.
    fn prepare(&mut self) -> Readiness {
        Readiness::Ready
    }
}

/// Why an episode ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EpisodeEnd {
    /// At the goal.
    Reached,
    /// At an obstacle.
    Collided,
    /// At the time limit.
    TimedOut,
    /// Where its controller gave up.
    Lost,
    /// Where its supervisor stopped it: it says nothing of the controller.
    Stopped,
}

/// The rules of an episode.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct EpisodeRules {
    /// Whether touching an obstacle ends the episode as a failure; the paper bumps and goes on.
    pub contact_ends: bool,
    /// Simulated time after which the episode fails, seconds; infinite for none.
    pub time_limit_s: f64,
    /// If set, the first plan of the controller sets the time limit: so many times its nominal time, and at least
    /// a minute.
    pub limit_by_plan: Option<f64>,
    /// Whether poses and times of decisions are kept.
    pub keep_trace: bool,
}

impl Default for EpisodeRules {
    /// Contact ends the episode, there is no time limit, and nothing is kept: what predictions need.
    fn default() -> Self {
        Self { contact_ends: true, time_limit_s: f64::INFINITY, limit_by_plan: None, keep_trace: false }
    }
}

impl EpisodeRules {
    /// The rules with contact as the end of an episode, or not.
    #[must_use]
    pub fn with_contact_ends(self, contact_ends: bool) -> Self {
        Self { contact_ends, ..self }
    }

    /// The rules with this time limit, seconds.
    #[must_use]
    pub fn with_time_limit_s(self, time_limit_s: f64) -> Self {
        Self { time_limit_s, ..self }
    }

    /// The rules with a time limit of `factor` times what the controller's first plan takes nominally.
    #[must_use]
    pub fn with_limit_by_plan(self, factor: f64) -> Self {
        Self { limit_by_plan: Some(factor), ..self }
    }

    /// The rules with poses and times kept.
    #[must_use]
    pub fn with_trace(self) -> Self {
        Self { keep_trace: true, ..self }
    }
}

/// Shortest time limit that a plan may set, seconds.
pub const TIME_LIMIT_MIN_S: f64 = 60.0;

/// What happened in an episode.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EpisodeRecord {
    /// Simulated time, seconds.
    pub time_s: f64,
    /// Distance driven, metres.
    pub path_m: f64,
    /// Actions that met an obstacle.
    pub contacts: u32,
    /// Plans that the controller made on the way, the first included.
    pub plans: u32,
    /// The pose after each action, the start first, if traces are kept.
    pub trace: Vec<Pose>,
    /// Wall time of each decision, microseconds, if traces are kept.
    pub decisions_us: Vec<f64>,
    /// Wall time of all planning, microseconds.
    pub planning_us: f64,
}

/// The world outside the simulation: its clock, and its wish to stop.
#[derive(Clone, Copy)]
pub struct Supervisor<'a> {
    /// Wall time, microseconds.
    pub clock_us: &'a (dyn Fn() -> f64 + Sync),
    /// Whether to give up; an episode that runs then ends as [`EpisodeEnd::Stopped`], which says nothing of the controller.
    pub should_stop: &'a (dyn Fn() -> bool + Sync),
}

impl Supervisor<'static> {
    /// No clock, and no wish to stop.
    #[must_use]
    pub fn silent() -> Self {
        Self { clock_us: &|| 0.0, should_stop: &|| false }
    }
}

impl fmt::Debug for Supervisor<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Supervisor").finish_non_exhaustive()
    }
}

/// A robot on its way.
#[derive(Clone, Debug)]
pub struct Episode {
    vehicle: AnyVehicle,
    rules: EpisodeRules,
    record: EpisodeRecord,
}

impl Episode {
    /// An episode that has not begun; `vehicle` ends its actions at contact if `rules` say so.
    #[must_use]
    pub fn new(vehicle: AnyVehicle, rules: EpisodeRules) -> Self {
        Self { vehicle, rules, record: EpisodeRecord::default() }
    }

    /// Begins episode `number` of the noise of `seed`, with the robot in `state`.
    pub fn begin(&mut self, state: RobotState, seed: Seed, number: u64) {
        self.vehicle.reset(state, seed, number);
        self.record = EpisodeRecord::default();
        if self.rules.keep_trace {
            self.record.trace.push(state.pose);
        }
    }

    /// The same with this slip and pull in place of those that are drawn for the episode.
    pub fn begin_with_bias(&mut self, state: RobotState, (seed, number): (Seed, u64), bias: EpisodeBias) {
        self.begin(state, seed, number);
        self.vehicle.set_bias(bias);
    }

    /// The state of the robot.
    #[must_use]
    pub fn state(&self) -> &RobotState {
        self.vehicle.state()
    }

    /// The vehicle.
    #[must_use]
    pub const fn vehicle(&self) -> &AnyVehicle {
        &self.vehicle
    }

    /// What happened so far.
    #[must_use]
    pub const fn record(&self) -> &EpisodeRecord {
        &self.record
    }

    /// What happened so far, taken out.
    #[must_use]
    pub fn into_record(self) -> EpisodeRecord {
        self.record
    }

    /// Carries out one command.
    pub fn act(&mut self, command: Command) -> Motion {
        let waypoint = command.to_world(&self.vehicle.state().pose);
        let report = self.vehicle.act_at(waypoint, command.speed_mps);
        self.note(Motion::of(Some(command), &report))
    }

    /// Reverses straight, as far as the robot's data allow; one that never reverses waits for one action.
    pub fn back_off(&mut self, distance_m: f64) -> Motion {
        let mut motion = Motion::of(None, &self.vehicle.back_off(distance_m));
        if motion.time_s == 0.0 {
            motion.time_s = self.vehicle.settings().action_s;
        }
        self.note(motion)
    }

    /// Carries out what a controller decided, or says how it ended the episode.
    pub(crate) fn carry_out(&mut self, decision: Decision) -> Result<Motion, EpisodeEnd> {
        match decision {
            Decision::Drive(command) => Ok(self.act(command)),
            Decision::BackOff { distance_m } => Ok(self.back_off(distance_m)),
            Decision::Reached => Err(EpisodeEnd::Reached),
            Decision::Lost => Err(EpisodeEnd::Lost),
        }
    }

    fn note(&mut self, motion: Motion) -> Motion {
        let record = &mut self.record;
        record.time_s += motion.time_s;
        record.path_m += motion.path_m;
        let is_new = motion.command.is_some() || self.rules.contact_ends;
        record.contacts += u32::from(motion.contact && is_new);
        if self.rules.keep_trace {
            record.trace.push(motion.after.pose);
        }
        motion
    }

    /// Lets `controller` drive until the episode ends.
    pub fn drive(&mut self, controller: &mut dyn Controller, supervisor: &Supervisor<'_>) -> EpisodeEnd {
        while self.record.time_s < self.rules.time_limit_s {
            if (supervisor.should_stop)() {
                return EpisodeEnd::Stopped;
            }
            let decision = self.decide(controller, supervisor);
            let motion = match self.carry_out(decision) {
                Ok(motion) => motion,
                Err(end) => return end,
            };
            controller.observe(&motion);
            // Where contact ends an episode, nobody backs off from one: it came while backing off.
            if motion.contact && self.rules.contact_ends {
                return EpisodeEnd::Collided;
            }
        }
        EpisodeEnd::TimedOut
    }

    /// Lets `controller` plan and decide, and counts the wall time of both.
    fn decide(&mut self, controller: &mut dyn Controller, supervisor: &Supervisor<'_>) -> Decision {
        let before_us = (supervisor.clock_us)();
        let readiness = controller.prepare();
        let prepared_us = (supervisor.clock_us)();
        if let Readiness::Planned { nominal_time_s } = readiness {
            let is_first = self.record.plans == 0;
            if let Some(factor) = self.rules.limit_by_plan.filter(|_| is_first) {
                self.rules.time_limit_s = (factor * nominal_time_s).max(TIME_LIMIT_MIN_S);
            }
            self.record.plans += 1;
            self.record.planning_us += prepared_us - before_us;
        }
        let decision = controller.decide();
        if self.rules.keep_trace {
            self.record.decisions_us.push((supervisor.clock_us)() - prepared_us);
        }
        decision
    }
}

#[cfg(test)]
mod tests {
    use sharp_sim::{NoiseModel, SimulatorKind};

    use super::*;
    use crate::test_worlds::hall;

    /// Drives straight ahead, and backs off after each contact.
    struct Bull {
        speed_mps: f64,
        bumped: bool,
        backed_off: u32,
    }

    impl Controller for Bull {
        fn decide(&mut self) -> Decision {
            if std::mem::take(&mut self.bumped) {
                self.backed_off += 1;
                return Decision::BackOff { distance_m: 0.4 };
            }
            Decision::Drive(Command { reach_m: 0.5, bearing_rad: 0.0, speed_mps: self.speed_mps })
        }

        fn observe(&mut self, motion: &Motion) {
            self.bumped = motion.contact && motion.command.is_some();
        }

        fn prepare(&mut self) -> Readiness {
            Readiness::Planned { nominal_time_s: 30.0 }
        }
    }

    fn bull(rules: EpisodeRules, speed_mps: f64) -> (EpisodeEnd, EpisodeRecord, u32) {
        let world = hall();
        let simulator = world.simulator(SimulatorKind::Kinematic);
        let vehicle = world.vehicle(&*simulator, &NoiseModel::none(), rules.contact_ends);
        let mut episode = Episode::new(vehicle, rules);
        episode.begin(RobotState::at_rest(Pose::new(7.0, 1.0, 0.0)), Seed(1), 0);
        let mut bull = Bull { speed_mps, bumped: false, backed_off: 0 };
        let end = episode.drive(&mut bull, &Supervisor::silent());
        // Time may be up before it has backed off from its last contact.
        (end, episode.into_record(), bull.backed_off + u32::from(bull.bumped))
    }

    #[test]
    fn a_wall_ends_an_episode_or_is_bumped_into_again() {
        let rules = EpisodeRules::default().with_limit_by_plan(1.0).with_trace();
        let (end, ended, _) = bull(rules.clone(), 1.0);
        assert_eq!((end, ended.contacts), (EpisodeEnd::Collided, 1), "the first contact is the end");
        let (end, bumping, backed_off) = bull(rules.with_contact_ends(false), 1.0);
        assert_eq!(end, EpisodeEnd::TimedOut, "it never learns");
        assert!(bumping.contacts > 5, "it backs off and comes again: {} contacts", bumping.contacts);
        assert_eq!(bumping.contacts, backed_off, "a contact is counted once");
        assert!(bumping.path_m > ended.path_m, "the way back is part of the way");
        assert_eq!(bumping.trace.len(), bumping.decisions_us.len() + 1, "a pose for each decision");
    }

    #[test]
    fn the_first_plan_sets_the_limit_which_is_at_least_a_minute() {
        for (factor, expected_s) in [(1.0, 60.0), (3.0, 90.0)] {
            let (end, record, _) = bull(EpisodeRules::default().with_limit_by_plan(factor), 0.0);
            assert_eq!(end, EpisodeEnd::TimedOut, "it stands still");
            assert!((record.time_s - expected_s).abs() < 0.6, "{} s, expected {expected_s}", record.time_s);
            assert!(record.plans > 100 && record.trace.is_empty(), "plans are counted, nothing is kept");
        }
    }
}
