//! Soft actor-critic on plain vectors.
