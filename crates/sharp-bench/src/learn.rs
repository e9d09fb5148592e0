//! Learning a whole building: library, abstraction, options, hand-overs, and a report with pictures of where it is weak.

use std::f64::consts::PI;
use std::fs;
use std::path::Path;
use std::sync::Arc;

use rand::RngExt;
use serde::Serialize;
use sharp_drive::World;
use sharp_maps::MapFile;
use sharp_plan::{
    AbstractionFile, Area, BuildingMonitor, BuildingShare, BuildingWork, MeasuredStretch, Part, Query,
    Roster, Sharp, WeakPlace, measured_stretches, weak_places,
};
use sharp_sim::NoiseModel;
use sharp_space::{Cell, CollisionChecker, GridFrame, Point, Pose, Seed};

use crate::error::BenchError;
use crate::jobs::{Engine, EngineMonitor, Lesson, Manifest, unfinished};
use crate::named::{self, InputError, NamedProblem, noise, robot};
use crate::pictures;
use crate::reports::MapReport;
use crate::solve::{SolveSettings, prepare};

/// Starts and goals that are drawn before a map counts as too small or too full for them.
const DRAWS_MAX: usize = 10_000_000;
/// How the names of folders begin, beside those of a library, in which workers share the learning of a building.
const LEARNING: &str = "learning-";
/// Places that a report names.
const WEAKEST: usize = 8;
/// How far from a guide the pictures colour the floor, metres.
const PAINT_M: f64 = 0.45;

/// A robot in a map under a noise, with the names that reports print beside them.
#[derive(Clone, Debug)]
pub struct NamedWorld {
    /// The name of the map.
    pub map: String,
    /// The name of the robot, or its file.
    pub robot: String,
    /// Map and robot.
    pub world: World,
    /// The name of the noise, or its file.
    pub noise: String,
    /// The noise itself.
    pub noise_model: NoiseModel,
}

impl NamedWorld {
    /// `map` for the robot and the noise with these names.
    ///
    /// # Errors
    /// Names what is not known.
    pub fn new(map: &MapFile, robot_name: &str, noise_name: &str) -> Result<Self, InputError> {
        Ok(Self {
            map: map.name.clone(),
            robot: robot_name.to_owned(),
            world: named::world(map, robot(robot_name)?),
            noise: noise_name.to_owned(),
            noise_model: noise(noise_name)?,
        })
    }

    /// `query` here.
    #[must_use]
    pub fn problem(&self, query: Query) -> NamedProblem {
        let Self { map, world, noise, noise_model, .. } = self.clone();
        NamedProblem { map, world, query, noise, noise_model }
    }

    /// `count` random starts and goals, in any heading and wherever the robot stands free, at least 8 m apart, or 30 m on a map
    /// with a side of more than 40 m. Whether a way joins them is left open.
    #[must_use]
    pub fn random_queries(&self, count: usize, seed: Seed) -> Vec<Query> {
        let world = &self.world;
        let frame = world.grid.frame();
        let bounds = frame.bounds();
        let least_m = if frame.width_m().max(frame.height_m()) > 40.0 { 30.0 } else { 8.0 };
        let mut rng = seed.stream("questions", 0);
        let mut pose = || {
            let x = rng.random_range(bounds.min.x..bounds.max.x);
            let y = rng.random_range(bounds.min.y..bounds.max.y);
            Pose::new(x, y, rng.random_range(-PI..PI))
        };
        // What is wrong with an end takes long to say.
        let is_free = |pose: &Pose| world.geometry.is_free(*pose);
        let is_sound = |query: &Query| {
            let is_far = query.start.distance_m(&query.goal) >= least_m;
            is_far && is_free(&query.start) && is_free(&query.goal) && query.check(world).is_ok()
        };
        let queries = std::iter::repeat_with(|| Query { start: pose(), goal: pose() });
        queries.take(DRAWS_MAX).filter(is_sound).take(count).collect()
    }

    /// The robot with what the library in the folder `library` knows of the building, and with the abstraction that it
    /// keeps. Without a folder it knows nothing.
    ///
    /// # Errors
    /// If the map has no room for the robot, or a file is broken.
    pub fn open(
        &self,
        settings: &SolveSettings,
        library: Option<&Path>,
    ) -> Result<(Sharp, AbstractionFile), BenchError> {
        let SolveSettings { abstraction, method, simulator, seed } = settings;
        let Self { world, noise_model, .. } = self;
        let library = settings.library(world, noise_model, library.into())?;
        let (sharp, file) = prepare(world.clone(), abstraction, library.folder(), &())?;
        let sharp = sharp
            .with_method(method.clone())
            .with_noise(noise_model.clone())
            .with_simulator(world.simulator(*simulator))
            .with_library(library)
            .with_seed(Seed(*seed));
        Ok((sharp, file))
    }
}

/// A share of successes over a building.
#[derive(Clone, Copy, Debug, Serialize)]
pub struct BuildingSuccess {
    /// Mean over all hand-overs.
    pub mean: f64,
    /// The least of them.
    pub worst: f64,
}

/// A place where the robot has trouble.
#[derive(Clone, Debug, Serialize)]
pub struct WeakReport {
    /// Where, metres.
    pub at: [f64; 2],
    /// The free width there, metres.
    pub width_m: f64,
    /// The options whose hand-over it is.
    pub option: String,
    /// The share of drives that came through.
    pub success: f64,
    /// The same in words.
    pub words: String,
}

/// `sharp.learn/1`: what is known of a building.
#[derive(Clone, Debug, Serialize)]
pub struct LearnReport {
    /// The name and version of the format.
    pub schema: &'static str,
    /// `whole`, or `partial` while something is missing.
    pub status: &'static str,
    /// The name of the robot.
    pub robot: String,
    /// The name of the noise.
    pub noise: String,
    /// The map.
    pub map: MapReport,
    /// Options that a robot can drive.
    pub options: usize,
    /// Those of them that the library has a policy for.
    pub learnt: usize,
    /// Those of them that were learnt now, the most used first.
    pub new: Vec<String>,
    /// Those of them that were taken over from another map.
    pub adopted: usize,
    /// Options between neighbours that no robot of this size gets through.
    pub unguided: usize,
    /// Hand-overs from one option to the next that were measured.
    pub pairs: usize,
    /// Those of them that were measured now.
    pub new_pairs: usize,
    /// How often hand-overs succeed.
    pub success: BuildingSuccess,
    /// Where they fail most.
    pub weakest: Vec<WeakReport>,
    /// The folder of the library.
    pub library: String,
    /// Wall time, seconds.
    pub time_s: f64,
}

/// What learning a building gave.
#[derive(Debug)]
pub struct LearntBuilding {
    /// What is printed.
    pub report: LearnReport,
    stretches: Vec<MeasuredStretch>,
    world: World,
}

/// Learns the `share` of the building of `place` into the library in the folder `library`.
///
/// # Errors
/// If the map has no room for the robot, no option lies within the area, or a file is broken or cannot be written.
pub fn learn(
    place: &NamedWorld,
    settings: &SolveSettings,
    library: &Path,
    share: BuildingShare,
    monitor: &dyn BuildingMonitor,
) -> Result<LearntBuilding, BenchError> {
    let (mut sharp, _) = place.open(settings, Some(library))?;
    let (roster, work) = sharp.learn_building(share, monitor)?;
    let stretches = sharp
        .library()
        .building(&roster.fingerprint)
        .map_or_else(Vec::new, |building| measured_stretches(&roster, building));
    let report = report(place, &sharp, (&roster, &work), &stretches);
    Ok(LearntBuilding { report, stretches, world: place.world.clone() })
}

/// The same by `engine`, in so many `parts`, which may run anywhere; of the area `within`, or of the whole building. What is
/// missing at the end is told by the report; the same call goes on with it.
///
/// # Errors
/// If the map has no room for the robot, no option lies within the area, a file is broken or cannot be written, or the
/// engine cannot do jobs at all.
pub fn learn_by(
    engine: &dyn Engine,
    (place, settings): (&NamedWorld, &SolveSettings),
    library: &Path,
    (within, parts): (Option<Area>, usize),
    monitor: &dyn EngineMonitor,
) -> Result<LearntBuilding, BenchError> {
    // The abstraction is made here and kept, so that it is not made by each of the workers.
    let (mut sharp, _) = place.open(settings, Some(library))?;
    let size = sharp.abstraction(&())?.options.options().len();
    let lesson = Lesson::new(place, settings, within, (parts, size))?;
    // Whatever the build of the program, it goes on in the same folder.
    let name = Lesson { version: String::new(), ..lesson.clone() }.key();
    let dir = library.join(format!("{LEARNING}{}", &name[..8]));
    fs::create_dir_all(&dir).map_err(|error| BenchError::Folder(format!("{}: {error}", dir.display())))?;
    sharp_maps::save_ros(&place.world.grid, &lesson.map_file(&dir))?;
    let (manifest, indices) = Manifest::extend(&dir, lesson.all(), "sharp learn")?;
    for round in indices.chunks(parts) {
        for error in engine.run(&manifest, round, monitor)? {
            monitor.message(&format!("error: {error}"));
        }
        let missing = unfinished(&manifest);
        if round.iter().any(|index| missing.contains(index)) {
            // What the workers should have done is not done here.
            let nothing = BuildingShare { within, options: Part::NONE, hand_overs: Part::NONE };
            return learn(place, settings, library, nothing, &());
        }
    }
    let learnt =
        learn(place, settings, library, BuildingShare { within, ..BuildingShare::ALL }, monitor.building())?;
    // A folder that stays is found finished by the next call.
    let _ = fs::remove_dir_all(&dir);
    Ok(learnt)
}

fn report(
    place: &NamedWorld,
    sharp: &Sharp,
    (roster, work): (&Roster, &BuildingWork),
    stretches: &[MeasuredStretch],
) -> LearnReport {
    let rates: Vec<f64> = stretches.iter().map(|stretch| stretch.count.rate()).collect();
    let is_learnt = |entry: &&sharp_plan::RosterOption| {
        sharp.library().get(entry.id).is_some_and(|stored| stored.corridor == entry.corridor)
    };
    let weakest = weak_places(&place.world, stretches, WEAKEST);
    LearnReport {
        schema: "sharp.learn/1",
        status: if work.is_whole { "whole" } else { "partial" },
        robot: place.world.robot.name.clone(),
        noise: place.noise.clone(),
        map: MapReport::new(&place.map, &place.world.grid),
        options: roster.options.len(),
        learnt: roster.options.iter().filter(is_learnt).count(),
        new: work.learnt.iter().map(ToString::to_string).collect(),
        adopted: work.adopted,
        unguided: roster.unguided.len(),
        pairs: stretches.len(),
        new_pairs: work.hand_overs.0,
        success: BuildingSuccess {
            mean: if rates.is_empty() { 1.0 } else { rates.iter().sum::<f64>() / rates.len() as f64 },
            worst: rates.iter().copied().fold(1.0, f64::min),
        },
        weakest: weakest.iter().map(|weak| weak_report(weak, &place.world)).collect(),
        library: sharp.library().folder().map_or_else(String::new, |folder| folder.display().to_string()),
        time_s: 0.0,
    }
}

fn weak_report(place: &WeakPlace, world: &World) -> WeakReport {
    let WeakPlace { at, width_m, before, after, count } = place;
    let robot_m = 2.0 * world.robot.footprint.inscribed_radius_m();
    let words = format!(
        "from region {} to {}, {width_m:.2} m wide near ({:.1}, {:.1}) for a robot of {robot_m:.2} m: {} of {} drives fail",
        before.from().0,
        after.to().0,
        at.x,
        at.y,
        count.failures(),
        count.episodes
    );
    WeakReport {
        at: [at.x, at.y].map(|value| (100.0 * value).round() / 100.0),
        width_m: (100.0 * width_m).round() / 100.0,
        option: format!("{before} {after}"),
        success: count.rate(),
        words,
    }
}

impl LearntBuilding {
    /// Draws `success` and `speed` (SVG and PNG) into `folder`: the floor along the options, coloured by the share of drives that
    /// fail and by the speed of those that do not.
    ///
    /// # Errors
    /// If a picture cannot be drawn or a file cannot be written.
    pub fn draw(&self, folder: &Path) -> Result<(), BenchError> {
        let grid: &Arc<_> = &self.world.grid;
        let failed = |stretch: &MeasuredStretch| 1.0 - stretch.count.rate();
        let failures = self.painted(failed, f64::max);
        pictures::write(folder, "success", &pictures::field(grid, &failures, "share of drives that fail"))?;
        let speeds = self.painted(|stretch| stretch.speed_mps, f64::min);
        pictures::write(folder, "speed", &pictures::field(grid, &speeds, "speed, m/s"))?;
        Ok(())
    }

    /// A field over the map: near the ways what `value` says of them; where several meet, what `choose` takes of two.
    fn painted(&self, value: impl Fn(&MeasuredStretch) -> f64, choose: fn(f64, f64) -> f64) -> Vec<f32> {
        let frame = self.world.grid.frame();
        let mut field = vec![f32::NAN; frame.len()];
        for stretch in &self.stretches {
            let value = value(stretch);
            for &point in &stretch.way {
                for index in cells_within(frame, point) {
                    let before = f64::from(field[index]);
                    field[index] = if before.is_nan() { value } else { choose(before, value) } as f32;
                }
            }
        }
        field
    }
}

/// The positions of the cells around `point` that a picture colours.
fn cells_within(frame: &GridFrame, point: Point) -> impl Iterator<Item = usize> + use<'_> {
    let reach = (PAINT_M / frame.resolution_m).ceil() as usize;
    let middle = frame.cell_at(point);
    let around = move |at: usize, len: usize| at.saturating_sub(reach)..(at + reach + 1).min(len);
    middle.into_iter().flat_map(move |middle| {
        let rows = around(middle.row, frame.height);
        rows.flat_map(move |row| around(middle.col, frame.width).map(move |col| Cell::new(col, row)))
            .filter(move |&cell| (frame.center(cell) - point).norm() <= PAINT_M)
            .map(|cell| frame.index(cell))
    })
}
