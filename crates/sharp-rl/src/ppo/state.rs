//! The networks, optimisers and counters of a run, as plain data and as bytes.
//!
//! A run continues from it bit for bit. Environments are not part of it: as with soft actor-critic, an unfinished
//! episode is repeated from its stream and its actions.

use rand::SeedableRng;
use serde::{Deserialize, Serialize};

use super::batch::BatchSpec;
use super::settings::PpoSettings;
use crate::actor::{Actor, layer_sizes};
use crate::adam::Adam;
use crate::environment::Stream;
use crate::network::Mlp;
use crate::normaliser::Normaliser;
use crate::state::ReplayRecord;
use crate::state_file::{EpisodeHeader, StreamRecord, read_adam, read_record, write_adam, write_record};
use crate::store::{StoreError, TensorReader, TensorWriter};

/// Everything that a run of proximal policy optimisation carries from iteration to iteration.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct PpoState {
    /// The policy. Its log deviations do not depend on the observation: they are the schedule's.
    pub actor: Actor,
    /// The critic. Inputs: the normalised observation, then the normalised privileged inputs. Outputs: the
    /// discounted reward to come, and the chance of a failure before its sigmoid.
    pub critic: Mlp,
    /// The scaling of the privileged inputs.
    pub privileged: Normaliser,
    /// Steps so far, all slots together.
    pub env_steps: u64,
    /// Gradient steps so far.
    pub updates: u64,
    /// Episodes finished so far.
    pub episodes: u64,
    /// Iterations finished so far.
    pub iterations: u64,
    pub(crate) actor_adam: Adam,
    pub(crate) critic_adam: Adam,
    /// The step size as it was steered, before its factor.
    pub(crate) learning_rate: f32,
    /// The actor came from elsewhere, with the scaling of its observations.
    pub(crate) is_given: bool,
    pub(crate) records: Vec<ReplayRecord>,
    pub(crate) action_rng: Stream,
    pub(crate) shuffle_rng: Stream,
}

impl PpoState {
    /// Fresh networks. The actor begins with zero means.
    #[must_use]
    pub fn new(spec: &BatchSpec, settings: &PpoSettings, rng: &mut Stream) -> Self {
        let mut actor = Actor::new(spec.lengths, &settings.hidden, rng);
        actor.network_mut().zero_last_layer();
        Self { is_given: false, ..Self::with_actor(actor, spec, settings, rng) }
    }

    /// A fresh critic beside `actor`, which learns on.
    #[must_use]
    pub fn with_actor(actor: Actor, spec: &BatchSpec, settings: &PpoSettings, rng: &mut Stream) -> Self {
        let mut critic = Mlp::new(&layer_sizes(spec.critic_len(), &settings.hidden, 2), rng);
        critic.zero_last_layer();
        let mut fork = || Stream::from_rng(rng);
        let record = |stream| ReplayRecord {
            start: None,
            stream,
            actions: Vec::new(),
            observation: vec![0.0; spec.lengths.observation_len],
        };
        Self {
            actor_adam: Adam::new(actor.network().parameters().len()),
            critic_adam: Adam::new(critic.parameters().len()),
            actor,
            critic,
            privileged: Normaliser::identity(spec.privileged_len),
            env_steps: 0,
            updates: 0,
            episodes: 0,
            iterations: 0,
            learning_rate: settings.learning_rate,
            is_given: true,
            action_rng: fork(),
            shuffle_rng: fork(),
            records: (0..spec.slots).map(|_| record(fork())).collect(),
        }
    }

    /// Components that only the critic sees.
    #[must_use]
    pub fn privileged_len(&self) -> usize {
        self.privileged.mean().len()
    }

    /// Returns true if all weights are finite.
    pub(crate) fn is_finite(&self) -> bool {
        let networks = [self.actor.network(), &self.critic];
        networks.into_iter().flat_map(Mlp::parameters).all(|value| value.is_finite())
    }

    /// Makes the actor draw with this `deviation` wherever it is used, whatever it sees.
    pub(crate) fn set_deviation(&mut self, deviation: f32) {
        let network = self.actor.network_mut();
        let inputs = network.sizes()[network.layer_count() - 1];
        let outputs = network.sizes()[network.layer_count()];
        let half = outputs / 2;
        let parameters = network.parameters_mut();
        let last = parameters.len() - outputs * (inputs + 1);
        let (weights, bias) = parameters[last..].split_at_mut(outputs * inputs);
        weights[half * inputs..].fill(0.0);
        bias[half..].fill(deviation.ln());
    }
}

#[derive(Serialize, Deserialize)]
struct PpoHeader {
    actor_sizes: Vec<usize>,
    critic_sizes: Vec<usize>,
    privileged_len: usize,
    adam_steps: [u64; 2],
    /// As bits, because text would have to be read back exactly.
    learning_rate: u32,
    is_given: bool,
    env_steps: u64,
    updates: u64,
    episodes: u64,
    iterations: u64,
    rngs: [StreamRecord; 2],
    records: Vec<EpisodeHeader>,
}

impl PpoState {
    const KIND: &'static str = "ppo";

    /// The whole state as bytes of a safetensors file.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut writer = TensorWriter::default();
        writer.actor("actor", &self.actor);
        writer.network("critic", &self.critic);
        if self.privileged_len() > 0 {
            writer.vector("privileged.mean", self.privileged.mean());
            writer.vector("privileged.std", self.privileged.std());
        }
        write_adam(&mut writer, "actor", &self.actor_adam);
        write_adam(&mut writer, "critic", &self.critic_adam);
        for (index, record) in self.records.iter().enumerate() {
            write_record(&mut writer, index, record);
        }
        let header = PpoHeader {
            actor_sizes: self.actor.network().sizes().to_vec(),
            critic_sizes: self.critic.sizes().to_vec(),
            privileged_len: self.privileged_len(),
            adam_steps: [self.actor_adam.steps, self.critic_adam.steps],
            learning_rate: self.learning_rate.to_bits(),
            is_given: self.is_given,
            env_steps: self.env_steps,
            updates: self.updates,
            episodes: self.episodes,
            iterations: self.iterations,
            rngs: [&self.action_rng, &self.shuffle_rng].map(StreamRecord::from),
            records: self.records.iter().map(EpisodeHeader::from).collect(),
        };
        writer.finish(Self::KIND, &header)
    }

    /// Reads what [`Self::to_bytes`] wrote, bit for bit.
    ///
    /// # Errors
    /// As [`Actor::from_bytes`].
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, StoreError> {
        let (reader, header) = TensorReader::open::<PpoHeader>(bytes, Self::KIND)?;
        let actor = reader.actor("actor", &header.actor_sizes)?;
        let critic = reader.network("critic", &header.critic_sizes)?;
        let spec = actor.spec();
        let sizes = &header.critic_sizes;
        if sizes[0] != spec.observation_len + header.privileged_len || sizes.last() != Some(&2) {
            return Err(StoreError::Header(format!(
                "critic sizes {sizes:?} do not fit the actor's {spec:?}"
            )));
        }
        let privileged = match header.privileged_len {
            0 => Normaliser::identity(0),
            len => {
                let part = |name: &str| reader.floats(&format!("privileged.{name}"), &[len]);
                Normaliser::new(part("mean")?, part("std")?)?
            }
        };
        let [actor_steps, critic_steps] = header.adam_steps;
        let records = header.records.into_iter().enumerate();
        let records = records.map(|(index, episode)| read_record(&reader, index, episode, spec));
        let records = records.collect::<Result<_, _>>()?;
        let [action_rng, shuffle_rng] = header.rngs.map(Stream::from);
        Ok(Self {
            actor_adam: read_adam(&reader, "actor", actor.network().parameters().len(), actor_steps)?,
            critic_adam: read_adam(&reader, "critic", critic.parameters().len(), critic_steps)?,
            actor,
            critic,
            privileged,
            env_steps: header.env_steps,
            updates: header.updates,
            episodes: header.episodes,
            iterations: header.iterations,
            learning_rate: f32::from_bits(header.learning_rate),
            is_given: header.is_given,
            records,
            action_rng,
            shuffle_rng,
        })
    }
}
