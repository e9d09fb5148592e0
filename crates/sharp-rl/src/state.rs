//! The state of a training run. It is complete: a run continues from it bit for bit.
//!
//! Environments are not part of it. An unfinished episode is rebuilt: its environment is reset with
//! the stream that the episode began with, and its actions are repeated. This is why an
//! [`Environment`](crate::Environment) must be a function of the two.

use rand::SeedableRng;
use serde::{Deserialize, Serialize};

use crate::buffer::ReplayBuffer;
use crate::environment::{EnvironmentSpec, Stream};
use crate::evaluation::Evaluation;
use crate::sac_state::SacState;
use crate::settings::SacSettings;

/// Everything that a run carries from step to step.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct TrainState {
    /// Networks and optimiser.
    pub sac: SacState,
    /// Environment steps so far, all environments together.
    pub env_steps: u64,
    /// Gradient steps so far.
    pub updates: u64,
    /// Episodes finished so far.
    pub episodes: u64,
    /// The best networks so far; `None` before the first evaluation.
    pub best: Option<BestNetworks>,
    pub(crate) buffer: ReplayBuffer,
    pub(crate) records: Vec<ReplayRecord>,
    /// Draws the policy's actions.
    pub(crate) action_rng: Stream,
    /// Draws batches and their noise.
    pub(crate) batch_rng: Stream,
    /// Draws evaluation episodes.
    pub(crate) evaluation_rng: Stream,
    /// Environment steps at the last evaluation; 0 before the first.
    pub(crate) evaluated_at: u64,
    /// The attempt under way.
    pub(crate) attempt: TrainingAttempt,
}

/// What a run has done since it began, or began anew ([`RestartRule`](crate::RestartRule)).
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct TrainingAttempt {
    /// Environment steps of the run before it.
    pub(crate) began_at: u64,
    /// Gradient steps of the run before it.
    pub(crate) updates_before: u64,
    /// The best mean return of its evaluations; `None` before the first.
    pub(crate) best_return: Option<f64>,
}

/// The networks with the best evaluation so far.
#[derive(Clone, Debug, PartialEq)]
pub struct BestNetworks {
    /// The networks.
    pub sac: SacState,
    /// Their evaluation.
    pub evaluation: Evaluation,
}

/// The current episode of one environment: all that is needed to repeat it.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct ReplayRecord {
    /// The stream before the reset of this episode; `None` before the first.
    pub(crate) start: Option<Stream>,
    /// The stream now.
    pub(crate) stream: Stream,
    /// The actions so far, end to end.
    pub(crate) actions: Vec<f32>,
    /// The last observation, to detect an environment that does not repeat its episode.
    pub(crate) observation: Vec<f32>,
}

impl TrainState {
    /// The state before the first step, for `count` environments.
    pub(crate) fn new(
        spec: EnvironmentSpec,
        settings: &SacSettings,
        sac: SacState,
        count: usize,
        rng: &mut Stream,
    ) -> Self {
        let mut fork = || Stream::from_rng(rng);
        let record = |stream| ReplayRecord {
            start: None,
            stream,
            actions: Vec::new(),
            observation: vec![0.0; spec.observation_len],
        };
        Self {
            sac,
            env_steps: 0,
            updates: 0,
            episodes: 0,
            best: None,
            buffer: ReplayBuffer::new(spec, settings.buffer_capacity),
            action_rng: fork(),
            batch_rng: fork(),
            evaluation_rng: fork(),
            records: (0..count).map(|_| record(fork())).collect(),
            evaluated_at: 0,
            attempt: TrainingAttempt::default(),
        }
    }

    /// Begins anew: fresh networks and an empty buffer. Episodes, counters, streams and the best networks stay.
    pub(crate) fn begin_anew(&mut self, settings: &SacSettings) {
        let spec = self.spec();
        self.sac = SacState::new(spec, settings, &mut Stream::from_rng(&mut self.action_rng));
        self.buffer = ReplayBuffer::new(spec, settings.buffer_capacity);
        self.attempt =
            TrainingAttempt { began_at: self.env_steps, updates_before: self.updates, best_return: None };
    }

    /// The lengths of observations and actions.
    #[must_use]
    pub fn spec(&self) -> EnvironmentSpec {
        self.sac.actor.spec()
    }

    /// Transitions in the replay buffer.
    #[must_use]
    pub const fn buffer_len(&self) -> usize {
        self.buffer.len()
    }
}
