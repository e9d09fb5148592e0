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
    /// Arc length of the guide from which on the leg counts as done, metres; infinite where only its
    /// termination set ends it.
    pub until_m: f64,
}

impl<'a> Driver<'a> {
    /// Drives `leg` by `policy` to its end; `next` is the leg after it.
    #[must_use]
    pub fn new(leg: &'a Leg, policy: &'a OptionPolicy, next: Option<&'a Leg>) -> Self {
        Self { leg, policy, next: next.map(|next| &next.guide), until_m: f64::INFINITY }
    }

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
            if self.leg.is_done(&percept.state.pose) || tracker.arc_m >= self.until_m {
                outcome = LegOutcome::Done;
                break;
            }
            let command = self.policy.decide(workspace, &percept, &tracker, &self.view(), scratch);
            let report = vehicle.act_at(command.to_world(&percept.state.pose), command.speed_mps);
            time_s += report.time_s;
            path_m += report.path_m;
            percept = percept.next(workspace, command, report.after);
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
    let mut percept = Percept::first(start, vehicle.noise());
    if !drivers.iter().any(|driver| driver.policy.believes()) {
        percept = percept.without_belief();
    }
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

#[cfg(test)]
mod tests {
    use sharp_options::OptionKind;
    use sharp_sim::NoiseModel;
    use sharp_space::Seed;

    use super::*;
    use crate::drawn::plan;

    #[test]
    fn without_noise_a_chain_of_followers_holds_and_ends_at_the_goal() {
        for kind in [OptionKind::Centroid, OptionKind::Interface] {
            let plan = plan(kind);
            let legs = &plan.solution.legs;
            let drivers: Vec<Driver<'_>> =
                legs.iter().map(|planned| Driver::new(&planned.leg, &planned.learnt.policy, None)).collect();
            let start = RobotState::at_rest(plan.solution.query.start);
            let mut vehicle = crate::learn::kinematic_vehicle(&plan.workspace, &NoiseModel::none(), true);
            vehicle.reset(start, Seed(1), 0);
            let run =
                drive_chain(&plan.workspace, &mut vehicle, start, &drivers, &mut DecisionScratch::default());
            assert_eq!(run.outcome, LegOutcome::Done, "{kind:?}: {run:?}");
            assert!((0..legs.len()).all(|index| run.passed(index)), "{kind:?}: every leg held");
            let end = vehicle.state().pose;
            assert!(end.distance_m(&plan.solution.query.goal) < 0.4, "{kind:?} ends at {end:?}");
            let time_s: f64 = run.times_s.iter().sum();
            assert!((10.0..40.0).contains(&time_s), "{kind:?}: 8 m in {time_s} s");
        }
    }

    #[test]
    fn a_leg_counts_as_passed_only_if_the_next_was_begun_or_the_goal_reached() {
        let entries = vec![RobotState::at_rest(sharp_space::Pose::new(0.0, 0.0, 0.0)); 2];
        for (outcome, passed) in
            [(LegOutcome::Done, [true, true, false]), (LegOutcome::Contact, [true, false, false])]
        {
            let run = ChainRun { entries: entries.clone(), times_s: vec![1.0; 2], outcome };
            assert_eq!([0, 1, 2].map(|index| run.passed(index)), passed, "{outcome:?}");
        }
    }
}
