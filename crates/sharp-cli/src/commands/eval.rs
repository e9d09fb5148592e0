//! `sharp eval`: suites of problems, one JSON line a result, and a report.
//!
//! Planning, running and merging of jobs in one call: what it leaves is what `sharp jobs` leaves.

use std::path::PathBuf;
use std::time::Duration;

use sharp_bench::{ReportInput, ResultLine, read_baselines, row_text};

use crate::args::{Engine, Eval};
use crate::jobs::{
    Cluster, Job, Manifest, Merged, Submission, clean, command, count_results, is_queued, merge, run_jobs,
    specs, unfinished,
};
use crate::outcome::{Exit, Failure, say, to_json};
use crate::progress::{bar, is_interrupted};

/// Times that jobs which a cluster lost are submitted.
const ROUNDS: usize = 3;
/// Expected length of a task, seconds.
const PACK_S: f64 = 600.0;
/// Between two looks at the queue.
const LOOK: Duration = Duration::from_secs(2);

pub(crate) fn run(args: &Eval, seed: u64, json: bool) -> Result<Exit, Failure> {
    let extra = args.baselines.as_deref().map(read_baselines).transpose()?.unwrap_or_default();
    let command = command("eval", &args.selection, seed) + &format!(" --out {}", args.out.display());
    let (manifest, indices) = Manifest::extend(&args.out, specs(&args.selection, seed)?, &command)?;
    match args.engine {
        Engine::Local => run_here(args, &manifest, &indices),
        Engine::Slurm => run_on_cluster(&manifest, &indices)?,
    }
    let merged = merge(&manifest)?;
    if is_interrupted() {
        eprintln!("interrupted; the same call goes on with {} results", merged.lines().count());
        return Ok(Exit::Interrupted);
    }
    let page = write_report(&manifest, &merged, &extra)?;
    let lines: Vec<&ResultLine> =
        indices.iter().flat_map(|&index| &merged.results[index]).map(|done| &done.line).collect();
    if json {
        for line in &lines {
            say!("{}", to_json(line));
        }
    } else {
        let of_sharp: Vec<&ResultLine> = lines.iter().copied().filter(|line| line.is_of_sharp()).collect();
        say!("{}\n{}", sharp_bench::table(&of_sharp), sharp_bench::totals(&lines));
        say!("results in {}, plans and pictures in {}", show(args, "results.jsonl"), show(args, "jobs"));
        say!("report in {}", page.display());
    }
    if merged.missing.iter().any(|(index, _)| indices.contains(index)) {
        return Ok(Exit::Partial);
    }
    clean(&manifest);
    Ok(Exit::Done)
}

/// Writes the report of everything in the folder of `manifest`, and of `extra` baselines; returns its page.
///
/// # Errors
/// Returns an error if it cannot be written.
pub(super) fn write_report(
    manifest: &Manifest,
    merged: &Merged,
    extra: &[ResultLine],
) -> Result<PathBuf, Failure> {
    let lines = merged.lines().chain(extra).collect();
    let mut commands: Vec<&str> = manifest.jobs.iter().map(|job| job.command.as_str()).collect();
    commands.dedup();
    let input = ReportInput { lines, command: commands.join("\n"), out: &manifest.dir };
    Ok(sharp_bench::write_report(&input)?)
}

fn show(args: &Eval, name: &str) -> String {
    args.out.join(name).display().to_string()
}

/// Does the jobs on threads of this process; those that fail are told and left unfinished.
fn run_here(args: &Eval, manifest: &Manifest, indices: &[usize]) {
    let jobs: Vec<&Job> = indices.iter().map(|&index| &manifest.jobs[index]).collect();
    let steps: usize = jobs.iter().map(|job| job.spec.problems.len()).sum();
    let progress = bar(steps as u64, "evaluating");
    progress.enable_steady_tick(Duration::from_millis(500));
    let workers = args.jobs.map_or_else(rayon::current_num_threads, |jobs| jobs as usize);
    let ended = run_jobs(&manifest.dir, &jobs, workers, &|line| {
        progress.println(row_text(line));
        progress.inc(1);
    });
    progress.finish_and_clear();
    for failure in ended.into_iter().filter_map(Result::err) {
        eprintln!("error: {failure}");
    }
}

/// Submits what is not finished, waits, and submits again what the cluster lost.
fn run_on_cluster(manifest: &Manifest, indices: &[usize]) -> Result<(), Failure> {
    let weight_s: f64 = indices.iter().map(|&index| manifest.jobs[index].weight_s).sum();
    // Tasks of minutes, but some of them even for a small suite.
    let pack_s = PACK_S.min(weight_s / 16.0);
    let submission = Submission { array_limit: None, time_min: None, pack_s, sbatch: vec![] };
    let steps: usize = indices.iter().map(|&index| manifest.jobs[index].spec.problems.len()).sum();
    let progress = bar(steps as u64, "evaluating");
    for _ in 0..ROUNDS {
        let open: Vec<usize> =
            unfinished(manifest).into_iter().filter(|index| indices.contains(index)).collect();
        if open.is_empty() {
            break;
        }
        let cluster = Cluster::write(manifest, &open, &submission)?;
        let array = cluster.submit()?;
        eprintln!("array {array} of {} tasks, logs in {}", cluster.tasks, cluster.logs().display());
        while is_queued(&array)? {
            if is_interrupted() {
                eprintln!("array {array} goes on; this call again finds what it made");
                return Ok(());
            }
            progress.set_position(count_results(manifest, indices) as u64);
            std::thread::sleep(LOOK);
        }
    }
    progress.finish_and_clear();
    Ok(())
}
