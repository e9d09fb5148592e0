//! The wheel, installed into an empty virtual environment and used from Python.

#![allow(clippy::disallowed_methods, reason = "a variable says whether a test can do more")]

#[path = "../../sharp-cli/tests/common/python.rs"]
mod python;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::sync::LazyLock;

/// A Python that has the wheel; `None`, said on stderr, where there is no Python or no package index.
static PYTHON: LazyLock<Option<PathBuf>> = LazyLock::new(|| {
    let (here, python) = (here(), python::python(&here().join("tests/requirements.txt"))?);
    // Two test programs may run at once, of two builds: each has a folder of its own.
    let folder = tempfile::tempdir().expect("a folder");
    let wheel = python::script(&python, &here.join("pack.py"), &[&library(), folder.path()]);
    let mut pip = Command::new(&python);
    // Nothing is fetched: what the wheel says it needs has to be there.
    pip.args([
        "-m",
        "pip",
        "install",
        "--quiet",
        "--disable-pip-version-check",
        "--no-index",
        "--force-reinstall",
    ]);
    let output = pip.args(["--no-deps", wheel.trim()]).output().expect("pip runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let output = Command::new(&python).args(["-m", "pip", "check"]).output().expect("pip runs");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stdout));
    Some(python)
});

fn here() -> PathBuf {
    PathBuf::from(env!("CARGO_MANIFEST_DIR"))
}

/// The library that cargo built for this test.
///
/// It lies beside the program in `deps`: only `cargo build` puts a copy one folder up.
fn library() -> PathBuf {
    let program = std::env::current_exe().expect("this program has a path");
    program.with_file_name("libsharp_core.so")
}

/// What the script called `name` prints; `None` where there is no Python.
fn said(name: &str, args: &[&Path]) -> Option<String> {
    if !cfg!(target_os = "linux") {
        eprintln!("SKIPPED: the wheel is packed by hand on Linux only");
        return None;
    }
    let python = PYTHON.as_deref()?;
    Some(python::script(python, &here().join(name), args))
}

#[test]
fn maps_plans_and_policies_work_from_python() {
    if let Some(said) = said("tests/check_sharp.py", &[]) {
        assert!(said.ends_with("all checks passed\n"), "{said}");
    }
}

#[test]
fn environments_pass_the_checks_of_gymnasium() {
    if let Some(said) = said("tests/check_environments.py", &[]) {
        assert!(said.ends_with("all checks passed\n"), "{said}");
    }
}

/// `SHARP_SOAK=1` tries 100,000 calls.
#[test]
fn whatever_arguments_are_given_python_raises_an_error_of_its_own() {
    let share = std::env::var("SHARP_SOAK").ok().and_then(|share| share.parse::<f64>().ok());
    let calls = share.map_or(1_500, |share| ((1e5 * share) as u64).max(1_500)).to_string();
    if let Some(said) = said("tests/check_arguments.py", &[Path::new(&calls)]) {
        println!("soak: {}", said.lines().next().unwrap_or_default());
        assert!(said.ends_with("all checks passed\n"), "{said}");
    }
}

#[test]
fn the_example_draws_its_pictures() {
    let folder = tempfile::tempdir().expect("a folder");
    if said("examples/first_steps.py", &[folder.path()]).is_none() {
        return;
    }
    for picture in ["plan.png", "drives.png", "odds.png"] {
        let bytes = fs::read(folder.path().join(picture)).expect(picture);
        assert!(bytes.starts_with(b"\x89PNG") && bytes.len() > 10_000, "{picture} is a picture");
    }
}

/// Stable-Baselines3 brings gigabytes of PyTorch, so it is a Python of one's own that has it.
#[test]
fn stable_baselines3_trains_on_an_option() {
    let Some(python) = std::env::var_os("SHARP_SB3_PYTHON").map(PathBuf::from) else {
        eprintln!("SKIPPED: SHARP_SB3_PYTHON names no Python that has stable-baselines3");
        return;
    };
    let folder = tempfile::tempdir().expect("a folder");
    let wheel = python::script(&python, &here().join("pack.py"), &[&library(), folder.path()]);
    let mut pip = Command::new(&python);
    pip.args(["-m", "pip", "install", "--quiet", "--no-index", "--no-deps", "--force-reinstall"]);
    assert!(pip.arg(wheel.trim()).status().expect("pip runs").success(), "the wheel installs");
    let said = python::script(&python, &here().join("tests/check_sb3.py"), &[]);
    assert!(said.ends_with("all checks passed\n"), "{said}");
}
