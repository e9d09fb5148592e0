//! The odds of a plan without a run from end to end: composed of what its parts are known to hold.
//!
//! A plan is cut in the middle of its options, but for those near its start and its goal. The pieces between two cuts were driven when the building was
//! learnt ([`HandOver`](crate::HandOver)); the first and the last piece belong to this plan alone and are driven a few
//! times, beside what the cost model says of them. The success of the plan is the product, its time the sum: each
//! piece counts only robots that came to its first cut as plans make them come there.

use std::sync::Arc;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use sharp_drive::{InitialStates, OptionPolicy, StateSpread, SuccessCount, SuccessEstimate, wilson95};
use sharp_guide::{Departure, GuidePath, GuidedOption, LegId, Role};
use sharp_sim::RobotState;
use sharp_space::Seed;

use crate::files::{self, FileError};
use crate::hand_over::{RUN_UP_M, RunBudget, Stretch};
use crate::known::KnownOptions;
use crate::learn::LearntPolicy;
use crate::policies::Policies;
use crate::price::Pricer;
use crate::problem::PlanningProblem;

/// Runs of a piece that no library has: so many, and where its price or they leave doubts so many more.
const EPISODES: [u32; 2] = [24, 24];
/// So many more of the plan that is taken where one of these failed, at least and at most.
const MORE: RunBudget = RunBudget { episodes: (128, 256), half_width: 0.03 };
/// A first or last leg that the prior drives less well than this is tried with the follower, which is slower.
const STAND_IN_BELOW: f64 = 0.985;
/// Success by the price from which on the few first runs are enough, and runs that the cost model's word counts as beside runs
/// none of which failed. Of 218 pieces with such a price whose first 16 runs came through, 1,000 runs of each showed 0.997 on
/// average, as the price says, and less than 0.98 for one in forty. Of 55 with a price from 0.985 on it was less than 0.93 for
/// one in forty. Where some fail, runs alone count: the model knows little of places where a robot barely fits.
const TRUSTED: [(f64, f64); 3] = [(0.995, 96.0), (0.985, 32.0), (0.0, 16.0)];
/// Way from the last cut to the last leg at least, metres.
const LEAD_M: f64 = 1.5;
/// States in which the option before a last leg begins.
const STATE_POOL: usize = 8;
/// How they spread: as robots pass there.
const PASSING: StateSpread = StateSpread { radius_m: 0.08, heading_sd_rad: 0.08, speed_max_mps: 1.0 };
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
    pub pieces: Vec<PlanPiece>,
}

/// A piece of a plan between two cuts.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PlanPiece {
    /// Where it ends, in legs from the start of the plan: 2.5 is the middle of the third leg.
    pub until: f64,
    /// The chance to come through.
    pub success: f64,
    /// Runs that it was counted on; the cost model's word counts as some.
    pub episodes: f64,
    /// Mean time, seconds.
    pub time_s: f64,
    /// Runs that were made for this plan alone; 0 where a library knew.
    #[serde(default, skip_serializing_if = "files::is_zero")]
    pub runs: u32,
}

impl ComposedOdds {
    /// The odds of `pieces` that follow one another.
    ///
    /// The interval is Wilson's with continuity correction for as many runs as would leave the same uncertainty: to first order the variance of the logarithm of
    /// a product is the sum of the factors' (1 - p) / (p n).
    #[must_use]
    pub fn of(pieces: Vec<PlanPiece>) -> Self {
        let success: f64 = pieces.iter().map(|piece| piece.success).product();
        let time_s = pieces.iter().map(|piece| piece.time_s).sum();
        let variance: f64 = pieces
            .iter()
            .map(|piece| (1.0 - piece.success) / (piece.success.max(1e-9) * piece.episodes))
            .sum();
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
        nearest_count(self.success, self.episodes)
    }

    /// The chance of success and the time, seconds, of what is left for a robot that has driven `share` of leg number `leg`.
    #[must_use]
    pub fn rest(&self, (leg, share): (usize, f64)) -> (f64, f64) {
        let at = leg as f64 + share;
        let mut begin = 0.0;
        let mut rest = (1.0, 0.0);
        for piece in &self.pieces {
            let left = ((piece.until - at.max(begin)) / (piece.until - begin)).clamp(0.0, 1.0);
            rest = (rest.0 * libm::pow(piece.success, left), rest.1 + left * piece.time_s);
            begin = piece.until;
        }
        rest
    }
}

impl PlanPiece {
    /// The nearest count of whole runs.
    pub(crate) fn count(&self) -> SuccessCount {
        nearest_count(self.success, self.episodes)
    }
}

fn nearest_count(success: f64, episodes: f64) -> SuccessCount {
    let episodes = episodes.round().max(1.0) as u32;
    SuccessCount { episodes, successes: (success * f64::from(episodes)).round() as u32 }
}

/// The odds of `plan`, whose guides are joined already, with `policies`.
pub(crate) fn compose(
    problem: &PlanningProblem<'_>,
    plan: &[Arc<GuidedOption>],
    policies: &Policies<'_>,
    known: &KnownOptions,
) -> ComposedOdds {
    let piece = |&(from, to): &(Option<usize>, usize)| {
        let known = match (from.map(|cut| plan[cut].id), plan.get(to).map(|leg| leg.id)) {
            (Some(LegId::Option(before)), Some(LegId::Option(after))) => known.hand_over(before, after),
            _ => None,
        };
        match known {
            Some(SuccessEstimate { count, mean_time_s }) if count.successes > 0 => PlanPiece {
                until: to as f64 + 0.5,
                success: count.rate(),
                episodes: f64::from(count.episodes),
                time_s: *mean_time_s,
                runs: 0,
            },
            _ => end_piece(problem, plan, policies, (from, to)),
        }
    };
    ComposedOdds::of(cuts(plan).par_iter().map(piece).collect())
}

/// Where the pieces of `plan` begin and end: in the middle of which legs, or at start and goal.
fn cuts(plan: &[Arc<GuidedOption>]) -> Vec<(Option<usize>, usize)> {
    let whole = plan.len();
    let options: Vec<usize> = (0..whole).filter(|&index| plan[index].id.role() == Role::Option).collect();
    let (Some(first), Some(last)) = (first_cut(plan, &options), last_cut(plan, &options)) else {
        return vec![(None, whole)];
    };
    let last = last.max(first);
    let between = (first..last).map(|cut| (Some(cut), cut + 1));
    std::iter::once((None, first)).chain(between).chain([(Some(last), whole)]).collect()
}

/// The `odds` of `plan` with more runs of those pieces that no library has and that failed at times: for the plan that is taken.
/// Where the follower drives its first or last leg better than the prior, the follower drives it from now on.
///
/// # Errors
/// If the library cannot be written.
pub(crate) fn refine(
    problem: &PlanningProblem<'_>,
    plan: &[Arc<GuidedOption>],
    policies: &mut Policies<'_>,
    odds: &ComposedOdds,
) -> Result<ComposedOdds, FileError> {
    let known = &*policies;
    let refined = |(piece, ends): (&PlanPiece, (Option<usize>, usize))| {
        // Where no run failed the price counts as well, and both together say enough.
        let is_doubtful = piece.runs > 0 && f64::from(piece.runs) == piece.episodes;
        if !is_doubtful {
            return (*piece, None);
        }
        let count = nearest_count(piece.success, piece.episodes);
        let mean_time_s = if count.successes > 0 { piece.time_s } else { f64::INFINITY };
        let few = SuccessEstimate { count, mean_time_s };
        let cost_s = |estimate: &SuccessEstimate| estimate.cost_s(problem.method.failure_cost_s);
        // The follower, if it does better than `prior`. The runs that choose it are not those that it is judged by.
        let stand_in_for = |prior: &SuccessEstimate| {
            let (leg, follower) = stand_in(problem, plan, known, ends)?;
            let by_follower = OwnStretch::new(problem, plan, known, ends).with_policy(leg, &follower);
            let is_better = |estimate: &SuccessEstimate| cost_s(estimate) < cost_s(prior);
            let estimate = is_better(&by_follower.drive(exactly(EPISODES[0]), "follower"))
                .then(|| by_follower.drive(MORE, "more by follower"))?;
            is_better(&estimate).then_some((leg, follower, estimate))
        };
        // A piece comes here because a run failed, so these few look worse than the prior is. Only where they leave no doubt
        // are they enough to put the follower in its place.
        let is_clear = count.upper95() < STAND_IN_BELOW;
        let at_once = if is_clear { stand_in_for(&few) } else { None };
        let (all, other) = if let Some(at_once) = at_once {
            (at_once.2, Some(at_once))
        } else {
            let prior = OwnStretch::new(problem, plan, known, ends).drive(MORE, "more").and(&few);
            let is_weak = !is_clear && prior.count.rate() < STAND_IN_BELOW;
            let other = if is_weak { stand_in_for(&prior) } else { None };
            (other.as_ref().map_or(prior, |other| other.2), other)
        };
        let time_s = if all.count.successes >= TIMED_MIN { all.mean_time_s } else { piece.time_s };
        let (success, runs) = (all.count.rate(), all.count.episodes);
        (PlanPiece { success, episodes: f64::from(runs), time_s, runs, ..*piece }, other)
    };
    let refined: Vec<_> = odds.pieces.par_iter().zip(cuts(plan)).map(refined).collect();
    let (pieces, others): (Vec<_>, Vec<_>) = refined.into_iter().unzip();
    for (leg, follower, estimate) in others.into_iter().flatten() {
        // The time of a piece is not that of a leg.
        let estimate = SuccessEstimate { mean_time_s: f64::INFINITY, ..estimate };
        policies.keep(&plan[leg], LearntPolicy::untrained(follower, estimate), &problem.world.grid)?;
    }
    Ok(ComposedOdds::of(pieces))
}

/// The first or last leg of a piece of `plan`, and the follower that could drive it, if the prior does.
fn stand_in(
    problem: &PlanningProblem<'_>,
    plan: &[Arc<GuidedOption>],
    policies: &Policies<'_>,
    (from, to): (Option<usize>, usize),
) -> Option<(usize, OptionPolicy)> {
    let leg = if from.is_none() { 0 } else { to.min(plan.len() - 1) };
    let PlanningProblem { world, method, conditions, .. } = *problem;
    let [_, follower] =
        Pricer::new(world, &conditions.noise, method.search, method.failure_cost_s).policies();
    let LearntPolicy { policy, env_steps, .. } = policies.learnt(plan[leg].id);
    let is_prior =
        method.learner.has_stand_in() && matches!(policy, OptionPolicy::Network(_)) && *env_steps == 0;
    (plan[leg].id.role() != Role::Option && is_prior).then_some((leg, follower))
}

/// The option in whose middle a robot has left the first leg some metres behind, so that it does not matter any more.
fn first_cut(plan: &[Arc<GuidedOption>], options: &[usize]) -> Option<usize> {
    let mut way_m = 0.0;
    for &index in options {
        let length_m = plan[index].guide.length_m();
        if way_m + 0.5 * length_m >= RUN_UP_M {
            return Some(index);
        }
        way_m += length_m;
    }
    options.last().copied()
}

/// The option in whose middle a robot has so much way to the last leg that the joined guide until there does not depend on it:
/// behind a short option the last leg bends what comes before. If all options together are too short, the first.
fn last_cut(plan: &[Arc<GuidedOption>], options: &[usize]) -> Option<usize> {
    let mut way_m = 0.0;
    for &index in options.iter().rev() {
        let length_m = plan[index].guide.length_m();
        if way_m + 0.5 * length_m >= LEAD_M {
            return Some(index);
        }
        way_m += length_m;
    }
    options.first().copied()
}

/// The piece of `plan` from the middle of leg `from`, or from the start, to the middle of leg `to`, or to the goal where there
/// is no such leg: driven a few times, beside its price.
fn end_piece(
    problem: &PlanningProblem<'_>,
    plan: &[Arc<GuidedOption>],
    policies: &Policies<'_>,
    (from, to): (Option<usize>, usize),
) -> PlanPiece {
    let (priced_s, success) = priced(problem, plan, (from, to));
    let class = TRUSTED.iter().position(|&(least, _)| success >= least).unwrap_or(TRUSTED.len() - 1);
    let SuccessEstimate { count, mean_time_s } = drive(problem, plan, policies, (from, to), class == 0);
    let weight = if count.failures() == 0 { TRUSTED[class].1 } else { 0.0 };
    let episodes = weight + f64::from(count.episodes);
    let success = (weight * success + f64::from(count.successes)) / episodes;
    let time_s = if count.successes >= TIMED_MIN { mean_time_s } else { priced_s };
    let until = if to < plan.len() { to as f64 + 0.5 } else { to as f64 };
    PlanPiece { until, success, episodes, time_s, runs: count.episodes }
}

/// Drives a piece of `plan`, a few times only if its price is trusted and none of them fails, or if half of them fail.
fn drive(
    problem: &PlanningProblem<'_>,
    plan: &[Arc<GuidedOption>],
    policies: &Policies<'_>,
    ends: (Option<usize>, usize),
    is_trusted: bool,
) -> SuccessEstimate {
    let stretch = OwnStretch::new(problem, plan, policies, ends);
    let few = stretch.drive(exactly(EPISODES[0]), "few");
    // A piece that fails as often as not is not looked at more closely before its plan is taken.
    let is_clear =
        2 * few.count.failures() >= few.count.episodes || (is_trusted && few.count.failures() == 0);
    if is_clear { few } else { stretch.drive(exactly(EPISODES[1]), "some").and(&few) }
}

/// So many runs, whatever they show.
const fn exactly(episodes: u32) -> RunBudget {
    RunBudget { episodes: (episodes, episodes), half_width: 0.0 }
}

/// A piece of a plan that belongs to this plan alone, with its run-up.
struct OwnStretch<'a> {
    problem: &'a PlanningProblem<'a>,
    /// The leg of the plan that it begins with.
    begin: usize,
    options: Vec<Arc<GuidedOption>>,
    policies: Vec<&'a OptionPolicy>,
    states: InitialStates,
    from_middle_of: Option<usize>,
    to_middle: bool,
    seed: Seed,
}

impl<'a> OwnStretch<'a> {
    fn new(
        problem: &'a PlanningProblem<'a>,
        plan: &[Arc<GuidedOption>],
        policies: &'a Policies<'_>,
        (from, to): (Option<usize>, usize),
    ) -> Self {
        let PlanningProblem { world, query, .. } = *problem;
        let begin = from.map_or(0, |cut| run_up(plan, cut));
        let mut options = plan[begin..plan.len().min(to + 1)].to_vec();
        let names: Vec<String> = options.iter().map(|leg| leg.id.to_string()).collect();
        let seed = problem.seed.child(&format!("odds {}", names.join(" ")), 0);
        let states = if begin == 0 {
            InitialStates::exactly(RobotState::at_rest(query.start))
        } else {
            // The middle at which a leg is cut must stay its middle.
            if let Some(cut) = from.filter(|&cut| cut > begin) {
                options[0] = from_run_up(&options[0], way_m(plan, begin, cut));
            }
            InitialStates::spread(world, &options[0], &PASSING, STATE_POOL, seed)
        };
        let policies = options.iter().map(|leg| &policies.learnt(leg.id).policy).collect();
        let (from_middle_of, to_middle) = (from.map(|cut| cut - begin), to < plan.len());
        Self { problem, begin, options, policies, states, from_middle_of, to_middle, seed }
    }

    /// The same with another policy for leg number `leg` of the plan.
    fn with_policy(mut self, leg: usize, policy: &'a OptionPolicy) -> Self {
        self.policies[leg - self.begin] = policy;
        self
    }

    /// What the runs of `budget` show; `name` names their random stream.
    fn drive(&self, budget: RunBudget, name: &str) -> SuccessEstimate {
        let Self { problem, options, policies, states, from_middle_of, to_middle, seed, .. } = self;
        let (from_middle_of, to_middle) = (*from_middle_of, *to_middle);
        let stretch = Stretch { options, policies, from_middle_of, to_middle };
        stretch.drive((problem.world, problem.conditions), states, budget, seed.child(name, 0))
    }
}

/// The way from the beginning of leg `begin` to the middle of leg `cut`, metres.
fn way_m(plan: &[Arc<GuidedOption>], begin: usize, cut: usize) -> f64 {
    let length_m = |leg: &Arc<GuidedOption>| leg.guide.length_m();
    plan[begin..cut].iter().map(length_m).sum::<f64>() + 0.5 * length_m(&plan[cut])
}

/// The last leg from which robots have enough way to the middle of leg `cut`.
fn run_up(plan: &[Arc<GuidedOption>], cut: usize) -> usize {
    (0..=cut).rev().find(|&begin| way_m(plan, begin, cut) >= RUN_UP_M).unwrap_or(0)
}

/// `option` without the part of its guide by which `way_m` is longer than a run-up.
fn from_run_up(option: &Arc<GuidedOption>, way_m: f64) -> Arc<GuidedOption> {
    let guide = &option.guide;
    let skipped_m = (way_m - RUN_UP_M).max(0.0);
    let kept = (0..guide.poses().len()).filter(|&index| guide.arc_m(index) >= skipped_m);
    match GuidePath::new(kept.map(|index| guide.poses()[index]).collect(), guide.spacing_m()) {
        // The middle of a guide is no place to leave.
        Ok(guide) if skipped_m > 0.0 => {
            Arc::new(GuidedOption { guide, departure: Departure::default(), ..GuidedOption::clone(option) })
        }
        // Nothing is cut, or less than two poses are left: it is driven whole.
        _ => Arc::clone(option),
    }
}

/// Time, seconds, and success of a piece by its price; of a leg that is cut the half.
fn priced(
    problem: &PlanningProblem<'_>,
    plan: &[Arc<GuidedOption>],
    (from, to): (Option<usize>, usize),
) -> (f64, f64) {
    let PlanningProblem { world, method, conditions, .. } = *problem;
    let pricer = Pricer::new(world, &conditions.noise, method.search, method.failure_cost_s);
    let mut whole = (0.0, 1.0);
    for index in from.unwrap_or(0)..plan.len().min(to + 1) {
        let (leg, next) = (&plan[index], plan.get(index + 1).map(|next| &next.guide));
        let (time_s, success) = pricer.price(leg, next).parts();
        let is_cut = from == Some(index) || to == index;
        let share = if is_cut { 0.5 } else { 1.0 };
        whole = (whole.0 + share * time_s, whole.1 * libm::pow(success, share));
    }
    whole
}

#[cfg(test)]
mod tests {
    use super::*;

    fn piece(success: f64, episodes: f64) -> PlanPiece {
        PlanPiece { until: 1.0, success, episodes, time_s: 5.0, runs: 0 }
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

    #[test]
    fn what_is_left_shrinks_from_the_whole_to_nothing() {
        let pieces = [1.5, 2.5, 4.0].map(|until| PlanPiece { until, ..piece(0.9, 100.0) });
        let odds = ComposedOdds::of(pieces.to_vec());
        assert_eq!(odds.rest((0, 0.0)), (odds.success, odds.time_s), "all of it");
        let half_way = odds.rest((1, 0.5));
        assert!((half_way.0 - 0.81).abs() < 1e-12 && (half_way.1 - 10.0).abs() < 1e-12, "{half_way:?}");
        assert_eq!(odds.rest((3, 1.0)), (1.0, 0.0), "nothing");
    }
}
