//! Sampling-based motion planners.
