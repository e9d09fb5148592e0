//! Small environments that a learner solves within seconds, for tests and examples.

use std::ops::Range;

use rand::{RngExt, SeedableRng};
use rand_distr::StandardNormal;

use crate::environment::{Environment, EnvironmentSpec, Step, Stream};
use crate::ppo::{BatchEnvironment, BatchSpec, BatchStep, SeenBatch};

/// The best action repeats the observation; the reward is minus the squared difference.
#[derive(Clone, Debug)]
pub struct Identity {
    len: usize,
    steps_left: usize,
    target: Vec<f32>,
    rng: Stream,
}

impl Identity {
    /// Steps in an episode, which a time limit truncates.
    pub const EPISODE_STEPS: usize = 10;

    /// An identity over vectors of `len` components.
    #[must_use]
    pub fn new(len: usize) -> Self {
        Self { len, steps_left: 0, target: vec![0.0; len], rng: Stream::seed_from_u64(0) }
    }

    fn draw(&mut self, observation: &mut [f32]) {
        for (target, observation) in self.target.iter_mut().zip(observation) {
            *target = self.rng.random_range(-0.9..0.9);
            *observation = *target;
        }
    }
}

impl Environment for Identity {
    fn spec(&self) -> EnvironmentSpec {
        EnvironmentSpec { observation_len: self.len, action_len: self.len }
    }

    fn reset(&mut self, rng: &mut Stream, observation: &mut [f32]) {
        self.rng = Stream::from_rng(rng);
        self.steps_left = Self::EPISODE_STEPS;
        self.draw(observation);
    }

    fn step(&mut self, action: &[f32], observation: &mut [f32]) -> Step {
        let error: f32 = action.iter().zip(&self.target).map(|(a, t)| (a - t) * (a - t)).sum();
        self.steps_left -= 1;
        self.draw(observation);
        let truncated = self.steps_left == 0;
        Step { reward: -error, terminated: false, truncated, success: truncated && error < 0.05 }
    }
}

/// A point mass on a plane that must reach the origin under noisy acceleration.
///
/// Observation: position (x, y) and velocity. Action: acceleration. The episode begins at a
/// distance of 1, terminates within 0.15 of the origin and is truncated after
/// [`Self::EPISODE_STEPS`] steps.
#[derive(Clone, Debug)]
pub struct PointMass {
    state: [f32; 4],
    steps_left: usize,
    rng: Stream,
}

impl Default for PointMass {
    fn default() -> Self {
        Self { state: [0.0; 4], steps_left: 0, rng: Stream::seed_from_u64(0) }
    }
}

impl PointMass {
    /// Steps after which an episode is truncated.
    pub const EPISODE_STEPS: usize = 40;
    /// Seconds in a step.
    const DT_S: f32 = 0.2;

    fn distance(&self) -> f32 {
        self.state[0].hypot(self.state[1])
    }
}

impl Environment for PointMass {
    fn spec(&self) -> EnvironmentSpec {
        EnvironmentSpec { observation_len: 4, action_len: 2 }
    }

    fn reset(&mut self, rng: &mut Stream, observation: &mut [f32]) {
        self.rng = Stream::from_rng(rng);
        let angle = self.rng.random_range(0.0..std::f32::consts::TAU);
        let (sin, cos) = angle.sin_cos();
        self.state = [cos, sin, 0.0, 0.0];
        self.steps_left = Self::EPISODE_STEPS;
        observation.copy_from_slice(&self.state);
    }

    fn step(&mut self, action: &[f32], observation: &mut [f32]) -> Step {
        let before = self.distance();
        let (position, velocity) = self.state.split_at_mut(2);
        for ((position, velocity), push) in position.iter_mut().zip(velocity).zip(action) {
            let noise: f32 = self.rng.sample(StandardNormal);
            *velocity = 0.9 * *velocity + Self::DT_S * (push + 0.1 * noise);
            *position += Self::DT_S * *velocity;
        }
        self.steps_left -= 1;
        observation.copy_from_slice(&self.state);
        let success = self.distance() < 0.15;
        let reward = before - self.distance() - 0.02 + if success { 1.0 } else { 0.0 };
        Step { reward, terminated: success, truncated: !success && self.steps_left == 0, success }
    }
}

/// Episodes along a ledge, side by side: speed pays, and a fast step fails with a chance of one in ten.
///
/// Half of the episodes have caution 0, the others [`Self::caution_max`]. The actor sees the caution; the critic is told
/// a constant. An episode ends with a failure, or well with a chance of one in ten at each step.
#[derive(Clone, Debug)]
pub struct Ledge {
    /// Caution of the careful episodes; 1 in a sound environment.
    pub caution_max: f32,
    cautions: Vec<f32>,
    streams: Vec<Stream>,
}

impl Ledge {
    /// So many `slots`.
    #[must_use]
    pub fn new(slots: usize) -> Self {
        Self { caution_max: 1.0, cautions: vec![0.0; slots], streams: vec![Stream::seed_from_u64(0); slots] }
    }
}

impl BatchEnvironment for Ledge {
    fn spec(&self) -> BatchSpec {
        let lengths = EnvironmentSpec { observation_len: 1, action_len: 1 };
        BatchSpec { slots: self.cautions.len(), lengths, privileged_len: 1 }
    }

    fn reset(&mut self, slot: usize, rng: &mut Stream, seen: &mut SeenBatch) {
        self.streams[slot] = Stream::from_rng(rng);
        self.cautions[slot] = if self.streams[slot].random::<bool>() { self.caution_max } else { 0.0 };
        seen.observations[slot] = 2.0 * self.cautions[slot] - 1.0;
        seen.privileged[slot] = 0.5;
    }

    fn step(&mut self, slots: Range<usize>, actions: &[f32], _seen: &mut SeenBatch, steps: &mut [BatchStep]) {
        for (slot, (action, step)) in slots.zip(actions.iter().zip(steps)) {
            let risk = 0.1 * (0.5 + 0.5 * action);
            let failed = self.streams[slot].random::<f32>() < risk;
            let terminated = failed || self.streams[slot].random::<f32>() < 0.1;
            let caution = self.cautions[slot];
            *step = BatchStep { reward: *action, failed, terminated, caution, ..BatchStep::default() };
        }
    }
}
