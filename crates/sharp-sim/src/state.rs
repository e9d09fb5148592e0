//! The state of a robot, and the commands to its wheels.

use serde::{Deserialize, Serialize};
use sharp_space::{Pose, Vector};

/// The state of a robot. Together with commands and noise it determines how the robot moves on.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct RobotState {
    /// Where the centre of the footprint is.
    pub pose: Pose,
    /// Velocity in the body's frame (ahead, left), metres per second.
    #[serde(with = "pair")]
    pub velocity: Vector,
    /// Turn of the body, radians per second, counter-clockwise.
    pub yaw_rate_radps: f64,
    /// Angle of the virtual middle front wheel, radians to the left; 0 for fixed wheels.
    pub steer_rad: f64,
    /// Rolling speed of the wheels, mean of left and right, metres per second.
    pub wheel_speed_mps: f64,
    /// Turn that fixed wheels would cause if they did not skid, radians per second; 0 for a car.
    pub wheel_yaw_rate_radps: f64,
}

impl RobotState {
    /// Standing still at `pose`, wheels straight.
    #[must_use]
    pub fn at_rest(pose: Pose) -> Self {
        Self::rolling(pose, 0.0)
    }

    /// Driving straight ahead at `speed_mps`.
    #[must_use]
    pub fn rolling(pose: Pose, speed_mps: f64) -> Self {
        Self {
            pose,
            velocity: Vector::new(speed_mps, 0.0),
            yaw_rate_radps: 0.0,
            steer_rad: 0.0,
            wheel_speed_mps: speed_mps,
            wheel_yaw_rate_radps: 0.0,
        }
    }

    /// Speed ahead, metres per second; negative backwards.
    #[must_use]
    pub fn speed_mps(&self) -> f64 {
        self.velocity.x
    }
}

/// A command to the wheels.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum WheelCommand {
    /// Speed and turn of the wheels; a skid-steered body follows with its yaw gain.
    Twist {
        /// Metres per second ahead.
        speed_mps: f64,
        /// Radians per second counter-clockwise.
        yaw_rate_radps: f64,
    },
    /// Speed and steering angle.
    Steer {
        /// Metres per second ahead, at the rear axle.
        speed_mps: f64,
        /// Radians to the left.
        steer_rad: f64,
    },
}

/// Two numbers in place of a vector.
mod pair {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};
    use sharp_space::Vector;

    pub(super) fn serialize<S: Serializer>(vector: &Vector, serializer: S) -> Result<S::Ok, S::Error> {
        [vector.x, vector.y].serialize(serializer)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Vector, D::Error> {
        <[f64; 2]>::deserialize(deserializer).map(|[x, y]| Vector::new(x, y))
    }
}
