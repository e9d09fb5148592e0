//! A writer of the little SVG that the pictures need.

use std::borrow::Cow;
use std::fmt::Write;

/// `text` for the inside of an element or attribute, of SVG and of HTML.
pub(crate) fn escape(text: &str) -> Cow<'_, str> {
    if !text.contains(['&', '<', '>', '"', '\'']) {
        return Cow::Borrowed(text);
    }
    let text = text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
    Cow::Owned(text.replace('"', "&quot;").replace('\'', "&#39;"))
}

/// Writes `value` with at most two decimals: a hundredth of a cell is finer than any pixel.
pub(super) fn number(value: f64) -> String {
    let text = format!("{value:.2}");
    let trimmed = text.trim_end_matches('0').trim_end_matches('.');
    if trimmed == "-0" { "0".into() } else { trimmed.into() }
}

/// A document under construction.
#[derive(Debug)]
pub(super) struct Svg {
    text: String,
    open: Vec<&'static str>,
}

impl Svg {
    /// A document that shows `view` (left, top, width, height in user units) with a longer side of
    /// `side_px` pixels.
    pub(super) fn new(view: [f64; 4], side_px: f64) -> Self {
        let mut svg = Self { text: String::new(), open: Vec::new() };
        let [_, _, width, height] = view;
        let scale = side_px / width.max(height);
        svg.open(
            "svg",
            &[
                ("xmlns", "http://www.w3.org/2000/svg".into()),
                ("viewBox", view.map(number).join(" ")),
                ("width", number(width * scale)),
                ("height", number(height * scale)),
            ],
        );
        svg
    }

    /// Opens an element that holds others.
    pub(super) fn open(&mut self, name: &'static str, attributes: &[(&str, String)]) {
        self.tag(name, attributes, ">\n");
        self.open.push(name);
    }

    /// Closes the element opened last.
    pub(super) fn close(&mut self) {
        if let Some(name) = self.open.pop() {
            // Writing to a String cannot fail.
            let _ = writeln!(self.text, "</{name}>");
        }
    }

    /// Writes an element without content.
    pub(super) fn element(&mut self, name: &str, attributes: &[(&str, String)]) {
        self.tag(name, attributes, "/>\n");
    }

    /// Writes an element that holds `text`.
    pub(super) fn text(&mut self, name: &str, attributes: &[(&str, String)], text: &str) {
        self.tag(name, attributes, ">");
        let _ = writeln!(self.text, "{}</{name}>", escape(text));
    }

    /// Closes everything and returns the document.
    pub(super) fn finish(mut self) -> String {
        while !self.open.is_empty() {
            self.close();
        }
        self.text
    }

    fn tag(&mut self, name: &str, attributes: &[(&str, String)], end: &str) {
        let _ = write!(self.text, "<{name}");
        for (key, value) in attributes {
            let _ = write!(self.text, " {key}=\"{}\"", escape(value));
        }
        self.text.push_str(end);
    }
}

/// The `d` attribute of a path, built step by step in user units.
#[derive(Clone, Debug, Default)]
pub(super) struct PathData(String);

impl PathData {
    /// A path through `points`, in order; closed if `closed`.
    pub(super) fn polyline(points: impl IntoIterator<Item = [f64; 2]>) -> Self {
        let mut path = Self::default();
        for (i, point) in points.into_iter().enumerate() {
            path = if i == 0 { path.move_to(point) } else { path.line_to(point) };
        }
        path
    }

    /// Starts a new stroke.
    pub(super) fn move_to(self, point: [f64; 2]) -> Self {
        self.command('M', &[point])
    }

    /// Draws a straight line.
    pub(super) fn line_to(self, point: [f64; 2]) -> Self {
        self.command('L', &[point])
    }

    /// Draws a quadratic curve that leaves and arrives towards `control`.
    pub(super) fn curve_to(self, control: [f64; 2], point: [f64; 2]) -> Self {
        self.command('Q', &[control, point])
    }

    /// Closes the stroke.
    pub(super) fn close(mut self) -> Self {
        self.0.push('z');
        self
    }

    /// The finished attribute.
    pub(super) fn finish(self) -> String {
        self.0
    }

    fn command(mut self, letter: char, points: &[[f64; 2]]) -> Self {
        self.0.push(letter);
        for (i, [x, y]) in points.iter().enumerate() {
            let separator = if i == 0 { "" } else { " " };
            let _ = write!(self.0, "{separator}{} {}", number(*x), number(*y));
        }
        self
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_short() {
        for (value, text) in
            [(1.0, "1"), (0.125, "0.12"), (-0.001, "0"), (-2.5, "-2.5"), (100.0, "100"), (12.340, "12.34")]
        {
            assert_eq!(number(value), text, "{value}");
        }
    }

    #[test]
    fn text_is_escaped() {
        let mut svg = Svg::new([0.0, 0.0, 1.0, 1.0], 1.0);
        svg.text("text", &[("class", "\"x\"".into())], "a < b & 'c'");
        let document = svg.finish();
        assert!(
            document.contains("<text class=\"&quot;x&quot;\">a &lt; b &amp; &#39;c&#39;</text>"),
            "{document}"
        );
    }

    #[test]
    fn elements_nest_and_close() {
        let mut svg = Svg::new([0.0, 0.0, 4.0, 2.0], 100.0);
        svg.open("g", &[("fill", "red".into())]);
        svg.element(
            "path",
            &[("d", PathData::polyline([[0.0, 0.0], [1.5, 2.0]]).curve_to([0.0, 1.0], [2.0, 2.0]).finish())],
        );
        assert_eq!(
            svg.finish(),
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 4 2\" width=\"100\" height=\"50\">\n\
             <g fill=\"red\">\n<path d=\"M0 0L1.5 2Q0 1 2 2\"/>\n</g>\n</svg>\n"
        );
    }
}
