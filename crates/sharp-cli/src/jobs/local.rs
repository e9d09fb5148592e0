//! The local engine: jobs on the threads of this process.
//!
//! Jobs are independent, so that a thread a job keeps every core busy without a word between them; only
//! where there are fewer jobs than cores does a job get several threads. Long jobs begin first. Neither
//! changes a result: they are keyed by job.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;

use super::manifest::Job;
use super::work::{Ended, run_job};
use crate::outcome::Failure;
use sharp_bench::ResultLine;

/// Does `jobs` below `dir`, at most `workers` at once, and tells `watch` of every result as it comes.
/// Returns how each job ended, in the order of `jobs`; one that fails or panics stops no other.
pub(crate) fn run_jobs(
    dir: &Path,
    jobs: &[&Job],
    workers: usize,
    watch: &(dyn Fn(&ResultLine) + Sync),
) -> Vec<Result<Ended, Failure>> {
    let mut order: Vec<usize> = (0..jobs.len()).collect();
    order.sort_by(|&a, &b| jobs[b].weight_s.total_cmp(&jobs[a].weight_s).then(a.cmp(&b)));
    let workers_wanted = workers.min(jobs.len()).max(1);
    let threads_each = (workers / workers_wanted).max(1);
    let next = AtomicUsize::new(0);
    let work = || -> Vec<(usize, Result<Ended, Failure>)> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads_each).build();
        let take = || order.get(next.fetch_add(1, Ordering::SeqCst)).copied();
        std::iter::from_fn(take)
            .map(|index| {
                let run = || run_job(dir, jobs[index], watch);
                let ended = match &pool {
                    Ok(pool) => guarded(jobs[index], || pool.install(run)),
                    Err(error) => Err(Failure::new("FAILED", format!("threads: {error}"))),
                };
                (index, ended)
            })
            .collect()
    };
    let mut ended: Vec<(usize, Result<Ended, Failure>)> = thread::scope(|scope| {
        let threads: Vec<_> = (0..workers_wanted).map(|_| scope.spawn(work)).collect();
        threads.into_iter().flat_map(|thread| thread.join().unwrap_or_default()).collect()
    });
    ended.sort_by_key(|&(index, _)| index);
    ended.into_iter().map(|(_, ended)| ended).collect()
}

/// A panic is the end of one job, not of the others.
fn guarded(job: &Job, run: impl FnOnce() -> Result<Ended, Failure>) -> Result<Ended, Failure> {
    catch_unwind(AssertUnwindSafe(run))
        .unwrap_or_else(|_| Err(Failure::new("FAILED", format!("job {} ({}) panicked", job.index, job.name))))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::args::SystemName;
    use crate::jobs::Manifest;
    use crate::jobs::spec::Spec;

    fn tracking(trial: u32) -> Spec {
        let spec =
            Spec { trial, episodes: 1, problems: vec![2], system: SystemName::Track, ..Spec::example() };
        Spec { sharp: None, ..spec }
    }

    #[test]
    fn one_bad_job_stops_no_other() {
        let folder = tempfile::tempdir().expect("a folder");
        let stale = Spec { version: "0.0.1".into(), ..tracking(1) };
        let specs = vec![stale, tracking(0), tracking(2)];
        let (manifest, _) = Manifest::extend(folder.path(), specs, "call").expect("a plan");
        let jobs: Vec<&Job> = manifest.jobs.iter().collect();
        let seen = AtomicUsize::new(0);
        let watch = |_: &ResultLine| {
            seen.fetch_add(1, Ordering::SeqCst);
        };
        let ended = run_jobs(folder.path(), &jobs, 2, &watch);
        assert!(matches!(&ended[..], [Err(_), Ok(Ended::Done), Ok(Ended::Done)]), "{ended:?}");
        assert_eq!(seen.into_inner(), 2, "one result of each good job");
        let message = ended[0].as_ref().expect_err("stale").to_string();
        assert!(message.starts_with(&format!("job 0 ({})", jobs[0].name)), "{message}");
    }

    #[test]
    fn a_panic_is_told_with_its_job() {
        let folder = tempfile::tempdir().expect("a folder");
        let (manifest, _) = Manifest::extend(folder.path(), vec![tracking(0)], "call").expect("a plan");
        let ended = guarded(&manifest.jobs[0], || panic!("on purpose"));
        let message = ended.expect_err("a panic").to_string();
        assert!(message.starts_with("job 0 (a-husky-track") && message.ends_with("panicked"), "{message}");
    }
}
