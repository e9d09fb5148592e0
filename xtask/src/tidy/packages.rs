//! Every library can be published: its manifest is complete, and what it embeds lies inside it.

use serde_json::Value;

use super::Finding;
use crate::tree::Tree;

/// What crates.io allows.
const KEYWORDS_MAX: usize = 5;
/// What embeds a file at compile time.
const EMBEDDING: [&str; 2] = ["include_str!(", "include_bytes!("];

/// Checks the packages of cargo's `metadata` that are libraries, and what the crates of `tree` embed.
pub(super) fn check(metadata: &Value, tree: &Tree) -> Vec<Finding> {
    let packages = metadata["packages"].as_array().into_iter().flatten();
    let mut problems: Vec<Finding> = packages
        .filter(|package| is_library(package))
        .flat_map(|package| check_manifest(package, tree))
        .collect();
    for (path, text) in tree.matching("crates/", ".rs") {
        problems.extend(check_embedded(path, text));
    }
    problems
}

fn is_library(package: &Value) -> bool {
    let targets = package["targets"].as_array().into_iter().flatten();
    targets.flat_map(|target| target["kind"].as_array().into_iter().flatten()).any(|kind| kind == "lib")
}

fn check_manifest(package: &Value, tree: &Tree) -> Vec<Finding> {
    let name = package["name"].as_str().unwrap_or_default();
    let folder = format!("crates/{name}/");
    let mut problems = Vec::new();
    let mut report =
        |message: String| problems.push(Finding::new(&format!("{folder}Cargo.toml"), 1, message));
    for field in ["description", "license"] {
        if package[field].as_str().is_none_or(str::is_empty) {
            report(format!("has no {field}"));
        }
    }
    for (field, max) in [("keywords", KEYWORDS_MAX), ("categories", KEYWORDS_MAX)] {
        let count = package[field].as_array().map_or(0, Vec::len);
        if count == 0 || count > max {
            report(format!("has {count} {field}, expected 1 to {max}"));
        }
    }
    let readme = package["readme"].as_str().unwrap_or("README.md");
    if package["readme"].is_null() || !tree.files.contains_key(&format!("{folder}{readme}")) {
        report(format!("has no {readme}"));
    }
    for line in package["dependencies"].as_array().into_iter().flatten() {
        if !line["path"].is_null() && line["req"] == "*" && line["kind"] != "dev" {
            report(format!("names {} by its path without a version", line["name"]));
        }
    }
    problems
}

/// A finding for each file that the source at `path` embeds from outside its crate.
fn check_embedded(path: &str, text: &str) -> Vec<Finding> {
    // Parts of the path below the crate's folder: src, and what lies below it.
    let depth = path.split('/').count().saturating_sub(3);
    let mut problems = Vec::new();
    for (i, line) in text.lines().enumerate() {
        for call in EMBEDDING.iter().flat_map(|word| line.split(word).skip(1)) {
            let file = call.split('"').nth(1).unwrap_or_default();
            if file.matches("../").count() > depth || call.contains("CARGO_MANIFEST_DIR") {
                let message = format!("embeds {file}, which a package of the crate would lack");
                problems.push(Finding::new(path, i + 1, message));
            }
        }
    }
    problems
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn whole() -> Value {
        json!({
            "name": "sharp-a", "description": "A.", "license": "MIT", "readme": "README.md",
            "keywords": ["robotics"], "categories": ["algorithms"], "targets": [{"kind": ["lib"]}],
            "dependencies": [{"name": "sharp-b", "path": "/b", "req": "^0.1.0", "kind": null}],
        })
    }

    fn problems(package: Value) -> Vec<String> {
        let tree = Tree::of(&[("crates/sharp-a/README.md", "")]);
        check(&json!({"packages": [package]}), &tree).into_iter().map(|problem| problem.message).collect()
    }

    #[test]
    fn a_whole_manifest_passes_and_commands_are_not_asked() {
        assert!(problems(whole()).is_empty());
        assert!(problems(json!({"name": "sharp-cli", "targets": [{"kind": ["bin"]}]})).is_empty());
    }

    #[test]
    fn what_a_manifest_lacks_is_named() {
        let mut package = whole();
        package["description"] = Value::Null;
        package["keywords"] = json!([]);
        package["readme"] = json!("OTHER.md");
        package["dependencies"][0]["req"] = json!("*");
        assert_eq!(
            problems(package),
            [
                "has no description",
                "has 0 keywords, expected 1 to 5",
                "has no OTHER.md",
                "names \"sharp-b\" by its path without a version",
            ]
        );
    }

    #[test]
    fn embedded_files_lie_in_the_crate() {
        let embed = |path: &str| format!("const A: &str = include_str!(\"{path}\");");
        for (source, path, inside) in [
            ("crates/a/src/lib.rs", "../assets/b.ron", true),
            ("crates/a/src/lib.rs", "../../assets/b.ron", false),
            ("crates/a/src/c/lib.rs", "../../assets/b.ron", true),
            ("crates/a/src/c/lib.rs", "../../../b.ron", false),
        ] {
            assert_eq!(check_embedded(source, &embed(path)).is_empty(), inside, "{source} embeds {path}");
        }
    }
}
