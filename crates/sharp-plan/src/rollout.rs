//! Driving one leg, or a whole chain of them, in a simulator.

use sharp_guide::GuidePath;
use sharp_sim::{RobotState, Simulator, Vehicle};

use crate::leg::Leg;
use crate::percept::{Percept, Tracker, Workspace};
use crate::policy::{DecisionScratch, GuideView, OptionPolicy};

/// How a leg ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LegOutcome {
    /// The termination set was reached.
    Done,
    /// The footprint touched a wall.
    Contact,
    /// The horizon ran out.
    TimedOut,
}

/// The end of one leg.
#[derive(Clone, Copy, Debug)]
pub struct LegEnd {
    /// How it ended.
    pub outcome: LegOutcome,
    /// What the robot knew at the end.
    pub percept: Percept,
    /// Simulated time, seconds.
    pub time_s: f64,
    /// Distance driven, metres.
    pub path_m: f64,
    /// Actions that ended outside the allowed states.
    pub stray_actions: u32,
}

/// A leg and the policy that drives it.
#[derive(Clone, Copy, Debug)]
pub struct Driver<'a> {
    /// The leg.
    pub leg: &'a Leg,
    /// Its policy.
    pub policy: &'a OptionPolicy,
    /// The guide of the leg after it.
    pub next: Option<&'a GuidePath>,
}

impl Driver<'_> {
    fn view(&self) -> GuideView<'_> {
        GuideView { guide: &self.leg.guide, next: self.next }
    }

    /// Drives until the leg is done, touches a wall or has used `horizon` actions.
    pub fn drive<S: Simulator>(
        &self,
        workspace: &Workspace,
        vehicle: &mut Vehicle<S>,
        mut percept: Percept,
        horizon: u32,
        scratch: &mut DecisionScratch,
    ) -> LegEnd {
        let mut tracker = Tracker::start(&self.leg.guide, &percept.state.pose);
        let (mut time_s, mut path_m, mut stray_actions) = (0.0, 0.0, 0);
        let mut outcome = LegOutcome::TimedOut;
        for _ in 0..=horizon {
            if self.leg.is_done(&percept.state.pose) {
                outcome = LegOutcome::Done;
                break;
            }
            let command = self.policy.decide(workspace, &percept, &tracker, &self.view(), scratch);
            let report = vehicle.act_at(command.to_world(&percept.state.pose), command.speed_mps);
            time_s += report.time_s;
            path_m += report.path_m;
            percept = percept.next(command, report.after);
            tracker.update(&self.leg.guide, &percept.state.pose);
            stray_actions += u32::from(!self.leg.is_allowed(&percept.state.pose));
            if report.contact {
                outcome = LegOutcome::Contact;
                break;
            }
        }
        LegEnd { outcome, percept, time_s, path_m, stray_actions }
    }
}

/// What happened on one run through a chain of legs.
#[derive(Clone, Debug)]
pub struct ChainRun {
    /// The state in which each leg was entered; as many as legs were begun.
    pub entries: Vec<RobotState>,
    /// Simulated time of each leg begun, seconds.
    pub times_s: Vec<f64>,
    /// How the last leg begun ended.
    pub outcome: LegOutcome,
}

impl ChainRun {
    /// Returns true if leg number `index` was begun and ended in its termination set.
    #[must_use]
    pub fn passed(&self, index: usize) -> bool {
        index + 1 < self.entries.len()
            || (index + 1 == self.entries.len() && self.outcome == LegOutcome::Done)
    }
}

/// Drives `drivers` one after the other from `start`: the automaton `q_i → q_{i+1}` without recovery.
pub fn drive_chain<S: Simulator>(
    workspace: &Workspace,
    vehicle: &mut Vehicle<S>,
    start: RobotState,
    drivers: &[Driver<'_>],
    scratch: &mut DecisionScratch,
) -> ChainRun {
    let mut run = ChainRun { entries: vec![], times_s: vec![], outcome: LegOutcome::Done };
    let mut percept = Percept::first(start);
    for driver in drivers {
        run.entries.push(percept.state);
        let horizon = driver.leg.horizon_actions(crate::SLOWEST_REACH_M);
        let end = driver.drive(workspace, vehicle, percept, horizon, scratch);
        run.times_s.push(end.time_s);
        run.outcome = end.outcome;
        percept = end.percept;
        if end.outcome != LegOutcome::Done {
            break;
        }
    }
    run
}
