//! Every command of the documents runs as it is written.
//!
//! A block of shell commands in a document is run in a folder of the document's own, one block after the other. A block
//! whose language is followed by a name, as in ```` ```python client.py ````, is first written to a file of that name.
//! A comment before a block, `<!-- not run: REASON -->`, leaves it out.

#[path = "common/python.rs"]
mod python;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

/// A block of a document.
#[derive(Debug)]
struct Block {
    line: usize,
    language: String,
    /// The name of the file that it is.
    file: Option<String>,
    text: String,
    /// Why it is not run.
    skipped: Option<String>,
}

fn root() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../..")
}

fn blocks(document: &Path) -> Vec<Block> {
    let text = fs::read_to_string(document).unwrap_or_else(|e| panic!("{}: {e}", document.display()));
    let (mut blocks, mut open, mut reason) = (Vec::new(), None::<Block>, None);
    for (number, line) in text.lines().enumerate() {
        let fence = line.trim_start().strip_prefix("```");
        match (&mut open, fence) {
            (Some(_), Some(_)) => blocks.extend(open.take()),
            (Some(block), None) => block.text += &format!("{line}\n"),
            (None, Some(info)) => {
                let mut words = info.split_whitespace().map(str::to_owned);
                let (language, file) = (words.next().unwrap_or_default(), words.next());
                let skipped = reason.take();
                open = Some(Block { line: number + 1, language, file, text: String::new(), skipped });
            }
            (None, None) => {
                let skip = line.strip_prefix("<!-- not run: ").and_then(|rest| rest.strip_suffix(" -->"));
                if !line.is_empty() {
                    reason = skip.map(str::to_owned);
                }
            }
        }
    }
    assert!(open.is_none(), "{}: a block is not closed", document.display());
    blocks
}

/// The documents of users, from the root of the repository.
fn documents() -> Vec<PathBuf> {
    let mut found = vec![root().join("README.md"), root().join("CONTRIBUTING.md")];
    let mut folders = vec![root().join("docs"), root().join("crates")];
    while let Some(folder) = folders.pop() {
        for path in fs::read_dir(&folder).expect("a folder").map(|entry| entry.expect("an entry").path()) {
            let is_source = ["src", "target", "assets"].iter().any(|name| path.ends_with(name));
            match path.is_dir() {
                true if !is_source => folders.push(path),
                false if path.extension().is_some_and(|ending| ending == "md") => found.push(path),
                _ => {}
            }
        }
    }
    found.sort();
    found
}

/// The search path with the program that is tested at its front.
#[allow(clippy::disallowed_methods, reason = "shells find programs by the search path")]
fn search_path() -> String {
    let binaries = Path::new(env!("CARGO_BIN_EXE_sharp")).parent().expect("a folder");
    format!("{}:{}", binaries.display(), std::env::var("PATH").unwrap_or_default())
}

/// Runs what `document` (from the root) says; the folder it ran in is left for a look if something fails.
fn run(document: &str) {
    let (path, folder) = (root().join(document), tempfile::tempdir().expect("a folder"));
    let (mut ran, mut failures) = (0, Vec::new());
    for block in blocks(&path) {
        if let Some(file) = &block.file {
            fs::write(folder.path().join(file), &block.text).expect("a file");
            if file.ends_with(".py") {
                failures
                    .extend(compiled(folder.path(), file).err().map(|said| format!("{document}: {said}")));
            }
        }
        if block.language != "sh" {
            continue;
        }
        if let Some(reason) = block.skipped {
            eprintln!("SKIPPED: {document}:{}: {reason}", block.line);
            continue;
        }
        let needs_python = block.text.contains("python3 ");
        if needs_python
            && !Command::new("python3").arg("--version").output().is_ok_and(|it| it.status.success())
        {
            eprintln!("SKIPPED: {document}:{}: there is no Python", block.line);
            continue;
        }
        let output = Command::new("bash")
            .args(["-euo", "pipefail", "-c", &block.text])
            .current_dir(folder.path())
            .env("PATH", search_path())
            .env("HOME", folder.path())
            .env("XDG_CACHE_HOME", folder.path().join("cache"))
            .output()
            .expect("bash runs");
        ran += 1;
        if !output.status.success() {
            let said = String::from_utf8_lossy(&output.stderr).into_owned();
            failures.push(format!("{document}:{}: {}{}\n{said}", block.line, block.text, output.status));
        }
    }
    assert!(failures.is_empty(), "{}", failures.join("\n"));
    assert!(ran > 0, "{document} has no commands to run");
}

/// Says what is wrong with the Python program `file` in `folder` before it runs; nothing where there is no Python.
fn compiled(folder: &Path, file: &str) -> Result<(), String> {
    let output = Command::new("python3").args(["-m", "py_compile", file]).current_dir(folder).output();
    match output {
        Ok(output) if !output.status.success() => Err(String::from_utf8_lossy(&output.stderr).into_owned()),
        _ => Ok(()),
    }
}

/// A test for each document whose commands are run.
macro_rules! documents {
    ($($test:ident: $document:literal,)*) => {
        $(#[test]
        fn $test() {
            run($document);
        })*

        /// What the tests above run.
        const RUN: &[&str] = &[$($document),*];
    };
}

documents! {
    the_commands_of_the_readme_run: "README.md",
    the_commands_about_maps_run: "docs/maps.md",
    the_commands_about_robots_run: "docs/robots.md",
    the_commands_about_the_page_run: "docs/show.md",
    the_commands_about_serve_run: "docs/serve.md",
    the_tutorial_from_a_ros_map_runs: "docs/tutorials/ros-map-to-served-policy.md",
    the_tutorial_about_a_new_robot_runs: "docs/tutorials/new-robot.md",
    the_tutorial_for_researchers_runs: "docs/tutorials/own-parts.md",
}

#[test]
fn every_command_of_every_document_is_run_or_says_why_not() {
    for path in documents() {
        let name = path.strip_prefix(root()).expect("inside").to_string_lossy().into_owned();
        if RUN.contains(&&*name) {
            continue;
        }
        for block in blocks(&path).iter().filter(|block| block.language == "sh") {
            let is_told = block.skipped.as_ref().is_some_and(|reason| reason.len() > 10);
            assert!(is_told, "{name}:{}: neither run by this test nor marked `not run: REASON`", block.line);
        }
    }
}

#[test]
fn a_session_with_serve_has_lines_of_the_schema() {
    let requirements = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/serve-requirements.txt");
    let Some(python) = python::python(&requirements) else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let plan = folder.path().join("plan");
    let solve = ["solve", "a", "--problem", "2", "--library", "none", "--verify", "20", "--out"];
    let solved = Command::new(env!("CARGO_BIN_EXE_sharp")).args(solve).arg(&plan).output().expect("runs");
    assert!(solved.status.success(), "{}", String::from_utf8_lossy(&solved.stderr));
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/check_serve.py");
    let schema = root().join("docs/serve.schema.json");
    let said = python::script(&python, &script, &[Path::new(env!("CARGO_BIN_EXE_sharp")), &plan, &schema]);
    assert!(said.contains("all lines are sound"), "{said}");
}

#[test]
fn a_session_with_a_learnt_building_has_lines_of_the_schema() {
    let tests = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests");
    let Some(python) = python::python(&tests.join("serve-requirements.txt")) else { return };
    let folder = tempfile::tempdir().expect("a folder");
    let (script, schema) =
        (tests.join("check_serve_library.py"), root().join("docs/serve-library.schema.json"));
    let words = [Path::new(env!("CARGO_BIN_EXE_sharp")), folder.path(), &schema];
    let said = python::script(&python, &script, &words);
    assert!(said.contains("all lines are sound"), "{said}");
}
