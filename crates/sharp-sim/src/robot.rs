//! Robots as data: the outline, the wheels and the limits.
//!
//! A robot is a RON file (`assets/robots` of this crate); no other code of the project depends on a robot's
//! name. The reference point is the middle between the wheels, around which a robot with fixed wheels turns; the
//! footprint may reach further to one side of it than to the other.

use serde::{Deserialize, Serialize};
use sharp_space::{Footprint, FootprintError, trig};
use thiserror::Error;

use crate::description::{self, SyntaxError};
use crate::robot_file::RobotText;
use crate::vehicle::BACK_OFF_MPS;

/// Longer names do not fit into a table, characters.
const NAME_MAX: usize = 64;

/// Why a robot's description was refused.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum RobotError {
    /// The text is not a robot in RON.
    #[error("robot description: {0}")]
    Syntax(#[from] SyntaxError),
    /// The name is empty, too long, cannot be printed or is no name of a folder: libraries are named by it.
    #[error(
        "robot name is {name:?}, must be 1 to {NAME_MAX} characters that can be printed, without / and \\ and no dot first"
    )]
    Name {
        /// The name.
        name: String,
    },
    /// The outline is impossible.
    #[error("robot {robot:?}: {source}")]
    Footprint {
        /// The robot's name.
        robot: String,
        /// What is wrong with the outline.
        source: FootprintError,
    },
    /// The file names no outline, or two.
    #[error("robot {robot:?}: has {problem}, must have footprint or robot_radius")]
    Outline {
        /// The robot's name.
        robot: String,
        /// What is wrong.
        problem: &'static str,
    },
    /// A number is out of range or not a number.
    #[error("robot {robot:?}: {field} is {value}, must be {expected}")]
    Value {
        /// The robot's name.
        robot: String,
        /// The name of the field.
        field: &'static str,
        /// Its value.
        value: f64,
        /// What is allowed.
        expected: String,
    },
}

/// The wheels and how they steer.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Drive {
    /// Fixed wheels that drive at different speeds left and right: turns in place, with two wheels a side by
    /// skidding.
    Differential {
        /// Distance between left and right wheels, metres.
        track_m: f64,
        /// Distance between front and rear axle, metres; 0 for one driven axle and casters.
        wheelbase_m: f64,
    },
    /// A car with steered front wheels.
    Ackermann {
        /// Distance between front and rear axle, metres.
        wheelbase_m: f64,
        /// Distance between left and right wheels, metres.
        track_m: f64,
        /// Largest angle of the virtual middle front wheel to either side, radians.
        max_steer_rad: f64,
        /// How fast that angle changes, radians per second.
        steer_rate_radps: f64,
    },
}

impl Drive {
    /// See [`RobotModel::yaw_gain`].
    pub(crate) fn yaw_gain(&self) -> f64 {
        match *self {
            Self::Differential { track_m, wheelbase_m } => {
                track_m * track_m / (track_m * track_m + wheelbase_m * wheelbase_m)
            }
            Self::Ackermann { .. } => 1.0,
        }
    }

    /// What it is called in results: `differential` or `ackermann`.
    #[must_use]
    pub const fn name(&self) -> &'static str {
        match self {
            Self::Differential { .. } => "differential",
            Self::Ackermann { .. } => "ackermann",
        }
    }
}

/// A wheeled robot.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "RobotText")]
pub struct RobotModel {
    /// What it is called in results and folders.
    pub name: String,
    /// Its outline.
    pub footprint: Footprint,
    /// Its wheels.
    pub drive: Drive,
    /// Mass, kilograms.
    pub mass_kg: f64,
    /// Moment of inertia about the vertical axis, kg m².
    pub yaw_inertia_kgm2: f64,
    /// Coulomb friction between wheels and floor.
    pub wheel_friction: f64,
    /// Fastest speed ahead, metres per second.
    pub max_speed_mps: f64,
    /// Fastest change of the wheels' speed, m/s².
    pub max_accel_mps2: f64,
    /// Fastest turn of the body, radians per second.
    pub max_yaw_rate_radps: f64,
    /// Fastest change of the commanded turn, rad/s².
    pub max_yaw_accel_radps2: f64,
    /// Slowest speed while driving; 0 for a robot that can stop and turn.
    pub min_speed_mps: f64,
    /// A goal counts as reached within this distance.
    pub goal_tolerance_m: f64,
    /// How far from the robot the waypoint of one action may lie.
    pub waypoint_reach_m: f64,
    /// How far it backs off from an obstacle; 0 for a robot that never reverses.
    pub recovery_reverse_m: f64,
}

/// The robots that come with the crate: name and description.
const BUILT_IN: [(&str, &str); 5] = [
    ("husky", include_str!("../assets/robots/husky.ron")),
    ("limo", include_str!("../assets/robots/limo.ron")),
    ("turtlebot3", include_str!("../assets/robots/turtlebot3.ron")),
    ("jackal", include_str!("../assets/robots/jackal.ron")),
    ("car", include_str!("../assets/robots/car.ron")),
];

impl RobotModel {
    /// The names of the built-in robots.
    pub fn names() -> impl Iterator<Item = &'static str> {
        BUILT_IN.iter().map(|&(name, _)| name)
    }

    /// The description of the built-in robot called `name`, in any case; `None` for other names.
    #[must_use]
    pub fn built_in_text(name: &str) -> Option<&'static str> {
        BUILT_IN.iter().find(|(known, _)| known.eq_ignore_ascii_case(name)).map(|&(_, text)| text)
    }

    /// The built-in robot called `name`, in any case; `None` for other names.
    #[must_use]
    pub fn built_in(name: &str) -> Option<Self> {
        let text = Self::built_in_text(name)?;
        Some(Self::from_ron(text).expect("every built-in robot is valid, as a test shows"))
    }

    /// The Clearpath Husky of the paper: moves ahead and rotates in place.
    #[must_use]
    pub fn husky() -> Self {
        Self::built_in("husky").expect("it is built in")
    }

    /// The Limo of the paper, a small car: moves ahead and steers.
    #[must_use]
    pub fn limo() -> Self {
        Self::built_in("limo").expect("it is built in")
    }

    /// Reads a robot from the text of a RON file. Footprint, drive and top speed are needed; the rest has
    /// defaults.
    ///
    /// # Errors
    /// Returns an error that names the first unreadable place, or the first field out of range, its value and
    /// what is allowed.
    pub fn from_ron(text: &str) -> Result<Self, RobotError> {
        description::parse::<RobotText>(text)?.try_into()
    }

    /// The same for a robot that is called `name` if the text does not say.
    ///
    /// # Errors
    /// As [`from_ron`](Self::from_ron).
    pub fn from_ron_named(text: &str, name: &str) -> Result<Self, RobotError> {
        description::parse::<RobotText>(text)?.named(name).try_into()
    }

    /// The least moment of inertia that the wheel law can move, kg m². It corrects a whole slip in one step; a body
    /// that is easier to turn than two point masses at the wheels would overshoot by more than the slip, and its
    /// motion would diverge.
    pub(crate) fn least_inertia_kgm2(&self) -> f64 {
        0.5 * self.mass_kg * 0.25 * (self.wheelbase_m().powi(2) + self.track_m().powi(2))
    }

    /// The tightest turn of the rear axle's middle, metres; 0 for a robot that turns in place.
    #[must_use]
    pub fn min_turning_radius_m(&self) -> f64 {
        match self.drive {
            Drive::Differential { .. } => 0.0,
            Drive::Ackermann { wheelbase_m, max_steer_rad, .. } => wheelbase_m / trig::tan(max_steer_rad),
        }
    }

    /// Returns true if it can change its heading without moving.
    #[must_use]
    pub const fn can_turn_in_place(&self) -> bool {
        matches!(self.drive, Drive::Differential { .. })
    }

    /// How fast it turns in steady state, as a share of what its wheels ask for.
    ///
    /// Four fixed wheels must slide sideways to turn. Isotropic friction balances at
    /// track² / (track² + wheelbase²): 0.554 for the Husky. A steered robot rolls: 1.
    #[must_use]
    pub fn yaw_gain(&self) -> f64 {
        self.drive.yaw_gain()
    }

    /// Distance between front and rear axle, metres.
    #[must_use]
    pub const fn wheelbase_m(&self) -> f64 {
        match self.drive {
            Drive::Differential { wheelbase_m, .. } | Drive::Ackermann { wheelbase_m, .. } => wheelbase_m,
        }
    }

    /// Distance between left and right wheels, metres.
    #[must_use]
    pub const fn track_m(&self) -> f64 {
        match self.drive {
            Drive::Differential { track_m, .. } | Drive::Ackermann { track_m, .. } => track_m,
        }
    }

    /// How fast it backs off, metres per second, forwards positive: [`BACK_OFF_MPS`], or its top speed if that is less.
    #[must_use]
    pub const fn back_off_mps(&self) -> f64 {
        BACK_OFF_MPS.min(self.max_speed_mps)
    }

    pub(crate) fn validate(&self) -> Result<(), RobotError> {
        let length = self.name.chars().count();
        let is_odd = |c: char| c.is_control() || matches!(c, '/' | '\\');
        if !(1..=NAME_MAX).contains(&length) || self.name.starts_with('.') || self.name.contains(is_odd) {
            return Err(RobotError::Name { name: self.name.clone() });
        }
        let positive = |field, value, max| self.require(field, value, f64::MIN_POSITIVE, max);
        positive("drive.track_m", self.track_m(), 20.0)?;
        if let Drive::Differential { wheelbase_m, .. } = self.drive {
            self.require("drive.wheelbase_m", wheelbase_m, 0.0, 20.0)?;
        }
        if let Drive::Ackermann { wheelbase_m, max_steer_rad, steer_rate_radps, .. } = self.drive {
            positive("drive.wheelbase_m", wheelbase_m, 20.0)?;
            positive("drive.max_steer_rad", max_steer_rad, 1.4)?;
            positive("drive.steer_rate_radps", steer_rate_radps, 100.0)?;
        }
        positive("mass_kg", self.mass_kg, 1e5)?;
        let least = self.least_inertia_kgm2();
        // A message with all digits of the bound would be hard to read.
        let least = if self.yaw_inertia_kgm2 < least { four_digits_up(least) } else { least };
        self.require("yaw_inertia_kgm2", self.yaw_inertia_kgm2, least, 1e6)?;
        positive("wheel_friction", self.wheel_friction, 10.0)?;
        positive("max_speed_mps", self.max_speed_mps, 100.0)?;
        positive("max_accel_mps2", self.max_accel_mps2, 1000.0)?;
        positive("max_yaw_rate_radps", self.max_yaw_rate_radps, 100.0)?;
        positive("max_yaw_accel_radps2", self.max_yaw_accel_radps2, 1000.0)?;
        self.require("min_speed_mps", self.min_speed_mps, 0.0, self.max_speed_mps)?;
        positive("goal_tolerance_m", self.goal_tolerance_m, 100.0)?;
        positive("waypoint_reach_m", self.waypoint_reach_m, 100.0)?;
        self.require("recovery_reverse_m", self.recovery_reverse_m, 0.0, 100.0)
    }

    /// Refuses everything outside `min..=max`, NaN included.
    fn require(&self, field: &'static str, value: f64, min: f64, max: f64) -> Result<(), RobotError> {
        if (min..=max).contains(&value) {
            return Ok(());
        }
        let expected = if min == f64::MIN_POSITIVE {
            format!("above 0 and at most {max}")
        } else {
            format!("from {min} to {max}")
        };
        Err(RobotError::Value { robot: self.name.clone(), field, value, expected })
    }
}

/// `value`, positive, rounded up to four digits.
fn four_digits_up(value: f64) -> f64 {
    let scale = 10_f64.powf(3.0 - value.log10().floor());
    (value * scale).ceil() / scale
}

#[cfg(test)]
mod tests {
    use super::*;

    const HUSKY: &str = include_str!("../assets/robots/husky.ron");
    const LIMO: &str = include_str!("../assets/robots/limo.ron");

    #[test]
    fn the_built_in_robots_are_those_of_the_paper() {
        let (husky, limo) = (RobotModel::husky(), RobotModel::limo());
        assert!(husky.can_turn_in_place(), "the husky rotates in place");
        assert_eq!(husky.min_turning_radius_m(), 0.0, "husky");
        assert!((husky.yaw_gain() - 0.554).abs() < 1e-3, "husky's yaw gain {}", husky.yaw_gain());
        assert!(!limo.can_turn_in_place(), "the limo is a car");
        assert!((limo.min_turning_radius_m() - 0.4).abs() < 1e-3, "limo {}", limo.min_turning_radius_m());
        assert_eq!(limo.yaw_gain(), 1.0, "limo's yaw gain");
    }

    #[test]
    fn built_in_robots_are_found_in_any_case_and_are_called_what_they_are() {
        for name in RobotModel::names() {
            let found = RobotModel::built_in(&name.to_uppercase()).map(|robot| robot.name);
            assert_eq!(found.as_deref(), Some(name));
        }
        assert_eq!(RobotModel::built_in("tank"), None);
    }

    #[test]
    fn a_robot_survives_a_round_trip() {
        for robot in RobotModel::names().map(|name| RobotModel::built_in(name).expect(name)) {
            let text = ron::to_string(&robot).unwrap();
            assert_eq!(RobotModel::from_ron(&text).unwrap(), robot, "{text}");
        }
    }

    #[test]
    fn errors_name_field_value_and_what_would_be_right() {
        let refuse = |text: &str, from: &str, to: &str, message: &str| {
            let changed = text.replace(from, to);
            assert_ne!(text, changed, "the test changes nothing: {from}");
            let error = RobotModel::from_ron(&changed).expect_err(to).to_string();
            assert!(error.starts_with(message), "{error}");
        };
        refuse(
            HUSKY,
            "mass_kg: 46.0",
            "mass_kg: NaN",
            r#"robot "husky": mass_kg is NaN, must be above 0 and at most 100000"#,
        );
        refuse(
            HUSKY,
            "inertia_kgm2: 5.0",
            "inertia_kgm2: 1.0",
            r#"robot "husky": yaw_inertia_kgm2 is 1, must be from 3.381 to 1000000"#,
        );
        refuse(
            LIMO,
            "steer_rad: 0.4636476",
            "steer_rad: 1.6",
            r#"robot "limo": drive.max_steer_rad is 1.6, must be above 0 and at most 1.4"#,
        );
        refuse(
            LIMO,
            "half_width_m: 0.11",
            "half_width_m: -0.11",
            "robot description: line 5 \"footprint: Footprint(half_length_m: 0.16, half_width_m: -0.11),\": \
             footprint half_width_m is -0.11 m, must be",
        );
        refuse(
            LIMO,
            "mass_kg: 4.8",
            "mas_kg: 4.8",
            "robot description: line 7 \"mas_kg: 4.8,\": Unexpected field named `mas_kg`",
        );
        refuse(
            HUSKY,
            "mass_kg: 46.0",
            "mass_kg: \"heavy\"",
            r#"robot description: line 7 "mass_kg: \"heavy\",": Expected float"#,
        );
        refuse(
            HUSKY,
            "    max_speed_mps: 1.0,\n",
            "",
            "robot description: line 17 \")\": Unexpected missing field named `max_speed_mps`",
        );
        refuse(HUSKY, "\"husky\"", "\"\"", "robot name is \"\", must be 1 to 64 characters");
        for name in ["../husky", "fleet/husky", "/tmp/husky", ".husky"] {
            refuse(HUSKY, "husky", name, &format!("robot name is {name:?}, must be 1 to 64 characters"));
        }
    }
}
