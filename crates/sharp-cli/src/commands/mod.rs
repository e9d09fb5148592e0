//! One file a command.

pub(crate) mod abstraction;
pub(crate) mod baseline;
pub(crate) mod eval;
pub(crate) mod export;
pub(crate) mod jobs;
pub(crate) mod learn;
pub(crate) mod library;
pub(crate) mod man;
pub(crate) mod map;
pub(crate) mod prior;
pub(crate) mod regions;
mod regions_score;
mod regions_train;
pub(crate) mod robot;
pub(crate) mod run;
pub(crate) mod serve;
pub(crate) mod serve_library;
mod show;
pub(crate) mod solve;
