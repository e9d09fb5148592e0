//! Who does the jobs of a manifest.

use std::fmt::Debug;

use sharp_plan::BuildingMonitor;

use super::manifest::Manifest;
use crate::error::BenchError;
use crate::result::ResultLine;

/// Does jobs: on threads, on a cluster, wherever a program can run that sees the manifest's folder.
///
/// A job may be done anywhere, killed at any moment, started again, or done twice at once: see
/// [`run_job`](super::run_job), which an engine calls itself or lets `sharp jobs run DIR --index N` call.
pub trait Engine: Debug {
    /// Does those of the jobs `indices` of `manifest` that are not finished. Returns when each was tried once or
    /// `monitor` wants to stop, with the errors of those that failed. One that fails stops no other.
    ///
    /// # Errors
    /// If there is no such job, or the engine cannot do jobs at all.
    fn run(
        &self,
        manifest: &Manifest,
        indices: &[usize],
        monitor: &dyn EngineMonitor,
    ) -> Result<Vec<BenchError>, BenchError>;
}

/// Watches an engine and may stop it. `()` watches nothing.
pub trait EngineMonitor: Sync {
    /// A result is there, new or found: for engines that see each.
    fn result(&self, _line: &ResultLine) {}
    /// This many results of the jobs asked for are there: for engines that look from time to time.
    fn results_so_far(&self, _count: usize) {}
    /// Watches the learning of a building: for engines whose workers are in this process.
    fn building(&self) -> &dyn BuildingMonitor {
        &()
    }
    /// Something that a user wants to know, as where logs are.
    fn message(&self, _text: &str) {}
    /// Asked often; true ends the work as soon as possible. What is finished is kept.
    fn should_stop(&self) -> bool {
        false
    }
}

impl EngineMonitor for () {}
