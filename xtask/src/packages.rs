//! Packing every library as for crates.io, without sending it anywhere.
//!
//! The workspace says `publish = false`, and cargo packs no crate that depends on another such one. So a copy of
//! the sources is packed that lacks that line.

use std::fs;
use std::path::Path;

use anyhow::Context;

use crate::process::{cargo, exit_code};
use crate::tree::{self, FOREIGN};

/// Packages that nobody would publish.
const UNPACKED: [&str; 4] = ["sharp-cli", "sharp-py", "sharp-tests", "xtask"];

/// Packs the libraries of a copy below `target/package`; returns cargo's exit code.
///
/// # Errors
/// Returns an error if the sources cannot be copied or cargo cannot be started.
pub(crate) fn run() -> anyhow::Result<u8> {
    let (root, copy) = (tree::root(), tree::root().join("target/package/sources"));
    if copy.exists() {
        fs::remove_dir_all(&copy).with_context(|| format!("cannot remove {}", copy.display()))?;
    }
    for folder in ["crates", "tests", "xtask"] {
        copy_folder(&root.join(folder), &copy.join(folder))?;
    }
    copy_file(&root.join("Cargo.lock"), &copy.join("Cargo.lock"))?;
    let manifest = fs::read_to_string(root.join("Cargo.toml")).context("cannot read Cargo.toml")?;
    fs::write(copy.join("Cargo.toml"), publishable(&manifest)).context("cannot write Cargo.toml")?;

    let mut command = cargo(&["package", "--quiet", "--workspace", "--no-verify", "--allow-dirty"]);
    for package in UNPACKED {
        command.args(["--exclude", package]);
    }
    exit_code(command.arg("--target-dir").arg(root.join("target/package")).current_dir(&copy))
}

/// `manifest` without the line that keeps its packages from being published.
fn publishable(manifest: &str) -> String {
    manifest.replace("\npublish = false\n", "\npublish = true\n")
}

fn copy_folder(from: &Path, to: &Path) -> anyhow::Result<()> {
    fs::create_dir_all(to).with_context(|| format!("cannot make {}", to.display()))?;
    let entries = fs::read_dir(from).with_context(|| format!("cannot list {}", from.display()))?;
    for entry in entries {
        let entry = entry.with_context(|| format!("cannot list {}", from.display()))?;
        let (source, name) = (entry.path(), entry.file_name());
        let is_foreign = FOREIGN.iter().any(|foreign| *name == **foreign);
        if source.is_file() {
            copy_file(&source, &to.join(&name))?;
        } else if source.is_dir() && !is_foreign {
            copy_folder(&source, &to.join(&name))?;
        }
    }
    Ok(())
}

fn copy_file(from: &Path, to: &Path) -> anyhow::Result<()> {
    fs::copy(from, to).with_context(|| format!("cannot copy {}", from.display()))?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_the_line_about_publishing_changes() {
        let manifest = "[workspace.package]\npublish = false\ndescription = \"publish = false\"\n";
        let expected = "[workspace.package]\npublish = true\ndescription = \"publish = false\"\n";
        assert_eq!(publishable(manifest), expected);
    }
}
