//! Driving along one path by one policy, planned anew where the robot leaves it.

use std::fmt;

use sharp_guide::{Goal, GuidePath};
use sharp_sim::{NoiseModel, RobotState};
use sharp_space::{Point, Pose};

use crate::episode::{Controller, Decision, Motion, Readiness};
use crate::policy::Policy;
use crate::situation::{GuideProgress, GuideView, Observation, Situation};
use crate::still::StandstillDetector;
use crate::world::World;

/// A robot further off its path than this gets a new one, metres.
const OFF_ROUTE_M: f64 = 0.5;
/// A robot with less of its path left than this is at its end, metres.
const AT_END_M: f64 = 1e-6;
/// Actions between two plans: what a new path needs to show its worth.
const PATIENCE_ACTIONS: u32 = 6;
/// Speed at which the nominal time of a path is counted, as a share of the top speed.
const NOMINAL_SPEED: f64 = 0.5;

/// Plans a path from a pose to the goal; `None` where there is none.
pub type Replan<'a> = Box<dyn Fn(Pose) -> Option<GuidePath> + 'a>;

/// Lets a policy drive along a path until the robot is at its goal.
pub struct RouteController<'a> {
    world: &'a World,
    replan: Option<Replan<'a>>,
    route: GuidePath,
    goal: Goal,
    policy: Box<dyn Policy>,
    observation: Observation,
    progress: GuideProgress,
    still: StandstillDetector,
    /// Actions since the last plan; `None` before the first decision.
    actions: Option<u32>,
    /// The last action met an obstacle: back off before anything else.
    must_back_off: bool,
    /// The way at hand led to an obstacle.
    is_bumped: bool,
}

impl fmt::Debug for RouteController<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("RouteController").field("goal", &self.goal).finish_non_exhaustive()
    }
}

impl<'a> RouteController<'a> {
    /// `policy` drives a robot in `state` along `route` to its end; `noise` is what the robot expects.
    #[must_use]
    pub fn new(
        world: &'a World,
        route: GuidePath,
        policy: Box<dyn Policy>,
        state: RobotState,
        noise: &NoiseModel,
    ) -> Self {
        let progress = GuideProgress::start(&route, &state.pose);
        Self {
            world,
            replan: None,
            goal: goal_at(world, route.end().position),
            route,
            policy,
            observation: Observation::first(state, noise),
            progress,
            still: StandstillDetector::new(state.pose),
            actions: None,
            must_back_off: false,
            is_bumped: false,
        }
    }

    /// The same to `goal`, with a new path by `replan` where the robot leaves the path, comes to its end without
    /// reaching the goal, stands still or has met an obstacle.
    #[must_use]
    pub fn with_replanning(self, goal: Point, replan: Replan<'a>) -> Self {
        Self { replan: Some(replan), goal: goal_at(self.world, goal), ..self }
    }

    fn is_at_goal(&self) -> bool {
        self.goal.is_reached(&self.observation.state.pose)
    }

    /// Begins the path at hand.
    fn enter(&mut self) -> Readiness {
        self.actions = Some(0);
        let Self { world, observation, progress, route, policy, .. } = self;
        let guide = GuideView { current: route, next: None };
        policy.enter(&Situation { world, observation, progress, guide });
        Readiness::Planned { nominal_time_s: route.length_m() / (NOMINAL_SPEED * world.robot.max_speed_mps) }
    }

    fn needs_plan(&self, actions: u32) -> bool {
        let is_off = self.progress.cross_track_m.abs() > OFF_ROUTE_M
            || self.progress.remaining_m < AT_END_M
            || self.still.stands_still();
        self.is_bumped || (is_off && actions >= PATIENCE_ACTIONS)
    }
}

/// The goal at `point` as all methods are judged by it: one behind a wall is not reached, however near it is.
fn goal_at(world: &World, point: Point) -> Goal {
    Goal::new(point, world.robot.goal_tolerance_m, world.geometry.clearance())
}

impl Controller for RouteController<'_> {
    fn prepare(&mut self) -> Readiness {
        if self.must_back_off || self.is_at_goal() {
            return Readiness::Ready;
        }
        let Some(actions) = self.actions else { return self.enter() };
        self.actions = Some(actions + 1);
        if !self.needs_plan(actions) {
            return Readiness::Ready;
        }
        let pose = self.observation.state.pose;
        let Some(replan) = &self.replan else { return Readiness::Ready };
        let route = replan(pose);
        self.is_bumped = false;
        match route {
            Some(route) => {
                self.route = route;
                self.progress = GuideProgress::start(&self.route, &pose);
                self.still = StandstillDetector::new(pose);
                self.enter()
            }
            // The old path may yet lead on, and the robot may come to stand better.
            None => {
                self.actions = Some(0);
                Readiness::Ready
            }
        }
    }

    fn decide(&mut self) -> Decision {
        if std::mem::take(&mut self.must_back_off) {
            return Decision::BackOff { distance_m: self.world.robot.recovery_reverse_m };
        }
        if self.is_at_goal() {
            return Decision::Reached;
        }
        let Self { world, observation, progress, route, policy, .. } = self;
        let guide = GuideView { current: route, next: None };
        let command = policy.decide(&Situation { world, observation, progress, guide });
        Decision::Drive(world.held(&observation.state.pose, command))
    }

    fn observe(&mut self, motion: &Motion) {
        self.observation = self.observation.after(self.world, motion);
        self.progress.update(&self.route, &motion.after.pose);
        self.still.observe(&motion.after.pose);
        // A forward-only robot with its nose at a wall can do nothing else.
        self.must_back_off = motion.contact && motion.command.is_some();
        self.is_bumped |= self.must_back_off;
    }
}

#[cfg(test)]
mod tests {
    use sharp_sim::SimulatorKind;
    use sharp_space::Seed;

    use super::*;
    use crate::command::Command;
    use crate::episode::{Episode, EpisodeEnd, EpisodeRules, Supervisor};
    use crate::follower::Follower;
    use crate::test_worlds::{hall, straight};

    #[test]
    fn a_follower_drives_its_path_to_the_end() {
        let (world, route) = (hall(), straight((1.0, 2.2), (9.0, 2.2)));
        let simulator = world.simulator(SimulatorKind::Kinematic);
        let vehicle = world.vehicle(&*simulator, &NoiseModel::none(), true);
        let mut episode = Episode::new(vehicle, EpisodeRules::default());
        let start = RobotState::at_rest(route.start());
        episode.begin(start, Seed(1), 0);
        let policy = Box::new(Follower::cautious(&world.robot));
        let mut controller = RouteController::new(&world, route, policy, start, &NoiseModel::none());
        assert_eq!(episode.drive(&mut controller, &Supervisor::silent()), EpisodeEnd::Reached);
        assert_eq!(episode.record().plans, 1, "the path at hand is a plan");
    }

    #[test]
    fn whoever_leaves_the_path_or_meets_a_wall_gets_a_new_one() {
        let (world, route) = (hall(), straight((1.0, 2.2), (9.0, 2.2)));
        let replan = |pose: Pose| Some(straight((pose.position.x, pose.position.y), (9.0, 2.2)));
        let start = RobotState::at_rest(route.start());
        let policy = Box::new(Follower::cautious(&world.robot));
        let goal = route.end().position;
        let mut controller = RouteController::new(&world, route, policy, start, &NoiseModel::none())
            .with_replanning(goal, Box::new(replan));
        let mut look = |x: f64, y: f64, contact| {
            let after = RobotState::at_rest(Pose::new(x, y, 0.0));
            controller.observe(&Motion { contact, ..Motion::commanded(Command::default(), after) });
            if contact {
                assert!(matches!(controller.decide(), Decision::BackOff { .. }), "first away from the wall");
            }
            controller.prepare()
        };
        assert!(matches!(look(1.0, 2.2, false), Readiness::Planned { .. }), "the first plan");
        for step in 1..8 {
            assert_eq!(look(1.0 + 0.2 * f64::from(step), 2.2, false), Readiness::Ready, "on the path");
        }
        assert!(matches!(look(3.0, 3.2, false), Readiness::Planned { .. }), "a metre beside it");
        assert!(matches!(look(3.2, 3.2, true), Readiness::Planned { .. }), "a wall in the way");
    }
}
