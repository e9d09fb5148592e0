//! Robots as people write them: footprint, drive and top speed; everything else has a default.
//!
//! The defaults are those of the built-in robots where they agree, scaled by size and speed where they do not.
//! `docs/robots.md` lists them.

use serde::{Deserialize, Deserializer};
use sharp_space::{Footprint, trig};

use crate::robot::{Drive, RobotError, RobotModel};

/// The name of a robot whose file does not say.
const NAME: &str = "robot";
/// Mass of a square metre of robot, kilograms: 69 for the Husky, 68 for the Limo, 78 for the Jackal.
const MASS_KGPM2: f64 = 70.0;
/// Inertia above the least that the wheel law allows, as a share.
const INERTIA_RESERVE: f64 = 1.05;
/// Rubber on a hard floor.
const WHEEL_FRICTION: f64 = 0.8;
/// The top speed is reached in a third of a second, but not faster than this, m/s²: as the built-in robots do.
const ACCEL_MAX_MPS2: f64 = 3.0;
/// Fastest turn of a robot that turns in place, radians per second: the Husky's.
const YAW_RATE_MAX_RADPS: f64 = 2.0;
/// A second's change of the turn, as a share of the fastest turn.
const YAW_ACCEL_PS: f64 = 3.0;
/// A lock takes about half a second, radians per second.
const STEER_RATE_RADPS: f64 = 1.0;
/// Slowest speed of a car, as a share of its fastest.
const CRAWL_SHARE: f64 = 0.1;
/// Distance between left and right wheels, as a share of the width.
const TRACK_SHARE: f64 = 0.85;
/// Tolerance at the goal: never less than this, metres, and two thirds of the robot's outer radius.
const GOAL_TOLERANCE_M: f64 = 0.3;
/// The waypoint of an action lies as far as the robot drives in an action, but not nearer than this, metres: noise
/// moves waypoints by centimetres.
const WAYPOINT_REACH_M: f64 = 0.5;
/// How far a robot backs off from an obstacle, metres.
const REVERSE_M: f64 = 0.4;

/// A robot file. Fields that may be left out are `None` then.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields, rename = "RobotModel")]
pub(crate) struct RobotText {
    #[serde(default, deserialize_with = "given")]
    name: Option<String>,
    #[serde(default, deserialize_with = "given")]
    footprint: Option<Footprint>,
    #[serde(default, deserialize_with = "given")]
    robot_radius: Option<f64>,
    drive: DriveText,
    #[serde(default, deserialize_with = "given")]
    mass_kg: Option<f64>,
    #[serde(default, deserialize_with = "given")]
    yaw_inertia_kgm2: Option<f64>,
    #[serde(default, deserialize_with = "given")]
    wheel_friction: Option<f64>,
    max_speed_mps: f64,
    #[serde(default, deserialize_with = "given")]
    max_accel_mps2: Option<f64>,
    #[serde(default, deserialize_with = "given")]
    max_yaw_rate_radps: Option<f64>,
    #[serde(default, deserialize_with = "given")]
    max_yaw_accel_radps2: Option<f64>,
    #[serde(default, deserialize_with = "given")]
    min_speed_mps: Option<f64>,
    #[serde(default, deserialize_with = "given")]
    goal_tolerance_m: Option<f64>,
    #[serde(default, deserialize_with = "given")]
    waypoint_reach_m: Option<f64>,
    #[serde(default, deserialize_with = "given")]
    recovery_reverse_m: Option<f64>,
}

#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields, rename = "Drive")]
enum DriveText {
    Differential {
        #[serde(default, deserialize_with = "given")]
        track_m: Option<f64>,
        #[serde(default)]
        wheelbase_m: f64,
    },
    Ackermann {
        wheelbase_m: f64,
        #[serde(default, deserialize_with = "given")]
        track_m: Option<f64>,
        max_steer_rad: f64,
        #[serde(default, deserialize_with = "given")]
        steer_rate_radps: Option<f64>,
    },
}

/// A value that is there: robot files write `mass_kg: 5.0`, not `mass_kg: Some(5.0)`.
fn given<'de, T: Deserialize<'de>, D: Deserializer<'de>>(deserializer: D) -> Result<Option<T>, D::Error> {
    T::deserialize(deserializer).map(Some)
}

impl RobotText {
    /// Gives the robot `name` if its file does not.
    pub(crate) fn named(mut self, name: &str) -> Self {
        self.name.get_or_insert_with(|| name.to_owned());
        self
    }

    fn outline(&self, robot: &str) -> Result<Footprint, RobotError> {
        match (self.footprint, self.robot_radius) {
            (Some(footprint), None) => Ok(footprint),
            (None, Some(radius_m)) => Footprint::disc(radius_m)
                .map_err(|source| RobotError::Footprint { robot: robot.to_owned(), source }),
            (footprint, _) => {
                let problem = if footprint.is_some() { "both of them" } else { "neither of them" };
                Err(RobotError::Outline { robot: robot.to_owned(), problem })
            }
        }
    }
}

impl TryFrom<RobotText> for RobotModel {
    type Error = RobotError;

    fn try_from(text: RobotText) -> Result<Self, RobotError> {
        let name = text.name.clone().unwrap_or_else(|| NAME.to_owned());
        let footprint = text.outline(&name)?;
        let drive = text.drive.complete(&footprint);
        let top_mps = text.max_speed_mps;
        let (length_m, width_m) = (2.0 * footprint.half_length_m(), 2.0 * footprint.half_width_m());
        let mass_kg = text.mass_kg.unwrap_or(MASS_KGPM2 * length_m * width_m);
        let is_car = matches!(drive, Drive::Ackermann { .. });
        let max_yaw_rate_radps = text.max_yaw_rate_radps.unwrap_or_else(|| fastest_turn(&drive, top_mps));
        let mut robot = Self {
            name,
            footprint,
            drive,
            mass_kg,
            yaw_inertia_kgm2: 0.0,
            wheel_friction: text.wheel_friction.unwrap_or(WHEEL_FRICTION),
            max_speed_mps: top_mps,
            max_accel_mps2: text.max_accel_mps2.unwrap_or((3.0 * top_mps).min(ACCEL_MAX_MPS2)),
            max_yaw_rate_radps,
            max_yaw_accel_radps2: text.max_yaw_accel_radps2.unwrap_or(YAW_ACCEL_PS * max_yaw_rate_radps),
            min_speed_mps: text.min_speed_mps.unwrap_or(if is_car { CRAWL_SHARE * top_mps } else { 0.0 }),
            goal_tolerance_m: text
                .goal_tolerance_m
                .unwrap_or_else(|| (footprint.circumscribed_radius_m() / 1.5).max(GOAL_TOLERANCE_M)),
            waypoint_reach_m: text.waypoint_reach_m.unwrap_or((0.5 * top_mps).max(WAYPOINT_REACH_M)),
            recovery_reverse_m: text.recovery_reverse_m.unwrap_or(REVERSE_M),
        };
        robot.yaw_inertia_kgm2 = text.yaw_inertia_kgm2.unwrap_or_else(|| {
            let even = mass_kg * (length_m * length_m + width_m * width_m) / 12.0;
            even.max(INERTIA_RESERVE * robot.least_inertia_kgm2())
        });
        robot.validate()?;
        Ok(robot)
    }
}

impl DriveText {
    fn complete(self, footprint: &Footprint) -> Drive {
        let usual_track_m = 2.0 * TRACK_SHARE * footprint.half_width_m();
        match self {
            Self::Differential { track_m, wheelbase_m } => {
                Drive::Differential { track_m: track_m.unwrap_or(usual_track_m), wheelbase_m }
            }
            Self::Ackermann { wheelbase_m, track_m, max_steer_rad, steer_rate_radps } => Drive::Ackermann {
                wheelbase_m,
                track_m: track_m.unwrap_or(usual_track_m),
                max_steer_rad,
                steer_rate_radps: steer_rate_radps.unwrap_or(STEER_RATE_RADPS),
            },
        }
    }
}

/// The fastest turn that the wheels allow at `top_mps`, radians per second.
fn fastest_turn(drive: &Drive, top_mps: f64) -> f64 {
    match *drive {
        // Skidding wheels turn the body by less than their speeds ask for: see `RobotModel::yaw_gain`.
        Drive::Differential { track_m, .. } => {
            (drive.yaw_gain() * 2.0 * top_mps / track_m).min(YAW_RATE_MAX_RADPS)
        }
        Drive::Ackermann { wheelbase_m, max_steer_rad, .. } => {
            top_mps * trig::tan(max_steer_rad) / wheelbase_m
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_few_lines_make_a_robot() {
        let robot = RobotModel::from_ron(
            "(robot_radius: 0.2, drive: Differential(track_m: 0.3), max_speed_mps: 0.5)",
        )
        .expect("the rest has defaults");
        assert_eq!(robot.footprint, Footprint::disc(0.2).expect("a disc"));
        assert_eq!(robot.drive, Drive::Differential { track_m: 0.3, wheelbase_m: 0.0 });
        assert_eq!((robot.yaw_gain(), robot.min_speed_mps, robot.goal_tolerance_m), (1.0, 0.0, 0.3));
        assert_eq!(
            (robot.max_accel_mps2, robot.max_yaw_rate_radps, robot.name.as_str()),
            (1.5, 2.0, "robot")
        );
        let car = RobotModel::from_ron(
            "RobotModel(footprint: \"[[1.4,0.4],[-0.3,0.4],[-0.3,-0.4],[1.4,-0.4]]\", \
             drive: Ackermann(wheelbase_m: 1.0, max_steer_rad: 0.5), max_speed_mps: 2.0)",
        )
        .expect("a car");
        assert!((car.max_yaw_rate_radps - 2.0 * trig::tan(0.5)).abs() < 1e-12, "full speed at full lock");
        assert_eq!((car.min_speed_mps, car.waypoint_reach_m), (0.2, 1.0), "from its speed");
        assert_eq!(car.footprint.half_length_m(), 1.4, "its nose");
    }

    #[test]
    fn every_outline_survives_a_round_trip() {
        for outline in [
            "footprint: Footprint(half_length_m: 0.5, half_width_m: 0.3)",
            "footprint: (radius_m: 0.25)",
            "footprint: (corners: [(0.4, 0.2), (-0.1, 0.2), (-0.1, -0.2), (0.4, -0.2)])",
            "footprint: \"[[0.4, 0.2], [-0.1, 0.3], [-0.1, -0.2]]\"",
            "robot_radius: 0.3",
        ] {
            let text = format!("({outline}, drive: Differential(), max_speed_mps: 1.0)");
            let robot = RobotModel::from_ron(&text).unwrap_or_else(|error| panic!("{text}: {error}"));
            let again = ron::to_string(&robot).expect("plain values");
            assert_eq!(RobotModel::from_ron(&again).unwrap(), robot, "{again}");
        }
    }

    #[test]
    fn what_is_missing_or_told_twice_is_named() {
        let drive = "drive: Differential(), max_speed_mps: 1.0";
        for (text, message) in [
            (
                format!("({drive})"),
                "robot \"robot\": has neither of them, must have footprint or robot_radius",
            ),
            (
                format!("(robot_radius: 0.1, footprint: (radius_m: 0.1), {drive})"),
                "robot \"robot\": has both of them",
            ),
            (format!("(robot_radius: -0.1, {drive})"), "robot \"robot\": footprint radius_m is -0.1 m"),
            (format!("(footprint: (length: 0.1), {drive})"), "robot description: line 1"),
            (format!("(footprint: \"[[1, 2]\", {drive})"), "robot description: line 1"),
            (format!("(footprint: (half_length_m: 0.1), {drive})"), "robot description: line 1"),
            ("(robot_radius: 0.1, max_speed_mps: 1.0)".to_owned(), "robot description: line 1"),
        ] {
            let error = RobotModel::from_ron(&text).expect_err(&text).to_string();
            assert!(error.starts_with(message), "{text}: {error}");
        }
    }
}
