//! Numbers as charts write them: short.

/// Seconds with about three digits: `0.04 s`, `1.0 s`, `213 s`.
#[must_use]
pub fn seconds(value: f64) -> String {
    let decimals = if value >= 100.0 { 0 } else { usize::from(value < 1.0) + 1 };
    format!("{value:.decimals$} s")
}

/// A number with at most six decimals and no zeros at its end.
#[must_use]
pub fn plain(value: f64) -> String {
    ((value * 1e6).round() / 1e6).to_string()
}

/// A share (0 to 1) as a whole percentage: `98 %`.
#[must_use]
pub fn percent(share: f64) -> String {
    format!("{:.0} %", 100.0 * share)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn times_have_as_many_decimals_as_their_size_needs() {
        assert_eq!([0.042, 1.0, 99.94, 213.4].map(seconds), ["0.04 s", "1.0 s", "99.9 s", "213 s"]);
    }

    #[test]
    fn what_rounding_left_is_not_written() {
        assert_eq!([0.1 + 0.2, 5.0, -0.25].map(plain), ["0.3", "5", "-0.25"]);
        assert_eq!(percent(0.985), "98 %");
    }
}
