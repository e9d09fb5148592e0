//! `cargo xtask bench peers regions`: the region network on burn's two backends and in PyTorch.
//!
//! All three sides train and predict on one thread, by turns in one run. The lines hold rates per
//! second: `regions.train.*` of gradient steps on eight maps of 120 x 120 pixels, `regions.predict.*`
//! of heat maps. A second set of lines has flex in place of the peer.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, ensure};
use serde_json::{Value, json};

use crate::peers::{load, median, parse, python, succeed};
use crate::process::{cargo, flag};
use crate::tree::root;

const DEVICES: [&str; 2] = ["flex", "ndarray"];

/// Built with the whole workspace: one package alone would compile burn once more.
const BUILD: [&str; 7] =
    ["build", "--release", "--workspace", "--features", "sharp-cli/ndarray", "--example", "peer_regions"];

/// Compares `--rounds N` times, `--seconds S` for each number.
///
/// # Errors
/// Returns an error if a flag is unreadable, or if a side cannot be built or run.
pub(crate) fn run(args: &[String]) -> anyhow::Result<u8> {
    let rounds: usize = flag(args, "--rounds").unwrap_or("3").parse().context("--rounds")?;
    ensure!(rounds > 0, "--rounds is 0, must be at least 1");
    let seconds: f64 = flag(args, "--seconds").unwrap_or("3").parse().context("--seconds")?;
    let seconds = seconds.to_string();
    succeed(&mut cargo(&BUILD))?;
    let python = python(&folder(), "requirements-regions.txt")?;
    let mut ours = DEVICES.map(|_| Vec::new());
    let mut peers = Vec::new();
    for round in 1..=rounds {
        eprintln!("round {round} of {rounds}, load {}", load());
        for (device, results) in DEVICES.iter().zip(&mut ours) {
            results.push(example(device, &seconds)?);
        }
        peers.push(peer(&python, &seconds)?);
    }
    let [flex, ndarray] = ours;
    let lines = [(&flex, &peers), (&ndarray, &peers), (&ndarray, &flex)]
        .into_iter()
        .map(|(ours, peers)| lines(ours, peers))
        .collect::<anyhow::Result<Vec<_>>>()?;
    for line in lines.into_iter().flatten() {
        if writeln!(std::io::stdout(), "{line}").is_err() {
            // Whoever reads has read enough.
            break;
        }
    }
    Ok(0)
}

/// A line for each quantity that the first result of ours names.
fn lines(ours: &[Value], peers: &[Value]) -> anyhow::Result<Vec<Value>> {
    let all = ours.first().and_then(Value::as_object).context("nothing was measured")?;
    let quantities = all.keys().filter(|key| *key != "name");
    quantities
        .map(|what| {
            let middle = |results: &[Value]| {
                let rates: Option<Vec<f64>> = results.iter().map(|result| result[what].as_f64()).collect();
                rates.and_then(median).with_context(|| format!("a side reports no {what}"))
            };
            let (rate, peer) = (middle(ours)?, middle(peers)?);
            Ok(json!({
                "schema": "sharp.peer/1", "what": format!("regions.{what}"), "ours": rate, "peer": peer,
                "ratio": rate / peer, "ours_name": ours[0]["name"], "peer_name": peers[0]["name"],
                "rounds": peers.len(),
            }))
        })
        .collect()
}

/// What our side measures on `device`.
fn example(device: &str, seconds: &str) -> anyhow::Result<Value> {
    let mut command = Command::new(root().join("target/release/examples/peer_regions"));
    let output = command.args([device, seconds]).stderr(Stdio::inherit()).output();
    let output = output.context("cannot start peer_regions")?;
    ensure!(output.status.success(), "peer_regions {device} failed");
    parse(std::str::from_utf8(&output.stdout).context("peer_regions prints no text")?)
}

fn peer(python: &Path, seconds: &str) -> anyhow::Result<Value> {
    let result = folder().join("result.json");
    let mut command = Command::new(python);
    command.arg(root().join("assets/peers/torch_unet.py")).arg(seconds).arg(&result);
    succeed(&mut command)?;
    parse(&fs::read_to_string(&result).with_context(|| format!("cannot read {}", result.display()))?)
}

/// PyTorch is large: it has a virtual environment of its own.
fn folder() -> PathBuf {
    root().join("target/peers-regions")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_holds_medians_and_names_both_sides() {
        let results = |name: &str, rates: [f64; 3]| rates.map(|rate| json!({"name": name, "train.x": rate}));
        let (ours, peers) = (results("burn", [9.0, 80.0, 10.0]), results("torch", [20.0, 1.0, 40.0]));
        let expected = json!({
            "schema": "sharp.peer/1", "what": "regions.train.x", "ours": 10.0, "peer": 20.0, "ratio": 0.5,
            "ours_name": "burn", "peer_name": "torch", "rounds": 3,
        });
        assert_eq!(lines(&ours, &peers).expect("all is there"), [expected]);
    }

    #[test]
    fn a_side_without_a_rate_is_named() {
        let error = lines(&[json!({"train.x": 1.0})], &[json!({})]).expect_err("the peer is empty");
        assert_eq!(error.to_string(), "a side reports no train.x");
    }
}
