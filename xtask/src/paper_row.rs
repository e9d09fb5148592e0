//! One row of the paper's table: the commands that measure it, and its line.
//!
//! A solve that runs out of this tool's time is interrupted. It keeps its trainings, and the next call goes on with them; the
//! time that it took until then is kept beside its plan and counts.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

use anyhow::{Context, bail, ensure};
use serde_json::{Value, json};

/// Wall time that the paper gives a problem, seconds.
pub(crate) const TIME_LIMIT_S: f64 = 2400.0;
/// Executions of each plan, as in the paper.
const EPISODES: &str = "20";
/// How often a running command is looked at; what a kill of this tool loses of the time that was taken.
const LOOK: Duration = Duration::from_millis(100);
const NOTE: Duration = Duration::from_secs(10);
/// Linux counts processor time in hundredths of a second.
const TICKS_PER_S: f64 = 100.0;

/// Everything that the rows of one call share.
pub(crate) struct PaperSite {
    /// The `sharp` command.
    pub(crate) program: PathBuf,
    /// Where plans, libraries and trainings lie.
    pub(crate) out: PathBuf,
    /// When measuring ends.
    pub(crate) deadline: Instant,
    /// Version and commit.
    pub(crate) version: String,
    pub(crate) machine: Value,
}

/// A row as the program names it.
pub(crate) struct NamedRow<'a>(pub(crate) &'a Value);

/// Time taken, seconds.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Spent {
    wall_s: f64,
    cpu_s: f64,
}

/// How a command ended.
struct FinishedCall {
    report: Value,
    spent: Spent,
}

impl NamedRow<'_> {
    pub(crate) fn word(&self, key: &str) -> &str {
        self.0[key].as_str().unwrap_or_default()
    }

    pub(crate) fn problem(&self) -> u64 {
        self.0["problem"].as_u64().unwrap_or_default()
    }

    /// A name for files and for `--only`.
    pub(crate) fn name(&self) -> String {
        format!("{}-p{}", self.group(), self.problem())
    }

    /// What shares a library.
    pub(crate) fn group(&self) -> String {
        let words = ["method", "env", "robot", "options"].map(|key| self.word(key));
        words.iter().filter(|word| **word != "none").copied().collect::<Vec<_>>().join("-")
    }

    fn is_of_sharp(&self) -> bool {
        self.word("options") != "none"
    }
}

impl PaperSite {
    /// Whether the library has what `row` learnt.
    pub(crate) fn has_learnt(&self, row: &NamedRow<'_>) -> bool {
        self.library(row).exists() && self.mark(row).exists()
    }

    /// Notes that the line of `row` is kept.
    ///
    /// # Errors
    /// If that cannot be written.
    pub(crate) fn note(&self, row: &NamedRow<'_>) -> anyhow::Result<()> {
        let mark = self.mark(row);
        fs::write(&mark, "").with_context(|| format!("cannot write {}", mark.display()))
    }

    fn mark(&self, row: &NamedRow<'_>) -> PathBuf {
        self.out.join("rows").join(row.name()).join("measured")
    }

    fn library(&self, row: &NamedRow<'_>) -> PathBuf {
        self.out.join("libraries").join(row.group())
    }

    /// Measures `row` and returns its line; `None` if time was up before it was done.
    ///
    /// # Errors
    /// If a command cannot be started, was interrupted by somebody else, or finds its input broken.
    pub(crate) fn measure(&self, row: &NamedRow<'_>) -> anyhow::Result<Option<Value>> {
        let folder = self.out.join("rows").join(row.name());
        fs::create_dir_all(&folder).with_context(|| format!("cannot make {}", folder.display()))?;
        let line =
            if row.is_of_sharp() { self.of_sharp(row, &folder)? } else { self.of_baseline(row, &folder)? };
        if line.is_some() {
            let _ = fs::remove_file(folder.join("spent.json"));
        }
        Ok(line)
    }

    fn of_sharp(&self, row: &NamedRow<'_>, folder: &Path) -> anyhow::Result<Option<Value>> {
        let (plan, library) = (folder.join("plan"), self.library(row));
        let [plan, library] = [&plan, &library].map(|path| path.display().to_string());
        let problem = row.problem().to_string();
        let mut args = vec!["solve", row.word("env"), "--problem", &problem, "--robot", row.word("robot")];
        args.extend(["--options", row.word("options"), "--learning", row.word("method")]);
        args.extend(["--library", &library, "--out", &plan]);
        let Some(FinishedCall { report, spent }) = self.run(&args, folder, Some(TIME_LIMIT_S))? else {
            return Ok(None);
        };
        let mut line = self.line(row, &report, spent, &args);
        line["reuse"] = report["reuse"].clone();
        if row.word("method").starts_with("paper") {
            line["legs"] = legs(&report);
        }
        if report["status"] == "solved" {
            for (key, rule) in [("with_contact", "contact"), ("without_contact", "end")] {
                let args = ["run", &plan, "--episodes", EPISODES, "--recovery", "off", "--collisions", rule];
                let Some(FinishedCall { report, .. }) = self.run(&args, folder, None)? else {
                    return Ok(None);
                };
                line[key] = count(&report);
            }
        }
        Ok(Some(line))
    }

    fn of_baseline(&self, row: &NamedRow<'_>, folder: &Path) -> anyhow::Result<Option<Value>> {
        let problem = row.problem().to_string();
        let mut args = vec!["baseline", row.word("method"), row.word("env"), "--problem", &problem];
        args.extend(["--robot", row.word("robot"), "--episodes", EPISODES, "--collisions", "contact"]);
        // Whatever one of them began it begins anew: its time does not add up.
        let _ = fs::remove_file(folder.join("spent.json"));
        let Some(FinishedCall { report, spent }) = self.run(&args, folder, Some(TIME_LIMIT_S))? else {
            return Ok(None);
        };
        let ready_s = |key: &str| report["time_s"][key].as_f64().unwrap_or_default();
        let mut line = self.line(row, &report, spent, &args);
        line["wall_s"] = rounded(ready_s("plan") + ready_s("learn"), 3);
        line["reuse"] = json!({"uses": 0, "reused": 0});
        line["env_steps"] = report["env_steps"].clone();
        line["with_contact"] = count(&report);
        // A policy that is learnt for so long is driven by one rule only.
        if row.word("method") != "sac" {
            let last = args.len() - 1;
            args[last] = "end";
            let Some(FinishedCall { report, .. }) = self.run(&args, folder, Some(TIME_LIMIT_S))? else {
                return Ok(None);
            };
            line["without_contact"] = count(&report);
        }
        Ok(Some(line))
    }

    fn line(&self, row: &NamedRow<'_>, report: &Value, spent: Spent, args: &[&str]) -> Value {
        let mut line = row.0.clone();
        line["schema"] = json!("sharp.paper/1");
        line["status"] = report["status"].clone();
        line["wall_s"] = rounded(spent.wall_s, 2);
        line["cpu_s"] = rounded(spent.cpu_s, 2);
        line["legs"] = json!([]);
        line["machine"] = self.machine.clone();
        line["version"] = json!(self.version);
        line["command"] = json!(format!("sharp {} --time-limit {TIME_LIMIT_S}", args.join(" ")));
        line
    }

    /// Runs `sharp` with `args` under what `limit_s` leaves after earlier attempts; `None` if time was up.
    fn run(
        &self,
        args: &[&str],
        folder: &Path,
        limit_s: Option<f64>,
    ) -> anyhow::Result<Option<FinishedCall>> {
        let (spent_file, report_file) = (folder.join("spent.json"), folder.join("report.json"));
        let before = limit_s.map_or(Spent::default(), |_| Spent::read(&spent_file));
        let mut command = Command::new(&self.program);
        command.args(args).arg("--json");
        if let Some(limit_s) = limit_s {
            command.args(["--time-limit", &format!("{:.1}", (limit_s - before.wall_s).max(1.0))]);
        }
        let report = fs::File::create(&report_file).context("cannot write a report")?;
        let child = command.stdout(report).stderr(Stdio::inherit()).spawn();
        let child = child.with_context(|| format!("cannot start {}", self.program.display()))?;
        let keep = |spent: Spent| limit_s.map_or(Ok(()), |_| spent.write(&spent_file));
        let (code, spent, is_stopped) = watch(child, self.deadline, before, keep)?;
        match code {
            Some(0 | 1) if !is_stopped => {
                let text = fs::read_to_string(&report_file).context("cannot read a report")?;
                let report = serde_json::from_str(&text).with_context(|| format!("{text:?} is no JSON"))?;
                Ok(Some(FinishedCall { report, spent }))
            }
            _ if is_stopped => Ok(None),
            Some(130) => bail!("interrupted; the same call goes on"),
            code => bail!("sharp {} ended with {code:?}", args.join(" ")),
        }
    }
}

/// Waits for `child`, or interrupts it at the `deadline`: its exit code, the time taken, and whether it was interrupted.
fn watch(
    mut child: Child,
    deadline: Instant,
    before: Spent,
    keep: impl Fn(Spent) -> anyhow::Result<()>,
) -> anyhow::Result<(Option<i32>, Spent, bool)> {
    let (begun, mut noted, mut is_stopped) = (Instant::now(), Instant::now(), false);
    let mut cpu_s = 0.0;
    loop {
        // A process that has ended tells its times until somebody waits for it.
        let (ticks, has_ended) = ticks(child.id());
        cpu_s = ticks.map_or(cpu_s, |ticks| ticks / TICKS_PER_S);
        let spent =
            Spent { wall_s: before.wall_s + begun.elapsed().as_secs_f64(), cpu_s: before.cpu_s + cpu_s };
        if has_ended || ticks.is_none() {
            let status = if has_ended { Some(child.wait()?) } else { child.try_wait()? };
            if let Some(status) = status {
                keep(spent)?;
                return Ok((status.code(), spent, is_stopped));
            }
        }
        if !is_stopped && Instant::now() >= deadline {
            is_stopped = true;
            let status = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
            ensure!(status.is_ok_and(|status| status.success()), "a solve cannot be interrupted");
        }
        if noted.elapsed() >= NOTE {
            keep(spent)?;
            noted = Instant::now();
        }
        sleep(LOOK);
    }
}

/// Processor time of a process, and whether it has ended; `None` where the system does not tell.
fn ticks(id: u32) -> (Option<f64>, bool) {
    let text = fs::read_to_string(format!("/proc/{id}/stat")).unwrap_or_default();
    parse_stat(&text).map_or((None, false), |(ticks, has_ended)| (Some(ticks), has_ended))
}

/// The same of what Linux says of a process: its name is in brackets, then come state and numbers.
fn parse_stat(text: &str) -> Option<(f64, bool)> {
    let words: Vec<&str> = text.rsplit_once(')')?.1.split_whitespace().collect();
    let number = |index: usize| words.get(index)?.parse::<f64>().ok();
    Some((number(11)? + number(12)?, words[0] == "Z"))
}

impl Spent {
    fn read(path: &Path) -> Self {
        let text = fs::read_to_string(path).unwrap_or_default();
        let value: Value = serde_json::from_str(&text).unwrap_or_default();
        let seconds = |key: &str| value[key].as_f64().unwrap_or_default();
        Self { wall_s: seconds("wall_s"), cpu_s: seconds("cpu_s") }
    }

    fn write(self, path: &Path) -> anyhow::Result<()> {
        let value = json!({"wall_s": self.wall_s, "cpu_s": self.cpu_s});
        fs::write(path, value.to_string()).with_context(|| format!("cannot write {}", path.display()))
    }
}

fn count(report: &Value) -> Value {
    json!({"episodes": report["episodes"], "successes": report["successes"]})
}

/// The legs of a plan; without a plan the trainings until then.
fn legs(report: &Value) -> Value {
    let of_plan = report["plan"].as_array().filter(|legs| !legs.is_empty());
    let leg = |leg: &Value| {
        let training = if of_plan.is_some() { &leg["training"] } else { leg };
        let is_reused = leg["reused"].as_bool().unwrap_or_default();
        let evaluations = training["evaluations"].as_array().filter(|_| !is_reused);
        let curve: Vec<Value> = evaluations.into_iter().flatten().map(point).collect();
        let last = || curve.last().map_or(Value::Null, |point| point[1].clone());
        let mean_return = training["mean_return"].as_f64().map_or_else(last, |value| rounded(value, 1));
        json!({
            "option": leg["option"],
            "length_m": rounded(leg["length_m"].as_f64().unwrap_or_default(), 2),
            "reused": is_reused,
            "env_steps": leg["env_steps"],
            "stop": training["stop"],
            "mean_return": mean_return,
            "curve": curve,
        })
    };
    let trainings = || report["trainings"].as_array();
    of_plan.or_else(trainings).into_iter().flatten().map(leg).collect()
}

fn point(evaluation: &Value) -> Value {
    let number = |key: &str, digits| rounded(evaluation[key].as_f64().unwrap_or_default(), digits);
    json!([
        evaluation["env_steps"],
        number("mean_return", 1),
        number("success", 3),
        number("without_contact", 3)
    ])
}

fn rounded(value: f64, digits: i32) -> Value {
    let scale = 10_f64.powi(digits);
    json!((value * scale).round() / scale)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn linux_tells_processor_time_whatever_the_name() {
        let text = "42 (a ) b) Z 1 2 3 4 5 6 7 8 9 10 250 50 0 0 20 0";
        assert_eq!(parse_stat(text), Some((300.0, true)));
        assert_eq!(parse_stat(""), None);
    }

    #[test]
    fn a_line_has_the_curves_of_what_was_trained_and_not_of_what_was_reused() {
        let evaluation =
            json!({"env_steps": 10_000, "mean_return": 512.34, "success": 0.95, "without_contact": 0.5});
        let training = json!({"stop": "rule", "mean_return": 512.34, "evaluations": [evaluation]});
        let leg = |reused: bool| json!({"option": "i:1-2-3", "length_m": 2.0, "reused": reused, "env_steps": 10_000, "training": training});
        let legs = legs(&json!({"plan": [leg(false), leg(true)]}));
        assert_eq!(legs[0]["curve"], json!([[10_000, 512.3, 0.95, 0.5]]));
        assert_eq!((&legs[0]["stop"], &legs[1]["curve"]), (&json!("rule"), &json!([])));
        let unsolved = json!({"plan": [], "trainings": [
            {"option": "i:1-2-3", "length_m": 2.0, "env_steps": 12_000, "stop": null, "evaluations": [evaluation]}]});
        let legs = super::legs(&unsolved);
        assert_eq!((&legs[0]["stop"], &legs[0]["mean_return"]), (&Value::Null, &json!(512.3)));
    }

    #[test]
    fn time_adds_up_over_attempts() {
        let path = crate::tree::root().join("target/tmp");
        fs::create_dir_all(&path).expect("a folder");
        let path = path.join("spent-test.json");
        let spent = Spent { wall_s: 12.5, cpu_s: 20.0 };
        spent.write(&path).expect("a file");
        assert_eq!(Spent::read(&path), spent);
        fs::remove_file(&path).expect("a file");
        assert_eq!(Spent::read(&path), Spent::default(), "nothing yet");
    }
}
