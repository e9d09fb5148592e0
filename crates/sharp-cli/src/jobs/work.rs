//! Doing a job: its problems in order, each a transaction.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use indicatif::ProgressBar;
use sharp_bench::{DecisionTimes, ResultLine, Reuse, SolveTimes};
use sharp_drive::{FAILURE_COST_S, SuccessCount};
use sharp_plan::{Plan, RunSettings, run as run_plan, write_atomic};
use sharp_space::Seed;

use super::machine::machine;
use super::manifest::Job;
use super::spec::{SharpSpec, Spec, map_args, word};
use super::step::JobStep;
use crate::args::{
    AbstractionArgs, Baseline, BaselineName, Collisions, Guide, MAX_ENV_STEPS, Metric, RRT_SAMPLES, Solve,
    Switch, SystemName,
};
use crate::commands::baseline::{BaselineReport, measure};
use crate::commands::solve::{Solved, solve_problem};
use crate::outcome::{Failure, to_json};
use crate::pictures;
use crate::progress::is_interrupted;
use crate::report::{RunReport, SolveReport};

/// How a job ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Ended {
    /// With the results of all its problems.
    Done,
    /// Between two problems; what was finished is kept.
    Interrupted,
}

/// Does what is missing of `job` below `dir` and tells `watch` of every result, old or new.
///
/// # Errors
/// Returns an error that names the job if it does not belong to this program, or its files cannot be
/// read or written.
pub(crate) fn run_job(dir: &Path, job: &Job, watch: &dyn Fn(&ResultLine)) -> Result<Ended, Failure> {
    let named = |failure: Failure| failure.within(format!("job {} ({})", job.index, job.name));
    run_steps(dir, job, watch).map_err(named)
}

fn run_steps(dir: &Path, job: &Job, watch: &dyn Fn(&ResultLine)) -> Result<Ended, Failure> {
    let steps: Vec<JobStep<'_>> = steps(dir, job).collect();
    let mut is_checked = false;
    for (index, step) in steps.iter().enumerate() {
        let done = match step.read()? {
            Some(done) => Some(done),
            None if is_interrupted() => None,
            None => {
                if !std::mem::replace(&mut is_checked, true) {
                    job.spec.check()?;
                }
                let before = index.checked_sub(1).map(|before| &steps[before]);
                step.make(before, |folder, library| result(step, folder, library))?
            }
        };
        let Some(done) = done else { return Ok(Ended::Interrupted) };
        watch(&done.line);
    }
    Ok(Ended::Done)
}

/// The problems of `job` below `dir`, in order.
pub(super) fn steps<'a>(dir: &'a Path, job: &'a Job) -> impl Iterator<Item = JobStep<'a>> {
    job.spec.problems.iter().map(move |&problem| JobStep { dir, job, problem })
}

/// Solves and drives one problem in `folder`; `None` if it was interrupted.
fn result(step: &JobStep<'_>, folder: &Path, library: &Path) -> Result<Option<ResultLine>, Failure> {
    let spec = &step.job.spec;
    let line = match &spec.sharp {
        Some(sharp) => solve_and_drive(step, sharp, folder, library)?,
        None => {
            let report = measure(&baseline_args(spec, step.problem), spec.seed)?;
            Some(with_baseline(blank(step.job, step.problem), &report))
        }
    };
    Ok(line.filter(|_| !is_interrupted()))
}

/// What is known before anything is measured.
fn blank(job: &Job, problem: usize) -> ResultLine {
    let spec = &job.spec;
    let of_sharp = |word: fn(&SharpSpec) -> String| spec.sharp.as_ref().map_or("none".to_owned(), word);
    ResultLine {
        schema: "sharp.result/1".to_owned(),
        version: spec.version.clone(),
        system: word(spec.system),
        learning: of_sharp(|sharp| word(sharp.learning)),
        env: spec.env.clone(),
        problem,
        robot: spec.robot.clone(),
        options: of_sharp(|sharp| word(sharp.options)),
        regions: of_sharp(|sharp| sharp.regions.clone()),
        options_available: 0,
        noise: spec.noise.clone(),
        variant: spec.variant(),
        simulator: SIMULATOR.to_owned(),
        trial: spec.trial,
        seed: spec.seed,
        status: String::new(),
        episodes: spec.episodes,
        successes: 0,
        collisions: 0,
        timeouts: 0,
        recoveries: 0,
        mean_sim_time_s: 0.0,
        predicted_success: 0.0,
        calibration: None,
        reuse: Reuse { uses: 0, reused: 0 },
        env_steps: 0,
        gradient_steps: 0,
        decision_us: DecisionTimes::default(),
        time_s: SolveTimes::default(),
        machine: machine(),
        job: job.name.clone(),
    }
}

/// Where everything is driven: walls to push and graze.
const SIMULATOR: &str = "rapier2d";

fn solve_and_drive(
    step: &JobStep<'_>,
    sharp: &SharpSpec,
    folder: &Path,
    library: &Path,
) -> Result<Option<ResultLine>, Failure> {
    let spec = &step.job.spec;
    let args = solve_args(spec, sharp, step.problem, [library, folder].map(Path::to_owned));
    let Solved { mut report, plan } = solve_problem(&args, spec.seed, ProgressBar::hidden())?;
    if is_interrupted() {
        return Ok(None);
    }
    let mut line = with_solution(blank(step.job, step.problem), &report);
    if let Some(plan) = plan {
        // The folder gets its name when the step is done.
        report.plan_dir = Some(step.folder().display().to_string());
        write_atomic(&folder.join("solve.json"), (to_json(&report) + "\n").as_bytes())?;
        let begun = Instant::now();
        let plan = Arc::new(plan);
        let run = drive(&plan, spec, sharp, folder)?;
        line = with_run(line, &run);
        line.time_s.drive = begun.elapsed().as_secs_f64();
        line.calibration = Some(calibrate(&plan, spec, sharp));
    }
    Ok(Some(line))
}

/// The simulator of learning and verification: not the one that evaluates.
const TRAINING_SIMULATOR: &str = "kinematic";

fn solve_args(spec: &Spec, sharp: &SharpSpec, problem: usize, [library, out]: [PathBuf; 2]) -> Solve {
    Solve {
        map: map_args(&spec.env),
        abstraction: AbstractionArgs {
            robot: spec.robot.clone(),
            options: sharp.options,
            regions: sharp.regions.clone(),
            metric: Metric::Geodesic,
        },
        start: None,
        goal: None,
        problem: Some(problem),
        learning: sharp.learning,
        noise: spec.noise.clone(),
        simulator: TRAINING_SIMULATOR.to_owned(),
        cost_update: sharp.cost_update,
        failure_cost: FAILURE_COST_S,
        guide: Guide::Ridge,
        library: Some(library.display().to_string()),
        out: Some(out),
        time_limit: Some(spec.time_limit_s),
        tensorboard: None,
    }
}

/// Executes the plan, draws what was driven, and counts.
fn drive(plan: &Arc<Plan>, spec: &Spec, sharp: &SharpSpec, folder: &Path) -> Result<RunReport, Failure> {
    let begun = Instant::now();
    let settings = run_settings(plan, spec, sharp, (spec.episodes, "evaluation"));
    let driven = run_plan(plan, &settings, &|| begun.elapsed().as_secs_f64() * 1e6);
    pictures::write(folder, "run", &pictures::plan(plan, &plan.solution.query, &driven))?;
    Ok(RunReport::new(plan, &driven))
}

/// So many executions; `purpose` names the root of their noise, which is never that of learning.
fn run_settings(
    plan: &Arc<Plan>,
    spec: &Spec,
    sharp: &SharpSpec,
    (episodes, purpose): (u32, &str),
) -> RunSettings {
    let mut settings = RunSettings::new(plan, episodes, Seed(spec.seed).child(purpose, 0));
    settings.recovery = sharp.recovery == Switch::On;
    settings
}

/// Executions that a prediction is held against.
const CALIBRATION_EPISODES: u32 = 1000;

/// Executes the plan often enough to tell a prediction that is three points off from luck.
fn calibrate(plan: &Arc<Plan>, spec: &Spec, sharp: &SharpSpec) -> SuccessCount {
    let settings = run_settings(plan, spec, sharp, (CALIBRATION_EPISODES, "calibration"));
    let report = RunReport::new(plan, &run_plan(plan, &settings, &|| 0.0));
    SuccessCount { episodes: report.episodes, successes: report.successes }
}

fn with_solution(line: ResultLine, report: &SolveReport) -> ResultLine {
    let learnt = || report.plan.iter().filter(|leg| !leg.reused);
    ResultLine {
        options_available: report.options_available,
        status: report.status.to_owned(),
        predicted_success: report.predicted.as_ref().map_or(0.0, |predicted| predicted.success),
        reuse: report.reuse,
        env_steps: learnt().map(|leg| leg.env_steps).sum(),
        gradient_steps: learnt().map(|leg| leg.gradient_steps).sum(),
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

fn baseline_args(spec: &Spec, problem: usize) -> Baseline {
    let (system, collisions) = match spec.system {
        SystemName::RrtContact => (BaselineName::Rrt, Collisions::Contact),
        SystemName::Track => (BaselineName::Track, Collisions::End),
        SystemName::Mppi => (BaselineName::Mppi, Collisions::End),
        SystemName::Sac => (BaselineName::Sac, Collisions::End),
        SystemName::Rrt | SystemName::Sharp => (BaselineName::Rrt, Collisions::End),
    };
    Baseline {
        system,
        map: map_args(&spec.env),
        robot: spec.robot.clone(),
        start: None,
        goal: None,
        problem: Some(problem),
        episodes: spec.episodes,
        noise: spec.noise.clone(),
        simulator: SIMULATOR.to_owned(),
        collisions,
        time_limit: Some(spec.time_limit_s),
        rrt_samples: RRT_SAMPLES,
        max_env_steps: MAX_ENV_STEPS,
        tensorboard: None,
    }
}

fn with_baseline(line: ResultLine, report: &BaselineReport) -> ResultLine {
    let times = report.time_s;
    ResultLine {
        status: report.status.to_owned(),
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
