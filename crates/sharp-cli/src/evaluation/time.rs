//! The figure of solving time: one bar a problem, one colour a phase.

use std::collections::BTreeSet;

use super::figure::{Axis, Figure, INK, LEFT, Panel, RIGHT, SOFT, TEXT, TOP, Table, key, plain, seconds};
use super::lines::ResultLine;
use crate::render::{Anchor, Shape};
use crate::report::SolveTimes;

const BAR: f64 = 13.0;
const HEADER: f64 = 20.0;

/// A phase: its name, its colour, and how long it took.
type Phase = (&'static str, &'static str, fn(&SolveTimes) -> f64);

/// Phases in the order of the algorithm.
const PHASES: [Phase; 7] = [
    ("regions", "#cc79a7", |time| time.regions),
    ("abstraction", "#e69f00", |time| time.abstraction),
    ("search", "#f0e442", |time| time.search),
    ("guides", "#56b4e9", |time| time.guide),
    ("learning", "#0072b2", |time| time.learn),
    ("verification", "#009e73", |time| time.verify),
    ("rest", "#999999", rest),
];

/// What no other phase counts: reading the map, writing the plan and its pictures.
fn rest(time: &SolveTimes) -> f64 {
    let counted: f64 = PHASES[..PHASES.len() - 1].iter().map(|(_, _, of)| of(time)).sum();
    (time.total - counted).max(0.0)
}

pub(super) fn figure(lines: &[&ResultLine]) -> Figure {
    let envs: BTreeSet<&str> = lines.iter().map(|line| line.env.as_str()).collect();
    let mut columns = vec!["env", "robot", "options", "problem"];
    columns.extend(PHASES.map(|(name, ..)| name));
    columns.push("total s");
    Figure {
        name: "time",
        title: "Time to solve a problem",
        caption: "Wall time of sharp solve by phase, seconds. Problems of one robot and kind share a \
                  library and are solved in order, so later ones reuse what earlier ones learnt. Each \
                  panel has an axis of its own."
            .to_owned(),
        legend: key(&PHASES.map(|(name, color, _)| (name, color, Shape::Square))),
        panels: envs
            .iter()
            .map(|env| panel(env, &lines.iter().copied().filter(|line| line.env == *env).collect::<Vec<_>>()))
            .collect(),
        table: Table { columns, rows: lines.iter().map(|line| row(line)).collect() },
    }
}

fn row(line: &ResultLine) -> Vec<String> {
    let mut row =
        vec![line.env.clone(), line.robot.clone(), line.options.clone(), format!("P{}", line.problem)];
    row.extend(PHASES.map(|(_, _, of)| format!("{:.2}", of(&line.time_s))));
    row.push(format!("{:.2}", line.time_s.total));
    row
}

fn panel(env: &str, lines: &[&ResultLine]) -> Panel {
    let groups: BTreeSet<(&str, &str)> = lines.iter().map(|line| (&*line.robot, &*line.options)).collect();
    let bottom = TOP + HEADER * groups.len() as f64 + BAR * lines.len() as f64;
    let mut panel = Panel::new(format!("environment {env}"), bottom + 18.0);
    let axis = Axis::from_zero(lines.iter().map(|line| line.time_s.total).fold(0.0, f64::max));
    axis.draw(&mut panel.chart, [TOP, bottom], plain);
    let mut top = TOP;
    for (robot, options) in groups {
        panel.chart.text([LEFT, top + 15.0], Anchor::Start, TEXT, SOFT, format!("{robot}, {options}"));
        top += HEADER;
        for line in lines.iter().filter(|line| line.robot == robot && line.options == options) {
            bar(&mut panel, line, &axis, top);
            top += BAR;
        }
    }
    panel
}

fn bar(panel: &mut Panel, line: &ResultLine, axis: &Axis, top: f64) {
    let chart = &mut panel.chart;
    chart.text([LEFT - 4.0, top + 10.0], Anchor::End, TEXT, INK, format!("P{}", line.problem));
    let mut spent = 0.0;
    for (_, color, of) in PHASES {
        let left = axis.at(spent);
        spent += of(&line.time_s);
        chart.rect([left, top + 2.0], [axis.at(spent) - left, BAR - 4.0], color);
    }
    chart.text([RIGHT + 6.0, top + 10.0], Anchor::Start, TEXT, INK, seconds(line.time_s.total));
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn phases_add_up_to_the_whole() {
        let line = ResultLine::example("a", "limo", "centroid", 1);
        let sum: f64 = PHASES.iter().map(|(_, _, of)| of(&line.time_s)).sum();
        assert!((sum - line.time_s.total).abs() < 1e-9, "{sum} of {}", line.time_s.total);
        let table = figure(&[&line]).table;
        assert_eq!(table.rows[0].len(), table.columns.len(), "{table:?}");
        assert_eq!(table.rows[0].last().map(String::as_str), Some("5.00"));
    }
}
