//! What a robot is like, learnt while it drives: the slip and the pull that stay for an episode.
//!
//! An extended Kalman filter over ([`Traits::yaw_share`], [`Traits::drift_radps`]) compares the turn
//! of every action with the model's, and a scalar one its way. The noise model gives the priors and
//! how much a single action says: little, for its waypoint is perturbed, too.

use sharp_sim::{NoiseModel, RobotState};
use sharp_space::Pose;

use crate::model::{Model, Slopes, Traits};
use crate::policy::PolarWaypoint;

/// What the model itself may be wrong by over one action, radians and metres.
const MODEL_SD: f64 = 0.01;
/// A robot that turns less than this per radian of bearing is not trimmed by more.
const SLOPE_MIN: f64 = 0.05;
/// A correction of a bearing beyond this is no correction, radians.
const TRIM_MAX_RAD: f64 = 0.7;
/// A surprise beyond so many standard deviations, squared, was no noise.
const OUTLIER: f64 = 25.0;

/// What is believed of one robot in one episode.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Belief {
    traits: Traits,
    /// Covariance of yaw share and drift: variance, covariance, variance.
    spread: [f64; 3],
    /// Variance of the speed share.
    speed_spread: f64,
    /// What a single action hides: deviation of the gains, and of the waypoint in metres.
    hidden: [f64; 2],
}

impl Belief {
    /// The belief of a robot that has not moved yet; `noise` says what to expect.
    pub(crate) fn new(noise: &NoiseModel) -> Self {
        let share = 1.0 - 0.5 * noise.slip_max;
        // The variance of a uniform variable.
        let share_spread = noise.slip_max.powi(2) / 12.0;
        let drift_spread = noise.drift_sd_radps.powi(2) + noise.drift_bias_radps.powi(2);
        Self {
            traits: Traits { speed_share: share, yaw_share: share, drift_radps: 0.0 },
            spread: [share_spread, 0.0, drift_spread],
            speed_spread: share_spread,
            hidden: [noise.gain_sd, noise.waypoint_sd_m],
        }
    }

    /// The best guess so far.
    pub(crate) const fn traits(&self) -> &Traits {
        &self.traits
    }

    /// The belief after `command` moved the robot from `before` to `after`. A motion that the noise does
    /// not explain, such as one that a wall ended, says nothing.
    pub(crate) fn after(
        mut self,
        model: &Model,
        (before, command): (&RobotState, PolarWaypoint),
        after: &RobotState,
    ) -> Self {
        let mut expected = *before;
        let slopes = model.act_with_slopes(&mut expected, command, &self.traits);
        self.learn_turn((before, command), (&expected, &slopes), after);
        self.learn_speed(before, &expected, after);
        self
    }

    fn learn_turn(
        &mut self,
        (before, command): (&RobotState, PolarWaypoint),
        (expected, slopes): (&RobotState, &Slopes),
        after: &RobotState,
    ) {
        let Self { traits, spread: [yy, yd, dd], hidden: [gain_sd, waypoint_sd_m], .. } = self;
        let Slopes { by_yaw, by_drift, by_bearing } = *slopes;
        let expected_rad = before.pose.heading.turn_to(expected.pose.heading);
        let bearing_sd = *waypoint_sd_m / command.reach_m.max(0.1);
        let doubt = (by_bearing * bearing_sd).powi(2)
            + (by_yaw * *gain_sd * traits.yaw_share).powi(2)
            + MODEL_SD.powi(2);
        let (ky, kd) = (*yy * by_yaw + *yd * by_drift, *yd * by_yaw + *dd * by_drift);
        let total = by_yaw * ky + by_drift * kd + doubt;
        let miss = before.pose.heading.turn_to(after.pose.heading) - expected_rad;
        if miss * miss > OUTLIER * total {
            return;
        }
        traits.yaw_share = (traits.yaw_share + ky / total * miss).clamp(0.1, 1.2);
        traits.drift_radps += kd / total * miss;
        (*yy, *yd, *dd) = (*yy - ky * ky / total, *yd - ky * kd / total, *dd - kd * kd / total);
    }

    fn learn_speed(&mut self, before: &RobotState, expected: &RobotState, after: &RobotState) {
        let Self { traits, speed_spread, hidden: [gain_sd, _], .. } = self;
        let expected_m = before.pose.distance_m(&expected.pose);
        let by_share = expected_m / traits.speed_share;
        let doubt = (by_share * *gain_sd * traits.speed_share).powi(2) + MODEL_SD.powi(2);
        let total = by_share * by_share * *speed_spread + doubt;
        let gain = *speed_spread * by_share / total;
        let miss_m = before.pose.distance_m(&after.pose) - expected_m;
        if miss_m * miss_m > OUTLIER * total {
            return;
        }
        traits.speed_share = (traits.speed_share + gain * miss_m).clamp(0.1, 1.2);
        *speed_spread -= gain * by_share * *speed_spread;
    }

    /// What to add to commands like `wanted` so that this robot does what a perfect one would;
    /// `share` of the pull is made up for.
    pub(crate) fn trim(&self, model: &Model, wanted: PolarWaypoint, share: f64) -> Trim {
        let mut state = RobotState::at_rest(Pose::new(0.0, 0.0, 0.0));
        state.wheel_speed_mps = wanted.speed_mps * self.traits.speed_share;
        let mut pulled = state;
        let ahead = PolarWaypoint { bearing_rad: 0.0, ..wanted };
        let slope = model.act_with_slopes(&mut pulled, ahead, &self.traits).by_bearing;
        let pulled_rad = state.pose.heading.turn_to(pulled.pose.heading);
        let bearing_rad = (-pulled_rad / slope.max(SLOPE_MIN)).clamp(-TRIM_MAX_RAD, TRIM_MAX_RAD);
        Trim { bearing_rad: share * bearing_rad, speed_share: self.traits.speed_share }
    }
}

/// How commands are adapted to one robot.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Trim {
    /// Added to bearings, radians.
    bearing_rad: f64,
    /// Speeds are divided by it.
    speed_share: f64,
}

impl Trim {
    /// `wanted`, adapted.
    pub(crate) fn applied(&self, wanted: PolarWaypoint) -> PolarWaypoint {
        PolarWaypoint {
            bearing_rad: wanted.bearing_rad + self.bearing_rad,
            speed_mps: wanted.speed_mps / self.speed_share,
            ..wanted
        }
    }
}

#[cfg(test)]
mod tests {
    use sharp_sim::RobotModel;

    use super::*;

    const AHEAD: PolarWaypoint = PolarWaypoint { reach_m: 0.5, bearing_rad: 0.0, speed_mps: 0.5 };

    /// What is believed after 60 actions of a robot that is like `truth`.
    fn believed(robot: &RobotModel, truth: &Traits) -> Belief {
        let model = Model::new(robot);
        let noise = NoiseModel { gain_sd: 0.05, waypoint_sd_m: 0.01, ..NoiseModel::harsh() };
        let mut belief = Belief::new(&noise);
        let mut state = RobotState::at_rest(Pose::new(0.0, 0.0, 0.0));
        for i in 0..60 {
            let command = PolarWaypoint { bearing_rad: 0.5 * (f64::from(i) * 0.7).sin(), ..AHEAD };
            let before = state;
            model.act(&mut state, command, truth, |_| true);
            belief = belief.after(&model, (&before, command), &state);
        }
        belief
    }

    #[test]
    fn slip_and_pull_are_recognised() {
        for robot in [RobotModel::husky(), RobotModel::limo()] {
            for drift_radps in [-0.3, 0.0, 0.3] {
                let truth = Traits { speed_share: 0.6, yaw_share: 0.8, drift_radps };
                let found = *believed(&robot, &truth).traits();
                assert!((found.speed_share - 0.6).abs() < 0.05, "{}: {found:?}", robot.name);
                assert!((found.yaw_share - 0.8).abs() < 0.1, "{}: {found:?}", robot.name);
                assert!((found.drift_radps - drift_radps).abs() < 0.05, "{}: {found:?}", robot.name);
            }
        }
    }

    #[test]
    fn a_trimmed_robot_drives_straight_ahead() {
        for robot in [RobotModel::husky(), RobotModel::limo()] {
            let truth = Traits { speed_share: 0.6, yaw_share: 0.8, drift_radps: 0.3 };
            let model = Model::new(&robot);
            let command = believed(&robot, &truth).trim(&model, AHEAD, 1.0).applied(AHEAD);
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
        let model = Model::new(&RobotModel::husky());
        let belief =
            believed(&RobotModel::husky(), &Traits { speed_share: 0.9, yaw_share: 0.9, drift_radps: 0.0 });
        let before = RobotState::at_rest(Pose::new(0.0, 0.0, 0.0));
        let after = RobotState::at_rest(Pose::new(0.0, 0.0, 1.0));
        assert_eq!(belief.after(&model, (&before, AHEAD), &after), belief);
    }
}
