//! The robot as policies imagine it: its waypoint controller on a body that follows its wheels.
//!
//! No friction and no walls, a time step of two control periods, and the [`Traits`] of the robot at
//! hand in place of noise.

use sharp_sim::{
    ActionSettings, Command, Drive, RobotModel, RobotState, STEER_PER_DRIFT_S, WaypointController,
};
use sharp_space::{Heading, Pose, Vector};

use crate::policy::PolarWaypoint;

/// Time step of the model, seconds: two control periods.
pub(crate) const MODEL_DT_S: f64 = 0.1;

/// What sets one robot on one floor apart from its data sheet; constant for an episode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Traits {
    /// Speed as a share of the commanded one.
    pub(crate) speed_share: f64,
    /// Turn or steering angle as a share of the commanded one.
    pub(crate) yaw_share: f64,
    /// Pull to the left at 1 m/s, radians per second, as noise models state it.
    pub(crate) drift_radps: f64,
}

/// Predicts what actions do.
#[derive(Clone, Debug)]
pub(crate) struct Model {
    pub(crate) robot: RobotModel,
    controller: WaypointController,
}

impl Model {
    pub(crate) fn new(robot: &RobotModel) -> Self {
        let controller = WaypointController::new(robot, ActionSettings::default().action_s);
        Self { robot: robot.clone(), controller }
    }

    /// Moves `state` by one action; false as soon as `is_free` denies a state on the way.
    pub(crate) fn act(
        &self,
        state: &mut RobotState,
        waypoint: PolarWaypoint,
        traits: &Traits,
        mut is_free: impl FnMut(&RobotState) -> bool,
    ) -> bool {
        let aim = self.controller.aim(&state.pose, waypoint.to_world(&state.pose), waypoint.speed_mps);
        let steps = (ActionSettings::default().action_s / MODEL_DT_S).round() as usize;
        (0..steps).all(|_| {
            let command = self.controller.command(state, &aim);
            self.follow(state, command, traits);
            is_free(state)
        })
    }

    /// The turn that one action makes from `state`, radians.
    pub(crate) fn turn_rad(&self, state: &RobotState, waypoint: PolarWaypoint, traits: &Traits) -> f64 {
        let mut after = *state;
        self.act(&mut after, waypoint, traits, |_| true);
        state.pose.heading.turn_to(after.pose.heading)
    }

    fn follow(&self, state: &mut RobotState, command: Command, traits: &Traits) {
        let robot = &self.robot;
        let Traits { speed_share, yaw_share, drift_radps } = *traits;
        let (Command::Twist { speed_mps, .. } | Command::Steer { speed_mps, .. }) = command;
        let wanted_mps = speed_mps * speed_share;
        state.wheel_speed_mps =
            approach(state.wheel_speed_mps, wanted_mps, robot.max_accel_mps2 * MODEL_DT_S);
        let (turn_rad, slip_rad) = match (robot.drive, command) {
            (
                Drive::Ackermann { steer_rate_radps, wheelbase_m, max_steer_rad, .. },
                Command::Steer { steer_rad, .. },
            ) => {
                let wanted_rad = steer_rad * yaw_share + drift_radps * STEER_PER_DRIFT_S;
                let wanted_rad = wanted_rad.clamp(-max_steer_rad, max_steer_rad);
                state.steer_rad = approach(state.steer_rad, wanted_rad, steer_rate_radps * MODEL_DT_S);
                let tan = state.steer_rad.tan();
                (state.wheel_speed_mps * tan / wheelbase_m * MODEL_DT_S, 0.5 * tan)
            }
            (_, Command::Twist { yaw_rate_radps, .. }) => {
                let step = robot.max_yaw_accel_radps2 * MODEL_DT_S;
                let wanted_radps = yaw_rate_radps * yaw_share * robot.yaw_gain() + drift_radps * wanted_mps;
                state.yaw_rate_radps = approach(state.yaw_rate_radps, wanted_radps, step);
                (state.yaw_rate_radps * MODEL_DT_S, 0.0)
            }
            (Drive::Differential { .. }, Command::Steer { .. }) => (0.0, 0.0),
        };
        let heading = state.pose.heading.radians();
        let way =
            Heading::new(heading + slip_rad + 0.5 * turn_rad).unit() * (state.wheel_speed_mps * MODEL_DT_S);
        state.pose = Pose::at(state.pose.position + way, Heading::new(heading + turn_rad));
        state.velocity = Vector::new(state.wheel_speed_mps, 0.0);
    }
}

fn approach(value: f64, target: f64, step: f64) -> f64 {
    value + (target - value).clamp(-step, step)
}
