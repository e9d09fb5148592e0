//! One problem of one job as a transaction.
//!
//! A step works in a folder of its own: the library as it was after the step before, in hard links, and
//! everything that it makes. At the end the folder gets its name. So the result and the library after
//! it appear together, and a step that was killed has never been: the next one starts from the same
//! library, draws the same random numbers and gives the same result. Where two processes do the same
//! step at once, the first one names its folder and the other one takes that result.

use std::fs;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use sharp_plan::{hash, write_atomic};

use super::manifest::Job;
use crate::error::BenchError;
use crate::json::to_json;
use crate::result::{ResultLine, problem_folder};

const SCHEMA: &str = "sharp.step/1";
/// What the names of folders that are still worked in end with.
pub(super) const UNFINISHED: &str = ".tmp";

/// One problem of one job, done or not.
#[derive(Clone, Copy, Debug)]
pub(super) struct JobStep<'a> {
    pub(super) dir: &'a Path,
    pub(super) job: &'a Job,
    pub(super) problem: usize,
}

/// A result with its line as it was written: what is merged are these bytes.
#[derive(Clone, Debug)]
pub struct Done {
    /// The result.
    pub line: ResultLine,
    /// Its line.
    pub text: String,
}

/// The first line of `result.jsonl`; the result follows.
#[derive(Debug, PartialEq, Eq, Serialize, Deserialize)]
struct Header {
    schema: String,
    /// Key of the job.
    job: String,
    problem: usize,
    blake3: String,
}

impl JobStep<'_> {
    /// Everything of this step.
    pub(super) fn folder(&self) -> PathBuf {
        problem_folder(self.dir, &self.job.name, self.problem)
    }

    /// What an earlier run left, if it is whole.
    ///
    /// # Errors
    /// Returns an error that names the file if it is damaged or of another job.
    pub(super) fn read(&self) -> Result<Option<Done>, BenchError> {
        let path = self.folder().join("result.jsonl");
        if !path.exists() {
            return Ok(None);
        }
        let damaged = |problem: &str| {
            let folder = self.folder();
            let message =
                format!("{}: {problem}; remove {} to do it again", path.display(), folder.display());
            BenchError::Folder(message)
        };
        let text = fs::read_to_string(&path).map_err(|error| damaged(&error.to_string()))?;
        let mut lines = text.lines();
        let (header, text) = (lines.next().unwrap_or(""), lines.next().unwrap_or(""));
        if serde_json::from_str::<Header>(header).ok() != Some(self.header(text)) {
            return Err(damaged("damaged or of another job"));
        }
        let line = serde_json::from_str(text).map_err(|error| damaged(&error.to_string()))?;
        Ok(Some(Done { line, text: text.to_owned() }))
    }

    /// Does the step with `work`, which gets the folder to write to and the folder of the library in
    /// it, a copy of the one that `before` left; `None` if `work` was interrupted.
    ///
    /// # Errors
    /// Returns an error of `work`, or if files cannot be written.
    pub(super) fn make(
        &self,
        before: Option<&JobStep<'_>>,
        work: impl FnOnce(&Path, &Path) -> Result<Option<ResultLine>, BenchError>,
    ) -> Result<Option<Done>, BenchError> {
        let made = self.make_apart(before, work);
        match self.read() {
            // Whatever went wrong here: another process has done the step.
            Ok(Some(done)) => Ok(Some(done)),
            Ok(None) => made.map(|_| None),
            Err(damage) => made.and(Err(damage)),
        }
    }

    fn make_apart(
        &self,
        before: Option<&JobStep<'_>>,
        work: impl FnOnce(&Path, &Path) -> Result<Option<ResultLine>, BenchError>,
    ) -> Result<(), BenchError> {
        let folder = self.folder();
        let parent = folder.parent().unwrap_or(self.dir);
        fs::create_dir_all(parent).map_err(|error| unwritable(parent, &error))?;
        let temporary = temporary(parent, self.problem).map_err(|error| unwritable(parent, &error))?;
        let library = temporary.path().join("library");
        if let Some(before) = before {
            let from = before.folder().join("library");
            link_tree(&from, &library).map_err(|error| unwritable(&library, &error))?;
        }
        let Some(line) = work(temporary.path(), &library)? else { return Ok(()) };
        let text = to_json(&line);
        let content = format!("{}\n{text}\n", to_json(&self.header(&text)));
        write_atomic(&temporary.path().join("result.jsonl"), content.as_bytes())?;
        sync(temporary.path());
        let named = fs::rename(temporary.path(), &folder);
        if named.is_ok() {
            // It has gone: there is nothing to remove under the old name.
            let _ = temporary.keep();
            sync(parent);
        } else if !folder.exists() {
            return named.map_err(|error| unwritable(&folder, &error));
        } else if !folder.join("result.jsonl").exists() {
            let problem = "has no result.jsonl; remove the folder, and the step is done again";
            return Err(BenchError::Folder(format!("{}: {problem}", folder.display())));
        }
        Ok(())
    }

    fn header(&self, text: &str) -> Header {
        Header {
            schema: SCHEMA.to_owned(),
            job: self.job.key.clone(),
            problem: self.problem,
            blake3: hash(text.as_bytes()),
        }
    }
}

/// A folder beside its future name that vanishes unless it is kept.
fn temporary(parent: &Path, problem: usize) -> std::io::Result<tempfile::TempDir> {
    let prefix = format!(".p{problem}-");
    let mut builder = tempfile::Builder::new();
    builder.prefix(&prefix).suffix(UNFINISHED);
    // What the user's umask allows, like any other folder; temporary ones are private by default.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o777));
    builder.tempdir_in(parent)
}

/// The files of `from` under their names in `to`. Library files are replaced, never changed, so that
/// links are copies.
fn link_tree(from: &Path, to: &Path) -> std::io::Result<()> {
    if !from.exists() {
        return Ok(());
    }
    fs::create_dir_all(to)?;
    for entry in fs::read_dir(from)? {
        let entry = entry?;
        let (source, target) = (entry.path(), to.join(entry.file_name()));
        if entry.file_type()?.is_dir() {
            link_tree(&source, &target)?;
        } else if fs::hard_link(&source, &target).is_err() {
            fs::copy(&source, &target)?;
        }
    }
    Ok(())
}

/// Asks that the names in `folder` outlive a power cut; where that cannot be had, they outlive the process.
fn sync(folder: &Path) {
    let _ = fs::File::open(folder).and_then(|folder| folder.sync_all());
}

fn unwritable(path: &Path, error: &std::io::Error) -> BenchError {
    BenchError::Folder(format!("{}: {error}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::jobs::Experiment;
    use crate::jobs::Manifest;

    fn manifest(dir: &Path) -> Manifest {
        Manifest::extend(dir, vec![Experiment::example()], "call").expect("a plan").0
    }

    fn line(problem: usize) -> ResultLine {
        ResultLine::example("a", "husky", "interface", problem)
    }

    /// Writes one option more than there were and fails if there were not `expected`.
    fn learn(library: &Path, expected: usize) {
        fs::create_dir_all(library.join("world")).expect("a folder");
        let known = fs::read_dir(library.join("world")).expect("a folder").count();
        assert_eq!(known, expected, "options of the problems before, and of no broken attempt");
        write_atomic(&library.join(format!("world/{known}.ron")), b"option").expect("a file");
    }

    #[test]
    fn a_step_that_was_broken_off_has_never_been() {
        let folder = tempfile::tempdir().expect("a folder");
        let manifest = manifest(folder.path());
        let step = |problem| JobStep { dir: &manifest.dir, job: &manifest.jobs[0], problem };
        let (first, second) = (step(1), step(2));
        let broken = first.make(None, |_, library| {
            learn(library, 0);
            Ok(None)
        });
        assert!(broken.expect("no error").is_none() && !first.folder().exists(), "interrupted");
        let failed = first.make(None, |_, library| {
            learn(library, 0);
            Err(BenchError::Engine("a bad day".into()))
        });
        assert_eq!(failed.expect_err("an error").to_string(), "a bad day");
        for (step, before, known) in [(first, None, 0), (second, Some(&first), 1)] {
            let done = step.make(before, |_, library| {
                learn(library, known);
                Ok(Some(line(step.problem)))
            });
            assert_eq!(done.expect("no error").expect("a result").text, to_json(&line(step.problem)));
        }
        assert_eq!(fs::read_dir(first.folder().join("library/world")).expect("a folder").count(), 1);
        let names = fs::read_dir(first.folder().parent().expect("the job's folder")).expect("a folder");
        assert_eq!(names.count(), 2, "nothing but the two steps is left");
    }

    #[test]
    fn who_comes_second_takes_the_first_ones_result() {
        let folder = tempfile::tempdir().expect("a folder");
        let manifest = manifest(folder.path());
        let step = JobStep { dir: &manifest.dir, job: &manifest.jobs[0], problem: 1 };
        let second = step.make(None, |_, _| {
            let first = step.make(None, |_, _| Ok(Some(ResultLine { successes: 7, ..line(1) })));
            assert_eq!(first.expect("no error").expect("a result").line.successes, 7);
            Ok(Some(line(1)))
        });
        assert_eq!(second.expect("no error").expect("a result").line.successes, 7);
        let third = step.read().expect("sound").expect("a result");
        assert_eq!(third.line.successes, 7, "and it stays");
    }

    #[test]
    fn damage_and_results_of_other_jobs_are_named() {
        let folder = tempfile::tempdir().expect("a folder");
        let manifest = manifest(folder.path());
        let step = JobStep { dir: &manifest.dir, job: &manifest.jobs[0], problem: 1 };
        step.make(None, |_, _| Ok(Some(line(1)))).expect("a result");
        let other = JobStep { problem: 2, ..step };
        fs::create_dir_all(other.folder()).expect("a folder");
        let path = step.folder().join("result.jsonl");
        fs::copy(&path, other.folder().join("result.jsonl")).expect("a file");
        let message = other.read().expect_err("of another problem").to_string();
        assert!(message.contains("damaged or of another job; remove"), "{message}");
        let mut bytes = fs::read(&path).expect("a file");
        let middle = bytes.len() / 2;
        bytes[middle] ^= 1;
        fs::write(&path, bytes).expect("a file");
        let message = step.read().expect_err("damaged").to_string();
        assert!(message.contains("result.jsonl: damaged or of another job"), "{message}");
    }
}
