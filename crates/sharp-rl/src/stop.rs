//! When training ends: the rule that an evaluation must meet, and the reason in the end.

use serde::{Deserialize, Serialize};

use crate::evaluation::Evaluation;

/// The condition under which training has reached its aim.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum StopRule {
    /// An evaluation and then `episodes` fresh ones both reach the success rate.
    ///
    /// A single evaluation is optimistic, because training picks the best of many.
    Success {
        /// The success rate wanted, 0 to 1.
        rate: f64,
        /// Episodes of the confirmation.
        episodes: usize,
    },
    /// An evaluation reaches this mean return (paper: 500).
    MeanReturn(f64),
    /// Training ends with its budget of steps only.
    Never,
}

impl StopRule {
    /// Returns true if `evaluation` reaches the aim, before any confirmation.
    #[must_use]
    pub fn is_met(&self, evaluation: &Evaluation) -> bool {
        match self {
            Self::Success { rate, .. } => evaluation.success_rate() >= *rate,
            Self::MeanReturn(aim) => evaluation.mean_return >= *aim,
            Self::Never => false,
        }
    }
}

/// Why training ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum StopReason {
    /// The learner reached its aim, for example a [`StopRule`].
    Rule,
    /// The budget of steps is used up.
    Steps,
    /// The observer asked for it.
    Observer,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_rule_compares_with_its_own_aim() {
        let evaluation = Evaluation { episodes: 10, successes: 9, mean_return: 5.0, ..Evaluation::default() };
        for (rule, expected) in [
            (StopRule::Success { rate: 0.9, episodes: 0 }, true),
            (StopRule::Success { rate: 0.91, episodes: 0 }, false),
            (StopRule::MeanReturn(5.0), true),
            (StopRule::MeanReturn(5.1), false),
            (StopRule::Never, false),
        ] {
            assert_eq!(rule.is_met(&evaluation), expected, "{rule:?}");
        }
    }
}
