//! Which crate may depend on which: the layers of `ARCHITECTURE.md` as a table.
//!
//! A new edge is a line here, and therefore reviewed. An edge that no manifest has any more must go.

use serde_json::Value;

use super::Finding;

/// A crate, its layer, and the crates of the workspace that its manifest names.
#[derive(Clone, Copy, Debug)]
struct Room {
    /// Its layer, 0 at the bottom: no edge leads upward.
    layer: u8,
    name: &'static str,
    /// What it uses.
    uses: &'static [&'static str],
    /// What only its tests, benches and examples use besides.
    tests_use: &'static [&'static str],
}

const fn room(
    layer: u8,
    name: &'static str,
    uses: &'static [&'static str],
    tests_use: &'static [&'static str],
) -> Room {
    Room { layer, name, uses, tests_use }
}

/// All crates, each after those that it uses.
const ROOMS: [Room; 18] = [
    room(0, "sharp-space", &[], &[]),
    room(0, "sharp-rl", &[], &[]),
    // Tests drive through generated floor plans.
    room(1, "sharp-maps", &["sharp-space"], &[]),
    room(1, "sharp-sim", &["sharp-space"], &["sharp-maps"]),
    room(1, "sharp-motion", &["sharp-space"], &[]),
    room(1, "sharp-rbvd", &["sharp-space"], &[]),
    // The network learns from paths that a motion planner drives through generated floor plans.
    room(2, "sharp-regions", &["sharp-space", "sharp-maps", "sharp-motion"], &[]),
    room(2, "sharp-options", &["sharp-space", "sharp-rbvd"], &[]),
    room(2, "sharp-guide", &["sharp-space", "sharp-motion", "sharp-rbvd", "sharp-options"], &["sharp-maps"]),
    room(
        3,
        "sharp-drive",
        &["sharp-space", "sharp-sim", "sharp-guide", "sharp-rl"],
        &["sharp-rbvd", "sharp-options"],
    ),
    // The detector of regions comes in through its trait: no edge to sharp-regions.
    room(
        4,
        "sharp-plan",
        &[
            "sharp-space",
            "sharp-sim",
            "sharp-rbvd",
            "sharp-options",
            "sharp-guide",
            "sharp-rl",
            "sharp-drive",
        ],
        &["sharp-regions"],
    ),
    // Pictures of plain data: no edge to the planner, so that whatever has points and poses can be drawn.
    room(5, "sharp-draw", &["sharp-space"], &[]),
    // Plans and drives in the formats of others.
    room(
        5,
        "sharp-export",
        &[
            "sharp-space",
            "sharp-rbvd",
            "sharp-sim",
            "sharp-options",
            "sharp-guide",
            "sharp-rl",
            "sharp-drive",
            "sharp-plan",
        ],
        &[],
    ),
    // From the names of map, robot, detector and system to a report with figures.
    room(
        5,
        "sharp-bench",
        &[
            "sharp-space",
            "sharp-maps",
            "sharp-sim",
            "sharp-motion",
            "sharp-rbvd",
            "sharp-regions",
            "sharp-options",
            "sharp-guide",
            "sharp-rl",
            "sharp-drive",
            "sharp-plan",
            "sharp-draw",
        ],
        &[],
    ),
    room(6, "sharp-cli", LIBRARIES, LIBRARIES),
    room(6, "sharp-py", LIBRARIES, LIBRARIES),
    room(6, "sharp-tests", LIBRARIES, LIBRARIES),
    room(6, "xtask", &[], &[]),
];

/// The layer of commands and tests.
const TOP: u8 = 6;

/// What the top layer may use; whether it does is its own business.
const LIBRARIES: &[&str] = &[
    "sharp-space",
    "sharp-rl",
    "sharp-maps",
    "sharp-sim",
    "sharp-motion",
    "sharp-rbvd",
    "sharp-regions",
    "sharp-options",
    "sharp-guide",
    "sharp-drive",
    "sharp-plan",
    "sharp-bench",
    "sharp-export",
    "sharp-draw",
];

/// Families of heavy packages, by the beginning of their names, and the crates that may name them.
const HEAVY: [(&str, &[&str]); 3] =
    [("burn", &["sharp-rl", "sharp-regions"]), ("rapier", &["sharp-sim"]), ("parry", &["sharp-sim"])];

/// Crates that promise to stay light, and everything from outside that they may use.
const LIGHT: [(&str, &[&str]); 2] = [
    ("sharp-space", &["libm", "nalgebra", "rand", "rand_chacha", "serde", "thiserror"]),
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

/// The packages of cargo's `metadata`.
pub(super) fn packages(metadata: &Value) -> Vec<Package> {
    metadata["packages"].as_array().into_iter().flatten().map(package).collect()
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
pub(super) fn check(packages: &[Package]) -> Vec<Finding> {
    let is_ours = |name: &str| packages.iter().any(|package| package.name == name);
    let mut problems = Vec::new();
    for package in packages {
        let mut report = |message| problems.push(Finding::new(&manifest(&package.name), 1, message));
        let Some(room) = ROOMS.iter().find(|room| room.name == package.name) else {
            report(format!("{} has no layer, add it to xtask/src/tidy/layers.rs", package.name));
            continue;
        };
        for edge in unused(room, package) {
            report(format!("{} does not use {edge}, take it out of xtask/src/tidy/layers.rs", room.name));
        }
        for Dependency { name, is_dev } in &package.dependencies {
            let may_use = |allowed: &[&str]| allowed.contains(&name.as_str());
            if is_ours(name) && !may_use(room.uses) && !(*is_dev && may_use(room.tests_use)) {
                let whose = if *is_dev { "tests of " } else { "" };
                report(format!("{whose}{} must not depend on {name}", package.name));
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

/// Edges of the table that the manifest lacks; the top layer may lack what it likes.
fn unused<'a>(room: &'a Room, package: &'a Package) -> impl Iterator<Item = &'static str> + 'a {
    let lacks = |edge: &&&str, dev: bool| {
        !package.dependencies.iter().any(|line| line.name == **edge && line.is_dev == dev)
    };
    let uses = room.uses.iter().filter(move |edge| lacks(edge, false));
    let tests = room.tests_use.iter().filter(move |edge| lacks(edge, true));
    uses.chain(tests).filter(|_| room.layer < TOP).copied()
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

    /// What is found where the package `name` names the `dependencies` and all others what the table says.
    fn problems(name: &str, dependencies: &[&str]) -> Vec<String> {
        let manifest = serde_json::json!({
            "name": name,
            "dependencies": dependencies.iter().map(|name| match name.strip_prefix("dev:") {
                Some(name) => serde_json::json!({"name": name, "kind": "dev"}),
                None => serde_json::json!({"name": name, "kind": null}),
            }).collect::<Vec<_>>(),
        });
        let line = |is_dev| move |name: &&str| Dependency { name: (*name).into(), is_dev };
        let listed = |room: &Room| Package {
            name: room.name.into(),
            dependencies: room
                .uses
                .iter()
                .map(line(false))
                .chain(room.tests_use.iter().map(line(true)))
                .collect(),
        };
        let mut packages: Vec<Package> = ROOMS.iter().filter(|room| room.name != name).map(listed).collect();
        packages.push(package(&manifest));
        check(&packages).into_iter().map(|problem| problem.message).collect()
    }

    #[test]
    fn edges_outside_the_table_are_refused() {
        assert!(problems("sharp-rbvd", &["sharp-space", "petgraph"]).is_empty(), "allowed");
        assert_eq!(
            problems("sharp-rbvd", &["sharp-space", "sharp-sim"]),
            ["sharp-rbvd must not depend on sharp-sim"]
        );
        assert_eq!(
            problems("sharp-rl", &["dev:sharp-space"]),
            ["tests of sharp-rl must not depend on sharp-space"]
        );
    }

    #[test]
    fn edges_of_tests_hold_for_tests_only() {
        assert!(problems("sharp-sim", &["sharp-space", "dev:sharp-maps"]).is_empty(), "a bench draws maps");
        assert_eq!(
            problems("sharp-sim", &["sharp-space", "sharp-maps", "dev:sharp-maps"]),
            ["sharp-sim must not depend on sharp-maps"]
        );
    }

    #[test]
    fn edges_that_nobody_uses_leave_the_table() {
        let message = "sharp-rbvd does not use sharp-space, take it out of xtask/src/tidy/layers.rs";
        assert_eq!(problems("sharp-rbvd", &[]), [message]);
        assert!(problems("sharp-cli", &["sharp-plan"]).is_empty(), "the top layer takes what it needs");
    }

    #[test]
    fn heavy_packages_stay_where_they_are() {
        let edges = ["sharp-space", "dev:sharp-maps"];
        assert!(
            problems("sharp-sim", &[&edges[..], &["rapier2d", "parry2d"]].concat()).is_empty(),
            "allowed"
        );
        let expected = ["burn: only sharp-rl and sharp-regions may name burn"];
        assert_eq!(problems("sharp-sim", &[&edges[..], &["burn"]].concat()), expected);
        let expected = ["burn-core: only sharp-rl and sharp-regions may name burn"];
        assert_eq!(problems("sharp-cli", &["burn-core"]), expected);
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
    fn no_edge_leads_upward_and_none_in_a_circle() {
        for (i, room) in ROOMS.iter().enumerate() {
            for edge in room.uses {
                let below = ROOMS[..i].iter().find(|other| other.name == *edge);
                let layer = below.map(|other| other.layer);
                assert!(layer.is_some_and(|layer| layer <= room.layer), "{} uses {edge}", room.name);
            }
        }
    }
}
