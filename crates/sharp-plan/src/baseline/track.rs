//! A planned path and closed-loop tracking: what an engineer would use today.
//!
//! A [`Follower`] steers; a [`SpeedRule`] slows it down where room is scarce, before bends and while
//! the robot is off its line. The route is planned anew when the robot leaves it or stands still.

use serde::{Deserialize, Serialize};
use sharp_guide::GuidePath;
use sharp_sim::{RobotModel, RobotState};
use sharp_space::Heading;

use crate::baseline::route::{OnRoute, RoutePlanner};
use crate::baseline::{Baseline, Pilot, Readiness, Situation};
use crate::percept::{Tracker, Workspace};
use crate::planner::Query;
use crate::policy::{Follower, GuideView, PolarWaypoint, Rule};

/// Speed by the place on the path.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct SpeedRule {
    /// Fastest, as a share of the robot's top speed.
    pub cruise: f64,
    /// Slowest, as a share of the robot's top speed.
    pub slow: f64,
    /// Room at the robot's sides at which it drives slowest, and from which on it cruises, metres.
    pub room_m: [f64; 2],
    /// Turn of the path over the distance looked ahead at which the robot drives slowest, radians.
    pub turn_rad: f64,
    /// Heading error at which the robot drives slowest, radians.
    pub heading_rad: f64,
    /// How far ahead room and turn are judged, metres.
    pub ahead_m: f64,
}

impl SpeedRule {
    /// The speed for a robot at `state`, metres per second.
    #[must_use]
    pub fn speed_mps(
        &self,
        workspace: &Workspace,
        route: &GuidePath,
        tracker: &Tracker,
        state: &RobotState,
    ) -> f64 {
        let robot = &workspace.robot;
        let view = GuideView { guide: route, next: None };
        let half_width_m = robot.footprint.inscribed_radius_m();
        let steps = (self.ahead_m / LOOK_STEP_M).ceil() as usize;
        let (mut room_m, mut turn_rad) = (f64::INFINITY, 0.0);
        let mut heading = tracker.tangent;
        for i in 0..=steps {
            let pose = view.ahead(tracker.arc_m + i as f64 * LOOK_STEP_M);
            room_m = room_m.min(workspace.checker.field().sample(pose.position) - half_width_m);
            turn_rad += heading.turn_to(pose.heading).abs();
            heading = pose.heading;
        }
        let error_rad = self.error_rad(tracker, state.pose.heading);
        let [tight_m, roomy_m] = self.room_m;
        let ease = ((room_m - tight_m) / (roomy_m - tight_m))
            .min(1.0 - turn_rad / self.turn_rad)
            .min(1.0 - error_rad / self.heading_rad)
            .clamp(0.0, 1.0);
        (self.slow + (self.cruise - self.slow) * ease) * robot.max_speed_mps
    }

    fn error_rad(&self, tracker: &Tracker, heading: Heading) -> f64 {
        tracker.tangent.turn_to(heading).abs()
    }
}

/// The distance between two looks along the path, metres: the spacing of its poses.
const LOOK_STEP_M: f64 = 0.25;

/// How a path is tracked.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct TrackSettings {
    /// Where to.
    pub rule: Rule,
    /// How fast.
    pub speed: SpeedRule,
}

impl TrackSettings {
    /// What did best on generated maps (see `docs/algorithms/baselines.md`).
    #[must_use]
    pub fn new(robot: &RobotModel) -> Self {
        let speed = SpeedRule {
            cruise: 0.8,
            slow: 0.35,
            room_m: [0.1, 0.4],
            turn_rad: 1.5,
            heading_rad: 1.0,
            ahead_m: 0.75,
        };
        if robot.can_turn_in_place() {
            Self { rule: Rule::Field { look_ahead_m: 0.3, softness_m: 0.6 }, speed }
        } else {
            Self { rule: Rule::Field { look_ahead_m: 0.3, softness_m: 0.6 }, speed }
        }
    }

    /// The waypoint for a robot in `state` whose projection onto `route` is `tracker`.
    #[must_use]
    pub fn waypoint(
        &self,
        workspace: &Workspace,
        route: &GuidePath,
        tracker: &Tracker,
        state: &RobotState,
    ) -> PolarWaypoint {
        let speed_mps = self.speed.speed_mps(workspace, route, tracker, state);
        let view = GuideView { guide: route, next: None };
        Follower { rule: self.rule, speed_mps }.waypoint(&workspace.robot, &state.pose, tracker, &view)
    }
}

/// The baseline `track`.
#[derive(Clone, Debug)]
pub struct Track<'a> {
    /// Map and robot.
    pub workspace: &'a Workspace,
    /// Plans anew on the way.
    pub planner: &'a RoutePlanner<'a>,
    /// The problem.
    pub query: Query,
    /// The path of every episode's beginning.
    pub route: GuidePath,
    /// How it is tracked.
    pub settings: TrackSettings,
}

impl Baseline for Track<'_> {
    fn pilot(&self, _episode: u64) -> Box<dyn Pilot + '_> {
        let on_route = OnRoute::new(self.planner, self.query, self.route.clone());
        Box::new(TrackPilot { baseline: self, on_route })
    }
}

#[derive(Debug)]
struct TrackPilot<'a> {
    baseline: &'a Track<'a>,
    on_route: OnRoute<'a>,
}

impl Pilot for TrackPilot<'_> {
    fn prepare(&mut self, situation: &Situation) -> Readiness {
        self.on_route.prepare(situation)
    }

    fn decide(&mut self, state: &RobotState) -> PolarWaypoint {
        let OnRoute { route, tracker, .. } = &self.on_route;
        self.baseline.settings.waypoint(self.baseline.workspace, route, tracker, state)
    }
}
