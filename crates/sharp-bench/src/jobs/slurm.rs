//! The Slurm engine: unfinished jobs as one array, and a merge that waits for it.
//!
//! Slurm starts a few tasks a second at best, so that short jobs are packed into tasks of minutes. A task
//! is `sharp jobs run` on a block of jobs: interrupted, it exits with 75, which a site lists under
//! `RequeueExit`, and goes on where it was. A task that was killed outright is submitted again by the
//! next `sharp jobs submit`, which looks at what is there and not at what a queue remembers.

use std::fmt::Write;
use std::ops::Range;
use std::path::{Path, PathBuf, absolute};
use std::process::{Command, Output};
use std::thread::sleep;
use std::time::Duration;

use sharp_plan::write_atomic;

use super::engine::{Engine, EngineMonitor};
use super::manifest::{Job, Manifest};
use super::merge::{count_results, unfinished};
use crate::error::BenchError;
use crate::shell::shell_word;

/// Seconds before the end of a task's time at which it is asked to stop: enough to write what is done.
const WARNING_S: u32 = 30;

/// Times that jobs which a cluster lost are submitted.
const ROUNDS: usize = 3;
/// Expected length of a task, seconds.
const PACK_S: f64 = 600.0;
/// Between two looks at the queue.
const LOOK: Duration = Duration::from_secs(2);

/// Jobs as tasks of a Slurm cluster, all nodes of which see the manifest's folder and the program.
#[derive(Clone, Debug)]
pub struct SlurmEngine {
    /// The `sharp` command, which does a block of jobs with `jobs run`.
    pub program: PathBuf,
}

impl Engine for SlurmEngine {
    /// Submits what is not finished, waits, and submits again what the cluster lost.
    fn run(
        &self,
        manifest: &Manifest,
        indices: &[usize],
        monitor: &dyn EngineMonitor,
    ) -> Result<Vec<BenchError>, BenchError> {
        let jobs = indices.iter().map(|&index| manifest.job(index)).collect::<Result<Vec<_>, _>>()?;
        let weight_s: f64 = jobs.iter().map(|job| job.weight_s).sum();
        // Tasks of minutes, but some of them even for a small suite.
        let pack_s = PACK_S.min(weight_s / 16.0);
        let submission = Submission { array_limit: None, time_min: None, pack_s, sbatch: vec![] };
        for _ in 0..ROUNDS {
            let open: Vec<usize> =
                unfinished(manifest).into_iter().filter(|index| indices.contains(index)).collect();
            if open.is_empty() {
                break;
            }
            let cluster = SlurmScripts::write(&self.program, manifest, &open, &submission)?;
            let array = cluster.submit()?;
            let (tasks, logs) = (cluster.tasks, cluster.logs());
            monitor.message(&format!("array {array} of {tasks} tasks, logs in {}", logs.display()));
            while is_queued(&array)? {
                if monitor.should_stop() {
                    monitor.message(&format!("array {array} goes on; this call again finds what it made"));
                    return Ok(vec![]);
                }
                monitor.results_so_far(count_results(manifest, indices));
                sleep(LOOK);
            }
        }
        Ok(vec![])
    }
}

/// How jobs are handed over.
#[derive(Clone, Debug)]
pub struct Submission {
    /// Tasks at once.
    pub array_limit: Option<u32>,
    /// Wall time of a task, minutes.
    pub time_min: Option<u32>,
    /// Expected length of a task, seconds.
    pub pack_s: f64,
    /// What else sbatch is told.
    pub sbatch: Vec<String>,
}

/// The scripts for one folder.
#[derive(Clone, Debug)]
pub struct SlurmScripts {
    dir: PathBuf,
    /// The script of the array.
    pub array: PathBuf,
    /// The script of the merge.
    pub merge: PathBuf,
    /// Number of tasks.
    pub tasks: usize,
    sbatch: Vec<String>,
}

impl SlurmScripts {
    /// Writes the scripts with which `program` does the jobs `indices` (ascending) of `manifest`.
    ///
    /// # Errors
    /// Returns an error if they cannot be written.
    pub fn write(
        program: &Path,
        manifest: &Manifest,
        indices: &[usize],
        submission: &Submission,
    ) -> Result<Self, BenchError> {
        let dir = absolute(&manifest.dir)
            .map_err(|error| BenchError::Folder(format!("{}: {error}", manifest.dir.display())))?;
        let jobs: Vec<&Job> = indices.iter().map(|&index| &manifest.jobs[index]).collect();
        if let Some(minutes) = submission.time_min {
            check_time(&jobs, minutes)?;
        }
        let blocks = blocks(&jobs, submission.pack_s);
        let folder = dir.join("slurm");
        let (array, merge) = (folder.join("array.sh"), folder.join("merge.sh"));
        write_atomic(&array, array_script(program, &dir, &blocks, submission).as_bytes())?;
        write_atomic(&merge, merge_script(program, &dir).as_bytes())?;
        Ok(Self { dir, array, merge, tasks: blocks.len(), sbatch: submission.sbatch.clone() })
    }

    /// Submits the array and returns its number.
    ///
    /// # Errors
    /// Returns an error that says what sbatch said.
    pub fn submit(&self) -> Result<String, BenchError> {
        self.sbatch(&self.array, &[])
    }

    /// Submits the merge, which begins when every task of the array `id` has succeeded.
    ///
    /// # Errors
    /// Returns an error that says what sbatch said.
    pub fn submit_merge(&self, id: &str) -> Result<String, BenchError> {
        let after = format!("--dependency=afterok:{id}");
        self.sbatch(&self.merge, &[&after, "--kill-on-invalid-dep=yes"])
    }

    fn sbatch(&self, script: &Path, extra: &[&str]) -> Result<String, BenchError> {
        let mut command = Command::new("sbatch");
        command.arg("--parsable").args(&self.sbatch).args(extra).arg(script);
        let output = output(&mut command)?;
        let said = |bytes: &[u8]| String::from_utf8_lossy(bytes).trim().to_owned();
        if !output.status.success() {
            let script = script.display();
            return Err(BenchError::Slurm(format!("sbatch {script}: {}", said(&output.stderr))));
        }
        let id = said(&output.stdout);
        // With several clusters the name of the cluster follows.
        Ok(id.split(';').next().unwrap_or_default().to_owned())
    }

    /// Where the tasks write what they say.
    pub fn logs(&self) -> PathBuf {
        self.dir.join("slurm")
    }
}

/// Returns true while Slurm has tasks of the array `id` that wait or run.
///
/// # Errors
/// Returns an error if squeue cannot be started.
fn is_queued(id: &str) -> Result<bool, BenchError> {
    let output = output(Command::new("squeue").args(["--noheader", "--format=%i", "--jobs", id]))?;
    // A job that is over for some minutes is unknown, which is an error of squeue. One that cannot ask
    // because the controller is away says so otherwise.
    let text = String::from_utf8_lossy(&output.stderr);
    Ok(if output.status.success() { !output.stdout.is_empty() } else { !text.contains("Invalid job id") })
}

/// What `command` says.
fn output(command: &mut Command) -> Result<Output, BenchError> {
    let name = command.get_program().to_string_lossy().into_owned();
    command.output().map_err(|error| BenchError::Slurm(format!("cannot start {name}: {error}")))
}

/// A problem is done whole or again: a task must have time for one, or it would begin it for ever.
fn check_time(jobs: &[&Job], minutes: u32) -> Result<(), BenchError> {
    let problem_s = |job: &&&Job| job.weight_s / job.work.problems().len().max(1) as f64;
    let Some(longest) = jobs.iter().max_by(|a, b| problem_s(a).total_cmp(&problem_s(b))) else {
        return Ok(());
    };
    let needed_s = problem_s(&longest) + f64::from(WARNING_S);
    if 60.0 * f64::from(minutes) > needed_s {
        return Ok(());
    }
    let name = &longest.name;
    let needed_min = (needed_s / 60.0).ceil();
    let problem =
        format!("{minutes} min, a problem of job {name} is expected to take {needed_min:.0} minutes");
    Err(BenchError::Setting { setting: "time", problem })
}

/// Ranges of consecutive jobs, each expected to take `pack_s` at least if there are enough.
fn blocks(jobs: &[&Job], pack_s: f64) -> Vec<Range<usize>> {
    let mut blocks: Vec<Range<usize>> = Vec::new();
    let mut weight_s = f64::INFINITY;
    for job in jobs {
        match blocks.last_mut() {
            Some(block) if block.end == job.index && weight_s + job.weight_s <= pack_s => {
                block.end += 1;
                weight_s += job.weight_s;
            }
            _ => {
                blocks.push(job.index..job.index + 1);
                weight_s = job.weight_s;
            }
        }
    }
    blocks
}

fn array_script(program: &Path, dir: &Path, blocks: &[Range<usize>], submission: &Submission) -> String {
    let limit = submission.array_limit.map_or(String::new(), |limit| format!("%{limit}"));
    let mut options = vec![
        "--job-name=sharp".to_owned(),
        format!("--array=0-{}{limit}", blocks.len().saturating_sub(1)),
        "--ntasks=1".to_owned(),
        "--cpus-per-task=1".to_owned(),
        "--requeue".to_owned(),
        "--open-mode=append".to_owned(),
        format!("--output={}", quoted(&dir.join("slurm/task-%A_%a.log"))),
    ];
    if let Some(minutes) = submission.time_min {
        options.push(format!("--time={minutes}"));
        options.push(format!("--signal=B:TERM@{WARNING_S}"));
    }
    let blocks: Vec<String> = blocks.iter().map(|block| format!("{}..{}", block.start, block.end)).collect();
    let mut script = head(&options);
    // Writing to a string cannot fail.
    let _ = writeln!(script, "blocks=({})", blocks.join(" "));
    let _ = writeln!(
        script,
        "exec {} --threads 1 jobs run {} --index \"${{blocks[$SLURM_ARRAY_TASK_ID]}}\"",
        quoted(program),
        quoted(dir)
    );
    script
}

fn merge_script(program: &Path, dir: &Path) -> String {
    let options = [
        "--job-name=sharp-merge".to_owned(),
        "--ntasks=1".to_owned(),
        "--open-mode=append".to_owned(),
        format!("--output={}", quoted(&dir.join("slurm/merge-%j.log"))),
    ];
    head(&options) + &format!("exec {} jobs merge {}\n", quoted(program), quoted(dir))
}

fn head(options: &[String]) -> String {
    let options: String = options.iter().map(|option| format!("#SBATCH {option}\n")).collect();
    format!("#!/bin/bash\n{options}")
}

/// `path` as one word of a shell.
fn quoted(path: &Path) -> String {
    shell_word(&path.display().to_string())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::jobs::Experiment;

    fn manifest(dir: &Path, trials: u32) -> Manifest {
        let experiments = (0..trials).map(|trial| Experiment { trial, ..Experiment::example() }).collect();
        Manifest::extend(dir, experiments, "call").expect("a plan").0
    }

    #[test]
    fn short_jobs_are_packed_and_gaps_are_kept() {
        let folder = tempfile::tempdir().expect("a folder");
        let manifest = manifest(folder.path(), 7);
        let each_s = manifest.jobs[0].weight_s;
        let jobs: Vec<&Job> = manifest.jobs.iter().filter(|job| job.index != 3).collect();
        assert_eq!(blocks(&jobs, 2.5 * each_s), [0..2, 2..3, 4..6, 6..7], "two fit, job 3 is done");
        assert_eq!(blocks(&jobs, 1e9), [0..3, 4..7], "all fit");
        assert_eq!(blocks(&jobs, 0.0).len(), 6, "none fits with another");
        assert!(blocks(&[], 1.0).is_empty(), "nothing to do");
    }

    #[test]
    fn a_task_has_time_for_one_problem_at_least() {
        let folder = tempfile::tempdir().expect("a folder");
        let mut manifest = manifest(folder.path(), 1);
        manifest.jobs[0].weight_s = 2.0 * 2400.0;
        let jobs: Vec<&Job> = manifest.jobs.iter().collect();
        assert!(check_time(&jobs, 41).is_ok(), "two problems of 40 minutes, one after the other");
        let message = check_time(&jobs, 40).expect_err("too short").to_string();
        assert!(message.ends_with("is expected to take 41 minutes"), "{message}");
    }

    #[test]
    fn the_script_says_what_a_task_does() {
        let submission = Submission {
            array_limit: Some(8),
            time_min: Some(90),
            pack_s: 600.0,
            sbatch: vec!["--partition=long".into()],
        };
        let script = array_script(Path::new("/opt/sharp"), Path::new("/my runs"), &[0..3, 3..4], &submission);
        let expected = "#!/bin/bash\n#SBATCH --job-name=sharp\n#SBATCH --array=0-1%8\n#SBATCH --ntasks=1\n\
             #SBATCH --cpus-per-task=1\n#SBATCH --requeue\n#SBATCH --open-mode=append\n\
             #SBATCH --output='/my runs/slurm/task-%A_%a.log'\n#SBATCH --time=90\n\
             #SBATCH --signal=B:TERM@30\nblocks=(0..3 3..4)\n\
             exec /opt/sharp --threads 1 jobs run '/my runs' --index \"${blocks[$SLURM_ARRAY_TASK_ID]}\"\n";
        assert_eq!(script, expected);
        let merge = merge_script(Path::new("/opt/sharp"), Path::new("/runs"));
        assert!(merge.ends_with("exec /opt/sharp jobs merge /runs\n"), "{merge}");
    }
}
