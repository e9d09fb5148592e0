//! The plan of many jobs: `DIR/manifest.jsonl`, one line a job, `sharp.jobs/1`.
//!
//! Planning again adds what is new and moves nothing: an index means the same job for ever, so that an
//! array of tasks that is still waiting in a queue does what it was submitted for.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use sharp_plan::write_atomic;

use super::spec::Spec;
use crate::outcome::{Failure, to_json};

const SCHEMA: &str = "sharp.jobs/1";

/// One line of the manifest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) struct Job {
    schema: String,
    /// Its place in the manifest, from 0.
    pub(crate) index: usize,
    /// The folder below `DIR/jobs` that holds what it makes.
    pub(crate) name: String,
    /// The hash of its specification.
    pub(crate) key: String,
    /// Expected processor time, seconds.
    pub(crate) weight_s: f64,
    /// The call that planned it.
    pub(crate) command: String,
    pub(crate) spec: Spec,
}

/// All jobs of one folder.
#[derive(Debug)]
pub(crate) struct Manifest {
    /// The folder that all jobs share.
    pub(crate) dir: PathBuf,
    /// By index.
    pub(crate) jobs: Vec<Job>,
}

impl Manifest {
    /// Reads the manifest in `dir`.
    ///
    /// # Errors
    /// Returns an error that names the file, and the line that is broken.
    pub(crate) fn open(dir: &Path) -> Result<Self, Failure> {
        let path = path(dir);
        let broken = |problem: String| Failure::new("FILE_INVALID", format!("{}{problem}", path.display()));
        let text = std::fs::read_to_string(&path).map_err(|error| match error.kind() {
            ErrorKind::NotFound => broken(": there is no manifest, make one with sharp jobs plan".into()),
            _ => broken(format!(": {error}")),
        })?;
        let parse = |(index, line): (usize, &str)| {
            parse(index, line).map_err(|problem| broken(format!(" line {}: {problem}", index + 1)))
        };
        let jobs = text.lines().enumerate().map(parse).collect::<Result<_, _>>()?;
        Ok(Self { dir: dir.to_owned(), jobs })
    }

    /// Adds those of `specs` that are not planned yet; returns the whole plan and the indices of `specs`.
    ///
    /// # Errors
    /// Returns an error if the manifest there is broken or cannot be written.
    pub(crate) fn extend(dir: &Path, specs: Vec<Spec>, command: &str) -> Result<(Self, Vec<usize>), Failure> {
        let mut manifest =
            if path(dir).exists() { Self::open(dir)? } else { Self { dir: dir.to_owned(), jobs: vec![] } };
        let planned = manifest.jobs.len();
        let indices = specs.into_iter().map(|spec| manifest.index_of(spec, command)).collect();
        if manifest.jobs.len() > planned {
            let text: String = manifest.jobs.iter().map(|job| to_json(job) + "\n").collect();
            write_atomic(&path(dir), text.as_bytes())?;
        }
        Ok((manifest, indices))
    }

    fn index_of(&mut self, spec: Spec, command: &str) -> usize {
        let key = spec.key();
        if let Some(job) = self.jobs.iter().find(|job| job.key == key) {
            return job.index;
        }
        let index = self.jobs.len();
        self.jobs.push(Job {
            schema: SCHEMA.to_owned(),
            index,
            name: spec.name(),
            key,
            weight_s: spec.weight_s(),
            command: command.to_owned(),
            spec,
        });
        index
    }

    /// The job with `index`.
    ///
    /// # Errors
    /// Returns an error if there is none.
    pub(crate) fn job(&self, index: usize) -> Result<&Job, Failure> {
        self.jobs.get(index).ok_or_else(|| {
            let message = format!("job {index} does not exist, there are {}", self.jobs.len());
            Failure::new("USAGE", message)
        })
    }
}

fn path(dir: &Path) -> PathBuf {
    dir.join("manifest.jsonl")
}

fn parse(index: usize, line: &str) -> Result<Job, String> {
    let job: Job = serde_json::from_str(line).map_err(|error| error.to_string())?;
    let (key, name) = (job.spec.key(), job.spec.name());
    for (field, is, expected) in [
        ("schema", &*job.schema, SCHEMA),
        ("index", &*job.index.to_string(), &*index.to_string()),
        ("key", &*job.key, &*key),
        ("name", &*job.name, &*name),
    ] {
        if is != expected {
            return Err(format!("{field} is {is}, expected {expected}"));
        }
    }
    Ok(job)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn trials(count: u32) -> Vec<Spec> {
        (0..count).map(|trial| Spec { trial, ..Spec::example() }).collect()
    }

    #[test]
    fn planning_again_adds_and_moves_nothing() {
        let folder = tempfile::tempdir().expect("a folder");
        let (first, indices) = Manifest::extend(folder.path(), trials(2), "one").expect("a plan");
        assert_eq!(indices, [0, 1]);
        let specs: Vec<Spec> = trials(3).into_iter().rev().collect();
        let (second, indices) = Manifest::extend(folder.path(), specs, "two").expect("a plan");
        assert_eq!(indices, [2, 1, 0], "in the order asked for");
        assert_eq!(second.jobs[..2], first.jobs[..], "planned jobs stay as they are");
        assert_eq!(Manifest::open(folder.path()).expect("a plan").jobs, second.jobs, "as written");
    }

    #[test]
    fn broken_lines_are_named() {
        let folder = tempfile::tempdir().expect("a folder");
        let missing = Manifest::open(folder.path()).expect_err("no plan").to_string();
        assert!(missing.contains("there is no manifest"), "{missing}");
        let (_, _) = Manifest::extend(folder.path(), trials(2), "call").expect("a plan");
        let path = folder.path().join("manifest.jsonl");
        let sound = std::fs::read_to_string(&path).expect("a manifest");
        for (from, to, expected) in [
            ("\"index\":1", "\"index\":7", "line 2: index is 7, expected 1"),
            ("\"trial\":1", "\"trial\":5", "line 2: key is"),
            ("\"env\":\"a\"", "\"env\":", "line 1: expected value"),
            ("jobs/1", "jobs/9", "line 1: schema is sharp.jobs/9, expected sharp.jobs/1"),
        ] {
            std::fs::write(&path, sound.replace(from, to)).expect("a file");
            let message = Manifest::open(folder.path()).expect_err("broken").to_string();
            assert!(message.contains(expected), "{message}");
        }
    }
}
