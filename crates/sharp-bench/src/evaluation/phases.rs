//! The figure of solving time by phase: one bar a problem, one colour a phase.

use std::collections::BTreeMap;

use sharp_draw::numbers::{plain, seconds};
use sharp_draw::{Axis, Color, LegendItem, Marker, Panel, legend};

use super::figure::{Figure, LABEL, Table, heading};
use crate::result::ResultLine;
use crate::times::SolveTimes;

const BAR: f64 = 13.0;
const HEADER: f64 = 20.0;

/// A phase: its name, its colour, and how long it took.
type TimedPhase = (&'static str, Color, fn(&SolveTimes) -> f64);

/// Phases in the order of the algorithm.
const PHASES: [TimedPhase; 7] = [
    ("regions", Color::hex(0xcc79a7), |time| time.regions),
    ("abstraction", Color::hex(0xe69f00), |time| time.abstraction),
    ("search", Color::hex(0xf0e442), |time| time.search),
    ("guides", Color::hex(0x56b4e9), |time| time.guide),
    ("learning", Color::hex(0x0072b2), |time| time.learn),
    ("verification", Color::hex(0x009e73), |time| time.verify),
    ("rest", Color::hex(0x999999), rest),
];

/// What no other phase counts: reading the map, writing the plan and its pictures.
fn rest(time: &SolveTimes) -> f64 {
    let counted: f64 = PHASES[..PHASES.len() - 1].iter().map(|(_, _, of)| of(time)).sum();
    (time.total - counted).max(0.0)
}

/// A problem solved with one kind of option: environment, robot, kind, number.
type Bar<'a> = (&'a str, &'a str, &'a str, usize);

pub(super) fn figure(lines: &[&ResultLine]) -> Figure {
    let bars = means(lines);
    let mut columns = vec!["env", "robot", "options", "problem"];
    columns.extend(PHASES.map(|(name, ..)| name));
    columns.push("total s");
    Figure {
        name: "phases",
        title: "Where the time goes",
        caption: "Wall time of sharp solve by phase, seconds, mean over trials. Problems of one robot and kind \
                  share a library and are solved in order, so later ones reuse what earlier ones learnt. Each \
                  panel has an axis of its own."
            .to_owned(),
        legend: legend(&PHASES.map(|(label, color, _)| LegendItem { label, color, marker: Marker::Square })),
        panels: bars.chunk_by(|a, b| a.0.0 == b.0.0).map(panel).collect(),
        table: Table { columns, rows: bars.iter().map(row).collect() },
    }
}

/// The mean times of all trials of each problem.
fn means<'a>(lines: &[&'a ResultLine]) -> Vec<(Bar<'a>, SolveTimes)> {
    let mut trials: BTreeMap<Bar<'a>, Vec<&SolveTimes>> = BTreeMap::new();
    for line in lines {
        trials.entry((&line.env, &line.robot, &line.options, line.problem)).or_default().push(&line.time_s);
    }
    let mean = |times: &[&SolveTimes], of: fn(&SolveTimes) -> f64| {
        times.iter().map(|time| of(time)).sum::<f64>() / times.len() as f64
    };
    let mean_of = |times: Vec<&SolveTimes>| SolveTimes {
        load: mean(&times, |time| time.load),
        regions: mean(&times, |time| time.regions),
        abstraction: mean(&times, |time| time.abstraction),
        search: mean(&times, |time| time.search),
        guide: mean(&times, |time| time.guide),
        learn: mean(&times, |time| time.learn),
        verify: mean(&times, |time| time.verify),
        total: mean(&times, |time| time.total),
        ..SolveTimes::default()
    };
    trials.into_iter().map(|(bar, times)| (bar, mean_of(times))).collect()
}

fn row(((env, robot, options, problem), time): &(Bar<'_>, SolveTimes)) -> Vec<String> {
    let mut row: Vec<String> = [*env, *robot, *options].map(str::to_owned).into();
    row.push(format!("P{problem}"));
    row.extend(PHASES.map(|(_, _, of)| format!("{:.2}", of(time))));
    row.push(format!("{:.2}", time.total));
    row
}

/// The bars of one environment.
fn panel(bars: &[(Bar<'_>, SolveTimes)]) -> Panel {
    let groups: Vec<_> = bars.chunk_by(|a, b| (a.0.1, a.0.2) == (b.0.1, b.0.2)).collect();
    let bottom = Panel::TOP + HEADER * groups.len() as f64 + BAR * bars.len() as f64;
    let mut panel = Panel::new(format!("environment {}", bars[0].0.0), bottom + Axis::FOOT);
    let most = bars.iter().map(|(_, time)| time.total).fold(0.0, f64::max);
    let axis = Axis::from_zero(most).label("wall time, seconds");
    axis.draw(&mut panel.chart, [Panel::TOP, bottom], plain);
    let mut top = Panel::TOP;
    for group in groups {
        let (_, robot, options, _) = group[0].0;
        heading(&mut panel.chart, [Panel::LEFT, top + 15.0], &format!("{robot}, {options}"));
        top += HEADER;
        for ((.., problem), time) in group {
            draw(&mut panel, (*problem, time), &axis, top);
            top += BAR;
        }
    }
    panel
}

fn draw(panel: &mut Panel, (problem, time): (usize, &SolveTimes), axis: &Axis, top: f64) {
    let chart = &mut panel.chart;
    chart.text([Panel::LEFT - 4.0, top + 10.0], LABEL.end(), format!("P{problem}"));
    let mut spent = 0.0;
    for (_, color, of) in PHASES {
        let left = axis.at(spent);
        spent += of(time);
        chart.rect([left, top + 2.0], [axis.at(spent) - left, BAR - 4.0], color);
    }
    chart.text([Panel::NUMBERS, top + 10.0], LABEL.end(), seconds(time.total));
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

    #[test]
    fn trials_are_one_bar() {
        let first = ResultLine::example("a", "limo", "centroid", 1);
        let mut second = first.clone();
        second.time_s.total = 7.0;
        let table = figure(&[&first, &second]).table;
        assert_eq!(table.rows.len(), 1, "{table:?}");
        assert_eq!(table.rows[0].last().map(String::as_str), Some("6.00"), "the mean of 5 and 7");
    }
}
