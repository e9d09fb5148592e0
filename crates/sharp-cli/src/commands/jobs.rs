//! `sharp jobs`: the engine-neutral contract under `sharp eval`.

use std::ops::Range;
use std::path::Path;

use sharp_bench::{
    Ended, EngineMonitor, Manifest, ResultLine, SlurmScripts, Submission, clean, merge, row_text, run_job,
    unfinished,
};

use crate::args::{Jobs, Submit, SuiteArgs};
use crate::commands::eval::{program, write_report};
use crate::outcome::{Exit, Failure, say, to_json};
use crate::progress::is_interrupted;

pub(crate) fn run(jobs: &Jobs, seed: u64, json: bool) -> Result<Exit, Failure> {
    match jobs {
        Jobs::Plan { selection, out } => plan(selection, out, seed),
        Jobs::Run { dir, index } => run_block(dir, index.as_deref(), json),
        Jobs::Merge { dir } => merge_all(dir),
        Jobs::Submit(args) => submit(args),
    }
}

fn plan(selection: &SuiteArgs, out: &Path, seed: u64) -> Result<Exit, Failure> {
    let command = selection.command("jobs plan", seed, out);
    let (manifest, indices) = Manifest::extend(out, selection.request(seed).experiments()?, &command)?;
    let weight_s: f64 = indices.iter().map(|&index| manifest.jobs[index].weight_s).sum();
    say!(
        "{} jobs planned in {}; the {} asked for take about {:.0} minutes of processor time",
        manifest.jobs.len(),
        out.join("manifest.jsonl").display(),
        indices.len(),
        weight_s / 60.0
    );
    Ok(Exit::Done)
}

/// Does the jobs of one block, one after the other.
fn run_block(dir: &Path, index: Option<&str>, json: bool) -> Result<Exit, Failure> {
    let manifest = Manifest::open(dir)?;
    let block = block(index)?;
    let is_alone = block.len() == 1;
    let monitor = ResultPrinter { json };
    let mut exit = Exit::Done;
    for index in block {
        match run_job(&manifest, index, &monitor) {
            Ok(Ended::Done) => {}
            Ok(Ended::Interrupted) => return Ok(interrupted()),
            Err(error) if is_alone => return Err(error.into()),
            Err(error) => {
                eprintln!("error: {error}");
                exit = Exit::Partial;
            }
        }
    }
    Ok(exit)
}

/// Prints each result.
struct ResultPrinter {
    json: bool,
}

impl EngineMonitor for ResultPrinter {
    fn result(&self, line: &ResultLine) {
        if self.json {
            say!("{}", to_json(line));
        } else {
            say!("{}", row_text(line));
        }
    }

    fn should_stop(&self) -> bool {
        is_interrupted()
    }
}

/// What is kept waits for the next start: on Slurm that comes by itself after this code.
fn interrupted() -> Exit {
    if std::env::var_os("SLURM_JOB_ID").is_some() { Exit::Requeue } else { Exit::Interrupted }
}

/// The jobs that `--index` or the engine names.
fn block(index: Option<&str>) -> Result<Range<usize>, Failure> {
    let of_engine =
        || ["SLURM_ARRAY_TASK_ID", "JOB_COMPLETION_INDEX"].iter().find_map(|name| std::env::var(name).ok());
    let Some(text) = index.map(str::to_owned).or_else(of_engine) else {
        let message = "--index is missing, and neither SLURM_ARRAY_TASK_ID nor JOB_COMPLETION_INDEX is set";
        return Err(Failure::new("USAGE", message));
    };
    parse_block(&text).ok_or_else(|| {
        Failure::new("USAGE", format!("--index is {text:?}, expected N, or N..M with N less than M"))
    })
}

fn parse_block(text: &str) -> Option<Range<usize>> {
    let number = |text: &str| text.trim().parse::<usize>().ok();
    let (first, end) = match text.split_once("..") {
        Some((first, end)) => (number(first)?, number(end)?),
        None => (number(text)?, number(text)?.checked_add(1)?),
    };
    (first < end).then_some(first..end)
}

fn merge_all(dir: &Path) -> Result<Exit, Failure> {
    let manifest = Manifest::open(dir)?;
    let merged = merge(&manifest)?;
    for (_, error) in &merged.missing {
        eprintln!("error: {error}");
    }
    let page = write_report(&manifest, &merged, &[])?;
    say!(
        "{} results of {} whole jobs of {} in {}, report in {}",
        merged.lines().count(),
        manifest.jobs.len() - merged.missing.len(),
        manifest.jobs.len(),
        dir.join("results.jsonl").display(),
        page.display()
    );
    if !merged.missing.is_empty() {
        return Ok(Exit::Partial);
    }
    clean(&manifest);
    Ok(Exit::Done)
}

fn submit(args: &Submit) -> Result<Exit, Failure> {
    let Submit { dir, slurm: _, array_limit, time, pack, dry_run, sbatch } = args;
    let manifest = Manifest::open(dir)?;
    let indices = unfinished(&manifest);
    if indices.is_empty() {
        say!("all {} jobs are finished, next: sharp jobs merge {}", manifest.jobs.len(), dir.display());
        return Ok(Exit::Done);
    }
    let submission = Submission {
        array_limit: *array_limit,
        time_min: *time,
        pack_s: 60.0 * pack,
        sbatch: sbatch.clone(),
    };
    let cluster = SlurmScripts::write(&program()?, &manifest, &indices, &submission)?;
    if *dry_run {
        for script in [&cluster.array, &cluster.merge] {
            let text = std::fs::read_to_string(script).unwrap_or_default();
            say!("{}:\n{text}", script.display());
        }
        return Ok(Exit::Done);
    }
    let array = cluster.submit()?;
    let merge = cluster.submit_merge(&array)?;
    say!(
        "{} jobs in {} tasks of array {array}, merge {merge} after it; logs in {}",
        indices.len(),
        cluster.tasks,
        cluster.logs().display()
    );
    Ok(Exit::Done)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_are_numbers_or_ranges() {
        for (text, expected) in [
            ("3", Some(3..4)),
            ("3..7", Some(3..7)),
            (" 3 .. 4 ", Some(3..4)),
            ("7..3", None),
            ("3..3", None),
            ("-1", None),
            ("", None),
            ("3..", None),
            ("18446744073709551615", None),
        ] {
            assert_eq!(parse_block(text), expected, "{text:?}");
        }
        let message = block(Some("x")).expect_err("no number").to_string();
        assert_eq!(message, "--index is \"x\", expected N, or N..M with N less than M");
    }
}
