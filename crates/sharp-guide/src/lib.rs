//! Option guides: guide paths and pseudo-rewards.
