//! `cargo xtask soak`: the promises of `tests/soak`, held against many cases.

use crate::process::{cargo, exit_code};

/// Runs all of `tests/soak` with as many cases as `docs/testing.md` says, or those whose name holds one of `names`.
///
/// # Errors
/// Returns an error if cargo cannot be started.
pub(crate) fn run(names: &[String]) -> anyhow::Result<u8> {
    let mut command = cargo(&["test", "--release", "--workspace", "--test", "soak", "--"]);
    // One after the other, so that the memory that a test sees is its own; each uses all cores.
    command.args(["--nocapture", "--test-threads", "1"]).args(names).env("SHARP_SOAK", "1");
    exit_code(&mut command)
}
