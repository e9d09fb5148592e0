//! Solving one problem whole: library, abstraction, Algorithm 1, report, and the folder of the plan.

use std::path::{Path, PathBuf};
use std::sync::Arc;

use sharp_options::OptionKind;
use sharp_plan::{
    AbstractionFile, AbstractionSettings, Answer, LibraryKey, Method, Monitor, OptionLibrary, Phase, Plan,
    Sharp, Tour, hash, map_hash, success, write_atomic,
};
use sharp_rbvd::CellMetric;
use sharp_sim::{NoiseModel, SimulatorKind};
use sharp_space::Seed;

use crate::error::BenchError;
use crate::json::to_json;
use crate::named::{DETECTORS, NamedProblem, detector};
use crate::pictures;
use crate::reports::{MapReport, SolveReport, Verified};
use crate::result::default_regions;
use crate::stopwatch::TimedMonitor;
use crate::times::{Reuse, SolveTimes};
use crate::tour::{forget_plans, has_tour};
use sharp_drive::World;

/// The status of a solve that was stopped without a plan.
const TIMEOUT: &str = "timeout";
/// A plan that succeeds less often is run with recovery as well.
const SHAKY: f64 = 0.98;
/// In so many episodes.
const RECOVERY_RUNS: u32 = 100;

/// How the abstraction of a map is made.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct AbstractionRequest {
    /// The kind of option.
    pub options: OptionKind,
    /// A detector's name, or a file of places: see [`named::detector`](crate::named::detector).
    pub regions: String,
    /// The distances of the diagram.
    pub metric: CellMetric,
}

/// How a problem is solved.
#[derive(Clone, Debug)]
pub struct SolveSettings {
    /// How the abstraction is made, where the library does not have it yet.
    pub abstraction: AbstractionRequest,
    /// How options get policies, how plans are searched, checked and repaired.
    pub method: Method,
    /// The simulator in which policies are learnt and the plan is verified.
    pub simulator: SimulatorKind,
    /// Root of all randomness.
    pub seed: u64,
}

/// Where a solve keeps what lasts.
#[derive(Clone, Copy, Debug, Default)]
pub struct SolveFolders<'a> {
    /// The library; without it the solve begins with nothing and keeps nothing.
    pub library: Option<&'a Path>,
    /// Where trainings are kept while they run ([`Method::keeps_trainings`]); `None` for the library's own folder.
    pub trainings: Option<&'a Path>,
}

impl<'a> From<Option<&'a Path>> for SolveFolders<'a> {
    fn from(library: Option<&'a Path>) -> Self {
        Self { library, trainings: None }
    }
}

/// What solving gave.
#[derive(Debug)]
pub struct Solved {
    /// What `solve.json` holds.
    pub report: SolveReport,
    /// The plan, if there is one.
    pub plan: Option<Plan>,
    /// The robot in its building, with what it knows.
    sharp: Sharp,
    file: AbstractionFile,
    /// Where the library keeps the picture of the abstraction, without extension.
    picture: Option<PathBuf>,
}

/// Algorithm 1 on `problem`, with what the library holds.
///
/// Nothing is written but trainings that take minutes ([`Method::keeps_trainings`]) and, into the library, the abstraction:
/// [`Solved::write`] and [`Solved::save_library`] do the rest.
///
/// # Errors
/// If the robot does not fit at an end of the problem or nowhere in the map, or a file is broken.
pub fn solve(
    problem: &NamedProblem,
    settings: &SolveSettings,
    folders: SolveFolders<'_>,
    monitor: &TimedMonitor<'_>,
) -> Result<Solved, BenchError> {
    let NamedProblem { world, query, noise_model, .. } = problem;
    let SolveSettings { abstraction, method, simulator, seed } = settings;
    query.check(world)?;
    let library = settings.library(world, noise_model, folders)?;
    let picture = library.folder().map(|folder| folder.join(abstraction.file_name()).with_extension(""));
    monitor.phase(Phase::Done);
    let (sharp, file) = prepare(world.clone(), abstraction, library.folder(), monitor)?;
    let mut sharp = sharp
        .with_method(method.clone())
        .with_noise(noise_model.clone())
        .with_simulator(world.simulator(*simulator))
        .with_library(library)
        .with_seed(Seed(*seed));
    let answer = sharp.solve(*query, monitor)?;
    let report = blank_report(problem, settings, &mut sharp, &file)?;
    let (mut report, plan) = answered(report, answer);
    if let (Some(predicted), Some(plan)) = (&mut report.predicted, &plan) {
        monitor.phase(Phase::Verify);
        let tour = Arc::new(plan.clone()).into();
        predicted.with_recovery = with_recovery(&tour, settings);
        predicted.with_contact = with_contact(&tour, settings);
    }
    if report.status == TIMEOUT {
        report.trainings = monitor.trainings();
    }
    monitor.phase(Phase::Done);
    let report = SolveReport { time_s: monitor.times(), ..report };
    Ok(Solved { report, plan, sharp, file, picture })
}

/// How often `tour` arrives where the robot may plan anew on the way, if it often has to; `None` for methods that stick to
/// their plan or run none.
pub(crate) fn with_recovery(tour: &Tour, settings: &SolveSettings) -> Option<Verified> {
    let method = &settings.method;
    let is_run = tour.plans.iter().all(|plan| plan.solution.composed.is_none());
    if method.keeps_all() || !is_run || tour.predicted.rate() >= SHAKY {
        return None;
    }
    let first = &tour.plans[0];
    let mut runs = tour.run_settings(RECOVERY_RUNS, first.seed.child("with recovery", 0));
    runs.simulator = first.world.simulator(settings.simulator);
    Some(success(&tour.run(&runs, &|| 0.0)).into())
}

/// How often `tour` arrives where the robot may touch walls; `None` for methods that do not learn so.
fn with_contact(tour: &Tour, settings: &SolveSettings) -> Option<Verified> {
    settings.method.keeps_all().then(|| {
        let first = &tour.plans[0];
        let mut runs = tour.run_settings(RECOVERY_RUNS, first.seed.child("with contact", 0));
        runs.simulator = first.world.simulator(settings.simulator);
        (runs.contact_ends, runs.recovery) = (false, false);
        success(&tour.run(&runs, &|| 0.0)).into()
    })
}

/// A robot in `world` with the abstraction that `request` asks for: from the folder `cache` if that has it, else made
/// and kept there.
///
/// # Errors
/// If the detector is not known, the map has no room for the robot, or a file is broken.
pub fn prepare(
    world: World,
    request: &AbstractionRequest,
    cache: Option<&Path>,
    monitor: &dyn Monitor,
) -> Result<(Sharp, AbstractionFile), BenchError> {
    let map = map_hash(&world.grid);
    let settings = AbstractionSettings { metric: request.metric, ..AbstractionSettings::new(&world) };
    let detector = detector(&world, &request.regions)?;
    let mut sharp =
        Sharp::new(world, detector).with_options(request.options).with_abstraction_settings(settings);
    let path = cache.map(|folder| folder.join(request.file_name()));
    if let Some(path) = path.as_deref().filter(|path| path.exists()) {
        monitor.phase(Phase::Abstraction);
        let file = AbstractionFile::load(path, &map)?;
        return Ok((sharp.with_abstraction(file.abstraction(), &file.regions), file));
    }
    let file = sharp.abstraction_file(monitor)?;
    if let Some(path) = path {
        // A picture beside it would be of an older abstraction.
        pictures::forget(&path.with_extension(""));
        file.save(&path)?;
    }
    Ok((sharp, file))
}

impl AbstractionRequest {
    /// Under which name a library keeps it.
    fn file_name(&self) -> String {
        format!("abstraction-{:?}-{:?}-{}.ron", self.options, self.metric, self.regions_name()).to_lowercase()
    }

    /// The detector, or the file of places by its content.
    fn regions_name(&self) -> String {
        match self.regions.as_str() {
            name if DETECTORS.contains(&name) => name.to_owned(),
            file => hash(&std::fs::read(file).unwrap_or_default())[..8].to_owned(),
        }
    }

    /// What tells the states apart from those of other settings; empty for the usual ones, so that libraries from before
    /// there was such a name stay valid.
    fn states_name(&self) -> String {
        let usual = (default_regions(), CellMetric::default());
        if (&self.regions, self.metric) == (&usual.0, usual.1) {
            return String::new();
        }
        format!("{} {:?}", self.regions_name(), self.metric)
    }
}

impl SolveSettings {
    /// The library in `folders` for what is learnt in `world` under `noise`; without a folder one that is kept nowhere.
    ///
    /// # Errors
    /// Names the file that is damaged or of another format.
    pub fn library(
        &self,
        world: &World,
        noise: &NoiseModel,
        folders: SolveFolders<'_>,
    ) -> Result<OptionLibrary, BenchError> {
        let states = self.abstraction.states_name();
        let Self { method, simulator, .. } = self;
        let key = LibraryKey { world, noise, simulator: *simulator, method, states: &states };
        let opened = |root| OptionLibrary::open_for(root, &key);
        let library = folders.library.map_or_else(|| Ok(OptionLibrary::in_memory()), opened)?;
        Ok(match folders.trainings {
            Some(root) => library.with_trainings(root, &key),
            None => library,
        })
    }
}

/// Removes what was driven with an earlier plan in `folder`, as far as it can be removed: beside another plan it would be
/// taken for that one's.
pub(crate) fn forget_drives(folder: &Path) {
    for file in ["run.json", "show.html"] {
        let _ = std::fs::remove_file(folder.join(file));
    }
    pictures::forget(&folder.join("run"));
}

/// `report` with what `answer` says.
pub(crate) fn answered(report: SolveReport, answer: Answer) -> (SolveReport, Option<Plan>) {
    match answer {
        Answer::Solved(plan) => (report.with_plan(&plan), Some(*plan)),
        Answer::NoPlan(reason) => (SolveReport { reason: Some(reason), ..report }, None),
        Answer::Stopped => {
            let reason = "stopped before a plan was verified; what was learnt is kept".to_owned();
            (SolveReport { status: TIMEOUT, reason: Some(reason), ..report }, None)
        }
    }
}

pub(crate) fn blank_report(
    problem: &NamedProblem,
    settings: &SolveSettings,
    sharp: &mut Sharp,
    file: &AbstractionFile,
) -> Result<SolveReport, BenchError> {
    let options_available = sharp.abstraction(&())?.options.options().len();
    let method = &settings.method;
    Ok(SolveReport {
        schema: "sharp.solve/1",
        status: "no_plan",
        reason: None,
        robot: problem.world.robot.name.clone(),
        options: file.kind.name(),
        learning: method.name.clone(),
        cost_update: if method.search.cost_update { "on" } else { "off" },
        noise: problem.noise.clone(),
        simulator: settings.simulator.to_string(),
        seed: settings.seed,
        library: sharp.library().folder().map_or("none".to_owned(), |folder| folder.display().to_string()),
        map: MapReport::new(&problem.map, &problem.world.grid),
        regions: file.regions.clone(),
        states: file.rbvd.len(),
        options_available,
        goals: vec![],
        plan: vec![],
        trainings: vec![],
        reuse: Reuse { uses: 0, reused: 0 },
        predicted: None,
        time_s: SolveTimes::default(),
        plan_dir: None,
    })
}

impl Solved {
    /// Writes the plan, its map, its pictures and the report into `folder`, which the report calls `name`, in place of an
    /// earlier plan and of what was driven with it. Does nothing without a plan.
    ///
    /// # Errors
    /// If a picture cannot be drawn or a file cannot be written.
    pub fn write(&mut self, folder: &Path, name: &Path) -> Result<(), BenchError> {
        let Self { report, plan, file, picture, .. } = self;
        let Some(plan) = plan else { return Ok(()) };
        report.plan_dir = Some(name.display().to_string());
        let had_tour = has_tour(folder);
        forget_drives(folder);
        plan.save(folder, file)?;
        if had_tour {
            forget_plans(folder, 0);
        }
        let grid = &plan.world.grid;
        sharp_maps::save_ros(grid, &folder.join("map.yaml"))?;
        let (of_states, of_plan) = rayon::join(
            || {
                pictures::write_kept(folder, "abstraction", picture.as_deref(), &|| {
                    pictures::abstraction(grid, &plan.abstraction)
                })
            },
            || pictures::write(folder, "plan", &pictures::plan(plan, &plan.solution.query, &[])),
        );
        of_states.and(of_plan)?;
        write_atomic(&folder.join("solve.json"), (to_json(report) + "\n").as_bytes())?;
        Ok(())
    }

    /// The options learnt so far.
    #[must_use]
    pub const fn library(&self) -> &OptionLibrary {
        self.sharp.library()
    }

    /// Writes what was learnt into the library.
    ///
    /// # Errors
    /// If a file cannot be written.
    pub fn save_library(&mut self) -> Result<(), BenchError> {
        Ok(self.sharp.library_mut().save()?)
    }
}
