//! What the yardstick shows: a line for each option, a table and a picture.

use std::collections::BTreeMap;
use std::fmt::Write;

use serde::{Deserialize, Serialize};
use sharp_draw::numbers::plain;
use sharp_draw::{Axis, Chart, Color, LegendItem, Marker, Panel, TextStyle, legend, sheet};
use sharp_drive::{FAILURE_COST_S, SuccessEstimate};

/// How one policy drove one option.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PolicyCost {
    /// Share of the episodes that succeeded.
    pub success: f64,
    /// Mean time of those, seconds; `None` without any.
    pub time_s: Option<f64>,
    /// Time and what failures cost, seconds.
    pub cost_s: f64,
}

impl PolicyCost {
    /// What `estimate` shows.
    #[must_use]
    pub fn of(estimate: &SuccessEstimate) -> Self {
        let time_s = Some(estimate.mean_time_s).filter(|time_s| time_s.is_finite());
        let cost_s = match time_s {
            Some(_) => estimate.cost_s(FAILURE_COST_S),
            None => FAILURE_COST_S,
        };
        Self { success: estimate.count.rate(), time_s, cost_s }
    }
}

/// One option driven by all policies.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct YardstickLine {
    /// `sharp.yardstick/1`.
    pub schema: String,
    /// The robot.
    pub robot: String,
    /// The noise.
    pub noise: String,
    /// Root of all randomness.
    pub seed: u64,
    /// Episodes of each policy.
    pub episodes: u32,
    /// Number of the option, from 0.
    pub option: usize,
    /// Length of its guide, metres.
    pub length_m: f64,
    /// Cost that the values promise where episodes begin, seconds.
    pub expected_s: f64,
    /// Each policy by its name: `informed`, `estimating`, `prior`, `follower`, `mppi` or `track`.
    pub policies: BTreeMap<String, PolicyCost>,
}

/// The policies that are compared, the informed one first: name, label, colour and marker.
pub(super) const POLICIES: [&str; 6] = ["informed", "estimating", "prior", "follower", "mppi", "track"];

const STYLES: [(&str, Color, Marker); 6] = [
    ("told slip and pull", Color::hex(0x1a1a1a), Marker::Star),
    ("estimates slip and pull", Color::hex(0x707070), Marker::Star),
    ("prior", Color::hex(0x0072b2), Marker::Circle),
    ("best of four followers", Color::hex(0xd55e00), Marker::Diamond),
    ("MPPI", Color::hex(0xe69f00), Marker::Down),
    ("tracking", Color::hex(0x009e73), Marker::Up),
];

/// Height of a row of the picture, user units.
const ROW: f64 = 15.0;
/// Costs are drawn up to so many times that of the informed policy.
const RATIO_MAX: f64 = 3.0;

/// A table of `lines` in Markdown, with means at its end.
#[must_use]
pub fn yardstick_table(lines: &[YardstickLine]) -> String {
    let mut text = String::from("| robot | option | m | promised s |");
    for name in POLICIES {
        _ = write!(text, " {name} |");
    }
    text.push_str(" regret of the prior s |\n|---|---|---|---|---|---|---|---|---|---|---|\n");
    for line in lines {
        _ = write!(
            text,
            "| {} | {} | {:.1} | {:.1} |",
            line.robot, line.option, line.length_m, line.expected_s
        );
        for name in POLICIES {
            let cell = line.policies.get(name).map_or("-".to_owned(), cell);
            _ = write!(text, " {cell} |");
        }
        _ = writeln!(text, " {} |", regret(line, "prior").map_or("-".to_owned(), |s| format!("{s:.2}")));
    }
    for robot in lines.chunk_by(|a, b| a.robot == b.robot) {
        _ = write!(
            text,
            "| {} | mean | {:.1} | {:.1} |",
            robot[0].robot,
            mean(robot, |l| Some(l.length_m)),
            mean(robot, |l| Some(l.expected_s))
        );
        for name in POLICIES {
            let of = |value: fn(&PolicyCost) -> Option<f64>| {
                mean(robot, |line| line.policies.get(name).and_then(value))
            };
            let (cost_s, success) = (of(|cost| Some(cost.cost_s)), of(|cost| Some(cost.success)));
            _ = write!(text, " {cost_s:.1} ({success:.3}, {:.1} s) |", of(|cost| cost.time_s));
        }
        _ = writeln!(text, " {:.2} |", mean(robot, |line| regret(line, "prior")));
    }
    text
}

/// Cost, success and time.
fn cell(cost: &PolicyCost) -> String {
    let time = cost.time_s.map_or("-".to_owned(), |time_s| format!("{time_s:.1} s"));
    format!("{:.1} ({:.3}, {time})", cost.cost_s, cost.success)
}

/// How much more policy `name` costs than the informed one, seconds.
fn regret(line: &YardstickLine, name: &str) -> Option<f64> {
    Some(line.policies.get(name)?.cost_s - line.policies.get(POLICIES[0])?.cost_s)
}

fn mean(lines: &[YardstickLine], of: impl Fn(&YardstickLine) -> Option<f64>) -> f64 {
    let values: Vec<f64> = lines.iter().filter_map(of).collect();
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

/// A picture of `lines` as SVG, and the longer side of its PNG in pixels: the cost of each policy on each option, as a multiple of
/// the informed one's.
#[must_use]
pub fn yardstick_picture(lines: &[YardstickLine]) -> (String, u32) {
    const TITLE: &str = "Cost of driving an option, beside value iteration";
    let items: Vec<_> =
        STYLES[1..].iter().map(|&(label, color, marker)| LegendItem { label, color, marker }).collect();
    let panels: Vec<Panel> = lines.chunk_by(|a, b| a.robot == b.robot).map(panel).collect();
    let sheet = sheet(TITLE, &legend(&items), &panels, 2);
    (sheet.to_svg(TITLE), (2.0 * sheet.longer_side()) as u32)
}

/// The options of one robot, by their cost.
fn panel(lines: &[YardstickLine]) -> Panel {
    let informed_s =
        |line: &YardstickLine| line.policies.get(POLICIES[0]).map_or(f64::INFINITY, |cost| cost.cost_s);
    let mut lines: Vec<_> = lines.iter().filter(|line| informed_s(line) > 0.0).collect();
    lines.sort_by(|a, b| a.length_m.total_cmp(&b.length_m));
    let bottom = Panel::TOP + 14.0 + ROW * lines.len() as f64;
    let noise = lines.first().map_or("", |line| line.noise.as_str());
    let robot = lines.first().map_or("", |line| line.robot.as_str());
    let mut panel = Panel::new(format!("{robot}, {noise} noise"), bottom + Axis::FOOT);
    let axis = Axis::new([0.5, RATIO_MAX]).label("cost / cost for who knows slip and pull");
    axis.draw(&mut panel.chart, [Panel::TOP, bottom], plain);
    let note = TextStyle::new(Panel::TEXT).color(Color::SOFT).end();
    panel.chart.text([Panel::LEFT - 4.0, Panel::TOP + 8.0], note, "m");
    panel.chart.text([Panel::NUMBERS, Panel::TOP + 8.0], note, "cost s");
    panel.chart.line([axis.at(1.0), Panel::TOP], [axis.at(1.0), bottom], Color::INK, 1.2);
    for (row, line) in lines.into_iter().enumerate() {
        let y = Panel::TOP + 14.0 + ROW * (row as f64 + 0.5);
        let text = TextStyle::new(Panel::TEXT).end();
        panel.chart.text([Panel::LEFT - 4.0, y + 4.0], text, format!("{:.1}", line.length_m));
        panel.chart.text([Panel::NUMBERS, y + 4.0], text, format!("{:.1}", informed_s(line)));
        for (name, style) in POLICIES.iter().zip(STYLES).skip(1).rev() {
            if let Some(cost) = line.policies.get(*name) {
                mark(
                    &mut panel.chart,
                    [axis.at(cost.cost_s / informed_s(line)), y],
                    style,
                    cost.cost_s / informed_s(line) > RATIO_MAX,
                );
            }
        }
    }
    panel
}

/// A marker; a hollow one at the edge stands for more.
fn mark(chart: &mut Chart, at: [f64; 2], (_, color, marker): (&str, Color, Marker), is_beyond: bool) {
    chart.marker(at, marker, 3.6, color);
    if is_beyond {
        chart.marker(at, marker, 2.0, Color::WHITE);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(option: usize, informed_s: f64, prior_s: f64) -> YardstickLine {
        let cost = |cost_s| PolicyCost { success: 1.0, time_s: Some(cost_s), cost_s };
        YardstickLine {
            schema: "sharp.yardstick/1".to_owned(),
            robot: "husky".to_owned(),
            noise: "nominal".to_owned(),
            seed: 1,
            episodes: 100,
            option,
            length_m: 3.0,
            expected_s: informed_s,
            policies: [("informed".to_owned(), cost(informed_s)), ("prior".to_owned(), cost(prior_s))].into(),
        }
    }

    #[test]
    fn the_table_ends_with_means() {
        let table = yardstick_table(&[line(0, 4.0, 5.0), line(1, 6.0, 9.0)]);
        let last = table.lines().last().expect("it has rows");
        assert!(last.starts_with("| husky | mean | 3.0 | 5.0 | 5.0 (1.000, 5.0 s) |"), "{last}");
        assert!(last.ends_with("| 2.00 |"), "mean regret: {last}");
        assert!(table.contains("| - |"), "what was not measured: {table}");
    }

    #[test]
    fn costs_beyond_the_axis_are_drawn_at_its_edge() {
        let (svg, side_px) = yardstick_picture(&[line(0, 4.0, 400.0)]);
        let (usual, _) = yardstick_picture(&[line(0, 4.0, 5.0)]);
        assert!(svg.contains("husky, nominal noise") && side_px > 500, "{svg}");
        assert!(svg.len() > usual.len(), "a hollow marker has a second shape");
    }

    #[test]
    fn without_a_success_there_is_no_time() {
        let failed = SuccessEstimate::of([(false, 3.0), (false, 4.0)].into_iter());
        assert_eq!(
            PolicyCost::of(&failed),
            PolicyCost { success: 0.0, time_s: None, cost_s: FAILURE_COST_S }
        );
    }
}
