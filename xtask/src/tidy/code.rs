//! Rust source as the checks read it: without comments, without the contents of literals, without tests.
//!
//! This is no parser. It knows comments, strings, characters and braces, which is enough to find words in code.

use crate::tree::Tree;

/// The files of `tree` that are neither tests nor benches, each with its code and without its unit tests.
/// Examples count as code, because they are read like it.
pub(super) fn sources(tree: &Tree) -> impl Iterator<Item = (&str, String)> {
    let sources = tree.matching("", ".rs").filter(|(path, _)| !is_test_file(path));
    sources.map(|(path, text)| (path, without_tests(&plain(text))))
}

/// Returns true if `path` holds nothing but tests, benches or worlds for them.
pub(super) fn is_test_file(path: &str) -> bool {
    let folder = ["/tests/", "/benches/"].iter().any(|folder| path.contains(folder));
    let file = ["/tests.rs", "/test_worlds.rs"].iter().any(|file| path.ends_with(file));
    folder || file || path.starts_with("tests/it/")
}

/// Returns true if `path` is an example.
pub(super) fn is_example(path: &str) -> bool {
    path.contains("/examples/")
}

/// `text` with blanks in place of comments and of what stands between quotes; lines stay where they are.
pub(super) fn plain(text: &str) -> String {
    let mut plain = String::with_capacity(text.len());
    let mut rest = text;
    while let Some(first) = rest.chars().next() {
        let (kept, skipped) = match first {
            '/' if rest.starts_with("//") => (0, rest.find('\n').unwrap_or(rest.len())),
            '/' if rest.starts_with("/*") => (0, rest.find("*/").map_or(rest.len(), |at| at + 2)),
            '"' => (1, string_len(rest, 0)),
            'r' if !ends_in_word(&plain) => match raw_hashes(rest) {
                Some(hashes) => (1, string_len(rest, hashes)),
                None => (1, 1),
            },
            '\'' => (1, character_len(rest)),
            _ => (first.len_utf8(), first.len_utf8()),
        };
        plain.push_str(&rest[..kept]);
        plain.extend(rest[kept..skipped].chars().filter(|&c| c == '\n'));
        if first == '"' {
            plain.push('"');
        }
        rest = &rest[skipped..];
    }
    plain
}

fn ends_in_word(text: &str) -> bool {
    text.chars().next_back().is_some_and(is_word)
}

/// Returns true if `c` may stand inside a name.
pub(super) fn is_word(c: char) -> bool {
    c.is_alphanumeric() || c == '_'
}

/// How many `#` open the raw string at the start of `text`; `None` if there is none.
fn raw_hashes(text: &str) -> Option<usize> {
    let inner = &text[1..];
    let hashes = inner.len() - inner.trim_start_matches('#').len();
    inner[hashes..].starts_with('"').then_some(hashes + 1)
}

/// Length of the string at the start of `text`: an ordinary one for 0, else a raw one with `raw` - 1 hashes.
fn string_len(text: &str, raw: usize) -> usize {
    if raw > 0 {
        let close = format!("\"{}", "#".repeat(raw - 1));
        let open = 1 + raw;
        return text[open..].find(&close).map_or(text.len(), |at| open + at + close.len());
    }
    let mut escaped = false;
    for (at, c) in text.char_indices().skip(1) {
        match c {
            _ if escaped => escaped = false,
            '\\' => escaped = true,
            '"' => return at + 1,
            _ => {}
        }
    }
    text.len()
}

/// Length of the character literal at the start of `text`, or 1 where the quote begins a lifetime.
fn character_len(text: &str) -> usize {
    let mut chars = text.char_indices().skip(1);
    match chars.next() {
        Some((_, '\\')) => text[3..].find('\'').map_or(text.len(), |at| at + 4),
        Some(_) => match chars.next() {
            Some((at, '\'')) => at + 1,
            _ => 1,
        },
        None => 1,
    }
}

/// `code` without the items under `#[cfg(test)]`; lines stay where they are. `code` must be [`plain`].
pub(super) fn without_tests(code: &str) -> String {
    const MARK: &str = "#[cfg(test)]";
    let mut kept = String::with_capacity(code.len());
    let mut rest = code;
    while let Some(at) = rest.find(MARK) {
        kept.push_str(&rest[..at]);
        let item = &rest[at..];
        let end = item_len(item);
        kept.extend(item[..end].chars().filter(|&c| c == '\n'));
        rest = &item[end..];
    }
    kept + rest
}

/// Length of the item at the start of `code`: up to its semicolon or its closing brace.
fn item_len(code: &str) -> usize {
    let mut depth = 0_u32;
    for (at, c) in code.char_indices() {
        match c {
            '{' => depth += 1,
            '}' if depth == 1 => return at + 1,
            '}' => depth = depth.saturating_sub(1),
            ';' if depth == 0 => return at + 1,
            _ => {}
        }
    }
    code.len()
}

/// Where `word` stands in `code` as a word of its own: the bytes at which it begins.
pub(super) fn words<'a>(code: &'a str, word: &'a str) -> impl Iterator<Item = usize> + 'a {
    code.match_indices(word).map(|(at, _)| at).filter(move |&at| {
        let after = code[at + word.len()..].chars().next();
        !ends_in_word(&code[..at]) && !after.is_some_and(is_word)
    })
}

/// The number of the line, from 1, in which the byte `at` of `text` stands.
pub(super) fn line_of(text: &str, at: usize) -> usize {
    1 + text[..at].matches('\n').count()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comments_and_literals_are_blank_and_lines_stay() {
        let text = "a(\"x \\\" y\"); // b\n/* c\nd */ e('\\'', 'f', \"\ng\") r#\"h \" i\"# &'static str";
        assert_eq!(plain(text), "a(\"\"); \n\n e(', ', \"\n\") r &'static str");
    }

    #[test]
    fn names_that_end_in_r_are_no_raw_strings() {
        assert_eq!(plain("for\"a\" br\"b\" r\"c\" r"), "for\"\" br\"\" r r");
    }

    #[test]
    fn tests_go_and_what_comes_after_them_stays() {
        let code =
            "a();\n#[cfg(test)]\nmod test_worlds;\n\nb();\n#[cfg(test)]\nmod tests {\n{ c(); }\n}\nd();\n";
        assert_eq!(without_tests(code), "a();\n\n\n\nb();\n\n\n\n\nd();\n");
    }

    #[test]
    fn words_are_found_whole() {
        let code = "act react act_at\nact";
        let lines: Vec<usize> = words(code, "act").map(|at| line_of(code, at)).collect();
        assert_eq!(lines, [1, 2]);
    }

    #[test]
    fn tests_and_benches_are_told_by_their_place() {
        for path in
            ["crates/a/tests/b.rs", "crates/a/benches/b.rs", "crates/a/src/tests.rs", "tests/it/main.rs"]
        {
            assert!(is_test_file(path), "{path}");
        }
        for path in ["crates/a/src/lib.rs", "crates/a/examples/b.rs", "tests/downstream/a/src/main.rs"] {
            assert!(!is_test_file(path), "{path}");
        }
        let tree = Tree::of(&[("crates/a/src/lib.rs", "a(); // b"), ("crates/a/src/tests.rs", "c();")]);
        assert_eq!(sources(&tree).collect::<Vec<_>>(), [("crates/a/src/lib.rs", "a(); ".to_owned())]);
    }
}
