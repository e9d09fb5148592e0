//! Followers: hand-written policies that steer along a guide at one speed.

use serde::{Deserialize, Serialize};
use sharp_sim::RobotModel;
use sharp_space::{Heading, Pose, trig};

use crate::command::Command;
use crate::policy::Policy;
use crate::presets::PRESETS;
use crate::situation::{GuideProgress, GuideView, Situation};
use crate::world::World;

/// Share of the estimated drift that a follower compensates: all of it makes it follow the estimate's noise.
const DRIFT_COMPENSATION: f64 = 0.5;

/// How a follower chooses its direction.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum SteeringRule {
    /// Pure pursuit: towards the guide's point this far ahead. Robust, but cuts corners.
    Pursuit {
        /// How far along the guide the robot looks, metres.
        look_ahead_m: f64,
    },
    /// Vector field: along the guide's tangent a little ahead, turned back towards the guide in proportion to
    /// the distance from it. Guides are checked with the outline along the tangent, so a robot that keeps the
    /// tangent keeps the clearance that was checked.
    Field {
        /// How far ahead along the guide the tangent is taken, metres.
        look_ahead_m: f64,
        /// Distance from the guide at which the direction is turned by 45 degrees, metres.
        softness_m: f64,
    },
}

impl SteeringRule {
    /// The direction for a robot at `pose`, against its heading, radians.
    #[must_use]
    pub fn bearing_rad(&self, pose: &Pose, progress: &GuideProgress, guide: &GuideView<'_>) -> f64 {
        match *self {
            Self::Pursuit { look_ahead_m } => {
                let local = pose.to_local(guide.ahead(progress.arc_m + look_ahead_m).position);
                trig::atan2(local.y, local.x)
            }
            Self::Field { look_ahead_m, softness_m } => {
                let tangent = guide.ahead(progress.arc_m + look_ahead_m).heading;
                let back = trig::atan2(progress.cross_track_m, softness_m);
                pose.heading.turn_to(Heading::new(tangent.radians() - back))
            }
        }
    }
}

/// Follows a guide path at a constant speed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Follower {
    /// Where to.
    pub rule: SteeringRule,
    /// How fast, metres per second.
    pub speed_mps: f64,
}

impl Follower {
    /// The followers that are compared for an option of `robot`, fastest first (`assets/followers.ron`).
    #[must_use]
    pub fn candidates(robot: &RobotModel) -> Vec<Self> {
        let speeds = PRESETS.constant.speeds.iter().map(|share| share * robot.max_speed_mps);
        let with_speed = |speed_mps| PRESETS.constant.rules.iter().map(move |&rule| Self { rule, speed_mps });
        speeds.flat_map(with_speed).collect()
    }

    /// The follower for options that were never tried: slow, looking near.
    #[must_use]
    pub fn cautious(robot: &RobotModel) -> Self {
        let (rule, speed) = PRESETS.cautious;
        Self { rule, speed_mps: speed * robot.max_speed_mps }
    }

    /// The next waypoint for a robot at `pose`: always as far away as the robot allows, so that noise in the
    /// point is little noise in the direction.
    #[must_use]
    pub fn waypoint(
        &self,
        robot: &RobotModel,
        pose: &Pose,
        progress: &GuideProgress,
        guide: &GuideView<'_>,
    ) -> Command {
        let bearing_rad = self.rule.bearing_rad(pose, progress, guide);
        Command { reach_m: robot.waypoint_reach_m, bearing_rad, speed_mps: self.speed_mps }
    }
}

impl Policy for Follower {
    fn decide(&mut self, situation: &Situation<'_>) -> Command {
        let Situation { world, observation, progress, guide } = situation;
        let wanted = self.waypoint(&world.robot, &observation.state.pose, progress, guide);
        compensated(world, situation, wanted, DRIFT_COMPENSATION)
    }
}

/// `wanted` with the feed-forward of slip and of a `share` of the drift, where there is an estimate.
pub(crate) fn compensated(world: &World, situation: &Situation<'_>, wanted: Command, share: f64) -> Command {
    let estimate = situation.observation.slip;
    estimate.map_or(wanted, |slip| slip.feed_forward(&world.model, wanted, share).applied(wanted))
}

#[cfg(test)]
mod tests {
    use sharp_sim::{NoiseModel, RobotState};

    use super::*;
    use crate::episode::Motion;
    use crate::policy::OptionPolicy;
    use crate::situation::Observation;
    use crate::speed_profile::ProfiledFollower;
    use crate::test_worlds::{hall, straight};

    fn husky() -> RobotModel {
        RobotModel::husky()
    }

    #[test]
    fn a_robot_that_drifts_to_the_left_is_steered_to_the_right() {
        let guide = straight((1.0, 2.0), (9.0, 2.0));
        let view = GuideView { current: &guide, next: None };
        let world = hall();
        let start = RobotState::at_rest(Pose::new(2.0, 2.0, 0.0));
        let mut observation = Observation::first(start, &NoiseModel::harsh());
        let progress = GuideProgress::start(&guide, &start.pose);
        let policies = [
            OptionPolicy::Follower(Follower::cautious(&husky())),
            OptionPolicy::Profiled(ProfiledFollower::candidates(&husky())[0]),
        ];
        let bearings_rad = |observation: &Observation| {
            let situation = Situation { world: &world, observation, progress: &progress, guide: view };
            policies.clone().map(|mut policy| policy.decide(&situation).bearing_rad)
        };
        assert!(bearings_rad(&observation).iter().all(|rad| rad.abs() < 1e-9), "nothing is known yet");
        let command = Command { reach_m: 0.5, bearing_rad: 0.0, speed_mps: 0.5 };
        for _ in 0..20 {
            let moved = RobotState::rolling(Pose::new(2.2, 2.0, 0.15), 0.5);
            observation = observation.after(&world, &Motion::commanded(command, moved));
            observation.state = start;
        }
        for rad in bearings_rad(&observation) {
            assert!(rad < -0.02, "steered by {rad} against a drift of {:?}", observation.slip);
        }
    }

    #[test]
    fn every_follower_turns_back_to_its_guide() {
        let guide = straight((0.0, 0.0), (2.0, 0.0));
        let view = GuideView { current: &guide, next: None };
        for follower in Follower::candidates(&husky()) {
            let bearing = |y: f64, heading: f64| {
                let pose = Pose::new(0.5, y, heading);
                let progress = GuideProgress::start(&guide, &pose);
                let waypoint = follower.waypoint(&husky(), &pose, &progress, &view);
                assert_eq!(waypoint.reach_m, husky().waypoint_reach_m, "{follower:?} keeps its distance");
                assert_eq!(waypoint.speed_mps, follower.speed_mps, "{follower:?} keeps its speed");
                waypoint.bearing_rad
            };
            assert!(bearing(0.0, 0.0).abs() < 1e-9, "{follower:?} swerves on the guide");
            assert!(bearing(0.3, 0.0) < -0.1, "{follower:?} leaves to the left");
            assert!(bearing(-0.3, 0.0) > 0.1, "{follower:?} leaves to the right");
            assert!(bearing(0.0, 1.0) < -0.5, "{follower:?} looks away");
        }
    }
}
