//! The lines that a report reads: `sharp.result/1`, of SHARP and of the systems to compare with.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use sharp_plan::Tally;

use crate::args::Switch;
use crate::outcome::Failure;
use crate::report::{DecisionTimes, Reuse, SolveTimes};

/// `sharp.result/1`: one line of `results.jsonl`.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct ResultLine {
    pub(crate) schema: String,
    pub(crate) version: String,
    /// sharp, rrt, rrt-contact, track, mppi or sac.
    pub(crate) method: String,
    /// fast, paper or prior; none for the baselines.
    pub(crate) learning: String,
    pub(crate) env: String,
    pub(crate) problem: usize,
    pub(crate) robot: String,
    /// The kind of option; none for the baselines.
    pub(crate) options: String,
    #[serde(default = "default_regions")]
    pub(crate) regions: String,
    /// Options synthesised in the environment.
    #[serde(default)]
    pub(crate) options_available: usize,
    pub(crate) noise: String,
    /// What was switched off: `default`, `no_recovery`, `no_cost_update` or both with a plus between.
    #[serde(default = "default_variant")]
    pub(crate) variant: String,
    #[serde(default = "default_simulator")]
    pub(crate) simulator: String,
    pub(crate) trial: u32,
    pub(crate) seed: u64,
    /// `solved`, `no_plan` or `timeout`; `driven` for the baselines.
    pub(crate) status: String,
    pub(crate) episodes: u32,
    pub(crate) successes: u32,
    pub(crate) collisions: u32,
    pub(crate) timeouts: u32,
    pub(crate) recoveries: u32,
    pub(crate) mean_sim_time_s: f64,
    pub(crate) predicted_success: f64,
    /// More executions of a plan, to hold against what it predicted: as many as its prediction took.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub(crate) calibration: Option<Tally>,
    pub(crate) reuse: Reuse,
    pub(crate) env_steps: u64,
    pub(crate) gradient_steps: u64,
    #[serde(default)]
    pub(crate) decision_us: DecisionTimes,
    pub(crate) time_s: SolveTimes,
    #[serde(default)]
    pub(crate) machine: Machine,
    /// The job that measured it.
    #[serde(default)]
    pub(crate) job: String,
}

/// Where times were taken.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Machine {
    /// Model of the processor; empty if the system does not tell.
    pub(crate) cpu: String,
    /// Cores of the whole machine.
    pub(crate) cores: usize,
}

/// What results were made with before there was a choice.
pub(crate) fn default_regions() -> String {
    "net".to_owned()
}

fn default_variant() -> String {
    variant(Switch::On, Switch::On)
}

fn default_simulator() -> String {
    "rapier2d".to_owned()
}

/// The name of what was switched off.
pub(crate) fn variant(recovery: Switch, cost_update: Switch) -> String {
    let off = [("no_recovery", recovery), ("no_cost_update", cost_update)];
    let off: Vec<&str> =
        off.iter().filter(|(_, switch)| *switch == Switch::Off).map(|&(name, _)| name).collect();
    if off.is_empty() { "default".to_owned() } else { off.join("+") }
}

impl ResultLine {
    pub(crate) const fn tally(&self) -> Tally {
        Tally { episodes: self.episodes, successes: self.successes }
    }

    pub(crate) fn is_solved(&self) -> bool {
        self.status == "solved"
    }

    pub(crate) fn is_of_sharp(&self) -> bool {
        self.method == "sharp"
    }

    /// Where the plan lies below the folder of the evaluation.
    pub(crate) fn plan_folder(&self, out: &Path) -> PathBuf {
        problem_folder(out, &self.job, self.problem)
    }
}

/// Where everything of one problem of one job lies below the folder of the evaluation.
pub(crate) fn problem_folder(out: &Path, job: &str, problem: usize) -> PathBuf {
    out.join("jobs").join(job).join(format!("p{problem}"))
}

/// The baselines among the results in `path`; a last line that is still being written is left out.
///
/// # Errors
/// Returns an error if there is no such file, or that names the first line that is no result.
pub(crate) fn read_baselines(path: &Path) -> Result<Vec<ResultLine>, Failure> {
    let broken = |problem: String| Failure::new("FILE_INVALID", format!("{}{problem}", path.display()));
    let text = std::fs::read_to_string(path).map_err(|error| broken(format!(": {error}")))?;
    let whole = text.rfind('\n').map_or("", |end| &text[..end]);
    let mut lines: Vec<ResultLine> = whole
        .lines()
        .enumerate()
        .map(|(index, line)| {
            serde_json::from_str(line).map_err(|error| broken(format!(" line {}: {error}", index + 1)))
        })
        .collect::<Result<_, _>>()?;
    lines.retain(|line| !line.is_of_sharp());
    Ok(lines)
}

/// One result for the terminal.
pub(crate) fn row_text(line: &ResultLine) -> String {
    let ResultLine { env, problem, robot, method, successes, episodes, .. } = line;
    if !line.is_of_sharp() {
        return format!("{env} P{problem} {robot} {method}: {successes} of {episodes}");
    }
    format!(
        "{} P{} {} {}: {} of {} (predicted {:.3}), reused {} of {}, {:.1} s",
        line.env,
        line.problem,
        line.robot,
        line.options,
        line.successes,
        line.episodes,
        line.predicted_success,
        line.reuse.reused,
        line.reuse.uses,
        line.time_s.total
    )
}

#[cfg(test)]
impl ResultLine {
    /// A made-up result, solved and driven without a failure.
    pub(crate) fn example(env: &str, robot: &str, kind: &str, problem: usize) -> Self {
        Self {
            schema: "sharp.result/1".into(),
            version: "0.1.0".into(),
            method: "sharp".into(),
            learning: "fast".into(),
            env: env.into(),
            problem,
            robot: robot.into(),
            options: kind.into(),
            regions: default_regions(),
            options_available: 12,
            noise: "nominal".into(),
            trial: 0,
            seed: 1,
            status: "solved".into(),
            episodes: 20,
            successes: 20,
            collisions: 0,
            timeouts: 0,
            recoveries: 0,
            mean_sim_time_s: 25.0,
            predicted_success: 0.98,
            calibration: None,
            variant: default_variant(),
            simulator: default_simulator(),
            decision_us: DecisionTimes::default(),
            machine: Machine::default(),
            job: format!("{env}-{robot}-{kind}"),
            reuse: Reuse { uses: 4, reused: 1 },
            env_steps: 0,
            gradient_steps: 0,
            time_s: SolveTimes { regions: 0.5, learn: 3.0, verify: 1.0, total: 5.0, ..SolveTimes::default() },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::outcome::to_json;

    #[test]
    fn a_baseline_cut_short_is_left_out() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("baselines.jsonl");
        let of_sharp = to_json(&ResultLine::example("a", "limo", "centroid", 3));
        let line = of_sharp.replace("\"method\":\"sharp\"", "\"method\":\"rrt\"");
        std::fs::write(&path, format!("{of_sharp}\n{line}\n{}", &line[..30])).expect("a file");
        let lines = read_baselines(&path).expect("whole lines");
        assert_eq!(lines.len(), 1, "one is of SHARP, one is cut short: {lines:?}");
        assert_eq!((lines[0].problem, lines[0].episodes), (3, 20), "{lines:?}");
        std::fs::write(&path, format!("{line}\n{{}}\n")).expect("a file");
        let error = read_baselines(&path).expect_err("a line without a schema").to_string();
        assert!(error.contains("baselines.jsonl line 2: missing field `schema`"), "{error}");
    }

    #[test]
    fn variants_name_what_is_off() {
        let names = [(Switch::On, Switch::On), (Switch::Off, Switch::On), (Switch::Off, Switch::Off)];
        assert_eq!(
            names.map(|(recovery, cost_update)| variant(recovery, cost_update)),
            ["default", "no_recovery", "no_recovery+no_cost_update"]
        );
    }

    #[test]
    fn a_line_of_before_reads_with_what_was_meant_then() {
        let mut line = serde_json::to_value(ResultLine::example("a", "limo", "centroid", 3)).expect("JSON");
        let fields = line.as_object_mut().expect("an object");
        for field in ["variant", "simulator", "machine", "decision_us", "job"] {
            assert!(fields.remove(field).is_some(), "{field} is printed");
        }
        let line: ResultLine = serde_json::from_value(line).expect("all of them have defaults");
        assert_eq!((&*line.variant, &*line.simulator), ("default", "rapier2d"));
    }
}
