//! The figure of ablations: what each part is worth, measured by doing without it.

use std::collections::BTreeSet;

use sharp_draw::numbers::{percent, plain, seconds};
use sharp_draw::{Axis, Panel};

use super::cases::{Mean, ProblemKey, Results, Setting, problem, ready_s, tally};
use super::figure::{Figure, LABEL, Style, Table, heading, marker, method_legend, noted};
use crate::result::ResultLine;

const ROW: f64 = 13.0;
const HEADER: f64 = 20.0;

/// A part that was replaced or left out: how it is called, and how that changes the setting.
#[derive(Clone, Copy, Debug)]
pub(super) struct Ablation {
    pub(super) name: &'static str,
    change: fn(Setting<'_>) -> Setting<'_>,
}

/// All of them, in the order of the figure.
pub(super) const ABLATIONS: [Ablation; 7] = [
    Ablation { name: "regions by geometry", change: |setting| Setting { regions: "geometric", ..setting } },
    Ablation { name: "regions on a grid", change: |setting| Setting { regions: "grid", ..setting } },
    Ablation { name: "regions at random", change: |setting| Setting { regions: "random", ..setting } },
    Ablation { name: "no cost update", change: |setting| Setting { variant: "no_cost_update", ..setting } },
    Ablation { name: "no recovery", change: |setting| Setting { variant: "no_recovery", ..setting } },
    Ablation { name: "prior only", change: |setting| Setting { learning: "prior", ..setting } },
    Ablation { name: "the paper's learning", change: |setting| Setting { learning: "paper", ..setting } },
];

impl Ablation {
    /// The setting `main` without the part; `None` if the part is not in it.
    pub(super) fn setting<'a>(&self, main: Setting<'a>) -> Option<Setting<'a>> {
        Some((self.change)(main)).filter(|&changed| changed != main)
    }

    /// What was measured of it.
    pub(super) fn lines<'a>(&self, results: &Results<'a>) -> Vec<&'a ResultLine> {
        self.setting(results.main).map_or(vec![], |setting| results.sharp(setting))
    }
}

/// One ablation on one robot with one kind of option, and the whole on the same problems.
#[derive(Debug)]
struct Row<'a> {
    robot: &'a str,
    name: &'static str,
    options: &'a str,
    without: Vec<&'a ResultLine>,
    whole: Vec<&'a ResultLine>,
}

/// The figure, or `None` where nothing was left out.
pub(super) fn figure(results: &Results<'_>) -> Option<Figure> {
    let mut rows: Vec<Row<'_>> = ABLATIONS.iter().flat_map(|ablation| rows(ablation, results)).collect();
    if rows.is_empty() {
        return None;
    }
    // The sort is stable: ablations keep their order.
    rows.sort_by_key(|row| row.robot);
    let robots = || rows.chunk_by(|a, b| a.robot == b.robot);
    Some(Figure {
        name: "ablations",
        title: "What each part is worth",
        caption: "SHARP with one part replaced or left out: success with Wilson's 95 % interval, and mean wall time \
                  of solving. The hollow marker above each is the whole on the same problems. Recovery plays no \
                  part in predictions."
            .to_owned(),
        legend: noted(&method_legend(rows.iter().map(|row| row.options)), "hollow: the whole, on the same problems"),
        panels: robots().map(success_panel).chain(robots().map(time_panel)).collect(),
        table: table(&rows),
    })
}

/// The rows of one ablation, on problems that were solved with the whole as well.
fn rows<'a>(ablation: &Ablation, results: &Results<'a>) -> Vec<Row<'a>> {
    let whole = results.sharp(results.main);
    let without = ablation.lines(results);
    let groups: BTreeSet<(&str, &str)> =
        without.iter().map(|line| (line.robot.as_str(), line.options.as_str())).collect();
    let row = |(robot, options): (&'a str, &'a str)| {
        let of = |lines: &[&'a ResultLine], others: &[&'a ResultLine]| {
            let is_wanted = |line: &&ResultLine| line.robot == robot && line.options == options;
            let problems: BTreeSet<ProblemKey<'_>> =
                others.iter().copied().filter(is_wanted).map(problem).collect();
            let shared = |line: &&'a ResultLine| is_wanted(line) && problems.contains(&problem(line));
            lines.iter().copied().filter(shared).collect::<Vec<_>>()
        };
        let (without, whole) = (of(&without, &whole), of(&whole, &without));
        (!without.is_empty()).then_some(Row { robot, name: ablation.name, options, without, whole })
    };
    groups.into_iter().filter_map(row).collect()
}

fn success_panel(rows: &[Row<'_>]) -> Panel {
    let axis = Axis::of_shares().label("success");
    panel(rows, &format!("{}: success", rows[0].robot), (&axis, percent), |lines| {
        let tally = tally(lines);
        let values = [tally.lower95(), tally.rate(), tally.upper95()];
        (values, format!("{}/{}", tally.successes, tally.episodes))
    })
}

fn time_panel(rows: &[Row<'_>]) -> Panel {
    let logs =
        || rows.iter().flat_map(|row| [&row.without, &row.whole]).map(|lines| solving_s(lines).log10());
    let axis =
        Axis::decades(logs().fold(0.0, f64::min), logs().fold(0.0, f64::max)).label("time to solve, seconds");
    let tick = |log| plain(10_f64.powf(log));
    panel(rows, &format!("{}: time to solve", rows[0].robot), (&axis, tick), |lines| {
        ([solving_s(lines).log10(); 3], seconds(solving_s(lines)))
    })
}

/// Mean wall time of solving; what is shorter than 10 ms counts as that long.
fn solving_s(lines: &[&ResultLine]) -> f64 {
    Mean::of(lines.iter().map(|line| ready_s(line))).map_or(0.0, |time| time.mean).max(0.01)
}

/// One header an ablation, and under it a line for the whole and a line without the part for each kind.
fn panel(
    rows: &[Row<'_>],
    title: &str,
    (axis, tick): (&Axis, fn(f64) -> String),
    shown: impl Fn(&[&ResultLine]) -> ([f64; 3], String),
) -> Panel {
    let groups: Vec<&[Row<'_>]> = rows.chunk_by(|a, b| a.name == b.name).collect();
    let bottom = Panel::TOP + HEADER * groups.len() as f64 + 2.0 * ROW * rows.len() as f64;
    let mut panel = Panel::new(title.to_owned(), bottom + Axis::FOOT);
    axis.draw(&mut panel.chart, [Panel::TOP, bottom], tick);
    let mut top = Panel::TOP;
    for group in groups {
        heading(&mut panel.chart, [0.0, top + 15.0], group[0].name);
        top += HEADER;
        for row in group {
            for (lines, is_whole) in [(&row.whole, true), (&row.without, false)] {
                let ([low, value, high], number) = shown(lines);
                let (style, y) = (Style::of(row.options), top + ROW / 2.0);
                panel.chart.line(
                    [axis.at(low), y],
                    [axis.at(high), y],
                    style.color,
                    if is_whole { 1.0 } else { 2.0 },
                );
                marker(&mut panel.chart, [axis.at(value), y], &style, is_whole);
                panel.chart.text([Panel::NUMBERS, y + 4.0], LABEL.end(), number);
                top += ROW;
            }
        }
    }
    panel
}

fn table(rows: &[Row<'_>]) -> Table {
    let columns = vec![
        "change",
        "robot",
        "options",
        "problems",
        "solved",
        "success",
        "95 % interval",
        "whole",
        "95 % interval",
        "time s",
        "whole s",
    ];
    let row = |row: &Row<'_>| {
        let (without, whole) = (tally(&row.without), tally(&row.whole));
        let problems: BTreeSet<ProblemKey<'_>> = row.without.iter().map(|line| problem(line)).collect();
        let solved = row.without.iter().filter(|line| line.is_solved()).count();
        vec![
            row.name.to_owned(),
            row.robot.to_owned(),
            row.options.to_owned(),
            problems.len().to_string(),
            format!("{solved}/{}", row.without.len()),
            format!("{}/{}", without.successes, without.episodes),
            format!("{:.3}-{:.3}", without.lower95(), without.upper95()),
            format!("{}/{}", whole.successes, whole.episodes),
            format!("{:.3}-{:.3}", whole.lower95(), whole.upper95()),
            format!("{:.2}", solving_s(&row.without)),
            format!("{:.2}", solving_s(&row.whole)),
        ]
    };
    Table { columns, rows: rows.iter().map(row).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_ablation_stands_beside_the_whole_on_the_same_problems() {
        let whole = [1, 2].map(|problem| ResultLine::example("a", "limo", "centroid", problem));
        let grid = ResultLine { regions: "grid".into(), successes: 12, ..whole[0].clone() };
        let elsewhere = ResultLine { env: "b".into(), ..grid.clone() };
        let paper = ResultLine {
            learning: "paper".into(),
            status: "timeout".into(),
            successes: 0,
            ..whole[1].clone()
        };
        let lines = [&whole[0], &whole[1], &grid, &elsewhere, &paper];
        let figure = figure(&Results::new(&lines)).expect("two ablations");
        let rows: Vec<String> = figure.table.rows.iter().map(|row| row[..8].join(" ")).collect();
        assert_eq!(
            rows,
            [
                "regions on a grid limo centroid 1 1/1 12/20 0.364-0.800 20/20",
                "the paper's learning limo centroid 1 0/1 0/20 0.000-0.200 20/20"
            ]
        );
        assert_eq!(figure.panels.len(), 2, "success and time of one robot");
    }

    #[test]
    fn every_ablation_changes_something_and_one_thing_only() {
        for ablation in ABLATIONS {
            let changed = (ablation.change)(Setting::USUAL);
            let differences = [
                changed.learning != Setting::USUAL.learning,
                changed.regions != Setting::USUAL.regions,
                changed.noise != Setting::USUAL.noise,
                changed.variant != Setting::USUAL.variant,
            ];
            assert_eq!(differences.iter().filter(|&&differs| differs).count(), 1, "{}", ablation.name);
        }
    }

    #[test]
    fn without_ablations_there_is_no_figure() {
        let line = ResultLine::example("a", "limo", "centroid", 1);
        assert!(figure(&Results::new(&[&line])).is_none());
    }
}
