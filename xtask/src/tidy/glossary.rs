//! The glossary names each term once, with a type that exists and one sentence.

use std::collections::BTreeSet;

use super::Finding;
use super::code::sources;
use super::names::declared;
use super::quoted;
use crate::tree::Tree;

const GLOSSARY: &str = "docs/glossary.md";

/// Checks every row of every table of the glossary: term, symbol, type, meaning.
pub(super) fn check(tree: &Tree) -> Vec<Finding> {
    let Some(text) = tree.files.get(GLOSSARY) else {
        return vec![Finding::new(GLOSSARY, 1, "is missing")];
    };
    let types: BTreeSet<String> =
        sources(tree).flat_map(|(_, code)| declared(&code)).map(|(name, _)| name).collect();
    let mut problems = Vec::new();
    let mut terms = BTreeSet::new();
    for (i, line) in text.lines().enumerate() {
        let cells: Vec<&str> = line.trim_matches('|').split('|').map(str::trim).collect();
        if !line.starts_with('|') || line.starts_with("|---") || cells[0] == "term" {
            continue;
        }
        let mut report = |message: String| problems.push(Finding::new(GLOSSARY, i + 1, message));
        let [term, _, name, meaning] = cells[..] else {
            report(format!("a row has {} cells, expected term, paper, type and meaning", cells.len()));
            continue;
        };
        if !terms.insert(term) {
            report(format!("the term {term} stands twice"));
        }
        for name in quoted(name).filter(|name| !types.contains(*name)) {
            report(format!("no type is called {name}"));
        }
        if name.is_empty() || !meaning.ends_with('.') {
            report(format!("the term {term} needs a type and a sentence"));
        }
    }
    problems
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_are_whole_and_their_types_exist() {
        let rows = "\
| term | paper | type | meaning |
|---|---|---|---|
| pose | x | `Pose` | Where the robot is. |
| place | x | `Place` | Where it stands. |
| pose | | `Pose` | no sentence |
| three | | `Pose` |";
        let tree = Tree::of(&[(GLOSSARY, rows), ("crates/a/src/lib.rs", "pub struct Pose;")]);
        let problems: Vec<String> = check(&tree).iter().map(ToString::to_string).collect();
        assert_eq!(
            problems,
            [
                "docs/glossary.md:4: no type is called Place",
                "docs/glossary.md:5: the term pose stands twice",
                "docs/glossary.md:5: the term pose needs a type and a sentence",
                "docs/glossary.md:6: a row has 3 cells, expected term, paper, type and meaning",
            ]
        );
    }
}
