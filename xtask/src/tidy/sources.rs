//! Rules for source files and manifests.

use super::Finding;
use crate::tree::Tree;

/// Words of unfinished work; cut in two so that this file passes its own check.
const UNFINISHED: [&str; 5] = [
    concat!("TO", "DO"),
    concat!("FIX", "ME"),
    concat!("db", "g!("),
    concat!("to", "do!("),
    concat!("unimplemen", "ted!("),
];

/// Calls that print; libraries leave that to the commands.
const PRINTING: [&str; 4] =
    [concat!("print", "ln!("), concat!("eprint", "ln!("), concat!("pri", "nt!("), concat!("epri", "nt!(")];

/// What opens connections: the project works without a network.
const CONNECTING: [&str; 1] = [concat!("std:", ":net")];

/// Workspaces of their own, whose manifests differ.
const STRANGERS: [&str; 2] = ["tests/downstream/", "tests/fuzz/"];

/// How a manifest begins its licence if it holds files of others besides ours.
const EXTENDED_LICENCE: &str = "\nlicense = \"(MIT OR Apache-2.0) AND ";

/// Checks every source file and manifest.
pub(super) fn check(tree: &Tree) -> Vec<Finding> {
    let mut problems = Vec::new();
    for (path, text) in tree.matching("", ".rs") {
        if !text.starts_with("//!") {
            problems.push(Finding::new(path, 1, "does not open with a module doc (//!)"));
        }
        if is_library(path) {
            problems.extend(find(path, library_code(text), &PRINTING, "library code must not print"));
        }
        if path.starts_with("crates/") {
            problems.extend(find(path, text, &CONNECTING, "nothing here uses a network"));
        }
    }
    for ending in [".rs", ".md", ".toml"] {
        for (path, text) in tree.matching("", ending) {
            problems.extend(find(path, text, &UNFINISHED, "unfinished work belongs in an issue"));
        }
    }
    let is_stranger = |path: &str| STRANGERS.iter().any(|folder| path.starts_with(folder));
    let manifests = tree.matching("", "/Cargo.toml").filter(|(path, _)| !is_stranger(path));
    for (path, text) in manifests {
        for line in ["[lints]\nworkspace = true", "license.workspace = true"] {
            // A crate with files of others in it adds their terms to ours.
            let is_extended = line.starts_with("license") && text.contains(EXTENDED_LICENCE);
            if !text.contains(line) && !is_extended {
                let message = format!("must say {:?}", line.replace('\n', " "));
                problems.push(Finding::new(path, 1, message));
            }
        }
    }
    if let Some(text) = tree.files.get("Cargo.toml").filter(|text| !text.contains("unsafe_code = \"forbid\""))
    {
        let line = text.lines().count();
        problems.push(Finding::new("Cargo.toml", line, "must forbid unsafe code in every package"));
    }
    problems
}

fn is_library(path: &str) -> bool {
    let is_test = path.ends_with("/tests.rs") || path.contains("/tests/");
    path.starts_with("crates/")
        && path.contains("/src/")
        && !path.starts_with("crates/sharp-cli/")
        && !is_test
}

/// The part above the unit tests.
fn library_code(text: &str) -> &str {
    text.split_once("#[cfg(test)]").map_or(text, |(code, _)| code)
}

/// A problem for each line of `text` that holds one of `words` as a word of its own; comments that
/// begin with `//!` or `///` show examples and may print.
fn find(path: &str, text: &str, words: &[&str], reason: &str) -> Vec<Finding> {
    let mut problems = Vec::new();
    for (i, line) in text.lines().enumerate() {
        let is_doc = line.trim_start().starts_with("//!") || line.trim_start().starts_with("///");
        for word in words.iter().filter(|word| !(is_doc && word.ends_with('('))) {
            if holds_word(line, word) {
                let message = format!("{}: {reason}", word.trim_end_matches('('));
                problems.push(Finding::new(path, i + 1, message));
            }
        }
    }
    problems
}

fn holds_word(line: &str, word: &str) -> bool {
    let is_part = |c: Option<char>| c.is_some_and(|c| c.is_alphanumeric() || c == '_');
    line.match_indices(word).any(|(at, _)| {
        let after = line[at + word.len()..].chars().next();
        !is_part(line[..at].chars().next_back()) && (word.ends_with('(') || !is_part(after))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn problems(path: &str, text: &str) -> Vec<String> {
        check(&Tree::of(&[(path, text)])).iter().map(ToString::to_string).collect()
    }

    #[test]
    fn files_open_with_a_doc() {
        assert_eq!(
            problems("crates/a/src/lib.rs", "use std;"),
            ["crates/a/src/lib.rs:1: does not open with a module doc (//!)"]
        );
        assert!(problems("crates/a/src/lib.rs", "//! A.\n").is_empty(), "it does");
    }

    #[test]
    fn unfinished_work_is_named_with_its_line() {
        let text = ["//! A.", concat!("// TO", "DO: more"), "// METHODO", concat!("let x = db", "g!(1);")];
        assert_eq!(
            problems("xtask/src/a.rs", &text.join("\n")),
            [
                concat!("xtask/src/a.rs:2: TO", "DO: unfinished work belongs in an issue"),
                concat!("xtask/src/a.rs:4: db", "g!: unfinished work belongs in an issue"),
            ]
        );
    }

    #[test]
    fn libraries_print_in_examples_and_tests_only() {
        let print = concat!("print", "ln!(\"x\");");
        let fine = format!("//! {print}\n/// {print}\n#[cfg(test)]\nmod tests {{ {print} }}");
        assert!(problems("crates/sharp-sim/src/lib.rs", &fine).is_empty(), "doc and tests");
        let broken = format!("//! A.\nfn f() {{ {print} }}");
        assert_eq!(problems("crates/sharp-sim/src/lib.rs", &broken).len(), 1, "code");
        assert!(problems("crates/sharp-cli/src/main.rs", &broken).is_empty(), "the command may print");
    }

    #[test]
    fn manifests_share_lints_and_licence() {
        let fine = "license.workspace = true\n[lints]\nworkspace = true\n";
        assert!(problems("crates/a/Cargo.toml", fine).is_empty(), "both there");
        let extended = "\nlicense = \"(MIT OR Apache-2.0) AND OFL-1.1\"\n[lints]\nworkspace = true\n";
        assert!(problems("crates/a/Cargo.toml", extended).is_empty(), "with the terms of a font");
        assert_eq!(problems("crates/a/Cargo.toml", "").len(), 2, "both missing");
        assert!(
            problems("Cargo.toml", "unsafe_code = \"forbid\"").is_empty(),
            "the workspace's own manifest"
        );
        assert_eq!(problems("Cargo.toml", "").len(), 1, "it forbids unsafe code");
    }
}
