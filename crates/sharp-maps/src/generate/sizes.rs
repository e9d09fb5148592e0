//! Sizes that all families draw from: those of the paper's environments.

use rand::RngExt;
use sharp_space::Stream;

/// Width of a door, metres.
pub(super) fn door_m(rng: &mut Stream) -> f64 {
    rng.random_range(1.0..=1.8)
}

/// Width of a corridor, metres.
pub(super) fn corridor_m(rng: &mut Stream) -> f64 {
    rng.random_range(1.1..=2.1)
}

/// Thickness of a wall, metres.
pub(super) fn wall_m(rng: &mut Stream) -> f64 {
    rng.random_range(0.1..=0.25)
}
