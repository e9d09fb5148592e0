//! `cargo xtask ci`: everything that must pass before a change is merged.
//!
//! All steps build with the release profile, so that the heavy dependencies are compiled once; see
//! `docs/decisions/0001-release-profile-for-tests.md`.

use std::time::{Duration, Instant};

use anyhow::ensure;

use crate::process::{cargo, exit_code};
use crate::{downstream, examples, fuzz, packages, tidy};

/// Runs the steps in order up to the first that fails, and says how long each took; with `names` only these.
///
/// # Errors
/// Returns an error if a name is unknown or a step cannot be started.
pub(crate) fn run(names: &[String]) -> anyhow::Result<u8> {
    let unknown = names.iter().find(|name| !STEPS.iter().any(|(step, _)| step == name));
    ensure!(unknown.is_none(), "no step is called {}", unknown.map_or("", String::as_str));
    let mut times: Vec<(&str, Duration, u8)> = Vec::new();
    for (name, step) in
        STEPS.into_iter().filter(|(step, _)| names.is_empty() || names.iter().any(|name| name == step))
    {
        eprintln!("\n=== {name}");
        let start = Instant::now();
        let code = step()?;
        times.push((name, start.elapsed(), code));
        if code != 0 {
            break;
        }
    }
    eprintln!();
    for (name, time, code) in &times {
        eprintln!("{:7.1} s  {name}{}", time.as_secs_f64(), if *code == 0 { "" } else { "  FAILED" });
    }
    Ok(times.last().map_or(0, |(_, _, code)| *code))
}

type Step = fn() -> anyhow::Result<u8>;

/// Cheap steps first.
const STEPS: [(&str, Step); 9] = [
    ("format", format),
    ("tidy", tidy::run),
    ("packages", packages::run),
    ("clippy", clippy),
    ("docs", docs),
    ("tests", tests),
    ("examples", examples::run),
    ("downstream", downstream::run),
    ("fuzz", fuzz::step),
];

fn format() -> anyhow::Result<u8> {
    let code = exit_code(&mut cargo(&["fmt", "--all", "--check"]))?;
    let downstream = exit_code(cargo(&["fmt", "--check"]).current_dir(downstream::folder()))?;
    let fuzz = exit_code(cargo(&["fmt", "--check"]).current_dir(fuzz::source()))?;
    Ok(code.max(downstream).max(fuzz))
}

fn clippy() -> anyhow::Result<u8> {
    exit_code(&mut cargo(&["clippy", "--release", "--workspace", "--all-targets", "--", "-D", "warnings"]))
}

fn docs() -> anyhow::Result<u8> {
    let mut command = cargo(&["doc", "--release", "--no-deps", "--workspace"]);
    exit_code(command.env("RUSTDOCFLAGS", "-Dwarnings"))
}

fn tests() -> anyhow::Result<u8> {
    exit_code(&mut cargo(&["test", "--release", "--workspace"]))
}
