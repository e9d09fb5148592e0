//! The projects in `tests/downstream`: single crates used as a stranger would.

use std::path::PathBuf;
use std::process::{Command, Stdio};

use anyhow::{Context, ensure};

use crate::process::{cargo, exit_code};
use crate::tree;

/// Heavy packages, by the beginning of their names, that a project must not get.
const ABSENT: [(&str, &[&str]); 3] =
    [("geojson", &["burn", "rapier", "parry"]), ("own_environment", &["burn"]), ("own_planner", &["burn"])];

/// The workspace of the projects.
pub(crate) fn folder() -> PathBuf {
    tree::root().join("tests/downstream")
}

/// Builds the projects, runs them, and checks what they depend on.
///
/// # Errors
/// Returns an error if cargo or a project cannot be started.
pub(crate) fn run() -> anyhow::Result<u8> {
    let folder = folder();
    // The main workspace's folder: what has the same features there is not compiled again.
    let target = tree::root().join("target");
    let mut build = cargo(&["build", "--release", "--locked"]);
    let code = exit_code(build.current_dir(&folder).env("CARGO_TARGET_DIR", &target))?;
    if code != 0 {
        return Ok(code);
    }
    for (project, absent) in ABSENT {
        let args = ["tree", "--package", project, "--edges", "normal", "--prefix", "none", "--locked"];
        let output = cargo(&args).current_dir(&folder).output().context("cannot start cargo tree")?;
        let found = heavy(&String::from_utf8_lossy(&output.stdout), absent);
        ensure!(found.is_none(), "{project} must not depend on {}", found.unwrap_or_default());

        let mut command = Command::new(target.join("release").join(project));
        if project == "geojson" {
            command.arg("a").stdout(Stdio::null());
        }
        let code = exit_code(command.current_dir(&folder))?;
        eprintln!("project {project}: {}", if code == 0 { "passed" } else { "FAILED" });
        if code != 0 {
            return Ok(code);
        }
    }
    Ok(0)
}

/// The first package of `tree` whose name begins with one of `absent`.
fn heavy(tree: &str, absent: &[&str]) -> Option<String> {
    let is_absent = |line: &&str| absent.iter().any(|prefix| line.starts_with(prefix));
    tree.lines().find(is_absent).map(ToOwned::to_owned)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heavy_packages_are_found_by_the_beginning_of_their_names() {
        let tree = "geojson v0.0.0\nsharp-maps v0.1.0\nburn-core v0.22.1 (*)\n";
        assert_eq!(heavy(tree, &["rapier", "burn"]).as_deref(), Some("burn-core v0.22.1 (*)"));
        assert_eq!(heavy(tree, &["rapier"]), None);
    }
}
