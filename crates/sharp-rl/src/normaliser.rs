//! Scaling of observations before the networks see them.

use thiserror::Error;

/// Scales observations for the networks: `(observation - mean) / std`, component by component.
#[derive(Clone, Debug, PartialEq)]
pub struct Normaliser {
    mean: Vec<f32>,
    std: Vec<f32>,
}

/// Why vectors do not make a normaliser.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum NormaliserError {
    /// Means and deviations differ in number.
    #[error("{means} means for {deviations} deviations")]
    Len {
        /// Means given.
        means: usize,
        /// Deviations given.
        deviations: usize,
    },
    /// A mean is not finite, or a deviation is not finite and positive.
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
    /// A component that never varies is only centred. A deviation is at least 1e-3, so that rare
    /// values are not scaled up without bound.
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

#[cfg(test)]
mod tests {
    use super::*;

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
    fn means_and_deviations_that_do_not_fit_are_refused() {
        let refuse =
            |mean: &[f32], std: &[f32]| Normaliser::new(mean.to_vec(), std.to_vec()).unwrap_err().to_string();
        assert_eq!(refuse(&[0.0], &[]), "1 means for 0 deviations");
        assert_eq!(refuse(&[0.0, 1.0], &[1.0, 0.0]), "component 1 has mean 1 and deviation 0");
        assert_eq!(refuse(&[f32::NAN], &[1.0]), "component 0 has mean NaN and deviation 1");
    }
}
