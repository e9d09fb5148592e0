//! `cargo xtask baselines`: every baseline on every problem, and the tables of `docs/results.md`.
//!
//! One case is one call of `sharp baseline`; its line goes to `DIR/baselines.jsonl` at once, so that a
//! run that was stopped goes on where it was. The tables in `DIR/baselines.md` come from these lines.

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs::{self, File, OpenOptions};
use std::io::{IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use anyhow::{Context, bail, ensure};
use serde_json::{Value, json};

use crate::process::{cargo, flag};
use crate::tree::root;

const ENVS: [&str; 7] = ["a", "b", "c", "d", "e", "f", "g"];
const ROBOTS: [&str; 2] = ["husky", "limo"];
const NOISES: [&str; 4] = ["none", "nominal", "harsh", "biased"];
/// Name, what `sharp baseline` calls it, and the rule for contacts.
const METHODS: [(&str, &str, &str); 4] = [
    ("rrt", "rrt", "end"),
    ("rrt-contact", "rrt", "contact"),
    ("track", "track", "end"),
    ("mppi", "mppi", "end"),
];
const PROBLEMS: u64 = 5;
/// Wall time of one case, seconds: no baseline needs a tenth of it.
const TIME_LIMIT_S: &str = "600";

/// One call of `sharp baseline`.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct Case {
    method: String,
    noise: String,
    env: String,
    robot: String,
    problem: u64,
}

/// Runs what is missing in `--out DIR` (`out/baselines`) of `--noise N,...`, `--methods M,...` and
/// `--envs E,...` with `--episodes N` (20) executions each, and writes the tables.
///
/// # Errors
/// If a flag names something unknown, or `sharp` cannot be built or run, or a file not be written.
pub(crate) fn run(args: &[String]) -> anyhow::Result<u8> {
    let noises = chosen(args, "--noise", &NOISES)?;
    let methods = chosen(args, "--methods", &METHODS.map(|(name, ..)| name))?;
    let envs = chosen(args, "--envs", &ENVS)?;
    let episodes: u32 = flag(args, "--episodes").unwrap_or("20").parse().context("--episodes")?;
    ensure!(episodes > 0, "--episodes is 0, must be at least 1");
    let out = PathBuf::from(flag(args, "--out").unwrap_or("out/baselines"));
    let out = if out.is_absolute() { out } else { root().join(out) };
    fs::create_dir_all(&out).with_context(|| format!("cannot create {}", out.display()))?;
    let status = cargo(&["build", "--release", "--package", "sharp-cli"]).status().context("cargo")?;
    ensure!(status.success(), "sharp does not build");
    let lines = out.join("baselines.jsonl");
    let mut done = read(&lines)?;
    let missing: Vec<Case> =
        cases(&methods, &noises, &envs).into_iter().filter(|case| !done.contains_key(case)).collect();
    let mut file = OpenOptions::new().create(true).append(true).open(&lines)?;
    for (number, case) in missing.iter().enumerate() {
        progress(number, missing.len(), case);
        let line = json!({
            "method": case.method, "noise": case.noise, "env": case.env, "robot": case.robot,
            "problem": case.problem, "report": drive(case, episodes)?,
        });
        append(&mut file, &line)?;
        done.insert(case.clone(), line["report"].clone());
    }
    let table = tables(&done);
    fs::write(out.join("baselines.md"), &table).context("cannot write the tables")?;
    print!("{table}");
    Ok(0)
}

/// The words that `--name a,b` chooses among `known`; all of them without it.
fn chosen<'a>(args: &'a [String], name: &str, known: &[&'a str]) -> anyhow::Result<Vec<&'a str>> {
    let Some(list) = flag(args, name) else { return Ok(known.to_vec()) };
    for word in list.split(',') {
        if !known.contains(&word) {
            bail!("{name} {word:?} is unknown, there are {}", known.join(", "));
        }
    }
    Ok(list.split(',').collect())
}

/// All cases, the quick methods first.
fn cases(methods: &[&str], noises: &[&str], envs: &[&str]) -> Vec<Case> {
    let mut cases = Vec::new();
    for method in methods {
        for noise in noises {
            for env in envs {
                for robot in ROBOTS {
                    cases.extend((1..=PROBLEMS).map(|problem| Case {
                        method: (*method).to_owned(),
                        noise: (*noise).to_owned(),
                        env: (*env).to_owned(),
                        robot: robot.to_owned(),
                        problem,
                    }));
                }
            }
        }
    }
    cases
}

/// The report of one case.
fn drive(case: &Case, episodes: u32) -> anyhow::Result<Value> {
    let (_, name, contact) =
        METHODS.into_iter().find(|(name, ..)| *name == case.method).context("an unknown method")?;
    let target = std::env::var_os("CARGO_TARGET_DIR").map_or_else(|| root().join("target"), PathBuf::from);
    let mut command = Command::new(root().join(target).join("release/sharp"));
    command.args(["--json", "baseline", name, &case.env, "--robot", &case.robot, "--noise", &case.noise]);
    command.args(["--problem", &case.problem.to_string(), "--episodes", &episodes.to_string()]);
    command.args(["--collisions", contact, "--time-limit", TIME_LIMIT_S]);
    let output = command.stderr(Stdio::inherit()).output().context("cannot start sharp")?;
    let text = String::from_utf8(output.stdout).context("sharp prints no text")?;
    let report: Value = serde_json::from_str(&text).with_context(|| format!("{case:?} gave {text:?}"))?;
    ensure!(report["schema"] == "sharp.baseline/1", "{case:?} gave {text}");
    Ok(report)
}

/// What earlier runs left; a last line that was cut off is dropped from the file.
fn read(path: &Path) -> anyhow::Result<BTreeMap<Case, Value>> {
    let text = match fs::read_to_string(path) {
        Ok(text) => text,
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(BTreeMap::new()),
        Err(error) => return Err(error).with_context(|| format!("cannot read {}", path.display())),
    };
    let whole = text.rfind('\n').map_or("", |end| &text[..=end]);
    if whole.len() < text.len() {
        fs::write(path, whole).with_context(|| format!("cannot write {}", path.display()))?;
    }
    whole.lines().map(|line| parse(line).with_context(|| format!("{}: {line}", path.display()))).collect()
}

fn parse(line: &str) -> anyhow::Result<(Case, Value)> {
    let value: Value = serde_json::from_str(line)?;
    let word = |key: &str| value[key].as_str().map(str::to_owned).with_context(|| format!("no {key}"));
    let case = Case {
        method: word("method")?,
        noise: word("noise")?,
        env: word("env")?,
        robot: word("robot")?,
        problem: value["problem"].as_u64().context("no problem")?,
    };
    Ok((case, value["report"].clone()))
}

fn append(file: &mut File, line: &Value) -> anyhow::Result<()> {
    writeln!(file, "{line}").context("cannot append to the results")
}

fn progress(number: usize, count: usize, case: &Case) {
    if std::io::stderr().is_terminal() {
        let Case { method, noise, env, robot, problem } = case;
        let filled = 30 * number / count.max(1);
        let bar = "#".repeat(filled) + &".".repeat(30 - filled);
        eprint!("\r[{bar}] {number}/{count} {method} {noise} {env} {robot} P{problem}          ");
    }
}

/// Sums over the reports of some cases.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Sum {
    episodes: f64,
    successes: f64,
    collisions: f64,
    timeouts: f64,
    /// Simulated seconds of successful executions.
    sim_s: f64,
    /// Planning time of every execution, seconds.
    plan_s: f64,
    /// Median decision time of each case times its executions, microseconds.
    decision_us: f64,
}

impl Sum {
    fn add(&mut self, report: &Value) {
        let number = |value: &Value| value.as_f64().unwrap_or(0.0);
        let (episodes, successes) = (number(&report["episodes"]), number(&report["successes"]));
        self.episodes += episodes;
        self.successes += successes;
        self.collisions += number(&report["collisions"]);
        self.timeouts += number(&report["timeouts"]);
        self.sim_s += successes * number(&report["mean_sim_time_s"]);
        self.plan_s += episodes * number(&report["time_s"]["plan"]);
        self.decision_us += episodes * number(&report["decision_us"]["p50"]);
    }

    /// Wilson's 95 % interval of the success rate.
    fn interval95(&self) -> (f64, f64) {
        let (n, z) = (self.episodes.max(1.0), 1.959_964);
        let rate = self.successes / n;
        let centre = (rate + z * z / (2.0 * n)) / (1.0 + z * z / n);
        let half = z / (1.0 + z * z / n) * (rate * (1.0 - rate) / n + z * z / (4.0 * n * n)).sqrt();
        ((centre - half).max(0.0), (centre + half).min(1.0))
    }
}

/// The tables, in Markdown: totals, then for each method the environments.
fn tables(done: &BTreeMap<Case, Value>) -> String {
    let mut totals: BTreeMap<(usize, usize, &str), Sum> = BTreeMap::new();
    let mut cells: BTreeMap<(usize, &str, &str, usize), Sum> = BTreeMap::new();
    for (case, report) in done {
        let method = METHODS.iter().position(|(name, ..)| *name == case.method);
        let noise = NOISES.iter().position(|name| *name == case.noise);
        let (Some(method), Some(noise)) = (method, noise) else { continue };
        totals.entry((method, noise, &case.robot)).or_default().add(report);
        cells.entry((method, &case.env, &case.robot, noise)).or_default().add(report);
    }
    let mut text = totals_table(&totals);
    for (method, (name, ..)) in METHODS.iter().enumerate() {
        let rows: BTreeMap<(&str, &str), BTreeMap<usize, Sum>> =
            cells.iter().filter(|(key, _)| key.0 == method).fold(BTreeMap::new(), |mut rows, (key, sum)| {
                rows.entry((key.1, key.2)).or_default().insert(key.3, *sum);
                rows
            });
        if !rows.is_empty() {
            text += &method_table(name, &rows);
        }
    }
    text
}

fn totals_table(totals: &BTreeMap<(usize, usize, &str), Sum>) -> String {
    let mut text = String::from(
        "| method | noise | robot | success | 95 % interval | collisions | timeouts | driving s | planning s | decision us |\n|---|---|---|---|---|---|---|---|---|---|\n",
    );
    for ((method, noise, robot), sum) in totals {
        let (lower, upper) = sum.interval95();
        let n = sum.episodes.max(1.0);
        let _ = writeln!(
            text,
            "| {} | {} | {robot} | {}/{} | {lower:.3}-{upper:.3} | {} | {} | {:.1} | {:.2} | {:.1} |",
            METHODS[*method].0,
            NOISES[*noise],
            sum.successes,
            sum.episodes,
            sum.collisions,
            sum.timeouts,
            sum.sim_s / sum.successes.max(1.0),
            sum.plan_s / n,
            sum.decision_us / n,
        );
    }
    text
}

/// Rows are environments and robots, columns noises: successes, their interval, collisions c and
/// executions out of time t where there are any, and the mean simulated time.
fn method_table(name: &str, rows: &BTreeMap<(&str, &str), BTreeMap<usize, Sum>>) -> String {
    let mut text =
        format!("\n`{name}`:\n\n| env | robot | {} |\n|---|---|---|---|---|---|\n", NOISES.join(" | "));
    for ((env, robot), sums) in rows {
        let cells: Vec<String> =
            (0..NOISES.len()).map(|noise| sums.get(&noise).map_or("".into(), cell)).collect();
        let _ = writeln!(text, "| {env} | {robot} | {} |", cells.join(" | "));
    }
    text
}

fn cell(sum: &Sum) -> String {
    let (lower, upper) = sum.interval95();
    let mut text = format!("{}/{} ({lower:.2}-{upper:.2})", sum.successes, sum.episodes);
    for (count, mark) in [(sum.collisions, 'c'), (sum.timeouts, 't')] {
        if count > 0.0 {
            let _ = write!(text, " {count}{mark}");
        }
    }
    if sum.successes > 0.0 {
        let _ = write!(text, " {:.0} s", sum.sim_s / sum.successes);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(line: &str) -> Vec<String> {
        line.split_whitespace().map(String::from).collect()
    }

    fn line(problem: u64, successes: u32) -> String {
        json!({
            "method": "track", "noise": "harsh", "env": "b", "robot": "limo", "problem": problem,
            "report": {
                "episodes": 20, "successes": successes, "collisions": 20 - successes, "timeouts": 0,
                "mean_sim_time_s": 30.0, "time_s": {"plan": 0.5}, "decision_us": {"p50": 4.0},
            },
        })
        .to_string()
    }

    #[test]
    fn every_case_comes_once_and_only_of_what_is_chosen() {
        let args = words("--noise harsh,none --methods=track --envs a");
        let noises = chosen(&args, "--noise", &NOISES).expect("known");
        let methods = chosen(&args, "--methods", &["rrt", "track"]).expect("known");
        let envs = chosen(&args, "--envs", &ENVS).expect("known");
        let all = cases(&methods, &noises, &envs);
        assert_eq!(all.len(), 20, "2 noises, 2 robots, 5 problems: {all:?}");
        let unique: std::collections::BTreeSet<_> = all.iter().collect();
        assert_eq!(unique.len(), all.len(), "no case twice");
        let error = chosen(&words("--noise loud"), "--noise", &NOISES).expect_err("unknown").to_string();
        assert_eq!(error, "--noise \"loud\" is unknown, there are none, nominal, harsh, biased");
    }

    #[test]
    fn a_killed_run_goes_on_after_its_last_whole_line() {
        let path = std::env::temp_dir().join(format!("sharp-baselines-{}.jsonl", std::process::id()));
        fs::write(&path, line(1, 20) + "\n" + &line(2, 19)[..40]).expect("a temporary file");
        let done = read(&path).expect("the first line is whole");
        assert_eq!(done.keys().map(|case| case.problem).collect::<Vec<_>>(), [1], "{done:?}");
        let kept = fs::read_to_string(&path).expect("still there");
        assert_eq!(kept, line(1, 20) + "\n", "the half line must not spoil the next one");
        fs::remove_file(&path).expect("still there");
    }

    #[test]
    fn tables_add_up_problems() {
        let done: BTreeMap<_, _> =
            [line(1, 20), line(2, 18)].iter().map(|line| parse(line).expect("whole")).collect();
        let text = tables(&done);
        assert!(
            text.contains("| track | harsh | limo | 38/40 | 0.835-0.986 | 2 | 0 | 30.0 | 0.50 | 4.0 |"),
            "{text}"
        );
        assert!(text.contains("| b | limo |  |  | 38/40 (0.83-0.99) 2c 30 s |  |"), "{text}");
    }
}
