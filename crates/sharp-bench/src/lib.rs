//! How SHARP is compared with other systems: contenders, baselines, suites and the jobs they consist of.
//!
//! The nouns: a [`Contender`] is a system that was prepared for one problem; it gives each episode a controller.
//! [`compare`] lets it drive under the same simulator, noise, collision rule, success rule and time limit as all
//! others. [`Rrt`] and [`Sac`] are the paper's baselines, [`Track`] and [`Mpc`] what an engineer would use,
//! [`Composed`] is SHARP.

pub mod conformance;

mod baselines;
mod contender;

pub use baselines::{Mpc, RoutePlanner, Rrt, Sac, SacBudget, Track};
pub use contender::{ComparisonSettings, Composed, Contender, Driven, compare};
