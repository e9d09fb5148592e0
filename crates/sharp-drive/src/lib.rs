//! Whatever moves a robot along a guide: observation, policies, slip estimate, the episode loop, estimates.
//!
//! The nouns: a [`World`] is a map with a robot in it. A [`Situation`] is what a policy sees at the moment of a
//! decision, a [`Policy`] turns it into a [`Command`]. An [`Episode`] is one robot on its way: its
//! [`act`](Episode::act) is the only place in this project that steps a vehicle, and [`Episode::drive`] is the
//! only loop. An [`Automaton`] keeps the books of a chain of guided options, `q_i → q_{i+1}`. Predictions
//! ([`MonteCarlo`]), learning ([`OptionTask`]) and execution all use these, so that what is predicted is what runs.
//!
//! ```
//! use sharp_drive::{Episode, EpisodeEnd, EpisodeRules, Follower, RouteController, Supervisor, World};
//! use sharp_guide::GuidePath;
//! use sharp_sim::{NoiseModel, RobotModel, RobotState, SimulatorKind};
//! use sharp_space::{OccupancyGrid, Pose, Seed};
//!
//! let grid = OccupancyGrid::from_ascii(0.5, &["...................."; 8].join("\n")).unwrap();
//! let world = World::new(grid, RobotModel::husky());
//! let poses = (0..=30).map(|i| Pose::new(2.0 + 0.2 * f64::from(i), 2.0, 0.0)).collect();
//! let route = GuidePath::new(poses, 0.25).unwrap();
//!
//! let (simulator, noise) = (world.simulator(SimulatorKind::Kinematic), NoiseModel::nominal());
//! let mut episode = Episode::new(world.vehicle(&*simulator, &noise, true), EpisodeRules::default());
//! let start = RobotState::at_rest(route.start());
//! episode.begin(start, Seed(1), 0);
//! let policy = Box::new(Follower::cautious(&world.robot));
//! let mut controller = RouteController::new(&world, route, policy, start, &noise);
//! assert_eq!(episode.drive(&mut controller, &Supervisor::silent()), EpisodeEnd::Reached);
//! ```

pub mod conformance;

mod automaton;
mod chain;
mod command;
mod cost;
mod count;
mod departure;
mod episode;
mod estimate;
mod features;
mod follower;
mod initial_states;
mod motion_model;
mod mppi;
mod network;
mod policy;
mod presets;
mod prior;
mod route;
mod situation;
mod slip_filter;
mod speed_limits;
mod speed_profile;
mod still;
mod task;
mod world;

#[cfg(test)]
mod test_worlds;

pub use automaton::{Automaton, Link, Visit};
pub use chain::{ChainController, ChainRun, Driver};
pub use command::Command;
pub use cost::{CostModel, DriveRow, GuideEnds, PredictedCost, RiskSamples, TimeSamples, drive_rows};
pub use count::{SuccessCount, wilson95};
pub use departure::CAREFUL_MPS;
pub use episode::{
    Controller, Decision, Episode, EpisodeEnd, EpisodeRecord, EpisodeRules, Motion, Readiness, Supervisor,
    TIME_LIMIT_MIN_S,
};
pub use estimate::{FAILURE_COST_S, MonteCarlo, SuccessEstimate, expected_cost_s};
pub use follower::{Follower, SteeringRule};
pub use initial_states::{InitialStates, StateSpread};
pub use mppi::{Mppi, MppiSettings};
pub use network::{Correction, NetworkPolicy, PolicyContext, PolicyInterface};
pub use policy::{ForkPolicy, OptionPolicy, Policy};
pub use prior::{Prior, prior_interface};
pub use route::{Replan, RouteController};
pub use situation::{GuideProgress, GuideView, Observation, Situation};
pub use speed_limits::{SPEED_LIMIT_MIN_MPS, SpeedLimits, SpeedLimitsError};
pub use speed_profile::{ProfiledFollower, RouteFollower, SpeedProfile};
pub use still::StandstillDetector;
pub use task::{DrivingBatch, OptionTask, Scenario, ScenarioSource, SingleOption};
pub use world::{AnyVehicle, World};
