//! Every type name stands once in the workspace: one word for one thing.

use std::collections::BTreeMap;

use super::Finding;
use super::code::{is_word, line_of, sources, words};
use crate::tree::Tree;

/// Names that may stand twice, each with the reason.
const EXCEPTIONS: [(&str, &str); 0] = [];
/// Words that declare a type.
const DECLARATIONS: [&str; 4] = ["struct", "enum", "trait", "union"];

/// Checks the types that all code declares outside tests and benches, private ones as well.
pub(super) fn check(tree: &Tree) -> Vec<Finding> {
    let mut places = BTreeMap::<String, Vec<(&str, usize)>>::new();
    for (path, code) in sources(tree) {
        for (name, line) in declared(&code) {
            places.entry(name).or_default().push((path, line));
        }
    }
    let is_free = |name: &str| EXCEPTIONS.iter().any(|(exception, _)| *exception == name);
    let mut problems = Vec::new();
    for (name, places) in places.iter().filter(|(name, places)| places.len() > 1 && !is_free(name)) {
        let (first, line) = places[0];
        for (path, at) in &places[1..] {
            problems.push(Finding::new(
                path,
                *at,
                format!("the type {name} stands in {first}:{line} as well"),
            ));
        }
    }
    problems
}

/// The types that `code` declares, with their lines.
pub(super) fn declared(code: &str) -> Vec<(String, usize)> {
    let mut found = Vec::new();
    for word in DECLARATIONS {
        for at in words(code, word) {
            let rest = code[at + word.len()..].trim_start();
            let name: String = rest.chars().take_while(|&c| is_word(c)).collect();
            // The word before a name in lower case is a name itself, as in `trait_ union`.
            if name.starts_with(|c: char| c.is_ascii_uppercase()) {
                found.push((name, line_of(code, at)));
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_second_declaration_is_named() {
        let tree = Tree::of(&[
            (
                "crates/a/src/lib.rs",
                "//! struct World;\npub struct World {}\n#[cfg(test)]\nmod tests { struct B; }",
            ),
            ("crates/b/src/lib.rs", "struct B(u8);\n\nenum World {}"),
            ("crates/b/tests/own.rs", "struct World;"),
        ]);
        let problems: Vec<String> = check(&tree).iter().map(ToString::to_string).collect();
        assert_eq!(
            problems,
            ["crates/b/src/lib.rs:3: the type World stands in crates/a/src/lib.rs:2 as well"]
        );
    }

    #[test]
    fn all_four_declarations_count() {
        let code =
            "pub(crate) struct A;\nenum B {}\npub trait C: D {}\nunion E { f: u8 }\nstruct Generic<T>(T);";
        let mut names: Vec<String> = declared(code).into_iter().map(|(name, _)| name).collect();
        names.sort();
        assert_eq!(names, ["A", "B", "C", "E", "Generic"]);
    }
}
