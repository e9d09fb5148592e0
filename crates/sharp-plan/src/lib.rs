//! SHARP whole: Algorithm 1, its search, the learning of options, the composed policy and the option library.
//!
//! The nouns: [`Sharp`] is a robot in a building that solves problem after problem. A [`Method`] says how, as data;
//! an [`OptionLearner`] gives an option its policy. A [`Plan`] is a policy composed of options with its measured
//! probability of success. [`run`] drives it in a simulator, a [`ComposedPolicy`] drives anything else, and an
//! [`OptionLibrary`] keeps what was learnt. Algorithm 1 itself is [`solve`].
//!
//! ```
//! use std::sync::Arc;
//! use sharp_drive::World;
//! use sharp_plan::{Answer, Method, Query, RunSettings, Sharp, run, success};
//! use sharp_regions::GeometricDetector;
//! use sharp_sim::{NoiseModel, RobotModel};
//! use sharp_space::{OccupancyGrid, Pose, Seed};
//!
//! let grid = OccupancyGrid::from_ascii(0.4, &["........................."; 10].join("\n")).unwrap();
//! let world = World::new(grid, RobotModel::husky());
//! let mut sharp = Sharp::new(world, GeometricDetector::default())
//!     .with_method(Method::prior().with_episodes(50, 50, 50))
//!     .with_noise(NoiseModel::none());
//! let query = Query { start: Pose::new(1.5, 2.0, 0.0), goal: Pose::new(8.5, 2.0, 0.0) };
//! let Answer::Solved(plan) = sharp.solve(query, &())? else { panic!("an open hall") };
//! let plan = Arc::new(*plan);
//! let executions = run(&plan, &RunSettings::new(&plan, 5, Seed(2)), &|| 0.0);
//! assert_eq!(success(&executions).successes, 5, "predicted {:?}", plan.solution.predicted);
//! # Ok::<(), sharp_plan::SolveError>(())
//! ```

pub mod conformance;

mod abstraction;
mod algorithm;
mod building;
mod composed;
mod conditions;
mod execute;
mod files;
mod hand_over;
mod known;
mod learn;
mod library;
mod method;
mod odds;
mod option_graph;
mod plan_file;
mod policies;
mod price;
mod problem;
mod query;
mod reason;
mod recording;
mod remote;
mod repair;
mod roster;
mod search;
mod sharp;
mod tour;
mod training_route;
mod verify;
mod weak_places;

#[cfg(test)]
mod test_worlds;

pub use abstraction::{Abstraction, AbstractionSettings, construct};
pub use algorithm::{Outcome, solve};
pub use building::{
    Building, BuildingMonitor, BuildingShare, BuildingTask, BuildingWork, LearningSite, Part,
};
pub use composed::{ComposedPolicy, Events};
pub use conditions::Conditions;
pub use execute::{Execution, RunSettings, run, success};
pub use files::{FileError, hash, read_ron, write_atomic, write_ron};
pub use hand_over::HandOver;
pub use known::KnownOptions;
pub use learn::{
    InterruptedTraining, LearnFailure, LearningMonitor, LearningTask, LearntPolicy, OptionLearner,
    PaperProtocol, PriorOnly, Selection, Training, TrainingFile, TrainingPoint,
};
pub use library::{FORMAT, LibraryKey, OptionLibrary, StoredOption};
pub use method::{LearningOrder, Method, PriceRule, RepairSettings, SearchSettings, TUNED_REWARD};
pub use odds::{ComposedOdds, PlanPiece};
pub use option_graph::{Candidate, OptionGraph};
pub use plan_file::{AbstractionFile, Plan, map_hash};
pub use problem::PlanningProblem;
pub use query::{Monitor, Phase, Query, QueryError};
pub use recording::{Moment, Recording, record};
pub use remote::{Instruction, MOVED, Reading, RemoteDriver, RemoteStatus, is_elsewhere, is_placed};
pub use roster::{Area, Roster, RosterOption};
pub use search::{Search, Unplaced};
pub use sharp::{Answer, Sharp, SolveError};
pub use tour::{Tour, TourPolicy, end_of};
pub use training_route::{RouteScenarios, TrainingRoute, training_routes};
pub use verify::{PlannedOption, Solution};
pub use weak_places::{MeasuredStretch, WeakPlace, measured_stretches, weak_places};
