//! RRT with replanning, executed open-loop: the planning baseline of Sec. 5.
//!
//! The robot is given the points of the planned path one after the other, each until it is there or
//! the time that the plan allots is over, wherever it then is: feedback is the waypoint controller's
//! alone. Where the path ends without the goal being reached, a new one is planned from there.

use sharp_drive::{Command, Controller, Decision, Motion, Readiness, World};
use sharp_guide::GuideRobot;
use sharp_motion::{Path, RrtSettings, ShortcutSettings, Uniform, rrt, shortcut};
use sharp_plan::Query;
use sharp_sim::{ActionSettings, RobotState};
use sharp_space::{Heading, Point, Pose, RobotGeometry, Seed, Vector};

use super::nominal_time_s;
use super::route::RoutePlanner;
use crate::contender::Contender;

/// Distance of the points that the robot is sent to, metres: the farthest that an action may aim at.
const SPACING_M: f64 = 0.5;
/// The same for a car, whose way between them bends.
const CAR_SPACING_M: f64 = 0.3;
/// A point counts as reached within this distance, metres; nearer, a robot turns about to hit it.
const REACHED_M: f64 = 0.25;
/// Speed between points, as a share of the robot's top speed: what the plan's time is counted with.
const CRUISE: f64 = 0.5;
/// A robot that slips gets this many times the planned time to arrive at a point.
const PATIENCE: f64 = 2.0;
/// Speed while turning towards a point, metres per second: next to none, but a robot that is asked
/// for none does not turn.
const TURN_MPS: f64 = 0.02;
/// A turn up to this happens on the way, radians.
const TURN_RAD: f64 = 0.1;

/// The baseline `rrt`: plans anew for each execution.
#[derive(Clone, Debug)]
pub struct Rrt<'a> {
    /// Map and robot.
    pub world: &'a World,
    /// The outlines and turning radii to plan with.
    pub planner: &'a RoutePlanner<'a>,
    /// The problem; the goal's heading is free.
    pub query: Query,
    /// Budget and steps of the planner.
    pub settings: RrtSettings,
    /// Whether touching a wall ends an episode.
    pub contact_ends: bool,
    /// Root of the planner's random streams.
    pub seed: Seed,
}

impl Contender for Rrt<'_> {
    fn controller(&self, start: RobotState, episode: u64) -> Box<dyn Controller + '_> {
        Box::new(RrtController {
            baseline: self,
            seed: self.seed.child("rrt", episode),
            state: start,
            attempts: 0,
            plans: 0,
            hops: vec![],
            next: 0,
            must_back_off: false,
            is_bumped: false,
            is_stuck: false,
        })
    }
}

/// A point of the path and for how many actions it is driven at.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Hop {
    point: Point,
    /// The direction in which the path arrives there.
    along: Vector,
    speed_mps: f64,
    actions: u32,
}

impl Hop {
    fn new((point, along): (Point, Vector), speed_mps: f64, time_s: f64) -> Self {
        let actions = (PATIENCE * time_s / ActionSettings::default().action_s - 1e-6).ceil().max(1.0) as u32;
        Self { point, along, speed_mps, actions }
    }

    /// Whether a robot at `position` is sent on to the next point.
    fn is_over(&self, position: Point) -> bool {
        let beyond_m = (position - self.point).dot(&self.along);
        self.actions == 0 || beyond_m >= 0.0 || (position - self.point).norm() <= REACHED_M
    }
}

#[derive(Debug)]
struct RrtController<'a> {
    baseline: &'a Rrt<'a>,
    seed: Seed,
    state: RobotState,
    /// Calls of the planner, and those that found a path.
    attempts: u64,
    plans: u64,
    /// What is left of the path.
    hops: Vec<Hop>,
    /// The first of it.
    next: usize,
    /// The last action met an obstacle: back off before anything else.
    must_back_off: bool,
    /// The way at hand led to an obstacle.
    is_bumped: bool,
    /// The planner found nothing from here.
    is_stuck: bool,
}

impl Controller for RrtController<'_> {
    fn prepare(&mut self) -> Readiness {
        if self.must_back_off || self.is_at_goal() {
            return Readiness::Ready;
        }
        let position = self.state.pose.position;
        while self.hops.get(self.next).is_some_and(|hop| hop.is_over(position)) {
            self.next += 1;
        }
        if self.next < self.hops.len() && !self.is_bumped {
            return Readiness::Ready;
        }
        self.is_bumped = false;
        self.plan(self.state.pose)
    }

    fn decide(&mut self) -> Decision {
        if std::mem::take(&mut self.must_back_off) {
            return self.back_off();
        }
        if self.is_at_goal() {
            return Decision::Reached;
        }
        if std::mem::take(&mut self.is_stuck) {
            return self.give_way();
        }
        let hop = &mut self.hops[self.next];
        let command = Command::of(&self.state.pose, hop.point, hop.speed_mps);
        hop.actions -= 1;
        Decision::Drive(command)
    }

    fn observe(&mut self, motion: &Motion) {
        self.state = motion.after;
        self.must_back_off = motion.contact && motion.command.is_some();
        self.is_bumped |= self.must_back_off;
    }
}

impl RrtController<'_> {
    fn is_at_goal(&self) -> bool {
        let Rrt { world, query, .. } = self.baseline;
        (self.state.pose.position - query.goal.position).norm() < world.robot.goal_tolerance_m
    }

    fn back_off(&self) -> Decision {
        Decision::BackOff { distance_m: self.baseline.world.robot.recovery_reverse_m }
    }

    /// Without a way on: the end, or where walls may be touched another step back.
    fn give_way(&self) -> Decision {
        if self.baseline.contact_ends || self.plans == 0 { Decision::Lost } else { self.back_off() }
    }

    fn plan(&mut self, start: Pose) -> Readiness {
        let Rrt { world, planner, query, settings, .. } = self.baseline;
        let query = sharp_motion::MotionQuery { start, goal: query.goal };
        let mut sampler = Uniform { bounds: world.grid.frame().bounds() };
        let mut rng = self.seed.stream("plan", self.attempts);
        self.attempts += 1;
        let path = planner.robots(start).find_map(|GuideRobot { geometry, steering, .. }| {
            let query = sharp_motion::MotionQuery { goal: fitting(geometry, query.goal)?, ..query };
            let path = rrt(&query, geometry, &steering, &mut sampler, settings, &mut rng).path()?;
            Some(shortcut(&path, geometry, &steering, &ShortcutSettings::default(), &mut rng))
        });
        let (hops, nominal_time_s) = path.map_or((vec![], 0.0), |path| hops(&path, world));
        (self.hops, self.next) = (hops, 0);
        if self.hops.is_empty() {
            self.is_stuck = true;
            return Readiness::Ready;
        }
        self.plans += 1;
        Readiness::Planned { nominal_time_s }
    }
}

/// `goal` with the nearest heading at which the robot fits there.
fn fitting(geometry: &dyn RobotGeometry, goal: Pose) -> Option<Pose> {
    let turned = |turn: f64| Pose::at(goal.position, Heading::new(goal.heading.radians() + turn));
    let turns = (0..32).flat_map(|i| [f64::from(i) * 0.1, f64::from(i) * -0.1]);
    turns.map(turned).find(|&pose| geometry.is_free(pose))
}

/// The points that the robot is sent to, and how long they take, seconds.
fn hops(path: &Path, world: &World) -> (Vec<Hop>, f64) {
    let robot = &world.robot;
    let cruise_mps = CRUISE * robot.max_speed_mps;
    let (mut hops, mut total_s): (Vec<Hop>, f64) = (Vec::new(), 0.0);
    let (mut from, mut turn_rad) = (path.start().position, 0.0);
    let mut to = |point: Point, turn_rad: &mut f64| {
        let travel_m = (point - from).norm();
        if travel_m < 1e-6 {
            return;
        }
        let along = (point - from) / travel_m;
        let turn = Hop::new((point, along), TURN_MPS, nominal_time_s(world, 0.0, *turn_rad) / PATIENCE);
        let travel = Hop::new((point, along), cruise_mps, nominal_time_s(world, travel_m, 0.0));
        hops.extend((*turn_rad > TURN_RAD).then_some(turn));
        hops.push(travel);
        total_s += nominal_time_s(world, travel_m, *turn_rad);
        (from, *turn_rad) = (point, 0.0);
    };
    let spacing_m = if robot.can_turn_in_place() { SPACING_M } else { CAR_SPACING_M };
    let mut last = path.start().position;
    let mut travel_m = 0.0;
    for pair in path.poses().windows(2) {
        let step_m = pair[0].distance_m(&pair[1]);
        if step_m < 1e-9 {
            // A corner: no point beyond it before the robot is there.
            to(pair[0].position, &mut turn_rad);
            travel_m = 0.0;
            turn_rad += pair[0].heading.turn_to(pair[1].heading).abs();
        } else {
            travel_m += step_m;
            if travel_m >= spacing_m {
                to(pair[1].position, &mut turn_rad);
                travel_m = 0.0;
            }
        }
        last = pair[1].position;
    }
    to(last, &mut turn_rad);
    (hops, total_s)
}

#[cfg(test)]
mod tests {
    use sharp_sim::RobotModel;
    use sharp_space::OccupancyGrid;

    use super::*;

    #[test]
    fn corners_are_turned_at_before_the_next_point_is_driven_to() {
        let grid = OccupancyGrid::from_ascii(1.0, "....\n....\n....\n....").expect("a sound drawing");
        let world = World::new(grid, RobotModel::husky());
        // A metre to the east, a turn to the left, and half a metre to the north.
        let ahead = (0..=20).map(|i| Pose::new(1.0 + 0.05 * f64::from(i), 1.0, 0.0));
        let left = (0..=10).map(|i| Pose::new(2.0, 1.0 + 0.05 * f64::from(i), std::f64::consts::FRAC_PI_2));
        let path = Path::new(ahead.chain(left).collect()).expect("it holds poses");
        let (hops, total_s) = hops(&path, &world);
        let points: Vec<_> = hops.iter().map(|hop| (hop.point.x, hop.point.y, hop.speed_mps)).collect();
        let expected = [(1.5, 1.0, 0.5), (2.0, 1.0, 0.5), (2.0, 1.5, TURN_MPS), (2.0, 1.5, 0.5)];
        assert_eq!(points.len(), expected.len(), "{points:?}");
        for (found, wanted) in points.iter().zip(expected) {
            let off = (found.0 - wanted.0).abs() + (found.1 - wanted.1).abs() + (found.2 - wanted.2).abs();
            assert!(off < 0.06, "{found:?}, expected {wanted:?}");
        }
        assert!((total_s - (1.5 / 0.5 + std::f64::consts::FRAC_PI_2)).abs() < 0.01, "{total_s} s");
    }

    #[test]
    fn a_point_is_left_behind_when_reached_passed_or_given_up() {
        let hop = |actions| Hop {
            point: Point::new(1.0, 0.0),
            along: Vector::new(1.0, 0.0),
            speed_mps: 0.5,
            actions,
        };
        for (x, y, actions, expected) in
            [(0.0, 0.0, 3, false), (0.9, 0.1, 3, true), (1.1, 0.8, 3, true), (0.0, 0.0, 0, true)]
        {
            assert_eq!(
                hop(actions).is_over(Point::new(x, y)),
                expected,
                "({x}, {y}), {actions} actions left"
            );
        }
    }
}
