//! Figures of numbers: marks placed by their caller, written as SVG.

use std::f64::consts::TAU;

use super::letters;
use super::svg::{PathData, Svg, number};

/// Font of text: whatever the reader's system shows its own text in.
const FONT: &str = "system-ui, sans-serif";
/// Distance between charts side by side, user units.
const GAP: f64 = 16.0;

/// Which end of a text is at its point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Anchor {
    Start,
    Middle,
    End,
}

/// How text is written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Lettering {
    /// As text, which can be selected, searched and read aloud.
    Text,
    /// As strokes, for pictures made where there is no font.
    Strokes,
}

/// Markers that differ without their colours.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Shape {
    Circle,
    Square,
    Diamond,
    Up,
    Down,
    Star,
}

impl Shape {
    /// Corners around the origin; the areas look alike for equal `radius`.
    fn corners(self, radius: f64) -> Vec<[f64; 2]> {
        let (count, turn, scale) = match self {
            Self::Circle => (16, 0.0, 1.0),
            Self::Square => (4, 0.125, 1.2),
            Self::Diamond => (4, 0.0, 1.3),
            Self::Up => (3, -0.25, 1.4),
            Self::Down => (3, 0.25, 1.4),
            Self::Star => (10, -0.25, 1.5),
        };
        (0..count)
            .map(|i| {
                let angle = TAU * (f64::from(i) / f64::from(count) + turn);
                let inner = if self == Self::Star && i % 2 == 1 { 0.45 } else { 1.0 };
                [radius * scale * inner * angle.cos(), radius * scale * inner * angle.sin()]
            })
            .collect()
    }
}

#[derive(Clone, Debug, PartialEq)]
enum Mark {
    Polygon { corners: Vec<[f64; 2]>, color: &'static str },
    Line { from: [f64; 2], to: [f64; 2], color: &'static str, width: f64 },
    Text { at: [f64; 2], anchor: Anchor, size: f64, color: &'static str, text: String },
}

/// A figure under construction, y downwards.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Chart {
    width: f64,
    height: f64,
    marks: Vec<Mark>,
}

impl Chart {
    pub(crate) const fn new(width: f64, height: f64) -> Self {
        Self { width, height, marks: Vec::new() }
    }

    /// Width that a text takes, about.
    pub(crate) fn text_width(text: &str, size: f64) -> f64 {
        letters::width(text, size)
    }

    /// A filled rectangle from its top left corner.
    pub(crate) fn rect(&mut self, [x, y]: [f64; 2], [width, height]: [f64; 2], color: &'static str) {
        let corners = vec![[x, y], [x + width, y], [x + width, y + height], [x, y + height]];
        self.marks.push(Mark::Polygon { corners, color });
    }

    pub(crate) fn line(&mut self, from: [f64; 2], to: [f64; 2], color: &'static str, width: f64) {
        self.marks.push(Mark::Line { from, to, color, width });
    }

    /// A marker centred at `at`.
    pub(crate) fn marker(&mut self, at: [f64; 2], shape: Shape, radius: f64, color: &'static str) {
        let corners = shape.corners(radius).into_iter().map(|corner| add(corner, at)).collect();
        self.marks.push(Mark::Polygon { corners, color });
    }

    /// `text` on the line through `at`.
    pub(crate) fn text(
        &mut self,
        at: [f64; 2],
        anchor: Anchor,
        size: f64,
        color: &'static str,
        text: impl Into<String>,
    ) {
        self.marks.push(Mark::Text { at, anchor, size, color, text: text.into() });
    }

    /// `header` on top of `charts` in rows of `columns`, each row as high as its highest chart.
    pub(crate) fn grid(header: &Self, charts: &[Self], columns: usize) -> Self {
        let column = charts.iter().map(|chart| chart.width).fold(header.width, f64::max) + GAP;
        let width = column * columns.min(charts.len()).max(1) as f64 + GAP;
        let mut grid = Self::new(width, 0.0);
        let mut top = GAP;
        grid.append(header, [GAP, top]);
        top += header.height;
        for row in charts.chunks(columns.max(1)) {
            for (i, chart) in row.iter().enumerate() {
                grid.append(chart, [GAP + column * i as f64, top]);
            }
            top += row.iter().map(|chart| chart.height).fold(0.0, f64::max) + GAP;
        }
        grid.height = top;
        grid
    }

    /// Adds the marks of `other`, moved by `offset`.
    pub(crate) fn append(&mut self, other: &Self, offset: [f64; 2]) {
        self.marks.extend(other.marks.iter().cloned().map(|mark| mark.moved(offset)));
    }

    pub(crate) const fn height(&self) -> f64 {
        self.height
    }

    /// The longer side, user units.
    pub(crate) const fn longer_side(&self) -> f64 {
        self.width.max(self.height)
    }

    /// The document; `label` says to those who cannot see it what it shows.
    pub(crate) fn to_svg(&self, label: &str, lettering: Lettering) -> String {
        let mut svg = Svg::new([0.0, 0.0, self.width, self.height], self.longer_side());
        svg.text("title", &[], label);
        let size = [("width", number(self.width)), ("height", number(self.height)), ("fill", "#fff".into())];
        svg.element("rect", &size);
        for mark in &self.marks {
            write(&mut svg, mark, lettering);
        }
        svg.finish()
    }
}

impl Mark {
    fn moved(self, by: [f64; 2]) -> Self {
        match self {
            Self::Polygon { corners, color } => {
                Self::Polygon { corners: corners.into_iter().map(|corner| add(corner, by)).collect(), color }
            }
            Self::Line { from, to, color, width } => {
                Self::Line { from: add(from, by), to: add(to, by), color, width }
            }
            Self::Text { at, anchor, size, color, text } => {
                Self::Text { at: add(at, by), anchor, size, color, text }
            }
        }
    }
}

fn add(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] + b[0], a[1] + b[1]]
}

fn write(svg: &mut Svg, mark: &Mark, lettering: Lettering) {
    match mark {
        Mark::Polygon { corners, color } => {
            let d = PathData::polyline(corners.iter().copied()).close().finish();
            svg.element("path", &[("d", d), ("fill", (*color).into())]);
        }
        Mark::Line { from, to, color, width } => {
            stroke(svg, PathData::polyline([*from, *to]), color, *width);
        }
        Mark::Text { at, anchor, size, color, text } if lettering == Lettering::Strokes => {
            let share = match anchor {
                Anchor::Start => 0.0,
                Anchor::Middle => 0.5,
                Anchor::End => 1.0,
            };
            let start = [at[0] - share * letters::width(text, *size), at[1]];
            stroke(svg, letters::strokes(text, start, *size), color, size * 0.09);
        }
        Mark::Text { at, anchor, size, color, text } => {
            let anchor = match anchor {
                Anchor::Start => "start",
                Anchor::Middle => "middle",
                Anchor::End => "end",
            };
            let attributes = [
                ("x", number(at[0])),
                ("y", number(at[1])),
                ("font-size", number(*size)),
                ("font-family", FONT.into()),
                ("text-anchor", anchor.into()),
                ("fill", (*color).into()),
            ];
            svg.text("text", &attributes, text);
        }
    }
}

fn stroke(svg: &mut Svg, path: PathData, color: &str, width: f64) {
    svg.element(
        "path",
        &[
            ("d", path.finish()),
            ("fill", "none".into()),
            ("stroke", color.into()),
            ("stroke-width", number(width)),
            ("stroke-linecap", "round".into()),
        ],
    );
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(text: &str) -> Chart {
        let mut chart = Chart::new(100.0, 40.0);
        chart.text([50.0, 20.0], Anchor::Middle, 10.0, "#000", text);
        chart.marker([10.0, 10.0], Shape::Up, 3.0, "#0072b2");
        chart
    }

    #[test]
    fn text_is_text_or_strokes() {
        let text = chart("a<b").to_svg("what & why", Lettering::Text);
        assert!(text.contains(">a&lt;b</text>"), "{text}");
        assert!(text.contains("<title>what &amp; why</title>"), "{text}");
        let strokes = chart("a<b").to_svg("", Lettering::Strokes);
        assert!(!strokes.contains("<text"), "no font is needed: {strokes}");
    }

    #[test]
    fn a_grid_breaks_into_rows() {
        let charts = vec![chart("one"), chart("two"), chart("three")];
        let grid = Chart::grid(&Chart::new(100.0, 20.0), &charts, 2);
        assert_eq!((grid.width, grid.height), (248.0, 148.0), "two columns, a header and two rows");
        assert_eq!(grid.marks.len(), 6, "all marks of all charts");
    }
}
