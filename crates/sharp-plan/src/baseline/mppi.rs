//! Model-predictive path integral control along a planned path (Williams, Aldrich and Theodorou 2017).
//!
//! Each decision rolls out a few hundred sequences of actions in a model without noise: what the
//! tracking follower would do from where the model is, plus a perturbation of bearing and speed. The
//! perturbations are averaged with weights exp(−cost / temperature), the first is carried out, and
//! the rest begins the next decision. The model is the robot's own waypoint controller on a body that
//! follows its wheels.

use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};
use sharp_guide::GuidePath;
use sharp_sim::{ActionSettings, NoiseModel, RobotModel, RobotState};
use sharp_space::{CollisionChecker, Pose, Seed, Stream};

use crate::baseline::observer::Observer;
use crate::baseline::route::{OnRoute, RoutePlanner};
use crate::baseline::{Baseline, Pilot, Readiness, Situation};
use crate::belief::Trim;
use crate::model::MODEL_DT_S;
use crate::pace::PacedFollower;
use crate::percept::{Tracker, Workspace};
use crate::planner::Query;
use crate::policy::PolarWaypoint;

/// Sampling and cost.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct MppiSettings {
    /// Sequences rolled out for a decision.
    pub samples: usize,
    /// Actions in a sequence.
    pub horizon: usize,
    /// Standard deviation of the bearing's perturbation, radians.
    pub bearing_sd_rad: f64,
    /// Standard deviation of the speed's perturbation, as a share of the top speed.
    pub speed_sd: f64,
    /// Cost that a sequence may be worse than the best and still weigh 1/e.
    pub temperature: f64,
    /// Room at the sides below which it costs, metres.
    pub room_m: f64,
    /// Cost of a second without any room at top speed; grows with the square of what is lacking.
    pub room_weight: f64,
    /// Cost of a second one metre off the path; grows with the square.
    pub cross_weight: f64,
    /// Cost of a contact.
    pub contact_cost: f64,
    /// What the perturbations are added to.
    pub base: PacedFollower,
}

impl MppiSettings {
    /// What did best on generated maps (see `docs/algorithms/baselines.md`).
    #[must_use]
    pub fn new(robot: &RobotModel, noise: &NoiseModel) -> Self {
        Self {
            samples: 96,
            horizon: 8,
            bearing_sd_rad: 0.25,
            speed_sd: 0.2,
            temperature: 0.3,
            room_m: 0.3,
            room_weight: 4.0,
            cross_weight: 2.0,
            contact_cost: 100.0,
            base: PacedFollower::tuned(robot, noise),
        }
    }
}

/// The baseline `mppi`.
#[derive(Clone, Debug)]
pub struct Mppi<'a> {
    /// Map and robot.
    pub workspace: &'a Workspace,
    /// Plans anew on the way.
    pub planner: &'a RoutePlanner<'a>,
    /// The problem.
    pub query: Query,
    /// The path of every episode's beginning.
    pub route: GuidePath,
    /// Sampling and cost.
    pub settings: MppiSettings,
    /// The noise that the robot expects.
    pub noise: NoiseModel,
    /// Root of the perturbations.
    pub seed: Seed,
}

impl Baseline for Mppi<'_> {
    fn pilot(&self, episode: u64) -> Box<dyn Pilot + '_> {
        let Self { workspace, planner, query, route, settings, noise, seed } = self;
        Box::new(MppiPilot {
            workspace,
            settings,
            on_route: OnRoute::new(planner, *query, route.clone(), settings.base.speed),
            observer: Observer::new(workspace, noise),
            // The last disc ends at the nose, so a corner is a half width ahead of and beside its centre.
            corner_m: (std::f64::consts::SQRT_2 - 1.0) * workspace.robot.footprint.half_width_m(),
            mean: vec![Push::default(); settings.horizon],
            seed: seed.child("mppi", episode),
            decisions: 0,
        })
    }
}

/// How an action differs from the follower's.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Push {
    bearing_rad: f64,
    speed_mps: f64,
}

impl Push {
    fn applied(self, robot: &RobotModel, base: PolarWaypoint) -> PolarWaypoint {
        let slowest_mps = robot.min_speed_mps.max(0.1 * robot.max_speed_mps);
        PolarWaypoint {
            bearing_rad: base.bearing_rad + self.bearing_rad,
            speed_mps: (base.speed_mps + self.speed_mps).clamp(slowest_mps, robot.max_speed_mps),
            ..base
        }
    }
}

#[derive(Debug)]
struct MppiPilot<'a> {
    workspace: &'a Workspace,
    settings: &'a MppiSettings,
    on_route: OnRoute<'a>,
    observer: Observer,
    /// How far the outline's corners stick out of the discs beside which room is measured, metres.
    corner_m: f64,
    /// The sequence that the next decision begins with.
    mean: Vec<Push>,
    seed: Seed,
    decisions: u64,
}

impl Pilot for MppiPilot<'_> {
    fn prepare(&mut self, situation: &Situation) -> Readiness {
        self.observer.end(&situation.state, situation.bumped);
        let readiness = self.on_route.prepare(situation);
        if readiness != Readiness::Ready {
            self.mean.fill(Push::default());
        }
        readiness
    }

    fn decide(&mut self, state: &RobotState) -> PolarWaypoint {
        let mut rng = self.seed.stream("decision", self.decisions);
        self.decisions += 1;
        let samples = self.samples(&mut rng);
        let (robot, on_route) = (&self.workspace.robot, &self.on_route);
        let base = self.settings.base.along(robot, &state.pose, &on_route.tracker, on_route.paced());
        let trim = self.observer.trim(base, self.settings.base.trim);
        let costs: Vec<f64> =
            samples.chunks(self.settings.horizon).map(|pushes| self.cost(state, pushes, &trim)).collect();
        self.mean = weighted_mean(&samples, &costs, self.settings);
        let command = self.mean[0].applied(robot, trim.applied(base));
        self.observer.begin(state, command);
        self.mean.rotate_left(1);
        *self.mean.last_mut().expect("a sequence has actions") = Push::default();
        command
    }
}

impl MppiPilot<'_> {
    /// All sequences one after the other; the first two are the follower itself and the mean.
    fn samples(&self, rng: &mut Stream) -> Vec<Push> {
        let MppiSettings { samples, horizon, bearing_sd_rad, speed_sd, .. } = *self.settings;
        let speed_sd_mps = speed_sd * self.workspace.robot.max_speed_mps;
        let mut normal = |sd: f64| sd * <StandardNormal as Distribution<f64>>::sample(&StandardNormal, rng);
        let mut pushes = vec![Push::default(); horizon];
        pushes.extend_from_slice(&self.mean);
        for _ in 2..samples {
            pushes.extend(self.mean.iter().map(|mean| Push {
                bearing_rad: mean.bearing_rad + normal(bearing_sd_rad),
                speed_mps: mean.speed_mps + normal(speed_sd_mps),
            }));
        }
        pushes
    }

    /// The cost of `pushes` from `state`: seconds of the way that is left undone, and what it risked.
    fn cost(&self, state: &RobotState, pushes: &[Push], trim: &Trim) -> f64 {
        let Self { workspace, settings, on_route, .. } = self;
        let (robot, traits) = (&workspace.robot, self.observer.traits());
        let action_s = ActionSettings::default().action_s;
        let (mut state, mut tracker) = (*state, on_route.tracker);
        let (begun_m, mut cost) = (tracker.arc_m, 0.0);
        for (number, push) in pushes.iter().enumerate() {
            let base = settings.base.along(robot, &state.pose, &tracker, on_route.paced());
            let command = push.applied(robot, trim.applied(base));
            if !workspace.model.act(&mut state, command, traits, |at| self.is_free(at, &mut cost)) {
                // The later, the less certain.
                return cost + settings.contact_cost / (1.0 + number as f64);
            }
            tracker.update(&on_route.route, &state.pose);
            cost += settings.cross_weight * action_s * tracker.cross_track_m * tracker.cross_track_m;
            if is_at_end(&on_route.route, &tracker) {
                break;
            }
        }
        let gained_s = (tracker.arc_m - begun_m) / robot.max_speed_mps;
        cost - gained_s
    }

    /// Whether the model's robot may stand at `state`; adds what a time step there risks.
    fn is_free(&self, state: &RobotState, cost: &mut f64) -> bool {
        let MppiSettings { room_m, room_weight, .. } = *self.settings;
        let robot = &self.workspace.robot;
        let beside_m = room_beside_m(self.workspace, &state.pose);
        let lack = (1.0 - beside_m / room_m).clamp(0.0, 1.0);
        let pace = 0.3 + 0.7 * state.wheel_speed_mps / robot.max_speed_mps;
        *cost += room_weight * lack * lack * pace * MODEL_DT_S;
        // Where even the coarse room exceeds a cell's diagonal, the exact test is spared.
        let sure_m = 1.5 * self.workspace.checker.field().frame().resolution_m;
        beside_m > sure_m + self.corner_m || self.workspace.checker.is_free(state.pose)
    }
}

fn is_at_end(guide: &GuidePath, tracker: &Tracker) -> bool {
    guide.length_m() - tracker.arc_m < 1e-6
}

/// Room beside nose, middle and tail of the robot, metres.
fn room_beside_m(workspace: &Workspace, pose: &Pose) -> f64 {
    let footprint = &workspace.robot.footprint;
    let reach_m = (footprint.half_length_m() - footprint.half_width_m()).max(0.0);
    let field = workspace.checker.field();
    let unit = pose.heading.unit();
    let at = |ahead_m: f64| {
        field.frame().cell_at(pose.position + unit * ahead_m).map_or(0.0, |cell| field.at(cell))
    };
    at(reach_m).min(at(0.0)).min(at(-reach_m)) - footprint.inscribed_radius_m()
}

/// The mean of the sequences in `samples`, each with weight exp(−(cost − least) / temperature).
fn weighted_mean(samples: &[Push], costs: &[f64], settings: &MppiSettings) -> Vec<Push> {
    let least = costs.iter().copied().fold(f64::INFINITY, f64::min);
    let weights: Vec<f64> = costs.iter().map(|cost| (-(cost - least) / settings.temperature).exp()).collect();
    let total: f64 = weights.iter().sum();
    let mut mean = vec![Push::default(); settings.horizon];
    for (pushes, weight) in samples.chunks(settings.horizon).zip(&weights) {
        for (mean, push) in mean.iter_mut().zip(pushes) {
            mean.bearing_rad += push.bearing_rad * weight / total;
            mean.speed_mps += push.speed_mps * weight / total;
        }
    }
    mean
}
