//! `cargo xtask bench peers`: the same work here and in other programs, by turns in one run.
//!
//! Turns make the ratios hold on a machine that others share: what slows one side down slows the
//! other down too. Each line on stdout is a JSON object of the schema `sharp.peer/1` with medians
//! over the rounds.

use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, bail, ensure};
use serde_json::{Value, json};

use crate::process::{cargo, flag};
use crate::tree::root;
use crate::{peers_learning, peers_option, peers_regions};

const MAPS: [&str; 4] = ["grid_15", "grid_75", "boxes_100", "boxes_10000"];
/// Our simulators, the beginning of their lines and the layouts of the peer they stand against.
const OURS: [(&str, &str, &[&str]); 3] = [
    ("rapier2d", "sim", &["mesh", "bodies"]),
    ("rapier3d", "sim.rigid3d", &["mesh"]),
    ("kinematic", "sim.kinematic", &["mesh"]),
];
/// How the peer holds the walls: all in one concave mesh, or each as a body.
const LAYOUTS: [&str; 2] = ["mesh", "bodies"];
/// What both sides report, each a rate per second: steps and waypoints on the way, steps at rest and
/// against a wall.
const QUANTITIES: [&str; 4] = ["steps", "actions", "idle", "push"];

/// Compares with the peers of the suite that the first argument names; `--rounds N` and `--seconds S`
/// set how often and how long each side works, `--map M` picks one map.
///
/// # Errors
/// Returns an error if the suite or a flag is unknown, or if a side cannot be built or run.
pub(crate) fn run(args: &[String]) -> anyhow::Result<u8> {
    let suite = args.first().map_or("sim", String::as_str);
    if suite == "regions" {
        return peers_regions::run(&args[1..]);
    }
    if suite == "learning" {
        return peers_learning::run(&args[1..]);
    }
    if suite == "option" {
        return peers_option::run(&args[1..]);
    }
    let is_known = suite == "sim" || suite.starts_with('-');
    ensure!(is_known, "no comparison is called {suite:?}, there are sim, learning, option, regions");
    let rounds: usize = flag(args, "--rounds").unwrap_or("3").parse().context("--rounds")?;
    ensure!(rounds > 0, "--rounds is 0, must be at least 1");
    let seconds: f64 = flag(args, "--seconds").unwrap_or("3").parse().context("--seconds")?;
    let maps: Vec<&str> = match flag(args, "--map") {
        None => MAPS.to_vec(),
        Some(map) if MAPS.contains(&map) => vec![map],
        Some(map) => bail!("no map is called {map:?}, there are {}", MAPS.join(", ")),
    };
    let sides = SimulatorSides::prepare(seconds.to_string())?;
    for map in maps {
        for line in sides.compare(map, rounds)? {
            if writeln!(std::io::stdout(), "{line}").is_err() {
                // Whoever reads has read enough.
                return Ok(0);
            }
        }
    }
    Ok(0)
}

/// Both sides, ready to run.
struct SimulatorSides {
    example: PathBuf,
    python: PathBuf,
    /// How long each measurement takes, as both sides read it.
    seconds: String,
}

impl SimulatorSides {
    fn prepare(seconds: String) -> anyhow::Result<Self> {
        Ok(Self { example: example()?, python: python(&folder(), "requirements.txt")?, seconds })
    }

    /// Measures every simulator and layout on `map`, by turns.
    fn compare(&self, map: &str, rounds: usize) -> anyhow::Result<Vec<Value>> {
        let walls = folder().join("walls.json");
        fs::write(&walls, self.ours(&[map, "walls"])?)
            .with_context(|| format!("cannot write {}", walls.display()))?;
        let mut ours = vec![Vec::new(); OURS.len()];
        let mut peers = vec![Vec::new(); LAYOUTS.len()];
        for round in 1..=rounds {
            eprintln!("{map}: round {round} of {rounds}, load {}", load());
            for ((simulator, ..), results) in OURS.iter().zip(&mut ours) {
                results.push(parse(&self.ours(&[map, simulator, &self.seconds])?)?);
            }
            for (layout, results) in LAYOUTS.iter().zip(&mut peers) {
                results.push(self.peer(&walls, layout)?);
            }
        }
        let mut lines = Vec::new();
        for ((simulator, prefix, layouts), ours) in OURS.iter().zip(&ours) {
            for (layout, peer) in LAYOUTS.iter().zip(&peers).filter(|(layout, _)| layouts.contains(layout)) {
                for quantity in QUANTITIES {
                    let mut line = line(&format!("{prefix}.{quantity}.{layout}"), quantity, ours, peer)?;
                    line["map"] = json!(map);
                    line["ours_name"] = json!(simulator);
                    lines.push(line);
                }
            }
        }
        Ok(lines)
    }

    /// What our side prints when called with `args`.
    fn ours(&self, args: &[&str]) -> anyhow::Result<String> {
        let mut command = Command::new(&self.example);
        let output = command.args(args).stderr(Stdio::inherit()).output();
        let output = output.with_context(|| format!("cannot start {}", self.example.display()))?;
        ensure!(output.status.success(), "peer_sim {} failed: {}", args.join(" "), output.status);
        String::from_utf8(output.stdout).context("peer_sim prints no text")
    }

    /// One measurement of the peer, which says much else on stdout.
    fn peer(&self, walls: &Path, layout: &str) -> anyhow::Result<Value> {
        let result = folder().join("result.json");
        let mut command = Command::new(&self.python);
        command.arg(root().join("assets/peers/pybullet_husky.py")).arg(walls);
        command.args([layout, &self.seconds]).arg(&result);
        succeed(command.stdout(Stdio::null()))?;
        parse(&fs::read_to_string(&result).with_context(|| format!("cannot read {}", result.display()))?)
    }
}

/// The line about `quantity`: medians of both sides and their ratio.
fn line(what: &str, quantity: &str, ours: &[Value], peers: &[Value]) -> anyhow::Result<Value> {
    let rate = |results: &[Value]| {
        let rates: Option<Vec<f64>> = results.iter().map(|result| result[quantity].as_f64()).collect();
        median(rates.with_context(|| format!("{what}: a side reports no {quantity}"))?)
            .with_context(|| format!("{what}: nothing was measured"))
    };
    let (ours, peer) = (rate(ours)?, rate(peers)?);
    Ok(json!({
        "schema": "sharp.peer/1", "what": what, "ours": ours, "peer": peer, "ratio": ours / peer,
        "peer_name": peers[0]["name"], "rounds": peers.len(),
    }))
}

/// The middle value; of an even number the lower one.
pub(crate) fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    values.get(values.len().checked_sub(1)? / 2).copied()
}

/// Builds our side and returns where it lies: run through cargo it would wait for other builds.
fn example() -> anyhow::Result<PathBuf> {
    let mut build = cargo(&["build", "--release", "--package", "sharp-sim", "--features", "rigid3d"]);
    build.args(["--example", "peer_sim", "--message-format", "json-render-diagnostics"]);
    let output = build.stderr(Stdio::inherit()).output().context("cannot start cargo")?;
    ensure!(output.status.success(), "peer_sim cannot be built");
    let messages = String::from_utf8_lossy(&output.stdout);
    executable(&messages).context("cargo does not say where peer_sim lies")
}

/// The last program that cargo's messages, a JSON object a line, say they built.
fn executable(messages: &str) -> Option<PathBuf> {
    let mut programs = messages.lines().rev().filter_map(|line| {
        let message: Value = serde_json::from_str(line).ok()?;
        message["executable"].as_str().map(PathBuf::from)
    });
    programs.next()
}

pub(crate) fn parse(text: &str) -> anyhow::Result<Value> {
    serde_json::from_str(text).with_context(|| format!("{text:?} is no JSON"))
}

/// Where the virtual environment and the files between the sides lie.
fn folder() -> PathBuf {
    root().join("target/peers")
}

/// The interpreter of the virtual environment in `folder`, made on the first call, with the packages
/// that a file of `assets/peers` lists.
pub(crate) fn python(folder: &Path, requirements: &str) -> anyhow::Result<PathBuf> {
    let python = folder.join("bin/python");
    if !python.exists() {
        succeed(Command::new("python3").args(["-m", "venv"]).arg(folder))?;
    }
    let mut install = Command::new(&python);
    install.args(["-m", "pip", "install", "--quiet", "--requirement"]);
    succeed(install.arg(root().join("assets/peers").join(requirements)))?;
    Ok(python)
}

/// Runs `command`; stdout is ours alone, so what it says there goes nowhere.
pub(crate) fn succeed(command: &mut Command) -> anyhow::Result<()> {
    let program = command.get_program().to_owned();
    let status = command.stdout(Stdio::null()).status();
    let status = status.with_context(|| format!("cannot start {}", program.display()))?;
    ensure!(status.success(), "{} failed: {status}", program.display());
    Ok(())
}

/// How busy the machine is: the mean number of running processes over the last minute.
pub(crate) fn load() -> String {
    let text = fs::read_to_string("/proc/loadavg").unwrap_or_default();
    text.split(' ').next().filter(|word| !word.is_empty()).unwrap_or("unknown").to_owned()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_line_holds_medians_and_their_ratio() {
        let results = |name: &str, rates: [f64; 3]| rates.map(|rate| json!({"name": name, "steps": rate}));
        let (ours, peers) = (results("ours", [9.0, 80.0, 10.0]), results("bullet 3", [2.0, 1.0, 4.0]));
        let line = line("sim.steps.mesh", "steps", &ours, &peers).expect("all is there");
        assert_eq!(
            line,
            json!({
                "schema": "sharp.peer/1", "what": "sim.steps.mesh", "ours": 10.0, "peer": 2.0, "ratio": 5.0,
                "peer_name": "bullet 3", "rounds": 3,
            })
        );
    }

    #[test]
    fn a_side_without_a_rate_is_named() {
        let error = line("sim.idle.mesh", "idle", &[json!({})], &[json!({"idle": 1.0})]);
        let message = error.expect_err("ours is empty").to_string();
        assert_eq!(message, "sim.idle.mesh: a side reports no idle");
    }

    #[test]
    fn the_program_is_named_among_cargos_messages() {
        let messages = "{\"reason\":\"compiler-artifact\",\"executable\":null}\n\
            {\"executable\":\"/t/examples/peer_sim\"}\n{\"reason\":\"build-finished\"}\n";
        assert_eq!(executable(messages), Some(PathBuf::from("/t/examples/peer_sim")));
        assert_eq!(executable("warning"), None, "no message");
    }

    #[test]
    fn unknown_suites_and_maps_are_refused_before_anything_is_built() {
        for (args, expected) in [
            (
                vec!["cooking"],
                "no comparison is called \"cooking\", there are sim, learning, option, regions",
            ),
            (vec!["sim", "--map", "moon"], "no map is called \"moon\", there are grid_15, grid_75"),
            (vec!["--rounds", "0"], "--rounds is 0, must be at least 1"),
        ] {
            let args: Vec<String> = args.into_iter().map(String::from).collect();
            let error = run(&args).expect_err("refused").to_string();
            assert!(error.starts_with(expected), "{args:?}: {error}");
        }
    }
}
