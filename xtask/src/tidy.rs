//! `cargo xtask tidy`: house rules that neither the compiler nor clippy checks.

mod assets;
mod code;
mod docs;
mod glossary;
mod layers;
mod licences;
mod methods;
mod names;
mod one_loop;
mod packages;
mod seams;
mod sources;

use std::fmt;
use std::process::Stdio;

use anyhow::Context;
use serde_json::Value;

use crate::process::cargo;
use crate::tree::Tree;

/// A broken rule and where.
#[derive(Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Finding {
    file: String,
    line: usize,
    message: String,
}

impl Finding {
    /// A problem in line `line` (from 1) of `file`.
    fn new(file: &str, line: usize, message: impl Into<String>) -> Self {
        Self { file: file.to_owned(), line, message: message.into() }
    }
}

impl fmt::Display for Finding {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}:{}: {}", self.file, self.line, self.message)
    }
}

/// Checks every rule and prints what is broken; returns 1 if anything is.
///
/// # Errors
/// Returns an error if the repository or its metadata cannot be read.
pub(crate) fn run() -> anyhow::Result<u8> {
    let tree = Tree::load()?;
    let mut problems = Vec::new();
    let metadata = metadata()?;
    problems.extend(layers::check(&layers::packages(&metadata)));
    problems.extend(packages::check(&metadata, &tree));
    problems.extend(licences::check(&licences::dependencies()?));
    problems.extend(sources::check(&tree));
    problems.extend(docs::check(&tree));
    problems.extend(assets::check(&tree));
    problems.extend(glossary::check(&tree));
    problems.extend(one_loop::check(&tree));
    problems.extend(methods::check(&tree));
    problems.extend(names::check(&tree));
    problems.extend(seams::check(&tree));
    problems.sort();
    for problem in &problems {
        println!("{problem}");
    }
    println!("tidy: {} files, {} problems", tree.files.len(), problems.len());
    Ok(u8::from(!problems.is_empty()))
}

/// The packages of the workspace as cargo sees them.
fn metadata() -> anyhow::Result<Value> {
    let output = cargo(&["metadata", "--no-deps", "--format-version", "1"])
        .stderr(Stdio::inherit())
        .output()
        .context("cannot start cargo metadata")?;
    serde_json::from_slice(&output.stdout).context("cargo metadata is not readable")
}

/// The text between backticks in `line`, in order.
fn quoted(line: &str) -> impl Iterator<Item = &str> {
    line.split('`').skip(1).step_by(2)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quotes_are_what_stands_between_backticks() {
        assert_eq!(quoted("a `b` c `d e`.").collect::<Vec<_>>(), ["b", "d e"]);
        assert_eq!(quoted("none").count(), 0);
    }
}
