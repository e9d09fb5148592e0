//! The figure of calibration: the success that SHARP foretold against the success that was counted.

use std::collections::BTreeSet;

use super::figure::{Axis, Figure, INK, Panel, SOFT, Style, TEXT, Table, legend, percent};
use super::lines::ResultLine;
use crate::render::Anchor;

/// The plotted square: left, right, top, bottom.
const AREA: [f64; 4] = [46.0, 336.0, 32.0, 322.0];
const HEIGHT: f64 = 368.0;

pub(super) fn figure(lines: &[&ResultLine]) -> Figure {
    let solved: Vec<&ResultLine> = lines.iter().copied().filter(|line| line.is_solved()).collect();
    let inside = solved.iter().filter(|line| is_inside(line)).count();
    let robots: BTreeSet<&str> = solved.iter().map(|line| line.robot.as_str()).collect();
    let low = lowest(&solved);
    let of = |robot: &str| solved.iter().copied().filter(|line| line.robot == robot).collect::<Vec<_>>();
    Figure {
        name: "calibration",
        title: "Predicted and measured success",
        caption: format!(
            "One marker a solved problem: the success predicted when it was solved, and the share counted \
             afterwards on executions with fresh noise, with Wilson's 95 % interval. Predictions that were \
             right lie on the diagonal. {inside} of {} predictions lie in the interval measured.",
            solved.len()
        ),
        legend: legend(solved.iter().map(|line| line.options.as_str())),
        panels: robots.into_iter().map(|robot| panel(robot, &of(robot), low)).collect(),
        table: Table {
            columns: vec![
                "env",
                "robot",
                "options",
                "problem",
                "predicted",
                "measured",
                "95 % interval",
                "inside",
            ],
            rows: solved.iter().map(|line| row(line)).collect(),
        },
    }
}

/// Returns true if the prediction lies in the interval that was measured.
fn is_inside(line: &ResultLine) -> bool {
    let tally = line.tally();
    (tally.lower95()..=tally.upper95()).contains(&line.predicted_success)
}

/// The tenth at or below everything that is shown: what is near 1 can be told apart.
fn lowest(lines: &[&ResultLine]) -> f64 {
    let low = lines.iter().map(|line| line.tally().lower95().min(line.predicted_success)).fold(0.9, f64::min);
    ((low * 10.0).floor() / 10.0).clamp(0.0, 0.9)
}

fn row(line: &ResultLine) -> Vec<String> {
    let tally = line.tally();
    vec![
        line.env.clone(),
        line.robot.clone(),
        line.options.clone(),
        format!("P{}", line.problem),
        format!("{:.3}", line.predicted_success),
        format!("{:.3}", tally.rate()),
        format!("{:.3}-{:.3}", tally.lower95(), tally.upper95()),
        if is_inside(line) { "yes" } else { "no" }.to_owned(),
    ]
}

fn panel(robot: &str, lines: &[&ResultLine], low: f64) -> Panel {
    let [left, right, top, bottom] = AREA;
    let across = Axis { low, high: 1.0, ends: [left, right] };
    let up = Axis { low, high: 1.0, ends: [bottom, top] };
    let mut panel = Panel::new(robot.to_owned(), HEIGHT);
    let chart = &mut panel.chart;
    across.draw(chart, [top, bottom], percent);
    up.draw_upright(chart, [left, right], percent);
    chart.line([left, bottom], [right, top], SOFT, 1.0);
    chart.text([(left + right) / 2.0, bottom + 32.0], Anchor::Middle, TEXT, INK, "predicted success");
    chart.text([right, top - 10.0], Anchor::End, TEXT, INK, "measured success, upwards");
    for line in lines {
        let (tally, style) = (line.tally(), Style::of(&line.options));
        let x = across.at(line.predicted_success);
        chart.line([x, up.at(tally.lower95())], [x, up.at(tally.upper95())], style.color, 1.0);
        chart.marker([x, up.at(tally.rate())], style.shape, 3.6, style.color);
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
        assert!(
            figure.caption.ends_with("1 of 2 predictions lie in the interval measured."),
            "{}",
            figure.caption
        );
        let titles: Vec<&str> = figure.panels.iter().map(|panel| panel.title.as_str()).collect();
        assert_eq!(titles, ["limo"]);
    }

    #[test]
    fn the_axes_show_every_interval() {
        let wrong = ResultLine { successes: 10, ..ResultLine::example("a", "limo", "centroid", 2) };
        assert!(lowest(&[&wrong]) <= wrong.tally().lower95());
        assert_eq!(lowest(&[]), 0.9, "nothing to show");
    }
}
