//! What the command promises whatever happens around it, by the groups of the list in `docs/testing.md`.
//!
//! `cargo test` tries a few cases of each promise; `cargo xtask soak` tries many and prints what came of them.

#![allow(clippy::disallowed_methods, reason = "variables say how much to try, and kills follow the clock")]

mod ends;
mod quiet;
mod service;
mod sizes;
mod small;
mod storm;
