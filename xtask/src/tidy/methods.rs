//! A mode is data: nothing outside `method.rs` asks which method is at work (invariant 13).

use super::Finding;
use super::code::{is_example, is_word, line_of, sources, words};
use crate::tree::Tree;

/// The one file that names the methods and may tell them apart.
const OWNER: &str = "crates/sharp-plan/src/method.rs";
/// The crate in which `method` always means a `Method`.
const CRATE: &str = "crates/sharp-plan/";
/// The named methods. A library takes a method as an argument; only a command may choose one.
const NAMED: [&str; 4] = ["Method::fast", "Method::paper", "Method::paper_tuned", "Method::prior"];

/// Checks the code of all crates outside tests and examples.
pub(super) fn check(tree: &Tree) -> Vec<Finding> {
    let mut problems = Vec::new();
    let is_bound = |path: &str| path.starts_with("crates/") && path != OWNER && !is_example(path);
    for (path, code) in sources(tree).filter(|(path, _)| is_bound(path)) {
        let mut report = |at: usize, message: &str| {
            problems.push(Finding::new(
                path,
                line_of(&code, at),
                format!("{message}: make it a field of `Method`"),
            ));
        };
        // Outside sharp-plan the word may mean something else, unless the file names the type or asks for `name`.
        let is_meant = path.starts_with(CRATE) || words(&code, "Method").next().is_some();
        for at in branches(&code).filter(|&at| is_meant || asks_for_name(&code[at..])) {
            report(at, "asks which method is at work");
        }
        if !path.starts_with("crates/sharp-cli/") {
            for name in NAMED {
                for at in words(&code, name) {
                    report(at, &format!("names {name}"));
                }
            }
        }
    }
    problems
}

/// Where `code` branches on a method or on its name: `match method`, `matches!(method.name, …)`, `method.name == …`.
fn branches(code: &str) -> impl Iterator<Item = usize> {
    let matched = words(code, "match").filter(|&at| {
        let rest = &code[at + "match".len()..];
        is_method(&rest[..rest.find('{').unwrap_or(rest.len())])
    });
    let tested = words(code, "matches").filter(|&at| {
        let rest = &code[at + "matches".len()..];
        rest.starts_with("!(") && is_method(&rest[2..rest.find(',').unwrap_or(rest.len()).max(2)])
    });
    let compared = words(code, "method").filter(|&at| {
        let rest = &code[at + "method".len()..];
        let rest = rest.trim_start_matches(".name").trim_start_matches("()").trim_start_matches(".as_str()");
        let rest = rest.trim_start();
        rest.starts_with("==") || rest.starts_with("!=")
    });
    matched.chain(tested).chain(compared)
}

/// Returns true if the branch at the start of `code` is about the field `name` of a method.
fn asks_for_name(code: &str) -> bool {
    let head = &code[..code.find(['{', ',', '=']).unwrap_or(code.len())];
    head.match_indices("method.name").any(|(at, name)| {
        let rest = &head[at + name.len()..];
        !rest.starts_with('(') && !rest.starts_with(is_word)
    })
}

/// Returns true if `expression` is a method or its name, or a tuple with one; not if a call merely takes one.
fn is_method(expression: &str) -> bool {
    let is_argument = |at: usize| {
        let open = expression[..at].rfind('(');
        open.is_some_and(|open| expression[..open].ends_with(is_word))
    };
    words(expression, "method").filter(|&at| !is_argument(at)).any(|at| {
        let rest = &expression[at + "method".len()..];
        match rest.strip_prefix('.') {
            Some(field) => field.split(|c: char| !is_word(c)).next() == Some("name"),
            None => !rest.starts_with('('),
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn problems(path: &str, code: &str) -> usize {
        check(&Tree::of(&[(path, code)])).len()
    }

    #[test]
    fn branches_on_a_method_stand_in_its_file_only() {
        for code in [
            "match method { _ => Method::new() }",
            "match &self.method.name.as_str() { _ => 1 }",
            "match (spec.method, 1) { _ => 1 }\nuse sharp_plan::Method;",
            "if problem.method.name == \"paper\" {}",
            "if method != Method::default() {}",
            "if matches!(method.name.as_str(), \"paper\") {}",
        ] {
            assert_eq!(problems("crates/sharp-plan/src/repair.rs", code), 1, "{code}");
            assert_eq!(problems("crates/sharp-cli/src/main.rs", code), 1, "{code}");
            assert_eq!(problems(OWNER, code), 0, "{code}");
        }
    }

    #[test]
    fn settings_of_a_method_may_be_asked() {
        for code in [
            "match problem.method.order { _ => 1 }",
            "match Search::new(world, method) { _ => 1 }",
            "if method.repair.rounds == 0 {}",
            "let method = other;",
        ] {
            assert_eq!(problems("crates/sharp-plan/src/repair.rs", code), 0, "{code}");
        }
    }

    #[test]
    fn elsewhere_the_word_may_mean_something_else() {
        for code in
            ["match spec.method { _ => 1 }", "if args.method == Baseline::Rrt {}", "match method.name() {}"]
        {
            assert_eq!(problems("crates/sharp-bench/src/jobs.rs", code), 0, "{code}");
        }
    }

    #[test]
    fn libraries_take_a_method_and_commands_choose_one() {
        let code = "//! [`Method::fast`]\nlet method = Method::fast();";
        assert_eq!(problems("crates/sharp-plan/src/sharp.rs", code), 1, "a library");
        assert_eq!(problems("crates/sharp-cli/src/input.rs", code), 0, "a command");
        assert_eq!(problems("crates/sharp-plan/examples/own.rs", code), 0, "an example");
    }
}
