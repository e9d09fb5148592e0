//! Repairing a plan: the legs that hold too rarely choose and learn again, from where they are entered.

use std::sync::Arc;

use rayon::prelude::*;
use sharp_sim::RobotState;

use super::{LegMonitor, Run, tallies};
use crate::files::FileError;
use crate::learn::{LearnSettings, Learnt, Lesson};
use crate::leg::Leg;
use crate::rollout::{ChainRun, LegOutcome};
use crate::stats::Tally;

/// A leg that holds as often as this on arrival is not trained anew, only chosen anew.
const TRAIN_BELOW: f64 = 0.97;
/// Legs after a repaired one that judge how it arrives.
const TAIL_LEGS: usize = 2;
/// Gain below which a repaired policy counts as no better, share of episodes: luck explains less.
const GAIN_MIN: f64 = 0.003;

impl Run<'_> {
    /// Runs the plan and trains the weak legs on the states in which they were really entered.
    /// Returns false if the plan holds as often as wanted, or no leg became better.
    pub(super) fn repair(&mut self, legs: &[Arc<Leg>], round: u64) -> Result<bool, FileError> {
        let runs = self.run_chain(legs, self.settings.repair_episodes, "repair", round);
        let wanted = self.settings.wanted_success;
        if Tally::count(runs.iter().map(|run| run.outcome == LegOutcome::Done)).rate() >= wanted {
            return Ok(false);
        }
        // n legs that each fail at most a share (1 - wanted) / n make a plan that holds as wanted.
        let leg_wanted = 1.0 - (1.0 - wanted) / legs.len() as f64;
        let is_weak = |tally: &Tally| tally.episodes >= 50 && tally.rate() < leg_wanted;
        let on_arrival = tallies(&runs, legs.len());
        // Who arrives badly is as much to blame as who cannot cope with it.
        let is_to_blame =
            |index: usize| is_weak(&on_arrival[index]) || on_arrival.get(index + 1).is_some_and(is_weak);
        let weak: Vec<usize> = (0..legs.len()).filter(|&index| is_to_blame(index)).collect();
        let relearn =
            |&index: &usize| self.relearn(legs, (index, on_arrival[index]), &runs, (leg_wanted, round));
        let results: Vec<_> = weak.par_iter().map(relearn).collect();
        let mut better = false;
        for (index, learnt) in weak.into_iter().zip(results) {
            if let Some(learnt) = learnt {
                better = true;
                self.monitor.learnt(&legs[index], &learnt);
                self.keep(&legs[index], learnt)?;
            }
        }
        Ok(better)
    }

    /// A policy for leg number `index`, which held as `on_arrival` says, that holds more often than its
    /// present one on what `runs` arrived with.
    fn relearn(
        &self,
        legs: &[Arc<Leg>],
        (index, on_arrival): (usize, Tally),
        runs: &[ChainRun],
        (wanted, round): (f64, u64),
    ) -> Option<Learnt> {
        let leg = &legs[index];
        let arrivals: Vec<RobotState> =
            runs.iter().filter_map(|run| run.entries.get(index).copied()).collect();
        let seed = self.settings.seed.child(&format!("repair {}", leg.id), round);
        let starts = self.starts(leg, seed).with_arrivals(arrivals);
        let mut settings = LearnSettings { wanted_success: wanted, ..self.settings.learn.clone() };
        // Training is for legs that are weak themselves, and once only.
        if self.learnt[&leg.id].gradient_steps > 0 || on_arrival.rate() >= TRAIN_BELOW {
            settings.train_below = 0.0;
        }
        let next = legs.get(index + 1);
        let drivers = self.drivers(legs);
        let tail = &drivers[index + 1..drivers.len().min(index + 1 + TAIL_LEGS)];
        let lesson = Lesson { settings: &settings, next, tail, ..self.lesson(leg, starts, seed) };
        let old = &self.learnt[&leg.id];
        let present = lesson.judge(&old.policy);
        let (judged, mut new) = lesson.learn_judged(&LegMonitor { monitor: self.monitor, leg }).ok()?;
        new.env_steps += old.env_steps;
        new.gradient_steps += old.gradient_steps;
        (judged.tally.rate() - present.tally.rate() >= GAIN_MIN).then_some(new)
    }
}
