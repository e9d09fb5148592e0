//! The first phase: what the policy does in every slot for a number of steps.

use rand::RngExt;
use rand_distr::StandardNormal;

use super::batch::{BatchEnvironment, BatchSpec, BatchStep, SeenBatch};
use super::state::PpoState;
use crate::error::{TrainError, check_observation, check_reward};
use crate::evaluation::{EPISODE_LIMIT, EpisodeSums};
use crate::network::Tape;
use crate::normaliser::Normaliser;

/// Everything that was seen and done in a rollout. Rows come step by step, within a step slot by slot.
#[derive(Debug)]
pub(crate) struct RolloutRows {
    pub(crate) spec: BatchSpec,
    /// Rows x critic inputs: the observation, then what only the critic sees; normalised after collecting.
    pub(crate) inputs: Vec<f32>,
    /// Rows x actions as they were drawn, before they were cut to \[-1, 1\].
    pub(crate) actions: Vec<f32>,
    /// Rows x actions: tanh of the actor's mean.
    pub(crate) means: Vec<f32>,
    pub(crate) steps: Vec<BatchStep>,
    /// What is seen after the last step: slots x critic inputs.
    pub(crate) last_inputs: Vec<f32>,
    /// The rows of truncated steps, and the last that was seen in their episodes: one row of critic inputs each.
    pub(crate) cut_rows: Vec<usize>,
    pub(crate) cut_inputs: Vec<f32>,
}

/// Sums over the episodes that ended in a rollout.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct EndedEpisodes {
    pub(crate) count: u64,
    pub(crate) total_return: f64,
    pub(crate) steps: u64,
    pub(crate) successes: u64,
}

/// The slots, where they are in their episodes, and buffers for acting in all of them at once.
#[derive(Debug)]
pub(crate) struct Slots {
    pub(crate) seen: SeenBatch,
    pub(crate) current: Vec<EpisodeSums>,
    /// Normalised observations of all slots.
    actor_inputs: Vec<f32>,
    /// Actions as the environments get them.
    actions: Vec<f32>,
    steps: Vec<BatchStep>,
    tape: Tape,
}

impl Slots {
    pub(crate) fn new(spec: &BatchSpec, state: &PpoState) -> Self {
        Self {
            seen: SeenBatch::new(spec),
            current: vec![EpisodeSums::default(); spec.slots],
            actor_inputs: vec![0.0; spec.slots * spec.lengths.observation_len],
            actions: vec![0.0; spec.slots * spec.lengths.action_len],
            steps: vec![BatchStep::default(); spec.slots],
            tape: Tape::new(state.actor.network().sizes(), spec.slots),
        }
    }

    /// Begins an episode in `slot`.
    pub(crate) fn begin<B: BatchEnvironment>(
        &mut self,
        batch: &mut B,
        state: &mut PpoState,
        slot: usize,
    ) -> Result<(), TrainError> {
        self.current[slot] = EpisodeSums::default();
        let record = &mut state.records[slot];
        record.start = Some(record.stream.clone());
        record.actions.clear();
        batch.reset(slot, &mut record.stream, &mut self.seen);
        self.check_seen(&batch.spec(), slot, 0)
    }

    /// Repeats the unfinished episode of a saved state in `slot`.
    pub(crate) fn replay<B: BatchEnvironment>(
        &mut self,
        batch: &mut B,
        state: &PpoState,
        slot: usize,
    ) -> Result<(), TrainError> {
        let BatchSpec { lengths, .. } = batch.spec();
        let record = &state.records[slot];
        let Some(mut stream) = record.start.clone() else { return Ok(()) };
        batch.reset(slot, &mut stream, &mut self.seen);
        let mut ended = false;
        for action in record.actions.chunks_exact(lengths.action_len) {
            batch.step(slot..slot + 1, action, &mut self.seen, &mut self.steps[..1]);
            ended |= self.steps[0].is_last();
            self.current[slot].add(self.steps[0].into());
        }
        let found = &self.seen.observations[slot * lengths.observation_len..][..lengths.observation_len];
        let same = found.iter().zip(&record.observation).all(|(a, b)| a.to_bits() == b.to_bits());
        if same && !ended && stream == record.stream {
            Ok(())
        } else {
            Err(TrainError::NotRepeated { environment: slot })
        }
    }

    /// Draws an action in every slot: normal around tanh of the mean, with this `deviation`.
    fn act(&mut self, state: &mut PpoState, deviation: f32, rollout: &mut RolloutRows) {
        self.actor_inputs.copy_from_slice(&self.seen.observations);
        state.actor.normaliser().apply(&mut self.actor_inputs);
        state.actor.network().forward(&self.actor_inputs, &mut self.tape);
        let len = rollout.spec.lengths.action_len;
        let rows = self.tape.output().chunks_exact(2 * len).zip(self.actions.chunks_exact_mut(len));
        for (output, given) in rows {
            for (mean, given) in output[..len].iter().zip(given) {
                let noise: f32 = state.action_rng.sample(StandardNormal);
                let mean = mean.tanh();
                let action = mean + deviation * noise;
                rollout.means.push(mean);
                rollout.actions.push(action);
                *given = action.clamp(-1.0, 1.0);
            }
        }
    }

    fn check_seen(&self, spec: &BatchSpec, slot: usize, steps: u64) -> Result<(), TrainError> {
        let (len, privileged) = (spec.lengths.observation_len, spec.privileged_len);
        check_observation(&self.seen.observations[slot * len..][..len], slot, steps)?;
        check_observation(&self.seen.privileged[slot * privileged..][..privileged], slot, steps)
    }
}

impl RolloutRows {
    pub(crate) fn new(spec: BatchSpec) -> Self {
        Self {
            spec,
            inputs: Vec::new(),
            actions: Vec::new(),
            means: Vec::new(),
            steps: Vec::new(),
            last_inputs: Vec::new(),
            cut_rows: Vec::new(),
            cut_inputs: Vec::new(),
        }
    }

    /// Rows: steps of all slots together.
    pub(crate) const fn len(&self) -> usize {
        self.steps.len()
    }

    /// Lets the policy drive for `step_count` steps in every slot.
    pub(crate) fn collect<B: BatchEnvironment>(
        &mut self,
        batch: &mut B,
        state: &mut PpoState,
        slots: &mut Slots,
        (step_count, deviation): (usize, f32),
    ) -> Result<EndedEpisodes, TrainError> {
        self.clear();
        let mut ended = EndedEpisodes::default();
        for _ in 0..step_count {
            push_rows(&self.spec, &slots.seen, 0..self.spec.slots, &mut self.inputs);
            slots.act(state, deviation, self);
            batch.step(0..self.spec.slots, &slots.actions, &mut slots.seen, &mut slots.steps);
            state.env_steps += self.spec.slots as u64;
            for slot in 0..self.spec.slots {
                self.note(batch, state, slots, slot, &mut ended)?;
            }
        }
        push_rows(&self.spec, &slots.seen, 0..self.spec.slots, &mut self.last_inputs);
        let len = self.spec.lengths.observation_len;
        for (record, seen) in state.records.iter_mut().zip(slots.seen.observations.chunks_exact(len)) {
            record.observation.copy_from_slice(seen);
        }
        Ok(ended)
    }

    /// Takes in what a step led to in `slot`, and begins the next episode where one ended.
    fn note<B: BatchEnvironment>(
        &mut self,
        batch: &mut B,
        state: &mut PpoState,
        slots: &mut Slots,
        slot: usize,
        ended: &mut EndedEpisodes,
    ) -> Result<(), TrainError> {
        let step = slots.steps[slot];
        slots.current[slot].add(step.into());
        let current = slots.current[slot];
        check_reward(step.reward, slot, current.steps)?;
        slots.check_seen(&self.spec, slot, current.steps)?;
        let len = self.spec.lengths.action_len;
        state.records[slot].actions.extend_from_slice(&slots.actions[slot * len..][..len]);
        self.steps.push(step);
        if !step.is_last() {
            let endless = current.steps >= EPISODE_LIMIT;
            let error = TrainError::Endless { environment: slot, steps: current.steps };
            return if endless { Err(error) } else { Ok(()) };
        }
        if step.truncated && !step.failed && !step.terminated {
            self.cut_rows.push(self.steps.len() - 1);
            push_rows(&self.spec, &slots.seen, slot..slot + 1, &mut self.cut_inputs);
        }
        state.episodes += 1;
        ended.count += 1;
        ended.total_return += current.total;
        ended.steps += current.steps;
        ended.successes += u64::from(current.success);
        slots.begin(batch, state, slot)
    }

    /// Means and deviations of what was seen: of the observation, and of what only the critic sees.
    pub(crate) fn fit_normalisers(&self) -> [Normaliser; 2] {
        let len = self.spec.lengths.observation_len;
        let part = |of: &dyn Fn(&[f32]) -> Vec<f32>| -> Vec<f32> {
            self.inputs.chunks_exact(self.spec.critic_len()).flat_map(of).collect()
        };
        let (observations, privileged) = (part(&|row| row[..len].to_vec()), part(&|row| row[len..].to_vec()));
        let privileged = match self.spec.privileged_len {
            0 => Normaliser::identity(0),
            privileged_len => Normaliser::fit(&privileged, privileged_len),
        };
        [Normaliser::fit(&observations, len), privileged]
    }

    /// Normalises all that was collected, in place.
    pub(crate) fn normalise(&mut self, state: &PpoState) {
        let len = self.spec.lengths.observation_len;
        for rows in [&mut self.inputs, &mut self.last_inputs, &mut self.cut_inputs] {
            for row in rows.chunks_exact_mut(self.spec.critic_len()) {
                let (observation, privileged) = row.split_at_mut(len);
                state.actor.normaliser().apply(observation);
                if !privileged.is_empty() {
                    state.privileged.apply(privileged);
                }
            }
        }
    }

    fn clear(&mut self) {
        self.inputs.clear();
        self.actions.clear();
        self.means.clear();
        self.steps.clear();
        self.last_inputs.clear();
        self.cut_rows.clear();
        self.cut_inputs.clear();
    }
}

/// Appends the critic's inputs of `slots` to `rows`.
fn push_rows(spec: &BatchSpec, seen: &SeenBatch, slots: std::ops::Range<usize>, rows: &mut Vec<f32>) {
    let (len, privileged_len) = (spec.lengths.observation_len, spec.privileged_len);
    for slot in slots {
        rows.extend_from_slice(&seen.observations[slot * len..][..len]);
        rows.extend_from_slice(&seen.privileged[slot * privileged_len..][..privileged_len]);
    }
}
