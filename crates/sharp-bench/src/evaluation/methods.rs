//! All methods beside each other as Markdown: totals under each noise, then each method by environment.

use std::collections::BTreeMap;
use std::fmt::Write;

use sharp_drive::SuccessCount;

use super::cases::ready_s;
use crate::result::{ResultLine, default_regions};

/// Sums over some results.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Sum {
    tally: SuccessCount,
    collisions: u32,
    timeouts: u32,
    /// Simulated time of successful executions, seconds.
    sim_s: f64,
    /// Wall time until the first execution can begin, over all results, seconds.
    ready_s: f64,
    /// Median decision time of each result, over all results, microseconds.
    decision_us: f64,
    results: u32,
}

impl Sum {
    fn add(&mut self, line: &ResultLine) {
        self.tally.episodes += line.episodes;
        self.tally.successes += line.successes;
        self.collisions += line.collisions;
        self.timeouts += line.timeouts;
        self.sim_s += f64::from(line.successes) * line.mean_sim_time_s;
        self.ready_s += ready_s(line);
        self.decision_us += line.decision_us.p50;
        self.results += 1;
    }

    fn driving_s(&self) -> f64 {
        self.sim_s / f64::from(self.tally.successes.max(1))
    }
}

/// The tables of `lines`.
pub(super) fn tables(lines: &[&ResultLine]) -> String {
    let noises = distinct(lines.iter().map(|line| line.noise.clone()));
    let mut text = totals(lines);
    for method in distinct(lines.iter().map(|line| label(line))) {
        let of_method: Vec<&ResultLine> =
            lines.iter().copied().filter(|line| label(line) == method).collect();
        text += &by_environment(&method, &of_method, &noises);
    }
    text
}

/// One row for each method, noise and robot.
#[must_use]
pub fn totals(lines: &[&ResultLine]) -> String {
    let noises = distinct(lines.iter().map(|line| line.noise.clone()));
    let mut text = String::from(
        "| method | noise | robot | success | 95 % interval | collisions | timeouts | driving s | ready after s | decision us |\n|---|---|---|---|---|---|---|---|---|---|\n",
    );
    for method in distinct(lines.iter().map(|line| label(line))) {
        for noise in &noises {
            let mut sums: BTreeMap<&str, Sum> = BTreeMap::new();
            for line in lines.iter().filter(|line| label(line) == method && line.noise == *noise) {
                sums.entry(&line.robot).or_default().add(line);
            }
            for (robot, sum) in sums {
                let (tally, results) = (sum.tally, f64::from(sum.results));
                // Writing to a string cannot fail.
                let _ = writeln!(
                    text,
                    "| {method} | {noise} | {robot} | {}/{} | {:.3}-{:.3} | {} | {} | {:.1} | {:.2} | {:.1} |",
                    tally.successes,
                    tally.episodes,
                    tally.lower95(),
                    tally.upper95(),
                    sum.collisions,
                    sum.timeouts,
                    sum.driving_s(),
                    sum.ready_s / results,
                    sum.decision_us / results,
                );
            }
        }
    }
    text
}

/// Each of `items` once, in the order in which they come.
fn distinct(items: impl Iterator<Item = String>) -> Vec<String> {
    items.fold(Vec::new(), |mut seen, item| {
        if !seen.contains(&item) {
            seen.push(item);
        }
        seen
    })
}

/// The name of a baseline, or SHARP with all that is not as usual.
fn label(line: &ResultLine) -> String {
    if !line.is_of_sharp() {
        return line.system.clone();
    }
    let usual = default_regions();
    let unusual = [(&line.learning, "fast"), (&line.regions, &usual), (&line.variant, "default")];
    let words = unusual.into_iter().filter(|(word, usual)| word != usual).map(|(word, _)| word.as_str());
    ["sharp", &line.options].into_iter().chain(words).collect::<Vec<_>>().join(" ")
}

/// Rows are environments and robots, columns noises.
fn by_environment(method: &str, lines: &[&ResultLine], noises: &[String]) -> String {
    let mut rows: BTreeMap<(&str, &str), Vec<Sum>> = BTreeMap::new();
    for line in lines {
        let row = rows.entry((&line.env, &line.robot)).or_insert_with(|| vec![Sum::default(); noises.len()]);
        if let Some(column) = noises.iter().position(|noise| *noise == line.noise) {
            row[column].add(line);
        }
    }
    let rule = "---|".repeat(noises.len() + 2);
    let mut text = format!("\n`{method}`:\n\n| env | robot | {} |\n|{rule}\n", noises.join(" | "));
    for ((env, robot), sums) in rows {
        let cells: Vec<String> = sums.iter().map(cell).collect();
        let _ = writeln!(text, "| {env} | {robot} | {} |", cells.join(" | "));
    }
    text
}

/// Successes, their interval, collisions c and executions out of time t where there are any, and the
/// mean simulated time.
fn cell(sum: &Sum) -> String {
    if sum.results == 0 {
        return String::new();
    }
    let tally = sum.tally;
    let mut text =
        format!("{}/{} ({:.2}-{:.2})", tally.successes, tally.episodes, tally.lower95(), tally.upper95());
    for (count, mark) in [(sum.collisions, 'c'), (sum.timeouts, 't')] {
        if count > 0 {
            let _ = write!(text, " {count}{mark}");
        }
    }
    if tally.successes > 0 {
        let _ = write!(text, " {:.0} s", sum.driving_s());
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn problems_add_up_under_each_noise() {
        let track = |problem, successes| ResultLine {
            system: "track".into(),
            noise: "harsh".into(),
            successes,
            collisions: 20 - successes,
            mean_sim_time_s: 30.0,
            ..ResultLine::example("b", "limo", "none", problem)
        };
        let sharp = ResultLine { regions: "grid".into(), ..ResultLine::example("b", "limo", "interface", 1) };
        let lines = [track(1, 20), track(2, 18), sharp];
        let text = tables(&lines.iter().collect::<Vec<_>>());
        for expected in [
            "| track | harsh | limo | 38/40 | 0.818-0.991 | 2 | 0 | 30.0 | 3.00 | 0.0 |",
            "| sharp interface grid | nominal | limo | 20/20 | 0.800-1.000 | 0 | 0 | 25.0 | 5.00 | 0.0 |",
            "`track`:\n\n| env | robot | harsh | nominal |\n|---|---|---|---|\n\
             | b | limo | 38/40 (0.82-0.99) 2c 30 s |  |",
        ] {
            assert!(text.contains(expected), "no {expected:?} in\n{text}");
        }
    }
}
