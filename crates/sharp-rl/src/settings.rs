//! Hyperparameters of soft actor-critic.
//!
//! [`SacSettings::default`] has the paper's networks: two hidden layers of 256 (Sec. 5). What the
//! paper does not state is the default of Stable-Baselines3, which it used;
//! [`TrainSettings::paper`](crate::TrainSettings::paper) has other values there.
//! [`SacSettings::fast`] is for small tasks on a CPU.

use std::fmt;

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// How actions are chosen during the warm-up.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Exploration {
    /// Uniform over \[-1, 1\] (Stable-Baselines3).
    Uniform,
    /// Normal around zero with this standard deviation, clipped to \[-1, 1\].
    ///
    /// For a policy that corrects a base policy, such actions stay near the base.
    Gaussian(f32),
    /// Drawn from the policy, for fine-tuning.
    Policy,
}

/// Hyperparameters of soft actor-critic.
///
/// Begin with a preset and change fields, in place or with [`SacSettings::with`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct SacSettings {
    /// Widths of the hidden layers of actor and critics (paper: two of 256).
    pub hidden: Vec<usize>,
    /// Discount γ per environment step, in (0, 1]. The paper's SSP has 1, SB3 learns with 0.99.
    pub gamma: f32,
    /// Share τ by which target critics follow the critics at each update, in (0, 1].
    pub tau: f32,
    /// Step size of Adam for actor, critics and temperature.
    pub learning_rate: f32,
    /// Transitions in a gradient step.
    pub batch: usize,
    /// Transitions that the replay buffer keeps, at least a batch. The oldest are overwritten.
    pub buffer_capacity: usize,
    /// The temperature α at the start. It then adapts to the target entropy.
    pub initial_alpha: f32,
    /// Target entropy H̄ of the policy, nats; `None` stands for minus the number of action components.
    pub target_entropy: Option<f32>,
    /// Gradient steps per environment step, any non-negative number (SB3: 1).
    pub updates_per_step: f32,
    /// Environment steps before the first gradient step (SB3's `learning_starts`).
    pub warmup_steps: u64,
    /// How actions are chosen during the warm-up.
    pub exploration: Exploration,
    /// Steps of the n-step return, 1 to 255. It never reaches across the end of an episode.
    pub n_step: usize,
    /// Factor on rewards inside the learner. Reported returns are not scaled.
    pub reward_scale: f32,
    /// Sets the actor's last layer to zero at the start, so that a residual policy begins as its base.
    pub zero_last_actor_layer: bool,
}

impl Default for SacSettings {
    fn default() -> Self {
        Self {
            hidden: vec![256, 256],
            gamma: 0.99,
            tau: 0.005,
            learning_rate: 3e-4,
            batch: 256,
            buffer_capacity: 1_000_000,
            initial_alpha: 1.0,
            target_entropy: None,
            updates_per_step: 1.0,
            warmup_steps: 100,
            exploration: Exploration::Uniform,
            n_step: 1,
            reward_scale: 1.0,
            zero_last_actor_layer: false,
        }
    }
}

/// A setting outside its range.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
#[error("{name} is {value}, expected {expected}")]
pub struct SettingsError {
    /// Name of the field.
    pub name: &'static str,
    /// Its value, as text.
    pub value: String,
    /// Its range, in words.
    pub expected: &'static str,
}

impl SettingsError {
    /// An error that names a field, its value and its range.
    #[must_use]
    pub fn new(name: &'static str, value: &dyn fmt::Debug, expected: &'static str) -> Self {
        Self { name, value: format!("{value:?}"), expected }
    }
}

impl SacSettings {
    /// Small networks and few updates: a small task takes seconds instead of minutes.
    #[must_use]
    pub fn fast() -> Self {
        Self {
            hidden: vec![64, 64],
            gamma: 0.97,
            tau: 0.01,
            learning_rate: 1e-3,
            buffer_capacity: 300_000,
            initial_alpha: 0.05,
            target_entropy: Some(-2.0),
            updates_per_step: 0.5,
            warmup_steps: 500,
            exploration: Exploration::Gaussian(0.4),
            ..Self::default()
        }
    }

    /// The same settings after `change`.
    #[must_use]
    pub fn with(mut self, change: impl FnOnce(&mut Self)) -> Self {
        change(&mut self);
        self
    }

    /// Checks every range.
    ///
    /// # Errors
    /// Names the first field outside its range.
    pub fn validate(&self) -> Result<(), SettingsError> {
        let positive = |value: f32| value > 0.0 && value.is_finite();
        let share = |value: f32| value > 0.0 && value <= 1.0;
        let check = |fits: bool, name, value: &dyn fmt::Debug, expected| {
            if fits { Ok(()) } else { Err(SettingsError::new(name, value, expected)) }
        };
        let widths = !self.hidden.is_empty() && !self.hidden.contains(&0);
        check(widths, "hidden", &self.hidden, "one positive width or more")?;
        check(share(self.gamma), "gamma", &self.gamma, "a number in (0, 1]")?;
        check(share(self.tau), "tau", &self.tau, "a number in (0, 1]")?;
        check(positive(self.learning_rate), "learning_rate", &self.learning_rate, "a positive number")?;
        check(self.batch > 0, "batch", &self.batch, "a positive count")?;
        let fits = self.buffer_capacity >= self.batch;
        check(fits, "buffer_capacity", &self.buffer_capacity, "at least the batch")?;
        check(positive(self.initial_alpha), "initial_alpha", &self.initial_alpha, "a positive number")?;
        let finite = self.target_entropy.is_none_or(f32::is_finite);
        check(finite, "target_entropy", &self.target_entropy, "a finite number")?;
        let rate = self.updates_per_step >= 0.0 && self.updates_per_step.is_finite();
        check(rate, "updates_per_step", &self.updates_per_step, "a non-negative number")?;
        check((1..=255).contains(&self.n_step), "n_step", &self.n_step, "1 to 255")?;
        check(positive(self.reward_scale), "reward_scale", &self.reward_scale, "a positive number")?;
        let spread = match self.exploration {
            Exploration::Gaussian(std) => std >= 0.0 && std.is_finite(),
            Exploration::Uniform | Exploration::Policy => true,
        };
        check(spread, "exploration", &self.exploration, "a non-negative deviation")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn both_presets_are_valid_and_survive_json() {
        for settings in [SacSettings::default(), SacSettings::fast()] {
            assert_eq!(settings.validate(), Ok(()));
            let json = serde_json::to_string(&settings).expect("plain data");
            assert_eq!(serde_json::from_str::<SacSettings>(&json).expect("own output"), settings);
        }
    }

    #[test]
    fn a_field_out_of_range_is_named() {
        let fast = SacSettings::fast;
        for (settings, message) in [
            (SacSettings { hidden: vec![], ..fast() }, "hidden is [], expected one positive width or more"),
            (SacSettings { gamma: 1.1, ..fast() }, "gamma is 1.1, expected a number in (0, 1]"),
            (SacSettings { tau: f32::NAN, ..fast() }, "tau is NaN, expected a number in (0, 1]"),
            (SacSettings { batch: 0, ..fast() }, "batch is 0, expected a positive count"),
            (
                SacSettings { buffer_capacity: 5, ..fast() },
                "buffer_capacity is 5, expected at least the batch",
            ),
            (SacSettings { n_step: 0, ..fast() }, "n_step is 0, expected 1 to 255"),
        ] {
            assert_eq!(settings.validate().expect_err(message).to_string(), message);
        }
        let json = r#"{"gama": 0.9}"#;
        assert!(serde_json::from_str::<SacSettings>(json).is_err(), "a misspelt field is an error");
    }
}
