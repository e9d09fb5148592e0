//! Model-predictive path integral control along a path (Williams, Aldrich and Theodorou 2017).
//!
//! Each decision rolls out a few hundred sequences of actions in a model without noise: what the profiled
//! follower would do from where the model is, plus a perturbation of bearing and speed. The perturbations are
//! averaged with weights exp(−cost / temperature), the first is carried out, and the rest begins the next
//! decision. The model is the robot's own waypoint controller on a body that follows its wheels.

use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};
use sharp_guide::GuidePath;
use sharp_sim::{ActionSettings, NoiseModel, RobotModel, RobotState};
use sharp_space::{Pose, Seed, Stream};

use crate::command::Command;
use crate::motion_model::{MODEL_DT_S, SlipParameters};
use crate::policy::Policy;
use crate::situation::{GuideProgress, Situation};
use crate::slip_filter::{FeedForward, SlipEstimate};
use crate::speed_profile::ProfiledFollower;
use crate::world::World;

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
    /// Clearance at the sides below which it costs, metres.
    pub clearance_m: f64,
    /// Cost of a second without any clearance at top speed; grows with the square of what is lacking.
    pub clearance_weight: f64,
    /// Cost of a second one metre off the path; grows with the square.
    pub cross_weight: f64,
    /// Cost of a contact.
    pub contact_cost: f64,
    /// What the perturbations are added to.
    pub base: ProfiledFollower,
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
            clearance_m: 0.3,
            clearance_weight: 4.0,
            cross_weight: 2.0,
            contact_cost: 100.0,
            base: ProfiledFollower::tuned(robot, noise),
        }
    }
}

/// How an action differs from the follower's.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Perturbation {
    bearing_rad: f64,
    speed_mps: f64,
}

impl Perturbation {
    fn applied(self, robot: &RobotModel, base: Command) -> Command {
        let slowest_mps = robot.min_speed_mps.max(0.1 * robot.max_speed_mps);
        Command {
            bearing_rad: base.bearing_rad + self.bearing_rad,
            speed_mps: (base.speed_mps + self.speed_mps).clamp(slowest_mps, robot.max_speed_mps),
            ..base
        }
    }
}

/// The controller as a policy. It needs [`enter`](Policy::enter) to be called when its path begins or changes.
#[derive(Clone, Debug)]
pub struct Mppi {
    settings: MppiSettings,
    /// Speed scales along the path.
    scales: Vec<f64>,
    /// The sequence that the next decision begins with.
    mean: Vec<Perturbation>,
    seed: Seed,
    decisions: u64,
}

impl Mppi {
    /// A controller that draws its perturbations from streams of `seed`.
    #[must_use]
    pub fn new(settings: MppiSettings, seed: Seed) -> Self {
        let mean = vec![Perturbation::default(); settings.horizon];
        Self { settings, scales: Vec::new(), mean, seed, decisions: 0 }
    }

    /// All sequences one after the other; the first two are the follower itself and the mean.
    fn samples(&self, robot: &RobotModel, rng: &mut Stream) -> Vec<Perturbation> {
        let MppiSettings { samples, horizon, bearing_sd_rad, speed_sd, .. } = self.settings;
        let speed_sd_mps = speed_sd * robot.max_speed_mps;
        let mut normal = |sd: f64| sd * <StandardNormal as Distribution<f64>>::sample(&StandardNormal, rng);
        let mut sequences = vec![Perturbation::default(); horizon];
        sequences.extend_from_slice(&self.mean);
        for _ in 2..samples {
            sequences.extend(self.mean.iter().map(|mean| Perturbation {
                bearing_rad: mean.bearing_rad + normal(bearing_sd_rad),
                speed_mps: mean.speed_mps + normal(speed_sd_mps),
            }));
        }
        sequences
    }
}

impl Policy for Mppi {
    fn enter(&mut self, situation: &Situation<'_>) {
        self.scales = self.settings.base.speed.along(situation.world, situation.guide.current);
        self.mean.fill(Perturbation::default());
    }

    fn decide(&mut self, situation: &Situation<'_>) -> Command {
        let Situation { world, observation, progress, guide } = *situation;
        let (robot, base) = (&*world.robot, &self.settings.base);
        let mut rng = self.seed.stream("decision", self.decisions);
        self.decisions += 1;
        let samples = self.samples(robot, &mut rng);
        let slip = observation.slip.unwrap_or_else(|| SlipEstimate::new(&NoiseModel::none()));
        let wanted = base.along(robot, &observation.state.pose, progress, (guide.current, &self.scales));
        let feed_forward = slip.feed_forward(&world.model, wanted, base.drift_compensation);
        let rollout = Rollout {
            world,
            settings: &self.settings,
            route: guide.current,
            scales: &self.scales,
            slip: slip.slip(),
            feed_forward,
            corner_m: (std::f64::consts::SQRT_2 - 1.0) * robot.footprint.half_width_m(),
        };
        let start = (&observation.state, progress);
        let costs: Vec<f64> =
            samples.chunks(self.settings.horizon).map(|sequence| rollout.cost(start, sequence)).collect();
        self.mean = weighted_mean(&samples, &costs, &self.settings);
        let command = self.mean[0].applied(robot, feed_forward.applied(wanted));
        self.mean.rotate_left(1);
        *self.mean.last_mut().expect("a sequence has actions") = Perturbation::default();
        command
    }
}

/// What all rollouts of a decision share.
struct Rollout<'a> {
    world: &'a World,
    settings: &'a MppiSettings,
    route: &'a GuidePath,
    scales: &'a [f64],
    slip: &'a SlipParameters,
    feed_forward: FeedForward,
    /// How far the outline's corners stick out of the discs beside which clearance is measured, metres: the last
    /// disc ends at the nose, so a corner is a half width ahead of and beside its centre.
    corner_m: f64,
}

impl Rollout<'_> {
    /// The cost of `sequence` from `start`: seconds of the way that is left undone, and what it risked.
    fn cost(&self, start: (&RobotState, &GuideProgress), sequence: &[Perturbation]) -> f64 {
        let Self { world, settings, route, slip, .. } = *self;
        let robot = &world.robot;
        let action_s = ActionSettings::default().action_s;
        let (mut state, mut progress) = (*start.0, *start.1);
        let (begun_m, mut cost) = (progress.arc_m, 0.0);
        for (number, perturbation) in sequence.iter().enumerate() {
            let base = settings.base.along(robot, &state.pose, &progress, (route, self.scales));
            let command = perturbation.applied(robot, self.feed_forward.applied(base));
            if !world.model.act(&mut state, command, slip, |at| self.is_free(at, &mut cost)) {
                // The later, the less certain.
                return cost + settings.contact_cost / (1.0 + number as f64);
            }
            progress.update(route, &state.pose);
            cost += settings.cross_weight * action_s * progress.cross_track_m * progress.cross_track_m;
            if route.length_m() - progress.arc_m < 1e-6 {
                break;
            }
        }
        let gained_s = (progress.arc_m - begun_m) / robot.max_speed_mps;
        cost - gained_s
    }

    /// Whether the model's robot may stand at `state`; adds what a time step there risks.
    fn is_free(&self, state: &RobotState, cost: &mut f64) -> bool {
        let MppiSettings { clearance_m, clearance_weight, .. } = *self.settings;
        let robot = &self.world.robot;
        let beside_m = clearance_beside_m(self.world, &state.pose);
        let lack = (1.0 - beside_m / clearance_m).clamp(0.0, 1.0);
        let speed = 0.3 + 0.7 * state.wheel_speed_mps / robot.max_speed_mps;
        *cost += clearance_weight * lack * lack * speed * MODEL_DT_S;
        // Where even the coarse clearance exceeds a cell's diagonal, the exact test is spared.
        let sure_m = 1.5 * self.world.geometry.clearance().frame().resolution_m;
        beside_m > sure_m + self.corner_m || self.world.geometry.is_free(state.pose)
    }
}

/// Clearance beside nose, middle and tail of the robot, metres.
fn clearance_beside_m(world: &World, pose: &Pose) -> f64 {
    let footprint = &world.robot.footprint;
    let reach_m = (footprint.half_length_m() - footprint.half_width_m()).max(0.0);
    let field = world.geometry.clearance();
    let unit = pose.heading.unit();
    let at = |ahead_m: f64| {
        field.frame().cell_at(pose.position + unit * ahead_m).map_or(0.0, |cell| field.at(cell))
    };
    at(reach_m).min(at(0.0)).min(at(-reach_m)) - footprint.inscribed_radius_m()
}

/// The mean of the sequences in `samples`, each with weight exp(−(cost − least) / temperature).
fn weighted_mean(samples: &[Perturbation], costs: &[f64], settings: &MppiSettings) -> Vec<Perturbation> {
    let least = costs.iter().copied().fold(f64::INFINITY, f64::min);
    let weights: Vec<f64> = costs.iter().map(|cost| (-(cost - least) / settings.temperature).exp()).collect();
    let total: f64 = weights.iter().sum();
    let mut mean = vec![Perturbation::default(); settings.horizon];
    for (sequence, weight) in samples.chunks(settings.horizon).zip(&weights) {
        for (mean, perturbation) in mean.iter_mut().zip(sequence) {
            mean.bearing_rad += perturbation.bearing_rad * weight / total;
            mean.speed_mps += perturbation.speed_mps * weight / total;
        }
    }
    mean
}
