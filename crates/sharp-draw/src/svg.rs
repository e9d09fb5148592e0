//! A writer of the few elements of SVG that pictures need.

use std::borrow::Cow;
use std::fmt::Write;

use crate::color::Color;
use crate::font;

/// `text` for the inside of an element or attribute, of SVG and of HTML: `&`, `<`, `>` and quotes are replaced.
#[must_use]
pub fn escape(text: &str) -> Cow<'_, str> {
    if !text.contains(['&', '<', '>', '"', '\'']) {
        return Cow::Borrowed(text);
    }
    let text = text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;");
    Cow::Owned(text.replace('"', "&quot;").replace('\'', "&#39;"))
}

/// Writes `value` with at most two decimals: a hundredth of a pixel or of a cell cannot be seen.
pub(crate) fn number(value: f64) -> String {
    let text = format!("{value:.2}");
    let trimmed = text.trim_end_matches('0').trim_end_matches('.');
    if trimmed == "-0" { "0".into() } else { trimmed.into() }
}

/// A document under construction.
#[derive(Debug)]
pub(crate) struct Svg {
    text: String,
    open: Vec<&'static str>,
    size: [f64; 2],
}

impl Svg {
    /// A document of `size` (width, height) in user units, each shown as a pixel.
    pub(crate) fn new([width, height]: [f64; 2]) -> Self {
        let mut svg = Self { text: String::new(), open: Vec::new(), size: [width, height] };
        svg.open(
            "svg",
            &[
                ("xmlns", "http://www.w3.org/2000/svg".into()),
                ("viewBox", [0.0, 0.0, width, height].map(number).join(" ")),
                ("width", number(width)),
                ("height", number(height)),
                ("font-family", font::FAMILY.into()),
            ],
        );
        svg
    }

    /// Fills the whole document with `color`.
    pub(crate) fn background(&mut self, color: Color) {
        let [width, height] = self.size.map(number);
        self.element("rect", &[("width", width), ("height", height), ("fill", color.into())]);
    }

    /// Opens a window of `size` pixels at the top left corner that shows `view` (left, top, width,
    /// height in the units of what is drawn inside) and cuts off the rest.
    pub(crate) fn open_window(&mut self, view: [f64; 4], [width, height]: [f64; 2]) {
        let attributes =
            [("viewBox", view.map(number).join(" ")), ("width", number(width)), ("height", number(height))];
        self.open("svg", &attributes);
    }

    /// Opens an element that holds others.
    pub(crate) fn open(&mut self, name: &'static str, attributes: &[(&str, String)]) {
        self.tag(name, attributes, ">\n");
        self.open.push(name);
    }

    /// Closes the element opened last.
    pub(crate) fn close(&mut self) {
        if let Some(name) = self.open.pop() {
            // Writing to a String cannot fail.
            let _ = writeln!(self.text, "</{name}>");
        }
    }

    /// Writes an element without content.
    pub(crate) fn element(&mut self, name: &str, attributes: &[(&str, String)]) {
        self.tag(name, attributes, "/>\n");
    }

    /// Writes an element that holds `text`.
    pub(crate) fn text(&mut self, name: &str, attributes: &[(&str, String)], text: &str) {
        self.tag(name, attributes, ">");
        let _ = writeln!(self.text, "{}</{name}>", escape(text));
    }

    /// Closes everything and returns the document.
    pub(crate) fn finish(mut self) -> String {
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
pub(crate) struct PathData(String);

impl PathData {
    /// A path through `points`, in order; open at its end.
    pub(crate) fn polyline(points: impl IntoIterator<Item = [f64; 2]>) -> Self {
        let mut path = Self::default();
        for (i, point) in points.into_iter().enumerate() {
            path = if i == 0 { path.move_to(point) } else { path.line_to(point) };
        }
        path
    }

    /// Starts a new stroke.
    pub(crate) fn move_to(self, point: [f64; 2]) -> Self {
        self.command('M', &[point])
    }

    /// Draws a straight line.
    pub(crate) fn line_to(self, point: [f64; 2]) -> Self {
        self.command('L', &[point])
    }

    /// Draws a quadratic curve that leaves and arrives towards `control`.
    pub(crate) fn curve_to(self, control: [f64; 2], point: [f64; 2]) -> Self {
        self.command('Q', &[control, point])
    }

    /// Closes the stroke.
    pub(crate) fn close(mut self) -> Self {
        self.0.push('z');
        self
    }

    /// The finished attribute.
    pub(crate) fn finish(self) -> String {
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
        let mut svg = Svg::new([1.0, 1.0]);
        svg.text("text", &[("class", "\"x\"".into())], "a < b & 'c'");
        let document = svg.finish();
        assert!(
            document.contains("<text class=\"&quot;x&quot;\">a &lt; b &amp; &#39;c&#39;</text>"),
            "{document}"
        );
    }

    #[test]
    fn elements_nest_and_close() {
        let mut svg = Svg::new([4.0, 2.0]);
        svg.open("g", &[("fill", "red".into())]);
        svg.element(
            "path",
            &[("d", PathData::polyline([[0.0, 0.0], [1.5, 2.0]]).curve_to([0.0, 1.0], [2.0, 2.0]).finish())],
        );
        assert_eq!(
            svg.finish(),
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 4 2\" width=\"4\" height=\"2\" \
             font-family=\"Inter, system-ui, sans-serif\">\n\
             <g fill=\"red\">\n<path d=\"M0 0L1.5 2Q0 1 2 2\"/>\n</g>\n</svg>\n"
        );
    }
}
