//! One binary of integration tests: it links once.
#[path = "../common/checker.rs"]
mod checker;
mod damage;
mod determinism;
mod learning;
mod library;
mod maps;
mod paper;
mod regions;
mod robots;
mod situations;
mod worlds;
