//! `sharp prior train|score`: the policy that every option begins with.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use rand::RngExt;
use rayon::prelude::*;
use serde::Serialize;
use sharp_bench::{CurveFolder, named};
use sharp_drive::{Follower, OptionPolicy, OptionTask, Prior, ProfiledFollower, SuccessEstimate, World};
use sharp_maps::{FloorplanKind, generate};
use sharp_options::OptionKind;
use sharp_plan::{
    Abstraction, AbstractionSettings, Query, RouteScenarios, SolveError, TrainingRoute, construct,
    prior_train_settings, training_routes, write_atomic,
};
use sharp_regions::GeometricDetector;
use sharp_rl::{Progress, TrainState, Trained, fine_tune, resume, train};
use sharp_sim::{NoiseModel, RobotModel};
use sharp_space::{GridFrame, OccupancyGrid, Pose, Seed, Stream};

use crate::args::{PriorCommand, PriorScore, PriorTrain};
use crate::outcome::{Exit, Failure, say, to_json};
use crate::progress;

/// Side of the maps, metres.
const MAP_M: f64 = 15.0;
/// Cell of the maps, metres.
const CELL_M: f64 = 0.05;
/// A small robot also sees maps shrunk by this: corridors as tight for it as for a large one.
const SHRUNK: f64 = 0.55;
/// Problems drawn in each map.
const QUERIES: u64 = 6;
/// The shortest problem worth planning, metres.
const QUERY_MIN_M: f64 = 5.0;
/// Environments that learn side by side.
const ENVIRONMENTS: u64 = 32;
/// Kinds of map that scores are taken on and no prior is trained on.
const HELD_OUT: [FloorplanKind; 4] = [
    FloorplanKind::FurnishedRooms,
    FloorplanKind::RingCorridor,
    FloorplanKind::OffsetWalls,
    FloorplanKind::RoomGrid,
];

/// `sharp.prior.train/1`.
#[derive(Serialize)]
struct PriorTrainReport {
    schema: &'static str,
    robot: String,
    seed: u64,
    file: String,
    maps: u32,
    courses: usize,
    env_steps: u64,
    gradient_steps: u64,
    success: f64,
    time_s: PriorTrainTimes,
}

#[derive(Serialize)]
struct PriorTrainTimes {
    courses: f64,
    train: f64,
    total: f64,
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
}

/// How a policy did on its own, leg by leg.
#[derive(Clone, Copy, Debug, Default, Serialize)]
struct PolicyScore {
    success: f64,
    /// Share of the legs on which it held at least 99 %.
    legs_at_99: f64,
    worst_leg: f64,
    mean_sim_time_s: f64,
}

pub(crate) fn run(command: &PriorCommand, seed: u64, json: bool) -> Result<Exit, Failure> {
    match command {
        PriorCommand::Train(args) => run_train(args, seed, json),
        PriorCommand::Score(args) => run_score(args, seed, json),
    }
}

fn run_train(args: &PriorTrain, seed: u64, json: bool) -> Result<Exit, Failure> {
    let begun = Instant::now();
    let robot = named::robot(&args.robot)?;
    let kinds: Vec<_> = FloorplanKind::ALL.into_iter().filter(|kind| !HELD_OUT.contains(kind)).collect();
    let bar = progress::bar(u64::from(args.maps), "planning courses");
    let courses = Arc::new(courses(&robot, &kinds, args.maps, Seed(seed).child("prior", 0), &bar)?);
    bar.finish_and_clear();
    if courses.is_empty() {
        return Err(Failure::new("TRAINING", format!("no course in {} maps for {}", args.maps, robot.name)));
    }
    let courses_s = begun.elapsed().as_secs_f64();
    let Some(trained) = learn(args, &courses, seed)? else { return Ok(Exit::Interrupted) };
    let networks = trained.sac.expect("soft actor-critic returns its networks");
    write_atomic(&args.out, &Prior::new(networks).to_bytes())?;
    // Only now: a crash before would have lost both.
    let _ = std::fs::remove_file(checkpoint(args));
    let total = begun.elapsed().as_secs_f64();
    let report = PriorTrainReport {
        schema: "sharp.prior.train/1",
        robot: robot.name,
        seed,
        file: args.out.display().to_string(),
        maps: args.maps,
        courses: courses.len(),
        env_steps: trained.env_steps,
        gradient_steps: trained.updates,
        success: trained.evaluation.success_rate(),
        time_s: PriorTrainTimes { courses: courses_s, train: total - courses_s, total },
    };
    if json {
        say!("{}", to_json(&report));
    } else {
        say!("{}: holds {:.3} of the evaluation's episodes, {total:.0} s", report.file, report.success);
    }
    Ok(Exit::Done)
}

/// Where a run that was interrupted goes on.
fn checkpoint(args: &PriorTrain) -> PathBuf {
    args.out.with_extension("state")
}

/// Trains on `courses`, from a checkpoint where one was left; `None` if it was interrupted.
fn learn(
    args: &PriorTrain,
    courses: &Arc<Vec<TrainingRoute>>,
    seed: u64,
) -> Result<Option<Trained>, Failure> {
    let max_env_steps = args.steps.unwrap_or(prior_train_settings().max_env_steps);
    let settings = prior_train_settings().with(|train| train.max_env_steps = max_env_steps);
    let noises = Arc::new(vec![NoiseModel::nominal(), NoiseModel::harsh(), NoiseModel::biased()]);
    let task = |index| {
        let scenarios = RouteScenarios::new(Arc::clone(courses), Arc::clone(&noises));
        OptionTask::new(Arc::new(scenarios), Seed(seed).child("environment", index))
    };
    let mut tasks: Vec<OptionTask> = (0..ENVIRONMENTS).map(task).collect();
    let bar = progress::bar(settings.max_env_steps, "learning");
    let mut interrupted = None;
    let mut curves = args.tensorboard.as_deref().map(CurveFolder::new);
    let mut observer = |progress: &Progress<'_>| {
        if let Some(curves) = &mut curves {
            curves.note("prior", progress);
        }
        bar.set_position(progress.env_steps);
        if let Some(evaluation) = progress.evaluation {
            let (steps, rate) = (progress.env_steps, evaluation.success_rate());
            bar.suspend(|| eprintln!("{steps} steps: {rate:.3}, {:.1} actions", evaluation.mean_steps));
        }
        if !progress::is_interrupted() {
            return ControlFlow::Continue(());
        }
        interrupted = progress.checkpoint();
        ControlFlow::Break(())
    };
    let trained = match (read(&checkpoint(args))?, &args.from) {
        (Some(bytes), _) => {
            let state = TrainState::from_bytes(&bytes).map_err(|error| invalid(&checkpoint(args), &error))?;
            resume(&mut tasks, state, &settings, &mut observer)
        }
        (None, Some(from)) => {
            let mut rng = Seed(seed).stream("sac", 0);
            fine_tune(&mut tasks, prior_file(from)?.networks(), &settings, &mut rng, &mut observer)
        }
        (None, None) => train(&mut tasks, &settings, &mut Seed(seed).stream("sac", 0), &mut observer),
    };
    let trained = trained.map_err(|error| Failure::new("TRAINING", error.to_string()))?;
    bar.finish_and_clear();
    if let Some(state) = interrupted {
        write_atomic(&checkpoint(args), &state)?;
        return Ok(None);
    }
    Ok(Some(trained))
}

/// The bytes of `path`, or `None` if there is no such file.
fn read(path: &Path) -> Result<Option<Vec<u8>>, Failure> {
    match std::fs::read(path) {
        Ok(bytes) => Ok(Some(bytes)),
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(Failure::new("FILE_UNREADABLE", format!("{}: {error}", path.display()))),
    }
}

fn prior_file(path: &Path) -> Result<Prior, Failure> {
    let missing = || Failure::new("FILE_UNREADABLE", format!("{}: no such file", path.display()));
    Prior::from_bytes(&read(path)?.ok_or_else(missing)?).map_err(|error| invalid(path, &error))
}

fn invalid(path: &Path, error: &dyn std::fmt::Display) -> Failure {
    Failure::new("FILE_INVALID", format!("{}: {error}", path.display()))
}

/// Courses in `maps` generated maps of `kinds` in turn.
fn courses(
    robot: &RobotModel,
    kinds: &[FloorplanKind],
    maps: u32,
    seed: Seed,
    bar: &indicatif::ProgressBar,
) -> Result<Vec<TrainingRoute>, Failure> {
    let of_map = |index: u32| -> Result<Vec<TrainingRoute>, Failure> {
        let map_seed = seed.child("map", u64::from(index));
        let rng = &mut map_seed.stream("draw", 0);
        let mut grid = generate(kinds[index as usize % kinds.len()], MAP_M, CELL_M, rng);
        if !robot.can_turn_in_place() && (index as usize / kinds.len()).is_multiple_of(2) {
            grid = shrunk(&grid);
        }
        let world = World::new(grid, robot.clone());
        let kind = if index.is_multiple_of(2) { OptionKind::Interface } else { OptionKind::Centroid };
        let Ok(abstraction) = abstraction(&world, kind) else { return Ok(vec![]) };
        let queries: Vec<Query> = (0..QUERIES).filter_map(|_| query(&world, rng)).collect();
        bar.inc(1);
        Ok(training_routes(&world, &abstraction, &queries, map_seed))
    };
    let all: Result<Vec<_>, Failure> = (0..maps).into_par_iter().map(of_map).collect();
    Ok(all?.into_iter().flatten().collect())
}

fn shrunk(grid: &OccupancyGrid) -> OccupancyGrid {
    let frame = GridFrame { resolution_m: SHRUNK * grid.frame().resolution_m, ..*grid.frame() };
    OccupancyGrid::new(frame, grid.cells().to_vec()).expect("as many cells as before")
}

fn abstraction(world: &World, kind: OptionKind) -> Result<Abstraction, Failure> {
    let detector = GeometricDetector::default();
    let family = kind.family().expect("one of ours");
    let built = construct(world, &detector, family, &AbstractionSettings::new(world), &());
    let robot = world.robot.name.clone();
    Ok(built.map_err(|source| SolveError::NoRoom { robot, source })?.0)
}

/// A problem with room at both ends.
fn query(world: &World, rng: &mut Stream) -> Option<Query> {
    let start = place(world, rng)?;
    let goal = place(world, rng)?;
    (start.distance_m(&goal) >= QUERY_MIN_M).then_some(Query { start, goal })
}

fn place(world: &World, rng: &mut Stream) -> Option<Pose> {
    let bounds = world.grid.frame().bounds();
    let room_m = world.robot.footprint.circumscribed_radius_m() + 0.05;
    for _ in 0..1000 {
        let x = rng.random_range(bounds.min.x..bounds.max.x);
        let y = rng.random_range(bounds.min.y..bounds.max.y);
        let pose = Pose::new(x, y, rng.random_range(-std::f64::consts::PI..std::f64::consts::PI));
        if world.geometry.clearance().sample(pose.position) > room_m {
            return Some(pose);
        }
    }
    None
}

fn run_score(args: &PriorScore, seed: u64, json: bool) -> Result<Exit, Failure> {
    let robot = named::robot(&args.robot)?;
    let noise = named::noise(&args.noise)?;
    let bar = progress::bar(u64::from(args.maps), "planning courses");
    let courses = courses(&robot, &HELD_OUT, args.maps, Seed(seed).child("prior score", 0), &bar)?;
    bar.finish_and_clear();
    let prior = match &args.from {
        None => Prior::shipped(&robot).clone(),
        Some(file) => prior_file(file)?,
    };
    let mut policies = BTreeMap::new();
    for (name, policy) in candidates(&prior, &robot, &noise) {
        let trials: Vec<_> = courses
            .iter()
            .flat_map(|course| course.estimate(&policy, &noise, args.episodes, Seed(seed)))
            .collect();
        policies.insert(name, policy_score(&trials));
    }
    let legs = courses.iter().map(TrainingRoute::len).sum();
    let report = PriorScoreReport {
        schema: "sharp.prior.score/1",
        robot: robot.name,
        noise: args.noise.clone(),
        legs,
        episodes: args.episodes,
        policies,
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
    Ok(Exit::Done)
}

/// Every policy that an option may be given without learning, by a name that sorts.
fn candidates(prior: &Prior, robot: &RobotModel, noise: &NoiseModel) -> Vec<(String, OptionPolicy)> {
    let named = |kind: &str, policies: Vec<OptionPolicy>| {
        let name = |(index, policy)| (format!("{kind} {index:02}"), policy);
        policies.into_iter().enumerate().map(name).collect::<Vec<_>>()
    };
    let followers = Follower::candidates(robot).into_iter().map(OptionPolicy::Follower).collect();
    let paced = ProfiledFollower::candidates(robot).into_iter().map(OptionPolicy::Profiled).collect();
    let mut all = named("prior", prior.candidates(robot, noise));
    all.extend(named("follower", followers));
    all.extend(named("paced", paced));
    all
}

fn policy_score(trials: &[SuccessEstimate]) -> PolicyScore {
    let count = trials.len().max(1) as f64;
    let rates = || trials.iter().map(|trial| trial.count.rate());
    let timed: Vec<f64> = trials.iter().map(|trial| trial.mean_time_s).filter(|s| s.is_finite()).collect();
    PolicyScore {
        success: rates().sum::<f64>() / count,
        legs_at_99: rates().filter(|&rate| rate >= 0.99).count() as f64 / count,
        worst_leg: rates().fold(1.0, f64::min),
        mean_sim_time_s: timed.iter().sum::<f64>() / timed.len().max(1) as f64,
    }
}
