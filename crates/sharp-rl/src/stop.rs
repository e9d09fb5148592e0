//! When training ends or begins anew, and which policy it returns: the rules for evaluations, and the reason in the end.

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

/// Which of the policies that were evaluated a run returns, unless one met the stop rule.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum BestRule {
    /// The one with the highest success rate, and of equal ones the one with the highest mean return.
    #[default]
    Success,
    /// The one with the highest mean return, with so much added for each success.
    ///
    /// For tasks where success needs more than the reward measures, such as arriving without a contact: a policy that always
    /// arrives is worth more than one that arrives half of the time, even if that one touches walls less often.
    ReturnAndSuccess(f64),
}

impl BestRule {
    /// Whether it prefers the policy of `evaluation` to that of `other`.
    #[must_use]
    pub fn prefers(&self, evaluation: &Evaluation, other: &Evaluation) -> bool {
        let score = |of: &Evaluation, success: f64| of.mean_return + success * of.success_rate();
        match *self {
            Self::Success => evaluation.beats(other),
            Self::ReturnAndSuccess(success) => score(evaluation, success) > score(other, success),
        }
    }
}

/// When a run begins anew with fresh networks and an empty buffer, because its policies do not get better.
///
/// Soft actor-critic may settle on a policy that never reaches the goal, and another seed learns the same task
/// (docs/decisions/0025-what-the-paper-leaves-open.md). An attempt is given up at the first evaluation after
/// [`after`](Self::after) steps if none of its evaluations had a mean return of at least [`below`](Self::below), and at least
/// twice as many steps are left of the budget.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RestartRule {
    /// Environment steps of an attempt, at least 1.
    pub after: u64,
    /// The mean return that one of its evaluations must have.
    pub below: f64,
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
    fn the_best_policy_has_successes_or_a_high_return_as_well() {
        let of = |successes, mean_return| Evaluation {
            episodes: 100,
            successes,
            mean_return,
            ..Evaluation::default()
        };
        let (halfway, arriving) = (of(30, 400.0), of(6, 970.0));
        assert!(BestRule::Success.prefers(&halfway, &arriving));
        assert!(BestRule::ReturnAndSuccess(1000.0).prefers(&arriving, &halfway), "1030 to 700");
        assert!(BestRule::ReturnAndSuccess(1000.0).prefers(&of(30, 970.0), &arriving), "of equal returns");
        for rule in [BestRule::Success, BestRule::ReturnAndSuccess(1000.0)] {
            assert!(!rule.prefers(&halfway, &halfway), "{rule:?}: an equal one is no better");
        }
    }

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
