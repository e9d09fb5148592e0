//! Panels beside each other under a title and a legend: the layout of all figures.
//!
//! A panel is as wide as a telephone. On a wide screen several stand side by side, so that text has
//! one size everywhere.

use crate::chart::{Chart, Marker};
use crate::color::Color;
use crate::text::TextStyle;

/// Distance between panels side by side, user units.
const GAP: f64 = 16.0;
/// Height that the title of a sheet takes, user units.
const TITLE: f64 = 28.0;
/// Height of a row of the legend, user units.
const LEGEND_ROW: f64 = 18.0;

/// One part of a figure: a chart with its title on top.
#[derive(Clone, Debug, PartialEq)]
pub struct Panel {
    /// The title, as it is drawn.
    pub title: String,
    /// Everything drawn so far.
    pub chart: Chart,
}

impl Panel {
    /// Width of a panel, user units; about the pixels of a telephone.
    pub const WIDTH: f64 = 360.0;
    /// Left end of the plotted area; before it stand names of rows.
    pub const LEFT: f64 = 34.0;
    /// Right end of the plotted area.
    pub const RIGHT: f64 = 288.0;
    /// Where the number of each row ends, right of the plotted area.
    pub const NUMBERS: f64 = 354.0;
    /// Height that the title takes.
    pub const TOP: f64 = 24.0;
    /// Size of text.
    pub const TEXT: f64 = 11.0;

    /// An empty panel with its title.
    #[must_use]
    pub fn new(title: impl Into<String>, height: f64) -> Self {
        let (title, mut chart) = (title.into(), Chart::new(Self::WIDTH, height));
        chart.text([0.0, 14.0], TextStyle::new(Self::TEXT + 1.5).bold(), title.clone());
        Self { title, chart }
    }
}

/// A marker and what it stands for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LegendItem<'a> {
    /// What it stands for.
    pub label: &'a str,
    /// Its colour.
    pub color: Color,
    /// Its shape.
    pub marker: Marker,
}

/// Markers with their labels, in as many rows as a panel's width needs.
#[must_use]
pub fn legend(items: &[LegendItem<'_>]) -> Chart {
    let style = TextStyle::new(Panel::TEXT);
    let width = |label: &str| style.width(label) + 34.0;
    let (mut left, mut top) = (0.0, 0.0);
    let mut places = Vec::new();
    for item in items {
        if left > 0.0 && left + width(item.label) > Panel::WIDTH {
            (left, top) = (0.0, top + LEGEND_ROW);
        }
        places.push([left, top]);
        left += width(item.label);
    }
    let mut chart = Chart::new(Panel::WIDTH, top + LEGEND_ROW + 6.0);
    for (item, [x, y]) in items.iter().zip(places) {
        chart.marker([x + 6.0, y + 9.0], item.marker, 4.2, item.color);
        chart.text([x + 16.0, y + 13.0], style, item.label);
    }
    chart
}

/// One picture with `title` and `legend` on top of `panels` in rows of `columns`, each row as high
/// as its highest panel.
#[must_use]
pub fn sheet(title: &str, legend: &Chart, panels: &[Panel], columns: usize) -> Chart {
    let style = TextStyle::new(Panel::TEXT + 5.0).bold();
    let column = Panel::WIDTH + GAP;
    let panels_wide = column * columns.min(panels.len()).max(1) as f64 - GAP;
    let wide = panels_wide.max(style.width(title)).max(legend.width()) + 2.0 * GAP;
    let mut chart = Chart::new(wide, 0.0);
    chart.text([GAP, GAP + 15.0], style, title);
    chart.append(legend, [GAP, GAP + TITLE]);
    let mut top = GAP + TITLE + legend.height() + GAP / 2.0;
    for row in panels.chunks(columns.max(1)) {
        for (i, panel) in row.iter().enumerate() {
            chart.append(&panel.chart, [GAP + column * i as f64, top]);
        }
        top += row.iter().map(|panel| panel.chart.height()).fold(0.0, f64::max) + GAP;
    }
    chart.with_height(top)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_sheet_breaks_into_rows() {
        let panels = ["one", "two", "three"].map(|title| Panel::new(title, 40.0));
        let sheet = sheet("all", &Chart::new(100.0, 20.0), &panels, 2);
        assert_eq!(sheet.width(), 2.0 * Panel::WIDTH + 3.0 * GAP, "two columns");
        assert_eq!(sheet.height(), GAP + TITLE + 20.0 + GAP / 2.0 + 2.0 * (40.0 + GAP), "two rows");
        assert_eq!(sheet.to_svg("").matches("<text").count(), 4, "all titles");
    }

    #[test]
    fn a_legend_breaks_where_a_panel_ends() {
        let item = LegendItem { label: "SHARP interface", color: Color::INK, marker: Marker::Star };
        assert_eq!(legend(&[item; 2]).height(), LEGEND_ROW + 6.0);
        assert_eq!(legend(&[item; 4]).height(), 2.0 * LEGEND_ROW + 6.0);
    }

    #[test]
    fn a_long_title_makes_a_sheet_wider() {
        let title = "Success of every problem with every kind of option under nominal noise";
        let sheet = sheet(title, &Chart::new(100.0, 20.0), &[Panel::new("one", 40.0)], 3);
        assert!(sheet.width() > Panel::WIDTH + 2.0 * GAP, "{}", sheet.width());
    }
}
