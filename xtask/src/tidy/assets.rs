//! Every asset is listed with its origin.

use super::{Finding, quoted};
use crate::tree::Tree;

/// Checks that the `README.md` of each `assets` folder, at the root and in crates, names every file below it,
/// in backticks, by its path from there; a `*` in a name stands for anything but a slash.
pub(super) fn check(tree: &Tree) -> Vec<Finding> {
    let mut problems = Vec::new();
    for (path, _) in tree.matching("", "") {
        let Some((folder, from_there)) = split(path) else { continue };
        let index = format!("{folder}README.md");
        if path == index {
            continue;
        }
        let names = tree.files.get(&index).into_iter().flat_map(|text| text.lines().flat_map(quoted));
        if !names.into_iter().any(|name| matches(name, from_there)) {
            problems.push(Finding::new(path, 1, format!("is not listed in {index}")));
        }
    }
    problems
}

/// The folder `assets/` that holds `path`, and the path from there.
fn split(path: &str) -> Option<(&str, &str)> {
    let at = if path.starts_with("assets/") {
        0
    } else {
        let inside = path.strip_prefix("crates/")?;
        let name = inside.find('/')?;
        inside[name..].starts_with("/assets/").then_some("crates/".len() + name + 1)?
    };
    Some(path.split_at(at + "assets/".len()))
}

/// Returns true if `pattern` describes `path`.
fn matches(pattern: &str, path: &str) -> bool {
    match pattern.split_once('*') {
        None => pattern == path,
        Some((head, tail)) => path.strip_prefix(head).is_some_and(|rest| {
            let reach = rest.find('/').unwrap_or(rest.len());
            (0..=reach).filter(|&i| rest.is_char_boundary(i)).any(|i| matches(tail, &rest[i..]))
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patterns_stay_inside_a_folder() {
        for (pattern, path, expected) in [
            ("maps/a.ron", "maps/a.ron", true),
            ("maps/*.ron", "maps/a.ron", true),
            ("maps/*.ron", "maps/b/a.ron", false),
            ("maps/*-*.ron", "maps/a-1.ron", true),
            ("maps/*", "maps/a.txt", true),
            ("maps/*.ron", "maps/a.txt", false),
        ] {
            assert_eq!(matches(pattern, path), expected, "{pattern} on {path}");
        }
    }

    #[test]
    fn unlisted_assets_are_named() {
        let tree = Tree::of(&[
            ("assets/README.md", "| `maps/*.ron` | drawn |"),
            ("assets/maps/a.ron", ""),
            ("assets/models/net", ""),
            ("crates/sharp-sim/assets/README.md", "| `robots/husky.ron` | data sheet |"),
            ("crates/sharp-sim/assets/robots/husky.ron", ""),
            ("crates/sharp-sim/assets/robots/limo.ron", ""),
            ("crates/sharp-maps/assets/a.ron", ""),
            ("crates/sharp-maps/src/assets/mod.rs", ""),
        ]);
        let problems: Vec<String> = check(&tree).iter().map(ToString::to_string).collect();
        assert_eq!(
            problems,
            [
                "assets/models/net:1: is not listed in assets/README.md",
                "crates/sharp-maps/assets/a.ron:1: is not listed in crates/sharp-maps/assets/README.md",
                "crates/sharp-sim/assets/robots/limo.ron:1: is not listed in crates/sharp-sim/assets/README.md",
            ]
        );
    }
}
