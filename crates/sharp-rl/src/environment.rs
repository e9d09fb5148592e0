//! What a learner may ask of a task: begin an episode, make a step (the option's MDP of Sec. 4.3).
//!
//! An environment is a function of two things: the stream that it was reset with, and the actions
//! since then. Noise that is drawn while stepping comes from a generator that
//! [`Environment::reset`] forks off its stream. Training relies on this: a resumed run rebuilds an
//! unfinished episode by repeating its actions.
//! [`check_environment`](crate::conformance::check_environment) tests it.

use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use crate::error::TrainError;

/// The generator behind every draw. It is the type of the streams in the crate `sharp-space`.
pub type Stream = ChaCha8Rng;

/// A task with continuous observations and actions, one episode at a time.
///
/// Implement the three methods below for a type that is `Clone` and owns its data;
/// [`ForkEnvironment`] then comes for free. Learners take environments as `Box<dyn Environment>`.
pub trait Environment: ForkEnvironment + Send {
    /// The lengths of the vectors. They never change.
    fn spec(&self) -> EnvironmentSpec;

    /// Begins an episode and writes the first observation.
    ///
    /// Every component of `observation` is written and finite. Everything random in the episode is
    /// drawn from `rng`, now or through a generator that is forked from it now.
    fn reset(&mut self, rng: &mut Stream, observation: &mut [f32]);

    /// Applies `action` and writes the observation that follows.
    ///
    /// Components of `action` lie in \[-1, 1\]. Every component of `observation` is written and
    /// finite. At the end of an episode this is its last observation, not the first of the next.
    fn step(&mut self, action: &[f32], observation: &mut [f32]) -> Step;
}

/// A copy of an environment behind a trait object, for evaluation beside a running episode.
///
/// Every environment that is `Clone` has it; there is nothing to implement.
pub trait ForkEnvironment {
    /// A copy in the same state. Both continue independently.
    fn fork(&self) -> Box<dyn Environment>;
}

impl<T: Environment + Clone + 'static> ForkEnvironment for T {
    fn fork(&self) -> Box<dyn Environment> {
        Box::new(self.clone())
    }
}

impl Clone for Box<dyn Environment> {
    fn clone(&self) -> Self {
        (**self).fork()
    }
}

impl Environment for Box<dyn Environment> {
    fn spec(&self) -> EnvironmentSpec {
        (**self).spec()
    }

    fn reset(&mut self, rng: &mut Stream, observation: &mut [f32]) {
        (**self).reset(rng, observation);
    }

    fn step(&mut self, action: &[f32], observation: &mut [f32]) -> Step {
        (**self).step(action, observation)
    }
}

/// The lengths of an environment's vectors.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct EnvironmentSpec {
    /// Components of an observation, at least 1.
    pub observation_len: usize,
    /// Components of an action, at least 1. Each runs from -1 to 1.
    pub action_len: usize,
}

impl EnvironmentSpec {
    /// The lengths that all `environments` share.
    ///
    /// # Errors
    /// If there are no environments, if a length is 0, or if one environment differs from the first.
    pub fn common<E: Environment>(environments: &[E]) -> Result<Self, TrainError> {
        let expected = environments.first().ok_or(TrainError::NoEnvironments)?.spec();
        if expected.observation_len == 0 || expected.action_len == 0 {
            return Err(TrainError::Empty(expected));
        }
        for (environment, found) in environments.iter().map(Environment::spec).enumerate() {
            if found != expected {
                return Err(TrainError::Spec { environment, found, expected });
            }
        }
        Ok(expected)
    }
}

/// The result of one step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Step {
    /// The reward of the step. It is finite.
    pub reward: f32,
    /// The episode ended inside the MDP (goal, collision). No value follows.
    pub terminated: bool,
    /// The episode was cut from outside (time limit). The value goes on, so targets bootstrap.
    pub truncated: bool,
    /// The step reached what the environment calls success.
    pub success: bool,
}

impl Step {
    /// Returns true if the episode is over, for either reason.
    #[must_use]
    pub const fn is_last(&self) -> bool {
        self.terminated || self.truncated
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;
    use crate::toy::{Identity, PointMass};

    #[test]
    fn a_boxed_copy_continues_like_its_original() {
        let mut original: Box<dyn Environment> = Box::new(PointMass::default());
        let mut observation = [0.0; 4];
        original.reset(&mut Stream::seed_from_u64(1), &mut observation);
        original.step(&[0.5, -0.5], &mut observation);
        let mut copy = original.clone();
        let mut other = [0.0; 4];
        for _ in 0..5 {
            let step = original.step(&[-1.0, 0.2], &mut observation);
            assert_eq!(copy.step(&[-1.0, 0.2], &mut other), step);
            assert_eq!(other, observation);
        }
    }

    #[test]
    fn environments_of_different_lengths_have_no_common_spec() {
        let boxed = |len| Box::new(Identity::new(len)) as Box<dyn Environment>;
        let common = |environments: &[Box<dyn Environment>]| EnvironmentSpec::common(environments);
        assert_eq!(common(&[]), Err(TrainError::NoEnvironments));
        assert_eq!(common(&[boxed(0)]), Err(TrainError::Empty(boxed(0).spec())));
        assert_eq!(common(&[boxed(2), boxed(2)]), Ok(boxed(2).spec()));
        let error = common(&[boxed(2), boxed(3)]).expect_err("lengths differ");
        assert!(matches!(error, TrainError::Spec { environment: 1, .. }), "{error:?}");
    }
}
