//! Fitting a network to data: plain supervised learning, for what is predicted rather than controlled.

use rand::seq::SliceRandom;
use thiserror::Error;

use crate::adam::Adam;
use crate::environment::Stream;
use crate::network::{Mlp, Tape};

/// What a network is fitted to, row by row.
pub trait Samples: Sync {
    /// Number of rows.
    fn len(&self) -> usize;

    /// Returns true if there are none.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The inputs of row `row`.
    fn inputs(&self, row: usize) -> &[f32];

    /// The loss of row `row` where the network says `outputs`; writes its derivative with respect to each output.
    fn loss(&self, row: usize, outputs: &[f32], derivative: &mut [f32]) -> f64;
}

/// How a network is fitted.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FitSettings {
    /// Passes through all rows.
    pub epochs: u32,
    /// Rows of a gradient step.
    pub minibatch: usize,
    /// Step size of Adam at the beginning; it falls linearly to a twentieth.
    pub learning_rate: f32,
}

/// Why a network could not be fitted.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum FitError {
    /// There is nothing to fit to.
    #[error("no rows to fit to")]
    NoRows,
    /// The loss is not a number.
    #[error("the loss is {loss} in epoch {epoch}")]
    Diverged {
        /// The epoch, from 0.
        epoch: u32,
        /// The mean loss there.
        loss: f64,
    },
}

/// Minimises the mean loss over `samples` and returns it for each epoch, as it was while the epoch went on.
///
/// # Errors
/// If there are no rows, or if the loss is no longer a number.
///
/// # Panics
/// If `settings` has a minibatch of 0.
pub fn fit(
    network: &mut Mlp,
    samples: &dyn Samples,
    settings: &FitSettings,
    rng: &mut Stream,
) -> Result<Vec<f64>, FitError> {
    if samples.is_empty() {
        return Err(FitError::NoRows);
    }
    let FitSettings { epochs, minibatch, learning_rate } = *settings;
    let mut rows: Vec<usize> = (0..samples.len()).collect();
    let steps = u64::from(epochs) * samples.len().div_ceil(minibatch) as u64;
    let mut adam = Adam::new(network.parameters().len());
    let mut step = FitStep::new(network, minibatch);
    let mut losses = Vec::new();
    for epoch in 0..epochs {
        rows.shuffle(rng);
        let mut total = 0.0;
        for part in rows.chunks(minibatch) {
            total += step.compute(network, samples, part);
            let left = 1.0 - adam.steps as f32 / steps as f32;
            adam.step(learning_rate * left.max(0.05), network.parameters_mut(), &step.gradient);
        }
        let loss = total / samples.len() as f64;
        if !loss.is_finite() {
            return Err(FitError::Diverged { epoch, loss });
        }
        losses.push(loss);
    }
    Ok(losses)
}

/// A gradient and the buffers that it takes.
struct FitStep {
    gradient: Vec<f32>,
    inputs: Vec<f32>,
    tape: Tape,
}

impl FitStep {
    fn new(network: &Mlp, minibatch: usize) -> Self {
        let tape = Tape::new(network.sizes(), minibatch);
        Self { gradient: vec![0.0; network.parameters().len()], inputs: Vec::new(), tape }
    }

    /// Writes the gradient of the mean loss on `rows` and returns the sum of the losses.
    fn compute(&mut self, network: &Mlp, samples: &dyn Samples, rows: &[usize]) -> f64 {
        self.inputs.clear();
        rows.iter().for_each(|&row| self.inputs.extend_from_slice(samples.inputs(row)));
        self.tape.resize(network.sizes(), rows.len());
        network.forward(&self.inputs, &mut self.tape);
        let width = network.sizes()[network.layer_count()];
        let (outputs, deltas) = self.tape.output_and_delta();
        let mut total = 0.0;
        for ((&row, outputs), delta) in
            rows.iter().zip(outputs.chunks_exact(width)).zip(deltas.chunks_exact_mut(width))
        {
            total += samples.loss(row, outputs, delta);
            delta.iter_mut().for_each(|delta| *delta /= rows.len() as f32);
        }
        network.backward(&self.inputs, &mut self.tape, &mut self.gradient);
        total
    }
}

#[cfg(test)]
mod tests {
    use rand::{RngExt, SeedableRng};

    use super::*;

    /// Rows (x, y) with the loss ½ (f(x) - y)².
    struct Points(Vec<([f32; 1], f32)>);

    impl Samples for Points {
        fn len(&self) -> usize {
            self.0.len()
        }

        fn inputs(&self, row: usize) -> &[f32] {
            &self.0[row].0
        }

        fn loss(&self, row: usize, outputs: &[f32], derivative: &mut [f32]) -> f64 {
            let error = outputs[0] - self.0[row].1;
            derivative[0] = error;
            0.5 * f64::from(error).powi(2)
        }
    }

    const SETTINGS: FitSettings = FitSettings { epochs: 60, minibatch: 64, learning_rate: 3e-3 };

    #[test]
    fn a_curve_is_fitted_and_equal_seeds_give_equal_networks() {
        let fitted = || {
            let mut rng = Stream::seed_from_u64(1);
            let point = |x: f32| ([x], (3.0 * x).sin());
            let points = Points((0..2000).map(|_| point(rng.random_range(-1.0..1.0))).collect());
            let mut network = Mlp::new(&[1, 32, 32, 1], &mut rng);
            let losses = fit(&mut network, &points, &SETTINGS, &mut rng).expect("a smooth curve");
            (network, losses)
        };
        let (network, losses) = fitted();
        assert!(losses[0] > 0.05 && losses[losses.len() - 1] < 1e-3, "{losses:?}");
        assert!(fitted().0 == network, "another network from the same seed");
    }

    #[test]
    fn what_cannot_be_fitted_is_an_error() {
        let mut network = Mlp::new(&[1, 4, 1], &mut Stream::seed_from_u64(2));
        let rng = &mut Stream::seed_from_u64(3);
        assert_eq!(fit(&mut network, &Points(vec![]), &SETTINGS, rng), Err(FitError::NoRows));
        let broken = Points(vec![([0.0], f32::NAN)]);
        assert!(matches!(fit(&mut network, &broken, &SETTINGS, rng), Err(FitError::Diverged { .. })));
    }
}
