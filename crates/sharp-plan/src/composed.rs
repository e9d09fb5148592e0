//! The composed policy Π: an automaton whose state is the option that is running.
//!
//! `Π(x) = π_i(x)` in controller state `q_i`, and `q_i → q_{i+1}` as soon as `x ∈ I_{o_{i+1}}`. The paper's
//! automaton ends there. With recovery, a robot that strays, stands still or takes too long is
//! placed again by α(x), and a new plan leads on from where it is with the policies at hand.

use std::collections::BTreeMap;
use std::sync::Arc;

use sharp_sim::RobotState;
use sharp_space::Point;

use crate::learn::LearningMode;
use crate::leg::{Leg, LegId};
use crate::percept::{Percept, Tracker};
use crate::plan::Plan;
use crate::planner::{Planner, Query, SearchSettings};
use crate::policy::{DecisionScratch, Follower, GuideView, OptionPolicy, PolarWaypoint};

/// Actions outside the allowed states and off the guide before recovery begins: a few are noise.
const STRAY_ACTIONS_MAX: u32 = 4;
/// A robot nearer to its guide than this is on its way, whatever state it is in, metres.
const OFF_GUIDE_M: f64 = 0.6;
/// Actions over which standing still is judged.
const STILL_ACTIONS: u32 = 10;
/// A robot that moved less than this over [`STILL_ACTIONS`], and turned less than
/// [`STILL_TURN_RAD`], stands still, metres.
const STILL_M: f64 = 0.1;
const STILL_TURN_RAD: f64 = 0.3;
/// Recoveries before the policy gives up.
const RECOVERIES_MAX: u32 = 10;

/// What the composed policy wants.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Decision {
    /// Drive to this point next, at this speed (metres per second).
    Waypoint(Point, f64),
    /// The same, just after a new plan was made.
    Recovering(Point, f64),
    /// The goal is reached.
    Reached,
    /// No plan leads on from here.
    Lost,
}

/// Counts of what went otherwise than planned.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Events {
    /// Actions that ended outside the allowed states.
    pub strays: u32,
    /// New plans made on the way.
    pub recoveries: u32,
}

/// A plan that is being run.
#[derive(Debug)]
pub struct ComposedPolicy {
    plan: Arc<Plan>,
    recovery: bool,
    legs: Vec<(Arc<Leg>, Arc<OptionPolicy>)>,
    current: usize,
    percept: Percept,
    tracker: Tracker,
    actions: u32,
    stray_actions: u32,
    anchor: (RobotState, u32),
    events: Events,
    scratch: DecisionScratch,
}

impl ComposedPolicy {
    /// The composed policy of `plan` for a robot in `state`.
    #[must_use]
    pub fn new(plan: Arc<Plan>, state: RobotState, recovery: bool) -> Self {
        let of = |planned: &crate::sharp::PlannedLeg| {
            (Arc::clone(&planned.leg), Arc::new(planned.learnt.policy.clone()))
        };
        let legs: Vec<_> = plan.solution.legs.iter().map(of).collect();
        let tracker = Tracker::start(&legs[0].0.guide, &state.pose);
        let percept = Percept::first(state, &plan.noise);
        Self {
            plan,
            recovery,
            legs,
            current: 0,
            percept,
            tracker,
            actions: 0,
            stray_actions: 0,
            anchor: (state, 0),
            events: Events::default(),
            scratch: DecisionScratch::default(),
        }
    }

    /// The leg that is running.
    #[must_use]
    pub fn leg(&self) -> &Leg {
        &self.legs[self.current].0
    }

    /// What went otherwise than planned so far.
    #[must_use]
    pub const fn events(&self) -> Events {
        self.events
    }

    /// What to do next.
    pub fn decide(&mut self) -> Decision {
        if !self.advance() {
            return Decision::Reached;
        }
        let in_trouble = self.stray_actions >= STRAY_ACTIONS_MAX || self.stands_still() || self.is_overdue();
        let recovering = in_trouble && self.recovery;
        if in_trouble && (!self.recovery || !self.recover()) {
            // Without recovery the automaton drives on while straying; it only ends when time is up.
            if self.recovery || self.is_overdue() {
                return Decision::Lost;
            }
        }
        let command = self.command();
        self.percept.last_command = command;
        let waypoint = command.to_world(&self.percept.state.pose);
        if recovering {
            Decision::Recovering(waypoint, command.speed_mps)
        } else {
            Decision::Waypoint(waypoint, command.speed_mps)
        }
    }

    /// Tells the policy where its last waypoint brought the robot.
    pub fn observe(&mut self, after: RobotState) {
        let (leg, _) = &self.legs[self.current];
        self.percept = self.percept.next(&self.plan.workspace, self.percept.last_command, after);
        self.tracker.update(&leg.guide, &after.pose);
        self.actions += 1;
        if leg.is_allowed(&after.pose) {
            self.stray_actions = 0;
        } else {
            self.stray_actions += u32::from(self.tracker.cross_track_m.abs() > OFF_GUIDE_M);
            self.events.strays += 1;
        }
        let (anchor, since) = self.anchor;
        let turned = anchor.pose.heading.turn_to(after.pose.heading).abs();
        let moved = anchor.pose.distance_m(&after.pose) > STILL_M || turned > STILL_TURN_RAD;
        self.anchor = if moved { (after, 0) } else { (anchor, since + 1) };
    }

    /// `q_i → q_{i+1}` while the robot is in the next initiation set; false at the goal.
    fn advance(&mut self) -> bool {
        while self.legs[self.current].0.is_done(&self.percept.state.pose) {
            if self.current + 1 == self.legs.len() {
                return false;
            }
            self.enter(self.current + 1);
        }
        true
    }

    fn enter(&mut self, index: usize) {
        self.current = index;
        self.tracker = Tracker::start(&self.legs[index].0.guide, &self.percept.state.pose);
        (self.actions, self.stray_actions) = (0, 0);
        self.anchor = (self.percept.state, 0);
    }

    fn command(&mut self) -> PolarWaypoint {
        let (leg, policy) = &self.legs[self.current];
        let next = self.legs.get(self.current + 1).map(|(leg, _)| &leg.guide);
        let view = GuideView { guide: &leg.guide, next };
        policy.decide(&self.plan.workspace, &self.percept, &self.tracker, &view, &mut self.scratch)
    }

    const fn stands_still(&self) -> bool {
        self.anchor.1 >= STILL_ACTIONS
    }

    fn is_overdue(&self) -> bool {
        self.actions > self.leg().horizon_actions(crate::SLOWEST_REACH_M)
    }

    /// α(x) again, and a plan from here with the policies at hand; legs without one are followed slowly.
    fn recover(&mut self) -> bool {
        if self.events.recoveries >= RECOVERIES_MAX {
            return false;
        }
        self.events.recoveries += 1;
        let plan = Arc::clone(&self.plan);
        let query = Query { start: self.percept.state.pose, goal: plan.solution.query.goal };
        let passing = plan.learning != LearningMode::Paper;
        let settings = SearchSettings { passing, ..SearchSettings::new(&plan.workspace) };
        let known: BTreeMap<LegId, &crate::sharp::PlannedLeg> = plan
            .solution
            .legs
            .iter()
            .filter(|planned| matches!(planned.leg.id, LegId::Option(_) | LegId::Last(..)))
            .map(|planned| (planned.leg.id, planned))
            .collect();
        let guides = known.iter().map(|(&id, planned)| (id, planned.leg.guide.clone()));
        let seed = plan.seed.child("recovery", u64::from(self.events.recoveries));
        let Ok(mut planner) = Planner::new(&plan.workspace, &plan.abstraction, settings, query, guides, seed)
        else {
            return false;
        };
        let cost = |id: LegId| known.get(&id).map(|planned| planned.learnt.cost_s(plan.failure_cost_s));
        let Some(legs) = planner.plan(&cost, &()) else { return false };
        let cautious = Arc::new(OptionPolicy::Follower(Follower::cautious(&plan.workspace.robot)));
        self.legs = legs
            .into_iter()
            .map(|leg| {
                let learnt = known.get(&leg.id).map(|planned| Arc::new(planned.learnt.policy.clone()));
                (leg, learnt.unwrap_or_else(|| Arc::clone(&cautious)))
            })
            .collect();
        self.enter(0);
        self.advance()
    }
}

#[cfg(test)]
mod tests {
    use sharp_options::OptionKind;
    use sharp_space::Pose;

    use super::*;
    use crate::drawn::plan;

    fn at(x: f64, y: f64) -> RobotState {
        RobotState::at_rest(Pose::new(x, y, 0.0))
    }

    /// Carries a robot from waypoint to waypoint and returns the legs it ran, in order.
    fn carry(policy: &mut ComposedPolicy, mut state: RobotState) -> (Decision, Vec<String>) {
        let mut legs = vec![policy.leg().id.to_string()];
        for _ in 0..500 {
            let decision = policy.decide();
            legs.push(policy.leg().id.to_string());
            match decision {
                Decision::Waypoint(point, _) | Decision::Recovering(point, _) => {
                    let towards = point - state.pose.position;
                    state = RobotState::at_rest(Pose::new(point.x, point.y, towards.y.atan2(towards.x)));
                    policy.observe(state);
                }
                Decision::Reached | Decision::Lost => {
                    legs.dedup();
                    return (decision, legs);
                }
            }
        }
        panic!("no end after 500 decisions, legs {legs:?}");
    }

    #[test]
    fn the_automaton_runs_its_legs_in_order_to_the_goal() {
        for (kind, expected) in [
            (OptionKind::Centroid, &["first:0", "c:0-1", "c:1-2", "last:2"][..]),
            (OptionKind::Interface, &["first:0", "i:0-1-2", "last:1"][..]),
        ] {
            for recovery in [false, true] {
                let start = at(1.0, 2.2);
                let mut policy = ComposedPolicy::new(plan(kind), start, recovery);
                let (end, legs) = carry(&mut policy, start);
                assert_eq!(end, Decision::Reached, "{kind:?}");
                assert_eq!(legs, expected, "{kind:?}");
                assert_eq!(policy.events(), Events::default(), "{kind:?}: all went as planned");
            }
        }
    }

    #[test]
    fn an_initiation_set_is_entered_at_once_and_those_passed_by_are_skipped() {
        let mut policy = ComposedPolicy::new(plan(OptionKind::Centroid), at(1.0, 2.2), false);
        policy.decide();
        let second = policy.plan.solution.legs[1].leg.target.center();
        policy.observe(at(second.x, second.y));
        policy.decide();
        assert_eq!(policy.leg().id.to_string(), "first:0", "I of the first option was not reached");
        let first = policy.plan.solution.legs[0].leg.target.center();
        policy.observe(at(first.x, first.y));
        policy.decide();
        assert_eq!(policy.leg().id.to_string(), "c:0-1", "x is in the first option's I");
    }

    #[test]
    fn a_robot_that_is_carried_off_gets_a_new_plan_only_with_recovery() {
        for recovery in [false, true] {
            let mut policy = ComposedPolicy::new(plan(OptionKind::Centroid), at(1.0, 2.2), recovery);
            policy.decide();
            // Into the last region's state, far from the first guide.
            for index in 0..STRAY_ACTIONS_MAX {
                policy.observe(at(8.2 + 0.2 * f64::from(index), 1.0));
            }
            let decision = policy.decide();
            let recovered = matches!(decision, Decision::Recovering(..));
            assert_eq!(recovered, recovery, "{decision:?}");
            assert_eq!(policy.events().strays, STRAY_ACTIONS_MAX, "each stray counts");
            assert_eq!(policy.events().recoveries, u32::from(recovery), "new plans");
            let from = policy.leg().from;
            let expected = if recovery { 2 } else { 0 };
            assert_eq!(from.0, expected, "the leg that runs leaves the state the robot is in, with recovery");
        }
    }

    #[test]
    fn a_robot_that_never_moves_is_given_up() {
        for (recovery, recoveries) in [(false, 0), (true, RECOVERIES_MAX)] {
            let mut policy = ComposedPolicy::new(plan(OptionKind::Centroid), at(1.0, 2.2), recovery);
            let mut decisions = 0;
            while policy.decide() != Decision::Lost {
                policy.observe(at(1.0, 2.2));
                decisions += 1;
                assert!(decisions < 1000, "never given up");
            }
            assert_eq!(policy.events().recoveries, recoveries, "with recovery: {recovery}");
        }
    }
}
