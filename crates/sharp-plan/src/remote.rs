//! Driving a robot outside this program: poses in, waypoints out.

use std::sync::Arc;

use sharp_drive::{Command, Controller, Decision, Motion, World};
use sharp_guide::LegId;
use sharp_sim::{ActionSettings, Drive, RobotModel, RobotState};
use sharp_space::{Heading, Pose, Vector, trig};

use crate::plan_file::Plan;
use crate::tour::TourPolicy;

/// Backing off ends this much before its distance, metres: the robot rolls on.
const BACKED_OFF_WITHIN_M: f64 = 0.02;
/// Backing off is given up after so many times the actions that it should take: something is in the way.
const PATIENCE: f64 = 3.0;

/// A robot that moved more than this many times as far as its top speed allows did not drive there: its place jumped, which
/// says nothing of its speed.
const DRIVEN_FACTOR: f64 = 2.0;
/// Where its place jumped by this much more, metres, it was carried, or wrong about its place before, and gets a new plan.
/// A plan bears shorter jumps, because localisation is not exact.
const CARRIED_M: f64 = 0.5;
/// A robot that was lost is looked at again once it has moved further than this, metres, or turned further, radians.
pub const MOVED: (f64, f64) = (0.1, 0.2);
/// What a slower car turns says little of how it steers, metres per second.
const STEERS_FROM_MPS: f64 = 0.1;

/// What a robot outside tells of itself.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Reading {
    /// Where it is.
    pub pose: Pose,
    /// Its forward speed, metres per second; taken from the last two poses where it is not told.
    pub speed_mps: Option<f64>,
    /// Its yaw rate, radians per second; taken likewise.
    pub yaw_rate_radps: Option<f64>,
}

/// How a robot outside is doing.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum RemoteStatus {
    /// It follows the plan.
    Running,
    /// It has a new plan, because the old one did not lead on.
    Recovering,
    /// It is at the goal.
    Reached,
    /// No way leads on.
    Lost,
}

impl RemoteStatus {
    /// Its name in answers.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Running => "running",
            Self::Recovering => "recovering",
            Self::Reached => "reached",
            Self::Lost => "lost",
        }
    }
}

/// What a robot outside has to do until its next pose.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instruction {
    /// Where to drive; `None` for a stop.
    pub waypoint: Option<Pose>,
    /// How fast, metres per second; negative for backwards.
    pub speed_mps: f64,
    /// The option that runs.
    pub option: LegId,
    /// How it is doing.
    pub status: RemoteStatus,
}

/// Drives a robot outside through plans, one answer for each pose.
#[derive(Debug)]
pub struct RemoteDriver {
    policy: TourPolicy,
    state: RobotState,
    pending: Pending,
    recovery: bool,
    robot: Arc<RobotModel>,
    /// Where no way led on; somewhere else there may be one.
    lost_at: Option<Pose>,
}

/// The last answer, until its outcome is known.
#[derive(Clone, Copy, Debug)]
enum Pending {
    Nothing,
    Stand,
    Command(Command),
    BackOff { from: Pose, distance_m: f64, actions: u32 },
}

impl Reading {
    /// The state of `robot`, if it was in the state `before` one action ago: motion that was not told is taken from there.
    #[must_use]
    pub fn state(&self, robot: &RobotModel, before: Option<&RobotState>) -> RobotState {
        let mut state = RobotState::at_rest(self.pose);
        let action_s = ActionSettings::default().action_s;
        let is_driven =
            |before: &&RobotState| before.pose.distance_m(&self.pose) < driven_max_m(robot, action_s);
        if let Some(before) = before.filter(is_driven) {
            state.velocity = before.pose.to_local(self.pose.position) / action_s;
            state.yaw_rate_radps = before.pose.heading.turn_to(self.pose.heading) / action_s;
        }
        if let Some(speed_mps) = self.speed_mps {
            state.velocity = Vector::new(speed_mps, 0.0);
        }
        state.yaw_rate_radps = self.yaw_rate_radps.unwrap_or(state.yaw_rate_radps);
        // A reading does not say how the wheels roll; take the motion of the body.
        state.wheel_speed_mps = state.velocity.x;
        match robot.drive {
            Drive::Differential { .. } => state.wheel_yaw_rate_radps = state.yaw_rate_radps,
            Drive::Ackermann { wheelbase_m, max_steer_rad, .. } => {
                let curve = wheelbase_m * state.yaw_rate_radps;
                let speed_mps = state.velocity.x.abs().max(STEERS_FROM_MPS);
                let steer_rad = trig::atan2(curve, speed_mps) * state.velocity.x.signum();
                state.steer_rad = steer_rad.clamp(-max_steer_rad, max_steer_rad);
            }
        }
        state
    }
}

impl RemoteDriver {
    /// Drives through `plans`, one after the other, from where the robot is now.
    ///
    /// # Panics
    /// If there is no plan.
    #[must_use]
    pub fn new(plans: Vec<Arc<Plan>>, first: &Reading, recovery: bool) -> Self {
        let robot = Arc::clone(&plans.first().expect("a tour has a plan").world.robot);
        Self::from_state(plans, first.state(&robot, None), recovery)
    }

    /// The same for a robot that is now in `state`.
    ///
    /// # Panics
    /// If there is no plan.
    #[must_use]
    pub fn from_state(plans: Vec<Arc<Plan>>, state: RobotState, recovery: bool) -> Self {
        let robot = Arc::clone(&plans.first().expect("a tour has a plan").world.robot);
        let policy = TourPolicy::new(plans, state, recovery);
        Self { policy, state, pending: Pending::Nothing, recovery, robot, lost_at: None }
    }

    /// How far the plan that runs has come: the number of its leg, from 0, and the share of its guide that is driven.
    #[must_use]
    pub fn progress(&self) -> (usize, f64) {
        self.policy.progress()
    }

    /// What the robot has to do next; it was told to come back after one action.
    pub fn answer(&mut self, reading: &Reading) -> Instruction {
        self.answer_in(reading.state(&self.robot, Some(&self.state)))
    }

    /// The same for a robot that is now in `state`.
    pub fn answer_in(&mut self, state: RobotState) -> Instruction {
        let before = std::mem::replace(&mut self.state, state);
        let action_s = ActionSettings::default().action_s;
        let is_carried =
            before.pose.distance_m(&state.pose) > driven_max_m(&self.robot, action_s) + CARRIED_M;
        let was_moved = self.lost_at.is_some_and(|at| is_elsewhere(&at, &state.pose, MOVED));
        if self.recovery && (is_carried || was_moved) {
            return self.carried();
        }
        if self.lost_at.is_some() {
            return self.lost();
        }
        match self.pending {
            Pending::Nothing => {}
            // The robot may have been moved meanwhile.
            Pending::Stand => self.policy.observe(&stood(state)),
            Pending::Command(command) => self.policy.observe(&Motion::commanded(command, state)),
            Pending::BackOff { from, distance_m, actions } => {
                let driven_m = from.distance_m(&state.pose);
                let actions_max =
                    PATIENCE * distance_m / (self.robot.back_off_mps() * ActionSettings::default().action_s);
                if driven_m < distance_m - BACKED_OFF_WITHIN_M && f64::from(actions) < actions_max {
                    self.pending = Pending::BackOff { from, distance_m, actions: actions + 1 };
                    return self.backwards(distance_m - driven_m);
                }
                self.policy.observe(&stood(state));
            }
        }
        self.decide()
    }

    /// What the robot has to do now that it is somewhere else than its last instruction leads.
    fn carried(&mut self) -> Instruction {
        self.lost_at = None;
        if !self.policy.relocate(RobotState::at_rest(self.state.pose)) {
            return self.lost();
        }
        let told = self.decide();
        let is_new = told.status == RemoteStatus::Running;
        if is_new { Instruction { status: RemoteStatus::Recovering, ..told } } else { told }
    }

    fn decide(&mut self) -> Instruction {
        let state = self.state;
        self.pending = Pending::Nothing;
        match self.policy.decide() {
            Decision::Drive(command) => {
                let point = command.to_world(&state.pose);
                // What is no number moves no robot: simulated ones stop, and others are told to.
                if ![point.x, point.y, command.speed_mps].iter().all(|number| number.is_finite()) {
                    return self.lost();
                }
                self.pending = Pending::Command(command);
                let towards = point - state.pose.position;
                let heading = Heading::new(trig::atan2(towards.y, towards.x));
                self.instruction(Some(Pose::at(point, heading)), command.speed_mps, self.status())
            }
            Decision::BackOff { distance_m } => {
                self.pending = Pending::BackOff { from: state.pose, distance_m, actions: 1 };
                self.backwards(distance_m)
            }
            Decision::Reached => {
                self.pending = Pending::Stand;
                self.instruction(None, 0.0, RemoteStatus::Reached)
            }
            Decision::Lost => self.lost(),
        }
    }

    /// The robot has to stand; if it may recover, until somebody moves it.
    fn lost(&mut self) -> Instruction {
        self.pending = Pending::Stand;
        if self.recovery && self.lost_at.is_none() {
            self.lost_at = Some(self.state.pose);
        }
        self.instruction(None, 0.0, RemoteStatus::Lost)
    }

    const fn status(&self) -> RemoteStatus {
        if self.policy.is_recovering() { RemoteStatus::Recovering } else { RemoteStatus::Running }
    }

    fn backwards(&self, left_m: f64) -> Instruction {
        let pose = self.state.pose;
        let behind = Pose::at(pose.to_world(Vector::new(-left_m, 0.0)), pose.heading);
        self.instruction(Some(behind), -self.robot.back_off_mps(), self.status())
    }

    fn instruction(&self, waypoint: Option<Pose>, speed_mps: f64, status: RemoteStatus) -> Instruction {
        Instruction { waypoint, speed_mps, option: self.policy.option().id, status }
    }
}

/// Returns true if a robot can be at `pose`: its middle is in the free space of the map.
#[must_use]
pub fn is_placed(world: &World, pose: &Pose) -> bool {
    world.grid.frame().cell_at(pose.position).is_some_and(|cell| world.grid.is_free(cell))
}

/// Returns true if `now` is further from `at` than so many metres or radians.
#[must_use]
pub fn is_elsewhere(at: &Pose, now: &Pose, (moved_m, turned_rad): (f64, f64)) -> bool {
    at.distance_m(now) > moved_m || at.heading.turn_to(now.heading).abs() > turned_rad
}

/// The longest way, metres, that `robot` may have driven in an action.
fn driven_max_m(robot: &RobotModel, action_s: f64) -> f64 {
    DRIVEN_FACTOR * robot.max_speed_mps * action_s
}

/// What came of an action that no policy commanded.
fn stood(after: RobotState) -> Motion {
    Motion { command: None, ..Motion::commanded(Command::default(), after) }
}

#[cfg(test)]
mod tests {
    use sharp_drive::{OptionPolicy, Policy, Situation};
    use sharp_guide::Departure;
    use sharp_options::OptionKind;
    use sharp_sim::BACK_OFF_MPS;

    use super::*;
    use crate::test_worlds::plan;

    fn at(x: f64, y: f64) -> Reading {
        Reading { pose: Pose::new(x, y, 0.0), speed_mps: None, yaw_rate_radps: None }
    }

    #[test]
    fn a_plan_that_backs_off_first_is_told_so_until_it_has() {
        let mut plan = (*plan(OptionKind::Centroid)).clone();
        let first = &mut plan.solution.steps[0].option;
        let departure = Departure { back_off_m: 0.3, careful_m: 0.0 };
        *first = Arc::new((**first).clone().with_departure(departure));
        let start = at(1.0, 2.2);
        let mut driver = RemoteDriver::new(vec![Arc::new(plan)], &start, true);
        let answers = [1.0, 0.85, 0.72, 0.7].map(|x| driver.answer(&at(x, 2.2)));
        let speeds = answers.map(|answer| answer.speed_mps);
        assert!(speeds[..2].iter().all(|&speed| speed == -BACK_OFF_MPS), "backwards: {speeds:?}");
        assert!(speeds[2..].iter().all(|&speed| speed > 0.0), "then on: {speeds:?}");
        let behind = answers[1].waypoint.expect("a place behind it");
        assert!((behind.position.x - 0.7).abs() < 1e-9, "so much is left: {behind:?}");
        assert!(answers.iter().all(|answer| answer.status == RemoteStatus::Running), "as planned");
    }

    /// Fuzzing found it: with a number in a plan's file changed, the robot was sent to no place at all.
    #[test]
    fn a_policy_that_decides_no_number_stops_the_robot() {
        #[derive(Clone, Debug)]
        struct Nowhere(f64);
        impl Policy for Nowhere {
            fn decide(&mut self, _: &Situation<'_>) -> Command {
                Command { reach_m: self.0, bearing_rad: 0.0, speed_mps: 0.5 }
            }
        }
        for reach_m in [f64::NAN, f64::INFINITY, 1e308] {
            let mut plan = (*plan(OptionKind::Centroid)).clone();
            plan.solution.steps[0].learnt.policy = OptionPolicy::Custom(Box::new(Nowhere(reach_m)));
            let answer = RemoteDriver::new(vec![Arc::new(plan)], &at(1.0, 2.2), true).answer(&at(1.0, 2.2));
            let is_place = answer.waypoint.is_none_or(|at| at.is_finite());
            assert!(is_place && answer.speed_mps.is_finite(), "{reach_m}: {answer:?}");
            let is_lost = answer.waypoint.is_none() && answer.status == RemoteStatus::Lost;
            assert!(is_lost || reach_m == 1e308, "{reach_m}: {answer:?}");
        }
    }

    #[test]
    fn a_robot_that_is_carried_gets_a_way_from_there_at_once() {
        let plan = plan(OptionKind::Interface);
        let goal = plan.solution.query.goal.position;
        let mut driver = RemoteDriver::new(vec![plan], &at(1.0, 2.2), true);
        assert_eq!(driver.answer(&at(1.0, 2.2)).status, RemoteStatus::Running, "at the start");
        let told = driver.answer(&at(5.0, 2.2));
        assert_eq!(told.status, RemoteStatus::Recovering, "4 m in half a second");
        let ahead = told.waypoint.expect("a way leads on");
        assert!(ahead.distance_m(&Pose::new(5.0, 2.2, 0.0)) < 1.0, "from where it is: {told:?}");
        assert_eq!(driver.answer(&at(goal.x, goal.y)).status, RemoteStatus::Reached, "set down at the goal");
    }

    #[test]
    fn a_robot_that_is_pushed_from_the_goal_drives_back() {
        let plan = plan(OptionKind::Interface);
        let goal = plan.solution.query.goal.position;
        let mut driver = RemoteDriver::new(vec![plan], &at(1.0, 2.2), true);
        driver.answer(&at(1.0, 2.2));
        assert_eq!(driver.answer(&at(goal.x, goal.y)).status, RemoteStatus::Reached);
        let pushed = [0.3, 0.6, 0.9].map(|off| driver.answer(&at(goal.x - off, goal.y)));
        let ahead = pushed[2].waypoint.expect("it is to drive");
        assert!(ahead.position.x > goal.x - 0.9, "back to the goal: {pushed:?}");
        assert_ne!(pushed[2].status, RemoteStatus::Reached);
    }

    #[test]
    fn a_lost_robot_gets_a_way_once_it_was_moved() {
        let mut driver = RemoteDriver::new(vec![plan(OptionKind::Interface)], &at(1.0, 2.2), true);
        // It cannot move: new plans do not help it.
        let answers: Vec<_> = (0..1000).map(|_| driver.answer(&at(1.0, 2.2)).status).collect();
        assert_eq!(answers[999], RemoteStatus::Lost);
        assert_eq!(driver.policy.events().recoveries, 10);
        let told = [1.05, 1.15].map(|x| driver.answer(&at(x, 2.2)));
        assert_eq!(told[0].status, RemoteStatus::Lost, "hardly moved");
        assert_eq!(told[1].status, RemoteStatus::Recovering, "somewhere else: {told:?}");
    }

    #[test]
    fn to_be_set_down_where_no_way_leads_on_uses_nothing_up() {
        let mut driver = RemoteDriver::new(vec![plan(OptionKind::Interface)], &at(1.0, 2.2), true);
        driver.answer(&at(1.0, 2.2));
        let nowhere: Vec<_> = (0..20).map(|i| driver.answer(&at(-50.0 - f64::from(i), 2.2)).status).collect();
        assert!(nowhere.iter().all(|&status| status == RemoteStatus::Lost), "{nowhere:?}");
        assert_eq!(driver.policy.events().recoveries, 0);
        assert_eq!(driver.answer(&at(1.0, 2.2)).status, RemoteStatus::Recovering);
    }

    /// From Python a robot whose pose was inside a wall was told to drive on.
    #[test]
    fn a_robot_can_only_be_in_the_free_space_of_the_map() {
        let plan = plan(OptionKind::Centroid);
        for (x, expected) in [(1.0, true), (0.2, false), (-50.0, false), (1e300, false)] {
            assert_eq!(is_placed(&plan.world, &Pose::new(x, 2.2, 0.0)), expected, "{x}");
        }
    }

    #[test]
    fn a_robot_is_elsewhere_once_it_moved_or_turned() {
        let here = Pose::new(1.0, 2.2, 3.1);
        let cases = [(1.0, 3.1, false), (1.05, 3.2, false), (1.15, 3.1, true), (1.0, -2.9, true)];
        for (x, yaw, expected) in cases {
            assert_eq!(is_elsewhere(&here, &Pose::new(x, 2.2, yaw), MOVED), expected, "{x}, {yaw}");
        }
    }

    #[test]
    fn wheels_roll_and_steer_as_the_body_moves() {
        let reading =
            Reading { pose: Pose::new(0.0, 0.0, 0.0), speed_mps: Some(0.8), yaw_rate_radps: Some(0.5) };
        let husky = reading.state(&RobotModel::husky(), None);
        assert_eq!((husky.wheel_speed_mps, husky.wheel_yaw_rate_radps, husky.steer_rad), (0.8, 0.5, 0.0));
        let limo = RobotModel::limo();
        let Drive::Ackermann { wheelbase_m, .. } = limo.drive else { panic!("a car") };
        let steer_rad =
            |speed_mps| Reading { speed_mps: Some(speed_mps), ..reading }.state(&limo, None).steer_rad;
        assert!((steer_rad(0.8) - trig::atan2(wheelbase_m * 0.5, 0.8)).abs() < 1e-12);
        assert_eq!(steer_rad(-0.8), -steer_rad(0.8), "backwards the same wheels turn it the other way");
        assert!(steer_rad(0.0).is_finite());
    }

    #[test]
    fn a_robot_that_cannot_back_off_is_not_asked_for_ever() {
        let mut plan = (*plan(OptionKind::Centroid)).clone();
        let first = &mut plan.solution.steps[0].option;
        let departure = Departure { back_off_m: 0.3, careful_m: 0.0 };
        *first = Arc::new((**first).clone().with_departure(departure));
        let mut driver = RemoteDriver::new(vec![Arc::new(plan)], &at(1.0, 2.2), true);
        let asked = (0..20).take_while(|_| driver.answer(&at(1.0, 2.2)).speed_mps < 0.0).count();
        assert!((2..10).contains(&asked), "asked {asked} times");
    }
}
