//! Bytes of [`SacState`] and [`TrainState`]: safetensors files with one JSON header.

use rand::SeedableRng;
use serde::{Deserialize, Serialize};

use crate::adam::Adam;
use crate::buffer::ReplayBuffer;
use crate::environment::{EnvironmentSpec, Stream};
use crate::evaluation::Evaluation;
use crate::sac_state::SacState;
use crate::state::{BestNetworks, ReplayRecord, TrainState, TrainingAttempt};
use crate::store::{StoreError, TensorReader, TensorWriter};

/// A stream as text: seed and position in 32-bit words.
#[derive(Serialize, Deserialize)]
pub(crate) struct StreamRecord {
    seed: [u8; 32],
    stream: u64,
    /// High and low half of the position.
    word: [u64; 2],
}

impl From<&Stream> for StreamRecord {
    fn from(stream: &Stream) -> Self {
        let word = stream.get_word_pos();
        Self {
            seed: stream.get_seed(),
            stream: stream.get_stream(),
            word: [(word >> 64) as u64, word as u64],
        }
    }
}

impl From<StreamRecord> for Stream {
    fn from(record: StreamRecord) -> Self {
        let mut stream = Self::from_seed(record.seed);
        stream.set_stream(record.stream);
        stream.set_word_pos(u128::from(record.word[0]) << 64 | u128::from(record.word[1]));
        stream
    }
}

#[derive(Serialize, Deserialize)]
struct SacHeader {
    actor_sizes: Vec<usize>,
    critic_sizes: Vec<usize>,
    /// Steps of the actor's, the critics' and the temperature's optimiser.
    adam_steps: [u64; 4],
}

impl SacHeader {
    fn new(sac: &SacState) -> Self {
        let [first, second] = sac.critic_adams.each_ref().map(|adam| adam.steps);
        Self {
            actor_sizes: sac.actor.network().sizes().to_vec(),
            critic_sizes: sac.critics[0].sizes().to_vec(),
            adam_steps: [sac.actor_adam.steps, first, second, sac.alpha_adam.steps],
        }
    }
}

#[derive(Serialize, Deserialize)]
struct TrainHeader {
    sac: SacHeader,
    best: Option<(SacHeader, Evaluation)>,
    env_steps: u64,
    updates: u64,
    episodes: u64,
    evaluated_at: u64,
    /// Files from before runs could begin anew have none: theirs is the first.
    #[serde(default)]
    attempt: Option<TrainingAttempt>,
    buffer_capacity: usize,
    buffer_len: usize,
    buffer_next: usize,
    rngs: [StreamRecord; 3],
    /// One for each environment. The name is part of the format.
    #[serde(rename = "lanes")]
    records: Vec<EpisodeHeader>,
}

#[derive(Serialize, Deserialize)]
pub(crate) struct EpisodeHeader {
    start: Option<StreamRecord>,
    stream: StreamRecord,
    action_values: usize,
}

impl From<&ReplayRecord> for EpisodeHeader {
    fn from(record: &ReplayRecord) -> Self {
        Self {
            start: record.start.as_ref().map(StreamRecord::from),
            stream: (&record.stream).into(),
            action_values: record.actions.len(),
        }
    }
}

impl SacState {
    const KIND: &'static str = "sac";

    /// All networks and optimisers as bytes of a safetensors file, for fine-tuning elsewhere.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut writer = TensorWriter::default();
        write_sac(&mut writer, "", self);
        writer.finish(Self::KIND, &SacHeader::new(self))
    }

    /// Reads what [`Self::to_bytes`] wrote, bit for bit.
    ///
    /// # Errors
    /// As [`Actor::from_bytes`](crate::Actor::from_bytes).
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, StoreError> {
        let (reader, header) = TensorReader::open::<SacHeader>(bytes, Self::KIND)?;
        read_sac(&reader, "", &header)
    }
}

impl TrainState {
    const KIND: &'static str = "train-state";

    /// The whole state as bytes of a safetensors file.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut writer = TensorWriter::default();
        write_sac(&mut writer, "", &self.sac);
        if let Some(best) = &self.best {
            write_sac(&mut writer, "best.", &best.sac);
        }
        write_buffer(&mut writer, &self.buffer);
        for (index, record) in self.records.iter().enumerate() {
            write_record(&mut writer, index, record);
        }
        let header = TrainHeader {
            sac: SacHeader::new(&self.sac),
            best: self.best.as_ref().map(|best| (SacHeader::new(&best.sac), best.evaluation)),
            env_steps: self.env_steps,
            updates: self.updates,
            episodes: self.episodes,
            evaluated_at: self.evaluated_at,
            attempt: Some(self.attempt),
            buffer_capacity: self.buffer.capacity,
            buffer_len: self.buffer.len(),
            buffer_next: self.buffer.next,
            rngs: [&self.action_rng, &self.batch_rng, &self.evaluation_rng].map(StreamRecord::from),
            records: self.records.iter().map(EpisodeHeader::from).collect(),
        };
        writer.finish(Self::KIND, &header)
    }

    /// Reads what [`Self::to_bytes`] wrote, bit for bit.
    ///
    /// # Errors
    /// As [`Actor::from_bytes`](crate::Actor::from_bytes).
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, StoreError> {
        let (reader, header) = TensorReader::open::<TrainHeader>(bytes, Self::KIND)?;
        let sac = read_sac(&reader, "", &header.sac)?;
        let spec = sac.actor.spec();
        let best = match &header.best {
            Some((sac, evaluation)) => {
                Some(BestNetworks { sac: read_sac(&reader, "best.", sac)?, evaluation: *evaluation })
            }
            None => None,
        };
        let best_return = header.best.as_ref().map(|best| best.1.mean_return);
        let attempt = header.attempt.unwrap_or(TrainingAttempt { best_return, ..TrainingAttempt::default() });
        let TrainingAttempt { began_at, updates_before, .. } = attempt;
        if began_at > header.env_steps || updates_before > header.updates {
            let what =
                format!("an attempt from step {began_at} and update {updates_before}, which lie ahead");
            return Err(StoreError::Header(what));
        }
        let buffer = read_buffer(&reader, spec, &header)?;
        let episodes = header.records.into_iter().enumerate();
        let records = episodes.map(|(index, episode)| read_record(&reader, index, episode, spec));
        let records = records.collect::<Result<_, _>>()?;
        let [action_rng, batch_rng, evaluation_rng] = header.rngs.map(Stream::from);
        Ok(Self {
            sac,
            env_steps: header.env_steps,
            updates: header.updates,
            episodes: header.episodes,
            best,
            buffer,
            records,
            action_rng,
            batch_rng,
            evaluation_rng,
            evaluated_at: header.evaluated_at,
            attempt,
        })
    }
}

fn write_sac(writer: &mut TensorWriter, prefix: &str, sac: &SacState) {
    writer.actor(&format!("{prefix}actor"), &sac.actor);
    write_adam(writer, &format!("{prefix}actor"), &sac.actor_adam);
    for index in 0..2 {
        writer.network(&format!("{prefix}critic{index}"), &sac.critics[index]);
        writer.network(&format!("{prefix}target{index}"), &sac.targets[index]);
        write_adam(writer, &format!("{prefix}critic{index}"), &sac.critic_adams[index]);
    }
    writer.vector(&format!("{prefix}log_alpha"), &[sac.log_alpha]);
    write_adam(writer, &format!("{prefix}log_alpha"), &sac.alpha_adam);
}

fn read_sac(reader: &TensorReader<'_>, prefix: &str, header: &SacHeader) -> Result<SacState, StoreError> {
    let actor = reader.actor(&format!("{prefix}actor"), &header.actor_sizes)?;
    let network = |name: &str| reader.network(&format!("{prefix}{name}"), &header.critic_sizes);
    let adam = |name: &str, len, steps| read_adam(reader, &format!("{prefix}{name}"), len, steps);
    let critics = [network("critic0")?, network("critic1")?];
    let targets = [network("target0")?, network("target1")?];
    let (actor_len, critic_len) = (actor.network().parameters().len(), critics[0].parameters().len());
    let [actor_steps, first_steps, second_steps, alpha_steps] = header.adam_steps;
    let spec = actor.spec();
    if critics[0].sizes()[0] != spec.observation_len + spec.action_len
        || critics[0].sizes().last() != Some(&1)
    {
        let sizes = critics[0].sizes();
        return Err(StoreError::Header(format!("critic sizes {sizes:?} do not fit the actor's {spec:?}")));
    }
    Ok(SacState {
        actor,
        critics,
        targets,
        log_alpha: reader.floats(&format!("{prefix}log_alpha"), &[1])?[0],
        actor_adam: adam("actor", actor_len, actor_steps)?,
        critic_adams: [adam("critic0", critic_len, first_steps)?, adam("critic1", critic_len, second_steps)?],
        alpha_adam: adam("log_alpha", 1, alpha_steps)?,
    })
}

pub(crate) fn write_adam(writer: &mut TensorWriter, name: &str, adam: &Adam) {
    writer.vector(&format!("{name}.adam.first"), &adam.first);
    writer.vector(&format!("{name}.adam.second"), &adam.second);
}

pub(crate) fn read_adam(
    reader: &TensorReader<'_>,
    name: &str,
    len: usize,
    steps: u64,
) -> Result<Adam, StoreError> {
    Ok(Adam {
        first: reader.floats(&format!("{name}.adam.first"), &[len])?,
        second: reader.floats(&format!("{name}.adam.second"), &[len])?,
        steps,
    })
}

fn write_buffer(writer: &mut TensorWriter, buffer: &ReplayBuffer) {
    let EnvironmentSpec { observation_len, action_len } = buffer.spec;
    let len = buffer.len();
    writer.floats("buffer.observations", &[len, observation_len], &buffer.observations);
    writer.floats("buffer.actions", &[len, action_len], &buffer.actions);
    writer.vector("buffer.rewards", &buffer.rewards);
    writer.bytes("buffer.steps", &buffer.steps);
    writer.floats("buffer.next_observations", &[len, observation_len], &buffer.next_observations);
    writer.bytes("buffer.terminated", &buffer.terminated);
    writer.bytes("buffer.truncated", &buffer.truncated);
}

fn read_buffer(
    reader: &TensorReader<'_>,
    spec: EnvironmentSpec,
    header: &TrainHeader,
) -> Result<ReplayBuffer, StoreError> {
    let TrainHeader { buffer_len: len, buffer_capacity: capacity, buffer_next: next, .. } = *header;
    // While the buffer is filling, the next slot is the first that holds nothing yet.
    if capacity == 0 || len > capacity || next >= capacity || (len < capacity && next != len) {
        let what = format!("a replay buffer of {len} in {capacity} with slot {next} next");
        return Err(StoreError::Header(what));
    }
    Ok(ReplayBuffer {
        spec,
        capacity,
        next,
        observations: reader.floats("buffer.observations", &[len, spec.observation_len])?,
        actions: reader.floats("buffer.actions", &[len, spec.action_len])?,
        rewards: reader.floats("buffer.rewards", &[len])?,
        steps: reader.bytes("buffer.steps", len)?,
        next_observations: reader.floats("buffer.next_observations", &[len, spec.observation_len])?,
        terminated: reader.bytes("buffer.terminated", len)?,
        truncated: reader.bytes("buffer.truncated", len)?,
    })
}

/// Writes the unfinished episode of environment `index`, all but its header.
pub(crate) fn write_record(writer: &mut TensorWriter, index: usize, record: &ReplayRecord) {
    writer.vector(&format!("lane.{index}.actions"), &record.actions);
    writer.vector(&format!("lane.{index}.observation"), &record.observation);
}

pub(crate) fn read_record(
    reader: &TensorReader<'_>,
    index: usize,
    header: EpisodeHeader,
    spec: EnvironmentSpec,
) -> Result<ReplayRecord, StoreError> {
    Ok(ReplayRecord {
        start: header.start.map(Stream::from),
        stream: header.stream.into(),
        actions: reader.floats(&format!("lane.{index}.actions"), &[header.action_values])?,
        observation: reader.floats(&format!("lane.{index}.observation"), &[spec.observation_len])?,
    })
}
