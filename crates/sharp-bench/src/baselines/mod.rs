//! The systems to compare with (Sec. 5 and beyond it).

mod mpc;
mod route;
mod rrt;
mod sac;
mod track;

#[cfg(test)]
mod tests;

pub use mpc::Mpc;
pub use route::RoutePlanner;
pub use rrt::Rrt;
pub use sac::{FlatSac, SacBudget};
pub use track::Track;

use sharp_drive::World;

/// Simulated time that `length_m` metres of path and `turn_rad` of turns in place take at half the
/// robot's top speed, seconds.
fn nominal_time_s(world: &World, length_m: f64, turn_rad: f64) -> f64 {
    let robot = &world.robot;
    length_m / (0.5 * robot.max_speed_mps) + turn_rad / (0.5 * robot.max_yaw_rate_radps)
}
