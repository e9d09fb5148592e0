//! Figures with one row a method under each problem: success with its interval, and driving time.

use std::collections::BTreeSet;

use sharp_plan::Tally;

use super::figure::{
    Axis, Figure, INK, LEFT, Panel, RIGHT, Style, TEXT, TOP, Table, legend, percent, plain, seconds,
};
use super::lines::{BaselineLine, ResultLine};
use crate::render::Anchor;

const ROW: f64 = 13.0;
const GAP: f64 = 7.0;

/// What one method did on one problem.
#[derive(Clone, Copy, Debug)]
struct Row<'a> {
    env: &'a str,
    robot: &'a str,
    problem: usize,
    /// Kind of option, or name of the baseline.
    method: &'a str,
    tally: Tally,
    /// Mean simulated time of successful executions.
    sim_time_s: f64,
}

/// What a figure shows of a row.
struct Shown {
    /// Both ends of the interval and what lies between; `None` if there is nothing to show.
    values: fn(&Row<'_>) -> Option<[f64; 3]>,
    /// The number at the right.
    number: fn(&Row<'_>) -> String,
    /// The axis of a panel with these rows.
    axis: fn(&[Row<'_>]) -> Axis,
    /// How the axis writes its values.
    tick: fn(f64) -> String,
}

/// Success of every problem with its interval.
pub(super) fn success(lines: &[&ResultLine], baselines: &[BaselineLine]) -> Figure {
    let rows = rows(lines, baselines);
    let shown = Shown {
        values: |row| Some([row.tally.lower95(), row.tally.rate(), row.tally.upper95()]),
        number: |row| format!("{}/{}", row.tally.successes, row.tally.episodes),
        axis: |_| Axis { low: 0.0, high: 1.0, ends: [LEFT, RIGHT] },
        tick: percent,
    };
    Figure {
        name: "success",
        title: "Success of each problem",
        caption: "Share of executions that reached the goal without touching a wall, with Wilson's 95 % \
                  interval; a problem without a plan counts as failed. Only RRT with contact allowed may \
                  touch walls, back off and go on."
            .to_owned(),
        legend: legend(rows.iter().map(|row| row.method)),
        panels: panels(&rows, &shown),
        table: table(&rows),
    }
}

/// Driving time of every problem.
pub(super) fn driving(lines: &[&ResultLine], baselines: &[BaselineLine]) -> Figure {
    let rows = rows(lines, baselines);
    let shown = Shown {
        values: |row| (row.tally.successes > 0).then_some([row.sim_time_s; 3]),
        number: |row| if row.tally.successes > 0 { seconds(row.sim_time_s) } else { "never".to_owned() },
        axis: |rows| Axis::from_zero(rows.iter().map(|row| row.sim_time_s).fold(0.0, f64::max)),
        tick: plain,
    };
    Figure {
        name: "driving",
        title: "Driving time of each problem",
        caption: "Mean simulated time of the executions that reached the goal, seconds. A method that \
                  fails on the long ways looks quicker than it is: read it beside the success. Each panel has an axis of its own."
            .to_owned(),
        legend: legend(rows.iter().map(|row| row.method)),
        panels: panels(&rows, &shown),
        table: table(&rows),
    }
}

/// SHARP's lines, then the baselines' lines for the same problems.
fn rows<'a>(lines: &[&'a ResultLine], baselines: &'a [BaselineLine]) -> Vec<Row<'a>> {
    let problems: BTreeSet<_> = lines.iter().map(|line| (&*line.env, &*line.robot, line.problem)).collect();
    let mut rows: Vec<Row<'a>> = lines
        .iter()
        .map(|line| Row {
            env: &line.env,
            robot: &line.robot,
            problem: line.problem,
            method: &line.options,
            tally: line.tally(),
            sim_time_s: line.mean_sim_time_s,
        })
        .collect();
    let shared = baselines.iter().filter(|line| problems.contains(&(&*line.env, &*line.robot, line.problem)));
    rows.extend(shared.map(|line| Row {
        env: &line.env,
        robot: &line.robot,
        problem: line.problem,
        method: &line.method,
        tally: Tally { episodes: line.report.episodes, successes: line.report.successes },
        sim_time_s: line.report.mean_sim_time_s,
    }));
    rows.sort_by_key(|row| (row.env, row.robot, row.problem, Style::rank(row.method), row.method));
    rows
}

fn panels(rows: &[Row<'_>], shown: &Shown) -> Vec<Panel> {
    let same = |a: &Row<'_>, b: &Row<'_>| (a.env, a.robot) == (b.env, b.robot);
    rows.chunk_by(same).map(|rows| panel(rows, shown)).collect()
}

fn panel(rows: &[Row<'_>], shown: &Shown) -> Panel {
    let problems: Vec<&[Row<'_>]> = rows.chunk_by(|a, b| a.problem == b.problem).collect();
    let bottom = TOP + GAP * problems.len() as f64 + ROW * rows.len() as f64;
    let title = format!("environment {}, {}", rows[0].env, rows[0].robot);
    let mut panel = Panel::new(title, bottom + 18.0);
    let axis = (shown.axis)(rows);
    axis.draw(&mut panel.chart, [TOP, bottom], shown.tick);
    let mut top = TOP;
    for rows in problems {
        top += GAP;
        let label = format!("P{}", rows[0].problem);
        panel.chart.text([0.0, top + 10.0], Anchor::Start, TEXT, INK, label);
        for row in rows {
            mark(&mut panel, row, shown, &axis, top + ROW / 2.0);
            top += ROW;
        }
    }
    panel
}

fn mark(panel: &mut Panel, row: &Row<'_>, shown: &Shown, axis: &Axis, y: f64) {
    let style = Style::of(row.method);
    if let Some([low, value, high]) = (shown.values)(row) {
        panel.chart.line([axis.at(low), y], [axis.at(high), y], style.color, 2.0);
        panel.chart.marker([axis.at(value), y], style.shape, 3.6, style.color);
    }
    panel.chart.text([RIGHT + 8.0, y + 4.0], Anchor::Start, TEXT, INK, (shown.number)(row));
}

fn table(rows: &[Row<'_>]) -> Table {
    let columns = vec!["env", "robot", "problem", "method", "success", "95 % interval", "driving s"];
    let row = |row: &Row<'_>| {
        let driving = if row.tally.successes > 0 { format!("{:.1}", row.sim_time_s) } else { "-".into() };
        vec![
            row.env.to_owned(),
            row.robot.to_owned(),
            format!("P{}", row.problem),
            method(row.method),
            format!("{}/{}", row.tally.successes, row.tally.episodes),
            format!("{:.3}-{:.3}", row.tally.lower95(), row.tally.upper95()),
            driving,
        ]
    };
    Table { columns, rows: rows.iter().map(row).collect() }
}

/// The label of a method; one without a style keeps its name.
fn method(name: &str) -> String {
    match Style::of(name).label {
        "other" => name.to_owned(),
        label => label.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluation::lines::BaselineCounts;

    fn baseline(env: &str, successes: u32) -> BaselineLine {
        BaselineLine {
            method: "rrt".into(),
            noise: "nominal".into(),
            env: env.into(),
            robot: "limo".into(),
            problem: 1,
            report: BaselineCounts { episodes: 20, successes, mean_sim_time_s: 12.5 },
        }
    }

    #[test]
    fn baselines_stand_beside_the_same_problem_only() {
        let line = ResultLine::example("a", "limo", "interface", 1);
        let figure = success(&[&line], &[baseline("a", 5), baseline("b", 6)]);
        let rows: Vec<String> = figure.table.rows.iter().map(|row| row.join(" ")).collect();
        assert_eq!(
            rows,
            ["a limo P1 SHARP interface 20/20 0.839-1.000 25.0", "a limo P1 RRT 5/20 0.112-0.469 12.5"]
        );
        assert_eq!(figure.panels.len(), 1, "environment b has no result of SHARP");
    }

    #[test]
    fn who_never_arrived_has_no_driving_time() {
        let line = ResultLine::example("a", "limo", "interface", 1);
        let figure = driving(&[&line], &[baseline("a", 0)]);
        let svg = figure.to_svg();
        assert!(svg.contains(">never</text>") && !svg.contains(">12.5 s</text>"), "{svg}");
    }
}
