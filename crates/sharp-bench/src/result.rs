//! Results: one line of JSON (`sharp.result/1`) a problem, of SHARP and of the systems to compare with.
//!
//! Keys are a contract: once written, a key keeps its meaning, and lines of before stay readable.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use sharp_drive::SuccessCount;

use crate::times::{DecisionTimes, Reuse, SolveTimes};

/// `sharp.result/1`: one line of `results.jsonl`.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct ResultLine {
    /// The name and version of the format, `sharp.result/1`.
    pub schema: String,
    /// The version of the program that measured.
    pub version: String,
    /// sharp, rrt, rrt-contact, track, mppi or sac.
    #[serde(rename = "method")]
    pub system: String,
    /// fast, paper or prior; none for the baselines.
    pub learning: String,
    /// The environment: the name of a map.
    pub env: String,
    /// The number of the problem in its environment, from 1.
    pub problem: usize,
    /// The name of the robot.
    pub robot: String,
    /// The kind of option; none for the baselines.
    pub options: String,
    /// Where critical regions came from.
    #[serde(default = "default_regions")]
    pub regions: String,
    /// Options synthesised in the environment.
    #[serde(default)]
    pub options_available: usize,
    /// The name of the noise.
    pub noise: String,
    /// What was switched off: `default`, `no_recovery`, `no_cost_update` or both with a plus between.
    #[serde(default = "default_variant")]
    pub variant: String,
    /// The simulator that executions ran in.
    #[serde(default = "default_simulator")]
    pub simulator: String,
    /// Which repetition with other random numbers, from 0.
    pub trial: u32,
    /// Root of all randomness.
    pub seed: u64,
    /// `solved`, `no_plan` or `timeout`; `driven`, `no_plan` or `timeout` for the baselines.
    pub status: String,
    /// Executions; of a baseline that was out of time, those that came to an end.
    pub episodes: u32,
    /// Executions that reached the goal.
    pub successes: u32,
    /// Contacts of all executions.
    pub collisions: u32,
    /// Executions that ran out of time or lost their way.
    pub timeouts: u32,
    /// New plans on the way, of all executions.
    pub recoveries: u32,
    /// Mean simulated time of the executions that reached the goal, seconds; 0 if none did.
    pub mean_sim_time_s: f64,
    /// The success that solving predicted, 0 to 1; 0 for the baselines.
    pub predicted_success: f64,
    /// More executions of a plan, to hold against what it predicted: 1,000.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calibration: Option<SuccessCount>,
    /// How many of the plan's options had been learnt before.
    pub reuse: Reuse,
    /// Legs of the plan by the kind of their policy.
    #[serde(default, skip_serializing_if = "BTreeMap::is_empty")]
    pub policies: BTreeMap<String, usize>,
    /// Steps of the environment that learning took.
    pub env_steps: u64,
    /// Gradient steps that learning took.
    pub gradient_steps: u64,
    /// Wall time of a decision.
    #[serde(default)]
    pub decision_us: DecisionTimes,
    /// Wall time by phase.
    pub time_s: SolveTimes,
    /// Where times were taken.
    #[serde(default)]
    pub machine: Machine,
    /// The job that measured it.
    #[serde(default)]
    pub job: String,
}

/// Why results cannot be read.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ResultError {
    /// The file is not there, or a line of it is no result.
    #[error("{}{problem}", path.display())]
    Unreadable {
        /// The file.
        path: PathBuf,
        /// The line and what is wrong with it.
        problem: String,
    },
}

/// Where times were taken.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Machine {
    /// Model of the processor; empty if the system does not tell.
    pub cpu: String,
    /// Cores of the whole machine.
    pub cores: usize,
}

/// What results were made with before there was a choice.
#[must_use]
pub fn default_regions() -> String {
    "net".to_owned()
}

fn default_variant() -> String {
    Variant::WHOLE.name()
}

fn default_simulator() -> String {
    "rapier2d".to_owned()
}

/// Which parts of SHARP ran; the ablations leave some out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Variant {
    /// Whether a robot that left its plan looked for a new one.
    pub has_recovery: bool,
    /// Whether the search learnt from what options turned out to cost.
    pub has_cost_update: bool,
}

impl Variant {
    /// Everything on.
    pub const WHOLE: Self = Self { has_recovery: true, has_cost_update: true };

    /// `default`, or what is off: `no_recovery`, `no_cost_update`, or both with a plus between.
    #[must_use]
    pub fn name(self) -> String {
        let parts = [("no_recovery", self.has_recovery), ("no_cost_update", self.has_cost_update)];
        let off: Vec<&str> = parts.iter().filter(|(_, is_on)| !is_on).map(|&(name, _)| name).collect();
        if off.is_empty() { "default".to_owned() } else { off.join("+") }
    }
}

impl ResultLine {
    /// Its executions and how many reached the goal.
    #[must_use]
    pub const fn tally(&self) -> SuccessCount {
        SuccessCount { episodes: self.episodes, successes: self.successes }
    }

    /// Returns true if there is a plan.
    #[must_use]
    pub fn is_solved(&self) -> bool {
        self.status == "solved"
    }

    /// Returns true for SHARP, false for the systems to compare with.
    #[must_use]
    pub fn is_of_sharp(&self) -> bool {
        self.system == "sharp"
    }

    /// Where the plan lies below the folder of the evaluation.
    #[must_use]
    pub fn plan_folder(&self, out: &Path) -> PathBuf {
        problem_folder(out, &self.job, self.problem)
    }
}

/// Where everything of one problem of one job lies below the folder of the evaluation.
#[must_use]
pub fn problem_folder(out: &Path, job: &str, problem: usize) -> PathBuf {
    out.join("jobs").join(job).join(format!("p{problem}"))
}

/// The baselines among the results in `path`; a last line that is still being written is left out.
///
/// # Errors
/// Returns an error if there is no such file, or that names the first line that is no result.
pub fn read_baselines(path: &Path) -> Result<Vec<ResultLine>, ResultError> {
    let broken = |problem: String| ResultError::Unreadable { path: path.to_owned(), problem };
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
#[must_use]
pub fn row_text(line: &ResultLine) -> String {
    let ResultLine { env, problem, robot, system, successes, episodes, .. } = line;
    if !line.is_of_sharp() {
        return format!("{env} P{problem} {robot} {system}: {successes} of {episodes}");
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

impl ResultLine {
    /// A made-up result, solved and driven without a failure: for tests and examples.
    #[must_use]
    pub fn example(env: &str, robot: &str, kind: &str, problem: usize) -> Self {
        Self {
            schema: "sharp.result/1".into(),
            version: "0.1.0".into(),
            system: "sharp".into(),
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
            policies: [("learnt", 5), ("profiled", 1)].map(|(kind, uses)| (kind.to_owned(), uses)).into(),
            env_steps: 0,
            gradient_steps: 0,
            time_s: SolveTimes { regions: 0.5, learn: 3.0, verify: 1.0, total: 5.0, ..SolveTimes::default() },
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_baseline_cut_short_is_left_out() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("baselines.jsonl");
        let of_sharp = serde_json::to_string(&ResultLine::example("a", "limo", "centroid", 3)).expect("JSON");
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
        let names = [(true, true), (false, true), (false, false)];
        assert_eq!(
            names.map(|(has_recovery, has_cost_update)| Variant { has_recovery, has_cost_update }.name()),
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
