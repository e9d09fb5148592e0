//! Which crate may depend on which: the layers of `ARCHITECTURE.md` as a table.
//!
//! A new edge is a line here, and therefore reviewed.

use anyhow::Context;
use serde_json::Value;

use super::Problem;
use crate::process::cargo;

/// The crates of the workspace, bottom layer first, each with the ones it may use.
const EDGES: [(&str, &[&str]); 15] = [
    ("sharp-space", &[]),
    ("sharp-rl", &[]),
    ("xtask", &[]),
    ("sharp-sim", &["sharp-space"]),
    ("sharp-motion", &["sharp-space"]),
    ("sharp-maps", &["sharp-space"]),
    ("sharp-rbvd", &["sharp-space"]),
    ("sharp-regions", &["sharp-space", "sharp-motion"]),
    ("sharp-options", &["sharp-space", "sharp-rbvd"]),
    ("sharp-guide", &["sharp-space", "sharp-motion", "sharp-rbvd", "sharp-options"]),
    (
        "sharp-plan",
        &[
            "sharp-space",
            "sharp-sim",
            "sharp-motion",
            "sharp-rbvd",
            "sharp-options",
            "sharp-guide",
            "sharp-rl",
        ],
    ),
    // Pictures of plain data: no edge to the planner, so that whatever has points and poses can be drawn.
    ("sharp-draw", &["sharp-space"]),
    // Results and their report: the planner for its tallies, pictures for its figures.
    ("sharp-bench", &["sharp-plan", "sharp-draw"]),
    ("sharp-cli", EVERYTHING),
    ("sharp-tests", EVERYTHING),
];

const EVERYTHING: &[&str] = &[
    "sharp-space",
    "sharp-maps",
    "sharp-motion",
    "sharp-sim",
    "sharp-rl",
    "sharp-regions",
    "sharp-rbvd",
    "sharp-options",
    "sharp-guide",
    "sharp-plan",
    "sharp-draw",
    "sharp-bench",
];

/// Families of heavy packages, by the beginning of their names, and the crates that may name them.
const HEAVY: [(&str, &[&str]); 3] =
    [("burn", &["sharp-rl", "sharp-regions"]), ("rapier", &["sharp-sim"]), ("parry", &["sharp-sim"])];

/// Crates that promise to stay light, and everything from outside that they may use.
const LIGHT: [(&str, &[&str]); 2] = [
    ("sharp-space", &["nalgebra", "rand", "rand_chacha", "serde", "thiserror"]),
    ("xtask", &["anyhow", "serde_json"]),
];

/// A package of the workspace and what its manifest names.
#[derive(Debug)]
pub(super) struct Package {
    name: String,
    dependencies: Vec<Dependency>,
}

/// A line of a manifest.
#[derive(Debug)]
struct Dependency {
    name: String,
    is_dev: bool,
}

/// The packages of the workspace as cargo sees them.
///
/// # Errors
/// Returns an error if cargo cannot read the manifests.
pub(super) fn workspace() -> anyhow::Result<Vec<Package>> {
    let output = cargo(&["metadata", "--no-deps", "--format-version", "1"])
        .stderr(std::process::Stdio::inherit())
        .output()
        .context("cannot start cargo metadata")?;
    let metadata: Value = serde_json::from_slice(&output.stdout).context("cargo metadata is not readable")?;
    let packages = metadata["packages"].as_array().context("cargo metadata names no packages")?;
    Ok(packages.iter().map(package).collect())
}

fn package(value: &Value) -> Package {
    let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
    let dependencies = value["dependencies"].as_array().into_iter().flatten();
    Package {
        name: text(&value["name"]),
        dependencies: dependencies
            .map(|line| Dependency { name: text(&line["name"]), is_dev: line["kind"] == "dev" })
            .collect(),
    }
}

/// Checks the packages against the tables above.
pub(super) fn check(packages: &[Package]) -> Vec<Problem> {
    let is_ours = |name: &str| packages.iter().any(|package| package.name == name);
    let mut problems = Vec::new();
    for package in packages {
        let mut report = |message| problems.push(Problem::new(&manifest(&package.name), 1, message));
        let Some((_, edges)) = EDGES.iter().find(|(name, _)| *name == package.name) else {
            report(format!("{} has no layer, add it to xtask/src/tidy/layers.rs", package.name));
            continue;
        };
        for Dependency { name, is_dev } in &package.dependencies {
            let may_use = |allowed: &[&str]| allowed.contains(&name.as_str());
            if is_ours(name) && !may_use(edges) {
                report(format!("{} must not depend on {name}", package.name));
            }
            let families = HEAVY.iter().filter(|(family, _)| name.starts_with(family));
            for (family, owners) in families.filter(|(_, owners)| !owners.contains(&package.name.as_str())) {
                report(format!("{name}: only {} may name {family}", owners.join(" and ")));
            }
            let promise = LIGHT.iter().find(|(light, _)| *light == package.name && !is_dev && !is_ours(name));
            if promise.is_some_and(|(_, allowed)| !may_use(allowed)) {
                report(format!("{} stays light and must not use {name}", package.name));
            }
        }
    }
    problems
}

fn manifest(package: &str) -> String {
    match package {
        "xtask" => "xtask/Cargo.toml".into(),
        "sharp-tests" => "tests/Cargo.toml".into(),
        _ => format!("crates/{package}/Cargo.toml"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn problems(name: &str, dependencies: &[&str]) -> Vec<String> {
        let manifest = serde_json::json!({
            "name": name,
            "dependencies": dependencies.iter().map(|name| match name.strip_prefix("dev:") {
                Some(name) => serde_json::json!({"name": name, "kind": "dev"}),
                None => serde_json::json!({"name": name, "kind": null}),
            }).collect::<Vec<_>>(),
        });
        let others = EDGES.iter().filter(|(other, _)| *other != name);
        let mut packages: Vec<Package> =
            others.map(|(name, _)| Package { name: (*name).into(), dependencies: Vec::new() }).collect();
        packages.push(package(&manifest));
        check(&packages).into_iter().map(|problem| problem.message).collect()
    }

    #[test]
    fn edges_outside_the_table_are_refused() {
        assert!(problems("sharp-guide", &["sharp-options", "petgraph"]).is_empty(), "allowed");
        assert_eq!(problems("sharp-rbvd", &["sharp-sim"]), ["sharp-rbvd must not depend on sharp-sim"]);
        assert_eq!(problems("sharp-rl", &["dev:sharp-space"]), ["sharp-rl must not depend on sharp-space"]);
    }

    #[test]
    fn heavy_packages_stay_where_they_are() {
        assert!(problems("sharp-sim", &["rapier2d", "parry2d"]).is_empty(), "allowed");
        assert_eq!(
            problems("sharp-plan", &["burn-core"]),
            ["burn-core: only sharp-rl and sharp-regions may name burn"]
        );
        assert_eq!(problems("sharp-sim", &["burn"]), ["burn: only sharp-rl and sharp-regions may name burn"]);
    }

    #[test]
    fn light_crates_stay_light_but_their_tests_may_use_more() {
        assert_eq!(problems("sharp-space", &["image"]), ["sharp-space stays light and must not use image"]);
        assert!(problems("sharp-space", &["dev:expect-test", "rand"]).is_empty(), "tests");
    }

    #[test]
    fn unknown_crates_need_a_layer() {
        assert_eq!(
            problems("sharp-utils", &[]),
            ["sharp-utils has no layer, add it to xtask/src/tidy/layers.rs"]
        );
    }

    #[test]
    fn the_table_has_no_cycle() {
        for (i, (name, edges)) in EDGES.iter().enumerate() {
            for edge in *edges {
                let below = EDGES.iter().position(|(other, _)| other == edge);
                assert!(below.is_some_and(|below| below < i), "{name} uses {edge}, which is not below it");
            }
        }
    }
}
