//! Repairing a plan: the legs that hold too rarely choose and learn again, from where they are entered.

use std::sync::Arc;

use rayon::prelude::*;
use sharp_sim::RobotState;

use super::{LegMonitor, Run, certificate, tallies};
use crate::certify::Certificate;
use crate::files::FileError;
use crate::learn::{LearnSettings, Learnt, Lesson, screen};
use crate::leg::Leg;
use crate::policy::OptionPolicy;
use crate::rollout::{ChainRun, Driver};
use crate::stats::Tally;

/// Way after a repaired leg that judges how it arrives, metres.
const TAIL_M: f64 = 4.0;
/// Names the random stream of the runs that repairs are judged by.
const REPAIR: &str = "repair";
/// Gain below which a repaired policy counts as no better, share of episodes: luck explains less.
const GAIN_MIN: f64 = 0.003;

impl Run<'_> {
    /// Makes the plan of `legs` hold more often until it holds as wanted or nothing helps; every change
    /// is tried on the same runs, and taken back if they say so. Returns false if stopped.
    pub(super) fn repair(&mut self, legs: &[Arc<Leg>]) -> Result<bool, FileError> {
        let mut runs = self.run_plan(legs);
        for round in 0..self.settings.repair_rounds {
            if self.monitor.should_stop() {
                return Ok(false);
            }
            if certificate(&runs).tally.rate() >= self.settings.wanted_success {
                break;
            }
            let before: Vec<Learnt> = legs.iter().map(|leg| self.learnt[&leg.id].clone()).collect();
            let changed = round == 0 && self.try_together(legs, &runs)?
                || self.relearn_weak(legs, &runs, u64::from(round))?;
            if !changed {
                break;
            }
            let anew = self.run_plan(legs);
            if self.cost_s(certificate(&anew)) >= self.cost_s(certificate(&runs)) {
                for (leg, learnt) in legs.iter().zip(before) {
                    self.keep(leg, learnt)?;
                }
                break;
            }
            runs = anew;
        }
        Ok(true)
    }

    /// The runs that repairs are judged by: always the same episodes.
    fn run_plan(&self, legs: &[Arc<Leg>]) -> Vec<ChainRun> {
        self.run_chain(&self.drivers(legs), self.settings.repair_episodes, REPAIR)
    }

    /// Gives all legs that were learnt in this problem one and the same policy if the plan is better off:
    /// what suits each leg best may hand over badly to the next. Returns true if it is.
    fn try_together(&mut self, legs: &[Arc<Leg>], runs: &[ChainRun]) -> Result<bool, FileError> {
        let new: Vec<usize> =
            (0..legs.len()).filter(|&index| !self.before.contains(&legs[index].id)).collect();
        let drive = |policy: &OptionPolicy, episodes, purpose: &str| {
            let mut drivers = self.drivers(legs);
            for &index in &new {
                drivers[index].policy = policy;
            }
            let runs = self.run_chain(&drivers, episodes, purpose);
            (self.cost_s(certificate(&runs)), runs)
        };
        let (noise, episodes) = (&self.settings.noise, self.settings.learn.screening_episodes);
        let few = screen(self.workspace, noise, episodes, |policy, episodes, round| {
            drive(policy, episodes, &format!("screen {round}")).0
        });
        let driven =
            few.into_iter().map(|policy| (drive(&policy, self.settings.repair_episodes, REPAIR), policy));
        let best = driven.min_by(|a, b| a.0.0.total_cmp(&b.0.0));
        let Some(((_, driven), policy)) = best.filter(|best| best.0.0 < self.cost_s(certificate(runs)))
        else {
            return Ok(false);
        };
        let certify = |&index: &usize| {
            let seed = self.settings.seed.child(&format!("together {}", legs[index].id), 0);
            let starts = self.starts(&legs[index], seed).with_arrivals(arrivals(&driven, index));
            let lesson = Lesson { next: legs.get(index + 1), ..self.lesson(&legs[index], starts, seed) };
            let Certificate { tally: verified, mean_time_s } = lesson.certify(&policy);
            let Learnt { env_steps, gradient_steps, .. } = self.learnt[&legs[index].id];
            Learnt { policy: policy.clone(), verified, mean_time_s, env_steps, gradient_steps }
        };
        let learnt: Vec<Learnt> = new.par_iter().map(certify).collect();
        for (index, learnt) in new.into_iter().zip(learnt) {
            self.monitor.learnt(&legs[index], &learnt);
            self.keep(&legs[index], learnt)?;
        }
        Ok(true)
    }

    /// Trains the weak legs on the states in which they were entered in `runs`. Returns false if no leg
    /// became better.
    fn relearn_weak(&mut self, legs: &[Arc<Leg>], runs: &[ChainRun], round: u64) -> Result<bool, FileError> {
        // n legs that each fail at most a share (1 - wanted) / n make a plan that holds as wanted.
        let leg_wanted = 1.0 - (1.0 - self.settings.wanted_success) / legs.len() as f64;
        let on_arrival = tallies(runs, legs.len());
        // Those that lose less than the mean leg have their turn in the next round.
        let lost: u32 = on_arrival.iter().map(|tally| tally.failures()).sum();
        let mean_lost = f64::from(lost) / legs.len() as f64;
        let is_weak = |tally: &Tally| {
            tally.episodes >= 50 && tally.rate() < leg_wanted && f64::from(tally.failures()) >= mean_lost
        };
        // Who arrives badly is as much to blame as who cannot cope with it.
        let is_to_blame =
            |index: usize| is_weak(&on_arrival[index]) || on_arrival.get(index + 1).is_some_and(is_weak);
        let weak: Vec<usize> = (0..legs.len()).filter(|&index| is_to_blame(index)).collect();
        let relearn =
            |&index: &usize| self.relearn(legs, (index, on_arrival[index]), runs, (leg_wanted, round));
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
        let seed = self.settings.seed.child(&format!("repair {}", leg.id), round);
        let starts = self.starts(leg, seed).with_arrivals(arrivals(runs, index));
        let mut settings = LearnSettings { wanted_success: wanted, ..self.settings.learn.clone() };
        // Training is for legs that are weak themselves, and once only.
        if self.learnt[&leg.id].gradient_steps > 0 || on_arrival.rate() >= settings.train_below {
            settings.train_below = 0.0;
        }
        let drivers = self.drivers(legs);
        let tail = tail(&drivers[index + 1..]);
        let lesson = Lesson {
            settings: &settings,
            next: legs.get(index + 1),
            tail: &tail,
            ..self.lesson(leg, starts, seed)
        };
        let old = &self.learnt[&leg.id];
        let Tally { episodes, successes } = lesson.judge(&old.policy).tally;
        let failures_allowed = (1.0 - wanted) * f64::from(episodes);
        if f64::from(episodes - successes) <= failures_allowed {
            return None;
        }
        let gain = (GAIN_MIN * f64::from(episodes)).ceil() as u32;
        let beaten = Tally { episodes, successes: (successes + gain).min(episodes) - 1 };
        let new = lesson.learn_fast(&LegMonitor { monitor: self.monitor, leg }, Some(beaten)).ok()??;
        let (env_steps, gradient_steps) =
            (new.env_steps + old.env_steps, new.gradient_steps + old.gradient_steps);
        Some(Learnt { env_steps, gradient_steps, ..new })
    }
}

/// The beginning of `drivers`, as far as how they were entered can matter.
fn tail<'a>(drivers: &[Driver<'a>]) -> Vec<Driver<'a>> {
    let mut left_m = TAIL_M;
    let mut tail = Vec::new();
    for &driver in drivers {
        if left_m <= 0.0 {
            break;
        }
        tail.push(Driver { until_m: left_m, ..driver });
        left_m -= driver.leg.guide.length_m();
    }
    tail
}

/// The states in which leg number `index` was entered.
fn arrivals(runs: &[ChainRun], index: usize) -> Vec<RobotState> {
    runs.iter().filter_map(|run| run.entries.get(index).copied()).collect()
}
