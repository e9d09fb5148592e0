//! The paper's own protocol from end to end (Sec. 5, appendices B and C): which rows there are, and what a page says of the
//! lines that were measured.

mod curves;
mod section;

use std::collections::BTreeMap;
use std::path::Path;

use serde::{Deserialize, Serialize};
use sharp_drive::SuccessCount;
use sharp_plan::write_atomic;
use sharp_rl::StopReason;

use super::figure::Figure;
use super::{ReportError, rows};
use crate::result::{Machine, ResultLine};
use crate::times::{Reuse, SolveTimes};

/// Wall time that the paper gives a problem, seconds.
const TIME_LIMIT_S: f64 = 2400.0;

/// One problem under one method.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct PaperRow {
    /// `paper`, `paper-tuned` and `fast` are SHARP with that learning; `rrt` and `sac` are the paper's baselines.
    pub method: String,
    /// The name of the map.
    pub env: String,
    /// The name of the robot.
    pub robot: String,
    /// The kind of option; `none` for the baselines.
    pub options: String,
    /// The number of the problem. Those of one environment, robot and kind share a library, in this order.
    pub problem: usize,
}

/// What was measured of a row.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct PaperLine {
    /// Which row.
    #[serde(flatten)]
    pub row: PaperRow,
    /// `solved`, `timeout` or `no_plan`; `driven` for the baselines.
    pub status: String,
    /// Wall time until there was a policy or a path, seconds, over all attempts if it was interrupted.
    pub wall_s: f64,
    /// Processor time of the same, seconds.
    pub cpu_s: f64,
    /// How many of the plan's options had been learnt before.
    pub reuse: Reuse,
    /// The legs of the plan; without a plan those that were trained.
    pub legs: Vec<PaperLeg>,
    /// Executions that may touch walls and go on, as in the paper.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub with_contact: Option<SuccessCount>,
    /// Executions that a contact ends.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub without_contact: Option<SuccessCount>,
    /// Environment steps of a baseline that learns.
    #[serde(default)]
    pub env_steps: u64,
    /// Where it was measured.
    pub machine: Machine,
    /// Version and commit of the program.
    pub version: String,
    /// The command that repeats it.
    pub command: String,
}

/// A leg of a plan and how it was learnt.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub struct PaperLeg {
    /// Its option.
    pub option: String,
    /// Length of its guide, metres.
    pub length_m: f64,
    /// Whether its policy existed before.
    pub reused: bool,
    /// Environment steps of its training.
    pub env_steps: u64,
    /// Why training ended; `None` where it did not, or where nothing was trained.
    pub stop: Option<StopReason>,
    /// Mean return of its policy when that was evaluated.
    pub mean_return: Option<f64>,
    /// Evaluations: steps, mean return, success with and without contact.
    #[serde(default)]
    pub curve: Vec<(u64, f64, f64, f64)>,
}

/// All rows of the table, in the order in which they are measured: what is quick first.
#[must_use]
pub fn paper_rows() -> Vec<PaperRow> {
    let sharp = |method: &str, envs: &[&str]| of_sharp(method, envs);
    let (small, large) = (["a", "b", "c", "d"], ["e", "f", "g"]);
    let all = [small.as_slice(), &large].concat();
    let mut rows = sharp("fast", &all);
    rows.extend(of_baseline("rrt", &all, true));
    rows.extend(sharp("paper", &small));
    rows.extend(sharp("paper-tuned", &small));
    rows.extend(sharp("paper", &large));
    rows.extend(of_baseline("sac", &all, false));
    rows
}

/// The protocol as the paper has it or with a tuned learner: a table and three figures each.
struct Protocol {
    method: &'static str,
    /// Titles of the figures of time, of success and of learning curves.
    titles: [&'static str; 3],
    /// Their files.
    names: [&'static str; 3],
}

const PROTOCOLS: [Protocol; 2] = [
    Protocol {
        method: "paper",
        titles: [
            "The paper's protocol: time of each problem",
            "The paper's protocol: success of each problem, contact allowed",
            "The paper's protocol: mean return while options are learnt",
        ],
        names: ["paper-time", "paper-success", "paper-curves"],
    },
    Protocol {
        method: "paper-tuned",
        titles: [
            "A tuned learner: time of each problem",
            "A tuned learner: success of each problem, contact allowed",
            "A tuned learner: mean return while options are learnt",
        ],
        names: ["paper-tuned-time", "paper-tuned-success", "paper-tuned-curves"],
    },
];

const ROBOTS: [&str; 2] = ["husky", "limo"];

/// Five problems of a small environment, the first of a large one.
fn problems(env: &str) -> std::ops::RangeInclusive<usize> {
    1..=if ["a", "b", "c", "d"].contains(&env) { 5 } else { 1 }
}

fn row(method: &str, env: &str, robot: &str, options: &str, problem: usize) -> PaperRow {
    let [method, env, robot, options] = [method, env, robot, options].map(str::to_owned);
    PaperRow { method, env, robot, options, problem }
}

fn of_sharp(method: &str, envs: &[&str]) -> Vec<PaperRow> {
    let mut rows = Vec::new();
    for env in envs {
        for robot in ROBOTS {
            for options in ["interface", "centroid"] {
                rows.extend(problems(env).map(|problem| row(method, env, robot, options, problem)));
            }
        }
    }
    rows
}

fn of_baseline(method: &str, envs: &[&str], has_all_problems: bool) -> Vec<PaperRow> {
    let mut rows = Vec::new();
    for env in envs {
        let problems = if has_all_problems { problems(env) } else { 1..=1 };
        for problem in problems {
            rows.extend(ROBOTS.map(|robot| row(method, env, robot, "none", problem)));
        }
    }
    rows
}

impl PaperLine {
    /// The legs that were trained for this row.
    fn trained(&self) -> impl Iterator<Item = &PaperLeg> {
        self.legs.iter().filter(|leg| !leg.reused && leg.env_steps > 0)
    }

    /// As the figures of other results want it.
    fn as_result(&self, count: SuccessCount) -> ResultLine {
        let PaperRow { method, env, robot, options, problem } = &self.row;
        let is_sharp = options != "none";
        let system = match method.as_str() {
            _ if is_sharp => "sharp",
            "rrt" => "rrt-contact",
            other => other,
        };
        let time_s = SolveTimes { total: self.wall_s, learn: self.wall_s, ..SolveTimes::default() };
        ResultLine {
            system: system.to_owned(),
            learning: if is_sharp { method.clone() } else { "none".to_owned() },
            status: self.status.clone(),
            successes: count.successes,
            episodes: count.episodes,
            time_s,
            ..ResultLine::example(env, robot, options, *problem)
        }
    }
}

/// Writes the figures into `images`, and into the text `page` between its two marks what `lines` say; returns the new text.
/// Of two lines of one row the later counts.
///
/// # Errors
/// Returns an error if a figure cannot be drawn or written.
///
/// # Panics
/// If the page has no marks.
pub fn write_paper(lines: &[PaperLine], page: &str, images: &Path) -> Result<String, ReportError> {
    let lines: BTreeMap<&PaperRow, &PaperLine> = lines.iter().map(|line| (&line.row, line)).collect();
    let lines: Vec<&PaperLine> = lines.into_values().collect();
    for figure in PROTOCOLS.iter().flat_map(|protocol| figures(&lines, protocol)) {
        let (svg, _) = figure.to_svg();
        write_atomic(&images.join(format!("{}.svg", figure.name)), svg.as_bytes())?;
    }
    Ok(between_marks(page, &section::text(&lines)))
}

const BEGIN: &str = "<!-- cargo xtask paper-table writes from here -->";
const END: &str = "<!-- to here -->";

/// `page` with `text` between the marks.
fn between_marks(page: &str, text: &str) -> String {
    let (before, rest) = page.split_once(BEGIN).expect("the page has the first mark");
    let (_, after) = rest.split_once(END).expect("the page has the second mark");
    format!("{before}{BEGIN}\n\n{text}\n{END}{after}")
}

/// Time and success of each problem as the paper draws them, and learning curves.
fn figures(lines: &[&PaperLine], protocol: &Protocol) -> Vec<Figure> {
    let is_own = |line: &&PaperLine| line.row.method == protocol.method;
    if !lines.iter().any(is_own) {
        return vec![];
    }
    let shown = lines.iter().filter(|line| is_own(line) || line.row.options == "none");
    let result = |line: &&PaperLine| {
        line.as_result(line.with_contact.unwrap_or(SuccessCount { episodes: 20, successes: 0 }))
    };
    let results: Vec<ResultLine> = shown.map(result).collect();
    let results: Vec<&ResultLine> = results.iter().collect();
    let ([time, success, curves], titles) = (protocol.names, protocol.titles);
    let own: Vec<&PaperLine> = lines.iter().copied().filter(|line| is_own(line)).collect();
    let mut figures =
        vec![rows::time(time, titles[0], &results), rows::success(success, titles[1], &results)];
    figures.extend(curves::figure((curves, titles[2]), own));
    figures
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A solved problem with one option that was learnt, one that was not, and one that was reused.
    fn line(problem: usize) -> PaperLine {
        let leg = |option: &str, stop| PaperLeg {
            option: option.to_owned(),
            length_m: 3.4,
            reused: false,
            env_steps: 20_000,
            stop: Some(stop),
            mean_return: Some(600.0),
            curve: vec![(10_000, -50.0, 0.0, 0.0), (20_000, 600.0, 0.65, 0.1)],
        };
        let reused = PaperLeg { reused: true, curve: vec![], ..leg("i:4-5-6", StopReason::Rule) };
        PaperLine {
            row: row("paper", "a", "husky", "interface", problem),
            status: "solved".to_owned(),
            wall_s: 300.0,
            cpu_s: 580.0,
            reuse: Reuse { uses: 3, reused: 1 },
            legs: vec![leg("i:1-2-3", StopReason::Rule), leg("i:2-3-4", StopReason::Steps), reused],
            with_contact: Some(SuccessCount { episodes: 20, successes: 12 }),
            without_contact: Some(SuccessCount { episodes: 20, successes: 0 }),
            env_steps: 0,
            machine: Machine::default(),
            version: "0.1.0".to_owned(),
            command: "sharp solve a".to_owned(),
        }
    }

    #[test]
    fn the_table_has_every_case_of_the_paper_once() {
        let rows = paper_rows();
        let count = |method: &str| rows.iter().filter(|row| row.method == method).count();
        assert_eq!(["fast", "paper", "paper-tuned", "rrt", "sac"].map(count), [92, 92, 80, 46, 14]);
        let names: std::collections::BTreeSet<&PaperRow> = rows.iter().collect();
        assert_eq!(names.len(), rows.len(), "no row twice");
    }

    #[test]
    fn a_section_says_what_was_learnt_what_was_not_and_what_is_missing() {
        let folder = tempfile::tempdir().expect("a folder");
        let (first, second) = (line(1), line(2));
        let old = PaperLine { wall_s: 1.0, ..line(1) };
        let page = format!("before\n{BEGIN}\nold\n{END}\nafter\n");
        let page = write_paper(&[old, first, second], &page, folder.path()).expect("figures");
        assert!(
            page.starts_with("before\n") && page.ends_with("\nafter\n") && !page.contains("old"),
            "{page}"
        );
        for expected in [
            "2 of 324 rows are there",
            "Of `a` 2 problems were measured and 2 ended with a plan within 2400 s. Those plans arrive in 60 % of \
             executions with contact allowed, and in 0 % where a contact is a failure.",
            "| a | husky | interface | 2 of 2 | 300 (-) | 60 % (-) | 0 % (-) | 2/6 | 43 % |",
            "| a P1 husky interface | solved | 300 | 580 | 2 | 1/3 | 20 k, 20 k | 1 | 12/20 | 0/20 | - | - |",
            "| a P2 husky interface | i:2-3-4 | 3.4 | 20000 | steps | 600 | 65, 10 % |",
            "paper a husky interface P3 P4 P5; ",
            "; paper b; ",
        ] {
            assert!(page.contains(expected), "no {expected:?} in {page}");
        }
        for name in ["paper-time", "paper-success", "paper-curves"] {
            let svg = std::fs::read_to_string(folder.path().join(format!("{name}.svg"))).expect("a figure");
            assert!(svg.starts_with("<svg") && !svg.contains("NaN"), "{name}: {svg}");
        }
        let empty = write_paper(&[], &page, folder.path()).expect("no figures");
        assert!(empty.contains("0 of 324 rows"), "{empty}");
    }
}
