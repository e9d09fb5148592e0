//! Starting cargo and the `sharp` command from the root of the workspace.

use std::process::Command;

use anyhow::Context;

use crate::tree;

/// A call of cargo with `args` from the root of the workspace.
pub(crate) fn cargo(args: &[&str]) -> Command {
    // Cargo names itself to what it runs; without it the toolchain of the path is as good.
    let mut command = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    command.args(args).current_dir(tree::root());
    command
}

/// A call of the `sharp` command, built in release mode with `features` (comma-separated, may be empty).
pub(crate) fn sharp(features: &str, args: &[&str]) -> Command {
    let mut command = cargo(&["run", "--quiet", "--release", "--package", "sharp-cli"]);
    if !features.is_empty() {
        command.args(["--features", features]);
    }
    command.arg("--").args(args);
    command
}

/// Runs `command` to its end and returns its exit code; what it prints passes through.
///
/// # Errors
/// Returns an error if the command cannot be started.
pub(crate) fn exit_code(command: &mut Command) -> anyhow::Result<u8> {
    let status = command.status().with_context(|| format!("cannot start {:?}", command.get_program()))?;
    // A command that a signal ended has no code.
    Ok(status.code().and_then(|code| u8::try_from(code).ok()).unwrap_or(1))
}

/// The value that follows the flag `name` in `args`, written `--name value` or `--name=value`.
pub(crate) fn flag<'a>(args: &'a [String], name: &str) -> Option<&'a str> {
    args.iter().enumerate().find_map(|(i, arg)| match arg.strip_prefix(name)? {
        "" => args.get(i + 1).map(String::as_str),
        rest => rest.strip_prefix('='),
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flags_are_found_in_both_spellings() {
        let args = ["--device", "flex", "--out=here", "--profiles"].map(String::from);
        assert_eq!(flag(&args, "--device"), Some("flex"), "two words");
        assert_eq!(flag(&args, "--out"), Some("here"), "one word");
        assert_eq!(flag(&args, "--profile"), None, "only the beginning of another flag");
    }
}
