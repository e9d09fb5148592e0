//! Lines 11 to 19 of Algorithm 1: what the plan lacks is taken from the library or learnt.

use std::sync::Arc;

use rayon::prelude::*;
use sharp_sim::RobotState;

use super::{LegMonitor, Run};
use crate::certify::Trial;
use crate::files::FileError;
use crate::learn::{LearnFailure, LearningMode, Learnt, Lesson};
use crate::leg::{Leg, LegId, Role};
use crate::library::StoredOption;
use crate::policy::{Follower, OptionPolicy, Rule};
use crate::rollout::Driver;
use crate::sharp::Phase;
use crate::stats::Tally;

/// Runs that show how a leg arrives.
const ARRIVALS: usize = 256;

impl Run<'_> {
    /// Lines 11 to 19: learns what neither the library nor an earlier attempt has. Returns false if stopped.
    pub(super) fn learn_missing(&mut self, legs: &[Arc<Leg>]) -> Result<bool, FileError> {
        for leg in legs {
            self.adopt(leg)?;
        }
        let is_missing = |leg: &&Arc<Leg>| !self.learnt.contains_key(&leg.id);
        let missing: Vec<Arc<Leg>> = legs.iter().filter(is_missing).cloned().collect();
        self.monitor.phase(Phase::Learn(missing.len()));
        match self.settings.learn.mode {
            LearningMode::Fast | LearningMode::Prior if missing.is_empty() => Ok(true),
            LearningMode::Fast | LearningMode::Prior => self.learn_in_order(legs),
            LearningMode::Paper => self.learn_apart(&missing),
        }
    }

    /// One leg after the other, each from where the one before it arrives and with the next in view.
    fn learn_in_order(&mut self, legs: &[Arc<Leg>]) -> Result<bool, FileError> {
        let mut arrivals = vec![RobotState::at_rest(self.query.start); ARRIVALS];
        for (index, leg) in legs.iter().enumerate() {
            let seed = self.settings.seed.child(&format!("leg {}", leg.id), 0);
            if !self.learnt.contains_key(&leg.id) {
                let starts = self.starts(leg, seed).with_arrivals(arrivals.clone());
                let lesson = Lesson { next: legs.get(index + 1), ..self.lesson(leg, starts, seed) };
                let result = lesson.learn(&LegMonitor { monitor: self.monitor, leg });
                if !self.take(leg, result)? {
                    return Ok(false);
                }
            }
            let (policy, next) = (&self.learnt[&leg.id].policy, legs.get(index + 1));
            let driver = Driver::new(leg, policy, next.map(AsRef::as_ref));
            let trial = Trial { workspace: self.workspace, noise: &self.settings.noise, episodes: 0, seed };
            arrivals = trial.exits(&driver, &arrivals);
        }
        Ok(true)
    }

    /// Each leg on its own and all at once: the paper's way.
    fn learn_apart(&mut self, missing: &[Arc<Leg>]) -> Result<bool, FileError> {
        let learn = |leg: &Arc<Leg>| {
            let seed = self.settings.seed.child(&format!("leg {}", leg.id), 0);
            self.lesson(leg, self.starts(leg, seed), seed).learn(&LegMonitor { monitor: self.monitor, leg })
        };
        let results: Vec<_> = missing.par_iter().map(learn).collect();
        let mut finished = true;
        for (leg, result) in missing.iter().zip(results) {
            finished &= self.take(leg, result)?;
        }
        Ok(finished)
    }

    /// Keeps what was learnt of `leg`; false if learning was stopped.
    fn take(&mut self, leg: &Leg, result: Result<Learnt, LearnFailure>) -> Result<bool, FileError> {
        let learnt = match result {
            Ok(learnt) => learnt,
            Err(LearnFailure::Stopped) => return Ok(false),
            // A broken task cannot be learnt: its edge goes, the search goes on.
            Err(LearnFailure::Broken(_)) => useless(),
        };
        self.monitor.learnt(leg, &learnt);
        self.keep(leg, learnt)?;
        Ok(true)
    }

    /// Takes the policy of `leg` from another map of the library where its corridor is the same.
    fn adopt(&mut self, leg: &Leg) -> Result<(), FileError> {
        if self.learnt.contains_key(&leg.id) || leg.id.role() != Role::Option {
            return Ok(());
        }
        let alone = self.planner.leg_called(leg.id).unwrap_or(leg);
        if let Some(stored) = self.library.adopt(&alone.corridor(&self.workspace.grid)) {
            self.before.push(leg.id);
            self.keep(leg, stored.learnt)?;
        }
        Ok(())
    }

    /// Keeps what was learnt of `leg`, an option in the library as well.
    pub(super) fn keep(&mut self, leg: &Leg, learnt: Learnt) -> Result<(), FileError> {
        if let (LegId::Option(id), true) = (leg.id, learnt.verified.successes > 0) {
            // The leg of a plan may have been joined to its neighbours.
            let alone = self.planner.leg_called(leg.id).unwrap_or(leg);
            let corridor = alone.corridor(&self.workspace.grid);
            let stored = StoredOption { guide: alone.guide.clone(), learnt: learnt.clone(), corridor };
            self.library.insert(id, stored)?;
        }
        self.learnt.insert(leg.id, learnt);
        Ok(())
    }
}

/// Stands for a policy that never succeeds.
fn useless() -> Learnt {
    let verified = Tally { episodes: 1, successes: 0 };
    let policy =
        OptionPolicy::Follower(Follower { rule: Rule::Pursuit { look_ahead_m: 0.5 }, speed_mps: 0.2 });
    Learnt { policy, verified, mean_time_s: f64::INFINITY, env_steps: 0, gradient_steps: 0 }
}
