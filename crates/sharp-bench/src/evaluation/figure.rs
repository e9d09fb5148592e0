//! A figure of the report: a legend, panels beside each other, and the numbers as a table.

use std::collections::BTreeSet;

use sharp_draw::{Chart, Color, LegendItem, Marker, Panel, TextStyle, legend, sheet};

/// Text of a figure.
pub(super) const LABEL: TextStyle = TextStyle::new(Panel::TEXT);
/// Text that stands back.
const NOTE: TextStyle = LABEL.color(Color::SOFT);
/// Pixels of a PNG per user unit.
const PNG_SCALE: f64 = 2.0;
/// Panels side by side in a file of its own.
const COLUMNS: usize = 3;
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

/// Rows of text under their columns' names.
#[derive(Debug)]
pub(super) struct Table {
    pub(super) columns: Vec<&'static str>,
    pub(super) rows: Vec<Vec<String>>,
}

impl Figure {
    /// The whole figure in one document, and the longer side of its PNG in pixels.
    pub(super) fn to_svg(&self) -> (String, u32) {
        let sheet = sheet(self.title, &self.legend, &self.panels, COLUMNS);
        (sheet.to_svg(self.title), (PNG_SCALE * sheet.longer_side()) as u32)
    }
}

/// Writes the name of a group of rows; the rules of the axis do not cross it.
pub(super) fn heading(chart: &mut Chart, [x, y]: [f64; 2], text: &str) {
    chart.rect([x - 2.0, y - 11.0], [NOTE.width(text) + 6.0, 14.0], Color::WHITE);
    chart.text([x, y], NOTE, text);
}

/// Draws the marker of `style`; hollow ones are for what came to nothing.
pub(super) fn marker(chart: &mut Chart, at: [f64; 2], style: &Style, hollow: bool) {
    chart.marker(at, style.marker, MARKER, style.color);
    if hollow {
        chart.marker(at, style.marker, 0.55 * MARKER, Color::WHITE);
    }
}

/// A method of the figures: its name, how it is called on the page, its colour and its marker.
///
/// The colours are those of Okabe and Ito, which the colour-blind tell apart.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Style {
    name: &'static str,
    pub(super) label: &'static str,
    pub(super) color: Color,
    pub(super) marker: Marker,
}

const STYLES: [Style; 9] = [
    Style { name: "centroid", label: "SHARP centroid", color: Color::hex(0x0072b2), marker: Marker::Circle },
    Style {
        name: "interface",
        label: "SHARP interface",
        color: Color::hex(0xd55e00),
        marker: Marker::Diamond,
    },
    Style { name: "rrt", label: "RRT", color: Color::hex(0x707070), marker: Marker::Square },
    Style {
        name: "rrt-contact",
        label: "RRT, contact allowed",
        color: Color::hex(0xcc79a7),
        marker: Marker::Square,
    },
    Style { name: "track", label: "tracking", color: Color::hex(0x009e73), marker: Marker::Up },
    Style { name: "mppi", label: "MPPI", color: Color::hex(0xe69f00), marker: Marker::Down },
    Style { name: "sac", label: "flat SAC", color: Color::hex(0x56b4e9), marker: Marker::Star },
    Style { name: "paper", label: "in the paper", color: Color::hex(0x999999), marker: Marker::Star },
    Style { name: "", label: "other", color: Color::hex(0x1a1a1a), marker: Marker::Star },
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
pub(super) fn method_legend<'a>(names: impl IntoIterator<Item = &'a str>) -> Chart {
    let ranks: BTreeSet<usize> = names.into_iter().map(Style::rank).collect();
    let item = |rank: usize| {
        let Style { label, color, marker, .. } = STYLES[rank];
        LegendItem { label, color, marker }
    };
    legend(&ranks.into_iter().map(item).collect::<Vec<_>>())
}

/// `legend` with a line of text below it.
pub(super) fn noted(legend: &Chart, note: &str) -> Chart {
    let mut noted = Chart::new(legend.width(), legend.height() + 18.0);
    noted.append(legend, [0.0, 0.0]);
    noted.text([0.0, legend.height() + 7.0], NOTE, note);
    noted
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unknown_methods_have_a_style_of_their_own() {
        assert_eq!(Style::of("mppi").label, "MPPI");
        assert_eq!(Style::of("walk").label, "other");
    }
}
