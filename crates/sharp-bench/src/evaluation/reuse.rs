//! The figure of reuse: how many of the options that plans used had been learnt before, beside the
//! paper's own table (appendix C).

use std::collections::BTreeMap;

use sharp_draw::numbers::percent;
use sharp_draw::{Axis, Panel};

use super::figure::{Figure, LABEL, Style, Table, marker, method_legend};
use crate::result::ResultLine;

const BAR: f64 = 15.0;
const GAP: f64 = 5.0;

/// Environment, centroid options, interface options: the paper's table, shares.
const PAPER: [(&str, f64, f64); 7] = [
    ("a", 0.50, 0.43),
    ("b", 0.50, 0.33),
    ("c", 0.33, 0.20),
    ("d", 0.33, 0.33),
    ("e", 0.39, 0.37),
    ("f", 0.36, 0.33),
    ("g", 0.50, 0.42),
];

/// What the paper reports of `options` in `env`, a share.
pub(super) fn paper(env: &str, options: &str) -> Option<f64> {
    let (_, centroid, interface) = PAPER.iter().find(|(name, ..)| *name == env)?;
    match options {
        "centroid" => Some(*centroid),
        "interface" => Some(*interface),
        _ => None,
    }
}

/// Robot, environment, kind of option.
type Group<'a> = (&'a str, &'a str, &'a str);

/// What the plans of a group use.
#[derive(Clone, Copy, Debug, Default)]
struct Uses {
    /// Options, and those that had been learnt before.
    options: usize,
    reused: usize,
    /// Legs, first and last ones too, and those that a learnt policy drives.
    legs: usize,
    learnt: usize,
}

pub(super) fn figure(lines: &[&ResultLine]) -> Figure {
    let sums: Vec<(Group<'_>, Uses)> = sums(lines).into_iter().collect();
    Figure {
        name: "reuse",
        title: "Reuse of options (appendix C)",
        caption: "Option uses of all problems of an environment, trials together, and how many were reused. An \
                  option use is reused if its policy existed before the problem began and had ever succeeded. The first problem of an \
                  environment reuses nothing; legs from the start and to the goal are no options. The last two columns \
                  count all legs, and those that a learnt policy drives. The paper's \
                  table stands beside it: its maps and problems are others, it does not define its figure, and \
                  it does not tell the robots apart."
            .to_owned(),
        legend: method_legend(lines.iter().map(|line| line.options.as_str()).chain(["paper"])),
        panels: sums.chunk_by(|a, b| a.0.0 == b.0.0).map(panel).collect(),
        table: Table {
            columns: vec!["env", "robot", "options", "reused", "uses", "share", "in the paper", "legs", "learnt"],
            rows: sums.iter().map(row).collect(),
        },
    }
}

fn sums<'a>(lines: &[&'a ResultLine]) -> BTreeMap<Group<'a>, Uses> {
    let mut sums: BTreeMap<Group<'a>, Uses> = BTreeMap::new();
    for line in lines {
        let sum = sums.entry((line.robot.as_str(), line.env.as_str(), line.options.as_str())).or_default();
        sum.options += line.reuse.uses;
        sum.reused += line.reuse.reused;
        sum.legs += line.policies.values().sum::<usize>();
        sum.learnt += line.policies.get("learnt").copied().unwrap_or(0);
    }
    sums
}

/// The share reused; 0 if no option was used.
fn share(uses: &Uses) -> f64 {
    uses.reused as f64 / uses.options.max(1) as f64
}

fn row(((robot, env, options), uses): &(Group<'_>, Uses)) -> Vec<String> {
    vec![
        (*env).to_owned(),
        (*robot).to_owned(),
        (*options).to_owned(),
        uses.reused.to_string(),
        uses.options.to_string(),
        percent(share(uses)),
        paper(env, options).map_or_else(|| "-".to_owned(), percent),
        uses.legs.to_string(),
        uses.learnt.to_string(),
    ]
}

fn panel(groups: &[(Group<'_>, Uses)]) -> Panel {
    let envs: Vec<_> = groups.chunk_by(|a, b| a.0.1 == b.0.1).collect();
    let bottom = Panel::TOP + GAP * envs.len() as f64 + BAR * groups.len() as f64;
    let mut panel = Panel::new(groups[0].0.0.to_owned(), bottom + Axis::FOOT);
    let axis = Axis::of_shares().label("option uses that were reused");
    axis.draw(&mut panel.chart, [Panel::TOP, bottom], percent);
    let mut top = Panel::TOP;
    for groups in envs {
        top += GAP;
        panel.chart.text([0.0, top + 11.0], LABEL, groups[0].0.1);
        for ((_, env, options), uses) in groups {
            let (end, y, style) = (axis.at(share(uses)), top + BAR / 2.0, Style::of(options));
            panel.chart.line([Panel::LEFT, y], [end, y], style.color, 4.0);
            marker(&mut panel.chart, [end, y], &style, false);
            if let Some(share) = paper(env, options) {
                marker(&mut panel.chart, [axis.at(share), y], &Style::of("paper"), false);
            }
            let number = format!("{}/{}", uses.reused, uses.options);
            panel.chart.text([Panel::NUMBERS, top + 11.0], LABEL.end(), number);
            top += BAR;
        }
    }
    panel
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::times::Reuse;

    #[test]
    fn problems_of_an_environment_are_added_up() {
        let lines = [1, 2].map(|problem| ResultLine::example("a", "limo", "centroid", problem));
        let other = ResultLine {
            reuse: Reuse { uses: 0, reused: 0 },
            ..ResultLine::example("b", "limo", "centroid", 1)
        };
        let figure = figure(&[&lines[0], &lines[1], &other]);
        let rows: Vec<String> = figure.table.rows.iter().map(|row| row.join(" ")).collect();
        assert_eq!(rows, ["a limo centroid 2 8 25 % 50 % 12 10", "b limo centroid 0 0 0 % 50 % 6 5"]);
    }

    #[test]
    fn the_papers_table_names_what_it_holds_only() {
        assert_eq!((paper("c", "interface"), paper("g", "centroid")), (Some(0.2), Some(0.5)));
        assert_eq!((paper("h", "centroid"), paper("a", "other")), (None, None));
    }
}
