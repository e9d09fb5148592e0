//! The local engine: jobs on the threads of this process.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use super::engine::{Engine, EngineMonitor};
use super::manifest::{Job, Manifest};
use super::work::{Ended, run_job};
use crate::error::BenchError;

/// Jobs on threads of this process.
///
/// Jobs are independent, so that a thread a job keeps every core busy without a word between them. Only where there are
/// fewer jobs than cores does a job get several threads. Long jobs begin first. Neither changes a result.
#[derive(Clone, Copy, Debug)]
pub struct LocalEngine {
    /// Jobs at once.
    pub workers: usize,
}

impl Engine for LocalEngine {
    fn run(
        &self,
        manifest: &Manifest,
        indices: &[usize],
        monitor: &dyn EngineMonitor,
    ) -> Result<Vec<BenchError>, BenchError> {
        let mut jobs = indices.iter().map(|&index| manifest.job(index)).collect::<Result<Vec<_>, _>>()?;
        jobs.sort_by(|a, b| b.weight_s.total_cmp(&a.weight_s).then(a.index.cmp(&b.index)));
        let workers = self.workers.min(jobs.len()).max(1);
        let threads_each = (self.workers / workers).max(1);
        let next = AtomicUsize::new(0);
        let work = || -> Vec<(usize, BenchError)> {
            let take = || jobs.get(next.fetch_add(1, Ordering::SeqCst)).copied();
            let pool = match rayon::ThreadPoolBuilder::new().num_threads(threads_each).build() {
                Ok(pool) => pool,
                // The other workers do its jobs; with none left they stay unfinished, which merging tells.
                Err(error) => return vec![(usize::MAX, BenchError::Engine(format!("threads: {error}")))],
            };
            let run = |job: &Job| guarded(job, || pool.install(|| run_job(manifest, job.index, monitor)));
            std::iter::from_fn(take).filter_map(|job| Some((job.index, run(job).err()?))).collect()
        };
        let mut failed: Vec<(usize, BenchError)> = thread::scope(|scope| {
            let threads: Vec<_> = (0..workers).map(|_| scope.spawn(work)).collect();
            threads.into_iter().flat_map(|thread| thread.join().unwrap_or_default()).collect()
        });
        failed.sort_by_key(|&(index, _)| index);
        Ok(failed.into_iter().map(|(_, error)| error).collect())
    }
}

/// A panic is the end of one job, not of the others.
fn guarded(job: &Job, run: impl FnOnce() -> Result<Ended, BenchError>) -> Result<Ended, BenchError> {
    catch_unwind(AssertUnwindSafe(run)).unwrap_or_else(|_| Err(job.error(BenchError::Panicked)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::jobs::Experiment;

    #[test]
    fn a_panic_is_told_with_its_job() {
        let folder = tempfile::tempdir().expect("a folder");
        let (manifest, _) =
            Manifest::extend(folder.path(), vec![Experiment::example()], "call").expect("a plan");
        let ended = guarded(&manifest.jobs[0], || panic!("on purpose"));
        let message = ended.expect_err("a panic").to_string();
        assert!(
            message.starts_with("job 0 (a-husky-interface") && message.ends_with("panicked"),
            "{message}"
        );
    }
}
