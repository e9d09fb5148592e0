//! What a simulator is, and the choice between ours.

use std::fmt::{self, Debug};
use std::str::FromStr;
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::kinematic::KinematicSim;
use crate::obstacle_map::ObstacleMap;
use crate::planar::PlanarSim;
#[cfg(feature = "rigid3d")]
use crate::rigid::RigidSim;
use crate::robot::RobotModel;
use crate::state::{RobotState, WheelCommand};

/// Moves a robot in small time steps.
///
/// A simulator holds one robot in one map. It is deterministic: all noise comes in through the commands, so
/// equal states and equal commands give equal bits. Implement the three methods below and derive `Clone`;
/// [`ForkSimulator`] then comes by itself.
/// [`conformance::check_simulator`](crate::conformance::check_simulator) tests an implementation.
///
/// `Box<dyn Simulator>` is a simulator too, so that [`Vehicle`](crate::Vehicle) drives one that was chosen at
/// run time as well as a concrete one.
pub trait Simulator: ForkSimulator + Debug + Send + Sync {
    /// Puts the robot into `state`, in which [`state`](Self::state) then is exactly. Nothing of the past
    /// remains.
    fn reset(&mut self, state: RobotState);

    /// Lets the wheels follow `command` for `dt_s` seconds, above 0 and at most 1/20 s for a stable drive.
    ///
    /// Reports contact if the robot's outline met an obstacle or the border of the map. The robot never ends
    /// a step inside of an obstacle; an engine may let it sink in by up to 4 cm.
    fn step(&mut self, command: WheelCommand, dt_s: f64) -> StepInfo;

    /// The state of the robot: finite after every step with a finite command.
    fn state(&self) -> &RobotState;
}

/// Forks a simulator of unknown type. Every simulator that is `Clone` has it.
pub trait ForkSimulator {
    /// A copy that continues on its own, bit for bit as the original would.
    ///
    /// To copy a `Box<dyn Simulator>`, clone it: `fork` would put the box into another box.
    fn fork(&self) -> Box<dyn Simulator>;
}

impl<S: Simulator + Clone + 'static> ForkSimulator for S {
    fn fork(&self) -> Box<dyn Simulator> {
        Box::new(self.clone())
    }
}

impl Clone for Box<dyn Simulator> {
    fn clone(&self) -> Self {
        (**self).fork()
    }
}

impl Simulator for Box<dyn Simulator> {
    fn reset(&mut self, state: RobotState) {
        (**self).reset(state);
    }

    fn step(&mut self, command: WheelCommand, dt_s: f64) -> StepInfo {
        (**self).step(command, dt_s)
    }

    fn state(&self) -> &RobotState {
        (**self).state()
    }
}

/// What happened in a step besides the motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct StepInfo {
    /// True if the outline met an obstacle or the border of the map.
    pub in_contact: bool,
}

/// Names a simulator.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum SimulatorKind {
    /// [`KinematicSim`]: fast; obstacles stop the robot.
    Kinematic,
    /// [`PlanarSim`]: a rigid-body engine; the robot pushes against obstacles and grazes them.
    Planar,
    /// [`RigidSim`]: wheels and gravity in three dimensions; the cross-check.
    #[cfg(feature = "rigid3d")]
    Rigid,
}

impl SimulatorKind {
    /// A simulator of this kind, the robot at rest at the grid's origin.
    #[must_use]
    pub fn build(self, map: Arc<ObstacleMap>, robot: &RobotModel) -> Box<dyn Simulator> {
        match self {
            Self::Kinematic => Box::new(KinematicSim::new(map, robot)),
            Self::Planar => Box::new(PlanarSim::new(map, robot)),
            #[cfg(feature = "rigid3d")]
            Self::Rigid => Box::new(RigidSim::new(map, robot)),
        }
    }
}

/// A name that belongs to no simulator of this build.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum UnknownSimulator {
    /// There is none of that name.
    #[error("simulator {0:?} is unknown, must be rapier2d (or planar), kinematic or rapier3d (or rigid)")]
    Name(String),
    /// It is not compiled into this build.
    #[error(
        "simulator {0:?} is not compiled in, must be rapier2d or kinematic; \
         cargo build --release -p sharp-cli --features rigid3d adds it"
    )]
    NotCompiled(String),
}

impl FromStr for SimulatorKind {
    type Err = UnknownSimulator;

    fn from_str(name: &str) -> Result<Self, UnknownSimulator> {
        match name {
            "kinematic" => Ok(Self::Kinematic),
            "planar" | "rapier2d" => Ok(Self::Planar),
            #[cfg(feature = "rigid3d")]
            "rigid" | "rapier3d" => Ok(Self::Rigid),
            #[cfg(not(feature = "rigid3d"))]
            "rigid" | "rapier3d" => Err(UnknownSimulator::NotCompiled(name.to_owned())),
            _ => Err(UnknownSimulator::Name(name.to_owned())),
        }
    }
}

impl fmt::Display for SimulatorKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Kinematic => "kinematic",
            Self::Planar => "rapier2d",
            #[cfg(feature = "rigid3d")]
            Self::Rigid => "rapier3d",
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn simulators_are_known_by_their_names() {
        for (name, expected) in [("kinematic", "kinematic"), ("planar", "rapier2d"), ("rapier2d", "rapier2d")]
        {
            let kind = name.parse::<SimulatorKind>().map(|kind| kind.to_string());
            assert_eq!(kind.as_deref(), Ok(expected), "{name}");
        }
        let error = "bullet".parse::<SimulatorKind>().map_err(|error| error.to_string());
        let message =
            "simulator \"bullet\" is unknown, must be rapier2d (or planar), kinematic or rapier3d (or rigid)";
        assert_eq!(error, Err(message.into()), "bullet");
    }

    #[test]
    fn rapier3d_is_there_or_says_how_to_get_it() {
        let found = "rapier3d".parse::<SimulatorKind>().map(|kind| kind.to_string());
        let message = "simulator \"rapier3d\" is not compiled in, must be rapier2d or kinematic; \
            cargo build --release -p sharp-cli --features rigid3d adds it";
        match found.map_err(|error| error.to_string()) {
            Ok(name) => assert_eq!((name.as_str(), cfg!(feature = "rigid3d")), ("rapier3d", true)),
            Err(error) => assert_eq!((error.as_str(), cfg!(feature = "rigid3d")), (message, false)),
        }
    }
}
