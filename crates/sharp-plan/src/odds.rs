//! The odds of a plan without a run from end to end: composed of what its parts are known to hold.
//!
//! A plan is cut in the middle of each of its options. The pieces between two cuts were driven when the building was
//! learnt ([`HandOver`](crate::HandOver)); the first and the last piece belong to this plan alone and are driven a few
//! times, beside what the cost model says of them. The success of the plan is the product, its time the sum: each
//! piece counts only robots that came to its first cut as plans make them come there.

use std::sync::Arc;

use serde::{Deserialize, Serialize};
use sharp_drive::{InitialStates, SuccessCount, SuccessEstimate, wilson95};
use sharp_guide::{GuidedOption, LegId, Role};
use sharp_sim::RobotState;

use crate::hand_over::{ARRIVING, Budget, Cut, Stretch};
use crate::known::KnownOptions;
use crate::policies::Policies;
use crate::price::Pricer;
use crate::problem::PlanningProblem;

/// Runs of a first or last piece.
const END_EPISODES: u32 = 32;
/// Runs of a hand-over that nobody has driven yet.
const NEW_EPISODES: u32 = 128;
/// States in which the option before a last leg begins.
const STATE_POOL: usize = 16;
/// Successes that tell a mean time.
const TIMED_MIN: u32 = 8;

/// What a plan is known to hold, without a run from end to end.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ComposedOdds {
    /// The chance of success.
    pub success: f64,
    /// The lower end of its two-sided 95 % interval.
    pub lower95: f64,
    /// The upper end.
    pub upper95: f64,
    /// Mean time of a success, seconds.
    pub time_s: f64,
    /// Runs of the whole plan that would tell as much.
    pub episodes: f64,
    /// The parts, in order: from the start to the middle of the first option, from there to the middle of the next, …
    pub pieces: Vec<Piece>,
}

/// A piece of a plan between two cuts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Piece {
    /// The chance to come through.
    pub success: f64,
    /// Runs that it was counted on; the cost model's word counts as some.
    pub episodes: f64,
    /// Mean time, seconds.
    pub time_s: f64,
}

impl ComposedOdds {
    /// The odds of `pieces` that follow one another.
    ///
    /// The interval is Wilson's for as many runs as would leave the same uncertainty: to first order the variance of the logarithm of
    /// a product is the sum of the factors' (1 - p) / (p n).
    #[must_use]
    pub fn of(pieces: Vec<Piece>) -> Self {
        let success: f64 = pieces.iter().map(|piece| piece.success).product();
        let time_s = pieces.iter().map(|piece| piece.time_s).sum();
        let variance: f64 =
            pieces.iter().map(|piece| (1.0 - piece.success) / (piece.success.max(1e-9) * piece.episodes)).sum();
        let least = pieces.iter().map(|piece| piece.episodes).fold(f64::INFINITY, f64::min);
        let most = pieces.iter().map(|piece| piece.episodes).fold(0.0, f64::max);
        let told = (1.0 - success) / (success.max(1e-9) * variance);
        let episodes = if told.is_finite() { told.clamp(0.0, most) } else { least };
        let (lower95, upper95) = wilson95(success, episodes);
        Self { success, lower95, upper95, time_s, episodes, pieces }
    }

    /// The nearest count of whole runs.
    #[must_use]
    pub fn count(&self) -> SuccessCount {
        let episodes = self.episodes.round().max(1.0) as u32;
        SuccessCount { episodes, successes: (self.success * f64::from(episodes)).round() as u32 }
    }

    /// The chance of success and the time, seconds, of what is left of a plan with `options` legs from `first_leg` on, of whose
    /// guide the robot has driven `share`.
    #[must_use]
    pub fn rest(&self, legs: &[LegId], (leg, share): (usize, f64)) -> (f64, f64) {
        // In pieces: a leg that is an option spans the second half of one piece and the first half of the next.
        let is_option = |index: usize| legs.get(index).is_some_and(|leg| leg.role() == Role::Option);
        let cuts_before = (0..leg).filter(|&index| is_option(index)).count();
        let is_past = is_option(leg) && share >= 0.5;
        let piece = (cuts_before + usize::from(is_past)).min(self.pieces.len().saturating_sub(1));
        let first = legs.first().is_some_and(|leg| leg.role() != Role::Option);
        let done = match (is_option(leg), is_past) {
            (true, true) => share - 0.5,
            (true, false) if leg == 1 && first => 0.6 + 0.8 * share,
            (true, false) => 0.5 + share,
            (false, _) if leg == 0 && legs.len() == 1 => share,
            (false, _) if leg == 0 => 0.6 * share,
            (false, _) => 0.4 + 0.6 * share,
        };
        let left = (1.0 - done).clamp(0.0, 1.0);
        let rest = self.pieces.iter().skip(piece).enumerate().map(|(index, piece)| {
            let share = if index == 0 { left } else { 1.0 };
            (libm::pow(piece.success, share), share * piece.time_s)
        });
        rest.fold((1.0, 0.0), |(success, time_s), (p, t)| (success * p, time_s + t))
    }
}

/// The odds of `plan`, whose guides are joined already, with `policies`.
pub(crate) fn compose(
    problem: &PlanningProblem<'_>,
    plan: &[Arc<GuidedOption>],
    policies: &Policies<'_>,
    known: &KnownOptions,
) -> ComposedOdds {
    let options: Vec<usize> = (0..plan.len()).filter(|&index| plan[index].id.role() == Role::Option).collect();
    let (Some(&first), Some(&last)) = (options.first(), options.last()) else {
        return ComposedOdds::of(vec![end_piece(problem, plan, policies, [Cut::End; 2])]);
    };
    let mut pieces = vec![end_piece(problem, &plan[..=first], policies, [Cut::End, Cut::Middle])];
    for pair in plan[first..=last].windows(2) {
        let known = match (pair[0].id, pair[1].id) {
            (LegId::Option(before), LegId::Option(after)) => known.hand_over(before, after).copied(),
            _ => None,
        };
        let driven = || drive(problem, pair, policies, [Cut::Middle; 2], NEW_EPISODES);
        let SuccessEstimate { count, mean_time_s } = known.unwrap_or_else(driven);
        let time_s = if mean_time_s.is_finite() { mean_time_s } else { priced(problem, pair, [Cut::Middle; 2]).0 };
        pieces.push(Piece { success: count.rate(), episodes: f64::from(count.episodes.max(1)), time_s });
    }
    pieces.push(end_piece(problem, &plan[last..], policies, [Cut::Middle, Cut::End]));
    ComposedOdds::of(pieces)
}

/// A piece that no other plan has: driven a few times, beside its price.
fn end_piece(
    problem: &PlanningProblem<'_>,
    legs: &[Arc<GuidedOption>],
    policies: &Policies<'_>,
    ends: [Cut; 2],
) -> Piece {
    let SuccessEstimate { count, mean_time_s } = drive(problem, legs, policies, ends, END_EPISODES);
    let (priced_s, success) = priced(problem, legs, ends);
    let weight = problem.method.search.price_episodes;
    let episodes = weight + f64::from(count.episodes);
    let success = (weight * success + f64::from(count.successes)) / episodes;
    let time_s = if count.successes >= TIMED_MIN { mean_time_s } else { priced_s };
    Piece { success, episodes, time_s }
}

/// Drives `legs`, which are a part of a plan.
fn drive(
    problem: &PlanningProblem<'_>,
    legs: &[Arc<GuidedOption>],
    policies: &Policies<'_>,
    ends: [Cut; 2],
    episodes: u32,
) -> SuccessEstimate {
    let PlanningProblem { world, conditions, query, .. } = *problem;
    let names: Vec<String> = legs.iter().map(|leg| leg.id.to_string()).collect();
    let seed = problem.seed.child(&format!("odds {}", names.join(" ")), 0);
    let states = match ends[0] {
        Cut::End => InitialStates::exactly(RobotState::at_rest(query.start)),
        Cut::Middle => InitialStates::spread(world, &legs[0], &ARRIVING, STATE_POOL, seed),
    };
    let policies: Vec<_> = legs.iter().map(|leg| &policies.learnt(leg.id).policy).collect();
    let budget = Budget { episodes: (episodes, episodes), half_width: 0.0 };
    Stretch { options: legs, policies: &policies, ends }.drive((world, conditions), &states, budget, seed)
}

/// Time, seconds, and success of `legs` by their price; of a leg that is cut the half.
fn priced(problem: &PlanningProblem<'_>, legs: &[Arc<GuidedOption>], ends: [Cut; 2]) -> (f64, f64) {
    let PlanningProblem { world, method, conditions, .. } = *problem;
    let pricer = Pricer::new(world, &conditions.noise, method.search, method.failure_cost_s);
    let mut whole = (0.0, 1.0);
    for (index, leg) in legs.iter().enumerate() {
        let next = legs.get(index + 1).map(|next| &next.guide);
        let (time_s, success) = pricer.price(leg.id, &leg.guide, next).parts();
        let is_cut = index == 0 && ends[0] == Cut::Middle || index + 1 == legs.len() && ends[1] == Cut::Middle;
        let share = if is_cut { 0.5 } else { 1.0 };
        whole = (whole.0 + share * time_s, whole.1 * libm::pow(success, share));
    }
    whole
}

#[cfg(test)]
mod tests {
    use super::*;

    fn piece(success: f64, episodes: f64) -> Piece {
        Piece { success, episodes, time_s: 5.0 }
    }

    #[test]
    fn equal_pieces_tell_as_much_as_so_many_whole_runs() {
        let odds = ComposedOdds::of(vec![piece(0.99, 500.0); 4]);
        assert!((odds.success - 0.99_f64.powi(4)).abs() < 1e-12, "{odds:?}");
        assert!((480.0..=500.0).contains(&odds.episodes), "{odds:?}");
        assert!(odds.lower95 < odds.success && odds.success < odds.upper95, "{odds:?}");
        assert_eq!(odds.time_s, 20.0);
        let sure = ComposedOdds::of(vec![piece(1.0, 256.0), piece(1.0, 1024.0)]);
        assert_eq!((sure.success, sure.episodes), (1.0, 256.0), "no better known than its weakest piece");
        assert!(sure.lower95 < 0.99, "{sure:?}");
    }
}
