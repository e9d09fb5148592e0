//! `sharp learn`: a building ahead of time.

use std::sync::atomic::{AtomicU64, Ordering};

use indicatif::ProgressBar;
use sharp_bench::{
    Engine, EngineMonitor, LearnReport, LocalEngine, NamedWorld, SlurmEngine, SolveSettings, Stopwatch,
    learn, learn_by,
};
use sharp_plan::{BuildingMonitor, BuildingShare, HandOver, LearntPolicy, Method, Part, RosterOption};

use crate::args::{EngineName, Learn};
use crate::commands::eval::program;
use crate::input;
use crate::outcome::{Exit, Failure, say, to_json};
use crate::progress::{bar, is_interrupted};

/// Tasks of a cluster where the user names no number.
const SLURM_PARTS: usize = 16;

pub(crate) fn run(args: &Learn, seed: u64, json: bool) -> Result<Exit, Failure> {
    let stopwatch = Stopwatch::start("learn");
    let map = input::map(&args.map)?;
    let place = NamedWorld::new(&map, &args.abstraction.robot, &args.noise)?;
    let method = Method::by_name(args.learning.name()).expect("every word names a method");
    let settings = SolveSettings {
        abstraction: args.abstraction.request(),
        simulator: input::training_simulator(args.simulator.as_deref(), &method)?,
        method,
        seed,
    };
    args.out.as_deref().map_or(Ok(()), |folder| input::check_out("--out", folder))?;
    let library = input::library(args.library.as_deref()).ok_or_else(|| {
        Failure::new("USAGE", "--library is none, expected a folder: what is learnt must be kept somewhere")
    })?;
    let monitor = LearnBar::new();
    let learnt = match workers(args)? {
        Some(Workers { engine, parts }) => {
            learn_by(&*engine, (&place, &settings), &library, (args.within, parts), &monitor)
        }
        None => {
            let share = BuildingShare::part(args.part.unwrap_or(Part::ALL));
            let share = BuildingShare { within: args.within, ..share };
            learn(&place, &settings, &library, share, &monitor)
        }
    };
    monitor.bar.finish_and_clear();
    let mut learnt = learnt?;
    if let Some(folder) = &args.out {
        learnt.draw(folder)?;
    }
    learnt.report.time_s = stopwatch.total_s();
    if json {
        say!("{}", to_json(&learnt.report));
    } else {
        print_report(&learnt.report);
    }
    Ok(match learnt.report.status {
        _ if is_interrupted() => Exit::Interrupted,
        "whole" => Exit::Done,
        _ => Exit::Partial,
    })
}

/// Who does the work, and in how many parts.
struct Workers {
    engine: Box<dyn Engine>,
    parts: usize,
}

/// Who does the work and in how many parts; `None` for this process as a whole.
fn workers(args: &Learn) -> Result<Option<Workers>, Failure> {
    let parts = args.jobs.map(|jobs| jobs as usize);
    Ok(match args.engine {
        EngineName::Local => {
            parts.map(|parts| Workers { engine: Box::new(LocalEngine { workers: parts }), parts })
        }
        EngineName::Slurm => {
            let engine = Box::new(SlurmEngine { program: program()? });
            Some(Workers { engine, parts: parts.unwrap_or(SLURM_PARTS) })
        }
    })
}

/// Shows on a terminal how far the learning is, and stops it when the user does.
struct LearnBar {
    bar: ProgressBar,
    episodes: AtomicU64,
    successes: AtomicU64,
}

impl LearnBar {
    fn new() -> Self {
        Self { bar: bar(0, "options"), episodes: AtomicU64::new(0), successes: AtomicU64::new(0) }
    }

    /// One unit of `message` is done, which succeeded so often.
    fn note(&self, message: &str, count: sharp_drive::SuccessCount) {
        let add =
            |sum: &AtomicU64, more: u32| sum.fetch_add(more.into(), Ordering::Relaxed) + u64::from(more);
        let episodes = add(&self.episodes, count.episodes);
        let successes = add(&self.successes, count.successes);
        let share = 100.0 * successes as f64 / episodes.max(1) as f64;
        self.bar.set_message(format!("{message}, {share:.1} % succeed"));
        self.bar.inc(1);
    }
}

impl EngineMonitor for LearnBar {
    fn building(&self) -> &dyn BuildingMonitor {
        self
    }

    fn results_so_far(&self, count: usize) {
        self.bar.set_message(format!("{count} parts of this round done"));
    }

    fn message(&self, text: &str) {
        self.bar.suspend(|| eprintln!("{text}"));
    }

    fn should_stop(&self) -> bool {
        is_interrupted()
    }
}

impl BuildingMonitor for LearnBar {
    fn planned(&self, options: usize, hand_overs: usize) {
        self.bar.set_length((options + hand_overs) as u64);
    }

    fn option(&self, _: &RosterOption, learnt: &LearntPolicy) {
        self.note("options", learnt.estimate.count);
    }

    fn hand_over(&self, hand_over: &HandOver) {
        self.note("hand-overs", hand_over.count);
    }

    fn should_stop(&self) -> bool {
        is_interrupted()
    }
}

fn print_report(report: &LearnReport) {
    let LearnReport { robot, noise, map, options, learnt, new, adopted, unguided, pairs, new_pairs, .. } =
        report;
    say!("{robot} on map {}, {noise} noise", map.name);
    say!("{learnt} of {options} options learnt, {} of them now, {adopted} as in another map", new.len());
    if *adopted > 0 && !new.is_empty() {
        say!("learnt now: {}", new.join(" "));
    }
    if *unguided > 0 {
        say!("{unguided} options lead nowhere for this robot");
    }
    say!("{pairs} hand-overs measured, {new_pairs} of them now");
    if *pairs > 0 {
        let success = &report.success;
        say!("they succeed in {:.2} %, the worst in {:.1} %", 100.0 * success.mean, 100.0 * success.worst);
    }
    if !report.weakest.is_empty() {
        say!("the weakest places:");
    }
    for weak in &report.weakest {
        say!("  {:>5.1} %  {}", 100.0 * weak.success, weak.words);
    }
    say!("library: {}", report.library);
    say!(
        "took {:.1} s{}",
        report.time_s,
        if report.status == "whole" { "" } else { "; something is missing" }
    );
}
