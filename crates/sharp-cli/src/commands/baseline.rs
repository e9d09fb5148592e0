//! `sharp baseline`: the systems to compare with, on the same map, robot, noise and simulator.

use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use sharp_bench::{
    BaselineKind, BaselineReport, BaselineSettings, BaselineTimes, CurveFolder, MeasureMonitor, NamedProblem,
    Stopwatch, measure,
};
use sharp_rl::Progress;

use crate::args::{Baseline, Collisions};
use crate::input;
use crate::outcome::{Exit, Failure, say, to_json};
use crate::progress::{is_interrupted, spinner, warn_of_curves};

pub(crate) fn run(args: &Baseline, seed: u64, json: bool) -> Result<Exit, Failure> {
    let stopwatch = Stopwatch::start("load");
    let kind = BaselineKind::from(args.system);
    let mut settings = BaselineSettings::new(kind, args.episodes, seed);
    settings.simulator = input::simulator(&args.simulator)?;
    settings.contact_ends = args.collisions == Collisions::End;
    settings.rrt_samples = args.rrt_samples;
    settings.max_env_steps = args.max_env_steps;
    if let Some(seconds) = args.time_limit {
        settings.time_limit = Some(Duration::try_from_secs_f64(seconds).map_err(|_| {
            Failure::new(
                "USAGE",
                format!("--time-limit is {seconds}, expected a number of seconds from 0 on"),
            )
        })?);
    }
    let map = input::map(&args.map)?;
    let query = input::query(&map, &args.problem)?;
    let problem = NamedProblem::new(&map, query, &args.robot, &args.noise)?;
    let bar = spinner(kind.name());
    let monitor = CurveMonitor(args.tensorboard.as_deref().map(|root| Mutex::new(CurveFolder::new(root))));
    let report = measure(&problem, &settings, stopwatch, &monitor)?;
    bar.finish_and_clear();
    warn_of_curves(monitor.0);
    if report.status == "timeout" && !is_interrupted() {
        eprintln!("warning: time was up after {} of {} executions", report.episodes, args.episodes);
    }
    if json {
        say!("{}", to_json(&report));
    } else {
        print_report(&report);
    }
    Ok(match report.status {
        _ if is_interrupted() => Exit::Interrupted,
        "driven" => Exit::Done,
        _ => Exit::No,
    })
}

/// Draws learning curves, if they are wanted, and stops when the user does.
struct CurveMonitor(Option<Mutex<CurveFolder>>);

impl MeasureMonitor for CurveMonitor {
    fn trained(&self, progress: &Progress<'_>) {
        if let Some(curves) = &self.0 {
            curves.lock().unwrap_or_else(PoisonError::into_inner).note("sac", progress);
        }
    }

    fn should_stop(&self) -> bool {
        is_interrupted()
    }
}

fn print_report(report: &BaselineReport) {
    if report.status == "no_plan" {
        say!("{}: no path leads to the goal", report.method);
        return;
    }
    say!(
        "{}: {} of {} reached the goal ({:.1} %, between {:.1} and {:.1} %)",
        report.method,
        report.successes,
        report.episodes,
        100.0 * report.success_rate,
        100.0 * report.lower95,
        100.0 * report.upper95
    );
    say!(
        "{} collisions, {} out of time, {} new plans on the way; {:.1} s and {:.1} m on average; a decision takes {:.1} us (p99 {:.1})",
        report.collisions,
        report.timeouts,
        report.recoveries,
        report.mean_sim_time_s,
        report.mean_path_m,
        report.decision_us.p50,
        report.decision_us.p99
    );
    let BaselineTimes { plan, learn, drive, total, .. } = report.time_s;
    say!(
        "took {total:.1} s: planning {plan:.2} an execution, learning {learn:.1} ({} steps), all executions {drive:.1}",
        report.env_steps
    );
}
