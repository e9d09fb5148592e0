//! The licences of all dependencies, packages that must not come back, and packages in several versions.

use std::collections::{BTreeMap, BTreeSet};
use std::process::Stdio;

use anyhow::{Context, ensure};

use super::Finding;
use crate::process::cargo;

/// Licences whose terms a binary of this project can meet; `deny.toml` holds the same list.
const ALLOWED: [&str; 13] = [
    "0BSD",
    "Apache-2.0",
    "Apache-2.0 WITH LLVM-exception",
    "BSD-2-Clause",
    "BSD-3-Clause",
    "BSL-1.0",
    "CC0-1.0",
    "ISC",
    "MIT",
    // Fonts only: they may be embedded in a program, and stay under it themselves.
    "OFL-1.1",
    "Unicode-3.0",
    "Unlicense",
    "Zlib",
];

/// Packages kept out, each with the reason.
const BANNED: [(&str, &str); 7] = [
    ("bincode", "is unmaintained (RUSTSEC-2025-0141)"),
    ("serde_yaml", "is deprecated, serde-saphyr reads YAML here"),
    ("fs2", "is abandoned, std locks files"),
    ("curl", "opens connections, nothing here does"),
    ("hyper", "opens connections, nothing here does"),
    ("reqwest", "opens connections, nothing here does"),
    ("ureq", "opens connections, nothing here does"),
];

/// Packages whose licence is not on the list but whose terms are met.
const EXCEPTIONS: [(&str, &str); 1] = [
    // burn prints with it; a copyleft of single files, and they are used unchanged.
    ("colored", "MPL-2.0"),
];

/// Packages that a build contains in several versions, because those who need them do not agree: the most there may be.
const REPEATED: [(&str, usize); 6] = [
    // burn's macros.
    ("darling", 2),
    ("darling_core", 2),
    ("darling_macro", 2),
    ("foldhash", 2),
    ("hashbrown", 3),
    // PNG writers of resvg and image.
    ("miniz_oxide", 2),
];

/// Compiles macros only, and changes its version more often than its users do.
const REPEATED_MACROS: &str = "syn";

/// A package that a build for this machine contains.
#[derive(Debug, PartialEq)]
pub(super) struct LicensedPackage {
    name: String,
    version: String,
    licence: String,
}

/// The packages that a build for this machine contains.
///
/// # Errors
/// Returns an error if cargo cannot resolve the dependencies.
pub(super) fn dependencies() -> anyhow::Result<Vec<LicensedPackage>> {
    // Not `cargo metadata`: its graph holds packages of features that nobody asked for.
    let args = ["tree", "--workspace", "--edges", "normal,build", "--prefix", "none", "--format", "{p}\t{l}"];
    let output = cargo(&args).stderr(Stdio::inherit()).output().context("cannot start cargo tree")?;
    ensure!(output.status.success(), "cargo tree cannot resolve the dependencies");
    Ok(parse(&String::from_utf8_lossy(&output.stdout)))
}

/// Reads lines such as `name v1.2.3 (proc-macro)`, tab, licence; repeated packages end in `(*)`.
fn parse(tree: &str) -> Vec<LicensedPackage> {
    let lines: BTreeSet<&str> = tree.lines().map(|line| line.trim_end_matches(" (*)")).collect();
    let packages = lines.iter().filter_map(|line| {
        let (package, licence) = line.split_once('\t')?;
        let mut words = package.split(' ').map(str::to_owned);
        Some(LicensedPackage { name: words.next()?, version: words.next()?, licence: licence.to_owned() })
    });
    packages.collect()
}

/// Checks every package against the lists above.
pub(super) fn check(dependencies: &[LicensedPackage]) -> Vec<Finding> {
    let mut problems = Vec::new();
    for LicensedPackage { name, licence, .. } in dependencies {
        let is_exception = EXCEPTIONS.contains(&(name.as_str(), licence.as_str()));
        if !is_exception && !Expression(licence).is_allowed() {
            let message = format!("package {name} has the licence {licence:?}, which is not on the list");
            problems.push(Finding::new("Cargo.lock", 1, message));
        }
        if let Some((_, reason)) = BANNED.iter().find(|(banned, _)| banned == name) {
            problems.push(Finding::new("Cargo.lock", 1, format!("package {name} {reason}")));
        }
    }
    problems.extend(repeated(dependencies));
    problems
}

/// A problem for each package in more versions than are known and explained above.
fn repeated(dependencies: &[LicensedPackage]) -> Vec<Finding> {
    let mut versions: BTreeMap<&str, BTreeSet<&str>> = BTreeMap::new();
    for LicensedPackage { name, version, .. } in dependencies {
        versions.entry(name).or_default().insert(version);
    }
    let most = |name: &str| REPEATED.iter().find(|(known, _)| *known == name).map_or(1, |(_, most)| *most);
    let repeated = versions
        .into_iter()
        .filter(|(name, versions)| *name != REPEATED_MACROS && versions.len() > most(name))
        .map(|(name, versions)| {
            let versions = versions.into_iter().collect::<Vec<_>>().join(", ");
            Finding::new("Cargo.lock", 1, format!("package {name} is built in versions {versions}"))
        });
    repeated.collect()
}

/// An SPDX expression such as `(MIT OR Apache-2.0) AND Unicode-3.0`; old manifests write `MIT/Apache-2.0`.
struct Expression<'a>(&'a str);

impl Expression<'_> {
    /// Returns true if some choice of alternatives leaves only allowed licences.
    fn is_allowed(&self) -> bool {
        let spaced = self.0.replace('/', " OR ").replace('(', " ( ").replace(')', " ) ");
        let mut words = spaced.split_whitespace().peekable();
        let is_allowed = alternatives(&mut words);
        is_allowed && words.next().is_none()
    }
}

type Words<'a> = std::iter::Peekable<std::str::SplitWhitespace<'a>>;

fn alternatives(words: &mut Words<'_>) -> bool {
    let mut is_allowed = requirements(words);
    while words.next_if_eq(&"OR").is_some() {
        // Both sides are read, whatever the first one says.
        is_allowed |= requirements(words);
    }
    is_allowed
}

fn requirements(words: &mut Words<'_>) -> bool {
    let mut is_allowed = licence(words);
    while words.next_if_eq(&"AND").is_some() {
        is_allowed &= licence(words);
    }
    is_allowed
}

fn licence(words: &mut Words<'_>) -> bool {
    if words.next_if_eq(&"(").is_some() {
        let is_allowed = alternatives(words);
        return words.next_if_eq(&")").is_some() && is_allowed;
    }
    let Some(name) = words.next() else { return false };
    if words.next_if_eq(&"WITH").is_some() {
        let exception = words.next().unwrap_or_default();
        return ALLOWED.contains(&format!("{name} WITH {exception}").as_str());
    }
    ALLOWED.contains(&name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn one_allowed_choice_is_enough() {
        for (expression, expected) in [
            ("MIT", true),
            ("MIT/Apache-2.0", true),
            ("GPL-3.0 OR MIT", true),
            ("(MIT OR Apache-2.0) AND Unicode-3.0", true),
            ("Apache-2.0 WITH LLVM-exception OR GPL-2.0", true),
            ("MIT AND GPL-3.0", false),
            ("(MIT OR Apache-2.0) AND GPL-3.0", false),
            ("GPL-3.0", false),
            ("", false),
            ("(MIT", false),
        ] {
            assert_eq!(Expression(expression).is_allowed(), expected, "{expression}");
        }
    }

    #[test]
    fn packages_are_read_from_the_tree() {
        let tree = "sharp-sim v0.1.0 (/here)\tMIT\nserde v1.0.0\tMIT OR Apache-2.0\nserde v1.0.0\tMIT OR Apache-2.0 (*)\n\n";
        let names: Vec<(String, String)> = parse(tree).into_iter().map(|p| (p.name, p.licence)).collect();
        let expected = [("serde", "MIT OR Apache-2.0"), ("sharp-sim", "MIT")];
        assert_eq!(names, expected.map(|(name, licence)| (name.to_owned(), licence.to_owned())));
    }

    fn package(name: &str, version: &str) -> LicensedPackage {
        LicensedPackage { name: name.into(), version: version.into(), licence: "MIT".into() }
    }

    #[test]
    fn packages_in_more_versions_than_are_explained_are_named() {
        let twice = |name| [package(name, "v1.0.0"), package(name, "v2.0.0"), package(name, "v2.0.0")];
        assert!(check(&twice("darling")).is_empty() && check(&twice("syn")).is_empty(), "these are known");
        let problems = check(&twice("serde"));
        assert_eq!(problems.len(), 1, "{problems:?}");
        assert_eq!(problems[0].message, "package serde is built in versions v1.0.0, v2.0.0");
        assert!(check(&[package("serde", "v1.0.0")]).is_empty(), "one version");
    }

    #[test]
    fn banned_packages_are_named_with_the_reason() {
        let dependencies = [package("bincode", "v1.3.3")];
        let problems = check(&dependencies);
        assert_eq!(problems[0].message, "package bincode is unmaintained (RUSTSEC-2025-0141)");
    }
}
