//! Robots from the files that their owners have: Nav2 or `move_base` parameters (YAML) and URDF.
//!
//! [`import_robot`] reads one file or several of the same robot and writes a robot file: what was found with its
//! source, and what had to be assumed.

mod facts;
mod nav2;
mod urdf;
mod write;
mod yaml;

use std::fs;
use std::path::{Path, PathBuf};

use serde::Serialize;
use sharp_sim::{RobotError, RobotModel};
use thiserror::Error;

use facts::{Facts, Quantity};

/// Larger than any parameter file or robot description, bytes.
const FILE_MAX_BYTES: u64 = 8 << 20;

/// Why no robot came of the files.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ImportError {
    /// A file cannot be read.
    #[error("{}: cannot be read: {reason}", file.display())]
    Unreadable {
        /// The file.
        file: PathBuf,
        /// The reason.
        reason: String,
    },
    /// A file is no YAML and no URDF, or breaks their rules.
    #[error("{}: {problem}", file.display())]
    Broken {
        /// The file.
        file: PathBuf,
        /// What is wrong, where, and what would be right.
        problem: String,
    },
    /// Something that cannot be assumed is in none of the files.
    #[error("no {what} in {files}: {remedy}")]
    Missing {
        /// What is missing.
        what: &'static str,
        /// The files, separated by commas.
        files: String,
        /// Where it could come from.
        remedy: &'static str,
    },
    /// What was found together is no robot.
    #[error("what {files} say makes no robot: {source}")]
    Robot {
        /// The files, separated by commas.
        files: String,
        /// What is wrong.
        source: RobotError,
    },
}

/// What the caller knows better than the files.
#[derive(Clone, Debug, Default)]
pub struct ImportWishes {
    /// What the robot is called; by default the URDF's name or the first file's.
    pub name: Option<String>,
    /// Its top speed, metres per second.
    pub max_speed_mps: Option<f64>,
    /// True if it steers like a car, false if it turns in place.
    pub is_car: Option<bool>,
}

/// A value of an imported robot and where it comes from.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ImportedField {
    /// The field of the robot file.
    pub field: &'static str,
    /// Its value, as the file writes it.
    pub value: String,
    /// The key it was read from, or why it was assumed.
    pub source: String,
}

/// A robot made of the files of others.
#[derive(Clone, Debug)]
pub struct ImportedRobot {
    /// The robot.
    pub robot: RobotModel,
    /// The robot file, with comments.
    pub text: String,
    /// What the files say.
    pub found: Vec<ImportedField>,
    /// What they do not say.
    pub assumed: Vec<ImportedField>,
    /// What was read in another way than its owner may expect.
    pub warnings: Vec<String>,
}

/// Makes a robot of `files`, which all describe the same one: Nav2 or `move_base` parameters (YAML) or URDF. Where two
/// say the same, the first one counts.
///
/// # Errors
/// If a file cannot be read, has neither format, or footprint or top speed are missing everywhere.
pub fn import_robot(files: &[PathBuf], wishes: &ImportWishes) -> Result<ImportedRobot, ImportError> {
    let mut facts = Facts::default();
    if let Some(speed_mps) = wishes.max_speed_mps {
        facts.add(Quantity::MaxSpeed, speed_mps, "given by --max-speed");
    }
    if let Some(is_car) = wishes.is_car {
        facts.say_drive(is_car, "given by --drive");
    }
    for file in files {
        read(file, &mut facts)?;
    }
    let name = wishes.name.clone().or_else(|| facts.name.clone()).unwrap_or_else(|| stem(files));
    write::robot(&name, files, facts)
}

fn stem(files: &[PathBuf]) -> String {
    let stem = files.first().and_then(|file| file.file_stem());
    stem.map_or_else(|| "robot".to_owned(), |stem| stem.to_string_lossy().into_owned())
}

fn read(file: &Path, facts: &mut Facts) -> Result<(), ImportError> {
    let unreadable = |reason: String| ImportError::Unreadable { file: file.to_owned(), reason };
    let metadata = fs::metadata(file).map_err(|error| unreadable(error.to_string()))?;
    if !metadata.is_file() || metadata.len() > FILE_MAX_BYTES {
        return Err(unreadable("must be a regular file of at most 8 MiB".to_owned()));
    }
    let text = fs::read_to_string(file).map_err(|error| unreadable(error.to_string()))?;
    let is_xml = text.trim_start().starts_with('<');
    let read = if is_xml { urdf::read(&text, facts) } else { nav2::read(&text, facts) };
    read.map_err(|problem| ImportError::Broken { file: file.to_owned(), problem })
}

fn listed(files: &[PathBuf]) -> String {
    files.iter().map(|file| file.display().to_string()).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests;
