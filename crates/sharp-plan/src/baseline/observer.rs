//! What a robot is like, learnt while it drives: the slip and the pull that stay for an episode.
//!
//! An extended Kalman filter over ([`Traits::yaw_share`], [`Traits::drift_radps`]) compares the turn
//! of every action with the model's, and a scalar one its way. The noise model gives the priors and
//! how much a single action says: little, for its waypoint is perturbed, too.

use sharp_sim::{NoiseModel, RobotState};
use sharp_space::Pose;

use crate::baseline::model::{Model, Traits};
use crate::policy::PolarWaypoint;

/// What the model itself may be wrong by over one action, radians and metres.
const MODEL_SD: f64 = 0.01;
/// Steps of the differences that stand for derivatives: of a share, of a pull and of a bearing.
const STEP: f64 = 0.05;
/// A correction of a bearing beyond this is no correction, radians.
const TRIM_MAX_RAD: f64 = 0.7;

/// The action under way: from where, and the command.
type Begun = (RobotState, PolarWaypoint);

/// Estimates the traits of one robot in one episode.
#[derive(Clone, Debug)]
pub(crate) struct Observer {
    model: Model,
    noise: NoiseModel,
    traits: Traits,
    /// Covariance of yaw share and drift: variance, covariance, variance.
    spread: [f64; 3],
    /// Variance of the speed share.
    speed_spread: f64,
    begun: Option<Begun>,
}

impl Observer {
    /// An observer that has seen nothing; `noise` says what to expect.
    pub(crate) fn new(model: Model, noise: &NoiseModel) -> Self {
        let share = 1.0 - 0.5 * noise.slip_max;
        // The variance of a uniform variable.
        let share_spread = noise.slip_max.powi(2) / 12.0;
        let drift_spread = noise.drift_sd_radps.powi(2) + noise.drift_bias_radps.powi(2);
        Self {
            model,
            noise: noise.clone(),
            traits: Traits { speed_share: share, yaw_share: share, drift_radps: 0.0 },
            spread: [share_spread, 0.0, drift_spread],
            speed_spread: share_spread,
            begun: None,
        }
    }

    /// The best guess so far.
    pub(crate) const fn traits(&self) -> &Traits {
        &self.traits
    }

    /// Notes that `command` is carried out from `state`.
    pub(crate) fn begin(&mut self, state: &RobotState, command: PolarWaypoint) {
        self.begun = Some((*state, command));
    }

    /// Compares what came of the last action; one that a wall ended says nothing.
    pub(crate) fn end(&mut self, after: &RobotState, bumped: bool) {
        if let Some(begun) = self.begun.take().filter(|_| !bumped) {
            self.learn_turn(&begun, after);
            self.learn_speed(&begun, after);
        }
    }

    fn learn_turn(&mut self, (before, command): &Begun, after: &RobotState) {
        let Self { model, noise, traits, spread: [yy, yd, dd], .. } = self;
        let turn = |command, traits: &Traits| model.turn_rad(before, command, traits);
        let expected = turn(*command, traits);
        let by_yaw =
            (turn(*command, &Traits { yaw_share: traits.yaw_share + STEP, ..*traits }) - expected) / STEP;
        let by_drift =
            (turn(*command, &Traits { drift_radps: traits.drift_radps + STEP, ..*traits }) - expected) / STEP;
        let turned = PolarWaypoint { bearing_rad: command.bearing_rad + STEP, ..*command };
        let by_bearing = (turn(turned, traits) - expected) / STEP;
        let bearing_sd = noise.waypoint_sd_m / command.reach_m.max(0.1);
        let doubt = (by_bearing * bearing_sd).powi(2)
            + (by_yaw * noise.gain_sd * traits.yaw_share).powi(2)
            + MODEL_SD.powi(2);
        let (ky, kd) = (*yy * by_yaw + *yd * by_drift, *yd * by_yaw + *dd * by_drift);
        let total = by_yaw * ky + by_drift * kd + doubt;
        let miss = before.pose.heading.turn_to(after.pose.heading) - expected;
        traits.yaw_share = (traits.yaw_share + ky / total * miss).clamp(0.1, 1.2);
        traits.drift_radps += kd / total * miss;
        (*yy, *yd, *dd) = (*yy - ky * ky / total, *yd - ky * kd / total, *dd - kd * kd / total);
    }

    fn learn_speed(&mut self, (before, command): &Begun, after: &RobotState) {
        let Self { model, noise, traits, speed_spread, .. } = self;
        let mut expected = *before;
        model.act(&mut expected, *command, traits, |_| true);
        let expected_m = before.pose.distance_m(&expected.pose);
        let by_share = expected_m / traits.speed_share;
        let doubt = (by_share * noise.gain_sd * traits.speed_share).powi(2) + MODEL_SD.powi(2);
        let total = by_share * by_share * *speed_spread + doubt;
        let gain = *speed_spread * by_share / total;
        let miss_m = before.pose.distance_m(&after.pose) - expected_m;
        traits.speed_share = (traits.speed_share + gain * miss_m).clamp(0.1, 1.2);
        *speed_spread -= gain * by_share * *speed_spread;
    }

    /// What to add to commands like `wanted` so that this robot does what a perfect one would;
    /// `share` of the pull is made up for.
    pub(crate) fn trim(&self, wanted: PolarWaypoint, share: f64) -> Trim {
        let mut state = RobotState::at_rest(Pose::new(0.0, 0.0, 0.0));
        state.wheel_speed_mps = wanted.speed_mps * self.traits.speed_share;
        let turn_rad =
            |bearing_rad| self.model.turn_rad(&state, PolarWaypoint { bearing_rad, ..wanted }, &self.traits);
        let pulled_rad = turn_rad(0.0);
        let slope = (turn_rad(STEP) - pulled_rad) / STEP;
        let bearing_rad = (-pulled_rad / slope.max(STEP)).clamp(-TRIM_MAX_RAD, TRIM_MAX_RAD);
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

    /// What an observer believes after 60 actions of a robot that is like `truth`.
    fn believed(robot: &RobotModel, truth: &Traits) -> Observer {
        let model = Model::new(robot);
        let noise = NoiseModel { gain_sd: 0.05, waypoint_sd_m: 0.01, ..NoiseModel::harsh() };
        let mut observer = Observer::new(model.clone(), &noise);
        let mut state = RobotState::at_rest(Pose::new(0.0, 0.0, 0.0));
        for i in 0..60 {
            let command = PolarWaypoint { bearing_rad: 0.5 * (f64::from(i) * 0.7).sin(), ..AHEAD };
            observer.begin(&state, command);
            model.act(&mut state, command, truth, |_| true);
            observer.end(&state, false);
        }
        observer
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
            let command = believed(&robot, &truth).trim(AHEAD, 1.0).applied(AHEAD);
            let mut state = RobotState::at_rest(Pose::new(0.0, 0.0, 0.0));
            state.wheel_speed_mps = 0.5;
            let plain_rad = Model::new(&robot).turn_rad(&state, AHEAD, &truth);
            let trimmed_rad = Model::new(&robot).turn_rad(&state, command, &truth);
            assert!(plain_rad > 0.02, "{} is pulled to the left: {plain_rad}", robot.name);
            assert!(trimmed_rad.abs() < 0.6 * plain_rad, "{}: {trimmed_rad} of {plain_rad}", robot.name);
            assert!(command.bearing_rad < 0.0, "{} steers against it", robot.name);
            assert!((command.speed_mps - 0.5 / 0.6).abs() < 0.1, "{} makes up for slip", robot.name);
        }
    }

    #[test]
    fn an_action_that_a_wall_ended_says_nothing() {
        let mut observer =
            believed(&RobotModel::husky(), &Traits { speed_share: 0.9, yaw_share: 0.9, drift_radps: 0.0 });
        let before = *observer.traits();
        observer.begin(&RobotState::at_rest(Pose::new(0.0, 0.0, 0.0)), AHEAD);
        observer.end(&RobotState::at_rest(Pose::new(0.0, 0.0, 1.0)), true);
        assert_eq!(*observer.traits(), before);
    }
}
