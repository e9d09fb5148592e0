//! RRT with replanning, executed open-loop: the planning baseline of Sec. 5.
//!
//! The robot is given the points of the planned path one after the other, each until it is there or
//! the time that the plan allots is over, wherever it then is: feedback is the waypoint controller's
//! alone. Where the path ends without the goal being reached, a new one is planned from there.

use sharp_motion::{Path, RrtSettings, ShortcutSettings, Uniform, rrt, shortcut};
use sharp_sim::{ActionSettings, RobotState};
use sharp_space::{CollisionChecker, FootprintChecker, Heading, Point, Pose, Seed, Vector};

use crate::baseline::route::RoutePlanner;
use crate::baseline::{Baseline, Pilot, Readiness, Situation, nominal_time_s};
use crate::percept::Workspace;
use crate::planner::Query;
use crate::policy::PolarWaypoint;
use crate::spare::Spare;

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
    pub workspace: &'a Workspace,
    /// The outlines and turning radii to plan with.
    pub planner: &'a RoutePlanner<'a>,
    /// The problem; the goal's heading is free.
    pub query: Query,
    /// Budget and steps of the planner.
    pub settings: RrtSettings,
    /// Root of the planner's random streams.
    pub seed: Seed,
}

impl Baseline for Rrt<'_> {
    fn pilot(&self, episode: u64) -> Box<dyn Pilot + '_> {
        Box::new(RrtPilot {
            baseline: self,
            seed: self.seed.child("rrt", episode),
            plans: 0,
            hops: vec![],
            next: 0,
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
struct RrtPilot<'a> {
    baseline: &'a Rrt<'a>,
    seed: Seed,
    plans: u64,
    /// What is left of the path.
    hops: Vec<Hop>,
    /// The first of it.
    next: usize,
}

impl Pilot for RrtPilot<'_> {
    fn prepare(&mut self, situation: &Situation) -> Readiness {
        let position = situation.state.pose.position;
        while self.hops.get(self.next).is_some_and(|hop| hop.is_over(position)) {
            self.next += 1;
        }
        if self.next < self.hops.len() && !situation.bumped {
            return Readiness::Ready;
        }
        self.plan(situation.state.pose)
    }

    fn decide(&mut self, state: &RobotState) -> PolarWaypoint {
        let hop = &mut self.hops[self.next];
        let waypoint = PolarWaypoint::of(&state.pose, hop.point, hop.speed_mps);
        hop.actions -= 1;
        waypoint
    }
}

impl RrtPilot<'_> {
    fn plan(&mut self, start: Pose) -> Readiness {
        let Rrt { workspace, planner, query, settings, .. } = self.baseline;
        let query = sharp_motion::MotionQuery { start, goal: query.goal };
        let mut sampler = Uniform { bounds: workspace.grid.frame().bounds() };
        let mut rng = self.seed.stream("plan", self.plans);
        self.plans += 1;
        let path = planner.attempts(start).find_map(|Spare { checker, steering }| {
            let query = sharp_motion::MotionQuery { goal: fitting(checker, query.goal)?, ..query };
            let path = rrt(&query, checker, steering, &mut sampler, settings, &mut rng).path()?;
            Some(shortcut(&path, checker, steering, &ShortcutSettings::default(), &mut rng))
        });
        let Some(path) = path else { return Readiness::NoWay };
        let nominal_time_s;
        (self.hops, nominal_time_s) = hops(&path, workspace);
        self.next = 0;
        if self.hops.is_empty() { Readiness::NoWay } else { Readiness::Planned { nominal_time_s } }
    }
}

/// `goal` with the nearest heading at which the robot fits there.
fn fitting(checker: &FootprintChecker, goal: Pose) -> Option<Pose> {
    let turned = |turn: f64| Pose::at(goal.position, Heading::new(goal.heading.radians() + turn));
    let turns = (0..32).flat_map(|i| [f64::from(i) * 0.1, f64::from(i) * -0.1]);
    turns.map(turned).find(|&pose| checker.is_free(pose))
}

/// The points that the robot is sent to, and how long they take, seconds.
fn hops(path: &Path, workspace: &Workspace) -> (Vec<Hop>, f64) {
    let robot = &workspace.robot;
    let cruise_mps = CRUISE * robot.max_speed_mps;
    let (mut hops, mut total_s): (Vec<Hop>, f64) = (Vec::new(), 0.0);
    let (mut from, mut turn_rad) = (path.start().position, 0.0);
    let mut to = |point: Point, turn_rad: &mut f64| {
        let travel_m = (point - from).norm();
        if travel_m < 1e-6 {
            return;
        }
        let along = (point - from) / travel_m;
        let turn = Hop::new((point, along), TURN_MPS, nominal_time_s(workspace, 0.0, *turn_rad) / PATIENCE);
        let travel = Hop::new((point, along), cruise_mps, nominal_time_s(workspace, travel_m, 0.0));
        hops.extend((*turn_rad > TURN_RAD).then_some(turn));
        hops.push(travel);
        total_s += nominal_time_s(workspace, travel_m, *turn_rad);
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
        let workspace = Workspace::new(grid, RobotModel::husky());
        // A metre to the east, a turn to the left, and half a metre to the north.
        let ahead = (0..=20).map(|i| Pose::new(1.0 + 0.05 * f64::from(i), 1.0, 0.0));
        let left = (0..=10).map(|i| Pose::new(2.0, 1.0 + 0.05 * f64::from(i), std::f64::consts::FRAC_PI_2));
        let path = Path::new(ahead.chain(left).collect()).expect("it holds poses");
        let (hops, total_s) = hops(&path, &workspace);
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
