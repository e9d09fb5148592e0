//! Progress on a terminal, interruption, and time by phase.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use sharp_guide::GuidedOption;
use sharp_plan::{LearntPolicy, Monitor, Phase};
use sharp_rl::Progress;

use crate::curves::CurveFolder;

static INTERRUPTED: AtomicBool = AtomicBool::new(false);

/// Makes the first interrupt (or SIGTERM) a wish to stop and the second one an end.
pub(crate) fn listen_for_interrupts() {
    // Without a handler the command still works; it just cannot be interrupted gently.
    let _ = ctrlc::set_handler(|| {
        if INTERRUPTED.swap(true, Ordering::SeqCst) {
            std::process::exit(130);
        }
    });
}

/// Returns true once the user has asked to stop.
pub(crate) fn is_interrupted() -> bool {
    INTERRUPTED.load(Ordering::SeqCst)
}

/// Wall time by phase, seconds.
#[derive(Debug)]
pub(crate) struct Stopwatch {
    begun: Instant,
    running: Option<(&'static str, Instant)>,
    spent: BTreeMap<&'static str, f64>,
}

impl Stopwatch {
    pub(crate) fn start() -> Self {
        Self { begun: Instant::now(), running: None, spent: BTreeMap::new() }
    }

    /// Ends the running phase and begins `phase`.
    pub(crate) fn enter(&mut self, phase: &'static str) {
        self.stop();
        self.running = Some((phase, Instant::now()));
    }

    /// Ends the running phase.
    pub(crate) fn stop(&mut self) {
        if let Some((phase, since)) = self.running.take() {
            *self.spent.entry(phase).or_insert(0.0) += since.elapsed().as_secs_f64();
        }
    }

    /// Seconds spent in `phase` so far.
    pub(crate) fn spent_s(&self, phase: &str) -> f64 {
        self.spent.get(phase).copied().unwrap_or(0.0)
    }

    /// Seconds since the start.
    pub(crate) fn total_s(&self) -> f64 {
        self.begun.elapsed().as_secs_f64()
    }
}

/// A spinner on a terminal, nothing elsewhere.
pub(crate) fn spinner(message: &str) -> ProgressBar {
    let bar = ProgressBar::new_spinner().with_message(message.to_owned());
    bar.enable_steady_tick(Duration::from_millis(100));
    bar
}

/// A bar of `len` steps on a terminal, nothing elsewhere.
pub(crate) fn bar(len: u64, message: &str) -> ProgressBar {
    let style = ProgressStyle::with_template("{msg:12} [{bar:30}] {pos}/{len} {elapsed} eta {eta}")
        .map(|style| style.progress_chars("=> "))
        .unwrap_or_else(|_| ProgressStyle::default_bar());
    ProgressBar::new(len).with_style(style).with_message(message.to_owned())
}

/// Watches the solver: phases to a stopwatch, legs to the terminal, interrupts and limits back.
pub(crate) struct SolveMonitor {
    stopwatch: Mutex<Stopwatch>,
    spinner: ProgressBar,
    learnt: AtomicUsize,
    deadline: Option<Instant>,
    curves: Option<Mutex<CurveFolder>>,
}

impl SolveMonitor {
    /// Shows on `spinner` what the solver does; `curves` is the folder of learning curves, if they are wanted.
    pub(crate) fn new(
        stopwatch: Stopwatch,
        time_limit: Option<Duration>,
        spinner: ProgressBar,
        curves: Option<&Path>,
    ) -> Self {
        let deadline = time_limit.and_then(|limit| stopwatch.begun.checked_add(limit));
        Self {
            stopwatch: Mutex::new(stopwatch),
            spinner,
            learnt: AtomicUsize::new(0),
            deadline,
            curves: curves.map(|folder| Mutex::new(CurveFolder::new(folder))),
        }
    }

    fn watch(&self) -> MutexGuard<'_, Stopwatch> {
        self.stopwatch.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The stopwatch, once the solver is done.
    pub(crate) fn into_stopwatch(self) -> Stopwatch {
        self.spinner.finish_and_clear();
        self.stopwatch.into_inner().unwrap_or_else(PoisonError::into_inner)
    }
}

impl Monitor for SolveMonitor {
    fn phase(&self, phase: Phase) {
        let (name, message) = match phase {
            Phase::Regions => ("regions", "predicting critical regions".to_owned()),
            Phase::Abstraction => ("abstraction", "building the abstraction".to_owned()),
            Phase::Search => ("search", "searching".to_owned()),
            Phase::Guide => ("guide", "planning guides".to_owned()),
            Phase::Learn(0) => ("learn", "every policy is at hand".to_owned()),
            Phase::Learn(legs) => ("learn", format!("learning {legs} policies")),
            Phase::Verify => ("verify", "running the whole plan, repairing weak legs".to_owned()),
            _ => {
                self.watch().stop();
                return;
            }
        };
        self.watch().enter(name);
        self.spinner.set_message(message);
    }

    fn trained(&self, option: &GuidedOption, progress: &Progress<'_>) {
        if let Some(curves) = &self.curves {
            let name = option.id.to_string().replace(':', "_");
            curves.lock().unwrap_or_else(PoisonError::into_inner).note(&name, progress);
        }
    }

    fn learnt(&self, option: &GuidedOption, learnt: &LearntPolicy) {
        let count = self.learnt.fetch_add(1, Ordering::Relaxed) + 1;
        let tally = learnt.estimate.count;
        self.spinner.set_message(format!(
            "{count} policies; {} holds {} of {}, {:.1} s",
            option.id, tally.successes, tally.episodes, learnt.estimate.mean_time_s
        ));
    }

    fn should_stop(&self) -> bool {
        is_interrupted() || self.deadline.is_some_and(|deadline| Instant::now() >= deadline)
    }
}
