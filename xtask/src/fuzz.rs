//! `cargo xtask fuzz`: files and lines that libFuzzer makes up, read by whatever reads files and lines.
//!
//! The targets are the programs in `tests/fuzz`. Each begins with what the project ships, with what `tests/fuzz/seeds` holds, with the real
//! maps that `SHARP_REAL_MAPS` names, and with what earlier runs found interesting (`target/fuzz/corpus`). What breaks
//! a target lies in `target/fuzz/artifacts` afterwards.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use anyhow::{Context, bail};

use crate::process::{cargo, exit_code, flag};
use crate::tree;

/// Coverage as libFuzzer wants it; a stable compiler has it.
const RUSTFLAGS: &str = "--cfg fuzzing -Cpasses=sancov-module -Cllvm-args=-sanitizer-coverage-level=4 \
    -Cllvm-args=-sanitizer-coverage-inline-8bit-counters -Cllvm-args=-sanitizer-coverage-pc-table \
    -Cllvm-args=-sanitizer-coverage-trace-compares -Ccodegen-units=1";

/// Memory above which a target fails, megabytes: what a map may take, and the fuzzer's own.
const MEMORY_MAX_MB: u32 = 1500;
/// An input that takes longer is a finding, seconds. Instrumented code is several times slower.
const SECONDS_MAX: u32 = 10;
/// Larger files are no seeds: small ones are changed at more interesting places.
const SEED_MAX_BYTES: u64 = 64 << 10;
const SECONDS: u32 = 20;
/// The random seed of the step: with one of its own each time, a change would fail for an input that it has nothing to do with.
const STEP_SEED: u32 = 1;

/// A program of `tests/fuzz`.
struct FuzzTarget {
    name: &'static str,
    /// Folders of the repository, and endings, whose files are seeds.
    assets: &'static [(&'static str, &'static str)],
    /// Endings of the real maps that are seeds.
    real: &'static [&'static str],
}

const TARGETS: [FuzzTarget; 13] = [
    FuzzTarget { name: "map_yaml", assets: &[], real: &["yaml"] },
    FuzzTarget { name: "map_image", assets: &[], real: &["pgm", "png"] },
    FuzzTarget { name: "movingai_map", assets: &[], real: &["map"] },
    FuzzTarget { name: "movingai_scenario", assets: &[], real: &["scen"] },
    FuzzTarget { name: "floor_plan", assets: &[("crates/sharp-maps/assets", "ron")], real: &[] },
    FuzzTarget { name: "robot", assets: &[("crates/sharp-sim/assets/robots", "ron")], real: &[] },
    FuzzTarget { name: "noise", assets: &[("crates/sharp-sim/assets/noise", "ron")], real: &[] },
    FuzzTarget { name: "weights", assets: &[("crates/sharp-drive/assets", "safetensors")], real: &[] },
    FuzzTarget { name: "library", assets: &[], real: &[] },
    FuzzTarget { name: "plan", assets: &[], real: &[] },
    FuzzTarget { name: "abstraction", assets: &[], real: &[] },
    FuzzTarget { name: "serve_line", assets: &[], real: &[] },
    FuzzTarget { name: "robot_import", assets: &[], real: &["yaml", "urdf", "xacro"] },
];

/// Builds and runs the targets that `args` name, all by default, each for `--seconds` (20).
///
/// # Errors
/// Returns an error if a name is unknown, or cargo or a target cannot be started.
pub(crate) fn run(args: &[String]) -> anyhow::Result<u8> {
    let seconds: u32 = match flag(args, "--seconds") {
        Some(text) => text.parse().with_context(|| format!("--seconds is {text}, expected a number"))?,
        None => SECONDS,
    };
    let is_value = |index: usize| index > 0 && args[index - 1] == "--seconds";
    let names = args.iter().enumerate().filter(|(index, arg)| !arg.starts_with("--") && !is_value(*index));
    let names: Vec<&String> = names.map(|(_, name)| name).collect();
    if let Some(name) = names.iter().find(|name| !TARGETS.iter().any(|target| target.name == name.as_str())) {
        let known = TARGETS.map(|target| target.name).join(", ");
        bail!("no target is called {name}, there are {known}");
    }
    let is_wanted = |target: &&FuzzTarget| names.is_empty() || names.iter().any(|name| *name == target.name);
    run_targets(&TARGETS.iter().filter(is_wanted).collect::<Vec<_>>(), seconds, None)
}

/// The step of `cargo xtask ci`: every target for 20 seconds, with the same random numbers each time.
///
/// # Errors
/// Returns an error if cargo or a target cannot be started.
pub(crate) fn step() -> anyhow::Result<u8> {
    run_targets(&TARGETS.iter().collect::<Vec<_>>(), SECONDS, Some(STEP_SEED))
}

fn run_targets(targets: &[&FuzzTarget], seconds: u32, seed: Option<u32>) -> anyhow::Result<u8> {
    let host = host()?;
    let mut build = cargo(&["build", "--release", "--locked", "--target", &host]);
    // With a target of its own, programs that run while building are not instrumented.
    build.current_dir(source()).env("RUSTFLAGS", RUSTFLAGS).env("CARGO_TARGET_DIR", work());
    let code = exit_code(&mut build)?;
    if code != 0 {
        return Ok(code);
    }
    let mut broken = Vec::new();
    for target in targets {
        eprintln!("\n--- {} for {seconds} s", target.name);
        if run_target(target, &host, seconds, seed)? != 0 {
            broken.push(target.name);
        }
    }
    if broken.is_empty() {
        eprintln!("fuzz: {} targets, nothing found", targets.len());
        return Ok(0);
    }
    eprintln!("fuzz: {} FAILED, see {}", broken.join(", "), work().join("artifacts").display());
    Ok(1)
}

/// Runs one target on its corpus for some seconds, with random numbers of its own where no `seed` is given; returns its exit code.
fn run_target(target: &FuzzTarget, host: &str, seconds: u32, seed: Option<u32>) -> anyhow::Result<u8> {
    let folder = |kind: &str| -> anyhow::Result<PathBuf> {
        let folder = work().join(kind).join(target.name);
        fs::create_dir_all(&folder).with_context(|| format!("cannot make {}", folder.display()))?;
        Ok(folder)
    };
    let (corpus, artifacts, seeds) = (folder("corpus")?, folder("artifacts")?, folder("seeds")?);
    let files = files_folder(target.name);
    fs::create_dir_all(&files).with_context(|| format!("cannot make {}", files.display()))?;
    gather(target, &seeds)?;
    let mut command = Command::new(work().join(host).join("release").join(target.name));
    command.args([&corpus, &seeds]).current_dir(&files).env("TMPDIR", &files).env("FUZZ_SEEDS", &seeds);
    command.args([
        format!("-max_total_time={seconds}"),
        format!("-timeout={SECONDS_MAX}"),
        format!("-rss_limit_mb={MEMORY_MAX_MB}"),
        format!("-artifact_prefix={}/", artifacts.display()),
        format!("-max_len={}", 2 * SEED_MAX_BYTES),
        "-print_final_stats=1".to_owned(),
        "-verbosity=0".to_owned(),
        "-print_funcs=0".to_owned(),
    ]);
    if let Some(seed) = seed {
        command.arg(format!("-seed={seed}"));
    }
    let dictionary = source().join("seeds").join(format!("{}.dict", target.name));
    if dictionary.exists() {
        command.arg(format!("-dict={}", dictionary.display()));
    }
    let code = exit_code(&mut command)?;
    fs::remove_dir_all(&files).with_context(|| format!("cannot clear {}", files.display()))?;
    Ok(code)
}

/// Where a target puts its files: in memory where there is such a folder, because each is waited for until it is on disk.
fn files_folder(target: &str) -> PathBuf {
    let memory = Path::new("/dev/shm");
    let folder = if memory.is_dir() { memory.to_owned() } else { work() };
    folder.join(format!("fuzz-{target}-{}", std::process::id()))
}

/// Copies the seeds of `target` into `folder`.
fn gather(target: &FuzzTarget, folder: &Path) -> anyhow::Result<()> {
    let own = source().join("seeds").join(target.name);
    let mut found: Vec<PathBuf> = files_below(&own)?;
    for (assets, ending) in target.assets {
        found.extend(files_below(&tree::root().join(assets))?.into_iter().filter(|path| ends(path, ending)));
    }
    if let Some(real) = std::env::var_os("SHARP_REAL_MAPS") {
        let real = files_below(Path::new(&real))?;
        found.extend(real.into_iter().filter(|path| target.real.iter().any(|ending| ends(path, ending))));
    }
    for (number, path) in found.iter().enumerate() {
        let size = fs::metadata(path).map_or(0, |metadata| metadata.len());
        if size <= 2 * SEED_MAX_BYTES {
            let name = path.file_name().unwrap_or_default().to_string_lossy();
            let copy = folder.join(format!("{number:02}-{name}"));
            fs::copy(path, copy).with_context(|| format!("cannot copy {}", path.display()))?;
        }
    }
    Ok(())
}

fn ends(path: &Path, ending: &str) -> bool {
    path.extension().is_some_and(|found| found == ending)
}

/// All files below `folder`, sorted; none if there is no such folder.
fn files_below(folder: &Path) -> anyhow::Result<Vec<PathBuf>> {
    if !folder.exists() {
        return Ok(vec![]);
    }
    let mut files = Vec::new();
    for entry in fs::read_dir(folder).with_context(|| format!("cannot list {}", folder.display()))? {
        let path = entry.with_context(|| format!("cannot list {}", folder.display()))?.path();
        if path.is_dir() {
            files.extend(files_below(&path)?);
        } else {
            files.push(path);
        }
    }
    files.sort();
    Ok(files)
}

/// The workspace of the targets.
pub(crate) fn source() -> PathBuf {
    tree::root().join("tests/fuzz")
}

/// Where everything that is built or found goes.
fn work() -> PathBuf {
    tree::root().join("target/fuzz")
}

/// The machine that the compiler runs on, as it names it.
fn host() -> anyhow::Result<String> {
    let output = Command::new("rustc").arg("-vV").output().context("cannot start rustc")?;
    let text = String::from_utf8_lossy(&output.stdout);
    let host = text.lines().find_map(|line| line.strip_prefix("host: "));
    Ok(host.context("rustc does not name its host")?.to_owned())
}
