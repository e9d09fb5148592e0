//! A conformance check for environments, as Gymnasium's `check_env`.

use rand::RngExt;
use thiserror::Error;

use crate::environment::{Environment, Stream};

/// Steps after which an episode under random actions counts as endless.
const EPISODE_LIMIT: usize = 100_000;
const EPISODES: usize = 3;

/// How an environment breaks its contract.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum CheckError {
    /// A vector has no components.
    #[error("an observation of {observation_len} and an action of {action_len} components")]
    Empty {
        /// Components of the observation.
        observation_len: usize,
        /// Components of the action.
        action_len: usize,
    },
    /// An observation holds NaN or infinity, or was not written at all.
    #[error("component {component} of the observation after {steps} steps is {value}")]
    Observation {
        /// The component.
        component: usize,
        /// Steps since the reset.
        steps: usize,
        /// The value.
        value: f32,
    },
    /// A reward is NaN or infinite.
    #[error("the reward of step {step} is {reward}")]
    Reward {
        /// The step, from 1.
        step: usize,
        /// The reward.
        reward: f32,
    },
    /// A step both terminates and truncates.
    #[error("step {step} both terminates and truncates the episode")]
    TwoEnds {
        /// The step, from 1.
        step: usize,
    },
    /// Equal streams and actions gave different episodes.
    #[error("two episodes from the same stream differ at step {step}")]
    NotReproducible {
        /// The step, 0 for the reset.
        step: usize,
    },
    /// An episode under random actions did not end.
    #[error("an episode did not end within {0} steps")]
    Endless(usize),
    /// The spec is not the same before and after an episode.
    #[error("the lengths of the vectors changed during an episode")]
    SpecChanged,
}

/// Runs a few episodes with random actions, each twice, and checks the contract of [`Environment`].
///
/// # Errors
/// Names the first breach.
pub fn check_environment<E: Environment>(environment: &mut E, rng: &mut Stream) -> Result<(), CheckError> {
    let spec = environment.spec();
    if spec.observation_len == 0 || spec.action_len == 0 {
        return Err(CheckError::Empty { observation_len: spec.observation_len, action_len: spec.action_len });
    }
    for _ in 0..EPISODES {
        let (mut first, mut second, mut actions) = (rng.clone(), rng.clone(), rng.clone());
        let _: u64 = actions.random(); // Actions are not to echo what the reset draws.
        let trace = episode(environment, &mut first, &mut actions.clone())?;
        let again = episode(environment, &mut second, &mut actions)?;
        if let Some(step) = trace.iter().zip(&again).position(|(a, b)| a != b) {
            return Err(CheckError::NotReproducible { step });
        }
        if trace.len() != again.len() || first != second {
            return Err(CheckError::NotReproducible { step: trace.len().min(again.len()) });
        }
        *rng = first;
        if environment.spec() != spec {
            return Err(CheckError::SpecChanged);
        }
    }
    Ok(())
}

/// Observations and rewards of one episode, as bits so that they compare exactly.
fn episode<E: Environment>(
    environment: &mut E,
    rng: &mut Stream,
    actions: &mut Stream,
) -> Result<Vec<Vec<u32>>, CheckError> {
    let spec = environment.spec();
    let mut action = vec![0.0; spec.action_len];
    // What is not written stays NaN and is noticed.
    let mut observation = vec![f32::NAN; spec.observation_len];
    environment.reset(rng, &mut observation);
    check_observation(&observation, 0)?;
    let mut trace = vec![bits(&observation, 0.0)];
    for step_number in 1..=EPISODE_LIMIT {
        action.fill_with(|| actions.random_range(-1.0..=1.0));
        observation.fill(f32::NAN);
        let step = environment.step(&action, &mut observation);
        check_observation(&observation, step_number)?;
        if !step.reward.is_finite() {
            return Err(CheckError::Reward { step: step_number, reward: step.reward });
        }
        if step.terminated && step.truncated {
            return Err(CheckError::TwoEnds { step: step_number });
        }
        trace.push(bits(&observation, step.reward));
        if step.is_last() {
            return Ok(trace);
        }
    }
    Err(CheckError::Endless(EPISODE_LIMIT))
}

fn check_observation(observation: &[f32], steps: usize) -> Result<(), CheckError> {
    match observation.iter().position(|value| !value.is_finite()) {
        Some(component) => Err(CheckError::Observation { component, steps, value: observation[component] }),
        None => Ok(()),
    }
}

fn bits(observation: &[f32], reward: f32) -> Vec<u32> {
    observation.iter().chain([&reward]).map(|value| value.to_bits()).collect()
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;
    use crate::environment::{EnvironmentSpec, Step};
    use crate::toy::{Identity, PointMass};

    fn check(environment: &mut impl Environment) -> Result<(), CheckError> {
        check_environment(environment, &mut Stream::seed_from_u64(7))
    }

    /// An environment of one component with a fault to choose.
    struct Broken {
        fault: &'static str,
        steps: usize,
    }

    impl Environment for Broken {
        fn spec(&self) -> EnvironmentSpec {
            EnvironmentSpec { observation_len: usize::from(self.fault != "empty"), action_len: 1 }
        }

        fn reset(&mut self, _rng: &mut Stream, observation: &mut [f32]) {
            if self.fault != "memory" {
                self.steps = 0;
            }
            if self.fault != "unwritten" {
                observation[0] = self.steps as f32;
            }
        }

        fn step(&mut self, _action: &[f32], observation: &mut [f32]) -> Step {
            self.steps += 1;
            observation[0] = if self.fault == "nan" { f32::NAN } else { self.steps as f32 };
            let last = self.steps.is_multiple_of(3) && self.fault != "endless";
            let reward = if self.fault == "reward" { f32::INFINITY } else { 0.0 };
            Step { reward, terminated: last, truncated: last && self.fault == "both", success: false }
        }
    }

    #[test]
    fn the_toy_environments_keep_the_contract() {
        assert_eq!(check(&mut Identity::new(3)), Ok(()), "identity");
        assert_eq!(check(&mut PointMass::default()), Ok(()), "point mass");
        assert_eq!(check(&mut Broken { fault: "none", steps: 0 }), Ok(()), "no fault");
    }

    #[test]
    fn every_fault_is_named() {
        for (fault, message) in [
            ("empty", "an observation of 0 and an action of 1 components"),
            ("unwritten", "component 0 of the observation after 0 steps is NaN"),
            ("nan", "component 0 of the observation after 1 steps is NaN"),
            ("reward", "the reward of step 1 is inf"),
            ("both", "step 3 both terminates and truncates the episode"),
            ("memory", "two episodes from the same stream differ at step 0"),
            ("endless", "an episode did not end within 100000 steps"),
        ] {
            let found = check(&mut Broken { fault, steps: 0 }).expect_err(fault).to_string();
            assert_eq!(found, message, "{fault}");
        }
    }
}
