//! How often a plan succeeds: fresh runs from its start to its goal.

use std::sync::Arc;

use sharp_drive::{ChainRun, Driver, EpisodeEnd, MonteCarlo, SuccessCount, SuccessEstimate, expected_cost_s};
use sharp_guide::{GuidedOption, Role};
use sharp_sim::RobotState;

use crate::known::KnownOptions;
use crate::learn::LearntPolicy;
use crate::method::Method;
use crate::odds::{ComposedOdds, PlanPiece, compose};
use crate::policies::Policies;
use crate::price::Pricer;
use crate::problem::PlanningProblem;
use crate::query::Query;

/// A step of a solution.
#[derive(Clone, Debug)]
pub struct PlannedOption {
    /// The option and its guide.
    pub option: Arc<GuidedOption>,
    /// Its policy.
    pub learnt: LearntPolicy,
    /// True for an option whose policy existed before this problem.
    pub reused: bool,
    /// How often it succeeded when entered the way the one before it arrives.
    pub on_arrival: SuccessCount,
    /// Mean simulated time of those successes, seconds; infinite without any.
    pub arrival_time_s: f64,
}

/// A policy composed of options, with its measured probability of success.
#[derive(Clone, Debug)]
pub struct Solution {
    /// The problem.
    pub query: Query,
    /// `π_0`, the options, `π_{n+1}`.
    pub steps: Vec<PlannedOption>,
    /// Fresh runs through the whole plan, without recovery and without contact.
    pub predicted: SuccessCount,
    /// Mean simulated time of the successful ones, seconds; 0 without any.
    pub predicted_time_s: f64,
    /// What the prediction was composed of, where no runs were made; then `predicted` are as many runs as it is worth.
    pub composed: Option<ComposedOdds>,
}

impl Solution {
    /// Option uses, and how many of them found their policy in the library.
    #[must_use]
    pub fn reuse(&self) -> (usize, usize) {
        let options = self.steps.iter().filter(|step| step.option.id.role() == Role::Option);
        options.fold((0, 0), |(uses, reused), step| (uses + 1, reused + usize::from(step.reused)))
    }

    pub(crate) fn estimate(&self) -> SuccessEstimate {
        let mean_time_s = if self.predicted.successes == 0 { f64::INFINITY } else { self.predicted_time_s };
        SuccessEstimate { count: self.predicted, mean_time_s }
    }

    /// The predicted chance of success: composed where the plan was not run, else the share of its runs.
    #[must_use]
    pub fn success(&self) -> f64 {
        self.composed.as_ref().map_or_else(|| self.predicted.rate(), |odds| odds.success)
    }

    /// The odds of the plan by its pieces: as they were composed, or by the runs of its legs.
    #[must_use]
    pub fn odds(&self) -> ComposedOdds {
        let piece = |(index, step): (usize, &PlannedOption)| PlanPiece {
            until: index as f64 + 1.0,
            success: step.on_arrival.rate(),
            episodes: f64::from(step.on_arrival.episodes),
            time_s: if step.arrival_time_s.is_finite() { step.arrival_time_s } else { 0.0 },
            runs: step.on_arrival.episodes,
        };
        let by_runs = || ComposedOdds::of(self.steps.iter().enumerate().map(piece).collect());
        self.composed.clone().unwrap_or_else(by_runs)
    }

    /// What a use of the plan is expected to cost, seconds. One failure in a few hundred runs would decide between two plans:
    /// the chance of failure is the mean of what may be after the runs (Jeffreys' rule), not their share.
    pub(crate) fn cost_s(&self, failure_cost_s: f64) -> f64 {
        match &self.composed {
            Some(odds) => expected_cost_s(odds.time_s, odds.success, failure_cost_s),
            None => {
                let SuccessEstimate { count, mean_time_s } = self.estimate();
                let success = (f64::from(count.successes) + 0.5) / (f64::from(count.episodes) + 1.0);
                expected_cost_s(mean_time_s, success, failure_cost_s)
            }
        }
    }
}

/// The drivers of `plan`.
pub(crate) fn drivers<'a>(plan: &[Arc<GuidedOption>], policies: &'a Policies<'_>) -> Vec<Driver<'a>> {
    let driver = |(index, option): (usize, &Arc<GuidedOption>)| {
        Driver::new(option, &policies.learnt(option.id).policy, plan.get(index + 1))
    };
    plan.iter().enumerate().map(driver).collect()
}

/// Runs `drivers` from the start of `problem`; `purpose` names the random stream.
pub(crate) fn run_chain(
    problem: &PlanningProblem<'_>,
    drivers: &[Driver<'_>],
    episodes: u32,
    purpose: &str,
) -> Vec<ChainRun> {
    trial(problem, episodes, purpose).runs(drivers, RobotState::at_rest(problem.query.start))
}

/// An experiment of so many `episodes`; `purpose` names the random stream.
fn trial<'a>(problem: &PlanningProblem<'a>, episodes: u32, purpose: &str) -> MonteCarlo<'a> {
    let trial = problem.conditions.monte_carlo(problem.world);
    trial.with_episodes(episodes).with_seed(problem.seed.child(purpose, 0))
}

/// Counts how often `plan` succeeds.
pub(crate) fn verify(
    problem: &PlanningProblem<'_>,
    plan: &[Arc<GuidedOption>],
    policies: &Policies<'_>,
) -> Solution {
    let Method { verify_episodes, verify_half_width, .. } = *problem.method;
    let is_known = |runs: &[ChainRun]| of_plan(runs).count.half_width95() <= verify_half_width;
    let trial = trial(problem, verify_episodes, "verify");
    let start = RobotState::at_rest(problem.query.start);
    let runs = trial.runs_until(&drivers(plan, policies), start, is_known);
    let planned = |(index, option): (usize, &Arc<GuidedOption>)| {
        let arrived = of_option(&runs, index);
        PlannedOption {
            option: Arc::clone(option),
            learnt: policies.learnt(option.id).clone(),
            reused: policies.is_reused(option.id),
            on_arrival: arrived.count,
            arrival_time_s: arrived.mean_time_s,
        }
    };
    let SuccessEstimate { count, mean_time_s } = of_plan(&runs);
    Solution {
        query: problem.query,
        steps: plan.iter().enumerate().map(planned).collect(),
        predicted: count,
        predicted_time_s: if mean_time_s.is_finite() { mean_time_s } else { 0.0 },
        composed: None,
    }
}

/// Composes the odds of `plan` of what is `known`, without a run from end to end.
pub(crate) fn predict(
    problem: &PlanningProblem<'_>,
    plan: &[Arc<GuidedOption>],
    policies: &mut Policies<'_>,
    known: &KnownOptions,
) -> Solution {
    let odds = compose(problem, plan, policies, known);
    note_ends(plan, policies, &odds);
    composed(problem, plan, policies, odds)
}

/// `plan` with its `odds`.
pub(crate) fn composed(
    problem: &PlanningProblem<'_>,
    plan: &[Arc<GuidedOption>],
    policies: &Policies<'_>,
    odds: ComposedOdds,
) -> Solution {
    let PlanningProblem { world, conditions, method, .. } = *problem;
    let pricer = Pricer::new(world, &conditions.noise, method.search, method.failure_cost_s);
    let planned = |(index, option): (usize, &Arc<GuidedOption>)| {
        let mut learnt = policies.learnt(option.id).clone();
        if !learnt.estimate.mean_time_s.is_finite() {
            let next = plan.get(index + 1).map(|next| &next.guide);
            let is_whole = plan.len() == 1;
            learnt.estimate.mean_time_s =
                if is_whole { odds.time_s } else { pricer.price(option, next).parts().0 };
        }
        let is_in = |piece: &&PlanPiece| piece.until > index as f64;
        let piece = odds.pieces.iter().find(is_in).expect("pieces reach the goal");
        PlannedOption {
            option: Arc::clone(option),
            reused: policies.is_reused(option.id),
            on_arrival: piece.count(),
            arrival_time_s: learnt.estimate.mean_time_s,
            learnt,
        }
    };
    Solution {
        query: problem.query,
        steps: plan.iter().enumerate().map(planned).collect(),
        predicted: odds.count(),
        predicted_time_s: odds.time_s,
        composed: Some(odds),
    }
}

/// Notes how the first and the last leg did, so that the search takes other ones where they fail.
fn note_ends(plan: &[Arc<GuidedOption>], policies: &mut Policies<'_>, odds: &ComposedOdds) {
    let ends = [(plan.first(), odds.pieces.first()), (plan.last(), odds.pieces.last())];
    for (leg, piece) in ends.into_iter().filter_map(|(leg, piece)| leg.zip(piece)) {
        if leg.id.role() != Role::Option {
            policies.note(leg.id, SuccessEstimate { count: piece.count(), mean_time_s: f64::INFINITY });
        }
    }
}

/// How often all options succeeded, and how long that took.
pub(crate) fn of_plan(runs: &[ChainRun]) -> SuccessEstimate {
    SuccessEstimate::of(runs.iter().map(|run| (run.end == EpisodeEnd::Reached, run.time_s())))
}

/// How often option number `index` succeeded where it was entered, and how long that took.
pub(crate) fn of_option(runs: &[ChainRun], index: usize) -> SuccessEstimate {
    let entered = runs.iter().filter(move |run| run.visits.len() > index);
    SuccessEstimate::of(entered.map(|run| (run.passed(index), run.visits[index].time_s)))
}

#[cfg(test)]
mod tests {
    use sharp_drive::Visit;
    use sharp_space::Pose;

    use super::*;

    #[test]
    fn options_are_counted_only_where_they_were_entered() {
        let arrival = RobotState::at_rest(Pose::new(0.0, 0.0, 0.0));
        let run = |count, end| {
            let visits = vec![Visit { entry: arrival, time_s: 1.0, half_s: None }; count];
            ChainRun { visits, arrival, end }
        };
        let runs = [run(2, EpisodeEnd::Reached), run(2, EpisodeEnd::Collided), run(1, EpisodeEnd::Lost)];
        let counts = [0, 1].map(|index| of_option(&runs, index).count);
        let count = |episodes, successes| SuccessCount { episodes, successes };
        assert_eq!(counts, [count(3, 2), count(2, 1)]);
        assert_eq!(of_option(&runs, 0).mean_time_s, 1.0);
    }

    #[test]
    fn one_failure_does_not_decide_between_plans_that_ran_a_few_hundred_times() {
        let cost_s = |successes, episodes, predicted_time_s| {
            let pose = Pose::new(0.0, 0.0, 0.0);
            let predicted = SuccessCount { episodes, successes };
            let query = Query { start: pose, goal: pose };
            let solution = Solution { query, steps: Vec::new(), predicted, predicted_time_s, composed: None };
            solution.cost_s(1000.0)
        };
        assert!(cost_s(383, 384, 11.0) < cost_s(256, 256, 14.0), "a faster plan that failed once");
        assert!(cost_s(380, 384, 11.0) > cost_s(256, 256, 14.0), "it failed four times");
        assert!(cost_s(0, 256, 0.0) > 1e6, "it never arrived");
    }
}
