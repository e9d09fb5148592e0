//! What a learner may ask of a world: reset it, step it (the option's MDP of Sec. 4.3).
//!
//! An environment is a function of the stream it was reset with and the actions it was given
//! since. Noise drawn while stepping comes from a generator that [`Environment::reset`] forks off
//! its stream. Training relies on it: a resumed run rebuilds an unfinished episode by replaying it.

use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

/// The generator behind every draw; the same type as the streams of the crate `sharp-space`.
pub type Stream = ChaCha8Rng;

/// A world with continuous observations and actions, one episode at a time.
pub trait Environment {
    /// The lengths of its vectors; the same for its whole life.
    fn spec(&self) -> EnvironmentSpec;

    /// Begins an episode and writes the first observation.
    ///
    /// Everything random in the episode is drawn from `rng`, now or through a generator forked now.
    fn reset(&mut self, rng: &mut Stream, observation: &mut [f32]);

    /// Applies `action`, every component in \[-1, 1\], and writes the observation that follows.
    ///
    /// At the end of an episode this is the last observation, not the next episode's first.
    fn step(&mut self, action: &[f32], observation: &mut [f32]) -> Step;
}

/// The lengths of an environment's vectors.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct EnvironmentSpec {
    /// Components of an observation, at least 1.
    pub observation_len: usize,
    /// Components of an action, at least 1; each runs from -1 to 1.
    pub action_len: usize,
}

/// What one step came to.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Step {
    /// The reward of the step; finite.
    pub reward: f32,
    /// The episode ended inside the MDP (goal, collision): there is no value after it.
    pub terminated: bool,
    /// The episode was cut from outside (time limit): its value goes on, so targets bootstrap.
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
