//! The lines that a report reads: `sharp.result/1` of `sharp eval`, and those of `cargo xtask baselines`.

use std::path::{Path, PathBuf};

use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use sharp_plan::Tally;

use crate::outcome::Failure;
use crate::report::{Reuse, SolveTimes};

/// `sharp.result/1`: one line of `results.jsonl`.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(crate) struct ResultLine {
    pub(crate) schema: String,
    pub(crate) version: String,
    pub(crate) method: String,
    pub(crate) learning: String,
    pub(crate) env: String,
    pub(crate) problem: usize,
    pub(crate) robot: String,
    pub(crate) options: String,
    #[serde(default = "default_regions")]
    pub(crate) regions: String,
    /// Options synthesised in the environment.
    #[serde(default)]
    pub(crate) options_available: usize,
    pub(crate) noise: String,
    /// What was switched off: default, no_recovery, no_cost_update or both with a plus between.
    #[serde(default = "default_variant")]
    pub(crate) variant: String,
    pub(crate) trial: u32,
    pub(crate) seed: u64,
    pub(crate) status: String,
    pub(crate) episodes: u32,
    pub(crate) successes: u32,
    pub(crate) collisions: u32,
    pub(crate) timeouts: u32,
    pub(crate) recoveries: u32,
    pub(crate) mean_sim_time_s: f64,
    pub(crate) predicted_success: f64,
    pub(crate) reuse: Reuse,
    pub(crate) env_steps: u64,
    pub(crate) gradient_steps: u64,
    pub(crate) time_s: SolveTimes,
}

/// What results were made with before there was a choice.
pub(crate) fn default_regions() -> String {
    "net".to_owned()
}

fn default_variant() -> String {
    "default".to_owned()
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

    /// Name of the library that the problem shared with others.
    pub(crate) fn group(&self) -> String {
        group(&self.env, &self.robot, &self.options, &self.learning, self.seed, &self.regions)
    }

    /// Where the plan lies below the folder of the evaluation.
    pub(crate) fn plan_folder(&self, out: &Path) -> PathBuf {
        plan_folder(out, &self.group(), self.problem)
    }
}

/// Problems of one environment, robot and kind share a library: P2 to P5 reuse what P1 learnt.
pub(crate) fn group(env: &str, robot: &str, kind: &str, learning: &str, seed: u64, regions: &str) -> String {
    let group = format!("{env}-{robot}-{kind}-{learning}-{seed}");
    if regions == default_regions() { group } else { format!("{group}-{regions}") }
}

/// Where the plan of `problem` lies below the folder of the evaluation.
pub(crate) fn plan_folder(out: &Path, group: &str, problem: usize) -> PathBuf {
    out.join("plans").join(format!("{group}-p{problem}"))
}

/// One case of `cargo xtask baselines`.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct BaselineLine {
    pub(crate) method: String,
    pub(crate) noise: String,
    pub(crate) env: String,
    pub(crate) robot: String,
    pub(crate) problem: usize,
    pub(crate) report: BaselineCounts,
}

/// The part of `sharp.baseline/1` that a report shows.
#[derive(Clone, Debug, Deserialize)]
pub(crate) struct BaselineCounts {
    pub(crate) episodes: u32,
    pub(crate) successes: u32,
    /// Simulated seconds of successful executions, mean; 0 without any.
    pub(crate) mean_sim_time_s: f64,
    #[serde(default)]
    pub(crate) env_steps: u64,
    #[serde(default)]
    pub(crate) time_s: BaselineTimes,
}

/// Wall time of a baseline, seconds.
#[derive(Clone, Copy, Debug, Default, Deserialize)]
pub(crate) struct BaselineTimes {
    pub(crate) plan: f64,
    pub(crate) learn: f64,
}

impl From<&BaselineLine> for ResultLine {
    fn from(line: &BaselineLine) -> Self {
        let BaselineLine { method, noise, env, robot, problem, report } = line;
        let time_s =
            SolveTimes { plan: report.time_s.plan, learn: report.time_s.learn, ..SolveTimes::default() };
        Self {
            schema: "sharp.result/1".to_owned(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
            method: method.clone(),
            learning: "none".to_owned(),
            env: env.clone(),
            problem: *problem,
            robot: robot.clone(),
            options: "none".to_owned(),
            regions: default_regions(),
            options_available: 0,
            noise: noise.clone(),
            variant: default_variant(),
            trial: 0,
            seed: 1,
            status: "driven".to_owned(),
            episodes: report.episodes,
            successes: report.successes,
            collisions: 0,
            timeouts: 0,
            recoveries: 0,
            mean_sim_time_s: report.mean_sim_time_s,
            predicted_success: 0.0,
            reuse: Reuse { uses: 0, reused: 0 },
            env_steps: report.env_steps,
            gradient_steps: 0,
            time_s,
        }
    }
}

/// The results that an earlier run left; none if there was none.
///
/// # Errors
/// Returns an error that names the first line that is no result.
pub(crate) fn read_results(path: &Path) -> Result<Vec<ResultLine>, Failure> {
    std::fs::read_to_string(path).map_or_else(|_| Ok(vec![]), |text| parse(path, &text))
}

/// The baselines in `path`; a last line that is still being written is left out.
///
/// # Errors
/// Returns an error if there is no such file, or that names the first line that is no baseline.
pub(crate) fn read_baselines(path: &Path) -> Result<Vec<BaselineLine>, Failure> {
    let text = std::fs::read_to_string(path)
        .map_err(|error| Failure::new("FILE_INVALID", format!("{}: {error}", path.display())))?;
    parse(path, text.rfind('\n').map_or("", |end| &text[..end]))
}

fn parse<T: DeserializeOwned>(path: &Path, text: &str) -> Result<Vec<T>, Failure> {
    text.lines()
        .enumerate()
        .map(|(index, line)| {
            serde_json::from_str(line).map_err(|error| {
                Failure::new("FILE_INVALID", format!("{} line {}: {error}", path.display(), index + 1))
            })
        })
        .collect()
}

/// One result for the terminal.
pub(crate) fn row_text(line: &ResultLine) -> String {
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
            variant: default_variant(),
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

    #[test]
    fn a_baseline_cut_short_is_left_out() {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("baselines.jsonl");
        let line = r#"{"method":"rrt","noise":"none","env":"a","robot":"limo","problem":1,"report":{"episodes":20,"successes":9,"mean_sim_time_s":3.0}}"#;
        std::fs::write(&path, format!("{line}\n{}", &line[..30])).expect("a file");
        let lines = read_baselines(&path).expect("one whole line");
        assert_eq!(lines.len(), 1, "{lines:?}");
        std::fs::write(&path, format!("{line}\n{{}}\n")).expect("a file");
        let error = read_baselines(&path).expect_err("a line without a method").to_string();
        assert!(error.contains("baselines.jsonl line 2: missing field `method`"), "{error}");
    }

    #[test]
    fn groups_name_their_regions_unless_they_are_the_usual_ones() {
        let mut line = ResultLine::example("a", "limo", "centroid", 3);
        assert_eq!(line.plan_folder(Path::new("out")), Path::new("out/plans/a-limo-centroid-fast-1-p3"));
        line.regions = "grid".into();
        assert_eq!(line.group(), "a-limo-centroid-fast-1-grid");
    }
}
