//! Progress on a terminal, and interruption.

use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressStyle};
use sharp_bench::CurveFolder;
use sharp_guide::GuidedOption;
use sharp_plan::{LearntPolicy, Monitor, Phase};
use sharp_rl::Progress;

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

/// Shows on a terminal what the solver does, draws learning curves, and stops when the user does.
pub(crate) struct SolveMonitor {
    spinner: ProgressBar,
    learnt: AtomicUsize,
    curves: Option<Mutex<CurveFolder>>,
}

impl SolveMonitor {
    /// Shows on `spinner` what the solver does; `curves` is the folder of learning curves, if they are wanted.
    pub(crate) fn new(spinner: ProgressBar, curves: Option<&Path>) -> Self {
        let curves = curves.map(|folder| Mutex::new(CurveFolder::new(folder)));
        Self { spinner, learnt: AtomicUsize::new(0), curves }
    }

    /// Clears the terminal once the solver is done.
    pub(crate) fn finish(self) {
        self.spinner.finish_and_clear();
        warn_of_curves(self.curves);
    }
}

/// Says why curves could not be written, if so.
pub(crate) fn warn_of_curves(curves: Option<Mutex<CurveFolder>>) {
    let curves = curves.map(|curves| curves.into_inner().unwrap_or_else(PoisonError::into_inner));
    if let Some(error) = curves.as_ref().and_then(CurveFolder::failure) {
        eprintln!("warning: learning curves are incomplete: {error}");
    }
}

impl Monitor for SolveMonitor {
    fn phase(&self, phase: Phase) {
        self.spinner.set_message(match phase {
            Phase::Regions => "predicting critical regions".to_owned(),
            Phase::Abstraction => "building the abstraction".to_owned(),
            Phase::Search => "searching".to_owned(),
            Phase::Guide => "planning guides".to_owned(),
            Phase::Learn(0) => "every policy is at hand".to_owned(),
            Phase::Learn(options) => format!("learning {options} policies"),
            Phase::Verify => "running the whole plan, repairing weak options".to_owned(),
            _ => return,
        });
    }

    fn trained(&self, option: &GuidedOption, progress: &Progress<'_>) {
        if let Some(curves) = &self.curves {
            let name = option.id.to_string().replace(':', "_");
            curves.lock().unwrap_or_else(PoisonError::into_inner).note(&name, progress);
        }
    }

    fn learnt(&self, option: &GuidedOption, learnt: &LearntPolicy) {
        let learnt_so_far = self.learnt.fetch_add(1, Ordering::Relaxed) + 1;
        let count = learnt.estimate.count;
        self.spinner.set_message(format!(
            "{learnt_so_far} policies; {} succeeds {} of {} times, {:.1} s",
            option.id, count.successes, count.episodes, learnt.estimate.mean_time_s
        ));
    }

    fn should_stop(&self) -> bool {
        is_interrupted()
    }
}
