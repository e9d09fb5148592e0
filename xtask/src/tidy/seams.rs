//! Every trait that strangers implement has a conformance suite and an example that does.

use super::Finding;
use super::code::{is_example, plain, words};
use crate::tree::Tree;

/// The traits, each with the crate that owns it.
const SEAMS: [(&str, &str); 15] = [
    ("sharp-space", "CollisionChecker"),
    ("sharp-space", "RobotGeometry"),
    ("sharp-space", "RegionDetector"),
    ("sharp-rl", "Environment"),
    ("sharp-rl", "BatchEnvironment"),
    ("sharp-rl", "Learner"),
    ("sharp-sim", "Simulator"),
    ("sharp-rbvd", "StateAbstraction"),
    ("sharp-options", "OptionFamily"),
    ("sharp-guide", "GuidePlanner"),
    ("sharp-guide", "Reward"),
    ("sharp-drive", "Policy"),
    ("sharp-plan", "OptionLearner"),
    ("sharp-bench", "Contender"),
    ("sharp-bench", "Engine"),
];

/// Longest example that implements a trait, lines: it shows that the trait is small.
const EXAMPLE_MAX: usize = 60;

/// Checks the table above.
pub(super) fn check(tree: &Tree) -> Vec<Finding> {
    SEAMS.iter().flat_map(|(package, name)| check_seam(tree, package, name)).collect()
}

fn check_seam(tree: &Tree, package: &str, name: &str) -> Vec<Finding> {
    let folder = format!("crates/{package}/");
    let root = format!("{folder}src/lib.rs");
    let mut problems = Vec::new();
    let mut report = |path: &str, message: String| problems.push(Finding::new(path, 1, message));

    let suite = format!("{folder}src/conformance");
    let mut suites = tree.matching(&suite, ".rs");
    if !suites.any(|(_, text)| words(&plain(text), name).next().is_some()) {
        report(&root, format!("the trait {name} has no suite in {suite}"));
    }
    let is_public = tree.files.get(&root).is_some_and(|text| plain(text).contains("pub mod conformance;"));
    if !is_public {
        report(&root, format!("the suite of {name} is not public: pub mod conformance"));
    }

    let implements = format!("impl {name} for");
    let examples = tree.matching(&folder, ".rs").filter(|(path, _)| is_example(path));
    let examples: Vec<_> = examples.filter(|(_, text)| plain(text).contains(&implements)).collect();
    if examples.is_empty() {
        report(&root, format!("no file of {folder}examples implements the trait {name}"));
    }
    // One that compares with another program may be longer.
    let shown: Vec<_> = examples.iter().filter(|(path, _)| !path.contains("/peer_")).collect();
    for (path, text) in &shown {
        let lines = text.lines().count();
        if lines > EXAMPLE_MAX {
            report(path, format!("has {lines} lines, an example has at most {EXAMPLE_MAX}"));
        }
        if !text.contains("conformance") {
            report(path, format!("does not run the suite of {name}"));
        }
    }
    problems
}

#[cfg(test)]
mod tests {
    use super::*;

    const SUITE: (&str, &str) = ("crates/a/src/conformance/mod.rs", "pub fn check(t: &dyn Trait) {}");
    const ROOT: (&str, &str) = ("crates/a/src/lib.rs", "pub mod conformance;");
    const EXAMPLE: (&str, &str) = ("crates/a/examples/own.rs", "use conformance;\nimpl Trait for Own {}");

    fn problems(files: &[(&str, &str)]) -> Vec<String> {
        let problems = check_seam(&Tree::of(files), "a", "Trait");
        problems.into_iter().map(|problem| problem.message).collect()
    }

    #[test]
    fn a_trait_with_suite_and_example_passes() {
        assert!(problems(&[ROOT, SUITE, EXAMPLE]).is_empty());
        let file = ("crates/a/src/conformance.rs", SUITE.1);
        assert!(problems(&[ROOT, file, EXAMPLE]).is_empty());
    }

    #[test]
    fn what_is_missing_is_named() {
        assert_eq!(problems(&[ROOT, EXAMPLE]), ["the trait Trait has no suite in crates/a/src/conformance"]);
        assert_eq!(problems(&[SUITE, EXAMPLE]), ["the suite of Trait is not public: pub mod conformance"]);
        assert_eq!(problems(&[ROOT, SUITE]), ["no file of crates/a/examples implements the trait Trait"]);
    }

    #[test]
    fn examples_are_short_and_run_the_suite() {
        let long = format!("// conformance\nimpl Trait for Own {{}}\n{}", "\n".repeat(60));
        assert_eq!(
            problems(&[ROOT, SUITE, ("crates/a/examples/own.rs", &long)]),
            ["has 62 lines, an example has at most 60"]
        );
        assert_eq!(
            problems(&[ROOT, SUITE, ("crates/a/examples/own.rs", "impl Trait for Own {}")]),
            ["does not run the suite of Trait"]
        );
    }
}
