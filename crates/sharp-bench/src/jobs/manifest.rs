//! The plan of many jobs: `DIR/manifest.jsonl`, one line a job, `sharp.jobs/2`.
//!
//! Planning again adds what is new and moves nothing: an index means the same job for ever, so that an
//! array of tasks that is still waiting in a queue does what it was submitted for.

use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use sharp_plan::write_atomic;

use super::experiment::Experiment;
use super::lesson::Lesson;
use crate::error::BenchError;
use crate::json::to_json;

const SCHEMA: &str = "sharp.jobs/2";

/// One line of the manifest.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Job {
    schema: String,
    /// Its place in the manifest, from 0.
    pub index: usize,
    /// The folder below `DIR/jobs` that holds what it makes.
    pub name: String,
    /// The hash of its experiment.
    pub key: String,
    /// Expected processor time, seconds.
    pub weight_s: f64,
    /// The call that planned it.
    pub command: String,
    /// What is done.
    #[serde(flatten)]
    pub work: JobWork,
}

/// What a job does.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum JobWork {
    /// It measures a system.
    Experiment(Experiment),
    /// It learns a share of a building.
    Lesson(Lesson),
}

impl From<Experiment> for JobWork {
    fn from(experiment: Experiment) -> Self {
        Self::Experiment(experiment)
    }
}

impl From<Lesson> for JobWork {
    fn from(lesson: Lesson) -> Self {
        Self::Lesson(lesson)
    }
}

impl JobWork {
    /// The hash of all that decides its result.
    #[must_use]
    pub fn key(&self) -> String {
        match self {
            Self::Experiment(experiment) => experiment.key(),
            Self::Lesson(lesson) => lesson.key(),
        }
    }

    /// A name for files.
    #[must_use]
    pub fn name(&self) -> String {
        match self {
            Self::Experiment(experiment) => experiment.name(),
            Self::Lesson(lesson) => lesson.name(),
        }
    }

    /// Expected processor time, seconds.
    #[must_use]
    pub fn weight_s(&self) -> f64 {
        match self {
            Self::Experiment(experiment) => experiment.weight_s(),
            Self::Lesson(lesson) => lesson.weight_s(),
        }
    }

    /// The problems that it solves, by number; a lesson has none.
    #[must_use]
    pub fn problems(&self) -> &[usize] {
        match self {
            Self::Experiment(experiment) => &experiment.problems,
            Self::Lesson(_) => &[],
        }
    }
}

/// All jobs of one folder.
#[derive(Clone, Debug)]
pub struct Manifest {
    /// The folder that all jobs share.
    pub dir: PathBuf,
    /// By index.
    pub jobs: Vec<Job>,
}

impl Job {
    /// `source`, told with the job that it happened in.
    pub(super) fn error(&self, source: BenchError) -> BenchError {
        BenchError::Job { index: self.index, name: self.name.clone(), source: Box::new(source) }
    }
}

impl Manifest {
    /// Reads the manifest in `dir`.
    ///
    /// # Errors
    /// Returns an error that names the file, and the line that is broken.
    pub fn open(dir: &Path) -> Result<Self, BenchError> {
        let path = path(dir);
        let broken = |problem: String| BenchError::Folder(format!("{}{problem}", path.display()));
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

    /// Adds those of `works` that are not planned yet by the call `command`; returns the whole plan and the indices of
    /// `works`, each once.
    ///
    /// # Errors
    /// Returns an error if the manifest there is broken or cannot be written.
    pub fn extend<W: Into<JobWork>>(
        dir: &Path,
        works: Vec<W>,
        command: &str,
    ) -> Result<(Self, Vec<usize>), BenchError> {
        let mut manifest =
            if path(dir).exists() { Self::open(dir)? } else { Self { dir: dir.to_owned(), jobs: vec![] } };
        let planned = manifest.jobs.len();
        let mut indices: Vec<usize> = Vec::with_capacity(works.len());
        for work in works {
            let index = manifest.index_of(work.into(), command);
            // A value may be given twice in a list.
            if !indices.contains(&index) {
                indices.push(index);
            }
        }
        if manifest.jobs.len() > planned {
            let text: String = manifest.jobs.iter().map(|job| to_json(job) + "\n").collect();
            write_atomic(&path(dir), text.as_bytes())?;
        }
        Ok((manifest, indices))
    }

    fn index_of(&mut self, work: JobWork, command: &str) -> usize {
        let key = work.key();
        if let Some(job) = self.jobs.iter().find(|job| job.key == key) {
            return job.index;
        }
        let index = self.jobs.len();
        self.jobs.push(Job {
            schema: SCHEMA.to_owned(),
            index,
            name: work.name(),
            key,
            weight_s: work.weight_s(),
            command: command.to_owned(),
            work,
        });
        index
    }

    /// The job with `index`.
    ///
    /// # Errors
    /// Returns an error if there is none.
    pub fn job(&self, index: usize) -> Result<&Job, BenchError> {
        self.jobs.get(index).ok_or_else(|| {
            let problem = format!("job {index} does not exist, there are {}", self.jobs.len());
            BenchError::Setting { setting: "index", problem }
        })
    }
}

fn path(dir: &Path) -> PathBuf {
    dir.join("manifest.jsonl")
}

fn parse(index: usize, line: &str) -> Result<Job, String> {
    let job: Job = serde_json::from_str(line).map_err(|error| error.to_string())?;
    let (key, name) = (job.work.key(), job.work.name());
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

    fn trials(count: u32) -> Vec<Experiment> {
        (0..count).map(|trial| Experiment { trial, ..Experiment::example() }).collect()
    }

    #[test]
    fn planning_again_adds_and_moves_nothing() {
        let folder = tempfile::tempdir().expect("a folder");
        let (first, indices) = Manifest::extend(folder.path(), trials(2), "one").expect("a plan");
        assert_eq!(indices, [0, 1]);
        let experiments: Vec<Experiment> = trials(3).into_iter().rev().collect();
        let (second, indices) = Manifest::extend(folder.path(), experiments, "two").expect("a plan");
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
            ("jobs/2", "jobs/9", "line 1: schema is sharp.jobs/9, expected sharp.jobs/2"),
        ] {
            std::fs::write(&path, sound.replace(from, to)).expect("a file");
            let message = Manifest::open(folder.path()).expect_err("broken").to_string();
            assert!(message.contains(expected), "{message}");
        }
    }
}
