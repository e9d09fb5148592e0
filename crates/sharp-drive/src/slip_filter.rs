//! The slip estimate: the slip and the drift of one robot, which are constant for an episode.
//!
//! An extended Kalman filter over ([`SlipParameters::yaw_share`], [`SlipParameters::drift_radps`]) compares the
//! turn of every action with the model's. A scalar filter compares the distance. The noise model gives the prior
//! and the measurement noise, which is large: the waypoint of each action is perturbed as well.

use rand::Rng;
use rand_distr::{Distribution, StandardNormal};
use sharp_sim::{EpisodeBias, NoiseModel, RobotState};
use sharp_space::Pose;

use crate::command::Command;
use crate::motion_model::{MotionModel, SlipParameters, TurnJacobian};

/// Standard deviation of the model's own error over one action, radians and metres.
const MODEL_SD: f64 = 0.01;
/// Least turn per radian of bearing that the feed-forward divides by: below it the correction would explode.
const SLOPE_MIN: f64 = 0.05;
/// Largest correction of a bearing, radians.
const FEED_FORWARD_MAX_RAD: f64 = 0.7;
/// A robot that slips more would hardly move.
const SLIP_DRAWN_MAX: f64 = 0.95;
/// Square of the number of standard deviations beyond which a measurement is an outlier and is ignored.
const OUTLIER: f64 = 25.0;

/// The estimate of one robot's slip and drift in one episode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SlipEstimate {
    slip: SlipParameters,
    /// Covariance of yaw share and drift: variance, covariance, variance.
    spread: [f64; 3],
    /// Variance of the speed share.
    speed_spread: f64,
    /// Standard deviations of what is drawn anew for every action: the gains (share), and the waypoint (metres).
    hidden: [f64; 2],
}

impl SlipEstimate {
    /// The estimate of a robot that has not moved yet; `noise` says what to expect.
    pub(crate) fn new(noise: &NoiseModel) -> Self {
        let share = 1.0 - 0.5 * noise.slip_max;
        // The variance of a uniform variable.
        let share_spread = noise.slip_max.powi(2) / 12.0;
        let drift_spread = noise.drift_sd_radps.powi(2) + noise.drift_bias_radps.powi(2);
        Self {
            slip: SlipParameters { speed_share: share, yaw_share: share, drift_radps: 0.0 },
            spread: [share_spread, 0.0, drift_spread],
            speed_spread: share_spread,
            hidden: [noise.gain_sd, noise.waypoint_sd_m],
        }
    }

    /// The best guess so far.
    pub(crate) const fn slip(&self) -> &SlipParameters {
        &self.slip
    }

    /// A slip and a pull that are as probable as the estimate says, as far as a robot can slip.
    pub(crate) fn draw(&self, rng: &mut impl Rng) -> EpisodeBias {
        let Self { slip, spread: [yy, yd, dd], speed_spread, .. } = self;
        let mut normal = || <StandardNormal as Distribution<f64>>::sample(&StandardNormal, rng);
        let (speed, first, second) = (normal(), normal(), normal());
        let yaw_sd = yy.max(0.0).sqrt();
        let along = if yaw_sd > 0.0 { yd / yaw_sd } else { 0.0 };
        let slipping = |share: f64| (1.0 - share).clamp(0.0, SLIP_DRAWN_MAX);
        EpisodeBias {
            speed_slip: slipping(slip.speed_share + speed_spread.max(0.0).sqrt() * speed),
            yaw_slip: slipping(slip.yaw_share + yaw_sd * first),
            drift_radps: slip.drift_radps + along * first + (dd - along * along).max(0.0).sqrt() * second,
        }
    }

    /// The estimate after `command` moved the robot from `before` to `after`. A motion that the noise does
    /// not explain, such as one that a wall ended, is ignored.
    pub(crate) fn after(
        mut self,
        model: &MotionModel,
        (before, command): (&RobotState, Command),
        after: &RobotState,
    ) -> Self {
        let mut expected = *before;
        let jacobian = model.act_with_jacobian(&mut expected, command, &self.slip);
        self.learn_turn((before, command), (&expected, &jacobian), after);
        self.learn_speed(before, &expected, after);
        self
    }

    fn learn_turn(
        &mut self,
        (before, command): (&RobotState, Command),
        (expected, jacobian): (&RobotState, &TurnJacobian),
        after: &RobotState,
    ) {
        let Self { slip, spread: [yy, yd, dd], hidden: [gain_sd, waypoint_sd_m], .. } = self;
        let TurnJacobian { by_yaw, by_drift, by_bearing } = *jacobian;
        let expected_rad = before.pose.heading.turn_to(expected.pose.heading);
        let bearing_sd = *waypoint_sd_m / command.reach_m.max(0.1);
        let doubt = (by_bearing * bearing_sd).powi(2)
            + (by_yaw * *gain_sd * slip.yaw_share).powi(2)
            + MODEL_SD.powi(2);
        let (ky, kd) = (*yy * by_yaw + *yd * by_drift, *yd * by_yaw + *dd * by_drift);
        let total = by_yaw * ky + by_drift * kd + doubt;
        let miss = before.pose.heading.turn_to(after.pose.heading) - expected_rad;
        if miss * miss > OUTLIER * total {
            return;
        }
        slip.yaw_share = (slip.yaw_share + ky / total * miss).clamp(0.1, 1.2);
        slip.drift_radps += kd / total * miss;
        (*yy, *yd, *dd) = (*yy - ky * ky / total, *yd - ky * kd / total, *dd - kd * kd / total);
    }

    fn learn_speed(&mut self, before: &RobotState, expected: &RobotState, after: &RobotState) {
        let Self { slip, speed_spread, hidden: [gain_sd, _], .. } = self;
        let expected_m = before.pose.distance_m(&expected.pose);
        let by_share = expected_m / slip.speed_share;
        let doubt = (by_share * *gain_sd * slip.speed_share).powi(2) + MODEL_SD.powi(2);
        let total = by_share * by_share * *speed_spread + doubt;
        let gain = *speed_spread * by_share / total;
        let miss_m = before.pose.distance_m(&after.pose) - expected_m;
        if miss_m * miss_m > OUTLIER * total {
            return;
        }
        slip.speed_share = (slip.speed_share + gain * miss_m).clamp(0.1, 1.2);
        *speed_spread -= gain * by_share * *speed_spread;
    }

    /// The correction of commands like `wanted` with which this robot moves as one without slip would;
    /// `share`, 0 to 1, of the drift is compensated.
    pub(crate) fn feed_forward(&self, model: &MotionModel, wanted: Command, share: f64) -> FeedForward {
        let mut state = RobotState::at_rest(Pose::new(0.0, 0.0, 0.0));
        state.wheel_speed_mps = wanted.speed_mps * self.slip.speed_share;
        let mut pulled = state;
        let ahead = Command { bearing_rad: 0.0, ..wanted };
        let slope = model.act_with_jacobian(&mut pulled, ahead, &self.slip).by_bearing;
        let pulled_rad = state.pose.heading.turn_to(pulled.pose.heading);
        let bearing_rad =
            (-pulled_rad / slope.max(SLOPE_MIN)).clamp(-FEED_FORWARD_MAX_RAD, FEED_FORWARD_MAX_RAD);
        FeedForward { bearing_rad: share * bearing_rad, speed_share: self.slip.speed_share }
    }
}

/// Feed-forward compensation of slip and drift.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct FeedForward {
    /// Added to bearings, radians.
    bearing_rad: f64,
    /// Speeds are divided by it.
    speed_share: f64,
}

impl FeedForward {
    /// `wanted` with the compensation.
    pub(crate) fn applied(&self, wanted: Command) -> Command {
        Command {
            bearing_rad: wanted.bearing_rad + self.bearing_rad,
            speed_mps: wanted.speed_mps / self.speed_share,
            ..wanted
        }
    }
}

#[cfg(test)]
mod tests {
    use sharp_sim::RobotModel;
    use sharp_space::trig;

    use super::*;

    const AHEAD: Command = Command { reach_m: 0.5, bearing_rad: 0.0, speed_mps: 0.5 };

    /// What is believed after 60 actions of a robot that is like `truth`.
    fn believed(robot: &RobotModel, truth: &SlipParameters) -> SlipEstimate {
        let model = MotionModel::new(robot);
        let noise = NoiseModel { gain_sd: 0.05, waypoint_sd_m: 0.01, ..NoiseModel::harsh() };
        let mut estimate = SlipEstimate::new(&noise);
        let mut state = RobotState::at_rest(Pose::new(0.0, 0.0, 0.0));
        for i in 0..60 {
            let command = Command { bearing_rad: 0.5 * trig::sin(f64::from(i) * 0.7), ..AHEAD };
            let before = state;
            model.act(&mut state, command, truth, |_| true);
            estimate = estimate.after(&model, (&before, command), &state);
        }
        estimate
    }

    #[test]
    fn slip_and_pull_are_recognised() {
        for robot in [RobotModel::husky(), RobotModel::limo()] {
            for drift_radps in [-0.3, 0.0, 0.3] {
                let truth = SlipParameters { speed_share: 0.6, yaw_share: 0.8, drift_radps };
                let found = *believed(&robot, &truth).slip();
                assert!((found.speed_share - 0.6).abs() < 0.05, "{}: {found:?}", robot.name);
                assert!((found.yaw_share - 0.8).abs() < 0.1, "{}: {found:?}", robot.name);
                assert!((found.drift_radps - drift_radps).abs() < 0.05, "{}: {found:?}", robot.name);
            }
        }
    }

    #[test]
    fn a_trimmed_robot_drives_straight_ahead() {
        for robot in [RobotModel::husky(), RobotModel::limo()] {
            let truth = SlipParameters { speed_share: 0.6, yaw_share: 0.8, drift_radps: 0.3 };
            let model = MotionModel::new(&robot);
            let command = believed(&robot, &truth).feed_forward(&model, AHEAD, 1.0).applied(AHEAD);
            let mut state = RobotState::at_rest(Pose::new(0.0, 0.0, 0.0));
            state.wheel_speed_mps = 0.5;
            let turn_rad = |waypoint| {
                let mut after = state;
                model.act(&mut after, waypoint, &truth, |_| true);
                after.pose.heading.radians()
            };
            let (plain_rad, trimmed_rad) = (turn_rad(AHEAD), turn_rad(command));
            assert!(plain_rad > 0.02, "{} is pulled to the left: {plain_rad}", robot.name);
            assert!(trimmed_rad.abs() < 0.6 * plain_rad, "{}: {trimmed_rad} of {plain_rad}", robot.name);
            assert!(command.bearing_rad < 0.0, "{} steers against it", robot.name);
            assert!((command.speed_mps - 0.5 / 0.6).abs() < 0.1, "{} makes up for slip", robot.name);
        }
    }

    #[test]
    fn an_action_that_a_wall_ended_says_nothing() {
        let model = MotionModel::new(&RobotModel::husky());
        let estimate = believed(
            &RobotModel::husky(),
            &SlipParameters { speed_share: 0.9, yaw_share: 0.9, drift_radps: 0.0 },
        );
        let before = RobotState::at_rest(Pose::new(0.0, 0.0, 0.0));
        let after = RobotState::at_rest(Pose::new(0.0, 0.0, 1.0));
        assert_eq!(estimate.after(&model, (&before, AHEAD), &after), estimate);
    }
}
