//! The façade: from a map to a plan, and from one problem to the next.

use std::fmt;
use std::sync::Arc;

use sharp_drive::World;
use sharp_options::{OptionFamily, OptionKind};
use sharp_rbvd::RbvdError;
use sharp_sim::{NoiseModel, Simulator};
use sharp_space::{Detection, RegionDetector, Seed};
use thiserror::Error;

use crate::abstraction::{Abstraction, AbstractionSettings, construct};
use crate::algorithm::{Outcome, solve_with};
use crate::building::{BuildingMonitor, BuildingShare, BuildingTask, BuildingWork, LearningSite};
use crate::conditions::Conditions;
use crate::files::FileError;
use crate::known::KnownOptions;
use crate::library::OptionLibrary;
use crate::method::Method;
use crate::plan_file::{AbstractionFile, Plan, map_hash};
use crate::problem::PlanningProblem;
use crate::query::{Monitor, Query};
use crate::roster::{Area, Roster};

/// A robot in a building that solves problem after problem and keeps what it learns.
pub struct Sharp {
    world: World,
    detector: Arc<dyn RegionDetector>,
    family: Arc<dyn OptionFamily>,
    kind: OptionKind,
    settings: AbstractionSettings,
    method: Method,
    conditions: Conditions,
    /// Whether the simulator was chosen, or is the method's.
    has_own_simulator: bool,
    library: OptionLibrary,
    built: Option<Built>,
    /// What the library knows here, and which version of it.
    known: Option<(u64, Arc<KnownOptions>)>,
    seed: Seed,
}

/// What lines 4 to 7 made, and where the regions came from.
#[derive(Debug)]
struct Built {
    abstraction: Abstraction,
    source: String,
    detection: Option<Detection>,
}

/// How a problem ended.
#[derive(Debug)]
pub enum Answer {
    /// With a plan.
    Solved(Box<Plan>),
    /// There is none; says why.
    NoPlan(String),
    /// The monitor stopped it; what was learnt is kept.
    Stopped,
}

/// Why a problem could not be worked on.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum SolveError {
    /// The map has no room for the robot.
    #[error("map has no room for the {robot}: {source}")]
    NoRoom {
        /// The robot's name.
        robot: String,
        /// What is wrong.
        source: RbvdError,
    },
    /// There is nothing to learn in an area of the map.
    #[error(
        "no option has both its ends in the area from ({}, {}) to ({}, {}), of {options} that the building has",
        area.min.x, area.min.y, area.max.x, area.max.y
    )]
    NothingWithin {
        /// The area.
        area: Area,
        /// Options of the whole building.
        options: usize,
    },
    /// The library cannot be written.
    #[error(transparent)]
    File(#[from] FileError),
}

impl fmt::Debug for Sharp {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Sharp").field("method", &self.method.name).finish_non_exhaustive()
    }
}

impl Sharp {
    /// The robot of `world`, whose critical regions `detector` finds. It solves by [`Method::fast`] with interface
    /// options under nominal noise, and keeps what it learns in memory.
    #[must_use]
    pub fn new(world: World, detector: impl RegionDetector + 'static) -> Self {
        let (settings, conditions) =
            (AbstractionSettings::new(&world), Conditions::new(&world, NoiseModel::nominal()));
        Self {
            world,
            detector: Arc::new(detector),
            family: Arc::new(sharp_options::InterfaceOptions),
            kind: OptionKind::Interface,
            settings,
            method: Method::default(),
            conditions,
            has_own_simulator: false,
            library: OptionLibrary::in_memory(),
            built: None,
            known: None,
            seed: Seed(1),
        }
    }

    /// The same with another method, in its simulator unless another was chosen.
    #[must_use]
    pub fn with_method(mut self, method: Method) -> Self {
        if !self.has_own_simulator {
            self.conditions.simulator = self.world.simulator(method.simulator);
        }
        Self { method, known: None, ..self }
    }

    /// The same with options of `kind`, one of ours.
    #[must_use]
    pub fn with_options(self, kind: OptionKind) -> Self {
        match kind.family() {
            Some(family) => Self { family: Arc::new(family), kind, built: None, known: None, ..self },
            None => self,
        }
    }

    /// The same with options of a family from outside.
    #[must_use]
    pub fn with_family(self, family: Arc<dyn OptionFamily>) -> Self {
        Self { family, kind: OptionKind::Custom, built: None, known: None, ..self }
    }

    /// The same with states and options that are known already, which came from `source`.
    #[must_use]
    pub fn with_abstraction(self, abstraction: Abstraction, source: &str) -> Self {
        let built = Some(Built { abstraction, source: source.to_owned(), detection: None });
        Self { built, known: None, ..self }
    }

    /// The same with other settings for building the abstraction.
    #[must_use]
    pub fn with_abstraction_settings(self, settings: AbstractionSettings) -> Self {
        Self { settings, built: None, known: None, ..self }
    }

    /// The same under another noise.
    #[must_use]
    pub fn with_noise(self, noise: NoiseModel) -> Self {
        Self { conditions: Conditions { noise, ..self.conditions }, known: None, ..self }
    }

    /// The same with policies learnt and verified in forks of `simulator`, which may be anybody's.
    #[must_use]
    pub fn with_simulator(self, simulator: Box<dyn Simulator>) -> Self {
        let conditions = self.conditions.with_simulator(simulator);
        Self { conditions, has_own_simulator: true, ..self }
    }

    /// The same with the options of `library`, which also keeps what is learnt.
    #[must_use]
    pub fn with_library(self, library: OptionLibrary) -> Self {
        Self { library, known: None, ..self }
    }

    /// The same with another root of all randomness.
    #[must_use]
    pub fn with_seed(self, seed: Seed) -> Self {
        Self { seed, ..self }
    }

    /// Map and robot.
    #[must_use]
    pub const fn world(&self) -> &World {
        &self.world
    }

    /// The options learnt so far.
    #[must_use]
    pub const fn library(&self) -> &OptionLibrary {
        &self.library
    }

    /// The options learnt so far, to be written.
    pub const fn library_mut(&mut self) -> &mut OptionLibrary {
        &mut self.library
    }

    /// What the detector found, if it was asked.
    #[must_use]
    pub fn detection(&self) -> Option<&Detection> {
        self.built.as_ref().and_then(|built| built.detection.as_ref())
    }

    /// The states and options of the map; lines 4 to 7 build them the first time.
    ///
    /// # Errors
    /// If the map has no room for the robot.
    pub fn abstraction(&mut self, monitor: &dyn Monitor) -> Result<&Abstraction, SolveError> {
        // 4: if the abstraction is not constructed
        if self.built.is_none() {
            let built = construct(&self.world, &*self.detector, &*self.family, &self.settings, monitor);
            let robot = self.world.robot.name.clone();
            let (abstraction, detection) = built.map_err(|source| SolveError::NoRoom { robot, source })?;
            let source = detection.source.clone();
            self.built = Some(Built { abstraction, source, detection: Some(detection) });
        }
        Ok(&self.built.as_ref().expect("just built").abstraction)
    }

    /// The file that keeps the abstraction, beside a plan or for the next problem.
    ///
    /// # Errors
    /// If the map has no room for the robot.
    pub fn abstraction_file(&mut self, monitor: &dyn Monitor) -> Result<AbstractionFile, SolveError> {
        let states = Arc::clone(&self.abstraction(monitor)?.states);
        let source = self.built.as_ref().map_or_else(String::new, |built| built.source.clone());
        let (map, options) = (map_hash(&self.world.grid), self.settings.options.clone());
        Ok(AbstractionFile::new(map, source, self.kind, options, &*states))
    }

    /// What the library knows of `abstraction`, made ready for searches; made again when the library has changed.
    fn known(&mut self, abstraction: &Abstraction) -> Arc<KnownOptions> {
        let Self { world, method, library, .. } = self;
        let version = library.version();
        let is_current = self.known.as_ref().is_some_and(|(made_of, _)| *made_of == version);
        if !is_current {
            let known = KnownOptions::new(world, abstraction, method, library);
            self.known = Some((version, Arc::new(known)));
        }
        self.known.as_ref().map(|(_, known)| Arc::clone(known)).expect("just made")
    }

    /// Learns what the library lacks of the `share` of the building: first the options, and once all of them are there the
    /// hand-overs.
    ///
    /// # Errors
    /// If the map has no room for the robot, no option lies within the area, or the library cannot be written.
    pub fn learn_building(
        &mut self,
        share: BuildingShare,
        monitor: &dyn BuildingMonitor,
    ) -> Result<(Roster, BuildingWork), SolveError> {
        let abstraction = self.abstraction(&())?.clone();
        let Self { world, method, conditions, library, seed, .. } = self;
        let site = LearningSite { world, abstraction: &abstraction, method, conditions, seed: *seed };
        let roster = Roster::new(&site, share.within);
        if let Some(area) = share.within.filter(|_| roster.options.is_empty() && roster.unguided.is_empty()) {
            let options = abstraction.options.options().len();
            return Err(SolveError::NothingWithin { area, options });
        }
        monitor.planned(roster.options.len(), roster.hand_overs.len());
        let mut work = BuildingWork::default();
        library.save_at_once()?;
        let task = BuildingTask { site: &site, roster: &roster, share, monitor };
        task.learn_options(library, &mut work)?;
        if !monitor.should_stop() {
            task.learn_hand_overs(library, &mut work)?;
        }
        Ok((roster, work))
    }

    /// Algorithm 1: a plan for `query`. What is learnt stays in the library.
    ///
    /// # Errors
    /// If the map has no room for the robot, or the library cannot be written.
    pub fn solve(&mut self, query: Query, monitor: &dyn Monitor) -> Result<Answer, SolveError> {
        let abstraction = self.abstraction(monitor)?.clone();
        let known = self.known(&abstraction);
        let Self { world, method, conditions, library, seed, .. } = self;
        let problem = PlanningProblem { world, method, conditions, query, seed: *seed, monitor };
        Ok(match solve_with(&problem, &abstraction, library, &known)? {
            Outcome::Solved(solution) => Answer::Solved(Box::new(Plan {
                world: world.clone(),
                abstraction,
                noise: conditions.noise.clone(),
                method: method.clone(),
                seed: *seed,
                solution: *solution,
            })),
            Outcome::NoPlan(reason) => Answer::NoPlan(reason),
            Outcome::Stopped => Answer::Stopped,
        })
    }
}

#[cfg(test)]
mod tests {
    use sharp_drive::SuccessCount;
    use sharp_options::OptionKind;
    use sharp_sim::SimulatorKind;
    use sharp_space::Pose;

    use super::*;
    use crate::execute::{RunSettings, run, success};
    use crate::test_worlds::{RING, world};

    fn ring() -> Sharp {
        let (world, abstraction) = world(RING, OptionKind::Interface);
        Sharp::new(world, sharp_regions::GeometricDetector::default())
            .with_abstraction(abstraction, "drawn")
            .with_method(Method::fast().composed())
    }

    #[test]
    fn odds_are_composed_of_what_was_learnt_and_hold() {
        let mut sharp = ring();
        let (roster, work) = sharp.learn_building(BuildingShare::ALL, &()).expect("in memory");
        assert!(work.is_whole && !roster.options.is_empty(), "{work:?}");
        let query = Query { start: Pose::new(1.4, 4.2, 0.0), goal: Pose::new(8.6, 1.4, 0.0) };
        let Answer::Solved(plan) = sharp.solve(query, &()).expect("in memory") else { panic!("a ring") };
        let odds = plan.solution.composed.clone().expect("nothing was run");
        assert_eq!(plan.solution.reuse().0, plan.solution.reuse().1, "every option was known");
        let plan = Arc::new(*plan);
        let mut settings = RunSettings::new(&plan, 400, Seed(9));
        settings.simulator = plan.world.simulator(SimulatorKind::Kinematic);
        let executions = run(&plan, &settings, &|| 0.0);
        let SuccessCount { episodes, successes } = success(&executions);
        let (rate, n) = (f64::from(successes) / f64::from(episodes), f64::from(episodes));
        assert!((odds.success - rate).abs() < 0.03, "{} predicted, {rate} measured", odds.success);
        let time_s = executions.iter().map(|one| one.record.time_s).sum::<f64>() / n;
        assert!((odds.time_s / time_s - 1.0).abs() < 0.1, "{} s predicted, {time_s} s measured", odds.time_s);
    }
    #[test]
    fn a_composed_plan_with_poor_odds_gives_way_to_one_that_was_run_and_the_library_stays() {
        let composed = Method::fast().composed();
        let hurried = Method { unhurried: None, ..composed.clone() };
        let query = Query { start: Pose::new(1.4, 4.2, 0.0), goal: Pose::new(8.6, 1.4, 0.0) };
        let mut sharp = ring().with_noise(NoiseModel::nominal().scaled(5.0)).with_method(hurried);
        let Answer::Solved(poor) = sharp.solve(query, &()).expect("in memory") else { panic!("a ring") };
        assert!(poor.solution.success() < 0.9, "{:?}", poor.solution.odds());
        let before = sharp.library().version();
        let mut sharp = sharp.with_method(composed);
        let Answer::Solved(plan) = sharp.solve(query, &()).expect("in memory") else { panic!("a ring") };
        let solution = &plan.solution;
        assert!(solution.composed.is_none(), "it was run: {:?}", solution.predicted);
        assert_eq!(sharp.library().version(), before, "other answers stay as they are");
        let odds = solution.odds();
        assert!((odds.success - solution.success()).abs() < 1e-9, "{odds:?}");
        assert!((odds.time_s / solution.predicted_time_s - 1.0).abs() < 0.1, "{odds:?}");
        let cost_s = |plan: &Plan| plan.solution.cost_s(plan.method.failure_cost_s);
        assert!(cost_s(&plan) < cost_s(&poor));
    }
}
