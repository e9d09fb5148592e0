//! Results in order: settings told apart, the trials of one problem put together.

use std::collections::{BTreeMap, BTreeSet};

use sharp_drive::SuccessCount;

use super::figure::Style;
use crate::result::ResultLine;
use crate::shell::shell_word;

/// How a result of SHARP was made, apart from its problem, its kind of option and its trial.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct Setting<'a> {
    pub(super) learning: &'a str,
    pub(super) regions: &'a str,
    pub(super) noise: &'a str,
    pub(super) variant: &'a str,
}

impl<'a> Setting<'a> {
    /// What `sharp eval` measures unless it is told otherwise.
    pub(super) const USUAL: Setting<'static> =
        Setting { learning: "fast", regions: "net", noise: "nominal", variant: "default" };

    pub(super) fn of(line: &'a ResultLine) -> Self {
        let ResultLine { learning, regions, noise, variant, .. } = line;
        Self { learning, regions, noise, variant }
    }

    /// The flags of `sharp eval` that ask for it, each after a space; none for what is usual.
    pub(super) fn flags(&self) -> String {
        let Self { learning, regions, noise, variant } = *self;
        let switch = |off: &str| if variant.split('+').any(|part| part == off) { "off" } else { "on" };
        [
            ("learning", learning, Self::USUAL.learning),
            ("regions", regions, Self::USUAL.regions),
            ("noise", noise, Self::USUAL.noise),
            ("recovery", switch("no_recovery"), "on"),
            ("cost-update", switch("no_cost_update"), "on"),
        ]
        .into_iter()
        .filter(|(_, value, usual)| value != usual)
        .map(|(flag, value, _)| format!(" --{flag} {}", shell_word(value)))
        .collect()
    }
}

/// A problem: environment, robot and number.
pub(super) type ProblemKey<'a> = (&'a str, &'a str, usize);

pub(super) fn problem(line: &ResultLine) -> ProblemKey<'_> {
    (&line.env, &line.robot, line.problem)
}

/// The kind of option of SHARP, or the name of a baseline.
pub(super) fn method(line: &ResultLine) -> &str {
    if line.is_of_sharp() { &line.options } else { &line.system }
}

/// Wall time until a policy or a path is ready, seconds.
pub(super) fn ready_s(line: &ResultLine) -> f64 {
    if line.is_of_sharp() { line.time_s.total } else { line.time_s.plan + line.time_s.learn }
}

/// All results with the setting that the page is about.
#[derive(Debug)]
pub(super) struct Results<'a> {
    pub(super) lines: Vec<&'a ResultLine>,
    /// The usual setting, or where nothing was measured with it the one with most results.
    pub(super) main: Setting<'a>,
}

impl<'a> Results<'a> {
    /// Of `lines` that measure the same thing, as when a problem was run alone and then in a suite, the last
    /// counts.
    pub(super) fn new(lines: &[&'a ResultLine]) -> Self {
        let lines = without_repeats(lines);
        let mut counts: BTreeMap<Setting<'a>, usize> = BTreeMap::new();
        for line in lines.iter().filter(|line| line.is_of_sharp()) {
            *counts.entry(Setting::of(line)).or_insert(0) += 1;
        }
        let most = counts.iter().max_by_key(|&(&setting, &count)| (setting == Setting::USUAL, count));
        let main = most.map_or(Setting::USUAL, |(&setting, _)| setting);
        Self { lines, main }
    }

    /// SHARP's results with `setting`.
    pub(super) fn sharp(&self, setting: Setting<'_>) -> Vec<&'a ResultLine> {
        let is_wanted = |line: &&'a ResultLine| line.is_of_sharp() && Setting::of(line) == setting;
        self.lines.iter().copied().filter(is_wanted).collect()
    }

    /// SHARP's results in the main setting, and those of the baselines on the same problems under the
    /// same noise.
    pub(super) fn compared(&self) -> Vec<&'a ResultLine> {
        let mut compared = self.sharp(self.main);
        let problems: BTreeSet<_> = compared.iter().map(|line| problem(line)).collect();
        let is_rival = |line: &&'a ResultLine| {
            !line.is_of_sharp() && line.noise == self.main.noise && problems.contains(&problem(line))
        };
        compared.extend(self.lines.iter().copied().filter(is_rival));
        compared
    }
}

fn without_repeats<'a>(lines: &[&'a ResultLine]) -> Vec<&'a ResultLine> {
    let mut seen = BTreeSet::new();
    let mut last: Vec<&'a ResultLine> = lines
        .iter()
        .rev()
        .copied()
        .filter(|line| seen.insert((problem(line), method(line), Setting::of(line), line.trial, line.seed)))
        .collect();
    last.reverse();
    last
}

/// One method on one problem, all trials together.
#[derive(Clone, Debug)]
pub(super) struct MethodCase<'a> {
    pub(super) env: &'a str,
    pub(super) robot: &'a str,
    pub(super) problem: usize,
    /// Kind of option, or name of the baseline.
    pub(super) method: &'a str,
    pub(super) trials: usize,
    /// Executions of all trials.
    pub(super) tally: SuccessCount,
    /// Wall time until there is something to drive with, seconds.
    pub(super) ready_s: Mean,
    /// Simulated time of successful executions, seconds; `None` if there were none.
    pub(super) driving_s: Option<Mean>,
}

/// The cases of `lines`, by environment, robot, problem and method.
pub(super) fn cases<'a>(lines: &[&'a ResultLine]) -> Vec<MethodCase<'a>> {
    let mut groups: BTreeMap<_, Vec<&'a ResultLine>> = BTreeMap::new();
    for line in lines {
        let method = method(line);
        groups.entry((problem(line), Style::rank(method), method)).or_default().push(line);
    }
    groups
        .into_iter()
        .map(|(((env, robot, problem), _, method), lines)| {
            let arrived = lines.iter().filter(|line| line.successes > 0);
            MethodCase {
                env,
                robot,
                problem,
                method,
                trials: lines.len(),
                tally: tally(&lines),
                ready_s: Mean::of(lines.iter().map(|line| ready_s(line))).unwrap_or_default(),
                driving_s: Mean::of(arrived.map(|line| line.mean_sim_time_s)),
            }
        })
        .collect()
}

/// The executions of all `lines`.
pub(super) fn tally(lines: &[&ResultLine]) -> SuccessCount {
    let sum = |of: fn(&ResultLine) -> u32| lines.iter().map(|line| of(line)).sum();
    SuccessCount { episodes: sum(|line| line.episodes), successes: sum(|line| line.successes) }
}

/// A mean with its 95 % interval after Student; of one value both ends are the value.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Mean {
    pub(super) mean: f64,
    pub(super) low: f64,
    pub(super) high: f64,
}

/// Student's t at 97.5 % for 1, 2, ... degrees of freedom.
const STUDENT: [f64; 20] = [
    12.706, 4.303, 3.182, 2.776, 2.571, 2.447, 2.365, 2.306, 2.262, 2.228, 2.201, 2.179, 2.160, 2.145, 2.131,
    2.120, 2.110, 2.101, 2.093, 2.086,
];
/// The same for so many that they hardly matter.
const NORMAL: f64 = 1.96;

impl Mean {
    /// The mean of `values`; `None` if there are none.
    pub(super) fn of(values: impl IntoIterator<Item = f64>) -> Option<Self> {
        let values: Vec<f64> = values.into_iter().collect();
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        match values.len() {
            0 => None,
            1 => Some(Self { mean, low: mean, high: mean }),
            many => {
                let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / (count - 1.0);
                let half = STUDENT.get(many - 2).unwrap_or(&NORMAL) * (variance / count).sqrt();
                Some(Self { mean, low: mean - half, high: mean + half })
            }
        }
    }

    /// The mean with `decimals`, and the ends where they differ.
    pub(super) fn text(&self, decimals: usize) -> String {
        let Self { mean, low, high } = self;
        if low == high {
            return format!("{mean:.decimals$}");
        }
        format!("{mean:.decimals$} ({low:.decimals$}-{high:.decimals$})")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_mean_has_students_interval() {
        // By hand: mean 2, standard deviation 1, t of 2 degrees of freedom 4.303.
        let three = Mean::of([1.0, 2.0, 3.0]).expect("values");
        assert!((three.mean - 2.0).abs() < 1e-12, "{three:?}");
        assert!((three.high - 2.0 - 4.303 / 3.0_f64.sqrt()).abs() < 1e-9, "{three:?}");
        assert_eq!(three.text(1), "2.0 (-0.5-4.5)");
        assert_eq!(
            Mean::of([7.0]).map(|one| one.text(2)),
            Some("7.00".to_owned()),
            "one value has no spread"
        );
        assert_eq!(Mean::of([]), None);
        let many = Mean::of((0..100).map(f64::from)).expect("values");
        assert!((many.high - many.mean - NORMAL * 29.011 / 10.0).abs() < 0.01, "{many:?}");
    }

    #[test]
    fn trials_of_a_problem_are_one_case() {
        let first = ResultLine::example("a", "limo", "centroid", 1);
        let second = ResultLine { trial: 1, successes: 10, ..first.clone() };
        let third = ResultLine { trial: 2, successes: 0, mean_sim_time_s: 0.0, ..first.clone() };
        let cases = cases(&[&first, &second, &third]);
        assert_eq!(cases.len(), 1, "{cases:?}");
        assert_eq!(cases[0].tally, SuccessCount { episodes: 60, successes: 30 });
        assert_eq!(cases[0].trials, 3);
        assert_eq!(cases[0].driving_s.map(|time| time.mean), Some(25.0), "who never arrived has no time");
    }

    #[test]
    fn what_was_measured_twice_counts_once() {
        let old = ResultLine { successes: 3, ..ResultLine::example("a", "limo", "centroid", 1) };
        let new = ResultLine { successes: 4, ..old.clone() };
        let other = ResultLine { seed: 2, ..old.clone() };
        let results = Results::new(&[&old, &other, &new]);
        let successes: Vec<u32> = results.lines.iter().map(|line| line.successes).collect();
        assert_eq!(successes, [3, 4], "of seed 2, and the later one of seed 1");
    }

    #[test]
    fn the_page_is_about_the_usual_setting_where_there_is_one() {
        let usual = ResultLine::example("a", "limo", "centroid", 1);
        let harsh = ResultLine { noise: "harsh".into(), ..usual.clone() };
        let both = [&harsh, &harsh, &usual];
        assert_eq!(Results::new(&both).main, Setting::USUAL, "although there is less of it");
        assert_eq!(Results::new(&both[..2]).main.noise, "harsh");
        assert_eq!(Results::new(&[]).main, Setting::USUAL);
    }

    #[test]
    fn baselines_are_compared_on_the_same_problems_under_the_same_noise() {
        let line = ResultLine::example("a", "limo", "interface", 1);
        let rival = |env: &str, noise: &str| ResultLine {
            system: "rrt".into(),
            noise: noise.into(),
            ..ResultLine::example(env, "limo", "none", 1)
        };
        let [same, elsewhere, louder] = [rival("a", "nominal"), rival("b", "nominal"), rival("a", "harsh")];
        let all = [&line, &same, &elsewhere, &louder];
        let compared: Vec<&str> = Results::new(&all).compared().into_iter().map(method).collect();
        assert_eq!(compared, ["interface", "rrt"]);
    }
}
