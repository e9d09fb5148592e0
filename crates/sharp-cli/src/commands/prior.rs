//! `sharp prior train|cost|score`: the policy that every option begins with.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use serde::Serialize;
use sharp_bench::{
    CostRecipe, CostScore, CurveFolder, PolicyScore, PriorCourses, PriorEnd, PriorProgress, PriorRecipe,
    fit_cost, named, prior_candidates, score_cost, score_policies, train_prior,
};
use sharp_drive::{CostModel, Prior};
use sharp_plan::{TrainingRoute, write_atomic};
use sharp_sim::RobotModel;
use sharp_space::Seed;

use crate::args::{Preset, PriorCommand, PriorCost, PriorScore, PriorTrain};
use crate::outcome::{Exit, Failure, say, to_json};
use crate::{input, progress};

/// How often what was learnt is saved, so that a crash costs little.
const SAVE_EVERY: Duration = Duration::from_secs(60);
/// Environment steps between two lines about the training.
const SAY_EVERY_STEPS: u64 = 500_000;

/// `sharp.prior.train/2`.
#[derive(Serialize)]
struct PriorTrainReport {
    schema: &'static str,
    robot: String,
    seed: u64,
    preset: &'static str,
    file: String,
    courses: usize,
    env_steps: u64,
    gradient_steps: u64,
    /// Share of the last training episodes that succeeded, with the noise in the actions.
    success: f64,
    time_s: f64,
}

/// `sharp.prior.score/1`.
#[derive(Serialize)]
struct PriorScoreReport {
    schema: &'static str,
    robot: String,
    noise: String,
    legs: usize,
    episodes: u32,
    policies: BTreeMap<String, PolicyScore>,
    /// How well the cost of the options is known beforehand, at full caution.
    cost: CostScore,
}

/// `sharp.prior.cost/1`.
#[derive(Serialize)]
struct PriorCostReport {
    schema: &'static str,
    robot: String,
    seed: u64,
    preset: &'static str,
    file: String,
    /// Places under one noise and caution.
    rows: usize,
    failures: f64,
    /// Mean loss of each epoch.
    losses: Vec<f64>,
    time_s: f64,
}

pub(crate) fn run(command: &PriorCommand, seed: u64, json: bool) -> Result<Exit, Failure> {
    match command {
        PriorCommand::Train(args) => run_train(args, seed, json),
        PriorCommand::Cost(args) => run_cost(args, seed, json),
        PriorCommand::Score(args) => run_score(args, seed, json),
    }
}

fn run_train(args: &PriorTrain, seed: u64, json: bool) -> Result<Exit, Failure> {
    let begun = Instant::now();
    input::check_out_file("--out", &args.out)?;
    let robot = named::robot(&args.robot)?;
    let recipe = PriorRecipe::by_name(args.preset.name()).expect("every word names a recipe");
    let saved = read(&checkpoint(args))?;
    let maps = progress::bar(recipe.stages.iter().map(|stage| u64::from(stage.map_count)).sum(), "planning");
    let bar = progress::bar(recipe.env_steps(), "learning");
    let mut watch = TrainWatch {
        file: checkpoint(args),
        bar: &bar,
        curves: args.tensorboard.as_deref().map(CurveFolder::new),
        saved: Instant::now(),
        said: 0,
        failed: None,
    };
    let mut observer = |progress: &PriorProgress<'_>| watch.note(progress);
    let end = train_prior((&robot, &recipe, Seed(seed)), saved.as_deref(), &|| maps.inc(1), &mut observer);
    maps.finish_and_clear();
    bar.finish_and_clear();
    if let Some(failure) = watch.failed {
        return Err(failure);
    }
    let end = end.map_err(|error| Failure::new("TRAINING", error.to_string()))?;
    let PriorEnd::Trained { prior, env_steps, updates, courses, success } = end else {
        return Ok(Exit::Interrupted);
    };
    write_atomic(&args.out, &prior.to_bytes())?;
    // Only now: a crash before would have lost both.
    let _ = std::fs::remove_file(checkpoint(args));
    let report = PriorTrainReport {
        schema: "sharp.prior.train/2",
        robot: robot.name,
        seed,
        preset: args.preset.name(),
        file: args.out.display().to_string(),
        courses,
        env_steps,
        gradient_steps: updates,
        success,
        time_s: begun.elapsed().as_secs_f64(),
    };
    if json {
        say!("{}", to_json(&report));
    } else {
        let PriorTrainReport { file, success, time_s, .. } = &report;
        say!("{file}: succeeds in {success:.3} of the last training episodes, {time_s:.0} s");
    }
    Ok(Exit::Done)
}

/// What the command does while a prior is trained: bar, curves, lines, saved states.
struct TrainWatch<'a> {
    file: PathBuf,
    bar: &'a indicatif::ProgressBar,
    curves: Option<CurveFolder>,
    saved: Instant,
    /// Steps at the last line.
    said: u64,
    failed: Option<Failure>,
}

impl TrainWatch<'_> {
    fn note(&mut self, progress: &PriorProgress<'_>) -> ControlFlow<()> {
        let learner = progress.learner;
        if let Some(curves) = &mut self.curves {
            curves.note("prior", learner);
        }
        let steps = progress.steps_before + learner.env_steps;
        self.bar.set_position(steps);
        if steps / SAY_EVERY_STEPS > self.said / SAY_EVERY_STEPS {
            self.said = steps;
            let metric = |name: &str| learner.metrics.iter().find(|m| m.0 == name).map_or(0.0, |m| m.1);
            let (rate, actions) = (learner.recent_success_rate, learner.recent_steps);
            let (std, kl, lr) = (metric("std"), metric("approx_kl"), metric("learning_rate"));
            let (value, failure) = (metric("value_loss"), metric("failure_loss"));
            self.bar.suspend(|| {
                eprintln!(
                    "{steps} steps: {rate:.3}, {actions:.1} actions, return {:.2}; deviation {std:.3}, kl {kl:.4}, \
                     rate {lr:.1e}, losses {value:.2} {failure:.4}",
                    learner.recent_return
                );
            });
        }
        let interrupted = progress::is_interrupted();
        if interrupted || self.saved.elapsed() > SAVE_EVERY {
            self.saved = Instant::now();
            let bytes = progress.checkpoint().expect("this learner can be saved");
            if let Err(error) = write_atomic(&self.file, &bytes) {
                self.failed = Some(error.into());
                return ControlFlow::Break(());
            }
        }
        if interrupted { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    }
}

/// Where a run that was interrupted goes on.
fn checkpoint(args: &PriorTrain) -> PathBuf {
    let mut name = args.out.clone().into_os_string();
    name.push(".state");
    name.into()
}

/// The bytes of `path`, or `None` if there is no such file.
fn read(path: &Path) -> Result<Option<Vec<u8>>, Failure> {
    match std::fs::read(path) {
        Ok(bytes) => Ok(Some(bytes)),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(Failure::new("FILE_UNREADABLE", format!("{}: {error}", path.display()))),
    }
}

/// Reads the prior in the file at `path`.
pub(crate) fn prior_file(path: &Path) -> Result<Prior, Failure> {
    let missing = || Failure::new("FILE_UNREADABLE", format!("{}: no such file", path.display()));
    Prior::from_bytes(&read(path)?.ok_or_else(missing)?).map_err(|error| invalid(path, &error))
}

fn invalid(path: &Path, error: &dyn std::fmt::Display) -> Failure {
    Failure::new("FILE_INVALID", format!("{}: {error}", path.display()))
}

/// The prior in `file`, or the shipped one of `robot`.
fn prior_of(file: Option<&Path>, robot: &RobotModel) -> Result<Prior, Failure> {
    file.map_or_else(|| Ok(Prior::shipped(robot).clone()), prior_file)
}

fn run_cost(args: &PriorCost, seed: u64, json: bool) -> Result<Exit, Failure> {
    let begun = Instant::now();
    input::check_out_file("--out", &args.out)?;
    let robot = named::robot(&args.robot)?;
    let prior = prior_of(args.from.as_deref(), &robot)?;
    let recipe = match args.preset {
        Preset::Tiny => CostRecipe::tiny(),
        Preset::Default => CostRecipe::shipped(),
    };
    let bar = progress::bar(u64::from(recipe.map_count), "planning courses");
    let fitted = fit_cost((&robot, &prior, &recipe, Seed(seed)), &|| bar.inc(1));
    bar.finish_and_clear();
    let fitted = fitted.map_err(|error| Failure::new("TRAINING", error.to_string()))?;
    write_atomic(&args.out, &fitted.model.to_bytes())?;
    let report = PriorCostReport {
        schema: "sharp.prior.cost/1",
        robot: robot.name,
        seed,
        preset: args.preset.name(),
        file: args.out.display().to_string(),
        rows: fitted.rows,
        failures: fitted.failures,
        losses: fitted.losses,
        time_s: begun.elapsed().as_secs_f64(),
    };
    if json {
        say!("{}", to_json(&report));
    } else {
        let PriorCostReport { file, rows, failures, time_s, .. } = &report;
        say!("{file}: fitted to {rows} places with {failures} failures, {time_s:.0} s");
    }
    Ok(Exit::Done)
}

fn run_score(args: &PriorScore, seed: u64, json: bool) -> Result<Exit, Failure> {
    let robot = named::robot(&args.robot)?;
    let noise = named::noise(&args.noise)?;
    let bar = progress::bar(u64::from(args.maps), "planning courses");
    let courses = PriorCourses::held_out(&robot, Seed(seed)).routes(args.maps, &|| bar.inc(1));
    bar.finish_and_clear();
    let prior = prior_of(args.from.as_deref(), &robot)?;
    let model = match &args.cost {
        None => CostModel::shipped(&robot).clone(),
        Some(file) => {
            let missing = || Failure::new("FILE_UNREADABLE", format!("{}: no such file", file.display()));
            CostModel::from_bytes(&read(file)?.ok_or_else(missing)?).map_err(|error| invalid(file, &error))?
        }
    };
    let mut policies = prior_candidates(&prior, &robot, &noise);
    if args.prior_only {
        policies.retain(|(name, _)| name.starts_with("prior"));
    }
    let policies = score_policies(&courses, policies, &noise, (args.episodes, Seed(seed)));
    let drive = (args.episodes, Seed(seed));
    let cost = score_cost((&model, &prior), (&courses, &robot), (&noise, 1.0), drive);
    let legs = courses.iter().map(TrainingRoute::len).sum();
    let report = PriorScoreReport {
        schema: "sharp.prior.score/1",
        robot: robot.name,
        noise: args.noise.clone(),
        legs,
        episodes: args.episodes,
        policies,
        cost,
    };
    if json {
        say!("{}", to_json(&report));
        return Ok(Exit::Done);
    }
    say!("| policy | success | legs at 99 % | worst leg | mean time s |\n|---|---|---|---|---|");
    for (name, score) in &report.policies {
        let PolicyScore { success, legs_at_99, worst_leg, mean_sim_time_s } = score;
        say!("| {name} | {success:.4} | {legs_at_99:.2} | {worst_leg:.2} | {mean_sim_time_s:.2} |");
    }
    let CostScore { time_s, predicted_time_s, failure, predicted_failure, failure_correlation, .. } =
        &report.cost;
    say!(
        "Cost model at full caution: time {predicted_time_s:.2} s for {time_s:.2} s, failures {predicted_failure:.4} \
         for {failure:.4}, correlation {failure_correlation:.2}"
    );
    Ok(Exit::Done)
}
