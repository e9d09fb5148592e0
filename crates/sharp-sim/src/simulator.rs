//! What a simulator is, and the choice between ours.

use std::fmt;
use std::str::FromStr;
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::kinematic::KinematicSim;
use crate::planar::PlanarSim;
use crate::robot::RobotModel;
use crate::state::{Command, RobotState};
use crate::world::World;

/// Moves a robot; a clone is a fork that continues on its own, bit for bit.
pub trait Simulator: Clone + Send {
    /// Puts the robot into `state`; nothing of the past remains.
    fn reset(&mut self, state: RobotState);

    /// Lets the wheels follow `command` for `dt_s` seconds, at most 1/20 s for a stable drive.
    fn step(&mut self, command: Command, dt_s: f64) -> StepInfo;

    /// The state of the robot.
    fn state(&self) -> &RobotState;
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
}

/// A name that belongs to no simulator.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("simulator {0:?} is unknown, must be kinematic or planar (rapier2d)")]
pub struct UnknownSimulator(String);

impl FromStr for SimulatorKind {
    type Err = UnknownSimulator;

    fn from_str(name: &str) -> Result<Self, UnknownSimulator> {
        match name {
            "kinematic" => Ok(Self::Kinematic),
            "planar" | "rapier2d" => Ok(Self::Planar),
            _ => Err(UnknownSimulator(name.to_owned())),
        }
    }
}

impl fmt::Display for SimulatorKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Kinematic => "kinematic",
            Self::Planar => "planar",
        })
    }
}

/// A simulator chosen at run time.
#[allow(clippy::large_enum_variant, reason = "a fork of the kinematic simulator must not allocate")]
#[derive(Clone, Debug)]
pub enum AnySim {
    /// No engine.
    Kinematic(KinematicSim),
    /// A rigid-body engine; boxed, for it is large.
    Planar(Box<PlanarSim>),
}

impl AnySim {
    /// A simulator of the given kind, the robot at rest at the grid's origin.
    #[must_use]
    pub fn new(kind: SimulatorKind, world: Arc<World>, robot: &RobotModel) -> Self {
        match kind {
            SimulatorKind::Kinematic => Self::Kinematic(KinematicSim::new(world, robot)),
            SimulatorKind::Planar => Self::Planar(Box::new(PlanarSim::new(world, robot))),
        }
    }
}

impl Simulator for AnySim {
    fn reset(&mut self, state: RobotState) {
        match self {
            Self::Kinematic(sim) => sim.reset(state),
            Self::Planar(sim) => sim.reset(state),
        }
    }

    fn step(&mut self, command: Command, dt_s: f64) -> StepInfo {
        match self {
            Self::Kinematic(sim) => sim.step(command, dt_s),
            Self::Planar(sim) => sim.step(command, dt_s),
        }
    }

    fn state(&self) -> &RobotState {
        match self {
            Self::Kinematic(sim) => sim.state(),
            Self::Planar(sim) => sim.state(),
        }
    }
}
