//! The motion model of slip estimates and of model-predictive control.
//!
//! The robot's own waypoint controller drives a body that follows its wheels. The model has no friction and no
//! walls, and a time step of two control periods. In place of noise it has the [`SlipParameters`] of the robot.

use sharp_sim::{
    ActionSettings, Drive, RobotModel, RobotState, STEER_PER_DRIFT_S, WaypointController, WheelCommand,
    approach,
};
use sharp_space::{Heading, Pose, Vector, trig};

use crate::command::Command;

/// Time step of the model, seconds: two control periods.
pub(crate) const MODEL_DT_S: f64 = 0.1;

/// How one robot on one floor differs from its data sheet; constant for an episode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SlipParameters {
    /// Speed as a share of the commanded one.
    pub(crate) speed_share: f64,
    /// Turn or steering angle as a share of the commanded one.
    pub(crate) yaw_share: f64,
    /// Pull to the left at 1 m/s, radians per second, as noise models state it.
    pub(crate) drift_radps: f64,
}

/// Predicts what actions do.
#[derive(Clone, Debug)]
pub(crate) struct MotionModel {
    pub(crate) robot: RobotModel,
    controller: WaypointController,
}

impl MotionModel {
    pub(crate) fn new(robot: &RobotModel) -> Self {
        let controller = WaypointController::new(robot, ActionSettings::default().action_s);
        Self { robot: robot.clone(), controller }
    }

    /// Moves `state` by one action; false as soon as `is_free` denies a state on the way.
    pub(crate) fn act(
        &self,
        state: &mut RobotState,
        waypoint: Command,
        slip: &SlipParameters,
        mut is_free: impl FnMut(&RobotState) -> bool,
    ) -> bool {
        let aim = self.controller.aim(&state.pose, waypoint.to_world(&state.pose), waypoint.speed_mps);
        (0..steps()).all(|_| {
            let command = self.controller.command(state, &aim);
            self.follow(state, command, slip);
            is_free(state)
        })
    }

    /// Moves `state` by one action and returns the Jacobian of its turn with respect to what was assumed.
    ///
    /// Derivatives are propagated along the motion. The change of the way with the heading is left out.
    pub(crate) fn act_with_jacobian(
        &self,
        state: &mut RobotState,
        waypoint: Command,
        slip: &SlipParameters,
    ) -> TurnJacobian {
        let aim = self.controller.aim(&state.pose, waypoint.to_world(&state.pose), waypoint.speed_mps);
        let (mut turn, mut rate) = (TurnJacobian::default(), TurnJacobian::default());
        for _ in 0..steps() {
            let (command, slope) = self.controller.command_and_slope(state, &aim);
            let response = self.follow(state, command, slip);
            let (WheelCommand::Twist { yaw_rate_radps: asked, .. }
            | WheelCommand::Steer { steer_rad: asked, .. }) = command;
            if !response.is_limited {
                let by_turn = slope * slip.yaw_share * response.unit;
                rate = TurnJacobian {
                    by_yaw: asked * response.unit - by_turn * turn.by_yaw,
                    by_drift: response.pull - by_turn * turn.by_drift,
                    by_bearing: by_turn * (1.0 - turn.by_bearing),
                };
            }
            turn.by_yaw += response.turn * rate.by_yaw;
            turn.by_drift += response.turn * rate.by_drift;
            turn.by_bearing += response.turn * rate.by_bearing;
        }
        turn
    }

    /// One time step; returns the derivatives of its motion.
    fn follow(&self, state: &mut RobotState, command: WheelCommand, slip: &SlipParameters) -> Response {
        let robot = &self.robot;
        let SlipParameters { speed_share, yaw_share, drift_radps } = *slip;
        let (WheelCommand::Twist { speed_mps, .. } | WheelCommand::Steer { speed_mps, .. }) = command;
        let wanted_mps = speed_mps * speed_share;
        state.wheel_speed_mps =
            approach(state.wheel_speed_mps, wanted_mps, robot.max_accel_mps2 * MODEL_DT_S);
        let (turn_rad, slip_rad, response) = match (robot.drive, command) {
            (
                Drive::Ackermann { steer_rate_radps, wheelbase_m, max_steer_rad, .. },
                WheelCommand::Steer { steer_rad, .. },
            ) => {
                let wanted_rad = steer_rad * yaw_share + drift_radps * STEER_PER_DRIFT_S;
                let within_rad = wanted_rad.clamp(-max_steer_rad, max_steer_rad);
                let step = steer_rate_radps * MODEL_DT_S;
                let is_limited = wanted_rad != within_rad || (within_rad - state.steer_rad).abs() > step;
                state.steer_rad = approach(state.steer_rad, within_rad, step);
                let tan = trig::tan(state.steer_rad);
                let way = state.wheel_speed_mps / wheelbase_m * MODEL_DT_S;
                let turn = way * (1.0 + tan * tan);
                (way * tan, 0.5 * tan, Response { unit: 1.0, pull: STEER_PER_DRIFT_S, is_limited, turn })
            }
            (_, WheelCommand::Twist { yaw_rate_radps, .. }) => {
                let step = robot.max_yaw_accel_radps2 * MODEL_DT_S;
                let unit = robot.yaw_gain();
                let wanted_radps = yaw_rate_radps * yaw_share * unit + drift_radps * wanted_mps;
                let is_limited = (wanted_radps - state.yaw_rate_radps).abs() > step;
                state.yaw_rate_radps = approach(state.yaw_rate_radps, wanted_radps, step);
                let response = Response { unit, pull: wanted_mps, is_limited, turn: MODEL_DT_S };
                (state.yaw_rate_radps * MODEL_DT_S, 0.0, response)
            }
            (Drive::Differential { .. }, WheelCommand::Steer { .. }) => (0.0, 0.0, Response::default()),
        };
        let heading = state.pose.heading.radians();
        let way =
            Heading::new(heading + slip_rad + 0.5 * turn_rad).unit() * (state.wheel_speed_mps * MODEL_DT_S);
        state.pose = Pose::at(state.pose.position + way, Heading::new(heading + turn_rad));
        state.velocity = Vector::new(state.wheel_speed_mps, 0.0);
        response
    }
}

/// Partial derivatives of the turn of one action, radians.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct TurnJacobian {
    /// Per unit of [`SlipParameters::yaw_share`].
    pub(crate) by_yaw: f64,
    /// Per radian per second of [`SlipParameters::drift_radps`].
    pub(crate) by_drift: f64,
    /// Per radian of bearing.
    pub(crate) by_bearing: f64,
}

/// How one time step responds to its command.
#[derive(Clone, Copy, Debug, Default)]
struct Response {
    /// Yaw rate or steering angle per commanded one.
    unit: f64,
    /// Yaw rate or steering angle per radian per second of drift.
    pull: f64,
    /// True where the robot could not follow in one step: small changes change nothing.
    is_limited: bool,
    /// Turn per yaw rate or steering angle.
    turn: f64,
}

/// Time steps of an action.
fn steps() -> usize {
    (ActionSettings::default().action_s / MODEL_DT_S).round() as usize
}

#[cfg(test)]
mod tests {
    use super::*;

    /// How far the slopes are from the differences of two actions, as a share, at 600 places.
    fn misses(robot: &RobotModel) -> Vec<f64> {
        const STEP: f64 = 1e-3;
        let model = MotionModel::new(robot);
        let mut misses = vec![];
        for i in 0..200 {
            let wave = |frequency: f64| trig::sin(f64::from(i) * frequency);
            let slip = SlipParameters { speed_share: 0.8, yaw_share: 0.8, drift_radps: 0.2 * wave(0.3) };
            let waypoint = Command { reach_m: 0.5, bearing_rad: 0.3 * wave(0.7), speed_mps: 0.5 };
            let mut before = RobotState::rolling(Pose::new(1.0, 2.0, 3.0), 0.4);
            (before.yaw_rate_radps, before.steer_rad) = (0.3 * wave(1.1), 0.1 * wave(1.1));
            let turn_rad = |waypoint, slip: &SlipParameters| {
                let mut after = before;
                model.act(&mut after, waypoint, slip, |_| true);
                before.pose.heading.turn_to(after.pose.heading)
            };
            let mut after = before;
            let slopes = model.act_with_jacobian(&mut after, waypoint, &slip);
            let plain_rad = turn_rad(waypoint, &slip);
            assert_eq!(before.pose.heading.turn_to(after.pose.heading), plain_rad, "the same motion");
            let turned = Command { bearing_rad: waypoint.bearing_rad + STEP, ..waypoint };
            let yaw = SlipParameters { yaw_share: slip.yaw_share + STEP, ..slip };
            let drift = SlipParameters { drift_radps: slip.drift_radps + STEP, ..slip };
            for (slope, other_rad) in [
                (slopes.by_bearing, turn_rad(turned, &slip)),
                (slopes.by_yaw, turn_rad(waypoint, &yaw)),
                (slopes.by_drift, turn_rad(waypoint, &drift)),
            ] {
                let expected = (other_rad - plain_rad) / STEP;
                misses.push((slope - expected).abs() / (0.05 + expected.abs()));
            }
        }
        misses.sort_by(f64::total_cmp);
        misses
    }

    #[test]
    fn slopes_are_the_differences_of_two_actions() {
        for robot in [RobotModel::husky(), RobotModel::limo()] {
            let misses = misses(&robot);
            let (median, ninth) = (misses[misses.len() / 2], misses[misses.len() * 9 / 10]);
            assert!(median < 0.1 && ninth < 0.4, "{}: median miss {median}, nine in ten {ninth}", robot.name);
        }
    }
}
