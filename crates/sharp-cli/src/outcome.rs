//! How a command ends: exit codes and the error object.

use std::fmt;

use serde::Serialize;
pub(crate) use sharp_bench::to_json;
use sharp_bench::{BenchError, ImportError, InputError, ReportError, ResultError};
use sharp_draw::PngError;
use sharp_export::RecordError;
use sharp_maps::MapError;
use sharp_plan::{FileError, SolveError};

/// Exit codes of the command, the same for every subcommand.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Exit {
    /// Done.
    Done = 0,
    /// Asked, and the answer is no.
    No = 1,
    /// Broken input or use.
    Broken = 2,
    /// Some jobs of many failed or are missing.
    Partial = 3,
    /// Interrupted on a cluster that starts the job again at this code.
    Requeue = 75,
    /// Interrupted, after saving what there was.
    Interrupted = 130,
}

/// Broken input: what is wrong, where, and what would be right.
#[derive(Debug)]
pub(crate) struct Failure {
    code: &'static str,
    message: String,
}

/// Names and numbers of Nav2's planner errors.
const NAV2: [(&str, u16); 6] = [
    ("START_OUTSIDE_MAP", 203),
    ("GOAL_OUTSIDE_MAP", 204),
    ("START_OCCUPIED", 205),
    ("GOAL_OCCUPIED", 206),
    ("TIMEOUT", 207),
    ("NO_VALID_PATH", 208),
];

#[derive(Serialize)]
struct ErrorReport<'a> {
    schema: &'static str,
    error: ErrorBody<'a>,
}

#[derive(Serialize)]
struct ErrorBody<'a> {
    code: &'a str,
    nav2: Option<u16>,
    message: &'a str,
}

impl Failure {
    pub(crate) fn new(code: &'static str, message: impl fmt::Display) -> Self {
        Self { code, message: message.to_string() }
    }

    /// The error object of `--json`.
    pub(crate) fn to_json(&self) -> String {
        let nav2 = NAV2.iter().find(|(name, _)| *name == self.code).map(|&(_, number)| number);
        let error = ErrorBody { code: self.code, nav2, message: &self.message };
        to_json(&ErrorReport { schema: "sharp.error/1", error })
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.message)
    }
}

impl From<&clap::Error> for Failure {
    /// What is wrong with the call, in one line and without the usage that a terminal shows below it.
    fn from(error: &clap::Error) -> Self {
        if error.kind() == clap::error::ErrorKind::DisplayHelpOnMissingArgumentOrSubcommand {
            return Self::new("USAGE", "a command is missing, --help lists all");
        }
        let text = error.render().to_string();
        let ends = ["\n\nUsage:", "\n\nFor more information"].map(|end| text.find(end).unwrap_or(text.len()));
        let said = &text[..ends[0].min(ends[1])];
        let words: Vec<&str> = said.strip_prefix("error: ").unwrap_or(said).split_whitespace().collect();
        Self::new("USAGE", words.join(" "))
    }
}

impl From<MapError> for Failure {
    fn from(error: MapError) -> Self {
        Self::new(error.code(), error)
    }
}

impl From<BenchError> for Failure {
    fn from(error: BenchError) -> Self {
        match error {
            // A setting is typed as a flag.
            BenchError::Setting { setting, problem } => Self::new("USAGE", format!("--{setting}: {problem}")),
            error => Self::new(error.code(), error),
        }
    }
}

impl From<InputError> for Failure {
    fn from(error: InputError) -> Self {
        Self::new(error.code(), error)
    }
}

impl From<ImportError> for Failure {
    fn from(error: ImportError) -> Self {
        Self::new("ROBOT_INVALID", error)
    }
}

impl From<FileError> for Failure {
    fn from(error: FileError) -> Self {
        Self::new("FILE_INVALID", error)
    }
}

impl From<SolveError> for Failure {
    fn from(error: SolveError) -> Self {
        BenchError::from(error).into()
    }
}

impl From<RecordError> for Failure {
    fn from(error: RecordError) -> Self {
        Self::new("FILE_INVALID", error)
    }
}

impl From<PngError> for Failure {
    fn from(error: PngError) -> Self {
        BenchError::from(error).into()
    }
}

impl From<ResultError> for Failure {
    fn from(error: ResultError) -> Self {
        BenchError::from(error).into()
    }
}

impl From<ReportError> for Failure {
    fn from(error: ReportError) -> Self {
        BenchError::from(error).into()
    }
}

impl From<anyhow::Error> for Failure {
    fn from(error: anyhow::Error) -> Self {
        Self::new("FAILED", format!("{error:#}"))
    }
}

/// Prints a line on stdout; a reader that has gone away is no error.
macro_rules! say {
    ($($part:tt)*) => {
        $crate::outcome::print_line(format_args!($($part)*))
    };
}
pub(crate) use say;

pub(crate) fn print_line(line: fmt::Arguments<'_>) {
    use std::io::Write;
    heed(writeln!(std::io::stdout(), "{line}"));
}

/// Prints `bytes` on stdout; a reader that has gone away is no error.
pub(crate) fn say_bytes(bytes: &[u8]) {
    use std::io::Write;
    heed(std::io::stdout().write_all(bytes));
}

/// Ends the program if stdout cannot take what was printed, as on a full disk: nobody may take the rest for the whole.
fn heed(printed: std::io::Result<()>) {
    if let Err(error) = printed
        && error.kind() != std::io::ErrorKind::BrokenPipe
    {
        eprintln!("error: stdout: {error}");
        std::process::exit(i32::from(Exit::Broken as u8));
    }
}
