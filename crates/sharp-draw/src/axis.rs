//! Axes of charts: which values are written, and where they are.

use crate::chart::Chart;
use crate::color::Color;
use crate::panel::Panel;
use crate::text::TextStyle;

/// An axis between two ends in the picture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axis {
    low: f64,
    high: f64,
    /// Between two values that are written.
    step: f64,
    /// Where `low` and `high` are, user units.
    ends: [f64; 2],
    label: &'static str,
}

impl Axis {
    /// Height below a horizontal axis that its values and its label take, user units.
    pub const FOOT: f64 = 38.0;

    /// A horizontal axis of a [`Panel`] with round values from `low` to `high`.
    #[must_use]
    pub fn new([low, high]: [f64; 2]) -> Self {
        let ends = [Panel::LEFT, Panel::RIGHT];
        Self { low, high, step: round_step(high - low), ends, label: "" }
    }

    /// A horizontal axis of shares from 0 to 1.
    #[must_use]
    pub fn of_shares() -> Self {
        Self::new([0.0, 1.0])
    }

    /// A horizontal axis from zero to the next round value from `most` on, at least 1.
    #[must_use]
    pub fn from_zero(most: f64) -> Self {
        let axis = Self::new([0.0, most.max(1.0)]);
        Self { high: (axis.high / axis.step).ceil() * axis.step, ..axis }
    }

    /// A horizontal axis of decimal logarithms that shows everything from `least` to `most`: whole
    /// decades, at least one.
    #[must_use]
    pub fn decades(least: f64, most: f64) -> Self {
        let low = least.floor();
        Self { step: 1.0, ..Self::new([low, most.ceil().max(low + 1.0)]) }
    }

    /// The same axis from `low` to `high` user units; a vertical one has the larger number first.
    #[must_use]
    pub const fn between(self, ends: [f64; 2]) -> Self {
        Self { ends, ..self }
    }

    /// The same axis with what it shows and its unit in words.
    #[must_use]
    pub const fn label(self, label: &'static str) -> Self {
        Self { label, ..self }
    }

    /// Where `value` is, user units; values outside stop at the ends.
    #[must_use]
    pub fn at(&self, value: f64) -> f64 {
        let share = ((value - self.low) / (self.high - self.low)).clamp(0.0, 1.0);
        self.ends[0] + share * (self.ends[1] - self.ends[0])
    }

    /// Round values from `low` to `high`, at most seven on an axis that is not of decades.
    #[must_use]
    pub fn ticks(&self) -> Vec<f64> {
        let first = (self.low / self.step).round();
        let count = ((self.high - self.low) / self.step).round() as u32;
        (0..=count).map(|i| (first + f64::from(i)) * self.step).collect()
    }

    /// Draws rules from `top` to `bottom`, below them their values as `text` writes them, and the
    /// label; [`FOOT`](Self::FOOT) says how much room that needs.
    pub fn draw(&self, chart: &mut Chart, [top, bottom]: [f64; 2], text: impl Fn(f64) -> String) {
        let style = TextStyle::new(Panel::TEXT).middle();
        let ticks: Vec<(f64, String)> =
            self.ticks().into_iter().map(|tick| (self.at(tick), text(tick))).collect();
        for (x, _) in &ticks {
            chart.line([*x, top], [*x, bottom], Color::RULE, 1.0);
        }
        // Where values would touch, every second one is left out.
        let width = ticks.iter().map(|(_, text)| style.width(text)).fold(0.0, f64::max) + 6.0;
        let apart = (self.ends[1] - self.ends[0]).abs() / (ticks.len().max(2) - 1) as f64;
        let every = if width > apart { 2 } else { 1 };
        for (x, text) in ticks.into_iter().step_by(every) {
            chart.text([x, bottom + 15.0], style.color(Color::SOFT), text);
        }
        let middle = (self.ends[0] + self.ends[1]) / 2.0;
        chart.text([middle, bottom + 31.0], style, self.label);
    }

    /// Draws the rules of a vertical axis from `left` to `right`, left of them their values, and
    /// left of those the label from bottom to top.
    pub fn draw_upright(&self, chart: &mut Chart, [left, right]: [f64; 2], text: impl Fn(f64) -> String) {
        let style = TextStyle::new(Panel::TEXT);
        for tick in self.ticks() {
            let y = self.at(tick);
            chart.line([left, y], [right, y], Color::RULE, 1.0);
            chart.text([left - 7.0, y + 4.0], style.end().color(Color::SOFT), text(tick));
        }
        let middle = (self.ends[0] + self.ends[1]) / 2.0;
        chart.text([10.0, middle], style.middle().upright(), self.label);
    }
}

/// A round step (1, 2 or 5 times a power of ten) that divides `range` into at most six parts.
pub(crate) fn round_step(range: f64) -> f64 {
    let rough = range / 5.0;
    let power = 10_f64.powf(rough.log10().floor());
    [1.0, 2.0, 5.0, 10.0]
        .into_iter()
        .map(|digit| digit * power)
        .find(|&step| step >= rough * 0.999)
        .unwrap_or(power)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::numbers::plain;

    fn texts(axis: &Axis) -> String {
        let texts: Vec<String> = axis.ticks().into_iter().map(plain).collect();
        texts.join(" ")
    }

    #[test]
    fn axes_end_at_round_values() {
        for (most, ticks) in
            [(213.4, "0 50 100 150 200 250"), (0.0, "0 0.2 0.4 0.6 0.8 1"), (7.3, "0 2 4 6 8")]
        {
            assert_eq!(texts(&Axis::from_zero(most)), ticks, "{most}");
        }
    }

    #[test]
    fn decades_are_whole() {
        for (ends, ticks) in [([-0.5, 2.9], "-1 0 1 2 3"), ([1.0, 1.0], "1 2"), ([0.2, 0.4], "0 1")] {
            assert_eq!(texts(&Axis::decades(ends[0], ends[1])), ticks, "{ends:?}");
        }
    }

    #[test]
    fn values_outside_an_axis_stop_at_its_ends() {
        let axis = Axis::new([0.5, 1.0]).between([10.0, 20.0]);
        assert_eq!([0.2, 0.75, 3.0].map(|value| axis.at(value)), [10.0, 15.0, 20.0]);
    }

    #[test]
    fn values_that_would_touch_are_left_out() {
        let count = |text: fn(f64) -> String| {
            let mut chart = Chart::new(Panel::WIDTH, 100.0);
            Axis::from_zero(5.0).draw(&mut chart, [20.0, 60.0], text);
            chart.to_svg("").matches("<text").count()
        };
        assert_eq!(count(plain), 6);
        assert_eq!(count(|value| format!("{value} thousand steps")), 3);
    }
}
