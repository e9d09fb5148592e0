//! The table of the paper's own protocol: which rows it has, and the section and figures made from the lines that were
//! measured. `cargo xtask paper-table` calls it.
//!
//! ```sh
//! paper_table rows
//! paper_table write docs/data/paper-protocol.jsonl docs/results.md docs/images
//! ```

#![allow(clippy::disallowed_methods, reason = "an example is a command: it reads its arguments")]

use std::fs;
use std::path::Path;

use sharp_bench::{PaperLine, paper_rows, to_json, write_paper};

fn main() {
    let args: Vec<String> = std::env::args().skip(1).collect();
    match args.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        ["rows"] => paper_rows().iter().for_each(|row| println!("{}", to_json(row))),
        ["write", lines, page, images] => write(lines, page, images),
        _ => panic!("expected `rows`, or `write LINES.jsonl PAGE.md IMAGES`"),
    }
}

fn write(path: &str, page: &str, images: &str) {
    let text = fs::read_to_string(path).unwrap_or_else(|error| panic!("{path}: {error}"));
    let parse = |(index, line): (usize, &str)| -> PaperLine {
        serde_json::from_str(line).unwrap_or_else(|error| panic!("{path} line {}: {error}", index + 1))
    };
    let lines: Vec<PaperLine> = text.lines().enumerate().map(parse).collect();
    let before = fs::read_to_string(page).unwrap_or_else(|error| panic!("{page}: {error}"));
    let after = write_paper(&lines, &before, Path::new(images)).expect("figures that can be written");
    fs::write(page, after).unwrap_or_else(|error| panic!("{page}: {error}"));
    println!("{} lines in {page}, figures in {images}", lines.len());
}
