//! Hyperparameters of proximal policy optimisation.

use serde::{Deserialize, Serialize};

use crate::settings::SettingsError;

/// A number that changes during training, from its first value to its last.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Schedule {
    /// The value until the share `begin` of training.
    pub first: f32,
    /// The value from the share `end` of training on.
    pub last: f32,
    /// Share of training at which the change begins, 0 to 1.
    pub begin: f32,
    /// Share of training at which the change ends, from `begin` to 1.
    pub end: f32,
}

impl Schedule {
    /// The same value all the time.
    #[must_use]
    pub const fn constant(value: f32) -> Self {
        Self { first: value, last: value, begin: 0.0, end: 1.0 }
    }

    /// A change over the whole of training.
    #[must_use]
    pub const fn between(first: f32, last: f32) -> Self {
        Self { first, last, begin: 0.0, end: 1.0 }
    }

    /// The value when the share `progress` of training is done. In between it changes by equal factors for equal
    /// shares.
    #[must_use]
    pub fn at(&self, progress: f32) -> f32 {
        let share = ((progress - self.begin) / (self.end - self.begin).max(1e-6)).clamp(0.0, 1.0);
        if share == 0.0 { self.first } else { self.first * (self.last / self.first).powf(share) }
    }

    fn is_valid(&self, from: f32, to: f32) -> bool {
        let within = |value: f32| value >= from && value <= to;
        within(self.first)
            && within(self.last)
            && 0.0 <= self.begin
            && self.begin <= self.end
            && self.end <= 1.0
    }
}

/// What a failure costs, in units of the reward: `least` x (`most` / `least`)^caution.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct FailurePrice {
    /// The price at no caution.
    pub least: f32,
    /// The price at full caution.
    pub most: Schedule,
}

impl FailurePrice {
    /// Failures are free: for tasks that have none.
    pub const NONE: Self = Self { least: 0.0, most: Schedule::constant(1.0) };

    /// The price at `caution` when the share `progress` of training is done.
    #[must_use]
    pub fn at(&self, caution: f32, progress: f32) -> f32 {
        if self.least == 0.0 { 0.0 } else { self.least * (self.most.at(progress) / self.least).powf(caution) }
    }
}

/// Hyperparameters of proximal policy optimisation.
///
/// Begin with the default and change fields, in place or with [`PpoSettings::with`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct PpoSettings {
    /// Widths of the hidden layers of actor and critic.
    pub hidden: Vec<usize>,
    /// The budget: steps, all slots together. The last iteration may exceed it.
    pub max_env_steps: u64,
    /// Steps of each slot in a rollout; rounded.
    pub rollout_steps: Schedule,
    /// Passes over a rollout.
    pub epochs: usize,
    /// Rows in a gradient step.
    pub minibatch: usize,
    /// Discount γ of the reward. Failures are not discounted.
    pub gamma: f32,
    /// λ of generalised advantage estimation, for both heads.
    pub lambda: f32,
    /// Largest change of the probability ratio that is rewarded (ε of the paper).
    pub clip: f32,
    /// Step size of Adam at the start.
    pub learning_rate: f32,
    /// Factor on the step size.
    pub learning_rate_factor: Schedule,
    /// Divergence of the policy over an iteration that the step size is steered to, nats; 0 for a fixed step size.
    pub target_kl: f32,
    /// Largest norm of a network's gradient; longer ones are shortened.
    pub gradient_norm: f32,
    /// Standard deviation of each action component around the policy's mean.
    pub deviation: Schedule,
    /// What a failure costs.
    pub failure_price: FailurePrice,
    /// Bins of caution within which advantages are normalised.
    pub caution_bins: usize,
    /// Normalised advantages are cut here, in deviations: single rows shall not rule a gradient. Rare failures are
    /// large, so a small number makes them cheaper than their price.
    pub advantage_max: f32,
    /// Iterations in which only the critic learns: an actor that drives already must not follow a fresh critic.
    pub actor_waits: u64,
    /// Scales observations by mean and deviation of the first rollout, if the actor is fresh.
    pub normalise: bool,
}

impl Default for PpoSettings {
    /// For small tasks without failures.
    fn default() -> Self {
        Self {
            hidden: vec![64, 64],
            max_env_steps: 100_000,
            rollout_steps: Schedule::constant(64.0),
            epochs: 10,
            minibatch: 64,
            gamma: 0.99,
            lambda: 0.95,
            clip: 0.2,
            learning_rate: 3e-4,
            learning_rate_factor: Schedule::constant(1.0),
            target_kl: 0.0,
            gradient_norm: 0.5,
            deviation: Schedule::between(0.5, 0.1),
            failure_price: FailurePrice::NONE,
            caution_bins: 1,
            advantage_max: 10.0,
            actor_waits: 0,
            normalise: true,
        }
    }
}

impl PpoSettings {
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
        let check = |fits: bool, name, value: &dyn std::fmt::Debug, expected| {
            if fits { Ok(()) } else { Err(SettingsError::new(name, value, expected)) }
        };
        let positive = |value: f32| value > 0.0 && value.is_finite();
        let share = |value: f32| value > 0.0 && value <= 1.0;
        let widths = !self.hidden.is_empty() && !self.hidden.contains(&0);
        check(widths, "hidden", &self.hidden, "one positive width or more")?;
        let steps = self.rollout_steps.is_valid(1.0, 1e5);
        check(steps, "rollout_steps", &self.rollout_steps, "1 to 100000 steps")?;
        check(self.epochs > 0, "epochs", &self.epochs, "a positive count")?;
        check(self.minibatch > 0, "minibatch", &self.minibatch, "a positive count")?;
        check(share(self.gamma), "gamma", &self.gamma, "a number in (0, 1]")?;
        check((0.0..=1.0).contains(&self.lambda), "lambda", &self.lambda, "a number in [0, 1]")?;
        check(positive(self.clip), "clip", &self.clip, "a positive number")?;
        check(positive(self.learning_rate), "learning_rate", &self.learning_rate, "a positive number")?;
        let factor = &self.learning_rate_factor;
        check(factor.is_valid(1e-6, 1e6), "learning_rate_factor", factor, "positive numbers")?;
        let kl = self.target_kl >= 0.0 && self.target_kl.is_finite();
        check(kl, "target_kl", &self.target_kl, "a non-negative number")?;
        check(positive(self.gradient_norm), "gradient_norm", &self.gradient_norm, "a positive number")?;
        check(
            self.deviation.is_valid(1e-4, 10.0),
            "deviation",
            &self.deviation,
            "positive numbers up to 10",
        )?;
        let price = &self.failure_price;
        let priced = price.least >= 0.0 && price.least.is_finite() && price.most.is_valid(1e-6, 1e9);
        check(priced, "failure_price", price, "finite prices")?;
        check(self.caution_bins > 0, "caution_bins", &self.caution_bins, "a positive count")?;
        check(positive(self.advantage_max), "advantage_max", &self.advantage_max, "a positive number")
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_schedule_changes_by_equal_factors_between_its_ends() {
        let schedule = Schedule { first: 1.0, last: 100.0, begin: 0.2, end: 0.6 };
        for (progress, expected) in [(0.0, 1.0), (0.2, 1.0), (0.4, 10.0), (0.6, 100.0), (1.0, 100.0)] {
            let found = schedule.at(progress);
            assert!((found - expected).abs() < 1e-3 * expected, "{found} at {progress}, expected {expected}");
        }
    }

    #[test]
    fn the_price_of_a_failure_rises_with_caution() {
        let price = FailurePrice { least: 30.0, most: Schedule::constant(3000.0) };
        for (caution, expected) in [(0.0, 30.0), (0.5, 300.0), (1.0, 3000.0)] {
            let found = price.at(caution, 0.5);
            assert!((found - expected).abs() < 0.01 * expected, "{found} at {caution}, expected {expected}");
        }
        assert_eq!(FailurePrice::NONE.at(1.0, 0.5), 0.0);
    }

    #[test]
    fn a_field_out_of_range_is_named() {
        let error = |change: fn(&mut PpoSettings)| {
            PpoSettings::default().with(change).validate().expect_err("out of range").name
        };
        assert_eq!(PpoSettings::default().validate(), Ok(()));
        assert_eq!(error(|s| s.hidden = vec![0]), "hidden");
        assert_eq!(error(|s| s.rollout_steps = Schedule::constant(0.0)), "rollout_steps");
        assert_eq!(error(|s| s.gamma = 1.5), "gamma");
        assert_eq!(error(|s| s.deviation = Schedule::between(0.5, 0.0)), "deviation");
        assert_eq!(error(|s| s.caution_bins = 0), "caution_bins");
    }
}
