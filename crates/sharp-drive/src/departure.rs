//! Leaving a tight place: slowly, towards waypoints so far away that their noise hardly turns the robot.

use crate::command::Command;
use crate::follower::{SteeringRule, compensated};
use crate::situation::Situation;

/// Speed of leaving a tight place, metres per second: drift turns a slow robot less before it is corrected.
pub const CAREFUL_MPS: f64 = 0.1;
/// Waypoints of a robot that turns in place: 5 cm of noise turn it by 5 mrad.
const FAR_M: f64 = 10.0;
/// Waypoints of a car, which steers by their curvature: further away it would hardly steer.
const FAR_CAR_M: f64 = 1.5;
/// Waypoints of a robot that turns at its goal: far, so that their noise turns it little, metres.
const TURN_REACH_M: f64 = 2.0;
/// Its speed, metres per second: a robot that stands does not turn.
const TURN_MPS: f64 = 0.02;
/// Along the guide's direction, and gently back to it.
const RULE: SteeringRule = SteeringRule::Field { look_ahead_m: 0.05, softness_m: 1.0 };
/// Share of the estimated drift that is compensated.
const DRIFT_COMPENSATION: f64 = 0.5;

/// The command for a robot that leaves a tight place along its guide.
pub(crate) fn careful(situation: &Situation<'_>) -> Command {
    let Situation { world, observation, progress, guide } = situation;
    let robot = &world.robot;
    let reach_m = if robot.can_turn_in_place() { FAR_M } else { FAR_CAR_M };
    let bearing_rad = RULE.bearing_rad(&observation.state.pose, progress, guide);
    let speed_mps = CAREFUL_MPS.max(robot.min_speed_mps).min(robot.max_speed_mps);
    let command = Command { reach_m, bearing_rad, speed_mps };
    world.held(&observation.state.pose, compensated(world, situation, command, DRIFT_COMPENSATION))
}

/// The command for a robot at its goal that has to turn by so much, radians: it hardly moves.
pub(crate) const fn turning(turn_rad: f64) -> Command {
    Command { reach_m: TURN_REACH_M, bearing_rad: turn_rad, speed_mps: TURN_MPS }
}
