//! `cargo xtask bench peers learning`: soft actor-critic here and in Stable-Baselines3, by turns.
//!
//! `sac.updates.*` are gradient steps per second on a filled buffer, by learners of ours and threads
//! of the peer. `toy.curve` holds mean returns of five seeds on the same point mass with the same
//! settings, and `toy.steps` how fast both learned it, evaluations included. The lines of `bench peers
//! option` follow.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, ensure};
use serde_json::{Value, json};

use crate::peers::{load, median, parse, python, succeed};
use crate::peers_option;
use crate::process::{cargo, flag};
use crate::tree::root;

/// Built with the whole workspace: one package alone would compile burn once more.
const BUILD: [&str; 5] = ["build", "--release", "--workspace", "--example", "peer_learning"];
const SIZES: [&str; 2] = ["256x256.b256", "64x64.b128"];
/// Learners on our side and threads of the peer: one core each, then both.
const COUNTS: [u32; 2] = [1, 2];
const SEEDS: usize = 5;
/// The 97.5 % quantile of Student's distribution for the mean of [`SEEDS`] values.
const STUDENT: f64 = 2.776;

/// Times updates in `--rounds N` rounds of `--seconds S` a number, then compares learning curves, and
/// last what [`peers_option`] compares.
///
/// # Errors
/// Returns an error if a flag is unreadable, or if a side cannot be built or run.
pub(crate) fn run(args: &[String]) -> anyhow::Result<u8> {
    let rounds: usize = flag(args, "--rounds").unwrap_or("3").parse().context("--rounds")?;
    ensure!(rounds > 0, "--rounds is 0, must be at least 1");
    let seconds: f64 = flag(args, "--seconds").unwrap_or("3").parse().context("--seconds")?;
    succeed(&mut cargo(&BUILD))?;
    let sides = LearningSides { python: python(&folder(), "requirements-learning.txt")? };
    let (ours, peers) = sides.by_turns(rounds, |_| ["updates".to_owned(), seconds.to_string()])?;
    let mut lines = update_lines(&ours, &peers)?;
    let (ours, peers) = sides.by_turns(SEEDS, |seed| ["curve".to_owned(), seed.to_string()])?;
    lines.extend(curve_lines(&ours, &peers)?);
    for line in lines {
        if writeln!(std::io::stdout(), "{line}").is_err() {
            // Whoever reads has read enough.
            return Ok(0);
        }
    }
    peers_option::run(args)
}

/// Both sides, ready to run.
struct LearningSides {
    python: PathBuf,
}

impl LearningSides {
    /// What both sides report, called in turn with the arguments of each round from 1.
    fn by_turns(
        &self,
        rounds: usize,
        args: impl Fn(usize) -> [String; 2],
    ) -> anyhow::Result<(Vec<Value>, Vec<Value>)> {
        let (mut ours, mut peers) = (Vec::new(), Vec::new());
        for round in 1..=rounds {
            let args = args(round);
            eprintln!("{}: round {round} of {rounds}, load {}", args[0], load());
            ours.push(example(&args)?);
            peers.push(peer(&self.python, &args)?);
        }
        Ok((ours, peers))
    }
}

/// A line for each size and each pair of learners and threads.
fn update_lines(ours: &[Value], peers: &[Value]) -> anyhow::Result<Vec<Value>> {
    let mut lines = Vec::new();
    for size in SIZES {
        for learners in COUNTS {
            for threads in COUNTS {
                let rates = (
                    middle(ours, &format!("{size}.{learners}"))?,
                    middle(peers, &format!("{size}.{threads}"))?,
                );
                let mut line = line(&format!("sac.updates.{size}"), rates, peers);
                line["learners"] = json!(learners);
                line["peer_threads"] = json!(threads);
                lines.push(line);
            }
        }
    }
    Ok(lines)
}

/// A line for each evaluation, and one about the speed.
fn curve_lines(ours: &[Value], peers: &[Value]) -> anyhow::Result<Vec<Value>> {
    let steps = ours.first().and_then(|result| result["steps"].as_array()).context("nothing was learned")?;
    let mut lines = Vec::new();
    for (index, step) in steps.iter().enumerate() {
        let band = |results: &[Value]| {
            ensure!(results.iter().all(|r| r["steps"][index] == *step), "a side did not evaluate at {step}");
            let returns: Option<Vec<f64>> = results.iter().map(|r| r["returns"][index].as_f64()).collect();
            mean_and_band(&returns.with_context(|| format!("a side reports no return at {step}"))?)
        };
        let ((mean, own), (peer, others)) = (band(ours)?, band(peers)?);
        lines.push(json!({
            "schema": "sharp.peer/1", "what": "toy.curve", "step": step,
            "ours": mean, "ours_band": own, "ours_in_band": contains(others, mean),
            "peer": peer, "peer_band": others, "peer_in_band": contains(own, peer),
            "peer_name": peers[0]["name"], "seeds": ours.len(),
        }));
    }
    lines.push(line("toy.steps", (middle(ours, "rate")?, middle(peers, "rate")?), peers));
    Ok(lines)
}

fn line(what: &str, (ours, peer): (f64, f64), peers: &[Value]) -> Value {
    json!({
        "schema": "sharp.peer/1", "what": what, "ours": ours, "peer": peer, "ratio": ours / peer,
        "peer_name": peers[0]["name"], "rounds": peers.len(),
    })
}

fn middle(results: &[Value], quantity: &str) -> anyhow::Result<f64> {
    let rates: Option<Vec<f64>> = results.iter().map(|result| result[quantity].as_f64()).collect();
    rates.and_then(median).with_context(|| format!("a side reports no {quantity}"))
}

/// The mean of [`SEEDS`] values and the 95 % interval for it.
fn mean_and_band(values: &[f64]) -> anyhow::Result<(f64, [f64; 2])> {
    ensure!(values.len() == SEEDS, "{} values, expected {SEEDS}", values.len());
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (count - 1.0);
    let half = STUDENT * (variance / count).sqrt();
    Ok((mean, [mean - half, mean + half]))
}

fn contains([low, high]: [f64; 2], value: f64) -> bool {
    (low..=high).contains(&value)
}

/// What our side reports when called with `args`.
fn example(args: &[String]) -> anyhow::Result<Value> {
    let mut command = Command::new(root().join("target/release/examples/peer_learning"));
    let output = command.args(args).stderr(Stdio::inherit()).output();
    let output = output.context("cannot start peer_learning")?;
    ensure!(output.status.success(), "peer_learning {} failed: {}", args.join(" "), output.status);
    parse(std::str::from_utf8(&output.stdout).context("peer_learning prints no text")?)
}

fn peer(python: &Path, args: &[String]) -> anyhow::Result<Value> {
    let result = folder().join("result.json");
    let mut command = Command::new(python);
    command.arg(root().join("assets/peers/sb3_sac.py")).args(args).arg(&result);
    succeed(&mut command)?;
    parse(&fs::read_to_string(&result).with_context(|| format!("cannot read {}", result.display()))?)
}

/// PyTorch is large: it has a virtual environment of its own.
pub(crate) fn folder() -> PathBuf {
    root().join("target/peers-learning")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_band_is_two_standard_errors_and_more_around_the_mean() {
        let (mean, [low, high]) = mean_and_band(&[1.0, 2.0, 3.0, 4.0, 5.0]).expect("five seeds");
        // The deviation of 1 to 5 is the root of 2.5, the standard error that of 0.5.
        let half = STUDENT * 0.5_f64.sqrt();
        assert!((mean - 3.0).abs() < 1e-12, "mean {mean}");
        assert!((low - 3.0 + half).abs() < 1e-12 && (high - 3.0 - half).abs() < 1e-12, "{low} to {high}");
        let error = mean_and_band(&[1.0]).expect_err("no deviation of one").to_string();
        assert_eq!(error, "1 values, expected 5");
    }

    #[test]
    fn every_pair_of_learners_and_threads_has_a_line() {
        let result = |factor: f64| {
            let mut result = json!({ "name": "sb3" });
            for (index, size) in SIZES.iter().enumerate() {
                for count in COUNTS {
                    result[format!("{size}.{count}")] = json!(factor * f64::from(count) * (index + 1) as f64);
                }
            }
            [result]
        };
        let lines = update_lines(&result(6.0), &result(2.0)).expect("all is there");
        let ratios: Vec<_> = lines.iter().map(|line| line["ratio"].as_f64().expect("a number")).collect();
        assert_eq!(ratios, [3.0, 1.5, 6.0, 3.0, 3.0, 1.5, 6.0, 3.0]);
        assert_eq!(lines[7]["what"], "sac.updates.64x64.b128");
        assert_eq!((&lines[2]["learners"], &lines[2]["peer_threads"]), (&json!(2), &json!(1)));
    }

    #[test]
    fn curves_say_whether_each_mean_lies_in_the_other_band() {
        let results = |returns: [f64; 5], steps: u64| {
            returns.map(|value| json!({"name": "sb3", "steps": [steps], "returns": [value], "rate": value}))
        };
        let narrow = results([0.9, 1.0, 1.0, 1.0, 1.1], 500);
        let wide = results([-2.0, 0.0, 1.5, 3.0, 4.5], 500);
        let lines = curve_lines(&narrow, &wide).expect("all is there");
        assert_eq!(lines[0]["ours_in_band"], true, "1 lies within 1.4 and more: {}", lines[0]);
        assert_eq!(lines[0]["peer_in_band"], false, "1.4 is beyond a tenth of 1: {}", lines[0]);
        assert_eq!(lines[1]["what"], "toy.steps");
        let error = curve_lines(&narrow, &results([1.0; 5], 600)).expect_err("other steps").to_string();
        assert_eq!(error, "a side did not evaluate at 500");
    }

    #[test]
    fn a_side_without_a_rate_is_named() {
        let error = update_lines(&[json!({})], &[json!({})]).expect_err("nothing there").to_string();
        assert_eq!(error, "a side reports no 256x256.b256.1");
    }
}
