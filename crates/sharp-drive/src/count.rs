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

    /// The lower end of the 95 % interval; 0 before the first trial. See [`wilson95`].
    #[must_use]
    pub fn lower95(&self) -> f64 {
        self.interval95().0
    }

    /// The upper end of the 95 % interval; 1 before the first trial. See [`wilson95`].
    #[must_use]
    pub fn upper95(&self) -> f64 {
        self.interval95().1
    }

    fn interval95(&self) -> (f64, f64) {
        wilson95(self.rate(), f64::from(self.episodes))
    }

    /// Half the width of the 95 % Wilson score interval without the correction of [`wilson95`]; one half before the first trial. It
    /// decides how many trials are made.
    #[must_use]
    pub fn half_width95(&self) -> f64 {
        if self.episodes == 0 { 0.5 } else { half_width(self.rate(), f64::from(self.episodes)) }
    }
}

/// The 95 % Wilson score interval, with continuity correction, of a share `rate` that was counted on `episodes` trials, which need not
/// be a whole number; from 0 to 1 without any.
///
/// With the correction the interval holds the truth at least 94.8 times in 100 whatever the truth is, and 95 times or more where
/// it lies between 0.02 and 0.98; without it, 84 to 98 times.
///
/// E. B. Wilson, "Probable Inference, the Law of Succession, and Statistical Inference", 1927; R. G. Newcombe, "Two-sided confidence
/// intervals for the single proportion: comparison of seven methods", 1998, method 4.
#[must_use]
pub fn wilson95(rate: f64, episodes: f64) -> (f64, f64) {
    if episodes <= 0.0 {
        return (0.0, 1.0);
    }
    // The upper end is the lower end for failures.
    (lower_end(rate, episodes), 1.0 - lower_end(1.0 - rate, episodes))
}

/// The lower end of [`wilson95`].
fn lower_end(rate: f64, episodes: f64) -> f64 {
    if rate <= 0.0 {
        return 0.0;
    }
    let (n, p, z2) = (episodes, rate, Z_95 * Z_95);
    let square = z2 - 2.0 - 1.0 / n + 4.0 * p * (n * (1.0 - p) + 1.0);
    let corrected = (2.0 * n * p + z2 - 1.0 - Z_95 * square.max(0.0).sqrt()) / (2.0 * (n + z2));
    // With less than one success, which a share of trials can be, the correction goes the wrong way.
    let plain = (p + z2 / (2.0 * n)) / (1.0 + z2 / n) - half_width(p, n);
    corrected.min(plain).max(0.0)
}

/// Half the width of the interval without correction.
fn half_width(rate: f64, episodes: f64) -> f64 {
    let (n, p, z2) = (episodes, rate, Z_95 * Z_95);
    Z_95 * (p * (1.0 - p) / n + z2 / (4.0 * n * n)).sqrt() / (1.0 + z2 / n)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Newcombe's table I, method 4.
    #[test]
    fn intervals_match_published_values() {
        for (successes, episodes, lower, upper) in [
            (81, 263, 0.2535, 0.3682),
            (15, 148, 0.0598, 0.1644),
            (0, 20, 0.0, 0.2005),
            (1, 29, 0.0018, 0.1963),
        ] {
            let count = SuccessCount { episodes, successes };
            assert!((count.lower95() - lower).abs() < 6e-5, "{successes}/{episodes}: {}", count.lower95());
            assert!((count.upper95() - upper).abs() < 6e-5, "{successes}/{episodes}: {}", count.upper95());
        }
    }

    /// The chances of 0, 1, ... successes in `episodes` trials.
    fn binomial(episodes: u32, rate: f64) -> Vec<f64> {
        let mut chances = vec![1.0];
        for _ in 0..episodes {
            let before = |k: usize| chances.get(k).copied().unwrap_or(0.0);
            let after = |k: usize| {
                let missed = before(k) * (1.0 - rate);
                missed + if k == 0 { 0.0 } else { before(k - 1) * rate }
            };
            chances = (0..=chances.len()).map(after).collect();
        }
        chances
    }

    #[test]
    fn intervals_hold_the_truth_95_times_in_100() {
        for episodes in [24, 48, 200, 500] {
            for permille in (1..1000).step_by(7) {
                let truth = f64::from(permille) / 1000.0;
                let chances = binomial(episodes, truth);
                let holds = |successes: u32| {
                    let count = SuccessCount { episodes, successes };
                    (count.lower95()..=count.upper95()).contains(&truth)
                };
                let held: f64 = (0..=episodes).filter(|&k| holds(k)).map(|k| chances[k as usize]).sum();
                let least = if (0.02..=0.98).contains(&truth) { 0.95 } else { 0.948 };
                assert!(held >= least, "a rate of {truth} on {episodes} trials is held {held} of the time");
            }
        }
    }

    #[test]
    fn half_widths_are_those_of_the_interval_without_correction() {
        // (1.0 - 0.8389) / 2, (0.9991 - 0.9722) / 2, (0.7634 - 0.2366) / 2.
        for (successes, episodes, half) in [(20, 20, 0.0806), (199, 200, 0.01345), (5, 10, 0.2634)] {
            let width = SuccessCount { episodes, successes }.half_width95();
            assert!((width - half).abs() < 1e-4, "{successes}/{episodes}: {width}");
        }
        assert_eq!(SuccessCount::default().half_width95(), 0.5, "nothing is known");
    }

    #[test]
    fn intervals_hold_what_was_counted() {
        for episodes in [0.05, 0.3, 1.0, 10.0, 100.0] {
            for rate in [0.0, 1e-4, 0.001, 0.4, 0.999, 1.0] {
                let (lower, upper) = wilson95(rate, episodes);
                assert!((0.0..=rate).contains(&lower), "{rate} of {episodes}: from {lower}");
                assert!((rate..=1.0).contains(&upper), "{rate} of {episodes}: to {upper}");
            }
        }
        let (lower, upper) = wilson95(0.5, 0.05);
        assert!(upper - lower > 0.9, "hardly anything is known: {lower} to {upper}");
    }

    #[test]
    fn nothing_is_known_before_the_first_trial() {
        let count = SuccessCount::default();
        assert_eq!((count.rate(), count.lower95(), count.upper95()), (0.0, 0.0, 1.0));
        assert_eq!(SuccessCount::count([true, false, true]), SuccessCount { episodes: 3, successes: 2 });
    }
}
