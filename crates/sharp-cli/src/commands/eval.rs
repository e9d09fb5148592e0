//! `sharp eval`: suites of problems, one JSON line a result, and a report.
//!
//! Planning, running and merging of jobs in one call: what it leaves is what `sharp jobs` leaves.

use std::path::PathBuf;
use std::time::Duration;

use indicatif::ProgressBar;
use sharp_bench::{
    Engine, EngineMonitor, LocalEngine, Manifest, Merged, ReportInput, ResultLine, SlurmEngine, clean, merge,
    read_baselines, row_text,
};

use crate::args::{EngineName, Eval};
use crate::outcome::{Exit, Failure, say, to_json};
use crate::progress::{bar, is_interrupted};

pub(crate) fn run(args: &Eval, seed: u64, json: bool) -> Result<Exit, Failure> {
    let extra = args.baselines.as_deref().map(read_baselines).transpose()?.unwrap_or_default();
    let command = args.selection.command("eval", seed, &args.out);
    let experiments = args.selection.request(seed).experiments()?;
    let (manifest, indices) = Manifest::extend(&args.out, experiments, &command)?;
    let engine: Box<dyn Engine> = match args.engine {
        EngineName::Local => {
            let workers = args.jobs.map_or_else(rayon::current_num_threads, |jobs| jobs as usize);
            Box::new(LocalEngine { workers })
        }
        EngineName::Slurm => Box::new(SlurmEngine { program: program()? }),
    };
    let results: usize = indices.iter().map(|&index| manifest.jobs[index].work.problems().len()).sum();
    let progress = EvalProgress(bar(results as u64, "evaluating"));
    progress.0.enable_steady_tick(Duration::from_millis(500));
    let failed = engine.run(&manifest, &indices, &progress)?;
    progress.0.finish_and_clear();
    for error in failed {
        eprintln!("error: {error}");
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
    let missing: Vec<_> = merged.missing.iter().filter(|(index, _)| indices.contains(index)).collect();
    if !missing.is_empty() {
        for (_, error) in missing {
            eprintln!("error: {error}");
        }
        return Ok(Exit::Partial);
    }
    clean(&manifest);
    Ok(Exit::Done)
}

/// This program, for tasks of a cluster.
pub(super) fn program() -> Result<PathBuf, Failure> {
    std::env::current_exe()
        .map_err(|error| Failure::new("FAILED", format!("this program has no path: {error}")))
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

/// A bar of results, with a line for each.
struct EvalProgress(ProgressBar);

impl EngineMonitor for EvalProgress {
    fn result(&self, line: &ResultLine) {
        self.0.println(row_text(line));
        self.0.inc(1);
    }

    fn results_so_far(&self, count: usize) {
        self.0.set_position(count as u64);
    }

    fn message(&self, text: &str) {
        self.0.suspend(|| eprintln!("{text}"));
    }

    fn should_stop(&self) -> bool {
        is_interrupted()
    }
}
