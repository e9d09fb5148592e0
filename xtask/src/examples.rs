//! Running every example that needs no argument: each asserts what it shows.

use std::fs;
use std::process::{Command, Stdio};

use anyhow::{Context, ensure};
use serde_json::Value;

use crate::process::{cargo, exit_code};
use crate::tree;

/// Examples that need arguments, by the beginning of their names. The peers drive other programs for comparison.
const WITH_ARGUMENTS: [&str; 6] =
    ["peer_", "draw_regions", "questions", "random_problems", "paper_", "yardstick"];

/// Builds the examples of all crates as `cargo test` does, and runs them one after the other.
///
/// # Errors
/// Returns an error if cargo or an example cannot be started.
pub(crate) fn run() -> anyhow::Result<u8> {
    // Together with all crates: the features are those of the tests, and everything is built already.
    let args =
        ["build", "--release", "--workspace", "--examples", "--message-format", "json-render-diagnostics"];
    let output = cargo(&args).stderr(Stdio::inherit()).output().context("cannot start cargo build")?;
    ensure!(output.status.success(), "the examples do not build");
    // Some write pictures.
    let folder = tree::root().join("target/tmp/examples");
    fs::create_dir_all(&folder).with_context(|| format!("cannot make {}", folder.display()))?;
    let mut code = 0;
    let examples = parse(&String::from_utf8_lossy(&output.stdout));
    for (name, program) in &examples {
        let mut command = Command::new(program);
        let one = exit_code(command.current_dir(&folder).stdout(Stdio::null()))?;
        eprintln!("example {name}: {}", if one == 0 { "passed" } else { "FAILED" });
        code = code.max(one);
    }
    ensure!(!examples.is_empty(), "no example was found");
    Ok(code)
}

/// The examples that cargo built and that run without arguments: names and programs.
fn parse(messages: &str) -> Vec<(String, String)> {
    let message = |line: &str| serde_json::from_str::<Value>(line).ok();
    let example = |message: Value| {
        let name = message["target"]["name"].as_str()?.to_owned();
        let is_example = message["target"]["kind"].as_array()?.iter().any(|kind| kind == "example");
        let runs_alone = !WITH_ARGUMENTS.iter().any(|prefix| name.starts_with(prefix));
        let program = message["executable"].as_str()?.to_owned();
        (is_example && runs_alone).then_some((name, program))
    };
    let mut examples: Vec<_> = messages.lines().filter_map(message).filter_map(example).collect();
    examples.sort();
    examples
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn examples_without_arguments_are_found() {
        let line = |name: &str, kind: &str| {
            format!(r#"{{"target":{{"name":"{name}","kind":["{kind}"]}},"executable":"/t/{name}"}}"#)
        };
        let messages = [
            line("tiles", "example"),
            "{\"reason\":\"build-finished\"}".into(),
            line("peer_sim", "example"),
            line("sharp", "bin"),
            line("own_contender", "example"),
        ];
        let expected = [("own_contender", "/t/own_contender"), ("tiles", "/t/tiles")];
        let expected = expected.map(|(name, program)| (name.to_owned(), program.to_owned()));
        assert_eq!(parse(&messages.join("\n")), expected);
    }
}
