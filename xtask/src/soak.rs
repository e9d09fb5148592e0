//! `cargo xtask soak`: promises held against many cases.

use crate::process::{cargo, exit_code};

/// Moments at which each command is killed.
const KILLS: &str = "70";

/// Runs `tests/soak`, the tests of killed commands and of other promises with as many cases as `docs/testing.md` says,
/// or those whose name holds one of `names`.
///
/// # Errors
/// Returns an error if cargo cannot be started.
pub(crate) fn run(names: &[String]) -> anyhow::Result<u8> {
    let mut command =
        cargo(&["test", "--release", "--workspace", "--test", "soak", "--test", "chaos", "--test", "jobs"]);
    command.args(["--test", "promises"]);
    // One after the other, so that the memory that a test sees is its own; each uses all cores.
    command.args(["--no-fail-fast", "--", "--nocapture", "--test-threads", "1"]).args(names);
    let share = std::env::var("SHARP_SOAK").unwrap_or_else(|_| "1".to_owned());
    command.env("SHARP_SOAK", share).env("SHARP_KILLS", KILLS);
    exit_code(&mut command)
}
