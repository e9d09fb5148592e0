//! One iteration: collect, estimate advantages, improve.

use rand::RngExt;

use super::advantages::Advantages;
use super::batch::BatchEnvironment;
use super::gradients::{MinibatchSums, PolicyBounds, PpoGradients};
use super::rollout::{EndedEpisodes, RolloutRows, Slots};
use super::settings::PpoSettings;
use super::state::PpoState;
use crate::environment::EnvironmentSpec;
use crate::error::TrainError;
use crate::learner::Progress;
use crate::matrix::dot;

/// The step size is steered by this factor when the divergence of an iteration is more than this factor off.
const STEERING: f32 = 1.5;
/// Bounds of the steered step size, as shares of the first one.
const LEARNING_RATE_SHARES: [f32; 2] = [0.05, 4.0];

/// A run in progress.
#[derive(Debug)]
pub(crate) struct PpoRun<'a, B> {
    pub(crate) batch: B,
    pub(crate) state: PpoState,
    settings: &'a PpoSettings,
    slots: Slots,
    rollout: RolloutRows,
    advantages: Advantages,
    gradients: PpoGradients,
    order: Vec<usize>,
    report: IterationReport,
}

/// What an iteration showed.
#[derive(Clone, Copy, Debug, Default)]
struct IterationReport {
    ended: EndedEpisodes,
    /// Of the last epoch.
    sums: MinibatchSums,
    learning_rate: f32,
    deviation: f32,
    metrics: [(&'static str, f64); 7],
}

impl<'a, B: BatchEnvironment> PpoRun<'a, B> {
    /// Checks that all parts fit and brings the slots to where the state left them.
    pub(crate) fn new(mut batch: B, settings: &'a PpoSettings, state: PpoState) -> Result<Self, TrainError> {
        settings.validate()?;
        let spec = batch.spec();
        check(&spec.lengths, &state.actor.spec())?;
        if state.records.len() != spec.slots {
            return Err(TrainError::EnvironmentCount { found: spec.slots, expected: state.records.len() });
        }
        mismatch("privileged inputs", &state.privileged_len(), &spec.privileged_len)?;
        let hidden = |sizes: &[usize]| sizes[1..sizes.len() - 1].to_vec();
        let actor_hidden = hidden(state.actor.network().sizes());
        mismatch("an actor of hidden widths", &actor_hidden, &settings.hidden)?;
        mismatch("a critic of hidden widths", &hidden(state.critic.sizes()), &settings.hidden)?;
        let mut slots = Slots::new(&spec, &state);
        let mut state = state;
        for slot in 0..spec.slots {
            if state.records[slot].start.is_some() {
                slots.replay(&mut batch, &state, slot)?;
            } else {
                slots.begin(&mut batch, &mut state, slot)?;
            }
        }
        Ok(Self {
            slots,
            rollout: RolloutRows::new(spec),
            advantages: Advantages::default(),
            gradients: PpoGradients::new(&state),
            order: Vec::new(),
            report: IterationReport::default(),
            batch,
            state,
            settings,
        })
    }

    /// Returns true if the budget is used up.
    pub(crate) fn is_done(&self) -> bool {
        self.state.env_steps >= self.settings.max_env_steps
    }

    /// Runs one iteration.
    pub(crate) fn iterate(&mut self) -> Result<(), TrainError> {
        let progress = (self.state.env_steps as f64 / self.settings.max_env_steps as f64).min(1.0) as f32;
        let deviation = self.settings.deviation.at(progress);
        let learning_rate = self.state.learning_rate * self.settings.learning_rate_factor.at(progress);
        self.report = IterationReport { deviation, learning_rate, ..self.report };
        self.collect(progress, deviation)?;
        self.advantages.estimate(&self.rollout, &self.state.critic, self.settings, progress);
        self.improve(deviation, learning_rate)?;
        self.steer();
        self.state.iterations += 1;
        self.note_metrics();
        Ok(())
    }

    /// Phase 1: what the policy does. The first rollout also says how inputs are scaled.
    fn collect(&mut self, progress: f32, deviation: f32) -> Result<(), TrainError> {
        self.state.set_deviation(deviation);
        let step_count = self.settings.rollout_steps.at(progress).round() as usize;
        let Self { batch, state, slots, rollout, .. } = self;
        let ended = rollout.collect(batch, state, slots, (step_count, deviation))?;
        if ended.count > 0 {
            self.report.ended = ended;
        }
        if self.state.iterations == 0 && self.settings.normalise {
            let [observations, privileged] = self.rollout.fit_normalisers();
            // A fresh actor's mean is zero whatever it sees, so that nothing has to be computed again.
            if !self.state.is_given {
                self.state.actor.set_normaliser(observations);
            }
            self.state.privileged = privileged;
        }
        self.rollout.normalise(&self.state);
        Ok(())
    }

    /// Phase 3: a few passes over the rollout in random order.
    fn improve(&mut self, deviation: f32, learning_rate: f32) -> Result<(), TrainError> {
        let bounds = PolicyBounds { deviation, clip: self.settings.clip };
        let actor_waits = self.state.iterations < self.settings.actor_waits;
        self.order.clear();
        self.order.extend(0..self.rollout.len());
        for _ in 0..self.settings.epochs {
            shuffle(&mut self.order, &mut self.state);
            self.report.sums = MinibatchSums::default();
            for rows in self.order.chunks(self.settings.minibatch) {
                let seen = (&self.rollout, &self.advantages);
                let sums = self.gradients.compute(&self.state, seen, rows, bounds);
                let PpoState { actor, critic, actor_adam, critic_adam, .. } = &mut self.state;
                if !actor_waits {
                    shorten(&mut self.gradients.actor, self.settings.gradient_norm);
                    let parameters = actor.network_mut().parameters_mut();
                    actor_adam.step(learning_rate, parameters, &self.gradients.actor);
                }
                shorten(&mut self.gradients.critic, self.settings.gradient_norm);
                critic_adam.step(learning_rate, critic.parameters_mut(), &self.gradients.critic);
                self.state.updates += 1;
                self.report.sums.add(&sums);
            }
        }
        let MinibatchSums { value_loss, failure_loss, kl, .. } = self.report.sums;
        if (value_loss + failure_loss + kl).is_finite() && self.state.is_finite() {
            Ok(())
        } else {
            Err(TrainError::Diverged { what: "a loss or a weight", updates: self.state.updates })
        }
    }

    /// Steers the step size to the divergence that is wanted.
    fn steer(&mut self) {
        let target = self.settings.target_kl;
        if target <= 0.0 || self.state.iterations < self.settings.actor_waits {
            return;
        }
        let kl = (self.report.sums.kl / self.report.sums.rows) as f32;
        let rate = &mut self.state.learning_rate;
        if kl > STEERING * target {
            *rate /= STEERING;
        } else if kl < target / STEERING {
            *rate *= STEERING;
        }
        let [least, most] = LEARNING_RATE_SHARES.map(|share| share * self.settings.learning_rate);
        *rate = rate.clamp(least, most);
    }

    fn note_metrics(&mut self) {
        let IterationReport { sums, learning_rate, deviation, .. } = self.report;
        let mean = |sum: f64| sum / sums.rows;
        self.report.metrics = [
            ("policy_gradient_loss", mean(sums.actor_loss)),
            ("value_loss", mean(sums.value_loss)),
            ("failure_loss", mean(sums.failure_loss)),
            ("approx_kl", mean(sums.kl)),
            ("clip_fraction", mean(sums.clipped)),
            ("std", f64::from(deviation)),
            ("learning_rate", f64::from(learning_rate)),
        ];
    }

    /// What an observer sees after an iteration.
    pub(crate) fn progress(&self) -> Progress<'_> {
        let EndedEpisodes { count, total_return, steps, successes } = self.report.ended;
        let mean = |sum: f64| sum / count.max(1) as f64;
        Progress {
            updates: self.state.updates,
            episodes: self.state.episodes,
            recent_return: mean(total_return),
            recent_success_rate: mean(successes as f64),
            recent_steps: mean(steps as f64),
            metrics: if self.state.iterations > 0 { &self.report.metrics } else { &[] },
            max_env_steps: Some(self.settings.max_env_steps),
            ..Progress::new(&self.state.actor, self.state.env_steps)
        }
    }
}

/// Shuffles `order` (Fisher and Yates).
fn shuffle(order: &mut [usize], state: &mut PpoState) {
    for last in (1..order.len()).rev() {
        order.swap(last, state.shuffle_rng.random_range(0..=last));
    }
}

/// Shortens `gradient` to `norm_max`.
fn shorten(gradient: &mut [f32], norm_max: f32) {
    let norm = dot(gradient, gradient).sqrt();
    if norm > norm_max {
        let scale = norm_max / norm;
        gradient.iter_mut().for_each(|value| *value *= scale);
    }
}

fn check(found: &EnvironmentSpec, expected: &EnvironmentSpec) -> Result<(), TrainError> {
    if found == expected {
        return Ok(());
    }
    Err(TrainError::Spec { environment: 0, found: *found, expected: *expected })
}

/// Refuses a state that differs from batch or settings.
fn mismatch<T: PartialEq + std::fmt::Debug>(
    what: &'static str,
    found: &T,
    expected: &T,
) -> Result<(), TrainError> {
    if found == expected {
        return Ok(());
    }
    Err(TrainError::Mismatch { what, found: format!("{found:?}"), expected: format!("{expected:?}") })
}
