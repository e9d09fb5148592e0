//! Text in pictures: its style, its width, and how it is written.

use crate::color::Color;
use crate::font::{self, Weight};
use crate::svg::{Svg, number};

/// How a text looks and which end of it is at its point.
///
/// ```
/// use sharp_draw::{Color, TextStyle};
///
/// let title = TextStyle::new(13.0).bold();
/// let unit = TextStyle::new(11.0).color(Color::SOFT).middle();
/// assert!(title.width("seconds") > unit.width("seconds"));
/// ```
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextStyle {
    size: f64,
    color: Color,
    anchor: Anchor,
    weight: Weight,
    is_upright: bool,
}

/// Which end of a text is at its point.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Anchor {
    Start,
    Middle,
    End,
}

impl TextStyle {
    /// Regular weight, dark grey, beginning at its point; `size` is the height of a line in user units.
    #[must_use]
    pub const fn new(size: f64) -> Self {
        Self { size, color: Color::INK, anchor: Anchor::Start, weight: Weight::Regular, is_upright: false }
    }

    /// In another colour.
    #[must_use]
    pub const fn color(self, color: Color) -> Self {
        Self { color, ..self }
    }

    /// With its middle at the point.
    #[must_use]
    pub const fn middle(self) -> Self {
        Self { anchor: Anchor::Middle, ..self }
    }

    /// With its end at the point.
    #[must_use]
    pub const fn end(self) -> Self {
        Self { anchor: Anchor::End, ..self }
    }

    /// In the semi-bold weight.
    #[must_use]
    pub const fn bold(self) -> Self {
        Self { weight: Weight::SemiBold, ..self }
    }

    /// Read from bottom to top, as beside a vertical axis.
    #[must_use]
    pub const fn upright(self) -> Self {
        Self { is_upright: true, ..self }
    }

    /// Width of `text`, user units.
    #[must_use]
    pub fn width(&self, text: &str) -> f64 {
        font::width(text, self.size, self.weight)
    }

    /// Writes `text` on the line through `at`, with a white rim `halo` wide if that is above 0.
    ///
    /// The width is part of the document: a browser with another font keeps to it, so that text
    /// stays clear of its neighbours everywhere.
    pub(crate) fn write(&self, svg: &mut Svg, at: [f64; 2], text: &str, halo: f64) {
        if text.is_empty() {
            return;
        }
        let [x, y] = at.map(number);
        let mut attributes = vec![
            ("x", x.clone()),
            ("y", y.clone()),
            ("font-size", number(self.size)),
            ("fill", self.color.into()),
            ("textLength", number(self.width(text))),
            ("lengthAdjust", "spacingAndGlyphs".into()),
        ];
        match self.anchor {
            Anchor::Start => {}
            Anchor::Middle => attributes.push(("text-anchor", "middle".into())),
            Anchor::End => attributes.push(("text-anchor", "end".into())),
        }
        if self.weight != Weight::Regular {
            attributes.push(("font-weight", self.weight.css().into()));
        }
        if self.is_upright {
            attributes.push(("transform", format!("rotate(-90 {x} {y})")));
        }
        if halo > 0.0 {
            attributes.extend([
                ("stroke", Color::WHITE.into()),
                ("stroke-width", number(halo)),
                ("stroke-linejoin", "round".into()),
                ("paint-order", "stroke".into()),
            ]);
        }
        svg.text("text", &attributes, text);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Columns of `png` with a dark pixel: the first and the last.
    fn dark_columns(svg: &str) -> (u32, u32) {
        let png = crate::svg_to_png(svg, 400).expect("a picture");
        let image = image::load_from_memory(&png).expect("a PNG").to_luma8();
        let dark: Vec<u32> =
            image.enumerate_pixels().filter(|(.., pixel)| pixel.0[0] < 128).map(|(x, ..)| x).collect();
        (*dark.iter().min().expect("ink"), *dark.iter().max().expect("ink"))
    }

    #[test]
    fn text_is_drawn_as_wide_as_it_was_measured() {
        let style = TextStyle::new(20.0);
        for (style, left) in [
            (style, 200.0),
            (style.bold(), 200.0),
            (style.middle(), 200.0 - style.width("HIIIIIIIIH") / 2.0),
            (style.end(), 200.0 - style.width("HIIIIIIIIH")),
        ] {
            let mut svg = Svg::new([400.0, 50.0]);
            svg.background(Color::WHITE);
            style.write(&mut svg, [200.0, 30.0], "HIIIIIIIIH", 0.0);
            let (first, last) = dark_columns(&svg.finish());
            let right = left + style.width("HIIIIIIIIH");
            assert!((f64::from(first) - left).abs() < 4.0, "begins at {first}, expected {left}");
            assert!((f64::from(last) - right).abs() < 4.0, "ends at {last}, expected {right}");
        }
    }

    #[test]
    fn a_rim_lies_behind_the_letters() {
        let mut svg = Svg::new([100.0, 20.0]);
        TextStyle::new(10.0).upright().write(&mut svg, [5.0, 15.0], "a<b", 2.0);
        let text = svg.finish();
        assert!(text.contains("paint-order=\"stroke\"") && text.contains(">a&lt;b</text>"), "{text}");
        assert!(text.contains("rotate(-90 5 15)"), "{text}");
    }
}
