//! Noise: the stochastic part of the transition function T(x, a, x′) of the paper's SSP.
//!
//! Every draw is keyed by (seed, episode, action), so forks, threads and the order of calls change nothing.
//! Some errors are drawn once per episode (a worn wheel, a wet floor), others for every action.

use rand::RngExt;
use rand_distr::{Distribution, StandardNormal};
use serde::{Deserialize, Serialize};
use sharp_space::{Point, Seed, Vector};
use thiserror::Error;

use crate::description::{self, SyntaxError};
use crate::robot::RobotModel;
use crate::state::WheelCommand;

/// Side of a square of slippery floor, metres: about one action's travel.
const PATCH_M: f64 = 0.5;
/// Steering error of a car that drifts by 1 rad/s at 1 m/s. On the Limo's wheelbase it has 1.5 times
/// the effect that the name promises; the values of the nominal noise were tuned with it.
pub const STEER_PER_DRIFT_S: f64 = 0.3;
/// With more slip a wheel would not drive at all.
const SLIP_MAX: f64 = 0.95;
/// The largest factor that a name may have. With more, no robot could drive under any built-in noise.
const FACTOR_MAX: f64 = 10.0;

/// Why a noise model was refused.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum NoiseError {
    /// The text is not a noise model in RON.
    #[error("noise description: {0}")]
    Syntax(#[from] SyntaxError),
    /// A number is out of range or not a number.
    #[error("noise: {field} is {value}, must be from 0 to {max}")]
    Value {
        /// The name of the field.
        field: &'static str,
        /// Its value.
        value: f64,
        /// The largest value allowed.
        max: f64,
    },
    /// No built-in noise has this name.
    #[error("noise is {0:?}, must be none, nominal, harsh or biased, also with a factor as in nominal*2")]
    Name(String),
    /// The number after a built-in noise's name is no factor.
    #[error("noise {name:?}: the factor is {factor:?}, must be a number from 0 to {FACTOR_MAX}")]
    Factor {
        /// The whole name.
        name: String,
        /// What stands after the asterisk.
        factor: String,
    },
}

/// How much the motion differs from the command.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct NoiseModel {
    /// Standard deviation of the factors on speed and on turn, drawn for every action.
    pub gain_sd: f64,
    /// Largest share of speed and of turn that is lost, each uniform from 0 and constant for an
    /// episode.
    pub slip_max: f64,
    /// Standard deviation of the pull to one side at 1 m/s, constant for an episode, rad/s.
    pub drift_sd_radps: f64,
    /// A pull of this size in every episode, to a side drawn once per episode, rad/s at 1 m/s.
    pub drift_bias_radps: f64,
    /// Standard deviation of each coordinate of the waypoint, metres: the paper's perturbed action.
    pub waypoint_sd_m: f64,
    /// Floor that slips more than the rest.
    pub slippery_patches: Option<SlipperyPatches>,
    /// Commands reach the wheels this much later, seconds; rounded to whole control periods.
    pub delay_s: f64,
}

/// Squares of slippery floor with sides of half a metre, drawn anew every episode.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SlipperyPatches {
    /// Share of the floor, 0 to 1.
    pub share: f64,
    /// Share of speed and turn lost there besides the episode's slip, 0 to 1.
    pub extra_slip: f64,
}

impl NoiseModel {
    /// The names that [`by_name`](Self::by_name) knows.
    pub const NAMES: [&str; 4] = ["none", "nominal", "harsh", "biased"];

    /// A perfect robot on a perfect floor.
    #[must_use]
    pub fn none() -> Self {
        Self::built_in(include_str!("../assets/noise/none.ron"))
    }

    /// The noise under which options are learnt and evaluated.
    #[must_use]
    pub fn nominal() -> Self {
        Self::built_in(include_str!("../assets/noise/nominal.ron"))
    }

    /// About twice the nominal noise.
    #[must_use]
    pub fn harsh() -> Self {
        Self::built_in(include_str!("../assets/noise/harsh.ron"))
    }

    /// A constant pull, patches of slippery floor and a delay: noise whose mean is not zero.
    #[must_use]
    pub fn biased() -> Self {
        Self::built_in(include_str!("../assets/noise/biased.ron"))
    }

    /// One of [`NAMES`](Self::NAMES), or one of them [scaled](Self::scaled): `nominal*2`, `harsh*0.5`.
    ///
    /// # Errors
    /// Returns [`NoiseError::Name`] for any other name and [`NoiseError::Factor`] for a factor that is no
    /// number from 0 to 10.
    pub fn by_name(name: &str) -> Result<Self, NoiseError> {
        let (kind, factor) = name.split_once('*').map_or((name, None), |(kind, text)| (kind, Some(text)));
        let noise = match kind {
            "none" => Self::none(),
            "nominal" => Self::nominal(),
            "harsh" => Self::harsh(),
            "biased" => Self::biased(),
            _ => return Err(NoiseError::Name(name.to_owned())),
        };
        let Some(text) = factor else { return Ok(noise) };
        match text.parse() {
            Ok(factor) if (0.0..=FACTOR_MAX).contains(&factor) => Ok(noise.scaled(factor)),
            _ => Err(NoiseError::Factor { name: name.to_owned(), factor: text.to_owned() }),
        }
    }

    /// Reads a noise model from the text of a RON file.
    ///
    /// # Errors
    /// Returns an error that names the first unreadable place, or the first field out of range.
    pub fn from_ron(text: &str) -> Result<Self, NoiseError> {
        let noise: Self = description::parse(text)?;
        noise.validate()?;
        Ok(noise)
    }

    /// The same kinds of noise, `factor` times as strong; slips stay below 1, and 0 leaves no noise.
    #[must_use]
    pub fn scaled(&self, factor: f64) -> Self {
        Self {
            gain_sd: self.gain_sd * factor,
            slip_max: (self.slip_max * factor).min(SLIP_MAX),
            drift_sd_radps: self.drift_sd_radps * factor,
            drift_bias_radps: self.drift_bias_radps * factor,
            waypoint_sd_m: self.waypoint_sd_m * factor,
            slippery_patches: self
                .slippery_patches
                .map(|patches| SlipperyPatches {
                    extra_slip: (patches.extra_slip * factor).min(SLIP_MAX),
                    ..patches
                })
                .filter(|patches| patches.extra_slip > 0.0),
            delay_s: self.delay_s * factor,
        }
    }

    fn built_in(text: &str) -> Self {
        Self::from_ron(text).expect("the built-in noise models are valid, as a test shows")
    }

    fn validate(&self) -> Result<(), NoiseError> {
        let patches = self.slippery_patches.unwrap_or(SlipperyPatches { share: 0.0, extra_slip: 0.0 });
        let fields = [
            ("gain_sd", self.gain_sd, 10.0),
            ("slip_max", self.slip_max, SLIP_MAX),
            ("drift_sd_radps", self.drift_sd_radps, 10.0),
            ("drift_bias_radps", self.drift_bias_radps, 10.0),
            ("waypoint_sd_m", self.waypoint_sd_m, 10.0),
            ("slippery_patches.share", patches.share, 1.0),
            ("slippery_patches.extra_slip", patches.extra_slip, SLIP_MAX),
            ("delay_s", self.delay_s, 10.0),
        ];
        match fields.into_iter().find(|&(_, value, max)| !(0.0..=max).contains(&value)) {
            Some((field, value, max)) => Err(NoiseError::Value { field, value, max }),
            None => Ok(()),
        }
    }
}

/// What stays the same for an episode and nobody tells the robot.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EpisodeBias {
    /// Share of the speed that is lost.
    pub speed_slip: f64,
    /// Share of the turn that is lost.
    pub yaw_slip: f64,
    /// Pull to one side at 1 m/s, rad/s, left positive.
    pub drift_radps: f64,
}

/// The noise of one episode.
#[derive(Clone, Debug)]
pub struct EpisodeNoise {
    model: NoiseModel,
    key: Seed,
    speed_slip: f64,
    yaw_slip: f64,
    drift_radps: f64,
}

/// The noise of one action.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ActionNoise {
    /// Factor on the speed, never negative.
    pub speed_gain: f64,
    /// Factor on the turn or the steering angle, never negative.
    pub yaw_gain: f64,
    /// How far the waypoint is moved, metres in the world frame.
    pub waypoint_shift: Vector,
}

impl EpisodeNoise {
    /// The noise of episode number `episode` under `seed`.
    #[must_use]
    pub fn new(model: &NoiseModel, seed: Seed, episode: u64) -> Self {
        let key = seed.child("simulator", episode);
        let stream = &mut key.stream("episode", 0);
        let speed_slip = model.slip_max * stream.random::<f64>();
        let yaw_slip = model.slip_max * stream.random::<f64>();
        let drift: f64 = StandardNormal.sample(stream);
        let bias = if stream.random::<bool>() { model.drift_bias_radps } else { -model.drift_bias_radps };
        let drift_radps = model.drift_sd_radps * drift + bias;
        Self { model: model.clone(), key, speed_slip, yaw_slip, drift_radps }
    }

    /// The same noise of actions with another slip and pull: those of a robot on a floor that is known.
    #[must_use]
    pub const fn with_bias(mut self, bias: EpisodeBias) -> Self {
        let EpisodeBias { speed_slip, yaw_slip, drift_radps } = bias;
        (self.speed_slip, self.yaw_slip, self.drift_radps) = (speed_slip, yaw_slip, drift_radps);
        self
    }

    /// Slip and pull of the episode.
    #[must_use]
    pub const fn bias(&self) -> EpisodeBias {
        let Self { speed_slip, yaw_slip, drift_radps, .. } = *self;
        EpisodeBias { speed_slip, yaw_slip, drift_radps }
    }

    /// The noise of action number `action`; the same at every call.
    #[must_use]
    pub fn action(&self, action: u64) -> ActionNoise {
        let stream = &mut self.key.stream("action", action);
        let mut normal =
            |sd: f64| sd * <StandardNormal as Distribution<f64>>::sample(&StandardNormal, stream);
        ActionNoise {
            speed_gain: (1.0 + normal(self.model.gain_sd)).max(0.0),
            yaw_gain: (1.0 + normal(self.model.gain_sd)).max(0.0),
            waypoint_shift: Vector::new(normal(self.model.waypoint_sd_m), normal(self.model.waypoint_sd_m)),
        }
    }

    /// What the wheels do instead of `command` while the robot stands at `position`.
    #[must_use]
    pub fn distort(
        &self,
        command: WheelCommand,
        action: &ActionNoise,
        robot: &RobotModel,
        position: Point,
    ) -> WheelCommand {
        let extra_slip = self.extra_slip(position);
        let speed_factor = action.speed_gain * (1.0 - self.speed_slip - extra_slip).max(0.0);
        let yaw_factor = action.yaw_gain * (1.0 - self.yaw_slip - extra_slip).max(0.0);
        match command {
            WheelCommand::Twist { speed_mps, yaw_rate_radps } => {
                let speed_mps = speed_mps * speed_factor;
                let drift_radps = self.drift_radps * speed_mps.abs() / robot.yaw_gain();
                WheelCommand::Twist { speed_mps, yaw_rate_radps: yaw_rate_radps * yaw_factor + drift_radps }
            }
            WheelCommand::Steer { speed_mps, steer_rad } => WheelCommand::Steer {
                speed_mps: speed_mps * speed_factor,
                steer_rad: steer_rad * yaw_factor + self.drift_radps * STEER_PER_DRIFT_S,
            },
        }
    }

    fn extra_slip(&self, position: Point) -> f64 {
        let Some(patches) = self.model.slippery_patches else { return 0.0 };
        let (col, row) = ((position.x / PATCH_M).floor() as i32, (position.y / PATCH_M).floor() as i32);
        let index = u64::from(col as u32) << 32 | u64::from(row as u32);
        let slippery = self.key.stream("patch", index).random::<f64>() < patches.share;
        if slippery { patches.extra_slip } else { 0.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn mean_and_sd(values: &[f64]) -> (f64, f64) {
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        (mean, (values.iter().map(|v| (v - mean).powi(2)).sum::<f64>() / count).sqrt())
    }

    fn check_statistics(what: &str, values: &[f64], mean: f64, sd: f64) {
        let (found_mean, found_sd) = mean_and_sd(values);
        // Five standard errors: a wrong formula is off by far more.
        let tolerance = 5.0 * sd / (values.len() as f64).sqrt();
        assert!((found_mean - mean).abs() <= tolerance, "mean of {what}: {found_mean}, expected {mean}");
        assert!((found_sd - sd).abs() <= 0.05 * sd + 1e-12, "sd of {what}: {found_sd}, expected {sd}");
    }

    #[test]
    fn action_draws_have_the_wanted_spread() {
        let noise = EpisodeNoise::new(&NoiseModel::nominal(), Seed(1), 0);
        let draws: Vec<ActionNoise> = (0..10_000).map(|i| noise.action(i)).collect();
        let column = |f: fn(&ActionNoise) -> f64| draws.iter().map(f).collect::<Vec<_>>();
        check_statistics("speed gain", &column(|d| d.speed_gain), 1.0, 0.20);
        check_statistics("yaw gain", &column(|d| d.yaw_gain), 1.0, 0.20);
        check_statistics("waypoint x", &column(|d| d.waypoint_shift.x), 0.0, 0.05);
        check_statistics("waypoint y", &column(|d| d.waypoint_shift.y), 0.0, 0.05);
        let product = column(|d| (d.speed_gain - 1.0) * (d.yaw_gain - 1.0));
        check_statistics("the two gains' product", &product, 0.0, 0.04);
    }

    #[test]
    fn episode_draws_have_the_wanted_spread() {
        let column = |model: &NoiseModel, f: fn(&EpisodeNoise) -> f64| {
            (0..10_000).map(|i| f(&EpisodeNoise::new(model, Seed(2), i))).collect::<Vec<_>>()
        };
        let (nominal, biased) = (NoiseModel::nominal(), NoiseModel::biased());
        // A uniform variable on [0, 0.3].
        check_statistics("speed slip", &column(&nominal, |n| n.speed_slip), 0.15, 0.3 / 12_f64.sqrt());
        check_statistics("yaw slip", &column(&nominal, |n| n.yaw_slip), 0.15, 0.3 / 12_f64.sqrt());
        check_statistics("drift", &column(&nominal, |n| n.drift_radps), 0.0, 0.15);
        let drifts = column(&biased, |n| n.drift_radps);
        assert!(drifts.iter().all(|d| d.abs() == 0.3), "a biased robot always pulls as strongly");
        check_statistics("biased drift", &drifts, 0.0, 0.3);
    }

    #[test]
    fn slippery_floor_covers_its_share() {
        let noise = EpisodeNoise::new(&NoiseModel::biased(), Seed(3), 0);
        let slippery = (0..10_000)
            .filter(|i| {
                noise.extra_slip(Point::new(f64::from(i % 100) * 0.5, f64::from(i / 100) * -0.5)) > 0.0
            })
            .count();
        assert!((1300..1700).contains(&slippery), "{slippery} of 10000 squares, expected 15 %");
    }

    #[test]
    fn draws_do_not_depend_on_the_order_of_calls() {
        let noise = EpisodeNoise::new(&NoiseModel::harsh(), Seed(4), 7);
        let forwards: Vec<_> = (0..50).map(|i| noise.action(i)).collect();
        let fork = noise.clone();
        let mut backwards: Vec<_> = (0..50).rev().map(|i| fork.action(i)).collect();
        backwards.reverse();
        assert_eq!(forwards, backwards);
        let other = EpisodeNoise::new(&NoiseModel::harsh(), Seed(4), 8);
        assert_ne!(noise.action(0), other.action(0), "another episode");
        assert_ne!(forwards[0], forwards[1], "another action");
    }

    #[test]
    fn slip_and_pull_can_be_given() {
        let drawn = EpisodeNoise::new(&NoiseModel::nominal(), Seed(4), 7);
        let given = EpisodeBias { speed_slip: 0.1, yaw_slip: 0.2, drift_radps: -0.3 };
        let noise = drawn.clone().with_bias(given);
        assert_eq!((noise.bias(), noise.action(3)), (given, drawn.action(3)), "actions keep their noise");
        assert_eq!(noise.with_bias(drawn.bias()).bias(), drawn.bias());
    }

    #[test]
    fn no_noise_changes_nothing() {
        let noise = EpisodeNoise::new(&NoiseModel::none(), Seed(5), 0);
        let action = noise.action(3);
        assert_eq!(action.waypoint_shift, Vector::zeros());
        for (robot, command) in [
            (RobotModel::husky(), WheelCommand::Twist { speed_mps: 0.7, yaw_rate_radps: -0.4 }),
            (RobotModel::limo(), WheelCommand::Steer { speed_mps: 0.7, steer_rad: -0.4 }),
        ] {
            assert_eq!(noise.distort(command, &action, &robot, Point::origin()), command);
        }
    }

    #[test]
    fn scaling_keeps_the_kinds() {
        for noise in [NoiseModel::nominal(), NoiseModel::harsh(), NoiseModel::biased()] {
            assert_eq!(noise.scaled(0.0), NoiseModel::none(), "{noise:?}");
        }
        assert_eq!(NoiseModel::nominal().scaled(1.0), NoiseModel::nominal());
        assert_eq!(NoiseModel::harsh().scaled(10.0).slip_max, SLIP_MAX, "slip stays below 1");
    }

    #[test]
    fn every_name_is_known() {
        for name in NoiseModel::NAMES {
            assert!(NoiseModel::by_name(name).is_ok(), "{name}");
        }
    }

    #[test]
    fn names_may_have_a_factor() {
        for (name, noise) in [
            ("nominal*2", NoiseModel::nominal().scaled(2.0)),
            ("harsh*0.5", NoiseModel::harsh().scaled(0.5)),
            ("biased*1", NoiseModel::biased()),
            ("nominal*0", NoiseModel::none()),
        ] {
            assert_eq!(NoiseModel::by_name(name).expect(name), noise, "{name}");
        }
        for factor in ["", "two", "-1", "10.5", "inf", "NaN", "2*2"] {
            let name = format!("nominal*{factor}");
            let error = NoiseModel::by_name(&name).expect_err(&name).to_string();
            let expected = format!("noise {name:?}: the factor is {factor:?}, must be a number from 0 to 10");
            assert_eq!(error, expected);
        }
        for name in ["loud", "loud*2", "*2", ""] {
            let error = NoiseModel::by_name(name).expect_err(name).to_string();
            assert!(error.starts_with(&format!("noise is {name:?}, must be none, nominal")), "{error}");
        }
    }

    #[test]
    fn every_noise_with_the_largest_factor_is_valid() {
        for name in NoiseModel::NAMES {
            let noise = NoiseModel::by_name(&format!("{name}*{FACTOR_MAX}")).expect(name);
            assert!(noise.validate().is_ok(), "{name}: {noise:?}");
        }
    }

    #[test]
    fn errors_name_field_value_and_range() {
        refuse("slip_max: 0.30", "slip_max: 1.5", "noise: slip_max is 1.5, must be from 0 to 0.95");
        refuse("delay_s: 0.1", "delay_s: NaN", "noise: delay_s is NaN, must be from 0 to 10");
        refuse("share: 0.15", "share: -1", "noise: slippery_patches.share is -1, must be from 0 to 1");
        refuse(
            "gain_sd",
            "gain_sf",
            "noise description: line 3 \"gain_sf: 0.20,\": Unexpected field named `gain_sf`",
        );
        refuse("share: 0.15, ", "", "noise description: line 8");
        refuse(
            "gain_sd: 0.20",
            "gain_sd: wide",
            "noise description: line 3 \"gain_sd: wide,\": Expected float",
        );
    }

    fn refuse(from: &str, to: &str, message: &str) {
        let text = include_str!("../assets/noise/biased.ron");
        let changed = text.replace(from, to);
        assert_ne!(text, changed, "the test changes nothing: {from}");
        let error = NoiseModel::from_ron(&changed).expect_err(to).to_string();
        assert!(error.starts_with(message), "{error}");
    }
}
