//! The replay buffer: a ring of transitions, sampled uniformly with the caller's generator.
//!
//! Termination and truncation are kept apart: targets bootstrap after a truncation.

use rand::RngExt;
use rand_distr::StandardNormal;

use crate::environment::{EnvironmentSpec, Stream};
use crate::normaliser::Normaliser;

/// One transition over one or more steps, as borrowed vectors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ReplayTransition<'a> {
    /// The first observation.
    pub observation: &'a [f32],
    /// The first action.
    pub action: &'a [f32],
    /// The discounted sum of the rewards of its steps.
    pub reward: f32,
    /// Steps from first to last observation, 1 to 255.
    pub steps: u8,
    /// The last observation.
    pub next_observation: &'a [f32],
    /// The episode terminated there.
    pub terminated: bool,
    /// The episode was truncated there.
    pub truncated: bool,
}

/// A ring of transitions. When it is full, the oldest is overwritten.
#[derive(Clone, Debug, PartialEq)]
pub struct ReplayBuffer {
    pub(crate) spec: EnvironmentSpec,
    pub(crate) capacity: usize,
    /// The slot that is written next.
    pub(crate) next: usize,
    pub(crate) observations: Vec<f32>,
    pub(crate) actions: Vec<f32>,
    pub(crate) rewards: Vec<f32>,
    pub(crate) steps: Vec<u8>,
    pub(crate) next_observations: Vec<f32>,
    pub(crate) terminated: Vec<u8>,
    pub(crate) truncated: Vec<u8>,
}

impl ReplayBuffer {
    /// An empty buffer for `capacity` transitions. Its memory grows with what is stored.
    ///
    /// # Panics
    /// If `capacity` is zero.
    #[must_use]
    pub fn new(spec: EnvironmentSpec, capacity: usize) -> Self {
        assert!(capacity > 0, "a replay buffer of capacity 0");
        Self {
            spec,
            capacity,
            next: 0,
            observations: Vec::new(),
            actions: Vec::new(),
            rewards: Vec::new(),
            steps: Vec::new(),
            next_observations: Vec::new(),
            terminated: Vec::new(),
            truncated: Vec::new(),
        }
    }

    /// Transitions stored.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.rewards.len()
    }

    /// Returns true if nothing is stored.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.rewards.is_empty()
    }

    /// The transition in `slot`, or `None` if it holds nothing yet.
    #[must_use]
    pub fn get(&self, slot: usize) -> Option<ReplayTransition<'_>> {
        let EnvironmentSpec { observation_len, action_len } = self.spec;
        (slot < self.len()).then(|| ReplayTransition {
            observation: row(&self.observations, slot, observation_len),
            action: row(&self.actions, slot, action_len),
            reward: self.rewards[slot],
            steps: self.steps[slot],
            next_observation: row(&self.next_observations, slot, observation_len),
            terminated: self.terminated[slot] != 0,
            truncated: self.truncated[slot] != 0,
        })
    }

    /// Stores `transition`. A full buffer overwrites the oldest one.
    ///
    /// # Panics
    /// If a vector has another length than the buffer's.
    pub fn push(&mut self, transition: ReplayTransition<'_>) {
        let EnvironmentSpec { observation_len, action_len } = self.spec;
        assert_eq!(transition.observation.len(), observation_len, "length of the observation");
        assert_eq!(transition.next_observation.len(), observation_len, "length of the next observation");
        assert_eq!(transition.action.len(), action_len, "length of the action");
        let slot = self.next;
        put(&mut self.observations, slot, transition.observation);
        put(&mut self.actions, slot, transition.action);
        put(&mut self.rewards, slot, &[transition.reward]);
        put(&mut self.steps, slot, &[transition.steps]);
        put(&mut self.next_observations, slot, transition.next_observation);
        put(&mut self.terminated, slot, &[u8::from(transition.terminated)]);
        put(&mut self.truncated, slot, &[u8::from(transition.truncated)]);
        self.next = (slot + 1) % self.capacity;
    }

    /// Fills `batch` with transitions drawn uniformly, with repetition, and fresh noise.
    ///
    /// # Panics
    /// If the buffer is empty.
    pub fn sample(&self, how: &SampleSettings<'_>, rng: &mut Stream, batch: &mut Batch) {
        assert!(!self.is_empty(), "sampling from an empty replay buffer");
        let EnvironmentSpec { observation_len, action_len } = self.spec;
        for index in 0..batch.len {
            let slot = rng.random_range(0..self.len());
            let observation = row(&self.observations, slot, observation_len);
            let next_observation = row(&self.next_observations, slot, observation_len);
            row_mut(&mut batch.observations, index, observation_len).copy_from_slice(observation);
            row_mut(&mut batch.next_observations, index, observation_len).copy_from_slice(next_observation);
            row_mut(&mut batch.actions, index, action_len).copy_from_slice(row(
                &self.actions,
                slot,
                action_len,
            ));
            batch.rewards[index] = how.reward_scale * self.rewards[slot];
            // Only a termination cuts the value off, so `truncated` does not matter here.
            batch.discounts[index] =
                if self.terminated[slot] != 0 { 0.0 } else { how.gamma.powi(i32::from(self.steps[slot])) };
        }
        how.normaliser.apply(&mut batch.observations);
        how.normaliser.apply(&mut batch.next_observations);
        for noise in batch.noise.iter_mut().chain(&mut batch.next_noise) {
            *noise = rng.sample(StandardNormal);
        }
    }
}

/// How stored transitions become a batch.
#[derive(Clone, Copy, Debug)]
pub struct SampleSettings<'a> {
    /// Discount per environment step.
    pub gamma: f32,
    /// Factor on rewards.
    pub reward_scale: f32,
    /// The scaling of observations.
    pub normaliser: &'a Normaliser,
}

/// Transitions for one update, with the noise of its two policy samples.
///
/// Because the noise is part of the batch, an update draws nothing: equal batches give equal updates.
#[derive(Clone, Debug, PartialEq)]
pub struct Batch {
    /// Rows.
    pub len: usize,
    /// Batch x observation, normalised.
    pub observations: Vec<f32>,
    /// Batch x action.
    pub actions: Vec<f32>,
    /// Scaled, summed over the transition's steps.
    pub rewards: Vec<f32>,
    /// Factor on the value of the next observation: γ to the number of steps, 0 after a termination.
    pub discounts: Vec<f32>,
    /// Batch x observation, normalised.
    pub next_observations: Vec<f32>,
    /// Batch x action, standard normal: the policy's noise at `observations`.
    pub noise: Vec<f32>,
    /// The same at `next_observations`.
    pub next_noise: Vec<f32>,
}

impl Batch {
    /// A batch of `len` transitions, all zero.
    #[must_use]
    pub fn new(spec: EnvironmentSpec, len: usize) -> Self {
        Self {
            len,
            observations: vec![0.0; len * spec.observation_len],
            actions: vec![0.0; len * spec.action_len],
            rewards: vec![0.0; len],
            discounts: vec![0.0; len],
            next_observations: vec![0.0; len * spec.observation_len],
            noise: vec![0.0; len * spec.action_len],
            next_noise: vec![0.0; len * spec.action_len],
        }
    }
}

fn row(data: &[f32], index: usize, len: usize) -> &[f32] {
    &data[index * len..][..len]
}

fn row_mut(data: &mut [f32], index: usize, len: usize) -> &mut [f32] {
    &mut data[index * len..][..len]
}

/// Writes `values` as row `slot`, which exists already or is the next one.
fn put<T: Copy>(data: &mut Vec<T>, slot: usize, values: &[T]) {
    let start = slot * values.len();
    if start == data.len() {
        data.extend_from_slice(values);
    } else {
        data[start..start + values.len()].copy_from_slice(values);
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    const SPEC: EnvironmentSpec = EnvironmentSpec { observation_len: 1, action_len: 1 };

    fn push(buffer: &mut ReplayBuffer, value: f32, steps: u8, terminated: bool, truncated: bool) {
        buffer.push(ReplayTransition {
            observation: &[value],
            action: &[-value],
            reward: 10.0 * value,
            steps,
            next_observation: &[value + 1.0],
            terminated,
            truncated,
        });
    }

    fn sample(buffer: &ReplayBuffer, seed: u64, len: usize) -> Batch {
        let normaliser = Normaliser::identity(1);
        let how = SampleSettings { gamma: 0.5, reward_scale: 0.1, normaliser: &normaliser };
        let mut batch = Batch::new(SPEC, len);
        buffer.sample(&how, &mut Stream::seed_from_u64(seed), &mut batch);
        batch
    }

    #[test]
    fn only_termination_cuts_the_value_off() {
        for (steps, terminated, truncated, discount) in
            [(1, false, false, 0.5), (1, false, true, 0.5), (3, false, true, 0.125), (3, true, false, 0.0)]
        {
            let mut buffer = ReplayBuffer::new(SPEC, 4);
            push(&mut buffer, 2.0, steps, terminated, truncated);
            let batch = sample(&buffer, 1, 1);
            assert_eq!(batch.discounts, [discount], "{steps} steps, {terminated} {truncated}");
            assert_eq!(batch.rewards, [2.0], "scaled");
        }
    }

    #[test]
    fn a_full_buffer_overwrites_the_oldest() {
        let mut buffer = ReplayBuffer::new(SPEC, 3);
        for value in 0..5 {
            push(&mut buffer, value as f32, 1, false, false);
        }
        let stored: Vec<f32> = (0..3).map(|slot| buffer.get(slot).expect("filled").observation[0]).collect();
        assert_eq!(stored, [3.0, 4.0, 2.0]);
        assert_eq!(buffer.get(3), None);
        assert_eq!(buffer.len(), 3);
    }

    #[test]
    fn sampling_depends_on_the_stream_only_and_reaches_everything() {
        let mut buffer = ReplayBuffer::new(SPEC, 8);
        for value in 0..8 {
            push(&mut buffer, value as f32, 1, false, false);
        }
        assert_eq!(sample(&buffer, 1, 64), sample(&buffer, 1, 64), "equal streams");
        assert_ne!(sample(&buffer, 1, 64), sample(&buffer, 2, 64), "other streams");
        let batch = sample(&buffer, 3, 400);
        for value in 0..8 {
            let count = batch.observations.iter().filter(|o| **o == value as f32).count();
            assert!((25..80).contains(&count), "{value} drawn {count} times of 400, expected about 50");
        }
        for row in 0..400 {
            assert_eq!(batch.actions[row], -batch.observations[row], "rows stay together");
            assert_eq!(batch.next_observations[row], batch.observations[row] + 1.0, "rows stay together");
        }
    }
}
