//! What can go wrong around a measurement.

use sharp_draw::PngError;
use sharp_maps::MapError;
use sharp_plan::{FileError, QueryError, SolveError};
use thiserror::Error;

use crate::evaluation::ReportError;
use crate::named::InputError;
use crate::result::ResultError;

/// Why something could not be solved, measured, planned or merged.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum BenchError {
    /// A map cannot be read.
    #[error(transparent)]
    Map(#[from] MapError),
    /// A robot, a noise or regions are not known.
    #[error(transparent)]
    Input(#[from] InputError),
    /// A robot cannot stand at an end of the problem.
    #[error(transparent)]
    Query(#[from] QueryError),
    /// Solving failed.
    #[error(transparent)]
    Solve(#[from] SolveError),
    /// A file cannot be read or written.
    #[error(transparent)]
    File(#[from] FileError),
    /// Results cannot be read.
    #[error(transparent)]
    Result(#[from] ResultError),
    /// The report cannot be written.
    #[error(transparent)]
    Report(#[from] ReportError),
    /// A picture cannot be drawn.
    #[error(transparent)]
    Picture(#[from] PngError),
    /// Learning failed.
    #[error("learning failed: {0}")]
    Learning(String),
    /// A setting is out of range or selects nothing.
    #[error("{setting}: {problem}")]
    Setting {
        /// The name of the setting, as in `time-limit`.
        setting: &'static str,
        /// Its value and what was expected.
        problem: String,
    },
    /// A file or folder of jobs is damaged, missing or cannot be written.
    #[error("{0}")]
    Folder(String),
    /// A job was planned for another build or other input.
    #[error("{what} is {is}, the job was planned for {planned}")]
    Stale {
        /// What differs.
        what: String,
        /// What this program has.
        is: String,
        /// What the job asks for.
        planned: String,
    },
    /// A result is not there yet.
    #[error("problem {0} is missing")]
    Missing(usize),
    /// A job went wrong.
    #[error("job {index} ({name}): {source}")]
    Job {
        /// Its number in the manifest.
        index: usize,
        /// Its name.
        name: String,
        /// What went wrong.
        source: Box<Self>,
    },
    /// A job panicked: a fault of this program.
    #[error("panicked")]
    Panicked,
    /// Slurm refused or cannot be asked.
    #[error("{0}")]
    Slurm(String),
    /// Another engine cannot do jobs.
    #[error("{0}")]
    Engine(String),
}

impl BenchError {
    /// A short name for programs, as in `FILE_INVALID`.
    #[must_use]
    pub fn code(&self) -> &'static str {
        match self {
            Self::Map(error) => error.code(),
            Self::Input(error) => error.code(),
            Self::Query(error) => error.code(),
            Self::Solve(SolveError::File(_))
            | Self::File(_)
            | Self::Result(_)
            | Self::Report(ReportError::File(_) | ReportError::Picture { .. })
            | Self::Folder(_) => "FILE_INVALID",
            Self::Solve(SolveError::NothingWithin { .. }) => "USAGE",
            Self::Solve(_) => "NO_FREE_SPACE",
            Self::Learning(_) | Self::Panicked | Self::Picture(_) | Self::Report(_) => "FAILED",
            Self::Setting { .. } => "USAGE",
            Self::Stale { .. } => "JOB_STALE",
            Self::Missing(_) => "JOB_MISSING",
            Self::Job { source, .. } => source.code(),
            Self::Slurm(_) => "SLURM",
            Self::Engine(_) => "ENGINE",
        }
    }
}
