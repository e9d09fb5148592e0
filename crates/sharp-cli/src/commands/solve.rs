//! `sharp solve`: Algorithm 1, from a map and a problem to a policy on disk.

use std::path::{Path, PathBuf};
use std::time::Duration;

use sharp_bench::{NamedProblem, SolveReport, SolveSettings, Stopwatch, TimedMonitor, solve};
use sharp_plan::Method;

use crate::args::{Guide, Solve, Switch};
use crate::input;
use crate::outcome::{Exit, Failure, say, to_json};
use crate::progress::{SolveMonitor, is_interrupted, spinner};

pub(crate) fn run(args: &Solve, seed: u64, json: bool) -> Result<Exit, Failure> {
    let stopwatch = Stopwatch::start("load");
    let time_limit = args.time_limit.map(limit).transpose()?;
    if !(args.failure_cost.is_finite() && args.failure_cost >= 0.0) {
        let message = format!("--failure-cost is {}, expected seconds, 0 or more", args.failure_cost);
        return Err(Failure::new("USAGE", message));
    }
    let map = input::map(&args.map)?;
    let query = input::query(&map, &args.problem)?;
    let problem = NamedProblem::new(&map, query, &args.abstraction.robot, &args.noise)?;
    let settings = SolveSettings {
        abstraction: args.abstraction.request(),
        method: method(args),
        simulator: input::simulator(&args.simulator)?,
        seed,
    };
    args.out.as_deref().map_or(Ok(()), input::check_out)?;
    let library = input::library(args.library.as_deref());

    let spinner = SolveMonitor::new(spinner("searching"), args.tensorboard.as_deref());
    let monitor = TimedMonitor::new(stopwatch, time_limit, &spinner);
    let mut solved = solve(&problem, &settings, library.as_deref(), &monitor)?;
    spinner.finish();

    if solved.plan.is_some() {
        let folder = plan_folder(args, &problem)?;
        solved.write(&folder, &folder)?;
    }
    solved.save_library()?;
    if json {
        say!("{}", to_json(&solved.report));
    } else {
        print_report(&solved.report);
    }
    Ok(match solved.plan {
        Some(_) => Exit::Done,
        None if is_interrupted() => Exit::Interrupted,
        None => Exit::No,
    })
}

fn limit(seconds: f64) -> Result<Duration, Failure> {
    let duration = Duration::try_from_secs_f64(seconds).ok().filter(|duration| !duration.is_zero());
    duration.ok_or_else(|| {
        Failure::new("USAGE", format!("--time-limit is {seconds}, expected a positive number of seconds"))
    })
}

/// How the flags want the problem solved.
fn method(args: &Solve) -> Method {
    let mut method = Method::by_name(args.learning.name()).expect("every word names a method");
    method.search.cost_update = args.cost_update == Switch::On;
    method.failure_cost_s = args.failure_cost;
    if args.guide == Guide::Paper { method.with_learn_and_link() } else { method }
}

/// The folder asked for, or a fresh one.
fn plan_folder(args: &Solve, problem: &NamedProblem) -> Result<PathBuf, Failure> {
    if let Some(folder) = &args.out {
        return Ok(folder.clone());
    }
    let number = args.problem.problem.map_or(String::new(), |number| format!("-p{number}"));
    let kind = sharp_options::OptionKind::from(args.abstraction.options).name();
    let stem = format!("{}{number}-{}-{kind}", problem.map, problem.world.robot.name);
    let root = Path::new("sharp-plans");
    (1..100_000)
        .map(|number| root.join(format!("{stem}-{number}")))
        .find(|folder| !folder.exists())
        .ok_or_else(|| Failure::new("FILE_INVALID", "sharp-plans is full, name a folder with --out"))
}

fn print_report(report: &SolveReport) {
    say!(
        "{}: {} on map {}, {} options, {} noise, {} learning{}",
        report.status,
        report.robot,
        report.map.name,
        report.options,
        report.noise,
        report.learning,
        if report.cost_update == Switch::Off.name() { ", no cost update" } else { "" }
    );
    say!(
        "{} abstract states (regions: {}), {} options",
        report.states,
        report.regions,
        report.options_available
    );
    if let Some(reason) = &report.reason {
        say!("{reason}");
    }
    for option in &report.plan {
        say!(
            "  {:<14} {:>5.1} m  time {:>5} s  cost {:>6.1} s  succeeds {:>4}/{:<4} on arrival  {}{}",
            option.option,
            option.length_m,
            option.time_s.map_or("-".to_owned(), |seconds| format!("{seconds:.1}")),
            option.cost_s,
            option.on_arrival.successes,
            option.on_arrival.episodes,
            option.policy,
            if option.reused { ", reused" } else { "" }
        );
    }
    if let Some(predicted) = &report.predicted {
        say!(
            "predicted success {:.1} % (at least {:.1} %), {:.1} s of driving; reused {} of {} options",
            100.0 * predicted.success,
            100.0 * predicted.lower95,
            predicted.sim_time_s,
            report.reuse.reused,
            report.reuse.uses
        );
    }
    say!("library: {}", report.library);
    let time = &report.time_s;
    say!(
        "took {:.1} s: regions {:.1}, abstraction {:.1}, search {:.1}, guides {:.1}, learning {:.1}, verification {:.1}",
        time.total,
        time.regions,
        time.abstraction,
        time.search,
        time.guide,
        time.learn,
        time.verify
    );
    if let Some(folder) = &report.plan_dir {
        say!("plan written to {folder}; next: sharp run {folder}");
    }
}
