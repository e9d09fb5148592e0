//! How a prior is trained and scored: generated maps, routes through them, proximal policy optimisation.
//!
//! A [`PriorRecipe`] is a few [`PriorStage`]s, each with its maps, noises and hyperparameters; [`train_prior`] runs
//! them one after the other. [`score_policies`] drives policies on routes of kinds of map that no prior was trained
//! on. `docs/algorithms/prior.md` says why the numbers are what they are.

mod cost;
mod courses;
mod recipe;
mod score;
mod train;

pub use cost::{CostError, CostRecipe, CostScore, FittedCost, fit_cost, score_cost};
pub use courses::{HELD_OUT, PriorCourses};
pub use recipe::{PriorRecipe, PriorStage};
pub use score::{PolicyScore, prior_candidates, score_policies};
pub use train::{PriorEnd, PriorProgress, PriorTrainError, train_prior};
