//! Doing a job: its problems in order, each a transaction.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;
use std::time::Duration;

use sharp_maps::{LoadOptions, MapFile};
use sharp_plan::{Monitor, Plan, Query, RunSettings, run as run_plan};
use sharp_rbvd::CellMetric;
use sharp_sim::SimulatorKind;
use sharp_space::Seed;

use super::engine::EngineMonitor;
use super::experiment::{Experiment, SharpSettings};
use super::lesson::run_lesson;
use super::machine::machine;
use super::manifest::{Job, JobWork, Manifest};
use super::step::JobStep;
use crate::error::BenchError;
use crate::measure::{BaselineSettings, MeasureMonitor, measure};
use crate::named::NamedProblem;
use crate::pictures;
use crate::reports::{BaselineReport, RunReport, SolveReport};
use crate::result::ResultLine;
use crate::solve::{AbstractionRequest, SolveFolders, SolveSettings, solve};
use crate::stopwatch::{Stopwatch, TimedMonitor, clock_us};
use crate::times::{DecisionTimes, Reuse, SolveTimes};

/// Where everything is driven: walls to push and graze.
const SIMULATOR: SimulatorKind = SimulatorKind::Planar;
/// Executions that a prediction is held against: enough to tell one that is three points off from luck.
const CALIBRATION_EPISODES: u32 = 1000;

/// How a job ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ended {
    /// With the results of all its problems.
    Done,
    /// Between two problems; what was finished is kept.
    Interrupted,
}

/// Does what is missing of the job `index` of `manifest` and tells `monitor` of every result, old or new.
///
/// # Errors
/// Returns an error that names the job if there is none, it does not belong to this program, or its files cannot be
/// read or written.
pub fn run_job(manifest: &Manifest, index: usize, monitor: &dyn EngineMonitor) -> Result<Ended, BenchError> {
    let job = manifest.job(index)?;
    let ended = match &job.work {
        JobWork::Experiment(experiment) => run_steps(&manifest.dir, (job, experiment), monitor),
        JobWork::Lesson(lesson) => run_lesson(&manifest.dir, (job, lesson), monitor),
    };
    ended.map_err(|error| job.error(error))
}

fn run_steps(
    dir: &Path,
    (job, experiment): (&Job, &Experiment),
    monitor: &dyn EngineMonitor,
) -> Result<Ended, BenchError> {
    let steps: Vec<JobStep<'_>> = steps(dir, job).collect();
    let mut is_checked = false;
    for (index, step) in steps.iter().enumerate() {
        let done = match step.read()? {
            Some(done) => Some(done),
            None if monitor.should_stop() => None,
            None => {
                if !std::mem::replace(&mut is_checked, true) {
                    experiment.check()?;
                }
                let before = index.checked_sub(1).map(|before| &steps[before]);
                let task = JobTask { step, experiment, monitor };
                step.make(before, |folder, library| task.result(folder, library))?
            }
        };
        let Some(done) = done else { return Ok(Ended::Interrupted) };
        monitor.result(&done.line);
    }
    Ok(Ended::Done)
}

/// The problems of `job` below `dir`, in order.
pub(super) fn steps<'a>(dir: &'a Path, job: &'a Job) -> impl Iterator<Item = JobStep<'a>> {
    job.work.problems().iter().map(move |&problem| JobStep { dir, job, problem })
}

/// One problem of a job, and who watches.
struct JobTask<'a> {
    step: &'a JobStep<'a>,
    experiment: &'a Experiment,
    monitor: &'a dyn EngineMonitor,
}

/// What solving and measuring ask: whether to go on.
struct StopOnly<'a>(&'a dyn EngineMonitor);

impl Monitor for StopOnly<'_> {
    fn should_stop(&self) -> bool {
        self.0.should_stop()
    }
}

impl MeasureMonitor for StopOnly<'_> {
    fn should_stop(&self) -> bool {
        self.0.should_stop()
    }
}

impl JobTask<'_> {
    /// Solves and drives the problem in `folder`; `None` if it was interrupted.
    fn result(&self, folder: &Path, library: &Path) -> Result<Option<ResultLine>, BenchError> {
        let line = match (self.experiment.system.sharp(), self.experiment.system.baseline()) {
            (Some(sharp), _) => self.solve_and_drive(sharp, folder, library)?,
            (None, Some((kind, contact_ends))) => {
                let mut settings =
                    BaselineSettings::new(kind, self.experiment.episodes, self.experiment.seed);
                settings.contact_ends = contact_ends;
                settings.time_limit = Some(self.time_limit());
                Some(self.measure(&settings)?)
            }
            (None, None) => None,
        };
        Ok(line.filter(|_| !self.monitor.should_stop()))
    }

    fn measure(&self, settings: &BaselineSettings) -> Result<ResultLine, BenchError> {
        let stopwatch = Stopwatch::start("load");
        let report = measure(&self.problem()?, settings, stopwatch, &StopOnly(self.monitor))?;
        Ok(with_baseline(self.blank(), &report))
    }

    fn problem(&self) -> Result<NamedProblem, BenchError> {
        let Experiment { env, robot, noise, .. } = self.experiment;
        let map = sharp_maps::load(env, &LoadOptions::default())?;
        let query = query_of(&map, self.step.problem)?;
        Ok(NamedProblem::new(&map, query, robot, noise)?)
    }

    fn time_limit(&self) -> Duration {
        Duration::try_from_secs_f64(self.experiment.time_limit_s).unwrap_or(Duration::MAX)
    }

    fn solve_and_drive(
        &self,
        sharp: &SharpSettings,
        folder: &Path,
        library: &Path,
    ) -> Result<Option<ResultLine>, BenchError> {
        let Experiment { seed, episodes, .. } = *self.experiment;
        let stop = StopOnly(self.monitor);
        let monitor = TimedMonitor::new(Stopwatch::start("load"), Some(self.time_limit()), &stop);
        let problem = self.problem()?;
        let method = sharp.method().ok_or_else(|| {
            let problem = format!("{:?}, expected fast, paper, paper-tuned or prior", sharp.learning);
            BenchError::Setting { setting: "learning", problem }
        })?;
        let settings = SolveSettings {
            abstraction: AbstractionRequest {
                options: sharp.options,
                regions: sharp.regions.clone(),
                metric: CellMetric::Geodesic,
            },
            simulator: method.simulator,
            method,
            seed,
        };
        // They outlive the folder of an attempt.
        let trainings = self.step.folder().with_extension("training");
        let folders = SolveFolders { library: Some(library), trainings: Some(&trainings) };
        let mut solved = solve(&problem, &settings, folders, &monitor)?;
        if self.monitor.should_stop() {
            return Ok(None);
        }
        let mut line = with_solution(self.blank(), &solved.report);
        // The folder gets its name when the step is done.
        solved.write(folder, &self.step.folder())?;
        if let Some(plan) = solved.plan.take() {
            let plan = Arc::new(plan);
            let mut stopwatch = Stopwatch::start("drive");
            let run = drive(
                &plan,
                &run_settings(&plan, sharp, episodes, Seed(seed).child("evaluation", 0)),
                folder,
            )?;
            stopwatch.stop();
            line = with_run(line, &run);
            line.time_s.drive = stopwatch.spent_s("drive");
            let settings =
                run_settings(&plan, sharp, CALIBRATION_EPISODES, Seed(seed).child("calibration", 0));
            line.calibration = Some(sharp_plan::success(&run_plan(&plan, &settings, &|| 0.0)));
        }
        solved.save_library()?;
        Ok(Some(line))
    }

    /// What is known before anything is measured.
    fn blank(&self) -> ResultLine {
        let Experiment { version, env, robot, system, noise, trial, seed, episodes, .. } = self.experiment;
        let of_sharp = |word: fn(&SharpSettings) -> &str| system.sharp().map_or("none", word).to_owned();
        ResultLine {
            schema: "sharp.result/1".to_owned(),
            version: version.clone(),
            system: system.name().to_owned(),
            learning: of_sharp(|sharp| &sharp.learning),
            env: env.clone(),
            problem: self.step.problem,
            robot: robot.clone(),
            options: of_sharp(|sharp| sharp.options.name()),
            regions: of_sharp(|sharp| &sharp.regions),
            options_available: 0,
            noise: noise.clone(),
            variant: self.experiment.variant().name(),
            simulator: SIMULATOR.to_string(),
            trial: *trial,
            seed: *seed,
            status: String::new(),
            episodes: *episodes,
            successes: 0,
            collisions: 0,
            timeouts: 0,
            recoveries: 0,
            mean_sim_time_s: 0.0,
            predicted_success: 0.0,
            calibration: None,
            reuse: Reuse { uses: 0, reused: 0 },
            policies: BTreeMap::new(),
            env_steps: 0,
            gradient_steps: 0,
            decision_us: DecisionTimes::default(),
            time_s: SolveTimes::default(),
            machine: machine(),
            job: self.step.job.name.clone(),
        }
    }
}

/// The problem with `number` of `map`, from 1.
fn query_of(map: &MapFile, number: usize) -> Result<Query, BenchError> {
    let problem = number.checked_sub(1).and_then(|index| map.problems.get(index)).ok_or_else(|| {
        let problem = format!("{number}, expected 1 to {}", map.problems.len());
        BenchError::Setting { setting: "problem", problem }
    })?;
    Ok(Query { start: problem.start, goal: problem.goal })
}

/// So many executions whose noise comes from `seed`, which is never that of learning.
fn run_settings(plan: &Arc<Plan>, sharp: &SharpSettings, episodes: u32, seed: Seed) -> RunSettings {
    let mut settings = RunSettings::new(plan, episodes, seed);
    settings.recovery = sharp.recovery;
    settings
}

/// Executes the plan, draws what was driven, and counts.
fn drive(plan: &Arc<Plan>, settings: &RunSettings, folder: &Path) -> Result<RunReport, BenchError> {
    let driven = run_plan(plan, settings, &clock_us());
    pictures::write(folder, "run", &pictures::plan(plan, &plan.solution.query, &driven))?;
    Ok(RunReport::new(plan, &driven))
}

fn with_solution(line: ResultLine, report: &SolveReport) -> ResultLine {
    let learnt = || report.plan.iter().filter(|option| !option.reused);
    ResultLine {
        options_available: report.options_available,
        status: report.status.to_owned(),
        predicted_success: report.predicted.as_ref().map_or(0.0, |predicted| predicted.success),
        reuse: report.reuse,
        policies: report.plan.iter().fold(BTreeMap::new(), |mut uses, option| {
            *uses.entry(option.policy.to_owned()).or_default() += 1;
            uses
        }),
        env_steps: learnt().map(|option| option.env_steps).sum(),
        gradient_steps: learnt().map(|option| option.gradient_steps).sum(),
        time_s: report.time_s,
        ..line
    }
}

fn with_run(line: ResultLine, run: &RunReport) -> ResultLine {
    ResultLine {
        successes: run.successes,
        collisions: run.collisions,
        timeouts: run.timeouts,
        recoveries: run.recoveries,
        mean_sim_time_s: run.mean_sim_time_s,
        decision_us: run.decision_us,
        ..line
    }
}

fn with_baseline(line: ResultLine, report: &BaselineReport) -> ResultLine {
    let times = report.time_s;
    ResultLine {
        status: report.status.to_owned(),
        // Without a path all executions have failed, and none was driven.
        episodes: if report.status == "no_plan" { line.episodes } else { report.episodes },
        successes: report.successes,
        collisions: report.collisions,
        timeouts: report.timeouts,
        recoveries: report.recoveries,
        mean_sim_time_s: report.mean_sim_time_s,
        env_steps: report.env_steps,
        gradient_steps: report.gradient_steps,
        decision_us: report.decision_us,
        time_s: SolveTimes {
            load: times.load,
            plan: times.plan,
            learn: times.learn,
            drive: times.drive,
            total: times.total,
            ..SolveTimes::default()
        },
        ..line
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::jobs::{System, merge};

    // Stopped executions were no episodes in the report of a baseline, and failures in its line.
    #[test]
    fn a_baseline_that_was_out_of_time_has_the_episodes_that_it_drove() {
        let folder = tempfile::tempdir().expect("a folder");
        let (system, problems) = (System::Track, vec![1]);
        let experiment = Experiment { system, problems, time_limit_s: 1e-9, ..Experiment::example() };
        let (manifest, _) = Manifest::extend(folder.path(), vec![experiment], "call").expect("a plan");
        assert_eq!(run_job(&manifest, 0, &()).expect("a job"), Ended::Done);
        let merged = merge(&manifest).expect("results");
        let lines: Vec<_> =
            merged.lines().map(|line| (&*line.status, line.episodes, line.successes)).collect();
        assert_eq!(lines, [("timeout", 0, 0)]);
    }
}
