//! Suites of experiments as jobs that any engine may run, anywhere and as often as it likes.
//!
//! A plan is a file (`manifest.rs`): one line a job, with everything that decides its result. A job is a
//! chain of problems that share an option library, or the problems of one baseline. Each problem is a
//! transaction (`step.rs`): a folder with its result, its plan and the library after it, which is there
//! whole or not at all. So a job may be killed at any moment, started again, or run twice at once: what
//! is there stays, what is missing is made, and the results are the same but for times. A job may also be
//! a lesson (`lesson.rs`): a share of the learning of a building.

mod engine;
mod experiment;
mod lesson;
mod local;
mod machine;
mod manifest;
mod merge;
mod slurm;
mod step;
mod suite;
mod work;

pub use engine::{Engine, EngineMonitor};
pub use experiment::{Experiment, Inputs, SharpSettings, System};
pub use lesson::{Lesson, LessonRound};
pub use local::LocalEngine;
pub use manifest::{Job, JobWork, Manifest};
pub use merge::{Merged, clean, count_results, merge, unfinished};
pub use slurm::{SlurmEngine, SlurmScripts, Submission};
pub use step::Done;
pub use suite::{Suite, SuiteSelection};
pub use work::{Ended, run_job};
