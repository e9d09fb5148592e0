//! Learning curves: one thin line an option, and their mean, in which an option that has stopped keeps its last return.

use sharp_draw::numbers::plain;
use sharp_draw::{Axis, Marker, Panel};

use super::super::figure::{Figure, Style, Table, method_legend};
use super::{PaperLeg, PaperLine};

/// The plotted area: left, right, top, bottom.
const AREA: [f64; 4] = [60.0, 340.0, 30.0, 210.0];
const HEIGHT: f64 = AREA[3] + Axis::FOOT;
/// Returns below are drawn at the edge: how much worse than nothing a policy is says little.
const RETURNS: [f64; 2] = [-1000.0, 1000.0];
/// The paper evaluates as often, steps.
const EVERY: u64 = 10_000;
/// The paper trains as long at most, steps.
const MOST: u64 = 150_000;

/// One panel a robot and kind of option; `None` where nothing was trained.
pub(super) fn figure(
    (name, title): (&'static str, &'static str),
    mut lines: Vec<&PaperLine>,
) -> Option<Figure> {
    lines.retain(|line| line.trained().next().is_some());
    lines.sort_by_key(|line| (&line.row.robot, &line.row.options));
    let same =
        |a: &&PaperLine, b: &&PaperLine| (&a.row.robot, &a.row.options) == (&b.row.robot, &b.row.options);
    let panels: Vec<Panel> = lines.chunk_by(same).map(panel).collect();
    let kinds = lines.iter().map(|line| line.row.options.as_str());
    (!panels.is_empty()).then(|| Figure {
        name,
        title,
        caption: String::new(),
        legend: method_legend(kinds),
        panels,
        table: Table { columns: vec![], rows: vec![] },
    })
}

fn panel(lines: &[&PaperLine]) -> Panel {
    let row = &lines[0].row;
    let legs: Vec<&PaperLeg> =
        lines.iter().flat_map(|line| line.trained()).filter(|leg| !leg.curve.is_empty()).collect();
    let title = format!("{}, {} options: {} trainings", row.robot, row.options, legs.len());
    let mut panel = Panel::new(title, HEIGHT);
    let steps = Axis::new([0.0, MOST as f64]).between([AREA[0], AREA[1]]).label("steps");
    let returns = Axis::new(RETURNS).between([AREA[3], AREA[2]]).label("mean return");
    let chart = &mut panel.chart;
    steps.draw(chart, [AREA[2], AREA[3]], |tick| plain(tick / 1000.0) + if tick > 0.0 { " k" } else { "" });
    returns.draw_upright(chart, [AREA[0], AREA[1]], plain);
    let color = Style::of(&row.options).color;
    let place = |(at, value): (u64, f64)| [steps.at(at as f64), returns.at(value)];
    for leg in &legs {
        let points: Vec<(u64, f64)> = leg.curve.iter().map(|&(at, value, ..)| (at, value)).collect();
        let points: Vec<[f64; 2]> = points.into_iter().map(place).collect();
        // Where it stopped: many are evaluated once.
        points.last().iter().for_each(|end| chart.marker(**end, Marker::Circle, 1.5, color));
        chart.polyline(points, color, 0.4);
    }
    chart.polyline(means(&legs).into_iter().map(place), color, 2.4);
    panel
}

/// The mean of all options at each evaluation.
fn means(legs: &[&PaperLeg]) -> Vec<(u64, f64)> {
    let value = |leg: &PaperLeg, at: u64| {
        let before = leg.curve.iter().take_while(|(steps, ..)| *steps <= at);
        before.last().map(|&(_, value, ..)| value.clamp(RETURNS[0], RETURNS[1]))
    };
    let mean = |at: u64| {
        let values: Vec<f64> = legs.iter().filter_map(|leg| value(leg, at)).collect();
        (!values.is_empty()).then(|| (at, values.iter().sum::<f64>() / values.len() as f64))
    };
    (1..=MOST / EVERY).filter_map(|number| mean(number * EVERY)).collect()
}
