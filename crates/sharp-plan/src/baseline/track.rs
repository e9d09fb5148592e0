//! A planned path and closed-loop tracking: what an engineer would use today.
//!
//! A [`Follower`] steers; a [`SpeedRule`] slows it down where room is scarce, before bends and while
//! the robot is off its line. The route is planned anew when the robot leaves it or stands still.

use serde::{Deserialize, Serialize};
use sharp_guide::GuidePath;
use sharp_sim::{NoiseModel, RobotModel, RobotState};
use sharp_space::{Heading, Pose};

use crate::baseline::model::Model;
use crate::baseline::observer::Observer;
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
    /// How freely the robot may drive at each [`LOOK_STEP_M`] of `route`, from 0 (slowest) to 1.
    pub(crate) fn ease(&self, workspace: &Workspace, route: &GuidePath) -> Vec<f64> {
        let view = GuideView { guide: route, next: None };
        let half_width_m = workspace.robot.footprint.inscribed_radius_m();
        let count = (route.length_m() / LOOK_STEP_M) as usize + 1;
        let ahead = (self.ahead_m / LOOK_STEP_M).ceil() as usize;
        let poses: Vec<Pose> = (0..=count + ahead).map(|i| view.ahead(i as f64 * LOOK_STEP_M)).collect();
        let room_m = |pose: &Pose| workspace.checker.field().sample(pose.position) - half_width_m;
        let [tight_m, roomy_m] = self.room_m;
        poses
            .windows(ahead + 1)
            .map(|ahead| {
                let least_m = ahead.iter().map(room_m).fold(f64::INFINITY, f64::min);
                let turn = |pair: &[Pose]| pair[0].heading.turn_to(pair[1].heading).abs();
                let turn_rad: f64 = ahead.windows(2).map(turn).sum();
                ((least_m - tight_m) / (roomy_m - tight_m))
                    .min(1.0 - turn_rad / self.turn_rad)
                    .clamp(0.0, 1.0)
            })
            .collect()
    }

    /// The speed of a robot that looks along `heading` at a place of its route with the given `ease`,
    /// as a share of its top speed.
    fn speed(&self, ease: f64, tangent: Heading, heading: Heading) -> f64 {
        let error_rad = tangent.turn_to(heading).abs();
        let ease = ease.min(1.0 - error_rad / self.heading_rad).max(0.0);
        self.slow + (self.cruise - self.slow) * ease
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
    /// Share of the pull, as it is known so far, that the direction makes up for.
    pub trim: f64,
}

impl TrackSettings {
    /// What did best on generated maps under noise like `noise` (see `docs/algorithms/baselines.md`).
    #[must_use]
    pub fn new(robot: &RobotModel, noise: &NoiseModel) -> Self {
        let is_harsh = noise.slip_max > 0.4 || noise.gain_sd > 0.25 || noise.waypoint_sd_m > 0.075;
        let is_biased = noise.drift_bias_radps > 0.0 || noise.delay_s > 0.0;
        match (robot.can_turn_in_place(), is_harsh, is_biased) {
            (true, true, _) => {
                let (room_m, turn_rad, heading_rad, ahead_m) = ([0.15, 0.95], 1.2, 0.3, 0.75);
                let speed = SpeedRule { cruise: 0.8, slow: 0.1, room_m, turn_rad, heading_rad, ahead_m };
                Self { rule: Rule::Field { look_ahead_m: 0.15, softness_m: 0.2 }, speed, trim: 0.3 }
            }
            (true, false, _) => {
                let (room_m, turn_rad, heading_rad, ahead_m) = ([0.15, 0.6], 2.0, 0.5, 1.5);
                let speed = SpeedRule { cruise: 0.8, slow: 0.15, room_m, turn_rad, heading_rad, ahead_m };
                Self { rule: Rule::Pursuit { look_ahead_m: 0.3 }, speed, trim: 0.5 }
            }
            (false, true, _) => {
                let (room_m, turn_rad, heading_rad, ahead_m) = ([0.1, 1.3], 0.8, 1.0, 0.75);
                let speed = SpeedRule { cruise: 0.5, slow: 0.2, room_m, turn_rad, heading_rad, ahead_m };
                Self { rule: Rule::Field { look_ahead_m: 0.4, softness_m: 0.3 }, speed, trim: 0.7 }
            }
            (false, false, true) => {
                let (room_m, turn_rad, heading_rad, ahead_m) = ([0.1, 0.4], 0.8, 2.0, 0.75);
                let speed = SpeedRule { cruise: 0.5, slow: 0.25, room_m, turn_rad, heading_rad, ahead_m };
                Self { rule: Rule::Field { look_ahead_m: 0.4, softness_m: 0.3 }, speed, trim: 0.5 }
            }
            (false, false, false) => {
                let (room_m, turn_rad, heading_rad, ahead_m) = ([0.1, 0.6], 2.0, 2.0, 0.75);
                let speed = SpeedRule { cruise: 0.7, slow: 0.2, room_m, turn_rad, heading_rad, ahead_m };
                Self { rule: Rule::Field { look_ahead_m: 0.4, softness_m: 0.4 }, speed, trim: 1.0 }
            }
        }
    }

    /// The waypoint for a robot at `pose` whose projection onto its route is `tracker`.
    pub(crate) fn waypoint(
        &self,
        robot: &RobotModel,
        pose: &Pose,
        tracker: &Tracker,
        on: &OnRoute<'_>,
    ) -> PolarWaypoint {
        let place = (tracker.arc_m / LOOK_STEP_M) as usize;
        let ease = on.ease[place.min(on.ease.len() - 1)];
        let speed_mps = self.speed.speed(ease, tracker.tangent, pose.heading) * robot.max_speed_mps;
        let view = GuideView { guide: &on.route, next: None };
        Follower { rule: self.rule, speed_mps }.waypoint(robot, pose, tracker, &view)
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
    /// The noise that the robot expects.
    pub noise: NoiseModel,
}

impl Baseline for Track<'_> {
    fn pilot(&self, _episode: u64) -> Box<dyn Pilot + '_> {
        let on_route = OnRoute::new(self.planner, self.query, self.route.clone(), self.settings.speed);
        let observer = Observer::new(Model::new(&self.workspace.robot), &self.noise);
        Box::new(TrackPilot { baseline: self, on_route, observer })
    }
}

#[derive(Debug)]
struct TrackPilot<'a> {
    baseline: &'a Track<'a>,
    on_route: OnRoute<'a>,
    observer: Observer,
}

impl Pilot for TrackPilot<'_> {
    fn prepare(&mut self, situation: &Situation) -> Readiness {
        self.observer.end(&situation.state, situation.bumped);
        self.on_route.prepare(situation)
    }

    fn decide(&mut self, state: &RobotState) -> PolarWaypoint {
        let (robot, settings) = (&self.baseline.workspace.robot, &self.baseline.settings);
        let wanted = settings.waypoint(robot, &state.pose, &self.on_route.tracker, &self.on_route);
        let command = self.observer.trim(wanted, settings.trim).applied(wanted);
        self.observer.begin(state, command);
        command
    }
}
