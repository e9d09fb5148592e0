//! Why training fails, and the checks behind it.

use thiserror::Error;

use crate::environment::EnvironmentSpec;
use crate::network::NetworkError;
use crate::settings::SettingsError;

/// Why training failed.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum TrainError {
    /// There are no environments.
    #[error("no environments to train on")]
    NoEnvironments,
    /// Environments, networks or a saved state differ in the lengths of their vectors.
    #[error("environment {environment} has {found:?}, expected {expected:?}")]
    Spec {
        /// Index of the environment.
        environment: usize,
        /// Its lengths.
        found: EnvironmentSpec,
        /// The lengths of the first environment or of the networks.
        expected: EnvironmentSpec,
    },
    /// An environment has vectors without components.
    #[error("an environment with {0:?}, both lengths must be at least 1")]
    Empty(EnvironmentSpec),
    /// A setting is out of range.
    #[error(transparent)]
    Settings(#[from] SettingsError),
    /// Parameters do not make a network.
    #[error(transparent)]
    Network(#[from] NetworkError),
    /// An environment returned an observation that holds NaN or infinity.
    #[error(
        "component {component} of the observation of environment {environment} is {value} after {steps} steps"
    )]
    Observation {
        /// Index of the environment.
        environment: usize,
        /// Index of the component.
        component: usize,
        /// The value, as text so that errors can be compared.
        value: String,
        /// Steps since the reset.
        steps: u64,
    },
    /// An environment returned NaN or infinity as a reward.
    #[error("the reward of environment {environment} is {value} after {steps} steps")]
    Reward {
        /// Index of the environment.
        environment: usize,
        /// The value, as text.
        value: String,
        /// Steps since the reset.
        steps: u64,
    },
    /// Learning diverged.
    #[error("{what} is not finite after {updates} updates")]
    Diverged {
        /// The quantity that is not finite.
        what: &'static str,
        /// Gradient steps taken.
        updates: u64,
    },
    /// An episode does not end. A time limit is the environment's duty.
    #[error("an episode of environment {environment} did not end within {steps} steps")]
    Endless {
        /// Index of the environment.
        environment: usize,
        /// Steps taken.
        steps: u64,
    },
    /// A saved state belongs to another number of environments.
    #[error("a state of {expected} environments resumed with {found}")]
    EnvironmentCount {
        /// Environments given.
        found: usize,
        /// Environments of the state.
        expected: usize,
    },
    /// A saved state has networks of other widths than the settings, or another buffer.
    #[error("the state to continue from has {what} {found}, the settings say {expected}")]
    Mismatch {
        /// What differs.
        what: &'static str,
        /// The state's value.
        found: String,
        /// The settings' value.
        expected: String,
    },
    /// An environment did not repeat its episode on resuming.
    #[error("environment {environment} did not repeat its episode: it is not the one that was saved")]
    NotRepeated {
        /// Index of the environment.
        environment: usize,
    },
    /// Another learner failed for a reason of its own.
    #[error("{0}")]
    Other(String),
}

/// Refuses NaN and infinity in an observation.
pub(crate) fn check_observation(values: &[f32], environment: usize, steps: u64) -> Result<(), TrainError> {
    match values.iter().position(|value| !value.is_finite()) {
        Some(component) => {
            let value = values[component].to_string();
            Err(TrainError::Observation { environment, component, value, steps })
        }
        None => Ok(()),
    }
}

/// Refuses NaN and infinity as a reward.
pub(crate) fn check_reward(reward: f32, environment: usize, steps: u64) -> Result<(), TrainError> {
    if reward.is_finite() {
        Ok(())
    } else {
        Err(TrainError::Reward { environment, value: reward.to_string(), steps })
    }
}
