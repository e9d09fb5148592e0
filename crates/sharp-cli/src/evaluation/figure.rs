//! A figure: a legend, panels beside each other, and the numbers as a table.
//!
//! A panel is as wide as a telephone. On a wide screen several stand side by side, so that text has one
//! size everywhere.

use std::collections::BTreeSet;

use crate::render::{Anchor, Chart, Lettering, Shape};

/// Width of a panel, user units; about the pixels of a telephone.
pub(super) const WIDTH: f64 = 360.0;
/// Left end of the plotted area.
pub(super) const LEFT: f64 = 34.0;
/// Right end of the plotted area; beyond it stands the number.
pub(super) const RIGHT: f64 = 304.0;
/// Height that the title of a panel takes.
pub(super) const TOP: f64 = 24.0;
/// Height that the title of the whole figure takes in a file of its own.
const TITLE: f64 = 26.0;
/// Size of text.
pub(super) const TEXT: f64 = 11.0;
pub(super) const INK: &str = "#1a1a1a";
pub(super) const SOFT: &str = "#595959";
/// Pixels of a PNG per user unit.
const PNG_SCALE: f64 = 2.0;
const RULE: &str = "#dcdcdc";
/// Radius of a marker, user units.
const MARKER: f64 = 3.6;

/// One figure of the page.
#[derive(Debug)]
pub(super) struct Figure {
    /// Name of its files and of its place in the page.
    pub(super) name: &'static str,
    pub(super) title: &'static str,
    /// How to read it.
    pub(super) caption: String,
    pub(super) legend: Chart,
    pub(super) panels: Vec<Panel>,
    /// The numbers shown.
    pub(super) table: Table,
}

/// One part of a figure.
#[derive(Debug)]
pub(super) struct Panel {
    pub(super) title: String,
    pub(super) chart: Chart,
}

/// Rows of text under their columns' names.
#[derive(Debug)]
pub(super) struct Table {
    pub(super) columns: Vec<&'static str>,
    pub(super) rows: Vec<Vec<String>>,
}

impl Figure {
    /// The whole figure in one document.
    pub(super) fn to_svg(&self) -> String {
        self.sheet().to_svg(self.title, Lettering::Text)
    }

    /// The same without a font, and the longer side of its PNG in pixels.
    pub(super) fn to_plain_svg(&self) -> (String, u32) {
        let sheet = self.sheet();
        (sheet.to_svg(self.title, Lettering::Strokes), (PNG_SCALE * sheet.longer_side()) as u32)
    }

    fn sheet(&self) -> Chart {
        let charts: Vec<Chart> = self.panels.iter().map(|panel| panel.chart.clone()).collect();
        let mut header = Chart::new(WIDTH, self.legend.height() + TITLE);
        header.text([0.0, 14.0], Anchor::Start, TEXT + 5.0, INK, self.title);
        header.append(&self.legend, [0.0, TITLE]);
        Chart::grid(&header, &charts, 3)
    }
}

impl Panel {
    /// An empty panel with its title.
    pub(super) fn new(title: String, height: f64) -> Self {
        let mut chart = Chart::new(WIDTH, height);
        chart.text([0.0, 14.0], Anchor::Start, TEXT + 2.0, INK, title.clone());
        Self { title, chart }
    }
}

/// An axis from `low` to `high` between two ends in the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Axis {
    pub(super) low: f64,
    pub(super) high: f64,
    /// Between two values that are written.
    pub(super) step: f64,
    /// Where `low` and `high` are, user units.
    pub(super) ends: [f64; 2],
}

impl Axis {
    /// An axis with round values from `low` to `high`.
    pub(super) fn new([low, high]: [f64; 2], ends: [f64; 2]) -> Self {
        Self { low, high, step: round_step(high - low), ends }
    }

    /// A horizontal axis of shares.
    pub(super) fn of_shares() -> Self {
        Self::new([0.0, 1.0], [LEFT, RIGHT])
    }

    /// A horizontal axis of decimal logarithms that shows everything from `least` to `most`: whole
    /// decades, at least one.
    pub(super) fn decades(least: f64, most: f64) -> Self {
        let low = least.floor();
        Self { low, high: most.ceil().max(low + 1.0), step: 1.0, ends: [LEFT, RIGHT] }
    }

    /// Where `value` is; values outside stop at the ends.
    pub(super) fn at(&self, value: f64) -> f64 {
        let share = ((value - self.low) / (self.high - self.low)).clamp(0.0, 1.0);
        self.ends[0] + share * (self.ends[1] - self.ends[0])
    }

    /// A horizontal axis from zero to the next round value above `most`, at least 1.
    pub(super) fn from_zero(most: f64) -> Self {
        let most = most.max(1.0);
        let step = round_step(most);
        Self { low: 0.0, high: (most / step).ceil() * step, step, ends: [LEFT, RIGHT] }
    }

    /// Round values from `low` to `high`, at most seven.
    pub(super) fn ticks(&self) -> Vec<f64> {
        let first = (self.low / self.step).round();
        let count = ((self.high - self.low) / self.step).round() as u32;
        (0..=count).map(|i| (first + f64::from(i)) * self.step).collect()
    }

    /// Draws rules from `top` to `bottom` with their values, as `text` writes them, below.
    pub(super) fn draw(&self, chart: &mut Chart, [top, bottom]: [f64; 2], text: impl Fn(f64) -> String) {
        for tick in self.ticks() {
            let x = self.at(tick);
            chart.line([x, top], [x, bottom], RULE, 1.0);
            chart.text([x, bottom + 15.0], Anchor::Middle, TEXT, SOFT, text(tick));
        }
    }

    /// Draws the rules of a vertical axis from `left` to `right`.
    pub(super) fn draw_upright(
        &self,
        chart: &mut Chart,
        [left, right]: [f64; 2],
        text: impl Fn(f64) -> String,
    ) {
        for tick in self.ticks() {
            let y = self.at(tick);
            chart.line([left, y], [right, y], RULE, 1.0);
            chart.text([left - 8.0, y + 4.0], Anchor::End, TEXT, SOFT, text(tick));
        }
    }
}

/// A round step (1, 2 or 5 times a power of ten) that divides `range` into at most six parts.
fn round_step(range: f64) -> f64 {
    let rough = range / 5.0;
    let power = 10_f64.powf(rough.log10().floor());
    [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .map(|digit| digit * power)
        .find(|&step| step >= rough * 0.999)
        .unwrap_or(power)
}

/// Draws the marker of `style`; hollow ones are for what came to nothing.
pub(super) fn marker(chart: &mut Chart, at: [f64; 2], style: &Style, hollow: bool) {
    chart.marker(at, style.shape, MARKER, style.color);
    if hollow {
        chart.marker(at, style.shape, 0.55 * MARKER, "#fff");
    }
}

/// A number of seconds, short.
pub(super) fn seconds(value: f64) -> String {
    let decimals = if value >= 100.0 { 0 } else { usize::from(value < 1.0) + 1 };
    format!("{value:.decimals$} s")
}

/// A number as it would be said, without what rounding left.
pub(super) fn plain(value: f64) -> String {
    ((value * 1e6).round() / 1e6).to_string()
}

/// A share as a percentage, short.
pub(super) fn percent(share: f64) -> String {
    format!("{:.0} %", 100.0 * share)
}

/// A method of the figures: its name, how it is called on the page, its colour and its marker.
///
/// The colours are those of Okabe and Ito, which the colour-blind tell apart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Style {
    name: &'static str,
    pub(super) label: &'static str,
    pub(super) color: &'static str,
    pub(super) shape: Shape,
}

const STYLES: [Style; 9] = [
    Style { name: "centroid", label: "SHARP centroid", color: "#0072b2", shape: Shape::Circle },
    Style { name: "interface", label: "SHARP interface", color: "#d55e00", shape: Shape::Diamond },
    Style { name: "rrt", label: "RRT", color: "#707070", shape: Shape::Square },
    Style { name: "rrt-contact", label: "RRT, contact allowed", color: "#cc79a7", shape: Shape::Square },
    Style { name: "track", label: "tracking", color: "#009e73", shape: Shape::Up },
    Style { name: "mppi", label: "MPPI", color: "#e69f00", shape: Shape::Down },
    Style { name: "sac", label: "flat SAC", color: "#56b4e9", shape: Shape::Star },
    Style { name: "paper", label: "in the paper", color: "#999999", shape: Shape::Star },
    Style { name: "", label: "other", color: "#1a1a1a", shape: Shape::Star },
];

impl Style {
    /// The style of a kind of option or a baseline; what has none of its own is `other`.
    pub(super) fn of(name: &str) -> Self {
        STYLES[Self::rank(name)]
    }

    /// Its place among the methods.
    pub(super) fn rank(name: &str) -> usize {
        STYLES.iter().position(|style| style.name == name).unwrap_or(STYLES.len() - 1)
    }
}

/// A legend of the styles of `names`, each once.
pub(super) fn legend<'a>(names: impl IntoIterator<Item = &'a str>) -> Chart {
    let ranks: BTreeSet<usize> = names.into_iter().map(Style::rank).collect();
    key(&ranks
        .iter()
        .map(|&rank| (STYLES[rank].label, STYLES[rank].color, STYLES[rank].shape))
        .collect::<Vec<_>>())
}

/// Markers with their labels, in as many rows as a panel's width needs.
pub(super) fn key(items: &[(&str, &'static str, Shape)]) -> Chart {
    let width = |label: &str| Chart::text_width(label, TEXT) + 32.0;
    let (mut left, mut top) = (0.0, 0.0);
    let mut places = Vec::new();
    for (label, ..) in items {
        if left > 0.0 && left + width(label) > WIDTH {
            (left, top) = (0.0, top + 18.0);
        }
        places.push([left, top]);
        left += width(label);
    }
    let mut chart = Chart::new(WIDTH, top + 24.0);
    for (&(label, color, shape), [x, y]) in items.iter().zip(places) {
        chart.marker([x + 7.0, y + 9.0], shape, 5.0, color);
        chart.text([x + 17.0, y + 13.0], Anchor::Start, TEXT, INK, label);
    }
    chart
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn axes_end_at_round_values() {
        for (most, ticks) in
            [(213.4, "0 50 100 150 200 250"), (0.0, "0 0.2 0.4 0.6 0.8 1"), (7.3, "0 2 4 6 8")]
        {
            let axis = Axis::from_zero(most);
            let texts: Vec<String> = axis.ticks().into_iter().map(plain).collect();
            assert_eq!(texts.join(" "), ticks, "{most}: {axis:?}");
        }
    }

    #[test]
    fn times_have_as_many_decimals_as_their_size_deserves() {
        assert_eq!([0.042, 1.0, 99.94, 213.4].map(seconds), ["0.04 s", "1.0 s", "99.9 s", "213 s"]);
    }

    #[test]
    fn decades_are_whole() {
        for (ends, ticks) in [([-0.5, 2.9], "-1 0 1 2 3"), ([1.0, 1.0], "1 2"), ([0.2, 0.4], "0 1")] {
            let texts: Vec<String> = Axis::decades(ends[0], ends[1]).ticks().into_iter().map(plain).collect();
            assert_eq!(texts.join(" "), ticks, "{ends:?}");
        }
    }

    #[test]
    fn values_outside_an_axis_stop_at_its_ends() {
        let axis = Axis::new([0.5, 1.0], [10.0, 20.0]);
        assert_eq!([0.2, 0.75, 3.0].map(|value| axis.at(value)), [10.0, 15.0, 20.0]);
    }

    #[test]
    fn unknown_methods_have_a_style_of_their_own() {
        assert_eq!(Style::of("mppi").label, "MPPI");
        assert_eq!(Style::of("walk").label, "other");
    }
}
