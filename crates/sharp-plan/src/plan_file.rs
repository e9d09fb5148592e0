//! A plan on disk: everything that running it takes, and nothing about when it was made.

use std::path::Path;
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use sharp_drive::{Prior, SpeedLimits, SuccessCount, SuccessEstimate, World};
use sharp_guide::{Departure, Goal, GuidePath, GuidedOption, LegId, OptionSpace};
use sharp_options::{OptionKind, OptionSettings};
use sharp_rbvd::{Rbvd, StateAbstraction, StateId};
use sharp_sim::{NoiseModel, RobotModel};
use sharp_space::{OccupancyGrid, Pose, Seed};

use crate::abstraction::Abstraction;
use crate::files::{self, FileError};
use crate::learn::{LearntPolicy, Training};
use crate::library::{FORMAT, PolicyFile};
use crate::method::{Method, SearchSettings};
use crate::odds::ComposedOdds;
use crate::price::Pricer;
use crate::query::Query;
use crate::search::goal_of;
use crate::tour::TOUR_FILE;
use crate::verify::{PlannedOption, Solution};

pub(crate) const PLAN_FILE: &str = "plan.ron";
const ABSTRACTION_FILE: &str = "abstraction.ron";

/// How an abstraction was made: what a file needs beside the states.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct AbstractionFile {
    format: u32,
    /// Hash of the map it belongs to.
    pub map: String,
    /// Where the regions came from.
    pub regions: String,
    /// The kind of its options.
    pub kind: OptionKind,
    /// How the options were made.
    pub options: OptionSettings,
    /// The states.
    pub rbvd: Rbvd,
}

impl AbstractionFile {
    /// A file for the map hashed as `map`, its regions made by `regions`. States that are no diagram are stored as
    /// one, with the same cells, regions and portals.
    #[must_use]
    pub fn new(
        map: String,
        regions: String,
        kind: OptionKind,
        options: OptionSettings,
        states: &dyn StateAbstraction,
    ) -> Self {
        Self { format: FORMAT, map, regions, kind, options, rbvd: Rbvd::from_abstraction(states) }
    }

    /// Writes it to `path`.
    ///
    /// # Errors
    /// Returns an error that names the file if it cannot be written.
    pub fn save(&self, path: &Path) -> Result<(), FileError> {
        files::write_ron(path, self)
    }

    /// Reads it from `path`, for the map hashed as `map`.
    ///
    /// # Errors
    /// Returns an error that names the file if it is damaged, of another format or for another map.
    pub fn load(path: &Path, map: &str) -> Result<Self, FileError> {
        let file: Self = files::read_ron(path)?;
        check_header(path, (file.format, &file.map), map)?;
        Ok(file)
    }

    /// The abstraction, its options synthesised again.
    #[must_use]
    pub fn abstraction(&self) -> Abstraction {
        let states = Arc::new(self.rbvd.clone());
        let options = sharp_options::OptionSet::synthesize(&*states, self.kind, &self.options);
        Abstraction { states, options: Arc::new(options) }
    }
}

/// Refuses a file of another format or for another map.
fn check_header(path: &Path, (format, found): (u32, &str), map: &str) -> Result<(), FileError> {
    if format != FORMAT {
        return Err(FileError::content(path, format!("format is {format}, expected {FORMAT}")));
    }
    if found != map {
        return Err(FileError::content(path, "belongs to another map"));
    }
    Ok(())
}

/// The hash that names a map: its frame and its cells.
#[must_use]
pub fn map_hash(grid: &OccupancyGrid) -> String {
    let frame = grid.frame();
    let mut bytes = format!("{}x{} {:?} {:?}\n", frame.width, frame.height, frame.resolution_m, frame.origin)
        .into_bytes();
    bytes.extend(grid.cells().iter().map(|&cell| cell as u8));
    files::hash(&bytes)
}

/// A solution with the world it was made in.
#[derive(Clone, Debug)]
pub struct Plan {
    /// Map and robot.
    pub world: World,
    /// The abstraction it was searched in.
    pub abstraction: Abstraction,
    /// The noise it was verified under.
    pub noise: NoiseModel,
    /// How it was made, and how it goes on where the robot has to recover.
    pub method: Method,
    /// The seed it was made with.
    pub seed: Seed,
    /// The composed policy.
    pub solution: Solution,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct PlanFile {
    format: u32,
    map: String,
    robot: RobotModel,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    speed_limits: Option<SpeedLimits>,
    /// The file of a prior that is not the shipped one; recovery drives by it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    prior: Option<String>,
    noise: NoiseModel,
    method: String,
    search: SearchSettings,
    failure_cost_s: f64,
    seed: Seed,
    start: Pose,
    goal: Pose,
    predicted: SuccessCount,
    predicted_time_s: f64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    composed: Option<ComposedOdds>,
    steps: Vec<StepFile>,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct StepFile {
    id: LegId,
    from: StateId,
    to: StateId,
    guide: GuidePath,
    #[serde(default, skip_serializing_if = "Departure::is_none")]
    departure: Departure,
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    ends_in_passing: bool,
    policy: PolicyFile,
    verified: SuccessCount,
    mean_time_s: f64,
    on_arrival: SuccessCount,
    arrival_time_s: f64,
    env_steps: u64,
    gradient_steps: u64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    training: Option<Training>,
    reused: bool,
}

impl Plan {
    /// What each leg of the plan is taken to cost before it is measured, seconds, without surcharges.
    #[must_use]
    pub fn prices_s(&self) -> Vec<f64> {
        let Self { world, noise, method, solution, .. } = self;
        let pricer = Pricer::new(world, noise, method.search, method.failure_cost_s);
        let price_s = |(index, step): (usize, &PlannedOption)| {
            let next = solution.steps.get(index + 1).map(|next| &next.option.guide);
            pricer.cost_s(&pricer.price(&step.option, next), None)
        };
        solution.steps.iter().enumerate().map(price_s).collect()
    }

    /// Writes the plan into `folder`, in place of any plan or tour there; the abstraction stands beside it as
    /// `abstraction`.
    ///
    /// # Errors
    /// Returns an error that names the file that could not be written, or says that its options are of a family from
    /// outside: no file holds those.
    pub fn save(&self, folder: &Path, abstraction: &AbstractionFile) -> Result<(), FileError> {
        let path = folder.join(PLAN_FILE);
        if abstraction.kind == OptionKind::Custom {
            return Err(FileError::content(&path, "options of a family from outside cannot be stored"));
        }
        files::write_ron_under(&folder.join(ABSTRACTION_FILE), abstraction, &path)?;
        let steps = self.solution.steps.iter().map(|step| step_file(step, folder));
        let prior = self.world.own_prior.as_deref();
        let prior = prior.map(|prior| files::write_blob(folder, &prior.to_bytes(), "safetensors"));
        let file = PlanFile {
            format: FORMAT,
            map: map_hash(&self.world.grid),
            robot: (*self.world.robot).clone(),
            speed_limits: self.world.speed_limits.as_deref().cloned(),
            prior: prior.transpose()?,
            noise: self.noise.clone(),
            method: self.method.name.clone(),
            search: self.method.search,
            failure_cost_s: self.method.failure_cost_s,
            seed: self.seed,
            start: self.solution.query.start,
            goal: self.solution.query.goal,
            predicted: self.solution.predicted,
            predicted_time_s: self.solution.predicted_time_s,
            composed: self.solution.composed.clone(),
            steps: steps.collect::<Result<_, _>>()?,
        };
        files::write_ron(&path, &file)?;
        // Of an earlier plan to several goals.
        files::remove(&folder.join(TOUR_FILE))
    }

    /// Reads the plan in `folder`, made in `grid`.
    ///
    /// # Errors
    /// Returns an error that names the file that is missing, damaged, of another format or for another map.
    pub fn load(folder: &Path, grid: OccupancyGrid) -> Result<Self, FileError> {
        let path = folder.join(PLAN_FILE);
        let file: PlanFile = files::read_ron(&path)?;
        let map = map_hash(&grid);
        check_header(&path, (file.format, &file.map), &map)?;
        let abstraction = AbstractionFile::load(&folder.join(ABSTRACTION_FILE), &map)?.abstraction();
        let method = Method::of_plan(file.method, file.search, file.failure_cost_s);
        let space = abstraction.space(method.search.allowed);
        let world = World::new(grid, file.robot);
        let world = match file.speed_limits {
            Some(limits) => world.with_speed_limits(limits),
            None => world,
        };
        let world = match file.prior {
            Some(name) => {
                let prior = Prior::from_bytes(&files::read_blob(folder, &name)?);
                world.with_prior(prior.map_err(|error| FileError::content(&folder.join(&name), error))?)
            }
            None => world,
        };
        let goal = goal_of(file.goal, &world, method.search.goal_heading_tolerance_rad);
        if let Some(step) = file.steps.iter().find(|step| !is_known(step, &space)) {
            let StepFile { id, from, to, .. } = step;
            let problem = format!(
                "step {id} from state {} to state {}: the abstraction has no such step",
                from.0, to.0
            );
            return Err(FileError::content(&path, problem));
        }
        let steps = file.steps.into_iter().map(|step| planned_option(step, folder, &space, goal.clone()));
        let steps = steps.collect::<Result<Vec<_>, _>>()?;
        if steps.is_empty() {
            return Err(FileError::content(&path, "steps is empty, expected at least one"));
        }
        let query = Query { start: file.start, goal: file.goal };
        let (predicted, predicted_time_s, composed) = (file.predicted, file.predicted_time_s, file.composed);
        Ok(Self {
            world,
            abstraction,
            noise: file.noise,
            method,
            seed: file.seed,
            solution: Solution { query, steps, predicted, predicted_time_s, composed },
        })
    }
}

fn step_file(step: &PlannedOption, folder: &Path) -> Result<StepFile, FileError> {
    let PlannedOption { option, learnt, reused, on_arrival, arrival_time_s } = step;
    Ok(StepFile {
        id: option.id,
        from: option.from,
        to: option.to,
        guide: option.guide.clone(),
        departure: option.departure,
        ends_in_passing: option.ends_in_passing,
        policy: PolicyFile::save(&learnt.policy, folder)?,
        verified: learnt.estimate.count,
        mean_time_s: learnt.estimate.mean_time_s,
        on_arrival: *on_arrival,
        arrival_time_s: *arrival_time_s,
        env_steps: learnt.env_steps,
        gradient_steps: learnt.gradient_steps,
        training: learnt.training.clone(),
        reused: *reused,
    })
}

/// Returns true if the abstraction has what the step names.
fn is_known(step: &StepFile, space: &OptionSpace) -> bool {
    let is_endpoint = |index: u32| (index as usize) < space.options.endpoints().len();
    let is_state = |state: StateId| (state.0 as usize) < space.states.len();
    let is_leg = match step.id {
        LegId::First(endpoint) => is_endpoint(endpoint),
        LegId::Option(id) => space.options.get(id).is_some(),
        LegId::Last(endpoint, state) => is_endpoint(endpoint) && is_state(state),
        LegId::Direct => true,
    };
    is_leg && is_state(step.from) && is_state(step.to)
}

fn planned_option(
    file: StepFile,
    folder: &Path,
    space: &OptionSpace,
    goal: Goal,
) -> Result<PlannedOption, FileError> {
    let learnt = LearntPolicy {
        policy: file.policy.load(folder)?,
        estimate: SuccessEstimate { count: file.verified, mean_time_s: file.mean_time_s },
        env_steps: file.env_steps,
        gradient_steps: file.gradient_steps,
        training: file.training,
    };
    let option = GuidedOption::new(space, file.id, (file.from, file.to), file.guide, goal)
        .with_departure(file.departure);
    let option = GuidedOption { ends_in_passing: file.ends_in_passing, ..option };
    Ok(PlannedOption {
        option: Arc::new(option),
        learnt,
        reused: file.reused,
        on_arrival: file.on_arrival,
        arrival_time_s: file.arrival_time_s,
    })
}

#[cfg(test)]
mod tests {
    use sharp_options::OptionKind;

    use super::*;
    use crate::test_worlds::{self, HALL, SEALED};
    use crate::tour::Tour;

    fn saved(kind: OptionKind) -> (Arc<Plan>, tempfile::TempDir) {
        let plan = test_worlds::plan(kind);
        let folder = folder_of(&plan, kind);
        (plan, folder)
    }

    fn folder_of(plan: &Plan, kind: OptionKind) -> tempfile::TempDir {
        let map = map_hash(&plan.world.grid);
        let file = AbstractionFile::new(
            map,
            "drawn".to_owned(),
            kind,
            OptionSettings::default(),
            &*plan.abstraction.states,
        );
        let folder = tempfile::tempdir().unwrap();
        plan.save(folder.path(), &file).unwrap();
        folder
    }

    #[test]
    fn a_plan_keeps_a_prior_of_its_own() {
        let plan = Plan::clone(&test_worlds::plan(OptionKind::Centroid));
        let read = |plan: &Plan| {
            let folder = folder_of(plan, OptionKind::Centroid);
            Plan::load(folder.path(), (*plan.world.grid).clone()).unwrap().world.own_prior
        };
        assert_eq!(read(&plan), None, "the shipped one is in the program");
        let other = Prior::shipped(&RobotModel::limo());
        let world = plan.world.clone().with_prior(other.clone());
        assert_eq!(read(&Plan { world, ..plan }).as_deref(), Some(other));
    }

    #[test]
    fn a_plan_survives_a_round_trip() {
        for kind in [OptionKind::Centroid, OptionKind::Interface] {
            let (plan, folder) = saved(kind);
            let read = Plan::load(folder.path(), (*plan.world.grid).clone()).unwrap();
            assert_eq!(read.solution.query, plan.solution.query, "{kind:?}");
            assert_eq!(*read.world.robot, *plan.world.robot, "{kind:?}");
            assert_eq!((&*read.method.name, read.method.search), ("fast", plan.method.search), "{kind:?}");
            for (read, written) in read.solution.steps.iter().zip(&plan.solution.steps) {
                assert_eq!(read.option.id, written.option.id, "{kind:?}");
                assert_eq!(read.option.guide, written.option.guide, "{}", written.option.id);
                assert_eq!(read.option.target, written.option.target, "{}", written.option.id);
                assert_eq!(read.option.source, written.option.source, "{}", written.option.id);
            }
            assert_eq!(read.solution.steps.len(), plan.solution.steps.len(), "{kind:?}");
        }
    }

    #[test]
    fn a_folder_holds_the_last_plan_or_tour_and_nothing_of_those_before() {
        let (plan, folder) = saved(OptionKind::Centroid);
        let folder = folder.path();
        let file = |kind: OptionKind| {
            let (map, settings) = (map_hash(&plan.world.grid), OptionSettings::default());
            AbstractionFile::new(map, "drawn".to_owned(), kind, settings, &*plan.abstraction.states)
        };
        let has = |name: &str| folder.join(name).exists();
        let tour = Tour::from(Arc::clone(&plan));
        tour.save(folder).unwrap();
        assert_eq!([PLAN_FILE, TOUR_FILE].map(has), [false, true], "a tour takes the place of a plan");
        plan.save(folder, &file(OptionKind::Centroid)).unwrap();
        assert_eq!([PLAN_FILE, TOUR_FILE].map(has), [true, false], "and a plan that of a tour");
        let owner = folder.join(PLAN_FILE);
        let abstraction = folder.join(ABSTRACTION_FILE);
        files::write_ron_under(&abstraction, &file(OptionKind::Centroid), &owner).unwrap();
        assert!(has(PLAN_FILE), "it still holds with the abstraction as it is");
        files::write_ron_under(&abstraction, &file(OptionKind::Interface), &owner).unwrap();
        assert!(!has(PLAN_FILE), "no plan stands beside an abstraction that is not its own");
    }

    #[test]
    fn a_plan_for_another_map_is_refused() {
        let (_, folder) = saved(OptionKind::Centroid);
        let (other, _) = test_worlds::world(SEALED, OptionKind::Centroid);
        let error = Plan::load(folder.path(), (*other.grid).clone()).unwrap_err().to_string();
        assert!(error.contains("plan.ron") && error.contains("another map"), "{error}");
    }

    /// Fuzzing found it: a number out of range in a plan whose checksum fits ended the program.
    #[test]
    fn a_plan_that_names_what_the_abstraction_lacks_is_refused() {
        let (plan, folder) = saved(OptionKind::Centroid);
        let path = folder.path().join(PLAN_FILE);
        let mut file: PlanFile = files::read_ron(&path).unwrap();
        let sound = file.steps[0].id;
        for id in [LegId::First(900), LegId::Last(900, StateId(0)), LegId::Last(0, StateId(900))] {
            file.steps[0].id = id;
            files::write_ron(&path, &file).unwrap();
            let error = Plan::load(folder.path(), (*plan.world.grid).clone()).unwrap_err().to_string();
            assert!(error.contains("plan.ron: step ") && error.contains("no such step"), "{error}");
        }
        (file.steps[0].id, file.steps[0].to) = (sound, StateId(900));
        files::write_ron(&path, &file).unwrap();
        let error = Plan::load(folder.path(), (*plan.world.grid).clone()).unwrap_err().to_string();
        assert!(error.contains("to state 900"), "{error}");
    }

    #[test]
    fn one_cell_or_one_metre_makes_another_map() {
        let grid = |drawing: &str, resolution_m| OccupancyGrid::from_ascii(resolution_m, drawing).unwrap();
        let hash = map_hash(&grid("##\n.#", 0.4));
        assert_eq!(hash, map_hash(&grid("##\n.#", 0.4)), "the same map");
        for other in [grid("##\n..", 0.4), grid("##\n.#", 0.5), grid("##\n?#", 0.4), grid("##.#", 0.4)] {
            assert_ne!(hash, map_hash(&other), "{other:?}");
        }
    }

    #[test]
    fn the_options_of_an_abstraction_are_made_again_the_same() {
        let (_, abstraction) = test_worlds::world(HALL, OptionKind::Interface);
        let (settings, kind) = (OptionSettings::default(), OptionKind::Interface);
        let file =
            AbstractionFile::new("m".to_owned(), "drawn".to_owned(), kind, settings, &*abstraction.states);
        assert_eq!(file.abstraction().options, abstraction.options);
    }
}
