//! The rules for environments, in the manner of Gymnasium's `check_env`.

use rand::RngExt;
use thiserror::Error;

use crate::environment::{Environment, EnvironmentSpec, Stream};

/// Steps after which an episode under random actions counts as endless.
const EPISODE_LIMIT: usize = 100_000;
const EPISODES: usize = 3;

/// The rule that an environment breaks.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum EnvironmentViolation {
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
    /// Equal streams and equal actions gave different episodes.
    #[error("two episodes from the same stream differ at step {step}")]
    NotReproducible {
        /// The step, 0 for the reset.
        step: usize,
    },
    /// A copy that was made after the reset continued in another way than its original.
    #[error("a copy and its original differ at step {step}")]
    ForkDiffers {
        /// The step, from 1.
        step: usize,
    },
    /// An episode under random actions did not end.
    #[error("an episode did not end within {0} steps")]
    Endless(usize),
    /// The spec is not the same before and after an episode.
    #[error("the lengths of the vectors changed during an episode")]
    SpecChanged,
}

/// Checks the rules of [`Environment`] on a few episodes with random actions.
///
/// Each episode runs twice from equal streams, and once more on a copy made after the reset.
///
/// # Errors
/// Names the first rule that is broken.
pub fn check_environment(
    environment: &mut dyn Environment,
    rng: &mut Stream,
) -> Result<(), EnvironmentViolation> {
    let spec = environment.spec();
    if spec.observation_len == 0 || spec.action_len == 0 {
        let EnvironmentSpec { observation_len, action_len } = spec;
        return Err(EnvironmentViolation::Empty { observation_len, action_len });
    }
    for _ in 0..EPISODES {
        let (mut second, mut third, mut actions) = (rng.clone(), rng.clone(), rng.clone());
        let _: u64 = actions.random(); // Actions shall not repeat the draws of the reset.
        let mut trace = vec![begin(environment, rng)?];
        trace.extend(finish(environment, &mut actions.clone())?);
        let mut again = vec![begin(environment, &mut second)?];
        again.extend(finish(environment, &mut actions.clone())?);
        let same_draws = *rng == second;
        if let Some(step) = first_difference(&trace, &again).or((!same_draws).then_some(0)) {
            return Err(EnvironmentViolation::NotReproducible { step });
        }
        begin(environment, &mut third)?;
        let copied = finish(&mut *environment.fork(), &mut actions)?;
        if let Some(step) = first_difference(&trace[1..], &copied) {
            return Err(EnvironmentViolation::ForkDiffers { step: step + 1 });
        }
        if environment.spec() != spec {
            return Err(EnvironmentViolation::SpecChanged);
        }
    }
    Ok(())
}

/// The bits of an observation and a reward.
type Bits = Vec<u32>;

/// Index of the first step in which two episodes differ, or in which only one goes on.
fn first_difference(first: &[Bits], second: &[Bits]) -> Option<usize> {
    let shorter = first.len().min(second.len());
    let differs = (0..shorter).find(|&step| first[step] != second[step]);
    differs.or((first.len() != second.len()).then_some(shorter))
}

/// Begins an episode.
fn begin(environment: &mut dyn Environment, rng: &mut Stream) -> Result<Bits, EnvironmentViolation> {
    // A component that is not written stays NaN, and is reported.
    let mut observation = vec![f32::NAN; environment.spec().observation_len];
    environment.reset(rng, &mut observation);
    check_observation(&observation, 0)?;
    Ok(bits(&observation, 0.0))
}

/// Runs the episode to its end with random actions.
fn finish(
    environment: &mut dyn Environment,
    actions: &mut Stream,
) -> Result<Vec<Bits>, EnvironmentViolation> {
    let spec = environment.spec();
    let (mut action, mut observation) = (vec![0.0; spec.action_len], vec![0.0; spec.observation_len]);
    let mut trace = Vec::new();
    for step_number in 1..=EPISODE_LIMIT {
        action.fill_with(|| actions.random_range(-1.0..=1.0));
        observation.fill(f32::NAN);
        let step = environment.step(&action, &mut observation);
        check_observation(&observation, step_number)?;
        if !step.reward.is_finite() {
            return Err(EnvironmentViolation::Reward { step: step_number, reward: step.reward });
        }
        if step.terminated && step.truncated {
            return Err(EnvironmentViolation::TwoEnds { step: step_number });
        }
        trace.push(bits(&observation, step.reward));
        if step.is_last() {
            return Ok(trace);
        }
    }
    Err(EnvironmentViolation::Endless(EPISODE_LIMIT))
}

fn check_observation(observation: &[f32], steps: usize) -> Result<(), EnvironmentViolation> {
    match observation.iter().position(|value| !value.is_finite()) {
        Some(component) => {
            Err(EnvironmentViolation::Observation { component, steps, value: observation[component] })
        }
        None => Ok(()),
    }
}

fn bits(observation: &[f32], reward: f32) -> Bits {
    observation.iter().chain([&reward]).map(|value| value.to_bits()).collect()
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;
    use crate::environment::Step;
    use crate::toy::{Identity, PointMass};

    fn check(environment: &mut dyn Environment) -> Result<(), EnvironmentViolation> {
        check_environment(environment, &mut Stream::seed_from_u64(7))
    }

    /// An environment of one component with a fault to choose.
    struct FaultyEnvironment {
        fault: &'static str,
        steps: usize,
    }

    impl Clone for FaultyEnvironment {
        fn clone(&self) -> Self {
            Self { fault: self.fault, steps: if self.fault == "fork" { 1 } else { self.steps } }
        }
    }

    impl Environment for FaultyEnvironment {
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
    fn the_toy_environments_conform() {
        assert_eq!(check(&mut Identity::new(3)), Ok(()), "identity");
        assert_eq!(check(&mut PointMass::default()), Ok(()), "point mass");
        assert_eq!(check(&mut FaultyEnvironment { fault: "none", steps: 0 }), Ok(()), "no fault");
    }

    #[test]
    fn every_fault_is_named() {
        for (fault, message) in [
            ("empty", "an observation of 0 and an action of 1 components"),
            ("unwritten", "component 0 of the observation after 0 steps is NaN"),
            ("nan", "component 0 of the observation after 1 steps is NaN"),
            ("reward", "the reward of step 1 is inf"),
            ("both", "step 3 both terminates and truncates the episode"),
            ("fork", "a copy and its original differ at step 1"),
            ("memory", "two episodes from the same stream differ at step 0"),
            ("endless", "an episode did not end within 100000 steps"),
        ] {
            let found = check(&mut FaultyEnvironment { fault, steps: 0 }).expect_err(fault).to_string();
            assert_eq!(found, message, "{fault}");
        }
    }
}
