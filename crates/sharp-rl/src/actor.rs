//! The policy: a tanh-squashed diagonal Gaussian over actions in \[-1, 1\].

use std::f32::consts::{LN_2, TAU};

use rand::RngExt;
use rand_distr::StandardNormal;
use thiserror::Error;

use crate::environment::{EnvironmentSpec, Stream};
use crate::network::{Mlp, Scratch};

/// Bounds of the logarithm of a standard deviation (Stable-Baselines3).
pub(crate) const LOG_STD_MIN: f32 = -20.0;
pub(crate) const LOG_STD_MAX: f32 = 2.0;

/// Scales observations to what the networks see: `(observation - mean) / std`.
#[derive(Clone, Debug, PartialEq)]
pub struct Normaliser {
    mean: Vec<f32>,
    std: Vec<f32>,
}

/// Why vectors make no normaliser.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum NormaliserError {
    /// One mean for each deviation is needed.
    #[error("{means} means for {deviations} deviations")]
    Len {
        /// Means given.
        means: usize,
        /// Deviations given.
        deviations: usize,
    },
    /// Means are finite, deviations finite and positive.
    #[error("component {component} has mean {mean} and deviation {std}")]
    Value {
        /// The component of the observation.
        component: usize,
        /// Its mean.
        mean: f32,
        /// Its deviation.
        std: f32,
    },
}

impl Normaliser {
    /// A normaliser that changes nothing.
    #[must_use]
    pub fn identity(observation_len: usize) -> Self {
        Self { mean: vec![0.0; observation_len], std: vec![1.0; observation_len] }
    }

    /// A normaliser from means and standard deviations.
    ///
    /// # Errors
    /// If the lengths differ, a value is not finite, or a deviation is not positive.
    pub fn new(mean: Vec<f32>, std: Vec<f32>) -> Result<Self, NormaliserError> {
        if mean.len() != std.len() {
            return Err(NormaliserError::Len { means: mean.len(), deviations: std.len() });
        }
        for (component, (&mean, &std)) in mean.iter().zip(&std).enumerate() {
            if !(mean.is_finite() && std.is_finite() && std > 0.0) {
                return Err(NormaliserError::Value { component, mean, std });
            }
        }
        Ok(Self { mean, std })
    }

    /// Means and deviations of `observations`, laid end to end, each `observation_len` long.
    ///
    /// Components that never vary are only centred; a deviation is at least 1e-3 so that a value
    /// seen once does not blow up.
    #[must_use]
    pub fn fit(observations: &[f32], observation_len: usize) -> Self {
        let count = (observations.len() / observation_len).max(1) as f64;
        let mut sums = vec![(0.0_f64, 0.0_f64); observation_len];
        for observation in observations.chunks_exact(observation_len) {
            for ((sum, squares), &value) in sums.iter_mut().zip(observation) {
                *sum += f64::from(value);
                *squares += f64::from(value) * f64::from(value);
            }
        }
        let deviation = |sum: f64, squares: f64| {
            let std = (squares / count - (sum / count).powi(2)).max(0.0).sqrt();
            if std < 1e-6 { 1.0 } else { std.max(1e-3) }
        };
        Self {
            mean: sums.iter().map(|(sum, _)| (sum / count) as f32).collect(),
            std: sums.iter().map(|&(sum, squares)| deviation(sum, squares) as f32).collect(),
        }
    }

    /// The means, one for each component.
    #[must_use]
    pub fn mean(&self) -> &[f32] {
        &self.mean
    }

    /// The deviations, one for each component; positive.
    #[must_use]
    pub fn std(&self) -> &[f32] {
        &self.std
    }

    /// Normalises observations laid end to end, in place.
    pub fn apply(&self, observations: &mut [f32]) {
        for observation in observations.chunks_exact_mut(self.mean.len()) {
            for ((value, mean), std) in observation.iter_mut().zip(&self.mean).zip(&self.std) {
                *value = (*value - mean) / std;
            }
        }
    }
}

/// A policy ready for use: network and normaliser.
#[derive(Clone, Debug, PartialEq)]
pub struct Actor {
    network: Mlp,
    normaliser: Normaliser,
}

/// Why a network and a normaliser make no actor.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error(
    "network sizes {sizes:?} do not fit a normaliser of {normaliser_len} components and pairs of outputs"
)]
pub struct ActorError {
    /// Layer sizes of the network.
    pub sizes: Vec<usize>,
    /// Components of the normaliser.
    pub normaliser_len: usize,
}

impl Actor {
    /// A fresh actor with `ReLU` layers of the widths `hidden`.
    ///
    /// # Panics
    /// If a width is zero.
    #[must_use]
    pub fn new(spec: EnvironmentSpec, hidden: &[usize], rng: &mut Stream) -> Self {
        let sizes = layer_sizes(spec.observation_len, hidden, 2 * spec.action_len);
        Self { network: Mlp::new(&sizes, rng), normaliser: Normaliser::identity(spec.observation_len) }
    }

    /// An actor from its parts. The network's outputs are the means, then the log deviations.
    ///
    /// # Errors
    /// If the lengths do not fit each other.
    pub fn from_parts(network: Mlp, normaliser: Normaliser) -> Result<Self, ActorError> {
        let sizes = network.sizes();
        let outputs = sizes[sizes.len() - 1];
        if sizes[0] != normaliser.mean.len() || !outputs.is_multiple_of(2) {
            return Err(ActorError { sizes: sizes.to_vec(), normaliser_len: normaliser.mean.len() });
        }
        Ok(Self { network, normaliser })
    }

    /// The lengths of observations and actions.
    #[must_use]
    pub fn spec(&self) -> EnvironmentSpec {
        let sizes = self.network.sizes();
        EnvironmentSpec { observation_len: sizes[0], action_len: sizes[sizes.len() - 1] / 2 }
    }

    /// The network behind the policy.
    #[must_use]
    pub const fn network(&self) -> &Mlp {
        &self.network
    }

    /// The network behind the policy, to be trained.
    pub const fn network_mut(&mut self) -> &mut Mlp {
        &mut self.network
    }

    /// What observations pass through first.
    #[must_use]
    pub const fn normaliser(&self) -> &Normaliser {
        &self.normaliser
    }

    /// Replaces the normaliser.
    ///
    /// # Panics
    /// If it has another length.
    pub fn set_normaliser(&mut self, normaliser: Normaliser) {
        assert_eq!(normaliser.mean.len(), self.normaliser.mean.len(), "length of the normaliser");
        self.normaliser = normaliser;
    }

    /// Writes the most likely action, tanh of the mean: the deployed, deterministic policy.
    ///
    /// # Panics
    /// If `observation` or `action` has a length other than [`Self::spec`] says.
    pub fn act_mean(&self, observation: &[f32], scratch: &mut ActorScratch, action: &mut [f32]) {
        let outputs = self.outputs(observation, scratch, action.len());
        for (action, mean) in action.iter_mut().zip(outputs) {
            *action = mean.tanh();
        }
    }

    /// Draws an action, as training does.
    ///
    /// # Panics
    /// If `observation` or `action` has a length other than [`Self::spec`] says.
    pub fn act_sample(
        &self,
        observation: &[f32],
        rng: &mut Stream,
        scratch: &mut ActorScratch,
        action: &mut [f32],
    ) {
        let (means, log_stds) = self.outputs(observation, scratch, action.len()).split_at(action.len());
        for ((action, mean), log_std) in action.iter_mut().zip(means).zip(log_stds) {
            let noise: f32 = rng.sample(StandardNormal);
            *action = (mean + log_std.clamp(LOG_STD_MIN, LOG_STD_MAX).exp() * noise).tanh();
        }
    }

    /// Means, then log deviations.
    fn outputs<'a>(
        &self,
        observation: &[f32],
        scratch: &'a mut ActorScratch,
        action_len: usize,
    ) -> &'a [f32] {
        assert_eq!(2 * action_len, self.network.sizes()[self.network.layer_count()], "length of the action");
        scratch.observation.clear();
        scratch.observation.extend_from_slice(observation);
        self.normaliser.apply(&mut scratch.observation);
        self.network.predict(&scratch.observation, &mut scratch.network)
    }
}

/// Reused room for decisions.
#[derive(Clone, Debug, Default)]
pub struct ActorScratch {
    observation: Vec<f32>,
    network: Scratch,
}

/// Log density of one component at `u` before squashing: Gaussian minus the volume tanh removes.
///
/// log(1 - tanh²u) is written as 2 (ln 2 - u - softplus(-2u)): exact where the square rounds to 1.
pub(crate) fn log_density(noise: f32, log_std: f32, u: f32) -> f32 {
    let softplus = (-2.0 * u).max(0.0) + (-2.0 * u.abs()).exp().ln_1p();
    -0.5 * (noise * noise + TAU.ln()) - log_std - 2.0 * (LN_2 - u - softplus)
}

/// Layer sizes from input to output.
pub(crate) fn layer_sizes(inputs: usize, hidden: &[usize], outputs: usize) -> Vec<usize> {
    let mut sizes = vec![inputs];
    sizes.extend_from_slice(hidden);
    sizes.push(outputs);
    sizes
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    #[test]
    fn the_squashed_density_integrates_to_one() {
        // Over actions: p(a) = p(u) / (1 - a²), so the sum runs over a on a fine grid.
        for (mean, log_std) in [(0.0_f32, 0.0_f32), (0.8, -1.0), (-1.5, -0.5)] {
            let cells = 20_000;
            let total: f64 = (0..cells)
                .map(|cell| {
                    let u = (-1.0 + 2.0 * (cell as f64 + 0.5) / f64::from(cells)).atanh() as f32;
                    let noise = (u - mean) / log_std.exp();
                    f64::from(log_density(noise, log_std, u).exp()) * 2.0 / f64::from(cells)
                })
                .sum();
            assert!((total - 1.0).abs() < 2e-3, "mean {mean}, log deviation {log_std}: {total}");
        }
    }

    #[test]
    fn the_density_stays_finite_where_tanh_is_one() {
        for u in [-50.0, 50.0] {
            assert!(log_density(0.0, 0.0, u).is_finite(), "at {u}");
        }
    }

    #[test]
    fn samples_surround_the_mean() {
        let spec = EnvironmentSpec { observation_len: 3, action_len: 2 };
        let mut rng = Stream::seed_from_u64(1);
        let actor = Actor::new(spec, &[16], &mut rng);
        let mut scratch = ActorScratch::default();
        let (mut mean, mut action, mut above) = ([0.0; 2], [0.0; 2], 0);
        actor.act_mean(&[0.1, 0.2, 0.3], &mut scratch, &mut mean);
        for _ in 0..1000 {
            actor.act_sample(&[0.1, 0.2, 0.3], &mut rng, &mut scratch, &mut action);
            assert!(action.iter().all(|a| a.abs() <= 1.0), "{action:?} within bounds");
            above += usize::from(action[0] > mean[0]);
        }
        assert!((430..570).contains(&above), "{above} of 1000 above the median");
    }

    #[test]
    fn a_fitted_normaliser_centres_and_scales() {
        let mut observations = vec![1.0, 5.0, 3.0, 5.0];
        let normaliser = Normaliser::fit(&observations, 2);
        assert_eq!(normaliser.mean(), [2.0, 5.0]);
        assert_eq!(normaliser.std(), [1.0, 1.0], "a constant is only centred");
        normaliser.apply(&mut observations);
        assert_eq!(observations, [-1.0, 0.0, 1.0, 0.0]);
    }

    #[test]
    fn a_broken_normaliser_is_refused() {
        let refuse =
            |mean: &[f32], std: &[f32]| Normaliser::new(mean.to_vec(), std.to_vec()).unwrap_err().to_string();
        assert_eq!(refuse(&[0.0], &[]), "1 means for 0 deviations");
        assert_eq!(refuse(&[0.0, 1.0], &[1.0, 0.0]), "component 1 has mean 1 and deviation 0");
        assert_eq!(refuse(&[f32::NAN], &[1.0]), "component 0 has mean NaN and deviation 1");
    }
}
