//! The wheel law: how four wheels push a body on a flat floor.
//!
//! Each contact point resists its slip, the difference between how the body moves there and how the
//! wheel rolls, by a friction that grows with the slip and saturates at Coulomb's limit. Both
//! simulators share it, so that they agree wherever nothing is touched.

use sharp_space::{Vector, trig, wrap_angle};

use crate::robot::{Drive, RobotModel};
use crate::state::{RobotState, WheelCommand};

pub(crate) const GRAVITY_MPS2: f64 = 9.81;

/// The wheels of a robot.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Wheels {
    drive: Drive,
    /// Where they touch the floor, in the body's frame.
    contacts: [Vector; 4],
    /// Fastest change of velocity that friction allows, m/s².
    grip_mps2: f64,
    mass_by_inertia_pm2: f64,
    max_accel_mps2: f64,
    /// Of the wheels: the body's limit divided by the yaw gain.
    max_yaw_accel_radps2: f64,
}

/// A sudden change of velocity, in the body's frame.
#[derive(Clone, Copy, Debug)]
pub(crate) struct WheelPush {
    pub(crate) velocity: Vector,
    pub(crate) yaw_rate_radps: f64,
}

impl Wheels {
    pub(crate) fn new(robot: &RobotModel) -> Self {
        let (x, y) = (robot.wheelbase_m() / 2.0, robot.track_m() / 2.0);
        Self {
            drive: robot.drive,
            contacts: [(x, y), (x, -y), (-x, y), (-x, -y)].map(|(x, y)| Vector::new(x, y)),
            grip_mps2: robot.wheel_friction * GRAVITY_MPS2,
            mass_by_inertia_pm2: robot.mass_kg / robot.yaw_inertia_kgm2,
            max_accel_mps2: robot.max_accel_mps2,
            max_yaw_accel_radps2: robot.max_yaw_accel_radps2 / robot.yaw_gain(),
        }
    }

    /// Lets the wheels follow `command` for `dt_s` as fast as the motors can.
    pub(crate) fn follow(&self, state: &mut RobotState, command: WheelCommand, dt_s: f64) {
        let speed_mps = match command {
            WheelCommand::Twist { speed_mps, .. } | WheelCommand::Steer { speed_mps, .. } => speed_mps,
        };
        state.wheel_speed_mps = approach(state.wheel_speed_mps, speed_mps, self.max_accel_mps2 * dt_s);
        match self.drive {
            Drive::Differential { wheelbase_m, .. } => {
                let target = match command {
                    WheelCommand::Twist { yaw_rate_radps, .. } => yaw_rate_radps,
                    WheelCommand::Steer { speed_mps, steer_rad } if wheelbase_m > 0.0 => {
                        speed_mps * trig::tan(steer_rad) / wheelbase_m
                    }
                    WheelCommand::Steer { .. } => 0.0,
                };
                let step = self.max_yaw_accel_radps2 * dt_s;
                state.wheel_yaw_rate_radps = approach(state.wheel_yaw_rate_radps, target, step);
            }
            Drive::Ackermann { wheelbase_m, max_steer_rad, steer_rate_radps, .. } => {
                let target = match command {
                    WheelCommand::Steer { steer_rad, .. } => steer_rad,
                    WheelCommand::Twist { speed_mps, yaw_rate_radps } => {
                        steer_for(speed_mps, yaw_rate_radps, wheelbase_m)
                    }
                };
                let target = target.clamp(-max_steer_rad, max_steer_rad);
                state.steer_rad = approach(state.steer_rad, target, steer_rate_radps * dt_s);
            }
        }
    }

    /// What friction does to the body within `dt_s`.
    pub(crate) fn push(&self, state: &RobotState, dt_s: f64) -> WheelPush {
        let (rolling, turn) = self.rolling(state);
        // Each wheel carries a quarter of the weight and corrects a quarter of the slip. Together they stop a
        // straight slide within one step, however long it is.
        let limit = self.grip_mps2 * dt_s;
        let (slide, spin) = (state.velocity - rolling, state.yaw_rate_radps - turn.rate_radps);
        let mut velocity = Vector::zeros();
        let mut moment = 0.0;
        for contact in &self.contacts {
            let lateral = state.yaw_rate_radps - turn.lateral_rate_radps;
            let slip = slide + Vector::new(-spin * contact.y, lateral * contact.x);
            // Most contacts do not slip; they need no root and no division.
            let square = slip.norm_squared();
            let share = if square <= limit * limit { 0.25 } else { 0.25 * limit / square.sqrt() };
            let change = slip * -share;
            velocity += change;
            moment += contact.x * change.y - contact.y * change.x;
        }
        WheelPush { velocity, yaw_rate_radps: moment * self.mass_by_inertia_pm2 }
    }

    /// How the body would move if no wheel slipped: its velocity, and the turn that the wheels roll
    /// (`rate_radps`) and steer (`lateral_rate_radps`).
    fn rolling(&self, state: &RobotState) -> (Vector, WheelTurn) {
        let speed = state.wheel_speed_mps;
        match self.drive {
            Drive::Differential { .. } => (
                Vector::new(speed, 0.0),
                WheelTurn { rate_radps: state.wheel_yaw_rate_radps, lateral_rate_radps: 0.0 },
            ),
            Drive::Ackermann { wheelbase_m, .. } => {
                let rate_radps = speed * trig::tan(state.steer_rad) / wheelbase_m;
                // The rear axle does not move sideways; the reference point is half a wheelbase ahead.
                (
                    Vector::new(speed, rate_radps * wheelbase_m / 2.0),
                    WheelTurn { rate_radps, lateral_rate_radps: rate_radps },
                )
            }
        }
    }
}

/// The turn of the body that wheels allow without slip.
#[derive(Clone, Copy, Debug)]
struct WheelTurn {
    /// From the difference of speed between left and right.
    rate_radps: f64,
    /// From the angle between front and rear wheels: 0 if all are fixed.
    lateral_rate_radps: f64,
}

/// The steering angle that turns a car at `yaw_rate_radps` while it drives at `speed_mps`.
fn steer_for(speed_mps: f64, yaw_rate_radps: f64, wheelbase_m: f64) -> f64 {
    let steer_rad = trig::atan2(wheelbase_m * yaw_rate_radps, speed_mps.abs());
    if speed_mps < 0.0 { wrap_angle(-steer_rad) } else { steer_rad }
}

/// `from`, moved towards `to` by at most `step`.
#[must_use]
pub fn approach(from: f64, to: f64, step: f64) -> f64 {
    from + (to - from).clamp(-step, step)
}
