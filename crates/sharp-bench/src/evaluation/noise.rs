//! The figure of the noise sweep: success by how many times the nominal noise there was.

use std::collections::{BTreeMap, BTreeSet};

use sharp_draw::numbers::{percent, plain};
use sharp_draw::{Axis, Panel};
use sharp_drive::SuccessCount;

use super::cases::{ProblemKey, Results, Setting, method, problem, tally};
use super::figure::{Figure, Style, Table, marker, method_legend};
use super::rows::label;
use crate::result::ResultLine;

/// The plotted area: left, right, top, bottom.
const AREA: [f64; 4] = [60.0, 340.0, Panel::TOP + 6.0, 236.0];
const HEIGHT: f64 = AREA[3] + Axis::FOOT;
/// Between the marks of two methods at one factor, user units: intervals shall not hide each other.
const ASIDE: f64 = 5.0;

/// One method on one robot.
#[derive(Debug)]
struct Series<'a> {
    robot: &'a str,
    method: &'a str,
    /// Problems that were measured at every factor.
    problems: usize,
    points: Vec<(f64, SuccessCount)>,
}

/// How many times the nominal noise `noise` is; `None` for noise of another kind.
pub(super) fn factor(noise: &str) -> Option<f64> {
    match noise {
        "none" => Some(0.0),
        "nominal" => Some(1.0),
        _ => noise.strip_prefix("nominal*")?.parse().ok(),
    }
}

/// The figure, or `None` where there are fewer than two levels of noise.
pub(super) fn figure(results: &Results<'_>) -> Option<Figure> {
    let series = series(results);
    if series.is_empty() {
        return None;
    }
    let row = |series: &Series<'_>, &(factor, tally): &(f64, SuccessCount)| {
        vec![
            series.robot.to_owned(),
            label(series.method),
            format!("{} x", plain(factor)),
            series.problems.to_string(),
            format!("{}/{}", tally.successes, tally.episodes),
            percent(tally.rate()),
            format!("{:.3}-{:.3}", tally.lower95(), tally.upper95()),
        ]
    };
    Some(Figure {
        name: "noise",
        title: "Success and noise",
        caption: "Success over all problems that a method was measured on at every level of noise, with Wilson's \
                  95 % interval. Policies are learnt and verified under the noise that they are driven in. Marks \
                  of methods stand side by side."
            .to_owned(),
        legend: method_legend(series.iter().map(|series| series.method)),
        panels: series.chunk_by(|a, b| a.robot == b.robot).map(panel).collect(),
        table: Table {
            columns: vec!["robot", "method", "noise", "problems", "success", "share", "95 % interval"],
            rows: series
                .iter()
                .flat_map(|series| series.points.iter().map(|point| row(series, point)))
                .collect(),
        },
    })
}

/// Every method that was measured under two levels of noise or more, by robot.
fn series<'a>(results: &Results<'a>) -> Vec<Series<'a>> {
    let mut groups: BTreeMap<_, Vec<(f64, &'a ResultLine)>> = BTreeMap::new();
    for &line in &results.lines {
        let is_main = Setting { noise: results.main.noise, ..Setting::of(line) } == results.main;
        if let Some(factor) = factor(&line.noise).filter(|_| is_main || !line.is_of_sharp()) {
            let key = (line.robot.as_str(), Style::rank(method(line)), method(line));
            groups.entry(key).or_default().push((factor, line));
        }
    }
    groups.into_iter().filter_map(|((robot, _, method), lines)| of_method(robot, method, &lines)).collect()
}

fn of_method<'a>(robot: &'a str, method: &'a str, lines: &[(f64, &'a ResultLine)]) -> Option<Series<'a>> {
    let mut factors: Vec<f64> = lines.iter().map(|&(factor, _)| factor).collect();
    factors.sort_by(f64::total_cmp);
    factors.dedup();
    let at = |wanted: f64| lines.iter().filter(move |&&(factor, _)| factor == wanted).map(|&(_, line)| line);
    let problems_at = |factor| -> BTreeSet<ProblemKey<'a>> { at(factor).map(problem).collect() };
    let problems = factors.iter().map(|&factor| problems_at(factor)).reduce(|a, b| &a & &b)?;
    let tally_at = |factor| {
        let shared: Vec<_> = at(factor).filter(|line| problems.contains(&problem(line))).collect();
        (factor, tally(&shared))
    };
    let points = factors.iter().map(|&factor| tally_at(factor)).collect();
    (factors.len() > 1 && !problems.is_empty()).then_some(Series {
        robot,
        method,
        problems: problems.len(),
        points,
    })
}

fn panel(series: &[Series<'_>]) -> Panel {
    let [left, right, top, bottom] = AREA;
    let most = series.iter().flat_map(|series| &series.points).map(|point| point.0).fold(1.0, f64::max);
    let across = Axis::from_zero(most).between([left + 20.0, right - 20.0]).label("times the nominal noise");
    let up = Axis::of_shares().between([bottom, top]).label("success");
    let mut panel = Panel::new(series[0].robot.to_owned(), HEIGHT);
    across.draw(&mut panel.chart, [top, bottom], plain);
    up.draw_upright(&mut panel.chart, [left, right], percent);
    for (index, series) in series.iter().enumerate() {
        draw(&mut panel, series, (&across, &up), ASIDE * aside(index));
    }
    panel
}

/// 0, 1, -1, 2, -2, ...
fn aside(index: usize) -> f64 {
    let steps = index.div_ceil(2) as f64;
    if index % 2 == 1 { steps } else { -steps }
}

fn draw(panel: &mut Panel, series: &Series<'_>, (across, up): (&Axis, &Axis), aside: f64) {
    let (chart, style) = (&mut panel.chart, Style::of(series.method));
    let place = |&(factor, tally): &(f64, SuccessCount)| [across.at(factor) + aside, up.at(tally.rate())];
    for pair in series.points.windows(2) {
        chart.line(place(&pair[0]), place(&pair[1]), style.color, 1.0);
    }
    for point in &series.points {
        let (at, tally) = (place(point), point.1);
        chart.line([at[0], up.at(tally.lower95())], [at[0], up.at(tally.upper95())], style.color, 2.0);
        marker(chart, at, &style, false);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn line(noise: &str, problem: usize, successes: u32) -> ResultLine {
        ResultLine { noise: noise.into(), successes, ..ResultLine::example("a", "limo", "centroid", problem) }
    }

    #[test]
    fn names_of_noise_have_factors() {
        let cases =
            [("none", Some(0.0)), ("nominal", Some(1.0)), ("nominal*0.5", Some(0.5)), ("harsh", None)];
        for (name, expected) in cases {
            assert_eq!(factor(name), expected, "{name}");
        }
    }

    #[test]
    fn only_problems_of_every_level_count() {
        let lines = [
            line("nominal*4", 1, 3),
            line("nominal", 1, 20),
            line("nominal", 2, 0),
            line("none", 1, 20),
            line("harsh", 1, 1),
            ResultLine { regions: "grid".into(), ..line("nominal*2", 1, 7) },
        ];
        let figure = figure(&Results::new(&lines.iter().collect::<Vec<_>>())).expect("three levels");
        let rows: Vec<String> = figure.table.rows.iter().map(|row| row[2..5].join(" ")).collect();
        assert_eq!(rows, ["0 x 1 20/20", "1 x 1 20/20", "4 x 1 3/20"]);
    }

    #[test]
    fn one_level_is_no_sweep() {
        let line = line("nominal", 1, 20);
        assert!(figure(&Results::new(&[&line])).is_none());
    }

    #[test]
    fn marks_of_methods_stand_side_by_side() {
        assert_eq!([0, 1, 2, 3, 4].map(aside), [0.0, 1.0, -1.0, 2.0, -2.0]);
    }
}
