//! A Python with the packages that tests compare with, in a virtual environment under `target`.

use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// The interpreter of a virtual environment that has what `requirements` lists, or `None`, said on stderr, where there
/// is no Python or no package index. It is made once and kept; two test programs may ask at once.
pub(crate) fn python(requirements: &Path) -> Option<PathBuf> {
    let target = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../target/python");
    fs::create_dir_all(&target).expect("a folder under target");
    let wanted = fs::read_to_string(requirements).expect("the list of packages");
    let name = wanted.bytes().fold(5381_u64, |hash, byte| hash.wrapping_mul(33) ^ u64::from(byte));
    let (folder, done) = (target.join(format!("{name:016x}")), target.join(format!("{name:016x}.done")));
    let lock = File::create(target.join("lock")).expect("a lock file");
    lock.lock().expect("one at a time");
    let python = folder.join("bin/python");
    if !done.exists() {
        let made = ran(Command::new("python3").args(["-m", "venv", "--clear"]).arg(&folder));
        let install = ["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--retries", "1"];
        let filled = || ran(Command::new(&python).args(install).arg("--requirement").arg(requirements));
        if !made || !filled() {
            eprintln!("SKIPPED: no Python with {}: no python3, or no package index", requirements.display());
            return None;
        }
        fs::write(&done, "").expect("a mark");
    }
    Some(python)
}

/// What `script` prints when `python` runs it with `args`; panics with what it says where it fails.
pub(crate) fn script(python: &Path, script: &Path, args: &[&Path]) -> String {
    let output = Command::new(python).arg(script).args(args).output().expect("Python runs");
    let Output { status, stdout, stderr } = output;
    assert!(status.success(), "{} fails: {}", script.display(), String::from_utf8_lossy(&stderr));
    String::from_utf8_lossy(&stdout).into_owned()
}

fn ran(command: &mut Command) -> bool {
    match command.output() {
        Ok(output) if output.status.success() => true,
        Ok(output) => {
            eprintln!("{command:?}: {}", String::from_utf8_lossy(&output.stderr));
            false
        }
        Err(error) => {
            eprintln!("{command:?}: {error}");
            false
        }
    }
}
