//! Several goals in a row, solved one after the other and measured as one.

use std::path::Path;
use std::sync::Arc;

use sharp_plan::{Monitor, Phase, Query, Tour, end_of, write_atomic};
use sharp_space::Pose;

use crate::error::BenchError;
use crate::json::to_json;
use crate::named::NamedProblem;
use crate::pictures;
use crate::reports::{GoalReport, Predicted, SolveReport};
use crate::solve::{SolveFolders, SolveSettings, Solved, solve, with_recovery};
use crate::stopwatch::TimedMonitor;
use crate::times::Reuse;

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
    /// Writes the plans into folders in `folder`, which the report calls `name`, and what they are together beside them.
    /// Does nothing without a plan to every goal.
    ///
    /// # Errors
    /// If a picture cannot be drawn or a file cannot be written.
    pub fn write(&mut self, folder: &Path, name: &Path) -> Result<(), BenchError> {
        let Self { report, tour, solved } = self;
        let Some(tour) = tour else { return Ok(()) };
        Tour::remove(folder)?;
        for (index, one) in solved.iter_mut().enumerate() {
            one.write(&Tour::plan_folder(folder, index), &Tour::plan_folder(name, index))?;
        }
        report.plan_dir = Some(name.display().to_string());
        sharp_maps::save_ros(&tour.plans[0].world.grid, &folder.join("map.yaml"))?;
        pictures::write(folder, "plan", &pictures::tour(tour, &[]))?;
        tour.save(folder)?;
        write_atomic(&folder.join("solve.json"), (to_json(report) + "\n").as_bytes())?;
        Ok(())
    }
}
