//! `cargo xtask stats`: lines, functions and docs of each crate, counted line by line.

use std::collections::BTreeMap;
use std::fmt::Write;

use crate::tree::Tree;

/// What is counted of one crate.
#[derive(Debug, Default, PartialEq)]
struct Counts {
    files: usize,
    /// Lines above the unit tests that are neither blank nor comment.
    code: usize,
    /// Lines of tests, benches and examples that are neither blank nor comment.
    test: usize,
    doc: usize,
    comment: usize,
    /// Lengths of the functions above the unit tests, lines, with the place of each.
    functions: Vec<(usize, String)>,
}

/// The table of all crates.
pub(crate) fn table(tree: &Tree) -> String {
    let mut crates = BTreeMap::<&str, Counts>::new();
    for (path, text) in tree.matching("", ".rs") {
        let name = match path.strip_prefix("crates/").unwrap_or(path).split_once('/') {
            Some((name, _)) => name,
            None => continue,
        };
        count(path, text, crates.entry(name).or_default());
    }
    let mut table = format!(
        "{:15}{:>6}{:>7}{:>7}{:>11}{:>10}{:>5}{:>8}{:>8}{:>6}  longest function\n",
        "crate", "files", "code", "tests", "tests/code", "docs/code", "fns", "fn p50", "fn p90", "max"
    );
    for (name, counts) in &mut crates {
        write_row(&mut table, name, counts);
    }
    table
}

fn write_row(table: &mut String, name: &str, counts: &mut Counts) {
    counts.functions.sort();
    let functions = &counts.functions;
    let quantile = |share: f64| match functions.len() {
        0 => 0,
        n => functions[((n - 1) as f64 * share) as usize].0,
    };
    let per_code = |lines: usize| lines as f64 / counts.code.max(1) as f64;
    // Writing to a String cannot fail.
    let _ = writeln!(
        table,
        "{name:15}{:>6}{:>7}{:>7}{:>11.2}{:>10.2}{:>5}{:>8}{:>8}{:>6}  {}",
        counts.files,
        counts.code,
        counts.test,
        per_code(counts.test),
        per_code(counts.doc),
        functions.len(),
        quantile(0.5),
        quantile(0.9),
        quantile(1.0),
        functions.last().map_or("", |(_, place)| place)
    );
}

fn count(path: &str, text: &str, counts: &mut Counts) {
    counts.files += 1;
    let mut is_test = is_test_file(path);
    let mut open: Option<(usize, usize, String)> = None;
    for (i, line) in text.lines().enumerate() {
        let trimmed = line.trim_start();
        let indent = line.len() - trimmed.len();
        is_test |= trimmed == "#[cfg(test)]" && indent == 0;
        match trimmed {
            "" => {}
            _ if trimmed.starts_with("//!") || trimmed.starts_with("///") => counts.doc += 1,
            _ if trimmed.starts_with("//") => counts.comment += 1,
            _ if is_test => counts.test += 1,
            _ => counts.code += 1,
        }
        if !is_test && open.is_none() && is_function(trimmed) && !trimmed.ends_with(';') {
            open = Some((i, indent, format!("{path}:{}", i + 1)));
        }
        // Formatted code closes a function in the column in which it was opened.
        let closes = |&(_, at, _): &(usize, usize, String)| indent == at && trimmed.starts_with('}');
        let is_line = |&(at, _, _): &(usize, usize, String)| at == i && trimmed.ends_with('}');
        if let Some((start, _, place)) = open.take_if(|open| closes(open) || is_line(open)) {
            counts.functions.push((i + 1 - start, place));
        }
    }
}

fn is_test_file(path: &str) -> bool {
    let folders = ["tests/", "/benches/", "/examples/"];
    folders.iter().any(|folder| path.contains(folder)) || path.ends_with("/tests.rs")
}

fn is_function(line: &str) -> bool {
    let mut words = line
        .split_whitespace()
        .skip_while(|word| word.starts_with("pub") || ["const", "async", "unsafe", "default"].contains(word));
    words.next() == Some("fn")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_and_functions_are_counted() {
        let text = "\
//! Module.

/// One.
pub(crate) const fn one() -> u8 {
    // Why.
    1
}

trait Two {
    fn required(&self);
    fn short(&self) {}
}

#[cfg(test)]
mod tests {
    fn helper() {}
}
";
        let mut counts = Counts::default();
        count("crates/a/src/lib.rs", text, &mut counts);
        let functions = vec![(4, "crates/a/src/lib.rs:4".into()), (1, "crates/a/src/lib.rs:11".into())];
        assert_eq!(counts, Counts { files: 1, code: 7, test: 4, doc: 2, comment: 1, functions });
    }

    #[test]
    fn every_crate_has_a_row() {
        let tree = Tree::of(&[
            ("crates/sharp-rl/src/lib.rs", "fn a() {\n}\n"),
            ("xtask/src/main.rs", ""),
            ("build.rs", ""),
        ]);
        let table = table(&tree);
        let names: Vec<&str> =
            table.lines().skip(1).filter_map(|row| row.split_whitespace().next()).collect();
        assert_eq!(names, ["sharp-rl", "xtask"]);
    }
}
