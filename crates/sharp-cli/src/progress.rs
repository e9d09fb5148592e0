//! Progress on a terminal, and interruption.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use indicatif::{MultiProgress, ProgressBar, ProgressStyle};
use sharp_bench::CurveFolder;
use sharp_guide::{GuidedOption, LegId};
use sharp_plan::{LearntPolicy, Monitor, Phase, TrainingPoint};
use sharp_rl::{Progress, StopRule};

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
    ticking(ProgressBar::new_spinner(), message)
}

/// A spinner that ticks, once it has its place on the terminal.
fn ticking(bar: ProgressBar, message: &str) -> ProgressBar {
    bar.set_message(message.to_owned());
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

/// Steps of a training between two looks of the terminal at it.
const LINE_EVERY: u64 = 50;

/// Shows on a terminal what the solver does, draws learning curves, and stops when the user does.
pub(crate) struct SolveMonitor {
    lines: MultiProgress,
    spinner: ProgressBar,
    trainings: Mutex<BTreeMap<LegId, TrainingLine>>,
    learnt: AtomicUsize,
    curves: Option<Mutex<CurveFolder>>,
}

impl SolveMonitor {
    /// Begins with `message`; `curves` is the folder of learning curves, if they are wanted.
    pub(crate) fn new(message: &str, curves: Option<&Path>) -> Self {
        let lines = MultiProgress::new();
        let spinner = ticking(lines.add(ProgressBar::new_spinner()), message);
        let curves = curves.map(|folder| Mutex::new(CurveFolder::new(folder)));
        Self { lines, spinner, trainings: Mutex::default(), learnt: AtomicUsize::new(0), curves }
    }

    /// Clears the terminal once the solver is done.
    pub(crate) fn finish(self) {
        // A training that was stopped has a line still.
        _ = self.lines.clear();
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

/// The line of one training.
struct TrainingLine {
    bar: ProgressBar,
    /// When it was looked at first, and the steps behind it then.
    begun: Option<(Instant, u64)>,
    evaluation: Option<TrainingPoint>,
}

impl TrainingLine {
    fn new(lines: &MultiProgress) -> Self {
        let bar = ticking(lines.add(ProgressBar::new_spinner()), "");
        Self { bar, begun: None, evaluation: None }
    }

    fn show(&mut self, id: LegId, progress: &Progress<'_>) {
        let (begun, first) = *self.begun.get_or_insert((Instant::now(), progress.env_steps));
        let steps = progress.env_steps.saturating_sub(first);
        let rate = steps as f64 / begun.elapsed().as_secs_f64().max(0.1);
        self.bar.set_message(training_text(id, progress, self.evaluation.as_ref(), rate));
    }
}

/// How far the training of `id` is, how good it was when it was evaluated, and how long it may take yet at `rate` steps a
/// second.
fn training_text(
    id: LegId,
    progress: &Progress<'_>,
    evaluation: Option<&TrainingPoint>,
    rate: f64,
) -> String {
    let steps = progress.env_steps;
    let mut text = format!("{id}: {steps} steps");
    if let Some(most) = progress.max_env_steps {
        text += &format!(" of at most {most}");
    }
    if progress.began_at > 0 {
        text += &format!(" (anew from {})", progress.began_at);
    }
    if let Some(point) = evaluation {
        text += &format!(", mean return {:.0}", point.mean_return);
        if let Some(StopRule::MeanReturn(wanted)) = progress.stop {
            text += &format!(" (stops at {wanted:.0})");
        }
        let [success, without] = [point.success, point.without_contact].map(|count| 100.0 * count.rate());
        text += &format!(", arrives {success:.0} %");
        if let Some(StopRule::Success { rate: wanted, .. }) = progress.stop {
            text += &format!(" (stops at {:.0} %)", 100.0 * wanted);
        }
        text += &format!(", without contact {without:.0} %");
    }
    if let Some(most) = progress.max_env_steps.filter(|_| rate > 0.0) {
        let left_s = most.saturating_sub(steps) as f64 / rate;
        text += &format!(", at most {:.0} min left", (left_s / 60.0).ceil());
    }
    text
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
        if progress.env_steps.is_multiple_of(LINE_EVERY) {
            let mut trainings = self.trainings.lock().unwrap_or_else(PoisonError::into_inner);
            trainings
                .entry(option.id)
                .or_insert_with(|| TrainingLine::new(&self.lines))
                .show(option.id, progress);
        }
        if let Some(curves) = &self.curves {
            let name = option.id.to_string().replace(':', "_");
            curves.lock().unwrap_or_else(PoisonError::into_inner).note(&name, progress);
        }
    }

    fn evaluated(&self, option: &GuidedOption, point: &TrainingPoint) {
        let mut trainings = self.trainings.lock().unwrap_or_else(PoisonError::into_inner);
        let line = trainings.entry(option.id).or_insert_with(|| TrainingLine::new(&self.lines));
        line.evaluation = Some(*point);
    }

    fn learnt(&self, option: &GuidedOption, learnt: &LearntPolicy) {
        let mut trainings = self.trainings.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(line) = trainings.remove(&option.id) {
            line.bar.finish_and_clear();
        }
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
