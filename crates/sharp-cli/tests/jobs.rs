//! Jobs as clusters treat them: killed, started twice, run at once, and merged.

#![allow(clippy::disallowed_methods, reason = "when to kill is a matter of time, how often one of patience")]

mod common;

use std::fs;
use std::path::Path;
use std::process::{Child, Command, Output, Stdio};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError};
use std::thread::sleep;
use std::time::{Duration, Instant};

use serde_json::Value;

use crate::common::results;

/// Two problems on one library, and a baseline: a few seconds.
const SUITE: [&str; 10] = [
    "smoke",
    "--methods",
    "sharp,track",
    "--options",
    "interface",
    "--problems",
    "4,5",
    "--episodes",
    "5",
    "--out",
];

/// One test at a time: times are measured, and kills follow them.
fn alone() -> MutexGuard<'static, ()> {
    static ALONE: Mutex<()> = Mutex::new(());
    ALONE.lock().unwrap_or_else(PoisonError::into_inner)
}

fn command(folder: &Path, args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_sharp"));
    command.args(args).current_dir(folder).stdout(Stdio::piped()).stderr(Stdio::piped());
    for name in ["SLURM_JOB_ID", "SLURM_ARRAY_TASK_ID", "JOB_COMPLETION_INDEX"] {
        command.env_remove(name);
    }
    command
}

fn sharp(folder: &Path, args: &[&str]) -> Output {
    command(folder, args).output().expect("the binary runs")
}

fn eval(folder: &Path, out: &str) -> Output {
    sharp(folder, &[&["eval"], &SUITE[..], &[out]].concat())
}

/// The results of the suite when nothing happens to it, and how long that takes.
fn undisturbed() -> &'static (Vec<Value>, Duration) {
    static RESULTS: OnceLock<(Vec<Value>, Duration)> = OnceLock::new();
    RESULTS.get_or_init(|| {
        let folder = tempfile::tempdir().expect("a folder");
        let begun = Instant::now();
        let output = eval(folder.path(), "out");
        assert_eq!(output.status.code(), Some(0), "{output:?}");
        let results = results(&folder.path().join("out"));
        assert_eq!(results.len(), 4, "two problems, two methods: {results:?}");
        (results, begun.elapsed())
    })
}

/// Numbers in 0..1 that look like chance and are the same every time.
fn moments() -> impl Iterator<Item = f64> {
    (1_u32..).map(|number| (f64::from(number) * 0.618_034).fract())
}

/// `SHARP_KILLS=20 cargo test --release --workspace killed_at` kills more often.
#[test]
fn killed_at_any_moment_a_suite_ends_with_the_same_results() {
    let _alone = alone();
    let (expected, takes) = undisturbed();
    let kills = std::env::var("SHARP_KILLS").ok().and_then(|kills| kills.parse().ok()).unwrap_or(3);
    let folder = tempfile::tempdir().expect("a folder");
    let mut struck = 0;
    for moment in moments().take(kills) {
        let args = [&["eval"], &SUITE[..], &["out"]].concat();
        let mut child = command(folder.path(), &args).spawn().expect("the binary runs");
        sleep(takes.mul_f64(moment));
        struck += usize::from(child.try_wait().expect("a child").is_none());
        child.kill().expect("a child");
        child.wait().expect("a child");
    }
    assert!(struck > 0, "it was over before every one of {kills} kills");
    let output = eval(folder.path(), "out");
    assert_eq!(output.status.code(), Some(0), "{output:?}");
    assert_eq!(&results(&folder.path().join("out")), expected, "after {struck} of {kills} kills");
    let left = fs::read_dir(folder.path().join("out/jobs")).expect("jobs").flat_map(|job| {
        fs::read_dir(job.expect("a job").path()).expect("a folder").map(|step| step.expect("a step"))
    });
    let left: Vec<_> =
        left.map(|step| step.file_name()).filter(|name| name != "p4" && name != "p5").collect();
    assert!(left.is_empty(), "nothing unfinished stays: {left:?}");
}

#[test]
fn jobs_run_in_any_order_at_once_and_twice() {
    let _alone = alone();
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    let plan = sharp(folder, &[&["jobs", "plan"], &SUITE[..], &["out"]].concat());
    assert_eq!(plan.status.code(), Some(0), "{plan:?}");
    let manifest = fs::read(folder.join("out/manifest.jsonl")).expect("a manifest");

    // An array's task does the job of its number.
    let task = command(folder, &["jobs", "run", "out"]).env("SLURM_ARRAY_TASK_ID", "1").output();
    assert_eq!(task.expect("the binary runs").status.code(), Some(0), "the baseline");
    let early = sharp(folder, &["jobs", "merge", "out"]);
    assert_eq!(early.status.code(), Some(3), "{early:?}");
    let message = String::from_utf8_lossy(&early.stderr).into_owned();
    assert!(
        message.contains("job 0 (a-husky-interface-") && message.contains("problem 4 is missing"),
        "{message}"
    );

    let block = ["jobs", "run", "out", "--index", "0..2"];
    let both: Vec<Child> =
        (0..2).map(|_| command(folder, &block).spawn().expect("the binary runs")).collect();
    for child in both {
        let output = child.wait_with_output().expect("a child");
        assert_eq!(output.status.code(), Some(0), "{output:?}");
    }
    assert_eq!(sharp(folder, &["jobs", "merge", "out"]).status.code(), Some(0), "all is there");
    assert_eq!(results(&folder.join("out")), undisturbed().0, "the same as of sharp eval");

    let once = fs::read(folder.join("out/results.jsonl")).expect("results");
    assert_eq!(sharp(folder, &block).status.code(), Some(0), "nothing left to do");
    sharp(folder, &[&["jobs", "plan"], &SUITE[..], &["out"]].concat());
    assert_eq!(sharp(folder, &["jobs", "merge", "out"]).status.code(), Some(0), "merged again");
    assert_eq!(fs::read(folder.join("out/results.jsonl")).expect("results"), once, "the same to the byte");
    assert_eq!(fs::read(folder.join("out/manifest.jsonl")).expect("a manifest"), manifest, "so is the plan");
}

#[test]
fn who_is_asked_to_stop_says_how_to_go_on() {
    let _alone = alone();
    let folder = tempfile::tempdir().expect("a folder");
    let folder = folder.path();
    sharp(folder, &[&["jobs", "plan"], &SUITE[..], &["out"]].concat());
    for (job, expected) in [(None, 130), (Some("7"), 75)] {
        let mut run = command(folder, &["jobs", "run", "out", "--index", "0"]);
        run.envs(job.map(|job| ("SLURM_JOB_ID", job)));
        let child = run.spawn().expect("the binary runs");
        sleep(Duration::from_millis(400));
        let asked = Command::new("kill").args(["-TERM", &child.id().to_string()]).status();
        assert!(asked.expect("kill runs").success(), "it was over too soon");
        let output = child.wait_with_output().expect("a child");
        assert_eq!(output.status.code(), Some(expected), "{output:?}");
    }
    for (args, code, expected) in [
        (["jobs", "run", "out"].as_slice(), 2, "--index is missing"),
        (&["jobs", "run", "out", "--index", "2..1"], 2, "expected N, or N..M"),
        (&["jobs", "run", "out", "--index", "9"], 2, "job 9 does not exist, there are 2"),
        (&["jobs", "run", "elsewhere", "--index", "0"], 2, "there is no manifest"),
        (&["jobs", "submit", "out", "--slurm", "--dry-run"], 0, ""),
    ] {
        let output = sharp(folder, args);
        assert_eq!(output.status.code(), Some(code), "{args:?}: {output:?}");
        let message = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(message.contains(expected), "{args:?}: {message}");
    }
    let script = fs::read_to_string(folder.join("out/slurm/array.sh")).expect("the script of the dry run");
    assert!(script.contains("#SBATCH --array=0-0\n") && script.contains("blocks=(0..2)\n"), "{script}");
}
