//! Learnt policies: a network, what it sees, and what its action means.

use std::sync::Arc;

use serde::{Deserialize, Serialize};
use sharp_rl::{Actor, DeployedActor, DeployedScratch};
use sharp_sim::NoiseModel;
use sharp_space::Vector;

use crate::command::Command;
use crate::features::{ABSOLUTE_FEATURES, GUIDE_FEATURES, absolute_features, guide_features};
use crate::follower::Follower;
use crate::policy::Policy;
use crate::situation::Situation;

/// The slowest that a network drives, as a share of the top speed: enough to turn in place.
const SLOWEST: f64 = 0.05;

/// What a network is told before it drives: how careful to be and which noise to expect.
///
/// One network then serves every noise and every trade of time against risk. Each entry is from 0 to about 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PolicyContext {
    /// How much a contact matters, 0 to 1.
    pub caution: f32,
    /// Standard deviation of the waypoint, in units of 0.1 m.
    pub waypoint: f32,
    /// Drift to one side, in units of 0.3 rad/s at 1 m/s.
    pub drift: f32,
    /// Share of speed and turn that may be lost, in units of one half.
    pub slip: f32,
    /// Standard deviation of the gains, in units of 0.3.
    pub gain: f32,
}

impl PolicyContext {
    pub(crate) const LEN: usize = 5;

    /// The context of `noise` for a network that is told to be as careful as `caution`, 0 to 1.
    #[must_use]
    pub fn new(noise: &NoiseModel, caution: f32) -> Self {
        let extra = noise.slippery_patches.map_or(0.0, |patches| patches.share * patches.extra_slip);
        let entry = |value: f64, unit: f64| (value / unit).min(2.0) as f32;
        Self {
            caution,
            waypoint: entry(noise.waypoint_sd_m, 0.1),
            drift: entry(noise.drift_sd_radps + noise.drift_bias_radps, 0.3),
            slip: entry(noise.slip_max + extra, 0.5),
            gain: entry(noise.gain_sd, 0.3),
        }
    }

    pub(crate) const fn entries(&self) -> [f32; Self::LEN] {
        [self.caution, self.waypoint, self.drift, self.slip, self.gain]
    }
}

/// How far an action of a network may move the follower's waypoint.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Correction {
    /// Change of the speed at full action, metres per second.
    pub speed_mps: f64,
    /// Change of the direction at full action, radians.
    pub bearing_rad: f64,
}

/// What a network sees and what its action means.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum PolicyInterface {
    /// The guide's frame; the action corrects a follower.
    Guide {
        /// The follower that is corrected.
        base: Follower,
        /// What a full action changes.
        correction: Correction,
        /// What the network is told.
        context: PolicyContext,
    },
    /// The paper's: absolute configuration and vector to the nearest guide point; the action is the
    /// displacement to the next point in the world frame, each component in ±`reach_m`.
    Absolute {
        /// Largest displacement along x and along y, metres.
        reach_m: f64,
    },
}

impl PolicyInterface {
    /// Components of an action, each from -1 to 1.
    pub const ACTION_LEN: usize = 2;

    /// Length of the vector that the network sees.
    #[must_use]
    pub const fn observation_len(&self) -> usize {
        match self {
            Self::Guide { .. } => GUIDE_FEATURES,
            Self::Absolute { .. } => ABSOLUTE_FEATURES,
        }
    }

    /// Writes what the network sees into `features`.
    pub fn observe(&self, situation: &Situation<'_>, features: &mut [f32]) {
        match self {
            Self::Guide { context, .. } => guide_features(situation, context, features),
            Self::Absolute { .. } => {
                absolute_features(&situation.observation.state.pose, situation.guide.current, features);
            }
        }
    }

    /// The command that `action` ∈ [−1, 1]² stands for.
    #[must_use]
    pub fn command(&self, situation: &Situation<'_>, action: &[f32]) -> Command {
        let (robot, pose) = (&situation.world.robot, &situation.observation.state.pose);
        let (a, b) = (f64::from(action[0]), f64::from(action[1]));
        match self {
            Self::Guide { base, correction, .. } => {
                let wanted = base.waypoint(robot, pose, situation.progress, &situation.guide);
                let speed_mps = wanted.speed_mps + a * correction.speed_mps;
                Command {
                    speed_mps: speed_mps.clamp(SLOWEST * robot.max_speed_mps, robot.max_speed_mps),
                    bearing_rad: wanted.bearing_rad + b * correction.bearing_rad,
                    ..wanted
                }
            }
            Self::Absolute { reach_m } => {
                let point = pose.position + Vector::new(a, b) * *reach_m;
                let seen = Command::of(pose, point, robot.max_speed_mps);
                Command { reach_m: seen.reach_m.min(robot.waypoint_reach_m), ..seen }
            }
        }
    }
}

/// A network as a policy: its mean action.
#[derive(Clone, Debug)]
pub struct NetworkPolicy {
    /// What it sees and what its action means.
    pub interface: PolicyInterface,
    /// The network; copies of the policy share it.
    pub actor: Arc<Actor>,
    deployed: Arc<DeployedActor>,
    scratch: NetworkScratch,
}

/// Memory that decisions write into, so that none is allocated.
#[derive(Debug, Default)]
struct NetworkScratch {
    features: Vec<f32>,
    action: [f32; PolicyInterface::ACTION_LEN],
    actor: DeployedScratch,
}

impl Clone for NetworkScratch {
    /// A copy has no memory yet: nothing in it outlasts a decision.
    fn clone(&self) -> Self {
        Self::default()
    }
}

impl NetworkPolicy {
    /// The policy of `actor`.
    #[must_use]
    pub fn new(interface: PolicyInterface, actor: Arc<Actor>) -> Self {
        let deployed = Arc::new(DeployedActor::new(&actor));
        Self::shared(interface, actor, deployed)
    }

    /// The same network with another interface of the same number of inputs.
    #[must_use]
    pub fn with_interface(&self, interface: PolicyInterface) -> Self {
        Self { interface, ..self.clone() }
    }

    /// The policy of `actor`, which `deployed` is made of.
    pub(crate) fn shared(
        interface: PolicyInterface,
        actor: Arc<Actor>,
        deployed: Arc<DeployedActor>,
    ) -> Self {
        Self { interface, actor, deployed, scratch: NetworkScratch::default() }
    }
}

impl Policy for NetworkPolicy {
    fn decide(&mut self, situation: &Situation<'_>) -> Command {
        let NetworkScratch { features, action, actor } = &mut self.scratch;
        features.resize(self.interface.observation_len(), 0.0);
        self.interface.observe(situation, features);
        self.deployed.act(features, actor, action);
        self.interface.command(situation, action)
    }

    /// It was trained to feel slip by itself.
    fn uses_slip_estimate(&self) -> bool {
        false
    }
}

#[cfg(test)]
mod tests {
    use sharp_sim::{RobotModel, RobotState};
    use sharp_space::{Point, Pose};

    use super::*;
    use crate::situation::{GuideProgress, GuideView, Observation};
    use crate::test_worlds::{hall, straight};

    /// What `interface` makes of `action` for a Husky at `pose` beside a guide of two metres to the east.
    fn command(interface: PolicyInterface, pose: Pose, action: [f32; 2]) -> (Command, Command) {
        let (world, guide) = (hall(), straight((0.0, 0.0), (2.0, 0.0)));
        let observation = Observation::first(RobotState::at_rest(pose), &NoiseModel::none());
        let progress = GuideProgress::start(&guide, &pose);
        let view = GuideView { current: &guide, next: None };
        let situation =
            Situation { world: &world, observation: &observation, progress: &progress, guide: view };
        let base = Follower::cautious(&world.robot).waypoint(&world.robot, &pose, &progress, &view);
        (interface.command(&situation, &action), base)
    }

    #[test]
    fn no_correction_is_the_follower_and_a_full_one_stays_within_its_share() {
        let interface = PolicyInterface::Guide {
            base: Follower::cautious(&RobotModel::husky()),
            correction: Correction { speed_mps: 0.6, bearing_rad: 0.8 },
            context: PolicyContext::default(),
        };
        let pose = Pose::new(0.5, 0.2, 0.1);
        let (same, wanted) = command(interface, pose, [0.0, 0.0]);
        assert_eq!(same, wanted, "no correction");
        for (action, speed_mps, turn) in [([1.0, 1.0], 1.0, 0.8), ([-1.0, -1.0], 0.05, -0.8)] {
            let (corrected, wanted) = command(interface, pose, action);
            assert_eq!(corrected.speed_mps, speed_mps, "the robot's limits bound {action:?}");
            assert!((corrected.bearing_rad - wanted.bearing_rad - turn).abs() < 1e-9, "{action:?}");
        }
    }

    #[test]
    fn absolute_actions_are_displacements_in_the_world() {
        let (interface, pose) = (PolicyInterface::Absolute { reach_m: 0.5 }, Pose::new(0.5, 0.2, 2.0));
        for (action, x, y) in [([1.0, 0.0], 1.0, 0.2), ([0.0, -0.4], 0.5, 0.0), ([0.2, 0.2], 0.6, 0.3)] {
            let point = command(interface, pose, action).0.to_world(&pose);
            assert!((point - Point::new(x, y)).norm() < 1e-6, "{action:?} leads to {point:?}");
        }
        let reach_m = RobotModel::husky().waypoint_reach_m;
        assert_eq!(command(interface, pose, [1.0, 1.0]).0.reach_m, reach_m, "no waypoint beyond reach");
    }
}
