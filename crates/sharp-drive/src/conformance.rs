//! The suite that every [`Policy`] must pass, ours and anybody's.

use sharp_guide::GuidePath;
use sharp_sim::{NoiseModel, RobotModel, RobotState, SimulatorKind};
use sharp_space::{OccupancyGrid, Pose, Seed};
use thiserror::Error;

use crate::command::Command;
use crate::episode::{Controller, Decision, Episode, EpisodeEnd, EpisodeRules, Motion, Supervisor};
use crate::policy::Policy;
use crate::route::RouteController;
use crate::world::World;

/// How a policy breaks its promise.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum PolicyViolation {
    /// A command is NaN or infinite, or its speed is negative.
    #[error("decision {decision} is {command:?}, expected finite numbers and a speed from 0 on")]
    Command {
        /// The number of the decision, from 0.
        decision: usize,
        /// The command.
        command: Command,
    },
    /// The same situations give other commands.
    #[error("decision {0} differs from that of a fork in the same situation")]
    Random(usize),
    /// On a straight guide without noise the policy does not arrive.
    #[error("a straight guide of 8 m without noise ended with {0:?}")]
    NotThere(EpisodeEnd),
}

/// Lets a policy and its fork drive a Husky along a straight guide through an empty hall, without noise and then
/// with harsh noise.
///
/// # Errors
/// Says which promise is broken.
pub fn check_policy(policy: &dyn Policy) -> Result<(), PolicyViolation> {
    let grid =
        OccupancyGrid::from_ascii(0.5, &["........................"; 12].join("\n")).expect("a drawing");
    let world = World::new(grid, RobotModel::husky());
    let poses = (0..=40).map(|i| Pose::new(2.0 + 0.2 * f64::from(i), 3.0, 0.0)).collect();
    let guide = GuidePath::new(poses, 0.25).expect("short gaps");
    let (end, first) = drive(&world, &guide, policy, &NoiseModel::none());
    if end != EpisodeEnd::Reached {
        return Err(PolicyViolation::NotThere(end));
    }
    check_commands(&first)?;
    let (_, noisy) = drive(&world, &guide, policy, &NoiseModel::harsh());
    check_commands(&noisy)?;
    let (_, again) = drive(&world, &guide, &*policy.fork(), &NoiseModel::harsh());
    match noisy.iter().zip(&again).position(|(a, b)| a != b) {
        Some(decision) => Err(PolicyViolation::Random(decision)),
        None => Ok(()),
    }
}

fn check_commands(commands: &[Command]) -> Result<(), PolicyViolation> {
    let is_sound = |command: &Command| {
        let Command { reach_m, bearing_rad, speed_mps } = *command;
        [reach_m, bearing_rad, speed_mps].iter().all(|number| number.is_finite()) && speed_mps >= 0.0
    };
    match commands.iter().position(|command| !is_sound(command)) {
        Some(decision) => Err(PolicyViolation::Command { decision, command: commands[decision] }),
        None => Ok(()),
    }
}

/// How a drive along `guide` ended, and all commands.
fn drive(
    world: &World,
    guide: &GuidePath,
    policy: &dyn Policy,
    noise: &NoiseModel,
) -> (EpisodeEnd, Vec<Command>) {
    let simulator = world.simulator(SimulatorKind::Kinematic);
    let rules = EpisodeRules::default().with_time_limit_s(120.0);
    let mut episode = Episode::new(world.vehicle(&*simulator, noise, true), rules);
    let start = RobotState::at_rest(guide.start());
    episode.begin(start, Seed(1), 0);
    let inner = RouteController::new(world, guide.clone(), policy.fork(), start, noise);
    let mut controller = Recorder { inner, commands: Vec::new() };
    let end = episode.drive(&mut controller, &Supervisor::silent());
    (end, controller.commands)
}

/// Notes every command of a controller.
struct Recorder<'a> {
    inner: RouteController<'a>,
    commands: Vec<Command>,
}

impl Controller for Recorder<'_> {
    fn decide(&mut self) -> Decision {
        let decision = self.inner.decide();
        if let Decision::Drive(command) = decision {
            self.commands.push(command);
        }
        decision
    }

    fn observe(&mut self, motion: &Motion) {
        self.inner.observe(motion);
    }

    fn prepare(&mut self) -> crate::Readiness {
        self.inner.prepare()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Follower, Mppi, MppiSettings, Prior, ProfiledFollower, RouteFollower};

    #[test]
    fn our_policies_conform() {
        let robot = RobotModel::husky();
        let tuned = ProfiledFollower::tuned(&robot, &NoiseModel::harsh());
        let settings = MppiSettings { samples: 16, ..MppiSettings::new(&robot, &NoiseModel::harsh()) };
        let policies: [Box<dyn Policy>; 5] = [
            Box::new(Follower::cautious(&robot)),
            Box::new(tuned),
            Box::new(RouteFollower::new(tuned)),
            Box::new(Mppi::new(settings, Seed(1))),
            Box::new(Prior::shipped(&robot).policy(&robot, &NoiseModel::nominal())),
        ];
        for policy in policies {
            assert_eq!(check_policy(&*policy), Ok(()), "{policy:?}");
        }
    }
}
