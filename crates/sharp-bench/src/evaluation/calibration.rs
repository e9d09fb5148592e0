//! The figure of calibration: the success that SHARP foretold against the success that was counted.

use std::collections::BTreeMap;

use sharp_draw::numbers::percent;
use sharp_draw::{Axis, Color, Panel};
use sharp_drive::SuccessCount;

use super::cases::Mean;
use super::figure::{Figure, Style, Table, marker, method_legend};
use crate::result::ResultLine;

/// The plotted square: left, right, top, bottom.
const AREA: [f64; 4] = [60.0, 340.0, 30.0, 310.0];
const HEIGHT: f64 = AREA[3] + Axis::FOOT;

/// All problems of one environment, robot and kind of option.
#[derive(Debug)]
struct CalibrationPoint<'a> {
    robot: &'a str,
    options: &'a str,
    /// Mean over the problems.
    predicted: f64,
    measured: SuccessCount,
}

pub(super) fn figure(lines: &[&ResultLine]) -> Figure {
    let solved: Vec<&ResultLine> = lines.iter().copied().filter(|line| line.is_solved()).collect();
    let points = points(&solved);
    let low = lowest(&points);
    let columns =
        "env,robot,options,problem,trial,predicted,measured,95 % interval,inside,within 3 points".split(',');
    Figure {
        name: "calibration",
        title: "Predicted and measured success",
        caption: caption(&solved),
        legend: method_legend(solved.iter().map(|line| line.options.as_str())),
        panels: points.chunk_by(|a, b| a.robot == b.robot).map(|points| panel(points, low)).collect(),
        table: Table { columns: columns.collect(), rows: solved.iter().map(|line| row(line)).collect() },
    }
}

fn caption(solved: &[&ResultLine]) -> String {
    let inside = solved.iter().filter(|line| is_inside(line)).count();
    let near = solved.iter().filter(|line| is_near(line)).count();
    let (count, measured) = (solved.len(), measured(solved));
    format!(
        "One marker an environment and kind of option: the success predicted when its problems were solved, \
         and the share counted afterwards on executions with fresh noise (1000 of each plan, beyond those of the \
         other figures), with Wilson's 95 % interval. \
         Predictions that were right lie on the diagonal. Problem by problem {near} of {count} predictions ({}) \
         are within 3 points of what was measured, {inside} of {count} lie in the interval measured. All \
         together: {:.1} % predicted, {:.1} % measured ({:.1} to {:.1} %).",
        percent(near as f64 / count.max(1) as f64),
        100.0 * predicted(solved),
        100.0 * measured.rate(),
        100.0 * measured.lower95(),
        100.0 * measured.upper95()
    )
}

fn points<'a>(solved: &[&'a ResultLine]) -> Vec<CalibrationPoint<'a>> {
    let mut groups: BTreeMap<_, Vec<&'a ResultLine>> = BTreeMap::new();
    for &line in solved {
        groups.entry((&*line.robot, &*line.env, &*line.options)).or_default().push(line);
    }
    let point = |((robot, _, options), lines): ((&'a str, &str, &'a str), Vec<&ResultLine>)| {
        CalibrationPoint { robot, options, predicted: predicted(&lines), measured: measured(&lines) }
    };
    groups.into_iter().map(point).collect()
}

/// The mean of what was predicted; 0 of nothing.
fn predicted(lines: &[&ResultLine]) -> f64 {
    Mean::of(lines.iter().map(|line| line.predicted_success)).unwrap_or_default().mean
}

/// The executions that the predictions of `lines` are held against; older results have no more than the others.
fn measured(lines: &[&ResultLine]) -> SuccessCount {
    let tallies = || lines.iter().map(|line| line.calibration.unwrap_or(line.tally()));
    SuccessCount {
        episodes: tallies().map(|tally| tally.episodes).sum(),
        successes: tallies().map(|tally| tally.successes).sum(),
    }
}

/// Returns true if the prediction lies in the interval that was measured.
fn is_inside(line: &ResultLine) -> bool {
    let tally = measured(&[line]);
    (tally.lower95()..=tally.upper95()).contains(&line.predicted_success)
}

/// Returns true if prediction and measurement are at most 3 points apart.
fn is_near(line: &ResultLine) -> bool {
    (line.predicted_success - measured(&[line]).rate()).abs() <= 0.03 + 1e-9
}

fn yes_or_no(yes: bool) -> String {
    if yes { "yes" } else { "no" }.to_owned()
}

/// The axes begin here if everything that is shown lies above.
const NEAR_ONE: f64 = 0.98;

/// [`NEAR_ONE`], or the tenth at or below everything that is shown: what is near 1 can be told apart.
fn lowest(points: &[CalibrationPoint<'_>]) -> f64 {
    let low = points.iter().map(|point| point.measured.lower95().min(point.predicted)).fold(1.0, f64::min);
    if low >= NEAR_ONE { NEAR_ONE } else { ((low * 10.0).floor() / 10.0).clamp(0.0, 0.9) }
}

fn tick(share: f64) -> String {
    if share.mul_add(100.0, 1e-9).fract() < 1e-6 { percent(share) } else { format!("{:.1} %", 100.0 * share) }
}

fn row(line: &ResultLine) -> Vec<String> {
    let tally = measured(&[line]);
    vec![
        line.env.clone(),
        line.robot.clone(),
        line.options.clone(),
        format!("P{}", line.problem),
        line.trial.to_string(),
        format!("{:.3}", line.predicted_success),
        format!("{:.3}", tally.rate()),
        format!("{:.3}-{:.3}", tally.lower95(), tally.upper95()),
        yes_or_no(is_inside(line)),
        yes_or_no(is_near(line)),
    ]
}

/// The points of one robot.
fn panel(points: &[CalibrationPoint<'_>], low: f64) -> Panel {
    let [left, right, top, bottom] = AREA;
    let across = Axis::new([low, 1.0]).between([left, right]).label("predicted success");
    let up = Axis::new([low, 1.0]).between([bottom, top]).label("measured success");
    let mut panel = Panel::new(points[0].robot.to_owned(), HEIGHT);
    let chart = &mut panel.chart;
    across.draw(chart, [top, bottom], tick);
    up.draw_upright(chart, [left, right], tick);
    chart.line([left, bottom], [right, top], Color::SOFT, 1.0);
    for CalibrationPoint { options, predicted, measured, .. } in points {
        let (x, style) = (across.at(*predicted), Style::of(options));
        chart.line([x, up.at(measured.lower95())], [x, up.at(measured.upper95())], style.color, 1.0);
        marker(chart, [x, up.at(measured.rate())], &style, false);
    }
    panel
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn predictions_are_counted_where_there_was_a_plan() {
        let right = ResultLine::example("a", "limo", "centroid", 1);
        let wrong = ResultLine { successes: 10, ..ResultLine::example("a", "limo", "centroid", 2) };
        let none =
            ResultLine { status: "no_plan".into(), ..ResultLine::example("a", "husky", "centroid", 3) };
        let figure = figure(&[&right, &wrong, &none]);
        for needle in [
            "1 of 2 predictions (50 %) are within 3 points",
            "1 of 2 lie in the interval measured",
            "98.0 % predicted, 75.0 % measured (58.5 to 86.8 %)",
        ] {
            assert!(figure.caption.contains(needle), "no {needle:?} in {}", figure.caption);
        }
        let titles: Vec<&str> = figure.panels.iter().map(|panel| panel.title.as_str()).collect();
        assert_eq!(titles, ["limo"]);
    }

    #[test]
    fn predictions_are_held_against_the_larger_number_of_executions() {
        let calibration = Some(SuccessCount { episodes: 1000, successes: 975 });
        let unlucky =
            ResultLine { successes: 18, calibration, ..ResultLine::example("a", "limo", "centroid", 1) };
        assert!(is_near(&unlucky) && is_inside(&unlucky), "0.98 of {:?}", measured(&[&unlucky]));
        assert!(!is_near(&ResultLine { calibration: None, ..unlucky }), "18 of 20");
    }

    #[test]
    fn the_axes_show_every_interval() {
        let wrong = ResultLine { successes: 10, ..ResultLine::example("a", "limo", "centroid", 2) };
        assert!(lowest(&points(&[&wrong])) <= wrong.tally().lower95());
        assert_eq!(lowest(&[]), NEAR_ONE, "nothing to show");
        assert_eq!([0.98, 0.985, 1.0].map(tick), ["98 %", "98.5 %", "100 %"]);
    }
}
