//! All results as a benchmark log of OMPL, which `ompl_benchmark_statistics` turns into the database that
//! Planner Arena shows.
//!
//! A planner is a method in one setting, a run is one line of `results.jsonl`. The format wants a date,
//! which results do not have: equal results give equal bytes, so it is always the same one.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write;

use super::cases::{Setting, method, ready_s};
use super::figure::Style;
use crate::result::ResultLine;

/// Time limit of a run that `sharp eval` sets unless told otherwise, seconds.
const TIME_LIMIT_S: f64 = 2400.0;
const STATUS: [&str; 4] = ["solved", "no_plan", "timeout", "driven"];

/// What a run has: its name, its type, and its value in a line.
type Property = (&'static str, &'static str, fn(&ResultLine) -> String);

const PROPERTIES: [Property; 18] = [
    ("time", "REAL", |line| ready_s(line).to_string()),
    ("solved", "BOOLEAN", |line| u8::from(line.successes > 0).to_string()),
    ("status", "ENUM", status),
    ("success rate", "REAL", |line| line.tally().rate().to_string()),
    ("predicted success", "REAL", predicted),
    ("episodes", "INTEGER", |line| line.episodes.to_string()),
    ("successes", "INTEGER", |line| line.successes.to_string()),
    ("collisions", "INTEGER", |line| line.collisions.to_string()),
    ("timeouts", "INTEGER", |line| line.timeouts.to_string()),
    ("recoveries", "INTEGER", |line| line.recoveries.to_string()),
    ("driving time", "REAL", driving),
    ("options used", "INTEGER", |line| line.reuse.uses.to_string()),
    ("options reused", "INTEGER", |line| line.reuse.reused.to_string()),
    ("environment steps", "INTEGER", |line| line.env_steps.to_string()),
    ("environment", "TEXT", |line| line.env.clone()),
    ("robot", "TEXT", |line| line.robot.clone()),
    ("problem", "INTEGER", |line| line.problem.to_string()),
    ("trial", "INTEGER", |line| line.trial.to_string()),
];

fn status(line: &ResultLine) -> String {
    STATUS.iter().position(|name| *name == line.status).map_or_else(String::new, |index| index.to_string())
}

/// Only SHARP predicts.
fn predicted(line: &ResultLine) -> String {
    if line.is_of_sharp() { line.predicted_success.to_string() } else { String::new() }
}

/// Who never arrived has no time.
fn driving(line: &ResultLine) -> String {
    if line.successes > 0 { line.mean_sim_time_s.to_string() } else { String::new() }
}

/// The log of all `lines`.
pub(super) fn log(lines: &[&ResultLine]) -> String {
    let mut planners: BTreeMap<_, Vec<&ResultLine>> = BTreeMap::new();
    for line in lines {
        let (method, setting) = (method(line), setting(line));
        // The usual setting comes first.
        let key = (Style::rank(method), method, setting != Setting::USUAL, setting);
        planners.entry(key).or_default().push(line);
    }
    let mut log = header(lines, planners.values().map(Vec::len).max().unwrap_or(0));
    // Writing to a string cannot fail.
    let _ = writeln!(log, "{} planners", planners.len());
    for ((_, method, _, setting), runs) in planners {
        log += &planner(method, setting, &runs);
    }
    log
}

/// The setting of a result; the baselines know noise only.
fn setting(line: &ResultLine) -> Setting<'_> {
    if line.is_of_sharp() { Setting::of(line) } else { Setting { noise: &line.noise, ..Setting::USUAL } }
}

fn header(lines: &[&ResultLine], runs: usize) -> String {
    let versions: BTreeSet<&str> = lines.iter().map(|line| line.version.as_str()).collect();
    let version = versions.last().copied().unwrap_or(env!("CARGO_PKG_VERSION"));
    let seed = lines.iter().map(|line| line.seed).min().unwrap_or(0);
    let spent_s: f64 = lines.iter().map(|line| line.time_s.total).sum();
    format!(
        "SHARP version {version}\n\
         Experiment sharp_eval\n\
         0 experiment properties\n\
         Running on sharp\n\
         Starting at 1970-01-01 00:00:00\n\
         <<<|\nOne run is one problem in one trial; its executions are counted in successes of episodes.\n|>>>\n\
         <<<|\n{}|>>>\n\
         {seed} is the random seed\n\
         {TIME_LIMIT_S} seconds per run\n\
         0 MB per run\n\
         {runs} runs per planner\n\
         {spent_s} seconds spent to collect the data\n\
         1 enum type\n\
         status|{}\n",
        machines(lines),
        STATUS.join("|")
    )
}

/// One line a machine that took part.
fn machines(lines: &[&ResultLine]) -> String {
    let machines: BTreeSet<(&str, usize)> =
        lines.iter().map(|line| (&*line.machine.cpu, line.machine.cores)).collect();
    machines.into_iter().map(|(cpu, cores)| format!("{cores} cores, {}\n", cpu.replace('\n', " "))).collect()
}

fn planner(method: &str, setting: Setting<'_>, runs: &[&ResultLine]) -> String {
    let Setting { learning, regions, noise, variant } = setting;
    let common = [("learning", learning), ("regions", regions), ("noise", noise), ("variant", variant)];
    let mut text = name(method, setting) + "\n";
    // Writing to a string cannot fail.
    let _ = writeln!(text, "{} common properties", common.len());
    for (name, value) in common {
        let _ = writeln!(text, "{name} TEXT = {}", token(value));
    }
    let _ = writeln!(text, "{} properties for each run", PROPERTIES.len());
    for (name, kind, _) in PROPERTIES {
        let _ = writeln!(text, "{name} {kind}");
    }
    let _ = writeln!(text, "{} runs", runs.len());
    for run in runs {
        text.extend(PROPERTIES.iter().map(|(_, _, of)| token(&of(run)) + "; "));
        text.push('\n');
    }
    text + ".\n"
}

/// The method, and whatever in its setting is not usual.
fn name(method: &str, setting: Setting<'_>) -> String {
    let mut name = Style::of(method).label.replace(", ", "_").replace(' ', "_");
    if name == "other" {
        name = token(method);
    }
    let Setting { learning, regions, noise, variant } = Setting::USUAL;
    for (value, usual) in [
        (setting.learning, learning),
        (setting.regions, regions),
        (setting.noise, noise),
        (setting.variant, variant),
    ] {
        if value != usual {
            name += &format!("_{}", token(value));
        }
    }
    name
}

/// `text` without what separates values and lines.
fn token(text: &str) -> String {
    text.replace([';', '\n', '\r', ' '], "_")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::result::Machine;

    /// Reads `count NAME` and returns the count.
    fn counted(line: Option<&str>, name: &str) -> usize {
        let line = line.unwrap_or_else(|| panic!("the log ends before {name}"));
        let (count, rest) = line.split_once(' ').unwrap_or_else(|| panic!("{line:?} is no {name}"));
        assert_eq!(rest, name);
        count.parse().unwrap_or_else(|error| panic!("{line:?}: {error}"))
    }

    /// Follows the rules of the format through planners; returns each one's name and its runs' values.
    fn read(log: &str) -> Vec<(String, Vec<Vec<String>>)> {
        let mut lines = log.lines().skip_while(|line| !line.ends_with(" planners"));
        let planners = (0..counted(lines.next(), "planners")).map(|_| {
            let name = lines.next().expect("a planner").to_owned();
            for _ in 0..counted(lines.next(), "common properties") {
                assert!(
                    lines.next().is_some_and(|line| line.contains(" TEXT = ")),
                    "{name}: common property"
                );
            }
            let properties = counted(lines.next(), "properties for each run");
            for _ in 0..properties {
                let line = lines.next().unwrap_or_default();
                let kind = line.rsplit(' ').next().unwrap_or_default();
                assert!(["REAL", "INTEGER", "BOOLEAN", "ENUM", "TEXT"].contains(&kind), "{line:?}");
            }
            let runs = (0..counted(lines.next(), "runs")).map(|_| {
                let mut values: Vec<String> =
                    lines.next().expect("a run").split("; ").map(str::to_owned).collect();
                assert_eq!(values.pop().as_deref(), Some(""), "a run ends with a separator");
                assert_eq!(values.len(), properties, "{values:?}");
                values
            });
            let runs = runs.collect();
            assert_eq!(lines.next(), Some("."), "{name} ends");
            (name, runs)
        });
        let planners = planners.collect();
        assert_eq!(lines.next(), None, "nothing comes after the last planner");
        planners
    }

    #[test]
    fn the_header_has_every_line_in_its_place() {
        let machine = Machine { cpu: "a processor".into(), cores: 4 };
        let line = ResultLine { machine, ..ResultLine::example("a", "limo", "centroid", 1) };
        let log = log(&[&line]);
        let starts = [
            "SHARP version ",
            "Experiment ",
            "0 experiment properties",
            "Running on ",
            "Starting at 1970-01-01 00:00:00",
            "<<<|",
            "One run is",
            "|>>>",
            "<<<|",
            "4 cores, a processor",
            "|>>>",
            "1 is the random seed",
            "2400 seconds per run",
            "0 MB per run",
            "1 runs per planner",
            "5 seconds spent to collect the data",
            "1 enum type",
            "status|solved|no_plan|timeout|driven",
            "1 planners",
        ];
        for (line, start) in log.lines().zip(starts) {
            assert!(line.starts_with(start), "{line:?} does not start with {start:?}");
        }
    }

    #[test]
    fn a_planner_is_a_method_in_one_setting() {
        let line = ResultLine::example("a", "limo", "centroid", 1);
        let grid = ResultLine { regions: "grid".into(), noise: "nominal*2".into(), ..line.clone() };
        let rrt = ResultLine { system: "rrt".into(), status: "driven".into(), successes: 0, ..line.clone() };
        let walk = ResultLine { system: "walk; run".into(), ..rrt.clone() };
        let planners = read(&log(&[&line, &line, &grid, &rrt, &walk]));
        let names: Vec<(&str, usize)> =
            planners.iter().map(|(name, runs)| (name.as_str(), runs.len())).collect();
        let expected =
            [("SHARP_centroid", 2), ("SHARP_centroid_grid_nominal*2", 1), ("RRT", 1), ("walk__run", 1)];
        assert_eq!(names, expected);
        let value = |run: &[String], name| {
            let index = PROPERTIES.iter().position(|(property, ..)| *property == name).expect(name);
            run[index].clone()
        };
        let (sharp, rrt) = (&planners[0].1[0], &planners[2].1[0]);
        assert_eq!((value(sharp, "status"), value(rrt, "status")), ("0".into(), "3".into()));
        assert_eq!((value(sharp, "solved"), value(rrt, "solved")), ("1".into(), "0".into()));
        assert_eq!((value(sharp, "driving time"), value(rrt, "driving time")), ("25".into(), String::new()));
        assert_eq!(value(rrt, "predicted success"), "", "it predicts nothing");
    }

    #[test]
    fn nothing_is_a_log_too() {
        assert!(read(&log(&[])).is_empty());
    }
}
