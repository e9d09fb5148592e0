//! `sharp solve`: Algorithm 1, from a map and a problem to a policy on disk.

use std::path::{Path, PathBuf};
use std::time::Duration;

use indicatif::ProgressBar;
use sharp_bench::{Reuse, SolveTimes};
use sharp_drive::World;
use sharp_maps::MapFile;
use sharp_plan::{AbstractionFile, Answer, Method, Plan, Sharp, write_atomic};
use sharp_space::Seed;

use crate::args::{Guide, Learning, Solve, Switch};
use crate::outcome::{Exit, Failure, say, to_json};
use crate::progress::{SolveMonitor, Stopwatch, is_interrupted, spinner};
use crate::report::{MapReport, SolveReport};
use crate::{input, pictures, pipeline};

/// What solving gave: the report, and the plan if there is one.
pub(crate) struct Solved {
    pub(crate) report: SolveReport,
    pub(crate) plan: Option<Plan>,
}

pub(crate) fn run(args: &Solve, seed: u64, json: bool) -> Result<Exit, Failure> {
    let Solved { report, plan } = solve_problem(args, seed, spinner("searching"))?;
    if json {
        say!("{}", to_json(&report));
    } else {
        print_report(&report);
    }
    Ok(match plan {
        Some(_) => Exit::Done,
        None if is_interrupted() => Exit::Interrupted,
        None => Exit::No,
    })
}

/// Solves and writes the plan folder; shows on `spinner` what it does and prints nothing.
pub(crate) fn solve_problem(args: &Solve, seed: u64, spinner: ProgressBar) -> Result<Solved, Failure> {
    let mut stopwatch = Stopwatch::start();
    stopwatch.enter("load");
    let time_limit = args.time_limit.map(limit).transpose()?;
    if !(args.failure_cost.is_finite() && args.failure_cost >= 0.0) {
        let message = format!("--failure-cost is {}, expected seconds, 0 or more", args.failure_cost);
        return Err(Failure::new("USAGE", message));
    }
    let map = input::map(&args.map)?;
    let query = input::query(&map, args.start.as_deref(), args.goal.as_deref(), args.problem)?;
    let noise = input::noise(&args.noise)?;
    let robot = input::robot(&args.abstraction.robot)?;
    let simulator = input::simulator(&args.simulator)?;
    let world = World::new(map.grid.clone(), robot);
    input::check_query(&world, &query)?;
    args.out.as_deref().map_or(Ok(()), input::check_out)?;
    let mut library = pipeline::library(args.library.as_deref(), &world, (simulator, &noise), args.learning)?;
    // Hours of training are kept at once; they are the same whatever else the library holds.
    if args.learning != Learning::Paper {
        library.defer();
    }
    stopwatch.stop();

    let monitor = SolveMonitor::new(stopwatch, time_limit, spinner, args.tensorboard.as_deref());
    let cache = library.folder().map(Path::to_owned);
    let (sharp, file) = pipeline::sharp(world, &args.abstraction, cache.as_deref(), &monitor)?;
    let simulator = sharp.world().simulator(simulator);
    let mut sharp = sharp
        .with_method(method(args))
        .with_noise(noise)
        .with_simulator(simulator)
        .with_library(library)
        .with_seed(Seed(seed));
    let answer = sharp.solve(query, &monitor)?;
    let stopwatch = monitor.into_stopwatch();

    let report = blank_report(args, seed, &map, &mut sharp, &file)?;
    let (mut report, plan) = match answer {
        Answer::Solved(plan) => {
            let folder = plan_folder(args, &map, &plan.world)?;
            let report = report.with_plan(&plan, &folder);
            (report, Some((*plan, folder)))
        }
        Answer::NoPlan(reason) => (SolveReport { status: "no_plan", reason: Some(reason), ..report }, None),
        Answer::Stopped => (
            SolveReport {
                status: "timeout",
                reason: Some("stopped before a plan was verified; what was learnt is kept".to_owned()),
                ..report
            },
            None,
        ),
    };
    report.time_s = SolveTimes::from(&stopwatch);
    let plan = plan
        .map(|(plan, folder)| write_plan(&plan, &folder, (&sharp, &file), &report).map(|()| plan))
        .transpose()?;
    sharp.library_mut().save()?;
    Ok(Solved { report, plan })
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

fn blank_report(
    args: &Solve,
    seed: u64,
    map: &MapFile,
    sharp: &mut Sharp,
    file: &AbstractionFile,
) -> Result<SolveReport, Failure> {
    let options_available = sharp.abstraction(&())?.options.options().len();
    Ok(SolveReport {
        schema: "sharp.solve/1",
        status: "no_plan",
        reason: None,
        robot: sharp.world().robot.name.clone(),
        options: file.kind.name(),
        learning: args.learning.name(),
        cost_update: args.cost_update.name(),
        noise: args.noise.clone(),
        simulator: args.simulator.clone(),
        seed,
        library: sharp.library().folder().map_or("none".to_owned(), |folder| folder.display().to_string()),
        map: MapReport::new(&map.name, &map.grid),
        regions: file.regions.clone(),
        states: file.rbvd.len(),
        options_available,
        plan: vec![],
        reuse: Reuse { uses: 0, reused: 0 },
        predicted: None,
        time_s: SolveTimes::default(),
        plan_dir: None,
    })
}

/// The folder asked for, or a fresh one.
fn plan_folder(args: &Solve, map: &MapFile, world: &World) -> Result<PathBuf, Failure> {
    if let Some(folder) = &args.out {
        return Ok(folder.clone());
    }
    let problem = args.problem.map_or(String::new(), |number| format!("-p{number}"));
    let kind = sharp_options::OptionKind::from(args.abstraction.options).name();
    let stem = format!("{}{problem}-{}-{kind}", map.name, world.robot.name);
    let root = Path::new("sharp-plans");
    (1..100_000)
        .map(|number| root.join(format!("{stem}-{number}")))
        .find(|folder| !folder.exists())
        .ok_or_else(|| Failure::new("FILE_INVALID", "sharp-plans is full, name a folder with --out"))
}

fn write_plan(
    plan: &Plan,
    folder: &Path,
    (sharp, file): (&Sharp, &AbstractionFile),
    report: &SolveReport,
) -> Result<(), Failure> {
    plan.save(folder, file)?;
    let grid = &plan.world.grid;
    sharp_maps::save_ros(grid, &folder.join("map.yaml"))?;
    let heatmap = sharp.detection().and_then(|found| pipeline::heatmap(grid.frame(), found));
    if let Some(heatmap) = &heatmap {
        let regions = pictures::regions_of(&file.rbvd);
        pictures::write(folder, "regions", &pictures::regions(grid, heatmap, &regions))?;
    }
    pictures::write(folder, "abstraction", &pictures::abstraction(grid, &plan.abstraction))?;
    pictures::write(folder, "plan", &pictures::plan(plan, &plan.solution.query, &[]))?;
    write_atomic(&folder.join("solve.json"), (to_json(report) + "\n").as_bytes())?;
    Ok(())
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
    for leg in &report.plan {
        say!(
            "  {:<14} {:>5.1} m  time {:>5} s  cost {:>6.1} s  succeeds {:>4}/{:<4} on arrival  {}{}",
            leg.option,
            leg.length_m,
            leg.time_s.map_or("-".to_owned(), |seconds| format!("{seconds:.1}")),
            leg.cost_s,
            leg.on_arrival.successes,
            leg.on_arrival.episodes,
            leg.policy,
            if leg.reused { ", reused" } else { "" }
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
