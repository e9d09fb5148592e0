//! Algorithm 1: search, learning, the composed policy and the option library.
//!
//! [`solve`] takes a [`Workspace`] (map and robot), an [`Abstraction`] (diagram and options) and a
//! [`Query`], searches a plan of options with A*, learns the policies that the [`OptionLibrary`]
//! lacks and returns a [`Solution`] with its measured odds. A [`Plan`] keeps a solution in a folder;
//! [`run`] drives it in a simulator, and a [`ComposedPolicy`] drives anything else.

mod baseline;
mod belief;
mod certify;
mod composed;
mod execute;
mod files;
mod learn;
mod leg;
mod library;
mod model;
mod pace;
mod percept;
mod plan;
mod planner;
mod policy;
pub mod prior;
mod rollout;
mod search;
mod sharp;
mod spare;
mod starts;
mod stats;
mod task;

#[cfg(test)]
mod drawn;

pub use baseline::{
    Baseline, ComparisonSettings, Driven, Host, Mppi, MppiSettings, Pilot, Readiness, RoutePlanner, Rrt, Sac,
    SacBudget, Situation, Track, compare,
};
pub use certify::{Certificate, FAILURE_COST_S, Trial};
pub use composed::{ComposedPolicy, Decision, Events};
pub use execute::{Episode, EpisodeEnd, RunSettings, run, success};
pub use files::{FileError, hash, read_ron, write_atomic, write_ron};
pub use learn::{LearnFailure, LearnSettings, LearningMode, Learnt, Lesson, LessonMonitor, RewardMode};
pub use leg::{Leg, LegId, Role, Target};
pub use library::{FORMAT, OptionLibrary, StoredOption};
pub use pace::{PacedFollower, SpeedRule};
pub use percept::{Expectation, Percept, Tracker, Workspace};
pub use plan::{AbstractionFile, Plan, map_hash};
pub use planner::{Abstraction, Planner, Query, SearchSettings, Unplaced};
pub use policy::{Correction, DecisionScratch, Follower, Form, GuideView, OptionPolicy, PolarWaypoint, Rule};
pub use prior::Prior;
pub use rollout::{ChainRun, Driver, LegEnd, LegOutcome, drive_chain};
pub use search::{Candidate, OptionGraph};
pub use sharp::{Monitor, Outcome, Phase, PlannedLeg, Solution, SolveSettings, kind_name, solve};
pub use starts::{StartSpread, Starts};
pub use stats::Tally;
pub use task::LegTask;

/// The slowest waypoint distance that a policy may choose all the way and still be in time, metres.
pub const SLOWEST_REACH_M: f64 = 0.15;
