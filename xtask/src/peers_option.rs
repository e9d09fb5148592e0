//! `cargo xtask bench peers option`: one option learnt here and by Stable-Baselines3.
//!
//! `option.time_to_95` is the time to 95 % success with the paper's observation, reward and networks and
//! Stable-Baselines3's hyperparameters on both sides, `option.time_to_stop` that to a mean return of 500; with `.tuned` behind it the
//! same with the settings of `--learning paper-tuned` on both sides. `option.time_to_95.scratch` and
//! `option.time_to_95.fast` stand what this project does instead against the peer's time in the paper's
//! form. Both sides of a line learn at the same time: what slows one down slows the other down too.
//! Processor time stands beside the time on the wall, for a machine that others share.

use std::fs;
use std::io::Write;
use std::path::PathBuf;
use std::process::{Command, Stdio};

use anyhow::{Context, ensure};
use serde_json::{Value, json};

use crate::peers::{load, parse, python, succeed};
use crate::peers_learning::folder;
use crate::process::{cargo, flag};
use crate::tree::root;

/// Built with the whole workspace: one package alone would compile burn once more.
const BUILD: [&str; 7] = ["build", "--release", "--workspace", "--bin", "sharp", "--example", "peer_option"];
const MAP: &str = "a";

/// Learns the longest option of problem `--problem P`, for at most `--option-limit S` seconds a side, as
/// often as `--option-seeds N` says; PyTorch takes `--peer-threads N`.
///
/// # Errors
/// Returns an error if a flag is unreadable, or if a side cannot be built or run.
pub(crate) fn run(args: &[String]) -> anyhow::Result<u8> {
    let limit: f64 = flag(args, "--option-limit").unwrap_or("600").parse().context("--option-limit")?;
    let seeds: u64 = flag(args, "--option-seeds").unwrap_or("1").parse().context("--option-seeds")?;
    ensure!(seeds > 0, "--option-seeds is 0, must be at least 1");
    let threads: u32 = flag(args, "--peer-threads").unwrap_or("1").parse().context("--peer-threads")?;
    let sides = OptionSides {
        python: python(&folder(), "requirements-learning.txt")?,
        plan: plan(flag(args, "--problem").unwrap_or("4"))?,
        limit,
        threads,
    };
    for seed in 1..=seeds {
        for line in sides.compare(seed)? {
            if writeln!(std::io::stdout(), "{line}").is_err() {
                // Whoever reads has read enough.
                return Ok(0);
            }
        }
    }
    Ok(0)
}

/// Builds our side and plans the problem; returns the folder of the plan.
fn plan(problem: &str) -> anyhow::Result<PathBuf> {
    succeed(&mut cargo(&BUILD))?;
    let plan = folder().join(format!("plan-{problem}"));
    let mut solve = Command::new(root().join("target/release/sharp"));
    solve.args(["solve", MAP, "--problem", problem, "--robot", "husky", "--options", "interface"]);
    succeed(solve.args(["--library", "none", "--out"]).arg(&plan))?;
    Ok(plan)
}

/// Both sides, ready to run.
struct OptionSides {
    python: PathBuf,
    plan: PathBuf,
    /// Seconds that a side may take.
    limit: f64,
    threads: u32,
}

impl OptionSides {
    fn compare(&self, seed: u64) -> anyhow::Result<Vec<Value>> {
        let (name, limit) = (seed.to_string(), self.limit.to_string());
        let mut lines = Vec::new();
        let mut paper_peer = Value::Null;
        for (kind, ending) in [("paper", ""), ("tuned", ".tuned")] {
            eprintln!("seed {seed}: {kind} settings on both sides, load {}", load());
            let (ours, peer) = std::thread::scope(|scope| {
                let ours = scope.spawn(|| self.ours(&[kind, &name, &limit]));
                let peer = self.peer(&[kind, &name, &limit, &self.threads.to_string()]);
                (ours.join().expect("no panic, but an error"), peer)
            });
            let (ours, peer) = (ours?, peer?);
            lines.push(line(&format!("option.time_to_95{ending}"), &ours, &peer));
            lines.push(line(&format!("option.time_to_stop{ending}"), &at_stop(&ours), &at_stop(&peer)));
            if kind == "paper" {
                paper_peer = peer;
            }
        }
        eprintln!("seed {seed}: the guide's frame, load {}", load());
        let scratch = self.ours(&["scratch", &name, &limit])?;
        let fast = self.ours(&["fast", &name])?;
        for (kind, ours) in [("scratch", &scratch), ("fast", &fast)] {
            lines.push(line(&format!("option.time_to_95.{kind}"), ours, &paper_peer));
        }
        for line in &mut lines {
            line["peer_threads"] = json!(self.threads);
            line["limit"] = json!(self.limit);
            line["seed"] = json!(seed);
        }
        Ok(lines)
    }

    /// What our side reports when called with `args`.
    fn ours(&self, args: &[&str]) -> anyhow::Result<Value> {
        let output = self.example().args(args).stderr(Stdio::inherit()).output();
        let output = output.context("cannot start peer_option")?;
        ensure!(output.status.success(), "peer_option {} failed: {}", args.join(" "), output.status);
        parse(std::str::from_utf8(&output.stdout).context("peer_option prints no text")?)
    }

    /// What the peer reports: kind, seed, limit and threads are `args`.
    fn peer(&self, args: &[&str]) -> anyhow::Result<Value> {
        let result = folder().join("option.json");
        let mut command = Command::new(&self.python);
        command.arg(root().join("assets/peers/sb3_option.py")).args(args);
        command.arg(&result).arg(self.example().get_program()).arg(MAP).arg(&self.plan);
        succeed(&mut command)?;
        parse(&fs::read_to_string(&result).with_context(|| format!("cannot read {}", result.display()))?)
    }

    fn example(&self) -> Command {
        let mut command = Command::new(root().join("target/release/examples/peer_option"));
        command.arg(MAP).arg(&self.plan);
        command
    }
}

/// What `side` reports of the paper's stop in place of the whole; all of its time was in vain where it never came there.
fn at_stop(side: &Value) -> Value {
    let mut at_stop = side.clone();
    at_stop["reached"] = json!(side["stop"].is_object());
    for (key, value) in side["stop"].as_object().into_iter().flatten() {
        at_stop[key] = value.clone();
    }
    at_stop
}

/// The line about `what`. A side that did not learn the option has no time: the ratio, how many times
/// as long the peer took, is then a bound, or unknown where neither did.
fn line(what: &str, ours: &Value, peer: &Value) -> Value {
    let mut line = json!({
        "schema": "sharp.peer/1", "what": what, "peer_name": peer["name"],
        "option": ours["option"], "length_m": ours["length_m"],
    });
    let reached = |side: &Value| side["reached"] == true;
    let bound = match (reached(ours), reached(peer)) {
        (true, true) => Some(""),
        (true, false) => Some("_at_least"),
        (false, true) => Some("_at_most"),
        (false, false) => None,
    };
    for (clock, ending) in [("seconds", ""), ("cpu_seconds", "_cpu")] {
        for (name, side) in [("ours", ours), ("peer", peer)] {
            line[format!("{name}{ending}")] = if reached(side) { side[clock].clone() } else { Value::Null };
            line[format!("{name}{ending}_spent")] = side[clock].clone();
        }
        if let (Some(bound), Some(ours), Some(peer)) = (bound, ours[clock].as_f64(), peer[clock].as_f64()) {
            line[format!("ratio{ending}{bound}")] = json!(peer / ours);
        }
    }
    for (name, side) in [("ours", ours), ("peer", peer)] {
        for quantity in ["steps", "updates", "best"] {
            line[format!("{name}_{quantity}")] = side[quantity].clone();
        }
    }
    line
}

#[cfg(test)]
mod tests {
    use super::*;

    fn side(reached: bool, seconds: f64) -> Value {
        json!({"reached": reached, "seconds": seconds, "cpu_seconds": seconds / 2.0, "steps": 7, "best": 0.5})
    }

    #[test]
    fn two_times_have_a_ratio() {
        let line = line("option.time_to_95", &side(true, 10.0), &side(true, 40.0));
        assert_eq!((&line["ours"], &line["peer"], &line["ratio"]), (&json!(10.0), &json!(40.0), &json!(4.0)));
        assert_eq!((&line["ours_cpu"], &line["ratio_cpu"]), (&json!(5.0), &json!(4.0)));
        assert_eq!((&line["ours_steps"], &line["peer_best"]), (&json!(7), &json!(0.5)));
    }

    #[test]
    fn the_stop_has_times_of_its_own() {
        let mut learnt = side(false, 10.0);
        learnt["stop"] = json!({"seconds": 4.0, "cpu_seconds": 3.0, "steps": 5});
        let learnt = at_stop(&learnt);
        assert_eq!((&learnt["reached"], &learnt["seconds"]), (&json!(true), &json!(4.0)));
        let never = at_stop(&side(true, 10.0));
        assert_eq!((&never["reached"], &never["seconds"]), (&json!(false), &json!(10.0)));
    }

    #[test]
    fn a_side_that_learns_nothing_leaves_a_bound() {
        for (ours, peer, named) in [
            (true, false, Some("ratio_at_least")),
            (false, true, Some("ratio_at_most")),
            (false, false, None),
        ] {
            let line = line("option.time_to_95", &side(ours, 10.0), &side(peer, 40.0));
            let object = line.as_object().expect("an object");
            let ratios: Vec<&str> =
                object.keys().map(String::as_str).filter(|key| key.starts_with("ratio")).collect();
            let cpu = named.map(|name| name.replace("ratio", "ratio_cpu"));
            let mut expected: Vec<&str> = named.into_iter().chain(cpu.as_deref()).collect();
            expected.sort_unstable();
            assert_eq!(ratios, expected, "ours {ours}, peer {peer}");
            assert_eq!(line["ours"].is_null(), !ours, "{line}");
            assert_eq!(line["peer_spent"], 40.0, "{line}");
        }
    }

    #[test]
    fn nothing_is_built_for_unreadable_flags() {
        for (args, expected) in [
            (["--option-limit", "soon"], "--option-limit"),
            (["--option-seeds", "0"], "--option-seeds is 0, must be at least 1"),
        ] {
            let error = run(&args.map(String::from)).expect_err("refused").to_string();
            assert_eq!(error, expected);
        }
    }
}
