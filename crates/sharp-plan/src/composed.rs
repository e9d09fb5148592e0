//! The composed policy Π: an automaton whose state is the option that is running.
//!
//! `Π(x) = π_i(x)` in controller state `q_i`, and `q_i → q_{i+1}` as soon as `x ∈ I_{o_{i+1}}`. The paper's automaton
//! ends there. With recovery, a robot that strays, stands still or takes too long is placed again by α(x), and a
//! new plan leads on from where it is with the policies at hand.

use std::collections::BTreeMap;
use std::sync::Arc;

use sharp_drive::{
    Automaton, Command, Controller, Decision, Link, Motion, Observation, OptionPolicy, Policy, Prior,
    StandstillDetector,
};
use sharp_guide::{GuidedOption, LegId, end_in_passing};
use sharp_sim::RobotState;
use sharp_space::Point;

use crate::plan_file::Plan;
use crate::query::Query;
use crate::search::Search;
use crate::verify::PlannedOption;

/// Actions outside the allowed states and off the guide before recovery begins: a few are noise.
const STRAY_ACTIONS_MAX: u32 = 4;
/// A robot nearer to its guide than this has not strayed, whatever state it is in, metres.
const OFF_GUIDE_M: f64 = 0.6;
/// New plans around one place before the policy gives up.
const RECOVERIES_MAX: u32 = 10;
/// A robot this far from where it last got a new plan has moved on, metres.
const MOVED_ON_M: f64 = 3.0;

/// Counts of what went otherwise than planned.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub struct Events {
    /// Actions that ended outside the allowed states.
    pub strays: u32,
    /// New plans made on the way.
    pub recoveries: u32,
}

/// A plan that is being run: a [`Controller`] for a simulator or, line by line, for a robot outside.
#[derive(Debug)]
pub struct ComposedPolicy {
    plan: Arc<Plan>,
    recovery: bool,
    automaton: Automaton,
    /// One for each option of the automaton.
    policies: Vec<OptionPolicy>,
    /// Options whose policy knows that it was entered.
    entered: usize,
    stray_actions: u32,
    still: StandstillDetector,
    /// The robot has met an obstacle in this episode.
    has_collided: bool,
    /// The last decision came with a new plan.
    is_recovering: bool,
    /// New plans around one place.
    tries: u32,
    /// Where the last of them was made.
    tried_at: Point,
    events: Events,
}

impl ComposedPolicy {
    /// The composed policy of `plan` for a robot in `state`.
    #[must_use]
    pub fn new(plan: Arc<Plan>, state: RobotState, recovery: bool) -> Self {
        let options: Vec<_> = plan.solution.steps.iter().map(|step| Arc::clone(&step.option)).collect();
        let policies = plan.solution.steps.iter().map(|step| step.learnt.policy.clone()).collect();
        let observation = Observation::first(state, &plan.noise);
        let automaton = Automaton::new(Link::chain(&options).into(), observation);
        Self {
            plan,
            recovery,
            automaton,
            policies,
            entered: 0,
            stray_actions: 0,
            still: StandstillDetector::new(state.pose),
            has_collided: false,
            is_recovering: false,
            tries: 0,
            tried_at: state.pose.position,
            events: Events::default(),
        }
    }

    /// The plan that it drives.
    pub(crate) fn plan(&self) -> &Plan {
        &self.plan
    }

    /// The composed policy of `plan` for a robot that comes to `state` from another plan: it may stand beside the guide and
    /// look elsewhere, so there is a new way from where it is, if there is one.
    pub(crate) fn arriving(plan: Arc<Plan>, state: RobotState, recovery: bool) -> Self {
        let mut this = Self::new(plan, state, recovery);
        this.begin_anew();
        this
    }

    /// The robot was carried to `state`: there is a new way from there. False if there is none.
    pub(crate) fn relocate(&mut self, state: RobotState) -> bool {
        *self = Self { events: self.events, ..Self::new(Arc::clone(&self.plan), state, self.recovery) };
        let is_found = self.begin_anew();
        self.events.recoveries += u32::from(is_found);
        is_found
    }

    /// The option that is running.
    #[must_use]
    pub fn option(&self) -> &GuidedOption {
        &self.automaton.link().option
    }

    /// What went otherwise than planned so far.
    #[must_use]
    pub const fn events(&self) -> Events {
        self.events
    }

    /// How far it is: the number of the leg that runs, from 0, and the share of its guide that is driven.
    #[must_use]
    pub fn progress(&self) -> (usize, f64) {
        let share = self.automaton.progress().arc_m / self.option().guide.length_m();
        (self.automaton.index(), share.clamp(0.0, 1.0))
    }

    /// Returns true if the last decision came with a new plan.
    #[must_use]
    pub const fn is_recovering(&self) -> bool {
        self.is_recovering
    }

    /// What the robot knows of itself.
    #[must_use]
    pub const fn observation(&self) -> &Observation {
        self.automaton.observation()
    }

    /// `q_i → q_{i+1}` while the robot is in the next initiation set; false at the goal.
    fn advance(&mut self) -> bool {
        let before = self.automaton.index();
        let runs = self.automaton.advance();
        if self.automaton.index() != before {
            self.begin_option();
        }
        runs
    }

    fn begin_option(&mut self) {
        self.stray_actions = 0;
        self.still = StandstillDetector::new(self.automaton.observation().state.pose);
    }

    /// The decision of the option's policy, whether or not its end is reached.
    pub(crate) fn drive(&mut self) -> Decision {
        if let Some(decision) = self.automaton.maneuver(&self.plan.world) {
            return decision;
        }
        let (index, situation) = (self.automaton.index(), self.automaton.situation(&self.plan.world));
        let policy = &mut self.policies[index];
        if self.entered <= index {
            self.entered = index + 1;
            policy.enter(&situation);
        }
        let command = policy.decide(&situation);
        // Simulated robots keep to their top speed by themselves. One outside does what it is told.
        let speed_mps = command.speed_mps.min(self.plan.world.robot.max_speed_mps);
        Decision::Drive(Command { speed_mps, ..command })
    }

    /// A new plan from here; false if there is none, or too many were made.
    fn recover(&mut self) -> bool {
        let place = self.automaton.observation().state.pose.position;
        if (place - self.tried_at).norm() > MOVED_ON_M {
            self.tries = 0;
        }
        if self.tries >= RECOVERIES_MAX {
            return false;
        }
        self.tries += 1;
        self.tried_at = place;
        self.events.recoveries += 1;
        self.begin_anew()
    }

    /// Drives on by a new plan from here; false if there is none.
    fn begin_anew(&mut self) -> bool {
        let Some((options, policies)) = self.replan() else { return false };
        let observation = *self.automaton.observation();
        self.automaton = Automaton::new(Link::chain(&options).into(), observation);
        (self.policies, self.entered) = (policies, 0);
        self.begin_option();
        true
    }

    /// α(x) again, and a plan with the policies at hand; the prior drives options without one.
    fn replan(&self) -> Option<(Vec<Arc<GuidedOption>>, Vec<OptionPolicy>)> {
        let plan = &*self.plan;
        let query = Query { start: self.automaton.observation().state.pose, goal: plan.solution.query.goal };
        let known: BTreeMap<LegId, &PlannedOption> =
            plan.solution.steps.iter().map(|step| (step.option.id, step)).collect();
        // Those from the start begin elsewhere now: their policies are at hand, their guides and costs are not.
        let is_kept = |id: &LegId| matches!(id, LegId::Option(_) | LegId::Last(..));
        let kept = known.iter().filter(|(id, _)| is_kept(id));
        let guides = kept.map(|(&id, step)| (id, step.option.guide.clone()));
        let seed = plan.seed.child("recovery", u64::from(self.events.recoveries));
        let mut search =
            Search::new(&plan.world, &plan.abstraction, &plan.method, &plan.noise, query, guides, seed)
                .ok()?;
        if known.contains_key(&LegId::Direct) {
            search.offer_direct();
        }
        let measured = |id: LegId| known.get(&id).filter(|_| is_kept(&id)).map(|step| step.learnt.estimate);
        let (_, mut options) = search.plan(&measured, &())?;
        if plan.method.join_guides {
            end_in_passing(&mut options);
        }
        let caution = Prior::caution(&plan.world.robot, plan.method.failure_cost_s);
        let prior = || plan.world.prior().at(caution, &plan.world.robot, &plan.noise);
        let policy = |option: &Arc<GuidedOption>| {
            known.get(&option.id).map_or_else(prior, |step| step.learnt.policy.clone())
        };
        let policies = options.iter().map(policy).collect();
        Some((options, policies))
    }
}

impl Controller for ComposedPolicy {
    fn decide(&mut self) -> Decision {
        self.is_recovering = false;
        if !self.advance() {
            return Decision::Reached;
        }
        let is_late = self.automaton.is_late();
        if self.stray_actions < STRAY_ACTIONS_MAX && !self.still.stands_still() && !is_late {
            return self.drive();
        }
        if !self.recovery {
            // The paper's automaton drives on while it strays; it only ends when time is up.
            return if is_late { Decision::Lost } else { self.drive() };
        }
        if !self.recover() {
            return Decision::Lost;
        }
        if !self.advance() {
            return Decision::Reached;
        }
        self.is_recovering = true;
        // Out of contact first: a forward-only robot with its nose at a wall cannot turn.
        let departs = self.automaton.link().option.departure.back_off_m > 0.0;
        let has_collided = std::mem::take(&mut self.has_collided);
        if has_collided && !departs && self.plan.world.robot.recovery_reverse_m > 0.0 {
            return Decision::BackOff { distance_m: self.plan.world.robot.recovery_reverse_m };
        }
        self.drive()
    }

    fn observe(&mut self, motion: &Motion) {
        self.automaton.observe(&self.plan.world, motion);
        self.has_collided |= motion.contact && motion.command.is_some();
        let pose = &motion.after.pose;
        self.still.observe(pose);
        if self.automaton.link().option.is_allowed(pose) {
            self.stray_actions = 0;
        } else {
            let is_off = self.automaton.progress().cross_track_m.abs() > OFF_GUIDE_M;
            self.stray_actions += u32::from(is_off);
            self.events.strays += 1;
        }
    }
}

#[cfg(test)]
mod tests {
    use sharp_options::OptionKind;
    use sharp_space::{Pose, trig};

    use super::*;
    use crate::test_worlds::plan;

    fn at(x: f64, y: f64) -> RobotState {
        RobotState::at_rest(Pose::new(x, y, 0.0))
    }

    /// The robot is in `state` after the last command.
    fn arrive(policy: &mut ComposedPolicy, state: RobotState) {
        let command = policy.observation().last_command;
        policy.observe(&Motion::commanded(command, state));
    }

    /// Carries a robot from waypoint to waypoint and returns the options it ran, in order.
    fn carry(policy: &mut ComposedPolicy, mut state: RobotState) -> (Decision, Vec<String>) {
        let mut legs = vec![policy.option().id.to_string()];
        for _ in 0..500 {
            let decision = policy.decide();
            legs.push(policy.option().id.to_string());
            match decision {
                Decision::Drive(command) => {
                    let point = command.to_world(&state.pose);
                    let towards = point - state.pose.position;
                    state =
                        RobotState::at_rest(Pose::new(point.x, point.y, trig::atan2(towards.y, towards.x)));
                    arrive(policy, state);
                }
                Decision::BackOff { .. } => panic!("nobody met a wall"),
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
        let second = policy.plan.solution.steps[1].option.target.center();
        arrive(&mut policy, at(second.x, second.y));
        policy.decide();
        assert_eq!(policy.option().id.to_string(), "first:0", "I of the first option was not reached");
        let first = policy.plan.solution.steps[0].option.target.center();
        arrive(&mut policy, at(first.x, first.y));
        policy.decide();
        assert_eq!(policy.option().id.to_string(), "c:0-1", "x is in the first option's I");
    }

    #[test]
    fn a_robot_that_is_carried_off_gets_a_new_plan_only_with_recovery() {
        for recovery in [false, true] {
            let mut policy = ComposedPolicy::new(plan(OptionKind::Centroid), at(1.0, 2.2), recovery);
            policy.decide();
            // Into the last region's state, far from the first guide.
            for index in 0..STRAY_ACTIONS_MAX {
                arrive(&mut policy, at(8.2 + 0.2 * f64::from(index), 1.0));
            }
            let decision = policy.decide();
            let recovered = policy.is_recovering();
            assert_eq!(recovered, recovery, "{decision:?}");
            assert_eq!(policy.events().strays, STRAY_ACTIONS_MAX, "each stray counts");
            assert_eq!(policy.events().recoveries, u32::from(recovery), "new plans");
            let from = policy.option().from;
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
                arrive(&mut policy, at(1.0, 2.2));
                decisions += 1;
                assert!(decisions < 1000, "never given up");
            }
            assert_eq!(policy.events().recoveries, recoveries, "with recovery: {recovery}");
        }
    }
}
