//! Seeded generator of indoor maps for training, tests and benches.
