//! A real Slurm on one node: tasks killed, interrupted and lost with their node, and the same results.
//!
//! Runs as root where Slurm is installed and `SHARP_SLURM_UP` names a script that starts a cluster in
//! the folder it is given; a script `down.sh` beside it stops that cluster. Elsewhere the test says
//! that it skips.

#![cfg(unix)]
#![allow(clippy::disallowed_methods, reason = "a cluster is found in the environment and waited for")]

mod common;

use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Output, Stdio};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread::sleep;
use std::time::{Duration, Instant};

use crate::common::results;

/// Jobs 0 and 2 are SHARP, 1 and 3 a baseline.
const SUITE: [&str; 12] = [
    "smoke",
    "--methods",
    "sharp,track",
    "--options",
    "interface",
    "--trials",
    "2",
    "--problems",
    "2,4",
    "--episodes",
    "10",
    "--out",
];
/// Longest wait for anything on a machine that is busy with other things.
const PATIENCE: Duration = Duration::from_secs(180);

/// A running cluster, stopped when dropped.
struct Cluster {
    root: tempfile::TempDir,
    down: PathBuf,
    /// Clusters share the ports of the machine.
    _turn: MutexGuard<'static, ()>,
}

/// Held by the test that has a cluster.
static TURN: Mutex<()> = Mutex::new(());

impl Cluster {
    /// Starts a cluster, or says what is missing.
    fn start() -> Result<Self, String> {
        let up = std::env::var_os("SHARP_SLURM_UP").map(PathBuf::from).ok_or("SHARP_SLURM_UP is not set")?;
        if !["/usr/sbin", "/usr/bin"].iter().any(|folder| Path::new(folder).join("slurmctld").exists()) {
            return Err("slurmctld is not installed".into());
        }
        let user = Command::new("id").arg("-u").output().map_err(|error| error.to_string())?;
        if user.stdout.trim_ascii() != b"0" {
            return Err("only root can start a cluster".into());
        }
        let turn = TURN.lock().unwrap_or_else(PoisonError::into_inner);
        // The daemons run as several users.
        let everyone = fs::Permissions::from_mode(0o755);
        let root = tempfile::Builder::new().permissions(everyone).tempdir().expect("a folder");
        let cluster = Self { root, down: up.with_file_name("down.sh"), _turn: turn };
        let started = Command::new("bash").arg(&up).arg(cluster.root.path()).status().expect("bash runs");
        assert!(started.success(), "{} did not start a cluster", up.display());
        Ok(cluster)
    }

    fn conf(&self) -> PathBuf {
        self.root.path().join("etc/slurm.conf")
    }

    fn command(&self, program: &str, args: &[&str]) -> Command {
        let mut command = Command::new(program);
        command.args(args).env("SLURM_CONF", self.conf()).current_dir(self.root.path());
        command
    }

    fn sharp(&self, args: &[&str]) -> Output {
        self.command(env!("CARGO_BIN_EXE_sharp"), args).output().expect("the binary runs")
    }

    /// Submits what is not finished and returns the number of the array.
    fn submit(&self) -> String {
        let output = self.sharp(&["jobs", "submit", "slurm", "--slurm", "--pack", "0"]);
        let text = String::from_utf8_lossy(&output.stdout).into_owned();
        assert_eq!(output.status.code(), Some(0), "{output:?}");
        let array = text.split("array ").nth(1).and_then(|rest| rest.split(',').next());
        array.unwrap_or_else(|| panic!("no array in {text:?}")).to_owned()
    }

    /// What Slurm knows of `job`: `KEY=value` words.
    fn describe(&self, job: &str) -> String {
        let output = self.command("scontrol", &["--oneliner", "show", "job", job]).output();
        String::from_utf8_lossy(&output.expect("scontrol runs").stdout).into_owned()
    }

    fn is_queued(&self, job: &str) -> bool {
        let output = self.command("squeue", &["--noheader", "--jobs", job]).output();
        !output.expect("squeue runs").stdout.is_empty()
    }

    /// The process of the task that does job `index`, as soon as it runs and is not one of `before`.
    fn payload(&self, index: usize, before: &[u32]) -> u32 {
        self.payload_in(&self.root.path().join("slurm"), index, before)
    }

    /// The same in the folder `folder` or one below it.
    fn payload_in(&self, folder: &Path, index: usize, before: &[u32]) -> u32 {
        let block = format!("{index}..{}", index + 1);
        let is_ours = |pid: &u32| {
            let line = fs::read(format!("/proc/{pid}/cmdline")).unwrap_or_default();
            let words: Vec<&str> = line.split(|&byte| byte == 0).flat_map(std::str::from_utf8).collect();
            words.contains(&&*block) && words.iter().any(|word| Path::new(word).starts_with(folder))
        };
        wait_for(&format!("the task of job {index}"), || {
            let pids = fs::read_dir("/proc").expect("processes").flatten();
            let pids = pids.filter_map(|entry| entry.file_name().to_str()?.parse::<u32>().ok());
            pids.filter(|pid| !before.contains(pid)).find(is_ours)
        })
    }

    /// Ends the node as a power cut would: its daemon, the steps and the payloads in them.
    fn crash(&self, payload: u32) {
        let daemon =
            fs::read_to_string(self.root.path().join("run/slurmd.pid")).expect("the daemon's number");
        let daemon: u32 = daemon.trim().parse().expect("a number");
        for pid in [daemon, parent(payload), payload] {
            kill("-KILL", pid);
        }
    }

    /// Starts the daemon of the node again.
    fn boot(&self) -> Child {
        let host = Command::new("hostname").arg("-s").output().expect("hostname runs").stdout;
        let host = String::from_utf8_lossy(&host).trim().to_owned();
        let conf = self.conf().display().to_string();
        let mut daemon = self.command("setsid", &["/usr/sbin/slurmd", "-D", "-f", &conf, "-N", &host]);
        daemon.stdin(Stdio::null()).stdout(Stdio::null()).stderr(Stdio::null());
        daemon.spawn().expect("slurmd runs")
    }
}

impl Drop for Cluster {
    fn drop(&mut self) {
        let _ = Command::new("scancel").args(["--user", "root"]).env("SLURM_CONF", self.conf()).status();
        let _ = Command::new("bash").arg(&self.down).arg(self.root.path()).status();
    }
}

fn wait_for<T>(what: &str, mut look: impl FnMut() -> Option<T>) -> T {
    let begun = Instant::now();
    loop {
        if let Some(found) = look() {
            return found;
        }
        assert!(begun.elapsed() < PATIENCE, "waited too long for {what}");
        sleep(Duration::from_millis(100));
    }
}

fn kill(signal: &str, pid: u32) {
    let status = Command::new("kill").args([signal, &pid.to_string()]).status().expect("kill runs");
    assert!(status.success(), "{signal} to {pid}, which is gone");
}

fn parent(pid: u32) -> u32 {
    let status = fs::read_to_string(format!("/proc/{pid}/status")).expect("a running process");
    let line = status.lines().find_map(|line| line.strip_prefix("PPid:")).expect("every process has one");
    line.trim().parse().expect("a number")
}

#[test]
fn a_cluster_that_loses_tasks_ends_with_the_results_of_one_machine() {
    let cluster = match Cluster::start() {
        Ok(cluster) => cluster,
        Err(missing) => return println!("skipped: {missing}"),
    };
    let folder = cluster.root.path().to_owned();
    let plan = cluster.sharp(&[&["jobs", "plan"], &SUITE[..], &["slurm"]].concat());
    assert_eq!(plan.status.code(), Some(0), "{plan:?}");
    let array = cluster.submit();

    let killed = cluster.payload(0, &[]);
    kill("-KILL", killed);
    let interrupted = cluster.payload(2, &[]);
    sleep(Duration::from_millis(500));
    kill("-TERM", interrupted);
    let failed = || cluster.describe(&format!("{array}_0")).contains("JobState=FAILED").then_some(());
    wait_for("Slurm to notice the killed task", failed);
    let again = cluster.payload(2, &[interrupted]);
    assert!(cluster.describe(&format!("{array}_2")).contains("Restarts=1"), "exit code 75 is a requeue");

    sleep(Duration::from_millis(500));
    cluster.crash(again);
    let mut daemon = cluster.boot();
    // Slurm takes its time to believe it; meanwhile one machine does the same.
    let mut local =
        cluster.command(env!("CARGO_BIN_EXE_sharp"), &[&["eval"], &SUITE[..], &["local"]].concat());
    let local = local.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("the binary runs");
    cluster.payload(2, &[interrupted, again]);
    wait_for("the array", || (!cluster.is_queued(&array)).then_some(()));
    let early = cluster.sharp(&["jobs", "merge", "slurm"]);
    assert_eq!(early.status.code(), Some(3), "the killed job is missing: {early:?}");

    // What is missing is submitted again, and this time nothing happens to it.
    let array = cluster.submit();
    wait_for("the second array", || (!cluster.is_queued(&array)).then_some(()));
    let merged = || {
        let text = fs::read_to_string(folder.join("slurm/results.jsonl")).unwrap_or_default();
        (text.lines().count() == 8).then_some(())
    };
    wait_for("the merge that depends on it", merged);

    let local = local.wait_with_output().expect("a child");
    assert_eq!(local.status.code(), Some(0), "{local:?}");
    assert_eq!(results(&folder.join("slurm")), results(&folder.join("local")), "on the cluster, and here");
    assert_eq!(cluster.sharp(&["jobs", "merge", "slurm"]).status.code(), Some(0), "nothing is missing");
    drop(cluster);
    daemon.wait().expect("the daemon of the node has been stopped");
}

/// What a folder holds, by name below it.
fn tree(folder: &Path) -> Vec<(PathBuf, Vec<u8>)> {
    let mut files = Vec::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for entry in fs::read_dir(&next).expect("a folder") {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                folders.push(path);
            } else {
                let name = path.strip_prefix(folder).expect("below it").to_owned();
                files.push((name, fs::read(&path).expect("a file")));
            }
        }
    }
    files.sort();
    files
}

#[test]
fn a_building_learnt_on_a_cluster_that_loses_a_task_has_the_bytes_of_one_process() {
    let cluster = match Cluster::start() {
        Ok(cluster) => cluster,
        Err(missing) => return println!("skipped: {missing}"),
    };
    let folder = cluster.root.path().to_owned();
    let building = ["learn", "a", "--options", "centroid", "--within", "0,0,15,8", "--library"];
    let on_cluster = [&building[..], &["slurm", "--engine", "slurm", "--jobs", "3"]].concat();
    let mut learner = cluster.command(env!("CARGO_BIN_EXE_sharp"), &on_cluster);
    let learner = learner.stdout(Stdio::null()).stderr(Stdio::piped()).spawn().expect("the binary runs");
    let first_round = cluster.payload(1, &[]);
    // It may be over already: these lessons are short.
    let _ = Command::new("kill").args(["-KILL", &first_round.to_string()]).status();
    let second_round = cluster.payload(4, &[first_round]);
    let _ = Command::new("kill").args(["-KILL", &second_round.to_string()]).status();
    let learner = learner.wait_with_output().expect("a child");
    assert_eq!(learner.status.code(), Some(0), "{learner:?}");

    let here = cluster.sharp(&[&building[..], &["local"]].concat());
    assert_eq!(here.status.code(), Some(0), "{here:?}");
    let threads = cluster.sharp(&[&building[..], &["threads", "--jobs", "2"]].concat());
    assert_eq!(threads.status.code(), Some(0), "{threads:?}");
    let names = |name: &str| tree(&folder.join(name)).into_iter().map(|file| file.0).collect::<Vec<_>>();
    assert_eq!(names("slurm"), names("local"));
    for other in ["slurm", "threads"] {
        assert!(tree(&folder.join(other)) == tree(&folder.join("local")), "{other} and one process");
    }
}
