//! Putting together what all jobs left.

use std::fs;

use sharp_plan::write_atomic;

use super::lesson::is_done;
use super::manifest::{Job, JobWork, Manifest};
use super::step::{Done, UNFINISHED};
use super::work::steps;
use crate::error::BenchError;
use crate::result::ResultLine;

/// All results that are there, and the jobs that are not whole.
#[derive(Debug)]
pub struct Merged {
    /// By job, each with its problems in order.
    pub results: Vec<Vec<Done>>,
    /// The jobs that are not whole, and what is wrong with them.
    pub missing: Vec<(usize, BenchError)>,
}

impl Merged {
    /// All results, in the order of the manifest.
    pub fn lines(&self) -> impl Iterator<Item = &ResultLine> {
        self.results.iter().flatten().map(|done| &done.line)
    }
}

/// Reads and verifies every result of `manifest` and writes those that are there to `results.jsonl`, in
/// the order of the manifest.
///
/// # Errors
/// Returns an error if `results.jsonl` cannot be written. Damage and gaps are in [`Merged::missing`].
pub fn merge(manifest: &Manifest) -> Result<Merged, BenchError> {
    let mut merged = Merged { results: vec![], missing: vec![] };
    for job in &manifest.jobs {
        let (results, missing) = collect(manifest, job);
        merged.results.push(results);
        merged.missing.extend(missing.map(|error| (job.index, error)));
    }
    let text: String = merged.results.iter().flatten().map(|done| format!("{}\n", done.text)).collect();
    write_atomic(&manifest.dir.join("results.jsonl"), text.as_bytes())?;
    Ok(merged)
}

/// The results of `job`, and what is wrong if they are not all there.
fn collect(manifest: &Manifest, job: &Job) -> (Vec<Done>, Option<BenchError>) {
    let mut results = Vec::new();
    if let JobWork::Lesson(_) = job.work {
        let missing = match is_done(&manifest.dir, job) {
            Ok(true) => None,
            Ok(false) => Some(BenchError::Missing(0)),
            Err(error) => Some(error),
        };
        return (results, missing.map(|error| job.error(error)));
    }
    for step in steps(&manifest.dir, job) {
        match step.read() {
            Ok(Some(done)) => results.push(done),
            Ok(None) => {
                return (results, Some(job.error(BenchError::Missing(step.problem))));
            }
            Err(error) => return (results, Some(job.error(error))),
        }
    }
    (results, None)
}

/// Indices of the jobs that are not whole.
#[must_use]
pub fn unfinished(manifest: &Manifest) -> Vec<usize> {
    let is_open = |job: &&Job| collect(manifest, job).1.is_some();
    manifest.jobs.iter().filter(is_open).map(|job| job.index).collect()
}

/// Number of results of the jobs `indices` that are there; a lesson that is finished counts as one.
///
/// # Panics
/// If `manifest` has no such job.
#[must_use]
pub fn count_results(manifest: &Manifest, indices: &[usize]) -> usize {
    let of_job = |job: &Job| match job.work {
        JobWork::Experiment(_) => steps(&manifest.dir, job).filter(|step| step.folder().exists()).count(),
        JobWork::Lesson(_) => usize::from(is_done(&manifest.dir, job).unwrap_or(false)),
    };
    indices.iter().map(|&index| of_job(&manifest.jobs[index])).sum()
}

/// Removes what killed processes left of the jobs of `manifest`, all of which are done.
pub fn clean(manifest: &Manifest) {
    for job in &manifest.jobs {
        let folder = manifest.dir.join("jobs").join(&job.name);
        for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
            let name = entry.file_name();
            let name = name.to_string_lossy();
            if name.starts_with(".p") && name.ends_with(UNFINISHED) {
                // Someone who still works there finds the step done and goes.
                let _ = fs::remove_dir_all(entry.path());
            }
        }
    }
}
