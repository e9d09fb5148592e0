//! Several goals in a row, solved one after the other and measured as one.

use std::path::Path;
use std::sync::Arc;

use sharp_plan::{Monitor, OptionLibrary, Phase, Query, Tour, end_of, write_atomic};
use sharp_space::Pose;

use crate::error::BenchError;
use crate::json::to_json;
use crate::named::NamedProblem;
use crate::pictures;
use crate::reports::{GoalReport, Predicted, SolveReport};
use crate::solve::{SolveFolders, SolveSettings, Solved, forget_drives, solve, with_recovery};
use crate::stopwatch::TimedMonitor;
use crate::times::Reuse;

/// The files in the folder of a plan, but for its weights.
const PLAN_FILES: [&str; 13] = [
    "abstraction.png",
    "abstraction.ron",
    "abstraction.svg",
    "map.pgm",
    "map.yaml",
    "plan.png",
    "plan.ron",
    "plan.svg",
    "run.json",
    "run.png",
    "run.svg",
    "show.html",
    "solve.json",
];

/// What solving for several goals gave.
#[derive(Debug)]
pub struct SolvedTour {
    /// What `solve.json` holds: the legs of all plans, and the success of the whole.
    pub report: SolveReport,
    /// The plans in a row, if there is one to every goal.
    pub tour: Option<Tour>,
    solved: Vec<Solved>,
}

/// Algorithm 1 from the start of `problem` to each of `goals` in turn, and runs through all of them. The goal of `problem`
/// is not looked at. What is learnt is kept in the library after every goal.
///
/// # Errors
/// As [`solve`], and if there is no goal.
pub fn solve_tour(
    problem: &NamedProblem,
    goals: &[Pose],
    settings: &SolveSettings,
    folders: SolveFolders<'_>,
    monitor: &TimedMonitor<'_>,
) -> Result<SolvedTour, BenchError> {
    for (index, &goal) in goals.iter().enumerate() {
        let is_last = index + 1 == goals.len();
        let check = Query { goal, ..problem.query }.check(&problem.world);
        check.map_err(|error| if is_last { error } else { error.on_the_way() })?;
    }
    let (mut solved, mut start): (Vec<Solved>, Pose) = (Vec::new(), problem.query.start);
    for &goal in goals {
        let leg = NamedProblem { query: Query { start, goal }, ..problem.clone() };
        let mut one = solve(&leg, settings, folders, monitor)?;
        one.save_library()?;
        let end = one.plan.as_ref().map(end_of);
        solved.push(one);
        match end {
            Some(end) => start = end,
            None => break,
        }
    }
    let plans: Option<Vec<_>> = solved.iter().map(|one| one.plan.clone().map(Arc::new)).collect();
    let tour = plans.filter(|plans| plans.len() == goals.len()).map(|plans| {
        monitor.phase(Phase::Verify);
        let simulator = problem.world.simulator(settings.simulator);
        Tour::verified(plans, &*simulator)
    });
    let recovered = tour.as_ref().and_then(|tour| with_recovery(tour, settings));
    monitor.phase(Phase::Done);
    let Some(last) = solved.last() else {
        return Err(BenchError::Setting { setting: "goal", problem: "is missing".to_owned() });
    };
    let mut report = whole(&solved, last, goals, tour.as_ref());
    report.time_s = monitor.times();
    if let Some(predicted) = &mut report.predicted {
        predicted.with_recovery = recovered;
    }
    Ok(SolvedTour { report, tour, solved })
}

/// The report of all plans as one.
fn whole(solved: &[Solved], last: &Solved, goals: &[Pose], tour: Option<&Tour>) -> SolveReport {
    let reports = || solved.iter().map(|one| &one.report);
    let reuse = reports().fold(Reuse { uses: 0, reused: 0 }, |sum, report| Reuse {
        uses: sum.uses + report.reuse.uses,
        reused: sum.reused + report.reuse.reused,
    });
    let goal = |(report, goal): (&SolveReport, &Pose)| GoalReport {
        goal: [goal.position.x, goal.position.y],
        success: report.predicted.map_or(0.0, |predicted| predicted.success),
        legs: report.plan.len(),
    };
    let to = goals[solved.len() - 1].position;
    let reason =
        last.report.reason.as_ref().map(|reason| {
            format!("goal {} of {}, ({}, {}): {reason}", solved.len(), goals.len(), to.x, to.y)
        });
    SolveReport {
        goals: reports().zip(goals).map(goal).collect(),
        plan: reports().flat_map(|report| report.plan.clone()).collect(),
        reuse,
        reason,
        predicted: tour.map(|tour| Predicted {
            basis: "runs",
            episodes: tour.predicted.episodes,
            success: tour.predicted.rate(),
            lower95: tour.predicted.lower95(),
            sim_time_s: tour.predicted_time_s,
            with_recovery: None,
            with_contact: None,
        }),
        ..last.report.clone()
    }
}

impl SolvedTour {
    /// The options learnt so far.
    #[must_use]
    pub fn library(&self) -> Option<&OptionLibrary> {
        self.solved.last().map(Solved::library)
    }

    /// Writes the plans into folders in `folder`, which the report calls `name`, and what they are together beside them, in
    /// place of earlier plans and of what was driven with them. Does nothing without a plan to every goal.
    ///
    /// # Errors
    /// If a picture cannot be drawn or a file cannot be written.
    pub fn write(&mut self, folder: &Path, name: &Path) -> Result<(), BenchError> {
        let Self { report, tour, solved } = self;
        let Some(tour) = tour else { return Ok(()) };
        let had_tour = has_tour(folder);
        forget_drives(folder);
        Tour::remove(folder)?;
        for (index, one) in solved.iter_mut().enumerate() {
            one.write(&Tour::plan_folder(folder, index), &Tour::plan_folder(name, index))?;
        }
        if had_tour {
            forget_plans(folder, solved.len());
        }
        report.plan_dir = Some(name.display().to_string());
        sharp_maps::save_ros(&tour.plans[0].world.grid, &folder.join("map.yaml"))?;
        pictures::write(folder, "plan", &pictures::tour(tour, &[]))?;
        tour.save(folder)?;
        write_atomic(&folder.join("solve.json"), (to_json(report) + "\n").as_bytes())?;
        Ok(())
    }
}

/// Returns true if `folder` holds several plans in a row.
pub(crate) fn has_tour(folder: &Path) -> bool {
    folder.join("tour.ron").exists()
}

/// Removes the plans from number `first` on, counted from 0, of an earlier tour in `folder`, as far as they can be removed.
/// What others put beside them stays.
pub(crate) fn forget_plans(folder: &Path, first: usize) {
    let folders = (first..).map(|index| Tour::plan_folder(folder, index));
    for folder in folders.take_while(|folder| Tour::is_in(folder)) {
        let files = std::fs::read_dir(&folder).into_iter().flatten().flatten();
        for file in files.map(|entry| entry.path()).filter(|file| is_of_plan(file)) {
            let _ = std::fs::remove_file(file);
        }
        let _ = std::fs::remove_dir(folder);
    }
}

/// Returns true if `file` is a plan or one of those that are written beside it. Weights are named by a hash of 32 digits.
fn is_of_plan(file: &Path) -> bool {
    let name = file.file_name().and_then(|name| name.to_str()).unwrap_or_default();
    PLAN_FILES.contains(&name) || name.strip_suffix(".safetensors").is_some_and(|hash| hash.len() == 32)
}
