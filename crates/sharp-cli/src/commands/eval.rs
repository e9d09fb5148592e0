//! `sharp eval`: suites of problems, one JSON line a result, and a report.
//!
//! Planning, running and merging of jobs in one call: what it leaves is what `sharp jobs` leaves.

use std::path::{Path, PathBuf};
use std::time::Duration;

use crate::args::{Engine, Eval};
use crate::evaluation::{self, Evaluation, ResultLine, read_baselines, row_text};
use crate::jobs::{
    Cluster, Job, Manifest, Submission, clean, command, count_results, is_queued, merge, run_jobs, specs,
    unfinished,
};
use crate::outcome::{Exit, Failure, say, to_json};
use crate::progress::{bar, is_interrupted};

/// Times that jobs which a cluster lost are submitted.
const ROUNDS: usize = 3;
/// Between two looks at the queue.
const LOOK: Duration = Duration::from_secs(2);

pub(crate) fn run(args: &Eval, seed: u64, json: bool) -> Result<Exit, Failure> {
    let extra = baselines(args)?;
    let command = full_command(args, seed);
    let (manifest, indices) = Manifest::extend(&args.out, specs(&args.selection, seed)?, &command)?;
    match args.engine {
        Engine::Local => run_here(args, &manifest, &indices),
        Engine::Slurm => run_on_cluster(&manifest, &indices)?,
    }
    let merged = merge(&manifest)?;
    if is_interrupted() {
        return Ok(Exit::Interrupted);
    }
    let wanted = |&&index: &&usize| &merged.results[index].1;
    let lines: Vec<&ResultLine> =
        indices.iter().flat_map(|index| wanted(&index)).map(|done| &done.line).collect();
    // Everything in the folder: what other calls measured there belongs to the same page.
    let all = merged.results.iter().flat_map(|(_, results)| results).map(|done| &done.line);
    let page = write_report(&args.out, all.chain(&extra).collect(), command)?;
    if json {
        for line in &lines {
            say!("{}", to_json(line));
        }
    } else {
        let of_sharp: Vec<&ResultLine> = lines.iter().copied().filter(|line| line.is_of_sharp()).collect();
        say!("{}", evaluation::table(&of_sharp));
        say!("results in {}, plans and pictures in {}", show(args, "results.jsonl"), show(args, "jobs"));
        say!("report in {}", page.display());
    }
    if unfinished(&manifest).iter().any(|index| indices.contains(index)) {
        return Ok(Exit::Partial);
    }
    clean(&manifest);
    Ok(Exit::Done)
}

/// Writes the report of `lines`; returns its page.
///
/// # Errors
/// Returns an error if it cannot be written.
pub(super) fn write_report(out: &Path, lines: Vec<&ResultLine>, command: String) -> Result<PathBuf, Failure> {
    evaluation::write(&Evaluation { lines, command, out })
}

fn show(args: &Eval, name: &str) -> String {
    args.out.join(name).display().to_string()
}

/// The baselines that another run measured.
fn baselines(args: &Eval) -> Result<Vec<ResultLine>, Failure> {
    Ok(args.baselines.as_deref().map(read_baselines).transpose()?.unwrap_or_default())
}

/// The call that gives the same results and the same report.
fn full_command(args: &Eval, seed: u64) -> String {
    let mut text = command("eval", &args.selection, seed);
    if let Some(path) = &args.baselines {
        text += &format!(" --baselines {}", path.display());
    }
    text + &format!(" --out {}", args.out.display())
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
    let submission = Submission { array_limit: None, time_min: None, pack_s: 600.0, sbatch: vec![] };
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

#[cfg(test)]
mod tests {
    use clap::Parser;

    use super::*;
    use crate::args::{Cli, Command};

    #[test]
    fn the_command_of_a_report_says_everything_that_decides_it() {
        let text = "sharp --seed 7 eval quick --episodes 50 --noise harsh,none --regions grid --recovery off \
                    --cost-update on --time-limit 60 --learning fast,paper --envs a,b --options interface \
                    --problems 1,3 --methods sharp,rrt-contact --trials 2 --baselines here.jsonl --out here";
        let cli = Cli::parse_from(text.split_whitespace());
        let Command::Eval(args) = &cli.command else { panic!("{:?} is no evaluation", cli.command) };
        assert_eq!(full_command(args, cli.seed), text);
    }
}
