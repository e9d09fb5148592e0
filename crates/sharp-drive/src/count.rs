//! Successes among trials, with a confidence interval.

use serde::{Deserialize, Serialize};

/// The 97.5 % point of the standard normal distribution.
const Z_95: f64 = 1.959_963_984_540_054;

/// A success probability measured by counting.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct SuccessCount {
    /// Trials that counted.
    pub episodes: u32,
    /// Trials that succeeded.
    pub successes: u32,
}

impl SuccessCount {
    /// Counts the successes among `outcomes`.
    pub fn count(outcomes: impl IntoIterator<Item = bool>) -> Self {
        outcomes.into_iter().fold(Self::default(), |count, success| count.with(success))
    }

    /// The count after one more trial.
    #[must_use]
    pub const fn with(self, success: bool) -> Self {
        Self { episodes: self.episodes + 1, successes: self.successes + success as u32 }
    }

    /// Trials that did not succeed.
    #[must_use]
    pub const fn failures(&self) -> u32 {
        self.episodes - self.successes
    }

    /// The share of successes; 0 before the first trial.
    #[must_use]
    pub fn rate(&self) -> f64 {
        if self.episodes == 0 { 0.0 } else { f64::from(self.successes) / f64::from(self.episodes) }
    }

    /// The lower end of the 95 % Wilson score interval; 0 before the first trial.
    #[must_use]
    pub fn lower95(&self) -> f64 {
        self.wilson().0
    }

    /// The upper end of the 95 % Wilson score interval; 1 before the first trial.
    #[must_use]
    pub fn upper95(&self) -> f64 {
        self.wilson().1
    }

    /// Half the width of the 95 % Wilson score interval; one half before the first trial.
    #[must_use]
    pub fn half_width95(&self) -> f64 {
        let (lower, upper) = self.wilson();
        0.5 * (upper - lower)
    }

    fn wilson(&self) -> (f64, f64) {
        wilson95(self.rate(), f64::from(self.episodes))
    }
}

/// The 95 % Wilson score interval of a share `rate` that was counted on `episodes` trials, which need not be a whole number;
/// from 0 to 1 without any.
///
/// E. B. Wilson, "Probable Inference, the Law of Succession, and Statistical Inference", 1927.
#[must_use]
pub fn wilson95(rate: f64, episodes: f64) -> (f64, f64) {
    if episodes <= 0.0 {
        return (0.0, 1.0);
    }
    let (n, p) = (episodes, rate);
    let z2 = Z_95 * Z_95;
    let center = p + z2 / (2.0 * n);
    let half = Z_95 * (p * (1.0 - p) / n + z2 / (4.0 * n * n)).sqrt();
    let scale = 1.0 + z2 / n;
    (((center - half) / scale).max(0.0), ((center + half) / scale).min(1.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wilson_intervals_match_known_values() {
        for (successes, episodes, lower, upper) in
            [(20, 20, 0.8389, 1.0), (199, 200, 0.9722, 0.9991), (0, 10, 0.0, 0.2775), (5, 10, 0.2366, 0.7634)]
        {
            let count = SuccessCount { episodes, successes };
            assert!((count.lower95() - lower).abs() < 1e-4, "{successes}/{episodes}: {}", count.lower95());
            assert!((count.upper95() - upper).abs() < 1e-4, "{successes}/{episodes}: {}", count.upper95());
        }
    }

    #[test]
    fn nothing_is_known_before_the_first_trial() {
        let count = SuccessCount::default();
        assert_eq!((count.rate(), count.lower95(), count.upper95()), (0.0, 0.0, 1.0));
        assert_eq!(SuccessCount::count([true, false, true]), SuccessCount { episodes: 3, successes: 2 });
    }
}
