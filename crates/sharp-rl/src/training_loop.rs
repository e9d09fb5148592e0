//! The loop of soft actor-critic: environments in turn, updates in proportion, evaluations between.
//!
//! One round is a step in every environment, the updates that these steps earn, and an evaluation
//! if one is due. The observer is called after every round.

use std::collections::VecDeque;

use rand::RngExt;
use rand_distr::StandardNormal;

use crate::actor::ActorScratch;
use crate::buffer::{Batch, SampleSettings};
use crate::environment::{Environment, EnvironmentSpec};
use crate::error::{TrainError, check_observation, check_reward};
use crate::evaluation::{EPISODE_LIMIT, EpisodeSums, Evaluation, evaluate};
use crate::learner::{Observer, Progress, Trained};
use crate::n_step::NStep;
use crate::normaliser::Normaliser;
use crate::sac::{Sac, UpdateReport};
use crate::settings::{Exploration, SacSettings};
use crate::state::{BestNetworks, ReplayRecord, TrainState};
use crate::stop::{StopReason, StopRule};
use crate::train::{Normalisation, TrainSettings};

/// Training episodes behind the running means of [`Progress`] (Stable-Baselines3).
const RECENT_EPISODES: usize = 100;

/// A run in progress: the state that a checkpoint keeps, and the buffers around it.
pub(crate) struct TrainingLoop<'a, E> {
    environments: &'a mut [E],
    settings: &'a TrainSettings,
    state: TrainState,
    sac: Sac,
    batch: Batch,
    windows: Vec<NStep>,
    /// One for each environment: its current episode so far.
    current: Vec<EpisodeSums>,
    recent: VecDeque<EpisodeSums>,
    scratch: ActorScratch,
    action: Vec<f32>,
    next_observation: Vec<f32>,
    report: UpdateReport,
}

impl<'a, E: Environment + Clone> TrainingLoop<'a, E> {
    /// Checks that all parts fit and brings the environments to where the state left them.
    pub(crate) fn new(
        environments: &'a mut [E],
        settings: &'a TrainSettings,
        state: TrainState,
    ) -> Result<Self, TrainError> {
        let spec = state.spec();
        let found = EnvironmentSpec::common(environments)?;
        if found != spec {
            return Err(TrainError::Spec { environment: 0, found, expected: spec });
        }
        if state.records.len() != environments.len() {
            let (found, expected) = (environments.len(), state.records.len());
            return Err(TrainError::EnvironmentCount { found, expected });
        }
        check_widths("an actor of hidden widths", state.sac.actor.network().sizes(), &settings.sac)?;
        check_widths("critics of hidden widths", state.sac.critics[0].sizes(), &settings.sac)?;
        if state.buffer.capacity != settings.sac.buffer_capacity {
            return Err(TrainError::Mismatch {
                what: "a buffer of capacity",
                found: state.buffer.capacity.to_string(),
                expected: settings.sac.buffer_capacity.to_string(),
            });
        }
        let window = NStep::new(spec, settings.sac.n_step, settings.sac.gamma);
        let mut run = Self {
            sac: Sac::new(spec, &settings.sac, settings.backend),
            batch: Batch::new(spec, settings.sac.batch),
            windows: vec![window; environments.len()],
            current: vec![EpisodeSums::default(); environments.len()],
            recent: VecDeque::with_capacity(RECENT_EPISODES),
            scratch: ActorScratch::default(),
            action: vec![0.0; spec.action_len],
            next_observation: vec![0.0; spec.observation_len],
            report: UpdateReport::default(),
            environments,
            settings,
            state,
        };
        for index in 0..run.environments.len() {
            if run.state.records[index].start.is_some() {
                run.replay(index)?;
            } else {
                run.begin_episode(index)?;
            }
        }
        Ok(run)
    }

    /// Runs until the stop rule, the budget or the observer ends training.
    pub(crate) fn finish(mut self, observer: &mut Observer<'_>) -> Result<Trained, TrainError> {
        let stop = loop {
            if self.state.env_steps >= self.settings.max_env_steps {
                break StopReason::Steps;
            }
            // Here and not after the evaluation: a run that was saved with it decides the same.
            if self.is_hopeless() {
                self.state.begin_anew(&self.settings.sac);
            }
            self.step_all()?;
            self.learn()?;
            let mut evaluation = None;
            let mut reached = false;
            if self.state.env_steps >= self.state.evaluated_at + self.settings.evaluate_every {
                let (found, confirmed) = self.evaluate_and_keep()?;
                (evaluation, reached) = (Some(found), confirmed);
            }
            let asked = self.report_progress(evaluation, reached, observer);
            if reached {
                break StopReason::Rule;
            }
            if asked {
                break StopReason::Observer;
            }
        };
        // Only an evaluated policy can be returned and compared.
        let fresh = self.state.evaluated_at == self.state.env_steps;
        if self.state.best.is_none() || (stop == StopReason::Steps && !fresh) {
            self.evaluate_and_keep()?;
        }
        let best = self.state.best.expect("an evaluation keeps a best policy");
        let actor = best.sac.actor.clone();
        Ok(Trained {
            updates: self.state.updates,
            episodes: self.state.episodes,
            sac: Some(best.sac),
            ..Trained::new(actor, best.evaluation, stop, self.state.env_steps)
        })
    }

    /// Whether the attempt under way is to be given up.
    fn is_hopeless(&self) -> bool {
        let Some(rule) = self.settings.restart else { return false };
        self.attempt_steps() >= rule.after.max(1)
            && self.state.evaluated_at == self.state.env_steps
            && self.state.env_steps + 2 * rule.after <= self.settings.max_env_steps
            && self.state.attempt.best_return.is_none_or(|best| best < rule.below)
    }

    /// Environment steps of the attempt under way.
    const fn attempt_steps(&self) -> u64 {
        self.state.env_steps - self.state.attempt.began_at
    }

    /// One step in every environment.
    fn step_all(&mut self) -> Result<(), TrainError> {
        for index in 0..self.environments.len() {
            self.choose_action(index);
            let step = self.environments[index].step(&self.action, &mut self.next_observation);
            self.current[index].add(step);
            let steps = self.current[index].steps;
            check_reward(step.reward, index, steps)?;
            check_observation(&self.next_observation, index, steps)?;
            let record = &mut self.state.records[index];
            let buffer = &mut self.state.buffer;
            self.windows[index].push(&record.observation, &self.action, step, &self.next_observation, |t| {
                buffer.push(t);
            });
            record.actions.extend_from_slice(&self.action);
            record.observation.copy_from_slice(&self.next_observation);
            self.state.env_steps += 1;
            if step.is_last() {
                self.end_episode(index)?;
            } else if steps >= EPISODE_LIMIT {
                return Err(TrainError::Endless { environment: index, steps });
            }
        }
        Ok(())
    }

    /// Writes the next action of an environment: exploration first, then the policy.
    fn choose_action(&mut self, index: usize) {
        let settings = &self.settings.sac;
        let exploration = if self.attempt_steps() < settings.warmup_steps {
            settings.exploration
        } else {
            Exploration::Policy
        };
        let rng = &mut self.state.action_rng;
        match exploration {
            Exploration::Uniform => self.action.fill_with(|| rng.random_range(-1.0..=1.0)),
            Exploration::Gaussian(std) => self.action.fill_with(|| {
                let noise: f32 = rng.sample(StandardNormal);
                (std * noise).clamp(-1.0, 1.0)
            }),
            Exploration::Policy => {
                let observation = &self.state.records[index].observation;
                self.state.sac.actor.act_sample(observation, rng, &mut self.scratch, &mut self.action);
            }
        }
    }

    fn end_episode(&mut self, index: usize) -> Result<(), TrainError> {
        self.state.episodes += 1;
        if self.recent.len() == RECENT_EPISODES {
            self.recent.pop_front();
        }
        self.recent.push_back(self.current[index]);
        self.begin_episode(index)
    }

    fn begin_episode(&mut self, index: usize) -> Result<(), TrainError> {
        self.current[index] = EpisodeSums::default();
        let record = &mut self.state.records[index];
        record.start = Some(record.stream.clone());
        record.actions.clear();
        self.environments[index].reset(&mut record.stream, &mut record.observation);
        check_observation(&record.observation, index, 0)
    }

    /// Repeats the unfinished episode of a saved state.
    fn replay(&mut self, index: usize) -> Result<(), TrainError> {
        let ReplayRecord { start, stream, actions, observation: saved } = &self.state.records[index];
        let Some(mut replayed) = start.clone() else { return Ok(()) };
        let mut observation = vec![0.0; saved.len()];
        self.environments[index].reset(&mut replayed, &mut observation);
        let mut ended = false;
        for action in actions.chunks_exact(self.action.len()) {
            let step = self.environments[index].step(action, &mut self.next_observation);
            ended |= step.is_last();
            self.current[index].add(step);
            // The saved buffer already holds the transitions that are complete here.
            self.windows[index].push(&observation, action, step, &self.next_observation, |_| ());
            observation.copy_from_slice(&self.next_observation);
        }
        let same = observation.iter().zip(saved).all(|(a, b)| a.to_bits() == b.to_bits());
        if same && !ended && replayed == *stream {
            Ok(())
        } else {
            Err(TrainError::NotRepeated { environment: index })
        }
    }

    /// Makes the updates that the steps so far have earned.
    fn learn(&mut self) -> Result<(), TrainError> {
        let settings = &self.settings.sac;
        let (steps, updates_before) = (self.attempt_steps(), self.state.attempt.updates_before);
        if steps < settings.warmup_steps || self.state.buffer.is_empty() {
            return Ok(());
        }
        if self.state.updates == updates_before && self.settings.normalisation == Normalisation::FromWarmup {
            self.fit_normaliser();
        }
        let earned = (steps - settings.warmup_steps) as f64 * f64::from(settings.updates_per_step);
        while self.state.updates - updates_before < earned as u64 {
            let state = &mut self.state;
            let how = SampleSettings {
                gamma: settings.gamma,
                reward_scale: settings.reward_scale,
                normaliser: state.sac.actor.normaliser(),
            };
            state.buffer.sample(&how, &mut state.batch_rng, &mut self.batch);
            self.report = self.sac.update(&mut state.sac, &self.batch);
            state.updates += 1;
            if let Some(what) = self.report.first_not_finite() {
                return Err(TrainError::Diverged { what, updates: state.updates });
            }
        }
        Ok(())
    }

    fn fit_normaliser(&mut self) {
        let buffer = &self.state.buffer;
        let normaliser = Normaliser::fit(&buffer.observations, buffer.spec.observation_len);
        self.state.sac.actor.set_normaliser(normaliser);
    }

    /// Evaluates the current policy and keeps it if it is the best; true if the aim is reached.
    fn evaluate_and_keep(&mut self) -> Result<(Evaluation, bool), TrainError> {
        if !self.state.sac.is_finite() {
            return Err(TrainError::Diverged { what: "a weight", updates: self.state.updates });
        }
        self.state.evaluated_at = self.state.env_steps;
        let mut evaluation = self.evaluate(self.settings.evaluation_episodes)?;
        let mut reached = self.settings.stop.is_met(&evaluation);
        if let (StopRule::Success { rate, episodes }, true) = (self.settings.stop, reached) {
            let confirmation = self.evaluate(episodes)?;
            reached = episodes == 0 || confirmation.success_rate() >= rate;
            evaluation = evaluation.pooled(&confirmation);
        }
        let best_return = &mut self.state.attempt.best_return;
        *best_return =
            Some(best_return.map_or(evaluation.mean_return, |best| best.max(evaluation.mean_return)));
        let rule = self.settings.best;
        let best = self.state.best.as_ref();
        let is_best = best.is_none_or(|best| rule.prefers(&evaluation, &best.evaluation));
        // The policy that met the rule is returned, even if an earlier one had a better evaluation.
        if is_best || reached {
            self.state.best = Some(BestNetworks { sac: self.state.sac.clone(), evaluation });
        }
        Ok((evaluation, reached))
    }

    /// Evaluates on copies, so that the episodes of training are not disturbed.
    fn evaluate(&mut self, episodes: usize) -> Result<Evaluation, TrainError> {
        let mut copies = self.environments.to_vec();
        let state = &mut self.state;
        let found = evaluate(&mut copies, &state.sac.actor, episodes, &mut state.evaluation_rng)?;
        Ok(Evaluation { env_steps: state.env_steps, updates: state.updates, ..found })
    }

    /// Calls the observer; returns true if it asks to stop.
    fn report_progress(
        &self,
        evaluation: Option<Evaluation>,
        is_over: bool,
        observer: &mut Observer<'_>,
    ) -> bool {
        let count = self.recent.len().max(1) as f64;
        let mean = |of: fn(&EpisodeSums) -> f64| self.recent.iter().map(of).sum::<f64>() / count;
        let metrics = [
            ("actor_loss", f64::from(self.report.actor_loss)),
            ("critic_loss", f64::from(self.report.critic_loss)),
            ("ent_coef", f64::from(self.report.alpha)),
            ("ent_coef_loss", f64::from(self.report.alpha_loss)),
            ("learning_rate", f64::from(self.settings.sac.learning_rate)),
        ];
        let checkpoint = || self.state.to_bytes();
        let progress = Progress {
            began_at: self.state.attempt.began_at,
            updates: self.state.updates,
            episodes: self.state.episodes,
            evaluation,
            recent_return: mean(|episode| episode.total),
            recent_success_rate: mean(|episode| f64::from(u8::from(episode.success))),
            recent_steps: mean(|episode| episode.steps as f64),
            metrics: if self.state.updates > 0 { &metrics } else { &[] },
            max_env_steps: Some(self.settings.max_env_steps),
            stop: Some(self.settings.stop),
            ..Progress::new(&self.state.sac.actor, self.state.env_steps)
        };
        // A state does not tell that the stop was met: a run that went on from here would train on.
        let progress = if is_over { progress } else { progress.with_checkpoint(&checkpoint) };
        observer(&progress).is_break()
    }
}

/// Refuses networks whose hidden layers differ from the settings.
fn check_widths(what: &'static str, sizes: &[usize], settings: &SacSettings) -> Result<(), TrainError> {
    let hidden = &sizes[1..sizes.len() - 1];
    if hidden == settings.hidden {
        return Ok(());
    }
    let (found, expected) = (format!("{hidden:?}"), format!("{:?}", settings.hidden));
    Err(TrainError::Mismatch { what, found, expected })
}
