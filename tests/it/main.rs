//! One binary of integration tests: it links once.
mod determinism;
mod learning;
mod library;
mod maps;
mod paper;
mod regions;
mod robots;
mod worlds;
