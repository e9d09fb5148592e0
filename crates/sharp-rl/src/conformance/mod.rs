//! What every implementation of this crate's traits must do, as checks that anyone can call.
//!
//! [`check_environment`], [`check_batch`] and [`check_learner`] take any implementation and name the first rule that
//! it breaks. They draw from the caller's stream only, so a failure can be repeated.

mod batch;
mod environment;
mod learner;

pub use batch::{BatchViolation, check_batch};
pub use environment::{EnvironmentViolation, check_environment};
pub use learner::{LEARNING_BUDGET_STEPS, LearnerViolation, MEAN_RETURN_MIN, STOP_STEPS_MAX, check_learner};
