//! Figures with one row a method under each problem: time until it can drive, success, driving time.

use sharp_draw::numbers::{percent, plain, seconds};
use sharp_draw::{Axis, Chart, Panel};

use super::cases::{MethodCase, cases};
use super::figure::{Figure, LABEL, Style, Table, marker, method_legend, noted};
use crate::result::ResultLine;

const ROW: f64 = 13.0;
const GAP: f64 = 7.0;
/// What is shorter is shown as long as this: whoever waits cannot tell.
const SHORTEST_S: f64 = 0.01;

/// What a figure shows of a case.
struct Shown {
    /// Both ends of the interval and what lies between; `None` if there is nothing to show.
    values: fn(&MethodCase<'_>) -> Option<[f64; 3]>,
    /// The number at the right.
    number: fn(&MethodCase<'_>) -> String,
    /// The axis of a panel with these cases.
    axis: fn(&[MethodCase<'_>]) -> Axis,
    /// How the axis writes its values.
    tick: fn(f64) -> String,
    /// Columns of the table behind those that name the case.
    columns: &'static [CaseColumn],
}

/// A column: its name, and what a case has in it.
type CaseColumn = (&'static str, fn(&MethodCase<'_>) -> String);

/// Time until there is something to drive with: the paper's figure of times.
pub(super) fn time(name: &'static str, title: &'static str, lines: &[&ResultLine]) -> Figure {
    let shown = Shown {
        values: |case| {
            let time = case.ready_s;
            Some([time.low, time.mean, time.high].map(|seconds| seconds.max(SHORTEST_S).log10()))
        },
        number: |case| seconds(case.ready_s.mean),
        axis: |cases| {
            let logs = || cases.iter().map(|case| case.ready_s.mean.max(SHORTEST_S).log10());
            Axis::decades(logs().fold(0.0, f64::min), logs().fold(0.0, f64::max)).label("wall time, seconds")
        },
        tick: |log| plain(10_f64.powf(log)),
        columns: &[("time s", |case| case.ready_s.text(2))],
    };
    let caption = "Wall time until there is a policy or a path, seconds, on a logarithmic axis; over several \
                   trials the mean with Student's 95 % interval. SHARP: everything that sharp solve does, \
                   regions, abstraction, learning and verification; problems of one robot and kind share a \
                   library and are solved in order. SAC: learning. RRT, tracking, MPPI: planning of one \
                   execution. A hollow marker never reached the goal.";
    figure((name, title), caption, lines, &shown)
}

/// Success of every problem with its interval: the paper's figure of success.
pub(super) fn success(name: &'static str, title: &'static str, lines: &[&ResultLine]) -> Figure {
    let shown = Shown {
        values: |case| Some([case.tally.lower95(), case.tally.rate(), case.tally.upper95()]),
        number: |case| format!("{}/{}", case.tally.successes, case.tally.episodes),
        axis: |_| Axis::of_shares().label("success"),
        tick: percent,
        columns: &[
            ("success", |case| format!("{}/{}", case.tally.successes, case.tally.episodes)),
            ("95 % interval", |case| format!("{:.3}-{:.3}", case.tally.lower95(), case.tally.upper95())),
        ],
    };
    let caption = "Share of executions, of all trials together, that reached the goal without touching a wall, \
                   with Wilson's 95 % interval; a problem without a plan counts as failed. Only RRT with \
                   contact allowed may touch walls, back off and go on.";
    figure((name, title), caption, lines, &shown)
}

/// Driving time of every problem.
pub(super) fn driving(lines: &[&ResultLine]) -> Figure {
    let shown = Shown {
        values: |case| case.driving_s.map(|time| [time.low, time.mean, time.high]),
        number: |case| case.driving_s.map_or_else(|| "never".to_owned(), |time| seconds(time.mean)),
        axis: |cases| {
            let times = cases.iter().filter_map(|case| case.driving_s);
            Axis::from_zero(times.map(|time| time.mean).fold(0.0, f64::max)).label("driving time, seconds")
        },
        tick: plain,
        columns: &[("driving s", |case| case.driving_s.map_or_else(|| "-".to_owned(), |time| time.text(1)))],
    };
    let caption = "Mean simulated time of the executions that reached the goal, seconds; over several trials \
                   with Student's 95 % interval. A method that fails on the long ways looks quicker than it \
                   is: read it beside the success. Each panel has an axis of its own.";
    figure(("driving", "Driving time of each problem"), caption, lines, &shown)
}

fn figure(
    (name, title): (&'static str, &'static str),
    caption: &str,
    lines: &[&ResultLine],
    shown: &Shown,
) -> Figure {
    let cases = cases(lines);
    let same = |a: &MethodCase<'_>, b: &MethodCase<'_>| (a.env, a.robot) == (b.env, b.robot);
    Figure {
        name,
        title,
        caption: caption.to_owned(),
        legend: legend_of(&cases),
        panels: cases.chunk_by(same).map(|cases| panel(cases, shown)).collect(),
        table: table(&cases, shown.columns),
    }
}

/// The methods, and what hollow markers say where there are any.
fn legend_of(cases: &[MethodCase<'_>]) -> Chart {
    let methods = method_legend(cases.iter().map(|case| case.method));
    let has_hollow = cases.iter().any(|case| case.tally.successes == 0);
    if has_hollow { noted(&methods, "hollow: never reached the goal") } else { methods }
}

fn panel(cases: &[MethodCase<'_>], shown: &Shown) -> Panel {
    let problems: Vec<&[MethodCase<'_>]> = cases.chunk_by(|a, b| a.problem == b.problem).collect();
    let bottom = Panel::TOP + GAP * problems.len() as f64 + ROW * cases.len() as f64;
    let title = format!("environment {}, {}", cases[0].env, cases[0].robot);
    let mut panel = Panel::new(title, bottom + Axis::FOOT);
    let axis = (shown.axis)(cases);
    axis.draw(&mut panel.chart, [Panel::TOP, bottom], shown.tick);
    let mut top = Panel::TOP;
    for cases in problems {
        top += GAP;
        let label = format!("P{}", cases[0].problem);
        panel.chart.text([0.0, top + 10.0], LABEL, label);
        for case in cases {
            mark(&mut panel, case, shown, &axis, top + ROW / 2.0);
            top += ROW;
        }
    }
    panel
}

fn mark(panel: &mut Panel, case: &MethodCase<'_>, shown: &Shown, axis: &Axis, y: f64) {
    let style = Style::of(case.method);
    if let Some([low, value, high]) = (shown.values)(case) {
        panel.chart.line([axis.at(low), y], [axis.at(high), y], style.color, 2.0);
        marker(&mut panel.chart, [axis.at(value), y], &style, case.tally.successes == 0);
    }
    panel.chart.text([Panel::NUMBERS, y + 4.0], LABEL.end(), (shown.number)(case));
}

fn table(cases: &[MethodCase<'_>], more: &[CaseColumn]) -> Table {
    let mut columns = vec!["env", "robot", "problem", "method", "trials"];
    columns.extend(more.iter().map(|(name, _)| name));
    let row = |case: &MethodCase<'_>| {
        let mut row = vec![
            case.env.to_owned(),
            case.robot.to_owned(),
            format!("P{}", case.problem),
            label(case.method),
            case.trials.to_string(),
        ];
        row.extend(more.iter().map(|(_, of)| of(case)));
        row
    };
    Table { columns, rows: cases.iter().map(row).collect() }
}

/// The label of a method; one without a style keeps its name.
pub(super) fn label(name: &str) -> String {
    match Style::of(name).label {
        "other" => name.to_owned(),
        label => label.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::times::SolveTimes;

    fn baseline(successes: u32) -> ResultLine {
        let line = ResultLine::example("a", "limo", "none", 1);
        let mean_sim_time_s = if successes == 0 { 0.0 } else { 12.5 };
        ResultLine { system: "rrt".into(), successes, mean_sim_time_s, ..line }
    }

    #[test]
    fn methods_stand_side_by_side() {
        let line = ResultLine::example("a", "limo", "interface", 1);
        let figure = success("success", "Success", &[&line, &baseline(5)]);
        let rows: Vec<String> = figure.table.rows.iter().map(|row| row.join(" ")).collect();
        assert_eq!(
            rows,
            ["a limo P1 SHARP interface 1 20/20 0.800-1.000", "a limo P1 RRT 1 5/20 0.096-0.494"]
        );
        assert_eq!(figure.panels.len(), 1, "one environment, one robot");
    }

    #[test]
    fn who_never_arrived_has_no_driving_time_and_a_hollow_marker() {
        let svg = driving(&[&baseline(0)]).to_svg().0;
        assert!(svg.contains(">never</text>") && !svg.contains(">12.5 s</text>"), "{svg}");
        let hollow = |successes| {
            time("time", "Time", &[&baseline(successes)]).panels[0]
                .chart
                .to_svg("")
                .matches("#ffffff")
                .count()
        };
        assert_eq!(hollow(0), hollow(1) + 1, "a white heart");
    }

    #[test]
    fn times_of_all_sizes_fit_on_one_axis() {
        let mut slow = ResultLine::example("a", "limo", "centroid", 1);
        slow.time_s.total = 2400.0;
        let quick =
            ResultLine { time_s: SolveTimes::default(), ..ResultLine::example("a", "limo", "interface", 1) };
        let svg = time("time", "Time", &[&slow, &quick]).to_svg().0;
        for tick in [">0.01<", ">1<", ">10000<", ">2400 s<", ">0.00 s<"] {
            assert!(svg.contains(tick), "no {tick} in {svg}");
        }
    }
}
