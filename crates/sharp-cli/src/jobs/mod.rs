//! Suites of experiments as jobs that any engine may run, anywhere and as often as it likes.
//!
//! A plan is a file, [`manifest`]: one line a job, with everything that decides its result. A job is a
//! chain of problems that share an option library, or the problems of one baseline. Each problem is a
//! transaction, [`step`]: a folder with its result, its plan and the library after it, which is there
//! whole or not at all. So a job may be killed at any moment, started again, or run twice at once: what
//! is there stays, what is missing is made, and the results are the same but for times.
//!
//! `sharp jobs` is the contract, `sharp eval` plans, runs and merges in one call.

mod local;
mod machine;
mod manifest;
mod merge;
mod slurm;
mod spec;
mod step;
mod suite;
mod work;

pub(crate) use local::run_jobs;
pub(crate) use manifest::{Job, Manifest};
pub(crate) use merge::{Merged, clean, count_results, merge, unfinished};
pub(crate) use slurm::{Cluster, Submission, is_queued};
pub(crate) use suite::{command, specs};
pub(crate) use work::{Ended, run_job};
