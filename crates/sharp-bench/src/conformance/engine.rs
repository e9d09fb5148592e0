//! The suite that every [`Engine`] must pass.

use std::path::Path;

use thiserror::Error;

use crate::error::BenchError;
use crate::jobs::{Engine, Experiment, LocalEngine, Manifest, System, merge, unfinished};
use crate::result::{Machine, ResultLine};
use crate::times::{DecisionTimes, SolveTimes};

/// How an engine breaks its promise.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum EngineViolation {
    /// It cannot do jobs at all.
    #[error("{0}")]
    Failed(#[from] BenchError),
    /// After it returned, the wrong jobs are not finished.
    #[error("after the jobs {asked:?} the jobs {is:?} are not finished, expected {expected:?}")]
    Unfinished {
        /// The jobs that it was asked for.
        asked: Vec<usize>,
        /// Those that are not finished.
        is: Vec<usize>,
        /// Those that should not be.
        expected: Vec<usize>,
    },
    /// A job that is none was not refused.
    #[error("job {0} does not exist and was not refused")]
    Unknown(usize),
    /// What is finished was done again.
    #[error("a finished job was done again: its result changed")]
    Repeated,
    /// Results differ from those of the local engine, in more than times.
    #[error("result {index} differs: {is}, expected {expected}")]
    Result {
        /// Which result.
        index: usize,
        /// What the engine made.
        is: String,
        /// What the local engine made.
        expected: String,
    },
}

/// Lets `engine` do some short jobs in the folder `shared`, which must be empty and visible to the engine's workers,
/// and compares what they leave with the work of [`LocalEngine`]. Takes some seconds of one core.
///
/// # Errors
/// Says which promise is broken.
pub fn check_engine(engine: &dyn Engine, shared: &Path) -> Result<(), EngineViolation> {
    let (of_engine, of_local) = (shared.join("engine"), shared.join("local"));
    let manifest = plan(&of_engine)?;
    for (asked, left) in [(vec![0], vec![1, 2]), (vec![0, 1, 2], vec![1])] {
        // Job 1 was planned for another version: it is refused, and stops no other.
        let _ = engine.run(&manifest, &asked, &())?;
        let is = unfinished(&manifest);
        if is != left {
            return Err(EngineViolation::Unfinished { asked, is, expected: left });
        }
    }
    let count = manifest.jobs.len();
    if engine.run(&manifest, &[count], &()).is_ok_and(|errors| errors.is_empty()) {
        return Err(EngineViolation::Unknown(count));
    }
    let results = |manifest: &Manifest| -> Result<Vec<ResultLine>, BenchError> {
        Ok(merge(manifest)?.lines().cloned().collect())
    };
    let first = results(&manifest)?;
    let _ = engine.run(&manifest, &[0, 1, 2], &())?;
    if results(&manifest)?.iter().map(text).ne(first.iter().map(text)) {
        return Err(EngineViolation::Repeated);
    }
    let local = plan(&of_local)?;
    let _ = LocalEngine { workers: 1 }.run(&local, &[0, 1, 2], &())?;
    for (index, (is, expected)) in first.iter().zip(&results(&local)?).enumerate() {
        let (is, expected) = (text(&without_times(is)), text(&without_times(expected)));
        if is != expected {
            return Err(EngineViolation::Result { index, is, expected });
        }
    }
    Ok(())
}

/// Three jobs: two that track a path through two problems, and between them one of another version.
fn plan(folder: &Path) -> Result<Manifest, BenchError> {
    let tracking = |trial| Experiment {
        trial,
        seed: 1 + u64::from(trial),
        episodes: 2,
        system: System::Track,
        ..Experiment::example()
    };
    let stale = Experiment { version: "0.0.0".to_owned(), ..tracking(1) };
    Ok(Manifest::extend(folder, vec![tracking(0), stale, tracking(2)], "conformance")?.0)
}

fn text(line: &ResultLine) -> String {
    format!("{line:?}")
}

fn without_times(line: &ResultLine) -> ResultLine {
    ResultLine {
        decision_us: DecisionTimes::default(),
        time_s: SolveTimes::default(),
        machine: Machine::default(),
        ..line.clone()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::jobs::EngineMonitor;

    #[test]
    fn the_local_engine_passes() {
        let folder = tempfile::tempdir().expect("a folder");
        check_engine(&LocalEngine { workers: 2 }, folder.path()).expect("an engine");
    }

    /// Gives up at the first job that fails.
    #[derive(Debug)]
    struct Timid;

    impl Engine for Timid {
        fn run(
            &self,
            manifest: &Manifest,
            indices: &[usize],
            monitor: &dyn EngineMonitor,
        ) -> Result<Vec<BenchError>, BenchError> {
            let each = indices.iter().map(|&index| crate::jobs::run_job(manifest, index, monitor));
            Ok(each.collect::<Result<Vec<_>, _>>().err().into_iter().collect())
        }
    }

    #[test]
    fn an_engine_that_a_bad_job_stops_is_found_out() {
        let folder = tempfile::tempdir().expect("a folder");
        let violation = check_engine(&Timid, folder.path()).expect_err("job 2 comes after job 1");
        let violation = violation.to_string();
        assert!(violation.contains("the jobs [0, 1, 2]"), "{violation}");
    }
}
