//! From the waypoint of an action to wheel commands.
//!
//! The actions of the paper's policies are points that the robot's own controller drives to. The controller
//! knows the robot's limits and its mean yaw gain, but not the noise.

use sharp_space::{Point, Pose, Vector, trig};

use crate::robot::{Drive, RobotModel};
use crate::state::{RobotState, WheelCommand};

/// Turn per bearing, 1/s: a quarter of a second to face the waypoint, well above the control period.
const BEARING_GAIN_PS: f64 = 4.0;
/// Cosine of the bearing beyond which a robot turns in place: 60 degrees.
const TURN_IN_PLACE_COS: f64 = 0.5;
/// Least distance of the point steered at. Nearer points would turn the robot wildly as it arrives.
const LOOK_AHEAD_M: f64 = 0.25;

/// Drives a robot towards waypoints, forward only.
#[derive(Clone, Copy, Debug)]
pub struct WaypointController {
    drive: Drive,
    yaw_gain: f64,
    min_speed_mps: f64,
    max_speed_mps: f64,
    max_yaw_rate_radps: f64,
    action_s: f64,
}

/// The target of one action. It is fixed when the action begins, so that the speed does not drop on arrival.
#[derive(Clone, Copy, Debug)]
pub struct Aim {
    waypoint: Point,
    direction: Vector,
    speed_mps: f64,
}

impl WaypointController {
    /// A controller for `robot` whose actions last `action_s` seconds.
    #[must_use]
    pub fn new(robot: &RobotModel, action_s: f64) -> Self {
        Self {
            drive: robot.drive,
            yaw_gain: robot.yaw_gain(),
            min_speed_mps: robot.min_speed_mps,
            max_speed_mps: robot.max_speed_mps,
            max_yaw_rate_radps: robot.max_yaw_rate_radps,
            action_s,
        }
    }

    /// Begins an action at `pose`: the waypoint's distance asks for the speed that covers it within
    /// the action, up to `speed_max_mps`. A waypoint that is not finite asks for a stop.
    #[must_use]
    pub fn aim(&self, pose: &Pose, waypoint: Point, speed_max_mps: f64) -> Aim {
        let way = waypoint - pose.position;
        let distance_m = way.norm();
        if !distance_m.is_finite() {
            return Aim { waypoint: pose.position, direction: pose.heading.unit(), speed_mps: 0.0 };
        }
        let wanted_mps = (distance_m / self.action_s).min(speed_max_mps);
        let speed_mps = wanted_mps.clamp(self.min_speed_mps, self.max_speed_mps);
        let direction = if distance_m > 1e-6 { way / distance_m } else { pose.heading.unit() };
        Aim { waypoint, direction, speed_mps }
    }

    /// The command for the next control period.
    #[must_use]
    pub fn command(&self, state: &RobotState, aim: &Aim) -> WheelCommand {
        self.towards(self.target(state, aim), aim.speed_mps)
    }

    /// The same, and what a waypoint turned by one radian would change: the yaw rate, rad/s, or the steering
    /// angle, rad; 0 where the robot already turns as much as it can.
    #[must_use]
    pub fn command_and_slope(&self, state: &RobotState, aim: &Aim) -> (WheelCommand, f64) {
        let target = self.target(state, aim);
        let command = self.towards(target, aim.speed_mps);
        let slope = match (self.drive, command) {
            (Drive::Differential { .. }, WheelCommand::Twist { yaw_rate_radps, .. }) => {
                let saturates = (yaw_rate_radps * self.yaw_gain).abs() >= self.max_yaw_rate_radps;
                if saturates || aim.speed_mps <= 0.0 { 0.0 } else { BEARING_GAIN_PS / self.yaw_gain }
            }
            (Drive::Ackermann { wheelbase_m, max_steer_rad, .. }, WheelCommand::Steer { steer_rad, .. }) => {
                if steer_rad.abs() >= max_steer_rad {
                    0.0
                } else {
                    pursuit_slope(target, wheelbase_m)
                }
            }
            _ => 0.0,
        };
        (command, slope)
    }

    /// The point steered at, in the robot's frame.
    fn target(&self, state: &RobotState, aim: &Aim) -> Vector {
        let left_m = (aim.waypoint - state.pose.position).dot(&aim.direction);
        let beyond_m = (LOOK_AHEAD_M - left_m).max(0.0);
        state.pose.to_local(aim.waypoint + aim.direction * beyond_m)
    }

    fn towards(&self, target: Vector, speed_mps: f64) -> WheelCommand {
        match self.drive {
            Drive::Differential { .. } => self.turn_towards(target, speed_mps),
            Drive::Ackermann { wheelbase_m, max_steer_rad, .. } => {
                WheelCommand::Steer { speed_mps, steer_rad: pursue(target, wheelbase_m, max_steer_rad) }
            }
        }
    }

    fn turn_towards(&self, target: Vector, speed_mps: f64) -> WheelCommand {
        let bearing = trig::atan2(target.y, target.x);
        // 1 straight ahead, 0 or less from the bearing at which it turns in place.
        let distance_m = target.norm();
        let cos = if distance_m > 0.0 { target.x / distance_m } else { 1.0 };
        let ahead = (cos - TURN_IN_PLACE_COS) / (1.0 - TURN_IN_PLACE_COS);
        let turn = (BEARING_GAIN_PS * bearing).clamp(-self.max_yaw_rate_radps, self.max_yaw_rate_radps);
        let moving = if speed_mps > 0.0 { 1.0 } else { 0.0 };
        WheelCommand::Twist {
            speed_mps: speed_mps * ahead.max(0.0),
            yaw_rate_radps: moving * turn / self.yaw_gain,
        }
    }
}

/// Pure pursuit: the steering angle of the circle from the rear axle through `target`; full lock for
/// a target behind, to the left if it is straight behind.
fn pursue(target: Vector, wheelbase_m: f64, max_steer_rad: f64) -> f64 {
    let from_axle = target + Vector::new(wheelbase_m / 2.0, 0.0);
    if from_axle.x <= 0.0 {
        return if from_axle.y < 0.0 { -max_steer_rad } else { max_steer_rad };
    }
    let curvature = 2.0 * from_axle.y / from_axle.norm_squared();
    trig::atan2(wheelbase_m * curvature, 1.0).clamp(-max_steer_rad, max_steer_rad)
}

/// The derivative of [`pursue`] where it is below full lock, as `target` turns around the robot's centre.
fn pursuit_slope(target: Vector, wheelbase_m: f64) -> f64 {
    let from_axle = target + Vector::new(wheelbase_m / 2.0, 0.0);
    let turned = Vector::new(-target.y, target.x);
    let square = from_axle.norm_squared();
    let curvature = 2.0 * from_axle.y / square;
    let change = (2.0 * turned.y - 2.0 * curvature * from_axle.dot(&turned)) / square;
    wheelbase_m * change / (1.0 + (wheelbase_m * curvature).powi(2))
}
