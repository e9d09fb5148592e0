//! What policies are learnt and verified under.

use sharp_drive::{MonteCarlo, World};
use sharp_sim::{NoiseModel, Simulator, SimulatorKind};

/// A simulator and its noise.
#[derive(Clone, Debug)]
pub struct Conditions {
    /// A simulator of the robot in the map; episodes run in forks of it.
    pub simulator: Box<dyn Simulator>,
    /// The noise.
    pub noise: NoiseModel,
}

impl Conditions {
    /// `noise` in the kinematic simulator, the fastest.
    #[must_use]
    pub fn new(world: &World, noise: NoiseModel) -> Self {
        Self { simulator: world.simulator(SimulatorKind::Kinematic), noise }
    }

    /// The same noise in another simulator, which may be anybody's.
    #[must_use]
    pub fn with_simulator(self, simulator: Box<dyn Simulator>) -> Self {
        Self { simulator, ..self }
    }

    /// Monte Carlo experiments under these conditions; contact counts as failure.
    #[must_use]
    pub fn monte_carlo<'a>(&'a self, world: &'a World) -> MonteCarlo<'a> {
        MonteCarlo::new(world, &*self.simulator, &self.noise)
    }
}
