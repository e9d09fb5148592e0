//! A lesson: a share of the learning of a building, as a job.
//!
//! A building is learnt in two rounds of lessons: first the options, then the hand-overs, which need all options. Lessons
//! share the folder of the library and nothing else. What a lesson has learnt is in the library at once, so that one
//! that was killed goes on where it was; the mark of a finished one is a file of its own.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use sharp_maps::{LoadOptions, MapFile};
use sharp_options::OptionKind;
use sharp_plan::{
    Area, BuildingMonitor, BuildingShare, HandOver, LearntPolicy, Method, Part, RosterOption, hash, map_hash,
    write_atomic,
};
use sharp_rbvd::CellMetric;
use sharp_sim::SimulatorKind;
use sharp_space::Point;

use super::engine::EngineMonitor;
use super::experiment::{Inputs, file_name, stale};
use super::machine::version;
use super::manifest::Job;
use super::work::Ended;
use crate::error::BenchError;
use crate::json::to_json;
use crate::learn::{NamedWorld, learn};
use crate::named::DETECTORS;
use crate::named::from_here;
use crate::solve::{AbstractionRequest, SolveSettings};

const SCHEMA: &str = "sharp.lesson/1";
/// Processor time of learning an option, and of driving its hand-overs, seconds: docs/results.md.
const OPTION_S: [f64; 2] = [0.13, 0.26];

/// A share of the learning of a building: equal lessons give equal bytes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Lesson {
    /// Version and build of the program.
    pub version: String,
    /// The name of the map.
    pub map: String,
    /// The name of the robot, or its file.
    pub robot: String,
    /// The name of the noise, or its file.
    pub noise: String,
    /// The kind of option.
    pub options: OptionKind,
    /// Where critical regions come from: see [`named::detector`](crate::named::detector).
    pub regions: String,
    /// The distances of the diagram.
    pub metric: CellMetric,
    /// The name of the method: see [`Method::by_name`].
    pub learning: String,
    /// The simulator of learning.
    pub simulator: SimulatorKind,
    /// The root of all randomness.
    pub seed: u64,
    /// Only the options whose two ends lie in this rectangle: x and y of its lower left corner and of its upper right one.
    pub within: Option<[f64; 4]>,
    /// What is learnt.
    pub round: LessonRound,
    /// Which share of it: the number of this lesson, from 0, and how many there are.
    pub part: [usize; 2],
    /// Options of the building, for weights only.
    pub size: usize,
    /// The folder of the library, from the folder of the manifest.
    pub library: PathBuf,
    /// What it reads.
    pub inputs: Inputs,
}

/// The two rounds of learning a building.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LessonRound {
    /// The options.
    Options,
    /// The hand-overs between them, once all of them are there.
    HandOvers,
}

/// The mark of a finished lesson.
#[derive(Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct LessonMark {
    schema: String,
    /// Key of the job.
    job: String,
}

impl Lesson {
    /// The first of `parts` lessons on the options of the building of `place` under `settings`, into the library one folder
    /// above the manifest.
    ///
    /// # Errors
    /// If a file cannot be read.
    pub fn new(
        place: &NamedWorld,
        settings: &SolveSettings,
        within: Option<Area>,
        (parts, size): (usize, usize),
    ) -> Result<Self, BenchError> {
        let SolveSettings { abstraction, method, simulator, seed } = settings;
        let AbstractionRequest { options, regions, metric } = abstraction;
        let grid = &place.world.grid;
        let named = (!DETECTORS.contains(&regions.as_str())).then_some(regions.as_str());
        let inputs = Inputs::of(grid, &place.robot, &place.noise, named)?;
        Ok(Self {
            version: version().to_owned(),
            map: place.map.clone(),
            robot: from_here(&place.robot),
            noise: from_here(&place.noise),
            options: *options,
            regions: from_here(regions),
            metric: *metric,
            learning: method.name.clone(),
            simulator: *simulator,
            seed: *seed,
            within: within.map(|area| [area.min.x, area.min.y, area.max.x, area.max.y]),
            round: LessonRound::Options,
            part: [0, parts],
            size,
            library: PathBuf::from(".."),
            inputs,
        })
    }

    /// All lessons of both rounds, of which this is one.
    #[must_use]
    pub fn all(&self) -> Vec<Self> {
        let count = self.part[1];
        let of_round =
            |round| (0..count).map(move |index| Self { round, part: [index, count], ..self.clone() });
        [LessonRound::Options, LessonRound::HandOvers].into_iter().flat_map(of_round).collect()
    }

    /// The hash that stands for the whole lesson.
    #[must_use]
    pub fn key(&self) -> String {
        hash(to_json(self).as_bytes())[..16].to_owned()
    }

    /// A name for files: readable, and of this lesson only.
    #[must_use]
    pub fn name(&self) -> String {
        let Self { map, robot, options, round, part: [index, count], .. } = self;
        let round = if *round == LessonRound::Options { "options" } else { "hand-overs" };
        let tail = format!("{}-{round}-{index}-of-{count}-{}", options.name(), &self.key()[..8]);
        file_name(&["learn", map, robot], &tail)
    }

    /// Processor time that the lesson is expected to take, seconds; for packing and order only.
    #[must_use]
    pub fn weight_s(&self) -> f64 {
        let [options_s, hand_overs_s] = OPTION_S;
        let each_s = if self.round == LessonRound::Options { options_s } else { hand_overs_s };
        each_s * self.size as f64 / self.part[1].max(1) as f64
    }

    /// The file that keeps the map in `dir`, the folder of the manifest: the cells as they were read.
    #[must_use]
    pub fn map_file(&self, dir: &Path) -> PathBuf {
        dir.join(format!("map-{}.yaml", self.inputs.map))
    }

    /// Verifies that this program reads what the lesson was planned for.
    ///
    /// # Errors
    /// Names the input that differs.
    fn check(&self, map: &MapFile) -> Result<(), BenchError> {
        if self.version != version() {
            return Err(stale("version and build of sharp".to_owned(), version(), &self.version));
        }
        let found = map_hash(&map.grid);
        if found[..16] != self.inputs.map {
            return Err(stale(format!("hash of map {:?}", self.map), &found[..16], &self.inputs.map));
        }
        let named = (!DETECTORS.contains(&self.regions.as_str())).then_some(self.regions.as_str());
        let is = Inputs::of(&map.grid, &self.robot, &self.noise, named)?;
        if is != self.inputs {
            let what = "hash of robot, noise or regions".to_owned();
            return Err(stale(what, &format!("{is:?}"), &format!("{:?}", self.inputs)));
        }
        Ok(())
    }

    fn settings(&self) -> Result<SolveSettings, BenchError> {
        let method = Method::by_name(&self.learning).ok_or_else(|| {
            let problem = format!("{:?}, expected fast, paper, paper-tuned or prior", self.learning);
            BenchError::Setting { setting: "learning", problem }
        })?;
        let Self { options, regions, metric, simulator, seed, .. } = self.clone();
        let abstraction = AbstractionRequest { options, regions, metric };
        Ok(SolveSettings { abstraction, method, simulator, seed })
    }
}

/// Does what is missing of the lesson `lesson`, which is `job` of the manifest in `dir`.
pub(super) fn run_lesson(
    dir: &Path,
    (job, lesson): (&Job, &Lesson),
    monitor: &dyn EngineMonitor,
) -> Result<Ended, BenchError> {
    if is_done(dir, job)? {
        return Ok(Ended::Done);
    }
    if monitor.should_stop() {
        return Ok(Ended::Interrupted);
    }
    let mut map = sharp_maps::load(&lesson.map_file(dir).display().to_string(), &LoadOptions::default())?;
    map.name.clone_from(&lesson.map);
    lesson.check(&map)?;
    let place = NamedWorld::new(&map, &lesson.robot, &lesson.noise)?;
    let within =
        lesson.within.map(|[x0, y0, x1, y1]| Area { min: Point::new(x0, y0), max: Point::new(x1, y1) });
    let [index, count] = lesson.part;
    let part = Part { index, count };
    let share = match lesson.round {
        LessonRound::Options => BuildingShare { within, options: part, hand_overs: Part::NONE },
        LessonRound::HandOvers => BuildingShare { within, options: Part::NONE, hand_overs: part },
    };
    let learnt = learn(&place, &lesson.settings()?, &dir.join(&lesson.library), share, &Watched(monitor))?;
    if monitor.should_stop() {
        return Ok(Ended::Interrupted);
    }
    if lesson.round == LessonRound::HandOvers && learnt.report.learnt < learnt.report.options {
        let missing = learnt.report.options - learnt.report.learnt;
        let problem =
            format!("{missing} options of the building are missing, the lessons on options come first");
        return Err(BenchError::Engine(problem));
    }
    let text = to_json(&LessonMark::of(job)) + "\n";
    write_atomic(&mark(dir, job), text.as_bytes())?;
    Ok(Ended::Done)
}

/// Returns true if the lesson `job` of the manifest in `dir` is finished.
pub(super) fn is_done(dir: &Path, job: &Job) -> Result<bool, BenchError> {
    let path = mark(dir, job);
    match std::fs::read_to_string(&path) {
        Ok(text) if serde_json::from_str::<LessonMark>(&text).ok() == Some(LessonMark::of(job)) => Ok(true),
        Ok(_) => {
            let path = path.display();
            Err(BenchError::Folder(format!(
                "{path}: damaged or of another job; remove it to do the job again"
            )))
        }
        Err(_) => Ok(false),
    }
}

fn mark(dir: &Path, job: &Job) -> PathBuf {
    dir.join("jobs").join(&job.name).join("done.json")
}

impl LessonMark {
    fn of(job: &Job) -> Self {
        Self { schema: SCHEMA.to_owned(), job: job.key.clone() }
    }
}

/// What watches a lesson.
struct Watched<'a>(&'a dyn EngineMonitor);

impl BuildingMonitor for Watched<'_> {
    fn planned(&self, options: usize, hand_overs: usize) {
        self.0.building().planned(options, hand_overs);
    }

    fn option(&self, option: &RosterOption, learnt: &LearntPolicy) {
        self.0.building().option(option, learnt);
    }

    fn hand_over(&self, hand_over: &HandOver) {
        self.0.building().hand_over(hand_over);
    }

    fn should_stop(&self) -> bool {
        self.0.should_stop()
    }
}
