//! Wall time by phase. Measuring is the business of this crate, so that no library below has to read a clock.

#![allow(clippy::disallowed_methods, reason = "times are what is measured here; no result depends on them")]

use std::collections::BTreeMap;
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use sharp_guide::{GuidedOption, LegId};
use sharp_plan::{LearntPolicy, Monitor, Phase, TrainingPoint};
use sharp_rl::Progress;

use crate::reports::UnsolvedTraining;
use crate::times::SolveTimes;

/// Wall time by phase, seconds.
#[derive(Debug)]
pub struct Stopwatch {
    begun: Instant,
    running: Option<(&'static str, Instant)>,
    spent: BTreeMap<&'static str, f64>,
}

impl Stopwatch {
    /// Starts in `phase`.
    #[must_use]
    pub fn start(phase: &'static str) -> Self {
        let now = Instant::now();
        Self { begun: now, running: Some((phase, now)), spent: BTreeMap::new() }
    }

    /// Ends the running phase and begins `phase`.
    pub fn enter(&mut self, phase: &'static str) {
        self.stop();
        self.running = Some((phase, Instant::now()));
    }

    /// Ends the running phase.
    pub fn stop(&mut self) {
        if let Some((phase, since)) = self.running.take() {
            *self.spent.entry(phase).or_insert(0.0) += since.elapsed().as_secs_f64();
        }
    }

    /// Seconds spent in `phase` so far, without the phase that is running.
    #[must_use]
    pub fn spent_s(&self, phase: &str) -> f64 {
        self.spent.get(phase).copied().unwrap_or(0.0)
    }

    /// Seconds since the start.
    #[must_use]
    pub fn total_s(&self) -> f64 {
        self.begun.elapsed().as_secs_f64()
    }

    /// When `limit` after the start is over; `None` for never.
    pub(crate) fn deadline(&self, limit: Option<Duration>) -> Option<Instant> {
        limit.and_then(|limit| self.begun.checked_add(limit))
    }
}

impl From<&Stopwatch> for SolveTimes {
    fn from(watch: &Stopwatch) -> Self {
        Self {
            load: watch.spent_s("load"),
            regions: watch.spent_s("regions"),
            abstraction: watch.spent_s("abstraction"),
            search: watch.spent_s("search"),
            guide: watch.spent_s("guide"),
            learn: watch.spent_s("learn"),
            verify: watch.spent_s("verify"),
            plan: watch.spent_s("plan"),
            drive: watch.spent_s("drive"),
            total: watch.total_s(),
        }
    }
}

/// Returns true once `deadline` has passed.
pub(crate) fn is_over(deadline: Option<Instant>) -> bool {
    deadline.is_some_and(|deadline| Instant::now() >= deadline)
}

/// The wall time since this call, microseconds: the clock that executions take their decisions' times from.
pub fn clock_us() -> impl Fn() -> f64 + Sync {
    let begun = Instant::now();
    move || begun.elapsed().as_secs_f64() * 1e6
}

/// Takes the time of each phase of a solve, stops it at its limit, and passes everything on to another monitor.
pub struct TimedMonitor<'a> {
    stopwatch: Mutex<Stopwatch>,
    deadline: Option<Instant>,
    trainings: Mutex<BTreeMap<LegId, UnsolvedTraining>>,
    inner: &'a dyn Monitor,
}

impl std::fmt::Debug for TimedMonitor<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("TimedMonitor").field("stopwatch", &self.stopwatch).finish_non_exhaustive()
    }
}

impl<'a> TimedMonitor<'a> {
    /// Goes on with `stopwatch`; `limit` counts from its start, `None` is no limit.
    #[must_use]
    pub fn new(stopwatch: Stopwatch, limit: Option<Duration>, inner: &'a dyn Monitor) -> Self {
        let deadline = stopwatch.deadline(limit);
        Self { stopwatch: Mutex::new(stopwatch), deadline, trainings: Mutex::default(), inner }
    }

    /// The times so far.
    #[must_use]
    pub fn times(&self) -> SolveTimes {
        SolveTimes::from(&*self.watch())
    }

    /// How far the trainings are.
    #[must_use]
    pub(crate) fn trainings(&self) -> Vec<UnsolvedTraining> {
        self.trainings.lock().unwrap_or_else(PoisonError::into_inner).values().cloned().collect()
    }

    fn note(&self, option: &GuidedOption, change: impl FnOnce(&mut UnsolvedTraining)) {
        let mut trainings = self.trainings.lock().unwrap_or_else(PoisonError::into_inner);
        change(trainings.entry(option.id).or_insert_with(|| UnsolvedTraining {
            option: option.id.to_string(),
            length_m: option.guide.length_m(),
            env_steps: 0,
            stop: None,
            evaluations: vec![],
        }));
    }

    fn watch(&self) -> MutexGuard<'_, Stopwatch> {
        self.stopwatch.lock().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Monitor for TimedMonitor<'_> {
    fn phase(&self, phase: Phase) {
        let name = match phase {
            Phase::Regions => Some("regions"),
            Phase::Abstraction => Some("abstraction"),
            Phase::Search => Some("search"),
            Phase::Guide => Some("guide"),
            Phase::Learn(_) => Some("learn"),
            Phase::Verify => Some("verify"),
            _ => None,
        };
        match name {
            Some(name) => self.watch().enter(name),
            None => self.watch().stop(),
        }
        self.inner.phase(phase);
    }

    fn trained(&self, option: &GuidedOption, progress: &Progress<'_>) {
        self.note(option, |training| training.env_steps = progress.env_steps);
        self.inner.trained(option, progress);
    }

    fn evaluated(&self, option: &GuidedOption, point: &TrainingPoint) {
        self.note(option, |training| training.evaluations.push(point.into()));
        self.inner.evaluated(option, point);
    }

    fn learnt(&self, option: &GuidedOption, learnt: &LearntPolicy) {
        let stop = learnt.training.as_ref().map(|training| training.stop);
        self.note(option, |training| (training.env_steps, training.stop) = (learnt.env_steps, stop));
        self.inner.learnt(option, learnt);
    }

    fn should_stop(&self) -> bool {
        self.inner.should_stop() || is_over(self.deadline)
    }
}
