//! `sharp solve`: Algorithm 1, from a map and a problem to a policy on disk.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;

use sharp_bench::{
    NamedProblem, SolveFolders, SolveReport, SolveSettings, Stopwatch, TimedMonitor, Verified, solve,
    solve_tour,
};
use sharp_plan::{Method, Monitor, OptionLibrary, Tour};
use sharp_space::Pose;

use crate::args::{Guide, Solve, Switch};
use crate::commands::prior::prior_file;
use crate::commands::show;
use crate::input::{self, HeadingRule};
use crate::outcome::{Exit, Failure, say, to_json};
use crate::progress::{SolveMonitor, is_interrupted};

/// The folder, beside a plan, of trainings that are under way.
const TRAININGS: &str = "training";
/// Runs that `--verify` may ask for.
const EPISODES_MAX: u32 = 1_000_000;

pub(crate) fn run(args: &Solve, seed: u64, json: bool) -> Result<Exit, Failure> {
    let stopwatch = Stopwatch::start("load");
    let time_limit = args.time_limit.map(limit).transpose()?;
    if let Some(cost_s) = args.failure_cost.filter(|cost_s| !(cost_s.is_finite() && *cost_s >= 0.0)) {
        let message = format!("--failure-cost is {cost_s}, expected seconds, 0 or more");
        return Err(Failure::new("USAGE", message));
    }
    if !(0.0..=1.0).contains(&args.min_success) {
        let message = format!("--min-success is {}, expected a share from 0 to 1", args.min_success);
        return Err(Failure::new("USAGE", message));
    }
    let map = input::map(&args.map)?;
    let query = input::query(&map, &args.problem)?;
    let mut problem = NamedProblem::new(&map, query, &args.abstraction.robot, &args.noise)?;
    if let Some(limits) =
        input::speed_limits(&args.speed, &args.map.reading, &map, problem.world.robot.max_speed_mps)?
    {
        problem.world = problem.world.with_speed_limits(limits);
    }
    if let Some(file) = &args.prior {
        problem.world = problem.world.with_prior(prior_file(file)?);
    }
    let method = method(args)?;
    let keeps_trainings = method.keeps_trainings;
    let settings = SolveSettings {
        abstraction: args.abstraction.request(),
        simulator: input::training_simulator(args.simulator.as_deref(), &method)?,
        method,
        seed,
    };
    args.out.as_deref().map_or(Ok(()), |folder| input::check_out("--out", folder))?;
    if let Some(Some(file)) = &args.show {
        input::check_out_file("--show", file)?;
    }
    let library = input::library(args.library.as_deref());
    let trainings = args.out.as_deref().filter(|_| library.is_none()).map(|folder| folder.join(TRAININGS));
    let folders = SolveFolders { library: library.as_deref(), trainings: trainings.as_deref() };

    let vias = args.via.iter().map(|via| input::pose("--via", via, HeadingRule::Free));
    let vias = vias.collect::<Result<Vec<Pose>, _>>()?;

    let spinner = SolveMonitor::new("searching", args.tensorboard.as_deref());
    let monitor = TimedMonitor::new(stopwatch, time_limit, &spinner);
    let (report, is_time_up) = if vias.is_empty() {
        let mut solved = solve(&problem, &settings, folders, &monitor)?;
        let is_time_up = monitor.should_stop();
        spinner.finish();
        hold_to(&mut solved.report, args.min_success);
        let folder = solved.plan.as_ref().map(|_| plan_folder(args, &problem)).transpose()?;
        if let Some(folder) = &folder {
            solved.write(folder, folder)?;
        }
        // Trainings that are kept apart are gone on with by the same call, which must find the library as this one did.
        if !(is_interrupted() && keeps_trainings) {
            solved.save_library()?;
        }
        if let (Some(plan), Some(folder)) = (&solved.plan, &folder) {
            let tour = Tour::from(Arc::new(plan.clone()));
            shown(args, (&tour, &problem.map), Some(solved.library()), (seed, folder))?;
        }
        (solved.report, is_time_up)
    } else {
        let goals = [vias, vec![query.goal]].concat();
        let mut solved = solve_tour(&problem, &goals, &settings, folders, &monitor)?;
        let is_time_up = monitor.should_stop();
        spinner.finish();
        hold_to(&mut solved.report, args.min_success);
        if solved.tour.is_some() {
            let folder = plan_folder(args, &problem)?;
            solved.write(&folder, &folder)?;
        }
        if let (Some(tour), Some(folder)) = (&solved.tour, &solved.report.plan_dir) {
            shown(args, (tour, &problem.map), solved.library(), (seed, Path::new(folder)))?;
        }
        (solved.report, is_time_up)
    };
    if is_time_up && report.predicted.is_some() && !is_interrupted() {
        eprintln!("warning: time was up before the search was done, this is the best plan so far");
    }
    if let Some(folder) =
        args.out.as_deref().filter(|folder| report.plan_dir.is_none() && Tour::is_in(folder))
    {
        eprintln!("warning: {} still holds the plan of an earlier solve", folder.display());
    }
    if json {
        say!("{}", to_json(&report));
    } else {
        print_report(&report);
    }
    Ok(match report.status {
        _ if is_interrupted() => Exit::Interrupted,
        "solved" => Exit::Done,
        _ => Exit::No,
    })
}

/// Says so if the plan predicts less success than is wanted.
fn hold_to(report: &mut SolveReport, min_success: f64) {
    if let Some(predicted) = report.predicted.filter(|predicted| predicted.success < min_success) {
        report.status = "below_min_success";
        report.reason = Some(format!(
            "the best plan found succeeds in {:.1} %, less than the {:.1} % of --min-success",
            100.0 * predicted.success,
            100.0 * min_success
        ));
    }
}

fn limit(seconds: f64) -> Result<Duration, Failure> {
    let duration = Duration::try_from_secs_f64(seconds).ok().filter(|duration| !duration.is_zero());
    duration.ok_or_else(|| {
        Failure::new("USAGE", format!("--time-limit is {seconds}, expected a positive number of seconds"))
    })
}

/// How the flags want the problem solved.
fn method(args: &Solve) -> Result<Method, Failure> {
    let mut method = Method::by_name(args.learning.name()).expect("every word names a method");
    method.search.cost_update = args.cost_update == Switch::On;
    method.failure_cost_s = args.failure_cost.unwrap_or(method.failure_cost_s);
    method.search.goal_heading_tolerance_rad = heading_tolerance(args)?;
    let mut is_composed = false;
    if args.verify != "auto" {
        let episodes = args.verify.parse().ok().filter(|episodes| (0..=EPISODES_MAX).contains(episodes));
        let usage = || {
            let message =
                format!("--verify is {:?}, expected auto or a number from 0 to {EPISODES_MAX}", args.verify);
            Failure::new("USAGE", message)
        };
        let episodes = episodes.ok_or_else(usage)?;
        is_composed = episodes == 0;
        if !is_composed {
            (method.verify_episodes, method.verify_half_width) = (episodes, 0.0);
        }
    }
    let method = if args.guide == Guide::Paper { method.with_learn_and_link() } else { method };
    Ok(if is_composed { method.composed() } else { method })
}

/// How far off the goal's heading the robot may stand, radians; `None` where any will do.
fn heading_tolerance(args: &Solve) -> Result<Option<f64>, Failure> {
    let Some(tolerance_rad) = args.goal_heading_tolerance else { return Ok(None) };
    let refused = |problem: &str| {
        let message = format!("--goal-heading-tolerance is {tolerance_rad}, {problem}");
        Err(Failure::new("USAGE", message))
    };
    if !(0.05..=std::f64::consts::PI).contains(&tolerance_rad) {
        return refused("expected radians from 0.05 to 3.14");
    }
    if !input::goal_has_heading(&args.problem) {
        return refused("but the goal has no heading: --goal X,Y,YAW");
    }
    Ok(Some(tolerance_rad))
}

/// Writes the page of the plan in `folder` where it is wanted, and says where it is.
fn shown(
    args: &Solve,
    plan: (&Tour, &str),
    library: Option<&OptionLibrary>,
    (seed, folder): (u64, &Path),
) -> Result<(), Failure> {
    if let Some(file) = &args.show {
        let path = show::solved(plan, library, seed, (folder, file.as_deref()))?;
        eprintln!("page written to {}", path.display());
    }
    Ok(())
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
    let ends: Vec<usize> =
        report.goals.iter().scan(0, |end, goal| Some(std::mem::replace(end, *end + goal.legs))).collect();
    let in_tenths = |seconds: Option<f64>| seconds.map_or("-".to_owned(), |seconds| format!("{seconds:.1}"));
    // Composed odds have no runs of legs.
    let is_run = report.predicted.as_ref().is_none_or(|predicted| predicted.basis == "runs");
    let arrivals = |count: Verified| match is_run {
        true => format!("succeeds {:>4}/{:<4} on arrival  ", count.successes, count.episodes),
        false => String::new(),
    };
    for (index, option) in report.plan.iter().enumerate() {
        if let Some(number) = ends.iter().position(|&first| first == index) {
            let [x, y] = report.goals[number].goal;
            say!("to ({x}, {y}):");
        }
        say!(
            "  {:<14} {:>5.1} m  time {:>5} s  cost {:>6} s  {}{}{}",
            option.option,
            option.length_m,
            in_tenths(option.time_s),
            in_tenths(option.cost_s),
            arrivals(option.on_arrival),
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
        if let Some(bumped) = &predicted.with_contact {
            say!(
                "where it may touch walls (run --collisions contact), {} of {} runs arrive",
                bumped.successes,
                bumped.episodes
            );
        }
        if let Some(recovered) = &predicted.with_recovery {
            say!(
                "where the robot may plan anew on the way, {} of {} runs arrive",
                recovered.successes,
                recovered.episodes
            );
        }
    }
    say!("library: {}", report.library);
    let time = &report.time_s;
    say!(
        "took {:.1} s: regions {:.1}, abstraction {:.1}, search {:.1}, guides {:.1}, learning {:.1}, verification and repair {:.1}",
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
