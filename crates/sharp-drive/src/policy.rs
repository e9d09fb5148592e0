//! A policy π of the paper: what the robot sees in, a command out.

use std::fmt::Debug;

use sharp_sim::RobotModel;

use crate::command::Command;
use crate::follower::Follower;
use crate::network::NetworkPolicy;
use crate::situation::Situation;
use crate::speed_profile::ProfiledFollower;

/// Decides what the robot does next. Implement [`decide`](Self::decide); the rest follows.
///
/// A policy is deterministic: it may keep a memory, but all randomness comes from a stream that it was made with.
/// Whoever is [`Clone`] can be copied by [`fork`](ForkPolicy::fork), one copy a thread and episode.
pub trait Policy: ForkPolicy + Debug + Send + Sync {
    /// The next command: waypoint (metres, radians) and speed (metres per second).
    fn decide(&mut self, situation: &Situation<'_>) -> Command;

    /// The robot begins the guide in `situation`: at the start of an option, or because there is a new plan.
    fn enter(&mut self, _situation: &Situation<'_>) {}

    /// Returns true if decisions depend on the slip estimate; where no policy of a chain does, none is computed.
    fn uses_slip_estimate(&self) -> bool {
        true
    }
}

/// Copies a policy behind a pointer. Every [`Policy`] that is [`Clone`] has it.
pub trait ForkPolicy {
    /// A copy that goes on by itself.
    fn fork(&self) -> Box<dyn Policy>;
}

impl<P: Policy + Clone + 'static> ForkPolicy for P {
    fn fork(&self) -> Box<dyn Policy> {
        Box::new(self.clone())
    }
}

impl Clone for Box<dyn Policy> {
    fn clone(&self) -> Self {
        (**self).fork()
    }
}

/// The policy of an option: one of ours, which can be stored, or anybody's.
#[derive(Clone, Debug)]
pub enum OptionPolicy {
    /// Follows the guide at one speed.
    Follower(Follower),
    /// Follows the guide at a speed that depends on the place.
    Profiled(ProfiledFollower),
    /// A network.
    Network(NetworkPolicy),
    /// A policy from outside. It runs like the others; plans and libraries cannot store it.
    Custom(Box<dyn Policy>),
}

impl OptionPolicy {
    /// The word for it in reports.
    #[must_use]
    pub const fn kind(&self) -> &'static str {
        match self {
            Self::Follower(_) => "follower",
            Self::Profiled(_) => "profiled",
            Self::Network(_) => "learnt",
            Self::Custom(_) => "custom",
        }
    }

    /// What drives where no learnt policy succeeds often enough: at most four hand-written followers.
    #[must_use]
    pub fn fallbacks(robot: &RobotModel) -> Vec<Self> {
        let mut all: Vec<Self> = ProfiledFollower::all_tuned(robot).into_iter().map(Self::Profiled).collect();
        all.push(Self::Follower(Follower::cautious(robot)));
        all
    }

    fn inner(&mut self) -> &mut dyn Policy {
        match self {
            Self::Follower(follower) => follower,
            Self::Profiled(follower) => follower,
            Self::Network(network) => network,
            Self::Custom(policy) => &mut **policy,
        }
    }
}

impl Policy for OptionPolicy {
    /// What the policy decides, held to the speed limits of the world.
    fn decide(&mut self, situation: &Situation<'_>) -> Command {
        let command = self.inner().decide(situation);
        situation.world.held(&situation.observation.state.pose, command)
    }

    fn enter(&mut self, situation: &Situation<'_>) {
        self.inner().enter(situation);
    }

    fn uses_slip_estimate(&self) -> bool {
        match self {
            Self::Follower(follower) => follower.uses_slip_estimate(),
            Self::Profiled(follower) => follower.uses_slip_estimate(),
            Self::Network(network) => network.uses_slip_estimate(),
            Self::Custom(policy) => policy.uses_slip_estimate(),
        }
    }
}
