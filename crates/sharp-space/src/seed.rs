//! Named random streams: the only source of randomness in the project.
//!
//! A stream is keyed by (seed, name, index), so neither the order in which streams are made nor the number of
//! threads changes what is drawn.

use rand_chacha::ChaCha8Rng;
use rand_chacha::rand_core::SeedableRng;
use serde::{Deserialize, Serialize};

/// The generator behind every stream; its values are the same on every platform and version.
pub type Stream = ChaCha8Rng;

/// The root of all randomness of a run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Seed(pub u64);

impl Seed {
    /// The stream called `name`, number `index`.
    #[must_use]
    pub fn stream(self, name: &str, index: u64) -> Stream {
        let mut key = [0; 32];
        key[..8].copy_from_slice(&self.0.to_le_bytes());
        key[8..16].copy_from_slice(&fnv1a(name.as_bytes()).to_le_bytes());
        key[16..24].copy_from_slice(&index.to_le_bytes());
        Stream::from_seed(key)
    }

    /// A seed of its own for the part called `name`, number `index`.
    #[must_use]
    pub fn child(self, name: &str, index: u64) -> Self {
        let mut bytes = self.0.to_le_bytes().to_vec();
        bytes.extend_from_slice(&index.to_le_bytes());
        bytes.extend_from_slice(name.as_bytes());
        Self(fnv1a(&bytes))
    }
}

/// The 64-bit FNV-1a hash: short, stable, and different for different names in practice.
fn fnv1a(bytes: &[u8]) -> u64 {
    bytes
        .iter()
        .fold(0xcbf2_9ce4_8422_2325, |hash, &byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

#[cfg(test)]
mod tests {
    use rand::RngExt;

    use super::*;

    #[test]
    fn streams_depend_on_seed_name_and_index_only() {
        let draw = |seed: u64, name: &str, index: u64| Seed(seed).stream(name, index).random::<u64>();
        assert_eq!(draw(1, "sim", 0), draw(1, "sim", 0), "equal keys");
        assert_ne!(draw(1, "sim", 0), draw(2, "sim", 0), "seed");
        assert_ne!(draw(1, "sim", 0), draw(1, "sac", 0), "name");
        assert_ne!(draw(1, "sim", 0), draw(1, "sim", 1), "index");
        assert_ne!(Seed(1).child("option", 0), Seed(1).child("option", 1), "children");
    }
}
