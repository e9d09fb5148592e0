//! `sharp run`: executes a plan in a simulator and counts.

use std::io::ErrorKind;
use std::path::Path;
use std::sync::Arc;

use sharp_bench::{BenchError, PlanPage, RunReport, clock_us, named, pictures};
use sharp_export::driven_mcap;
use sharp_maps::{LoadOptions, load};
use sharp_plan::{Execution, FileError, Plan, Tour, write_atomic};
use sharp_space::Seed;

use crate::args::{Collisions, Run, Switch};
use crate::commands::show;
use crate::outcome::{Exit, Failure, say, to_json};
use crate::{input, progress};

pub(crate) fn run(args: &Run, seed: u64, json: bool) -> Result<Exit, Failure> {
    let simulator = input::simulator(&args.simulator)?;
    let tour = load_tour(&args.plan_dir)?;
    let mut settings = tour.run_settings(args.episodes, Seed(seed));
    settings.simulator = tour.plans[0].world.simulator(simulator);
    if let Some(noise) = &args.noise {
        settings.noise = named::noise(noise)?;
    }
    settings.recovery = args.recovery == Switch::On;
    settings.contact_ends = args.collisions == Collisions::End;

    if args.record.is_some() && tour.plans.len() > 1 {
        let count = tour.plans.len();
        let message =
            format!("--record: the plan has {count} goals in a row, expected one; record each goal-N");
        return Err(Failure::new("USAGE", message));
    }
    if let Some(file) = &args.record {
        input::check_out_file("--record", file)?;
    }
    match &args.show {
        Some(Some(file)) => input::check_out_file("--show", file)?,
        Some(None) => input::check_out("--show", &args.plan_dir)?,
        None => {}
    }
    let spinner = progress::spinner("driving");
    let is_kept = args.record.is_some() || args.show.is_some();
    let recordings = if is_kept { tour.record(&settings, &clock_us()) } else { vec![] };
    let episodes: Vec<Execution> = if is_kept {
        recordings.iter().map(|recording| recording.execution.clone()).collect()
    } else {
        tour.run(&settings, &clock_us())
    };
    spinner.finish_and_clear();
    let report = RunReport::predicted(tour.predicted_success(), &episodes);
    let picture = pictures::tour(&tour, &episodes);
    let has_picture = keep(&args.plan_dir, &picture, &report)?;
    if json {
        say!("{}", to_json(&report));
    } else {
        say!(
            "{} of {} reached the goal ({:.1} %, between {:.1} and {:.1} %); predicted {:.1} %",
            report.successes,
            report.episodes,
            100.0 * report.success_rate,
            100.0 * report.lower95,
            100.0 * report.upper95,
            100.0 * report.predicted_success
        );
        say!(
            "{} collisions, {} out of time, {} stray actions, {} recoveries; {:.1} s and {:.1} m on average; a decision takes {:.1} us (p99 {:.1})",
            report.collisions,
            report.timeouts,
            report.strays,
            report.recoveries,
            report.mean_sim_time_s,
            report.mean_path_m,
            report.decision_us.p50,
            report.decision_us.p99
        );
        if has_picture {
            say!("picture: {}", args.plan_dir.join("run.png").display());
        }
    }
    // What was driven has been reported by now, whether or not it can be written.
    if let Some(file) = &args.record {
        write_atomic(file, &driven_mcap(&tour.plans[0], &recordings)?)?;
    }
    if let Some(file) = &args.show {
        let map = map_name(&args.plan_dir);
        let shown = PlanPage { map: &map, tour: &tour, recordings: &recordings, library: None };
        let path = show::write(&shown, &args.plan_dir, file.as_deref())?;
        eprintln!("page written to {}", path.display());
    }
    Ok(Exit::Done)
}

/// Keeps picture and report in the plan's `folder`. It may lie where nothing can be written: its owner has seen the
/// report all the same. Returns true if they are kept.
fn keep(folder: &Path, picture: &str, report: &RunReport) -> Result<bool, Failure> {
    let kept = pictures::write(folder, "run", picture)
        .and_then(|()| Ok(write_atomic(&folder.join("run.json"), (to_json(report) + "\n").as_bytes())?));
    match kept {
        Err(BenchError::File(FileError::Io { path, source }))
            if matches!(source.kind(), ErrorKind::ReadOnlyFilesystem | ErrorKind::PermissionDenied) =>
        {
            eprintln!("warning: {}: {source}; picture and report are not kept", path.display());
            Ok(false)
        }
        kept => Ok(kept.map(|()| true)?),
    }
}

/// The name of the map that the plan in `folder` was made for, as its report says; else the folder's own.
fn map_name(folder: &Path) -> String {
    let report = std::fs::read(folder.join("solve.json")).unwrap_or_default();
    let report: serde_json::Value = serde_json::from_slice(&report).unwrap_or_default();
    report["map"]["name"].as_str().map_or_else(|| folder.display().to_string(), str::to_owned)
}

/// Reads the plan or the plans in a row in `folder` with their map.
pub(crate) fn load_tour(folder: &Path) -> Result<Tour, Failure> {
    if !Tour::is_in(folder) {
        let found = if folder.is_dir() { "holds no plan" } else { "is no folder" };
        let message =
            format!("{} {found}, expected the folder of a plan that `sharp solve` wrote", folder.display());
        return Err(Failure::new("FILE_INVALID", message));
    }
    let map = folder.join("map.yaml");
    let spec = map
        .to_str()
        .ok_or_else(|| Failure::new("FILE_INVALID", format!("{} is not printable", map.display())))?;
    let grid = load(spec, &LoadOptions::default())?.grid;
    Ok(Tour::load(folder, &grid)?)
}

/// Reads the plan of one goal in `folder` with its map.
pub(crate) fn load_plan(folder: &Path) -> Result<Arc<Plan>, Failure> {
    let plans = load_tour(folder)?.plans;
    match &plans[..] {
        [plan] => Ok(Arc::clone(plan)),
        _ => {
            let message = format!(
                "{} has {} goals in a row, name one of its folders goal-N",
                folder.display(),
                plans.len()
            );
            Err(Failure::new("USAGE", message))
        }
    }
}
