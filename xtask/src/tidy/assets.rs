//! Every asset is listed with its origin.

use super::{Problem, quoted};
use crate::tree::Tree;

const INDEX: &str = "assets/README.md";

/// Checks that `assets/README.md` names each file below `assets/`, in backticks, by its path from
/// there; a `*` in a name stands for anything but a slash.
pub(super) fn check(tree: &Tree) -> Vec<Problem> {
    let Some(index) = tree.files.get(INDEX) else {
        return vec![Problem::new(INDEX, 1, "is missing: it lists every asset with its origin")];
    };
    let names: Vec<&str> = index.lines().flat_map(quoted).collect();
    let assets = tree.matching("assets/", "").map(|(path, _)| path).filter(|path| *path != INDEX);
    let is_listed = |path: &str| {
        let from_here = path.strip_prefix("assets/").unwrap_or(path);
        names.iter().any(|name| matches(name, from_here) || matches(name, path))
    };
    assets
        .filter(|path| !is_listed(path))
        .map(|path| Problem::new(path, 1, format!("is not listed in {INDEX}")))
        .collect()
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
            (INDEX, "| `maps/*.ron` | drawn |\n| `robots/husky.ron` | data sheet |"),
            ("assets/maps/a.ron", ""),
            ("assets/robots/husky.ron", ""),
            ("assets/robots/limo.ron", ""),
        ]);
        let problems: Vec<String> = check(&tree).iter().map(ToString::to_string).collect();
        assert_eq!(problems, ["assets/robots/limo.ron:1: is not listed in assets/README.md"]);
    }
}
