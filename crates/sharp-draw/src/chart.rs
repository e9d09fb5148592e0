//! Figures of numbers: marks placed by their caller, written as SVG.

use std::f64::consts::TAU;

use sharp_space::trig;

use crate::color::Color;
use crate::svg::{PathData, Svg, number};
use crate::text::TextStyle;

/// Shapes of points that can be told apart without their colours.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Marker {
    /// A disc.
    Circle,
    /// A square on its side.
    Square,
    /// A square on its corner.
    Diamond,
    /// A triangle that points up.
    Up,
    /// A triangle that points down.
    Down,
    /// A star with five points.
    Star,
}

impl Marker {
    /// Corners around the origin; the areas look alike for equal `radius`.
    fn corners(self, radius: f64) -> Vec<[f64; 2]> {
        let (count, turn, scale) = match self {
            Self::Circle => (24, 0.0, 1.0),
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
                [radius * scale * inner * trig::cos(angle), radius * scale * inner * trig::sin(angle)]
            })
            .collect()
    }
}

/// One thing that is drawn.
#[derive(Clone, Debug, PartialEq)]
enum ChartMark {
    Polygon { corners: Vec<[f64; 2]>, color: Color },
    Line { points: Vec<[f64; 2]>, color: Color, width: f64 },
    Text { at: [f64; 2], style: TextStyle, text: String },
}

/// A figure under construction. Places are user units from the top left corner, y downwards.
#[derive(Clone, Debug, PartialEq)]
pub struct Chart {
    width: f64,
    height: f64,
    marks: Vec<ChartMark>,
}

impl Chart {
    /// An empty figure.
    #[must_use]
    pub const fn new(width: f64, height: f64) -> Self {
        Self { width, height, marks: Vec::new() }
    }

    /// Adds a filled rectangle from its top left corner.
    pub fn rect(&mut self, [x, y]: [f64; 2], [width, height]: [f64; 2], color: Color) {
        let corners = vec![[x, y], [x + width, y], [x + width, y + height], [x, y + height]];
        self.marks.push(ChartMark::Polygon { corners, color });
    }

    /// Adds a straight line.
    pub fn line(&mut self, from: [f64; 2], to: [f64; 2], color: Color, width: f64) {
        self.polyline([from, to], color, width);
    }

    /// Adds a line through `points`.
    pub fn polyline(&mut self, points: impl IntoIterator<Item = [f64; 2]>, color: Color, width: f64) {
        self.marks.push(ChartMark::Line { points: points.into_iter().collect(), color, width });
    }

    /// Adds a marker centred at `at`.
    pub fn marker(&mut self, at: [f64; 2], marker: Marker, radius: f64, color: Color) {
        let corners = marker.corners(radius).into_iter().map(|corner| add(corner, at)).collect();
        self.marks.push(ChartMark::Polygon { corners, color });
    }

    /// Adds `text` on the line through `at`.
    pub fn text(&mut self, at: [f64; 2], style: TextStyle, text: impl Into<String>) {
        self.marks.push(ChartMark::Text { at, style, text: text.into() });
    }

    /// Adds the marks of `other`, moved by `offset`.
    pub fn append(&mut self, other: &Self, offset: [f64; 2]) {
        self.marks.extend(other.marks.iter().cloned().map(|mark| mark.moved(offset)));
    }

    /// The same marks on a sheet of another height.
    pub(crate) fn with_height(self, height: f64) -> Self {
        Self { height, ..self }
    }

    /// Width, user units.
    #[must_use]
    pub const fn width(&self) -> f64 {
        self.width
    }

    /// Height, user units.
    #[must_use]
    pub const fn height(&self) -> f64 {
        self.height
    }

    /// The longer side, user units.
    #[must_use]
    pub const fn longer_side(&self) -> f64 {
        self.width.max(self.height)
    }

    /// The document; `title` says to those who cannot see it what it shows. Equal charts give equal bytes.
    #[must_use]
    pub fn to_svg(&self, title: &str) -> String {
        let mut svg = Svg::new([self.width, self.height]);
        svg.text("title", &[], title);
        svg.background(Color::WHITE);
        for mark in &self.marks {
            mark.write(&mut svg);
        }
        svg.finish()
    }
}

impl ChartMark {
    fn moved(self, by: [f64; 2]) -> Self {
        let all = |points: Vec<[f64; 2]>| points.into_iter().map(|point| add(point, by)).collect();
        match self {
            Self::Polygon { corners, color } => Self::Polygon { corners: all(corners), color },
            Self::Line { points, color, width } => Self::Line { points: all(points), color, width },
            Self::Text { at, style, text } => Self::Text { at: add(at, by), style, text },
        }
    }

    fn write(&self, svg: &mut Svg) {
        match self {
            Self::Polygon { corners, color } => {
                let d = PathData::polyline(corners.iter().copied()).close().finish();
                svg.element("path", &[("d", d), ("fill", (*color).into())]);
            }
            Self::Line { points, color, width } => svg.element(
                "path",
                &[
                    ("d", PathData::polyline(points.iter().copied()).finish()),
                    ("fill", "none".into()),
                    ("stroke", (*color).into()),
                    ("stroke-width", number(*width)),
                    ("stroke-linecap", "round".into()),
                    ("stroke-linejoin", "round".into()),
                ],
            ),
            Self::Text { at, style, text } => style.write(svg, *at, text, 0.0),
        }
    }
}

fn add(a: [f64; 2], b: [f64; 2]) -> [f64; 2] {
    [a[0] + b[0], a[1] + b[1]]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texts_are_text_and_escaped() {
        let mut chart = Chart::new(100.0, 40.0);
        chart.text([50.0, 20.0], TextStyle::new(10.0).middle(), "a<b");
        chart.marker([10.0, 10.0], Marker::Up, 3.0, Color::hex(0x0072b2));
        let svg = chart.to_svg("what & why");
        assert!(svg.contains(">a&lt;b</text>"), "{svg}");
        assert!(svg.contains("<title>what &amp; why</title>"), "{svg}");
        assert!(svg.contains("fill=\"#0072b2\""), "{svg}");
    }

    #[test]
    fn charts_can_stand_in_charts() {
        let mut part = Chart::new(10.0, 10.0);
        part.line([0.0, 0.0], [10.0, 10.0], Color::INK, 1.0);
        let mut whole = Chart::new(20.0, 10.0);
        whole.append(&part, [10.0, 0.0]);
        assert!(whole.to_svg("").contains("d=\"M10 0L20 10\""), "{}", whole.to_svg(""));
    }
}
