//! Documents name and link only files and tests that exist.

use super::{Finding, quoted};
use crate::tree::Tree;

/// Documents that must exist.
const REQUIRED: [&str; 3] = ["ARCHITECTURE.md", "README.md", PAPER_MAP];
const PAPER_MAP: &str = "docs/paper-map.md";

/// Endings by which a name is taken for a file even outside a known folder.
const ENDINGS: [&str; 5] = [".md", ".rs", ".toml", ".ron", ".sh"];
/// Folders at the root whose names make a path.
const FOLDERS: [&str; 6] = ["crates/", "docs/", "xtask/", "tests/", "assets/", ".ci/"];

/// Checks the paths that all documents name and the tests that the map of the paper names.
pub(super) fn check(tree: &Tree) -> Vec<Finding> {
    let mut problems = Vec::new();
    for path in REQUIRED.into_iter().filter(|path| !tree.files.contains_key(*path)) {
        problems.push(Finding::new(path, 1, "is missing"));
    }
    for (path, text) in tree.matching("", ".md") {
        for (i, line) in text.lines().enumerate() {
            for name in quoted(line).filter(|name| is_path(name) && !tree.has(name)) {
                problems.push(Finding::new(path, i + 1, format!("names {name}, which does not exist")));
            }
            for link in links(line).filter(|link| !is_alive(tree, path, link)) {
                problems.push(Finding::new(path, i + 1, format!("links {link}, which does not exist")));
            }
        }
    }
    if let Some(text) = tree.files.get(PAPER_MAP) {
        problems.extend(check_tests(tree, text));
    }
    problems
}

/// Returns true if `name` reads like a path inside the repository: no blank, pattern or parameter.
fn is_path(name: &str) -> bool {
    let is_plain = |c: char| c.is_ascii_alphanumeric() || "/._-".contains(c);
    let is_parameter = name
        .split('/')
        .next()
        .is_some_and(|first| first.len() > 1 && first.chars().all(|c| c.is_ascii_uppercase() || c == '_'));
    let is_foreign = ["../", "/", "target/", "out/"].iter().any(|prefix| name.starts_with(prefix));
    let is_file = ENDINGS.iter().any(|ending| name.len() > ending.len() && name.ends_with(ending));
    let is_known = FOLDERS.iter().any(|folder| name.starts_with(folder));
    let is_example = name.ends_with(".ron") && !name.contains('/');
    (is_file || is_known) && name.chars().all(is_plain) && !is_parameter && !is_foreign && !is_example
}

/// The targets of the links in `line`, in order.
fn links(line: &str) -> impl Iterator<Item = &str> {
    line.split("](").skip(1).filter_map(|rest| rest.split(')').next())
}

/// Returns true if `link` in `document` leads to a file or folder of the repository, or out of it.
fn is_alive(tree: &Tree, document: &str, link: &str) -> bool {
    let target = link.split('#').next().unwrap_or_default();
    if target.is_empty() || target.contains("://") || target.starts_with("mailto:") {
        return true;
    }
    let mut parts: Vec<&str> = document.split('/').collect();
    parts.pop();
    for part in target.split('/').filter(|part| !part.is_empty() && *part != ".") {
        if part == ".." {
            parts.pop();
        } else {
            parts.push(part);
        }
    }
    let (file, folder) = (parts.join("/"), format!("{}/", parts.join("/")));
    tree.files.contains_key(&file) || tree.files.keys().any(|path| path.starts_with(&folder))
}

/// Checks the column of each table of the paper's map whose heading holds the word "test".
fn check_tests(tree: &Tree, text: &str) -> Vec<Finding> {
    let mut problems = Vec::new();
    let mut column = None;
    for (i, line) in text.lines().enumerate() {
        if !line.starts_with('|') {
            column = None;
            continue;
        }
        let cells: Vec<&str> = line.trim_matches('|').split('|').collect();
        let Some(column) = column else {
            let is_heading = |cell: &&str| cell.to_lowercase().contains("test");
            // A table without such a column has nothing to check: its index lies outside every row.
            column = Some(cells.iter().position(is_heading).unwrap_or(usize::MAX));
            continue;
        };
        for test in cells.get(column).into_iter().flat_map(|cell| quoted(cell)).filter(|name| is_test(name)) {
            if !exists(tree, test) {
                problems.push(Finding::new(PAPER_MAP, i + 1, format!("no test is called {test}")));
            }
        }
    }
    problems
}

/// Returns true if `name` is a function's name, with or without its path.
fn is_test(name: &str) -> bool {
    !name.is_empty() && name.chars().all(|c| c.is_ascii_alphanumeric() || c == '_' || c == ':')
}

/// Returns true if a function of that name stands in the crate that the path begins with, or
/// anywhere for a bare name.
fn exists(tree: &Tree, test: &str) -> bool {
    let (package, name) = match test.rsplit_once("::") {
        Some((path, name)) => (path.split("::").next().unwrap_or_default().replace('_', "-"), name),
        None => (String::new(), test),
    };
    let folder = match package.as_str() {
        "" => String::new(),
        "it" | "sharp-tests" => "tests/".into(),
        "xtask" => "xtask/".into(),
        _ => format!("crates/{package}/"),
    };
    let declaration = format!("fn {name}(");
    tree.matching(&folder, ".rs").any(|(_, text)| text.contains(&declaration))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_told_from_other_words() {
        for name in ["crates/sharp-sim", "docs/testing.md", "pose.rs", "./README.md", "xtask/src/ci.rs"] {
            assert!(is_path(name), "{name}");
        }
        for name in [
            "m/s",
            "DIR/report/tables.md",
            "../shared/maps/README.md",
            "crates/*/Cargo.toml",
            "docs/decisions/<number>.md",
            "target/doc/a.md",
            "noise.ron",
            "a b.rs",
            ".rs",
        ] {
            assert!(!is_path(name), "{name}");
        }
    }

    #[test]
    fn missing_files_are_named_with_their_line() {
        let tree = Tree::of(&[
            ("README.md", "See\n`docs/gone.md` and `docs/paper-map.md`."),
            ("ARCHITECTURE.md", ""),
            (PAPER_MAP, ""),
        ]);
        let problems: Vec<String> = check(&tree).iter().map(ToString::to_string).collect();
        assert_eq!(problems, ["README.md:2: names docs/gone.md, which does not exist"]);
        assert_eq!(check(&Tree::of(&[])).len(), 3, "the required documents");
    }

    #[test]
    fn links_are_followed_from_their_document() {
        let tree = Tree::of(&[("README.md", ""), ("docs/README.md", ""), ("docs/decisions/0001-a.md", "")]);
        for link in ["../README.md#try", "decisions", "./decisions/0001-a.md", "https://a.b/c.md", "#top"] {
            assert!(is_alive(&tree, "docs/README.md", link), "{link}");
        }
        assert!(!is_alive(&tree, "docs/README.md", "0001-a.md"), "another folder");
        assert_eq!(links("a [b](c.md) and [d](e)").collect::<Vec<_>>(), ["c.md", "e"]);
    }

    #[test]
    fn tests_of_the_paper_map_must_exist() {
        let map = "\
| paper | type | test |
|---|---|---|
| Definition 2 | `Rbvd` | `sharp_rbvd::build::cells_are_connected` |
| Definition 3 | `Endpoint` | `sharp_options::centroid::gone` |
| Theorem 1 | `Sharp` | `it::paper::composes`, `crates/sharp-rbvd/src/build.rs` |

| paper | file |
|---|---|
| `nothing_to_check` | `here` |";
        let tree = Tree::of(&[
            ("crates/sharp-rbvd/src/build.rs", "fn cells_are_connected() {}"),
            ("crates/sharp-options/src/centroid.rs", "fn other() {}"),
            ("tests/it/paper.rs", "fn composes() {}"),
        ]);
        let problems: Vec<String> = check_tests(&tree, map).iter().map(ToString::to_string).collect();
        assert_eq!(problems, ["docs/paper-map.md:4: no test is called sharp_options::centroid::gone"]);
    }
}
