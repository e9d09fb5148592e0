//! The training loop: environments in turn, updates in proportion, evaluation, best checkpoint.
//!
//! The paper (Sec. 5) trains for at most 150,000 steps, evaluates 20 episodes every 10,000 and
//! stops at a mean return of 500; [`TrainSettings::default`] does the same. The loop is a function
//! of environments, settings and streams: the same inputs give the same weights, and a state saved
//! by the observer continues as if nothing had happened.

use std::collections::VecDeque;
use std::ops::ControlFlow;

use rand::RngExt;
use rand_distr::StandardNormal;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::actor::{Actor, ActorScratch, Normaliser};
use crate::buffer::{Batch, ReplayBuffer, SampleSettings};
use crate::environment::{Environment, EnvironmentSpec, Step, Stream};
use crate::evaluation::{Evaluation, evaluate};
use crate::n_step::NStep;
use crate::sac::{LearnerKind, Sac, SacState, UpdateReport};
use crate::settings::{Exploration, SacSettings, SettingsError};
use crate::state::{Best, Lane, TrainState};

/// Steps after which an episode counts as endless: a time limit is the environment's duty.
pub(crate) const EPISODE_LIMIT: u64 = 1_000_000;
/// Episodes behind the running means of [`Progress`] (Stable-Baselines3).
const RECENT_EPISODES: usize = 100;

/// When training has reached its aim.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum StopRule {
    /// An evaluation and then `episodes` fresh ones both reach the success rate.
    ///
    /// One good evaluation is optimistic, because the best of many is picked.
    Success {
        /// The rate, 0 to 1.
        rate: f64,
        /// Confirming episodes.
        episodes: usize,
    },
    /// An evaluation reaches this mean return (paper: 500).
    MeanReturn(f64),
    /// Never; only the number of steps ends training.
    Never,
}

/// What the networks see of observations.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Normalisation {
    /// What the actor's normaliser says: nothing, in a fresh actor.
    #[default]
    AsGiven,
    /// Means and deviations of the warm-up's observations, fixed from then on.
    ///
    /// Fixed, so that a stored observation means the same for the whole of training.
    FromWarmup,
}

/// Everything about a run but environments and seed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct TrainSettings {
    /// The algorithm's hyperparameters.
    pub sac: SacSettings,
    /// Who differentiates; results differ by rounding only.
    pub learner: LearnerKind,
    /// What the networks see of observations.
    pub normalisation: Normalisation,
    /// Environment steps, all environments together, after which training ends (paper: 150,000).
    pub max_env_steps: u64,
    /// Environment steps between evaluations (paper: 10,000).
    pub evaluate_every: u64,
    /// Episodes in an evaluation (paper: 20).
    pub evaluation_episodes: usize,
    /// When to stop before.
    pub stop: StopRule,
}

impl Default for TrainSettings {
    fn default() -> Self {
        Self {
            sac: SacSettings::default(),
            learner: LearnerKind::default(),
            normalisation: Normalisation::default(),
            max_env_steps: 150_000,
            evaluate_every: 10_000,
            evaluation_episodes: 20,
            stop: StopRule::MeanReturn(500.0),
        }
    }
}

impl TrainSettings {
    /// Small networks, frequent evaluation and a stop at 99 % success, confirmed over 1,000.
    #[must_use]
    pub fn fast() -> Self {
        Self {
            sac: SacSettings::fast(),
            max_env_steps: 30_000,
            evaluate_every: 1_000,
            evaluation_episodes: 200,
            stop: StopRule::Success { rate: 0.99, episodes: 1_000 },
            ..Self::default()
        }
    }
}

/// Why training ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stop {
    /// The stop rule was met.
    Rule,
    /// The steps were used up.
    Steps,
    /// The observer asked for it.
    Observer,
}

/// The outcome of training: the best checkpoint, not the last.
#[derive(Clone, Debug, PartialEq)]
pub struct Trained {
    /// The best policy.
    pub actor: Actor,
    /// The networks around it, for fine-tuning elsewhere.
    pub sac: SacState,
    /// How it did.
    pub evaluation: Evaluation,
    /// Why training ended.
    pub stop: Stop,
    /// Environment steps of training; evaluation not counted.
    pub env_steps: u64,
    /// Gradient steps.
    pub updates: u64,
    /// Episodes finished in training.
    pub episodes: u64,
}

/// What the observer sees after every round of one step in each environment.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct Progress<'a> {
    /// All counters and networks; [`TrainState::to_bytes`] makes a checkpoint of it.
    pub state: &'a TrainState,
    /// The last update; zeros before the first.
    pub report: UpdateReport,
    /// The evaluation of this round, if it had one.
    pub evaluation: Option<Evaluation>,
    /// Mean return of up to 100 recent training episodes; 0 before the first.
    pub recent_return: f64,
    /// Success rate of the same.
    pub recent_success_rate: f64,
    /// Mean number of their steps.
    pub recent_steps: f64,
    /// Step of all three optimisers.
    pub learning_rate: f32,
}

/// Why training failed.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum TrainError {
    /// There is nothing to learn from.
    #[error("no environments to train on")]
    NoEnvironments,
    /// Environments, networks or a saved state disagree about lengths.
    #[error("environment {environment} has {found:?}, expected {expected:?}")]
    Spec {
        /// Its index.
        environment: usize,
        /// What it says.
        found: EnvironmentSpec,
        /// What the first one or the networks say.
        expected: EnvironmentSpec,
    },
    /// A hyperparameter is out of range.
    #[error(transparent)]
    Settings(#[from] SettingsError),
    /// An environment returned NaN or infinity as part of an observation.
    #[error(
        "component {component} of the observation of environment {environment} is {value} after {steps} steps"
    )]
    Observation {
        /// Its index.
        environment: usize,
        /// The component.
        component: usize,
        /// The value, as text so that the error can be compared.
        value: String,
        /// Steps into the episode.
        steps: u64,
    },
    /// An environment returned NaN or infinity as a reward.
    #[error("the reward of environment {environment} is {value} after {steps} steps")]
    Reward {
        /// Its index.
        environment: usize,
        /// The value, as text.
        value: String,
        /// Steps into the episode.
        steps: u64,
    },
    /// Learning blew up.
    #[error("{what} is not finite after {updates} updates")]
    Diverged {
        /// What is not finite.
        what: &'static str,
        /// Gradient steps taken.
        updates: u64,
    },
    /// An episode has no end.
    #[error("an episode of environment {environment} did not end within {steps} steps")]
    Endless {
        /// Its index.
        environment: usize,
        /// Steps taken.
        steps: u64,
    },
    /// A saved state is of another number of environments.
    #[error("a state of {expected} environments resumed with {found}")]
    LaneCount {
        /// Environments given.
        found: usize,
        /// Environments of the state.
        expected: usize,
    },
    /// A saved state has networks of other widths than the settings, or another buffer.
    #[error("the state to continue from has {what} {found}, the settings say {expected}")]
    Mismatch {
        /// What differs.
        what: &'static str,
        /// The state's value.
        found: String,
        /// The settings' value.
        expected: String,
    },
    /// An environment did not repeat its episode on resuming.
    #[error("environment {environment} did not repeat its episode: it is not the one that was saved")]
    NotRepeated {
        /// Its index.
        environment: usize,
    },
}

/// Called after every round; breaking ends training.
pub type Observer<'a> = dyn FnMut(&Progress<'_>) -> ControlFlow<()> + 'a;

/// Trains fresh networks on `environments`, which are stepped in turn.
///
/// # Errors
/// If settings or environments do not fit, or anything stops being finite.
pub fn train<E: Environment + Clone>(
    environments: &mut [E],
    settings: &TrainSettings,
    rng: &mut Stream,
    observer: &mut Observer<'_>,
) -> Result<Trained, TrainError> {
    settings.sac.validate()?;
    let spec = common_spec(environments)?;
    let sac = SacState::new(spec, &settings.sac, rng);
    let state = TrainState::new(spec, &settings.sac, sac, environments.len(), rng);
    Run::new(environments, settings, state)?.finish(observer)
}

/// Trains networks that exist already, with fresh optimiser, temperature and buffer.
///
/// # Errors
/// As [`train`]; also if the networks are of other sizes than the settings say.
pub fn fine_tune<E: Environment + Clone>(
    environments: &mut [E],
    networks: &SacState,
    settings: &TrainSettings,
    rng: &mut Stream,
    observer: &mut Observer<'_>,
) -> Result<Trained, TrainError> {
    settings.sac.validate()?;
    let spec = common_spec(environments)?;
    let sac = networks.restarted(&settings.sac);
    let state = TrainState::new(spec, &settings.sac, sac, environments.len(), rng);
    Run::new(environments, settings, state)?.finish(observer)
}

/// Continues a run from a saved state, bit for bit as if it had not been interrupted.
///
/// `environments` and `settings` are those of the run; only its limits may be moved.
///
/// # Errors
/// As [`train`]; also if the state is of other environments.
pub fn resume<E: Environment + Clone>(
    environments: &mut [E],
    state: TrainState,
    settings: &TrainSettings,
    observer: &mut Observer<'_>,
) -> Result<Trained, TrainError> {
    settings.sac.validate()?;
    Run::new(environments, settings, state)?.finish(observer)
}

/// A run in progress: the state that lasts and the room around it that does not.
struct Run<'a, E> {
    environments: &'a mut [E],
    settings: &'a TrainSettings,
    state: TrainState,
    sac: Sac,
    batch: Batch,
    windows: Vec<NStep>,
    /// Steps, return and success of each environment's current episode.
    current: Vec<EpisodeSums>,
    recent: VecDeque<EpisodeSums>,
    scratch: ActorScratch,
    action: Vec<f32>,
    next_observation: Vec<f32>,
    report: UpdateReport,
}

#[derive(Clone, Copy, Debug, Default)]
struct EpisodeSums {
    steps: u64,
    total: f64,
    success: bool,
}

impl EpisodeSums {
    fn add(&mut self, step: Step) {
        self.steps += 1;
        self.total += f64::from(step.reward);
        self.success |= step.success;
    }
}

impl<'a, E: Environment + Clone> Run<'a, E> {
    /// Checks that everything fits and brings the environments to where the state left them.
    fn new(
        environments: &'a mut [E],
        settings: &'a TrainSettings,
        state: TrainState,
    ) -> Result<Self, TrainError> {
        let spec = state.spec();
        let found = common_spec(environments)?;
        if found != spec {
            return Err(TrainError::Spec { environment: 0, found, expected: spec });
        }
        if state.lanes.len() != environments.len() {
            let (found, expected) = (environments.len(), state.lanes.len());
            return Err(TrainError::LaneCount { found, expected });
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
            sac: Sac::new(spec, &settings.sac, settings.learner),
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
            if run.state.lanes[index].start.is_some() {
                run.replay(index)?;
            } else {
                run.begin_episode(index)?;
            }
        }
        Ok(run)
    }

    /// Runs until something says stop.
    fn finish(mut self, observer: &mut Observer<'_>) -> Result<Trained, TrainError> {
        let stop = loop {
            if self.state.env_steps >= self.settings.max_env_steps {
                break Stop::Steps;
            }
            self.step_all()?;
            self.learn()?;
            let mut evaluation = None;
            let mut reached = false;
            if self.state.env_steps >= self.state.evaluated_at + self.settings.evaluate_every {
                let (found, confirmed) = self.evaluate_and_keep()?;
                (evaluation, reached) = (Some(found), confirmed);
            }
            let asked = observer(&self.progress(evaluation)).is_break();
            if reached {
                break Stop::Rule;
            }
            if asked {
                break Stop::Observer;
            }
        };
        // A policy that was never evaluated could neither be returned nor compared.
        let fresh = self.state.evaluated_at == self.state.env_steps;
        if self.state.best.is_none() || (stop == Stop::Steps && !fresh) {
            self.evaluate_and_keep()?;
        }
        let best = self.state.best.expect("an evaluation keeps a best policy");
        Ok(Trained {
            actor: best.sac.actor.clone(),
            sac: best.sac,
            evaluation: best.evaluation,
            stop,
            env_steps: self.state.env_steps,
            updates: self.state.updates,
            episodes: self.state.episodes,
        })
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
            let lane = &mut self.state.lanes[index];
            let buffer = &mut self.state.buffer;
            self.windows[index].push(&lane.observation, &self.action, step, &self.next_observation, |t| {
                buffer.push(t);
            });
            lane.actions.extend_from_slice(&self.action);
            lane.observation.copy_from_slice(&self.next_observation);
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
        let rng = &mut self.state.action_rng;
        let exploration = if self.state.env_steps < settings.warmup_steps {
            settings.exploration
        } else {
            Exploration::Policy
        };
        match exploration {
            Exploration::Uniform => self.action.fill_with(|| rng.random_range(-1.0..=1.0)),
            Exploration::Gaussian(std) => self.action.fill_with(|| {
                let noise: f32 = rng.sample(StandardNormal);
                (std * noise).clamp(-1.0, 1.0)
            }),
            Exploration::Policy => {
                let observation = &self.state.lanes[index].observation;
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
        let lane = &mut self.state.lanes[index];
        lane.start = Some(lane.stream.clone());
        lane.actions.clear();
        self.environments[index].reset(&mut lane.stream, &mut lane.observation);
        check_observation(&lane.observation, index, 0)
    }

    /// Repeats a saved, unfinished episode.
    fn replay(&mut self, index: usize) -> Result<(), TrainError> {
        let Lane { start, stream, actions, observation: saved } = &self.state.lanes[index];
        let Some(mut replayed) = start.clone() else { return Ok(()) };
        let mut observation = vec![0.0; saved.len()];
        self.environments[index].reset(&mut replayed, &mut observation);
        let mut ended = false;
        for action in actions.chunks_exact(self.action.len()) {
            let step = self.environments[index].step(action, &mut self.next_observation);
            ended |= step.is_last();
            self.current[index].add(step);
            // What these transitions complete is in the saved buffer already.
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

    /// As many updates as the steps so far have earned.
    fn learn(&mut self) -> Result<(), TrainError> {
        let settings = &self.settings.sac;
        if self.state.env_steps < settings.warmup_steps || self.state.buffer.is_empty() {
            return Ok(());
        }
        if self.state.updates == 0 && self.settings.normalisation == Normalisation::FromWarmup {
            self.fit_normaliser();
        }
        let earned =
            (self.state.env_steps - settings.warmup_steps) as f64 * f64::from(settings.updates_per_step);
        while self.state.updates < earned as u64 {
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
        let buffer: &ReplayBuffer = &self.state.buffer;
        let normaliser = Normaliser::fit(&buffer.observations, buffer.spec.observation_len);
        self.state.sac.actor.set_normaliser(normaliser);
    }

    /// Evaluates the current policy, keeps it if it is the best, and says if the aim is reached.
    fn evaluate_and_keep(&mut self) -> Result<(Evaluation, bool), TrainError> {
        if !self.state.sac.is_finite() {
            return Err(TrainError::Diverged { what: "a weight", updates: self.state.updates });
        }
        self.state.evaluated_at = self.state.env_steps;
        let mut evaluation = self.evaluate(self.settings.evaluation_episodes)?;
        let mut reached = match self.settings.stop {
            StopRule::Success { rate, .. } => evaluation.success_rate() >= rate,
            StopRule::MeanReturn(aim) => evaluation.mean_return >= aim,
            StopRule::Never => false,
        };
        if let (StopRule::Success { rate, episodes }, true) = (self.settings.stop, reached) {
            let confirmation = self.evaluate(episodes)?;
            reached = episodes == 0 || confirmation.success_rate() >= rate;
            evaluation = evaluation.pooled(&confirmation);
        }
        let is_best = self.state.best.as_ref().is_none_or(|best| evaluation.beats(&best.evaluation));
        // The policy that met the rule is the answer, even if a luckier one came before.
        if is_best || reached {
            self.state.best = Some(Best { sac: self.state.sac.clone(), evaluation });
        }
        Ok((evaluation, reached))
    }

    /// Evaluates on copies, so that the episodes of training go on undisturbed.
    fn evaluate(&mut self, episodes: usize) -> Result<Evaluation, TrainError> {
        let mut copies = self.environments.to_vec();
        let state = &mut self.state;
        let found = evaluate(&mut copies, &state.sac.actor, episodes, &mut state.evaluation_rng)?;
        Ok(Evaluation { env_steps: state.env_steps, updates: state.updates, ..found })
    }

    fn progress(&self, evaluation: Option<Evaluation>) -> Progress<'_> {
        let count = self.recent.len().max(1) as f64;
        let mean = |of: fn(&EpisodeSums) -> f64| self.recent.iter().map(of).sum::<f64>() / count;
        Progress {
            state: &self.state,
            report: self.report,
            evaluation,
            recent_return: mean(|episode| episode.total),
            recent_success_rate: mean(|episode| f64::from(u8::from(episode.success))),
            recent_steps: mean(|episode| episode.steps as f64),
            learning_rate: self.settings.sac.learning_rate,
        }
    }
}

/// The spec all environments share.
fn common_spec<E: Environment>(environments: &[E]) -> Result<EnvironmentSpec, TrainError> {
    let expected = environments.first().ok_or(TrainError::NoEnvironments)?.spec();
    for (environment, found) in environments.iter().map(Environment::spec).enumerate() {
        if found != expected {
            return Err(TrainError::Spec { environment, found, expected });
        }
    }
    Ok(expected)
}

fn check_widths(what: &'static str, sizes: &[usize], settings: &SacSettings) -> Result<(), TrainError> {
    let hidden = &sizes[1..sizes.len() - 1];
    if hidden == settings.hidden {
        return Ok(());
    }
    let (found, expected) = (format!("{hidden:?}"), format!("{:?}", settings.hidden));
    Err(TrainError::Mismatch { what, found, expected })
}

/// Refuses NaN and infinity in an observation.
pub(crate) fn check_observation(values: &[f32], environment: usize, steps: u64) -> Result<(), TrainError> {
    match values.iter().position(|value| !value.is_finite()) {
        Some(component) => {
            let value = values[component].to_string();
            Err(TrainError::Observation { environment, component, value, steps })
        }
        None => Ok(()),
    }
}

/// Refuses NaN and infinity as a reward.
pub(crate) fn check_reward(reward: f32, environment: usize, steps: u64) -> Result<(), TrainError> {
    if reward.is_finite() {
        Ok(())
    } else {
        Err(TrainError::Reward { environment, value: reward.to_string(), steps })
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;
    use crate::toy::{Identity, PointMass};

    fn quiet(_: &Progress<'_>) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    fn rng(seed: u64) -> Stream {
        Stream::seed_from_u64(seed)
    }

    /// A short run of a few hundred updates.
    fn short() -> TrainSettings {
        let sac = SacSettings {
            hidden: vec![16, 16],
            batch: 32,
            buffer_capacity: 400,
            warmup_steps: 60,
            n_step: 3,
            ..SacSettings::fast()
        };
        TrainSettings {
            sac,
            normalisation: Normalisation::FromWarmup,
            max_env_steps: 600,
            evaluate_every: 150,
            evaluation_episodes: 10,
            stop: StopRule::Never,
            ..TrainSettings::fast()
        }
    }

    #[test]
    fn identity_is_learned() {
        let settings = TrainSettings {
            sac: SacSettings { hidden: vec![32, 32], batch: 64, gamma: 0.5, ..SacSettings::fast() },
            evaluate_every: 500,
            evaluation_episodes: 20,
            max_env_steps: 8_000,
            stop: StopRule::MeanReturn(-0.3),
            ..TrainSettings::fast()
        };
        let trained = train(&mut [Identity::new(2)], &settings, &mut rng(1), &mut quiet).expect("trains");
        assert_eq!(trained.stop, Stop::Rule, "{:?}", trained.evaluation);
        assert!(trained.evaluation.mean_return >= -0.3, "{:?}", trained.evaluation);
    }

    #[test]
    fn a_point_mass_is_brought_home() {
        let settings = TrainSettings {
            sac: SacSettings { hidden: vec![32, 32], batch: 128, ..SacSettings::fast() },
            evaluate_every: 1_000,
            evaluation_episodes: 50,
            max_env_steps: 20_000,
            stop: StopRule::Success { rate: 0.95, episodes: 100 },
            ..TrainSettings::fast()
        };
        let mut worlds = vec![PointMass::default(); 4];
        let trained = train(&mut worlds, &settings, &mut rng(2), &mut quiet).expect("trains");
        assert_eq!(trained.stop, Stop::Rule, "{:?}", trained.evaluation);
        let fresh = evaluate(&mut worlds, &trained.actor, 200, &mut rng(77)).expect("evaluates");
        assert!(fresh.success_rate() >= 0.9, "on fresh seeds: {fresh:?}");
    }

    #[test]
    fn the_same_seed_gives_the_same_weights() {
        let run = |seed| {
            let trained = train(&mut vec![PointMass::default(); 3], &short(), &mut rng(seed), &mut quiet);
            trained.expect("trains").sac.to_bytes()
        };
        assert_eq!(run(1), run(1), "equal seeds");
        assert_ne!(run(1), run(2), "other seeds");
    }

    #[test]
    fn a_resumed_run_ends_as_the_uninterrupted_one() {
        let worlds = || vec![PointMass::default(); 3];
        let whole = train(&mut worlds(), &short(), &mut rng(5), &mut quiet).expect("trains");
        // Before and after warm-up, right after an evaluation, with the ring full.
        for kill_at in [3, 59, 61, 152, 451, 598] {
            let mut saved = Vec::new();
            let mut kill = |progress: &Progress<'_>| {
                if progress.state.env_steps < kill_at {
                    return ControlFlow::Continue(());
                }
                saved = progress.state.to_bytes();
                ControlFlow::Break(())
            };
            train(&mut worlds(), &short(), &mut rng(5), &mut kill).expect("trains");
            let state = TrainState::from_bytes(&saved).expect("own bytes");
            assert_eq!(state.to_bytes(), saved, "killed at {kill_at}: equal contents, equal bytes");
            let resumed = resume(&mut worlds(), state, &short(), &mut quiet).expect("resumes");
            assert!(resumed == whole, "killed at {kill_at}: other weights or counters");
        }
    }

    #[test]
    fn another_environment_or_setting_does_not_resume() {
        let mut state = None;
        let mut save = |progress: &Progress<'_>| {
            state = Some(progress.state.clone());
            if progress.state.env_steps < 35 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        };
        train(&mut [PointMass::default()], &short(), &mut rng(5), &mut save).expect("trains");
        let state = state.expect("saved");
        let refusal = |worlds: usize, settings: &TrainSettings, state: &TrainState| {
            let mut worlds = vec![PointMass::default(); worlds];
            resume(&mut worlds, state.clone(), settings, &mut quiet).expect_err("refuses").to_string()
        };
        assert_eq!(refusal(2, &short(), &state), "a state of 1 environments resumed with 2");
        let wide = TrainSettings { sac: SacSettings { hidden: vec![8], ..short().sac }, ..short() };
        assert_eq!(
            refusal(1, &wide, &state),
            "the state to continue from has an actor of hidden widths [16, 16], the settings say [8]"
        );
        let mut moved = state;
        moved.lanes[0].observation[0] += 0.5;
        assert_eq!(
            refusal(1, &short(), &moved),
            "environment 0 did not repeat its episode: it is not the one that was saved"
        );
    }

    /// A point mass whose observation or reward turns NaN at some step of an episode.
    #[derive(Clone)]
    struct Failing {
        inner: PointMass,
        steps: u64,
        observation_at: u64,
        reward_at: u64,
    }

    impl Environment for Failing {
        fn spec(&self) -> EnvironmentSpec {
            self.inner.spec()
        }

        fn reset(&mut self, rng: &mut Stream, observation: &mut [f32]) {
            self.steps = 0;
            self.inner.reset(rng, observation);
        }

        fn step(&mut self, action: &[f32], observation: &mut [f32]) -> Step {
            self.steps += 1;
            let mut step = self.inner.step(action, observation);
            if self.steps == self.observation_at {
                observation[2] = f32::NAN;
            }
            if self.steps == self.reward_at {
                step.reward = f32::INFINITY;
            }
            step
        }
    }

    #[test]
    fn nan_from_an_environment_names_its_origin() {
        let refusal = |observation_at, reward_at| {
            let sound = Failing { inner: PointMass::default(), steps: 0, observation_at: 0, reward_at: 0 };
            let mut worlds = [sound.clone(), Failing { observation_at, reward_at, ..sound }];
            train(&mut worlds, &short(), &mut rng(1), &mut quiet).expect_err("refuses").to_string()
        };
        assert_eq!(refusal(5, 0), "component 2 of the observation of environment 1 is NaN after 5 steps");
        assert_eq!(refusal(0, 7), "the reward of environment 1 is inf after 7 steps");
    }

    #[test]
    fn absurd_step_sizes_diverge_with_an_error() {
        let sac = SacSettings { learning_rate: 1e30, ..short().sac };
        let settings = TrainSettings { sac, ..short() };
        let error = train(&mut [PointMass::default()], &settings, &mut rng(1), &mut quiet);
        assert!(matches!(error, Err(TrainError::Diverged { .. })), "{error:?}");
    }

    #[test]
    fn the_best_checkpoint_is_kept_and_the_last_policy_is_evaluated() {
        let mut seen = Vec::new();
        let mut watch = |progress: &Progress<'_>| {
            seen.extend(progress.evaluation);
            ControlFlow::Continue(())
        };
        let trained =
            train(&mut vec![PointMass::default(); 3], &short(), &mut rng(3), &mut watch).expect("trains");
        let steps: Vec<u64> = seen.iter().map(|evaluation| evaluation.env_steps).collect();
        assert_eq!(steps, [150, 300, 450, 600]);
        assert!(seen.iter().all(|evaluation| !evaluation.beats(&trained.evaluation)), "{seen:?}");
        assert!(seen.contains(&trained.evaluation), "the outcome is one of those seen");
        assert_eq!((trained.stop, trained.env_steps, trained.updates), (Stop::Steps, 600, 270));
    }

    #[test]
    fn fine_tuning_begins_where_the_networks_are() {
        let mut worlds = vec![PointMass::default(); 2];
        let first = train(&mut worlds, &short(), &mut rng(3), &mut quiet).expect("trains");
        let settings = TrainSettings {
            sac: SacSettings { exploration: Exploration::Policy, ..short().sac },
            normalisation: Normalisation::AsGiven,
            max_env_steps: 20,
            ..short()
        };
        let tuned = fine_tune(&mut worlds, &first.sac, &settings, &mut rng(4), &mut quiet).expect("trains");
        assert_eq!(tuned.actor, first.actor, "no update within the warm-up");
        assert_eq!(tuned.stop, Stop::Steps);
    }

    #[test]
    fn training_through_burn_takes_the_same_path() {
        let run = |learner| {
            let settings = TrainSettings { learner, max_env_steps: 120, ..short() };
            train(&mut [PointMass::default()], &settings, &mut rng(3), &mut quiet).expect("trains")
        };
        let (hand, burn) = (run(LearnerKind::Fused), run(LearnerKind::Burn));
        assert_eq!((hand.updates, hand.episodes), (burn.updates, burn.episodes));
        let far = |(a, b): (&f32, &f32)| (a - b).abs() > 1e-3;
        let weights = |trained: &Trained| trained.actor.network().parameters().to_vec();
        let (hand, burn) = (weights(&hand), weights(&burn));
        assert!(!hand.iter().zip(&burn).any(far), "weights after thirty updates");
    }

    #[test]
    fn nothing_to_train_on_is_an_error() {
        let none: &mut [PointMass] = &mut [];
        let error = train(none, &short(), &mut rng(1), &mut quiet).expect_err("refuses");
        assert_eq!(error, TrainError::NoEnvironments);
    }
}
