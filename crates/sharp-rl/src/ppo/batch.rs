//! What an on-policy learner may ask of many environments at once.

use std::ops::Range;

use crate::environment::{Environment, EnvironmentSpec, Step, Stream};
use crate::error::TrainError;

/// Many episodes of one task side by side, each in a slot.
///
/// An episode is a function of the stream that its slot was reset with and of the actions since then, as in
/// [`Environment`](crate::Environment). Slots do not depend on each other, so that an implementation may step
/// them in any order and on any number of threads.
pub trait BatchEnvironment {
    /// The number of slots and the lengths of the vectors. They never change.
    fn spec(&self) -> BatchSpec;

    /// Begins an episode in `slot` and writes the first row of `seen` for it.
    ///
    /// Everything random in the episode is drawn from `rng`, now or through a generator that is forked from it now.
    fn reset(&mut self, slot: usize, rng: &mut Stream, seen: &mut SeenBatch);

    /// Applies one action in each of `slots` and writes what follows into their rows of `seen`.
    ///
    /// `actions` has a row of [`EnvironmentSpec::action_len`] values in \[-1, 1\] for each of `slots`, `steps` one
    /// entry. At the end of an episode the row of `seen` is its last one.
    fn step(&mut self, slots: Range<usize>, actions: &[f32], seen: &mut SeenBatch, steps: &mut [BatchStep]);
}

/// The size of a batch of environments.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct BatchSpec {
    /// Episodes side by side, at least 1.
    pub slots: usize,
    /// The lengths of what the actor sees and of what it does.
    pub lengths: EnvironmentSpec,
    /// Components that only the critic sees; may be 0.
    pub privileged_len: usize,
}

impl BatchSpec {
    /// Components that the critic sees: the observation, then the privileged ones.
    pub(crate) const fn critic_len(&self) -> usize {
        self.lengths.observation_len + self.privileged_len
    }
}

/// What is seen in every slot: one row each, finite.
#[derive(Clone, Debug, PartialEq)]
pub struct SeenBatch {
    /// Slots x observation: what the actor and the critic see.
    pub observations: Vec<f32>,
    /// Slots x privileged: what only the critic sees.
    pub privileged: Vec<f32>,
}

impl SeenBatch {
    /// Rows of zeros.
    #[must_use]
    pub fn new(spec: &BatchSpec) -> Self {
        Self {
            observations: vec![0.0; spec.slots * spec.lengths.observation_len],
            privileged: vec![0.0; spec.slots * spec.privileged_len],
        }
    }
}

/// The result of one step in one slot.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BatchStep {
    /// The reward, finite. It is discounted; that of [`train_ppo`](crate::train_ppo)'s first critic head.
    pub reward: f32,
    /// The step failed for good. It ends the episode and is not discounted; the second critic head is its chance.
    pub failed: bool,
    /// The episode ended inside the decision process; a failure always does. No value follows.
    pub terminated: bool,
    /// The episode was cut from outside. The value goes on.
    pub truncated: bool,
    /// The step reached what the task calls success.
    pub success: bool,
    /// How much a failure matters in this episode, 0 to 1 ([`FailurePrice`](crate::FailurePrice)).
    pub caution: f32,
}

impl BatchStep {
    /// Returns true if the episode is over.
    #[must_use]
    pub const fn is_last(&self) -> bool {
        self.failed || self.terminated || self.truncated
    }
}

/// Ordinary environments as a batch: no privileged inputs, no failures.
#[derive(Debug)]
pub(crate) struct PlainBatch<'a, E> {
    pub(crate) environments: &'a mut [E],
    lengths: EnvironmentSpec,
}

impl<'a, E: Environment> PlainBatch<'a, E> {
    pub(crate) fn new(environments: &'a mut [E]) -> Result<Self, TrainError> {
        let lengths = EnvironmentSpec::common(environments)?;
        Ok(Self { environments, lengths })
    }
}

impl<E: Environment> BatchEnvironment for PlainBatch<'_, E> {
    fn spec(&self) -> BatchSpec {
        BatchSpec { slots: self.environments.len(), lengths: self.lengths, privileged_len: 0 }
    }

    fn reset(&mut self, slot: usize, rng: &mut Stream, seen: &mut SeenBatch) {
        let len = self.lengths.observation_len;
        self.environments[slot].reset(rng, &mut seen.observations[slot * len..][..len]);
    }

    fn step(&mut self, slots: Range<usize>, actions: &[f32], seen: &mut SeenBatch, steps: &mut [BatchStep]) {
        let EnvironmentSpec { observation_len, action_len } = self.lengths;
        let rows = actions.chunks_exact(action_len).zip(steps);
        for (slot, (action, step)) in slots.zip(rows) {
            let row = &mut seen.observations[slot * observation_len..][..observation_len];
            let made = self.environments[slot].step(action, row);
            *step = BatchStep {
                reward: made.reward,
                failed: false,
                terminated: made.terminated,
                truncated: made.truncated,
                success: made.success,
                caution: 0.0,
            };
        }
    }
}

impl From<BatchStep> for Step {
    fn from(step: BatchStep) -> Self {
        let BatchStep { reward, failed, terminated, truncated, success, .. } = step;
        Self { reward, terminated: terminated || failed, truncated, success }
    }
}

impl<B: BatchEnvironment> BatchEnvironment for &mut B {
    fn spec(&self) -> BatchSpec {
        (**self).spec()
    }

    fn reset(&mut self, slot: usize, rng: &mut Stream, seen: &mut SeenBatch) {
        (**self).reset(slot, rng, seen);
    }

    fn step(&mut self, slots: Range<usize>, actions: &[f32], seen: &mut SeenBatch, steps: &mut [BatchStep]) {
        (**self).step(slots, actions, seen, steps);
    }
}
