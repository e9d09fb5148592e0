//! One binary of integration tests: it links once.
mod determinism;
mod learning;
mod maps;
mod paper;
mod worlds;
