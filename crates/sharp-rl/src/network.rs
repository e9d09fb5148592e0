//! Multilayer perceptrons with `ReLU` hidden layers, forward and backward, without allocation.
//!
//! All parameters of a network lie in one vector, layer after layer, weights before biases. Weights
//! are outputs x inputs, row-major, `PyTorch`'s layout. So the optimiser, the soft update and files
//! are loops over slices. A [`Tape`] keeps what the backward pass needs of the forward pass.

use std::ops::Range;

use rand::RngExt;
use thiserror::Error;

use crate::environment::Stream;
use crate::matrix::{LayerShape, dot, matvec, multiply, multiply_back, multiply_weights};

/// A fully connected network, with `ReLU` after every layer but the last.
#[derive(Clone, Debug, PartialEq)]
pub struct Mlp {
    sizes: Vec<usize>,
    parameters: Vec<f32>,
}

/// One dense layer of an [`Mlp`].
#[derive(Clone, Copy, Debug)]
pub struct Layer<'a> {
    /// Outputs x inputs, row-major.
    pub weights: &'a [f32],
    /// One for each output.
    pub bias: &'a [f32],
}

/// Why sizes and parameters do not make a network.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum NetworkError {
    /// Fewer than two sizes, or a size of zero.
    #[error("layer sizes {0:?} describe no network")]
    Sizes(Vec<usize>),
    /// The vector does not fit the sizes.
    #[error("{found} parameters for layer sizes {sizes:?}, expected {expected}")]
    Len {
        /// The sizes, input first.
        sizes: Vec<usize>,
        /// Parameters given.
        found: usize,
        /// Parameters needed.
        expected: usize,
    },
    /// A parameter is NaN or infinite.
    #[error("parameter {index} is {value}")]
    NotFinite {
        /// Its index in the vector.
        index: usize,
        /// The value, as text so that the error can be compared.
        value: String,
    },
}

impl Mlp {
    /// A network with weights and biases uniform within 1/sqrt(inputs), `PyTorch`'s default.
    ///
    /// # Panics
    /// If there are fewer than two `sizes` or one of them is zero.
    #[must_use]
    pub fn new(sizes: &[usize], rng: &mut Stream) -> Self {
        assert!(is_network(sizes), "layer sizes {sizes:?} describe no network");
        let mut parameters = Vec::with_capacity(parameter_count(sizes));
        for pair in sizes.windows(2) {
            let limit = 1.0 / (pair[0] as f32).sqrt();
            parameters.extend((0..pair[1] * (pair[0] + 1)).map(|_| rng.random_range(-limit..limit)));
        }
        Self { sizes: sizes.to_vec(), parameters }
    }

    /// A network from one vector of all parameters, in the order of [`Self::parameters`].
    ///
    /// # Errors
    /// If the sizes do not describe a network, the vector does not fit them, or a value is not finite.
    pub fn from_parameters(sizes: &[usize], parameters: Vec<f32>) -> Result<Self, NetworkError> {
        if !is_network(sizes) {
            return Err(NetworkError::Sizes(sizes.to_vec()));
        }
        check_parameters(sizes, &parameters)?;
        Ok(Self { sizes: sizes.to_vec(), parameters })
    }

    /// The network that computes what `self` and `other` compute, side by side: its outputs are those of `self`, then
    /// those of `other`. `None` if they have not the same inputs or not as many layers.
    #[must_use]
    pub fn beside(&self, other: &Self) -> Option<Self> {
        if self.sizes[0] != other.sizes[0] || self.layer_count() != other.layer_count() {
            return None;
        }
        let mut sizes: Vec<usize> = self.sizes.iter().zip(&other.sizes).map(|(a, b)| a + b).collect();
        sizes[0] = self.sizes[0];
        let mut parameters = Vec::with_capacity(parameter_count(&sizes));
        for (index, &width) in sizes[..self.layer_count()].iter().enumerate() {
            // The first layer of both reads the same inputs.
            let place = if index == 0 { 0 } else { self.sizes[index] };
            for (network, before) in [(self, 0), (other, place)] {
                let inputs = network.sizes[index];
                for row in network.layer(index).weights.chunks_exact(inputs) {
                    parameters.extend(std::iter::repeat_n(0.0, before));
                    parameters.extend_from_slice(row);
                    parameters.extend(std::iter::repeat_n(0.0, width - before - inputs));
                }
            }
            [self, other].iter().for_each(|network| parameters.extend_from_slice(network.layer(index).bias));
        }
        Some(Self { sizes, parameters })
    }

    /// Replaces all parameters, in the order of [`Self::parameters`].
    ///
    /// # Errors
    /// If the vector has another length than before, or if a value is not finite.
    pub fn set_parameters(&mut self, parameters: &[f32]) -> Result<(), NetworkError> {
        check_parameters(&self.sizes, parameters)?;
        self.parameters.copy_from_slice(parameters);
        Ok(())
    }

    /// Sets the last layer to zero, so that the output is zero everywhere until the network learns.
    pub fn zero_last_layer(&mut self) {
        let range = self.range(self.layer_count() - 1);
        self.parameters[range].fill(0.0);
    }

    /// Widths from input to output.
    #[must_use]
    pub fn sizes(&self) -> &[usize] {
        &self.sizes
    }

    /// Dense layers, at least 1.
    #[must_use]
    pub const fn layer_count(&self) -> usize {
        self.sizes.len() - 1
    }

    /// All weights and biases, layer after layer: weights (outputs x inputs, row-major), then biases.
    #[must_use]
    pub fn parameters(&self) -> &[f32] {
        &self.parameters
    }

    /// All weights and biases, in the same order, for changes.
    pub fn parameters_mut(&mut self) -> &mut [f32] {
        &mut self.parameters
    }

    /// The layer with number `index`; layer 0 is next to the input.
    ///
    /// # Panics
    /// If there is no such layer.
    #[must_use]
    pub fn layer(&self, index: usize) -> Layer<'_> {
        let (weights, bias) =
            self.parameters[self.range(index)].split_at(self.sizes[index] * self.sizes[index + 1]);
        Layer { weights, bias }
    }

    /// Moves every parameter by the share `tau` towards `online`: the soft update of target networks.
    ///
    /// # Panics
    /// If the sizes differ.
    pub fn move_towards(&mut self, online: &Self, tau: f32) {
        assert_eq!(self.sizes, online.sizes, "soft update between different networks");
        for (target, online) in self.parameters.iter_mut().zip(&online.parameters) {
            *target += tau * (online - *target);
        }
    }

    /// Computes the outputs for `input` (batch x inputs) and keeps the values of every layer in `tape`.
    pub(crate) fn forward(&self, input: &[f32], tape: &mut Tape) {
        for index in 0..self.layer_count() {
            let shape = self.shape(index, tape.batch);
            let layer = self.layer(index);
            let (below, rest) = tape.values.split_at_mut(index);
            let x = below.last().map_or(input, Vec::as_slice);
            multiply(shape, x, layer.weights, &mut rest[0]);
            let hidden = index + 1 < self.layer_count();
            for row in rest[0].chunks_exact_mut(shape.outputs) {
                add_bias(row, layer.bias, hidden);
            }
        }
    }

    /// Writes the derivatives of all parameters to `gradient`, from the output derivatives in `tape`.
    ///
    /// `input` and `tape` are those of the forward pass.
    pub(crate) fn backward(&self, input: &[f32], tape: &mut Tape, gradient: &mut [f32]) {
        for index in (0..self.layer_count()).rev() {
            let shape = self.shape(index, tape.batch);
            let (below, above) = tape.deltas.split_at_mut(index);
            let delta = &above[0];
            let x = if index == 0 { input } else { &tape.values[index - 1] };
            let (dw, db) = gradient[self.range(index)].split_at_mut(shape.inputs * shape.outputs);
            multiply_weights(shape, delta, x, dw);
            sum_rows(delta, db);
            if let Some(delta_below) = below.last_mut() {
                multiply_back(shape, delta, self.layer(index).weights, delta_below);
                mask(delta_below, x);
            }
        }
    }

    /// The derivative of a single output with respect to some inputs, for some rows of the batch.
    ///
    /// Row `r` of `out` (batch x `columns`) receives `scale` times the derivative, for each `r` in
    /// `rows`; other rows do not change. Only these rows are computed, because each of the twin
    /// critics is needed only for the samples where its value is the smaller one.
    pub(crate) fn input_gradient(&self, tape: &mut Tape, rows: &[usize], seed: &InputSeed, out: &mut [f32]) {
        let last = self.layer_count() - 1;
        debug_assert!(last > 0 && self.sizes[last + 1] == 1, "one output above a hidden layer");
        let width = self.sizes[last];
        let weights = self.layer(last).weights;
        for (delta, &row) in tape.deltas[last - 1].chunks_exact_mut(width).zip(rows) {
            let values = &tape.values[last - 1][row * width..][..width];
            for ((delta, value), weight) in delta.iter_mut().zip(values).zip(weights) {
                *delta = if *value > 0.0 { seed.scale * weight } else { 0.0 };
            }
        }
        for index in (1..last).rev() {
            let shape = self.shape(index, rows.len());
            let (below, above) = tape.deltas.split_at_mut(index);
            let count = rows.len() * shape.inputs;
            let delta = &mut below[index - 1][..count];
            multiply_back(shape, &above[0][..rows.len() * shape.outputs], self.layer(index).weights, delta);
            for (delta, &row) in delta.chunks_exact_mut(shape.inputs).zip(rows) {
                mask(delta, &tape.values[index - 1][row * shape.inputs..][..shape.inputs]);
            }
        }
        self.gather_input_columns(tape, rows, &seed.columns, out);
    }

    /// The last product of [`Self::input_gradient`]: deltas of the first layer times the columns asked for.
    fn gather_input_columns(&self, tape: &mut Tape, rows: &[usize], columns: &Range<usize>, out: &mut [f32]) {
        let (inputs, width) = (self.sizes[0], self.sizes[1]);
        let weights = self.layer(0).weights;
        tape.columns.clear();
        for column in columns.clone() {
            tape.columns.extend(weights.iter().skip(column).step_by(inputs));
        }
        for (delta, &row) in tape.deltas[0].chunks_exact(width).zip(rows) {
            let out = &mut out[row * columns.len()..][..columns.len()];
            for (out, column) in out.iter_mut().zip(tape.columns.chunks_exact(width)) {
                *out = dot(delta, column);
            }
        }
    }

    /// The output for one input vector. `scratch` allocates once and is then reused.
    ///
    /// # Panics
    /// If `input` has another length than the first layer.
    pub fn predict<'a>(&self, input: &[f32], scratch: &'a mut Scratch) -> &'a [f32] {
        assert_eq!(input.len(), self.sizes[0], "length of the network's input");
        let width = self.sizes.iter().copied().max().expect("a network has sizes");
        scratch.front.resize(width, 0.0);
        scratch.back.resize(width, 0.0);
        scratch.front[..input.len()].copy_from_slice(input);
        for index in 0..self.layer_count() {
            let layer = self.layer(index);
            let (inputs, outputs) = (self.sizes[index], self.sizes[index + 1]);
            matvec(layer.weights, &scratch.front[..inputs], &mut scratch.back[..outputs]);
            add_bias(&mut scratch.back[..outputs], layer.bias, index + 1 < self.layer_count());
            std::mem::swap(&mut scratch.front, &mut scratch.back);
        }
        &scratch.front[..self.sizes[self.layer_count()]]
    }

    /// The part of the parameter vector that belongs to the layer.
    fn range(&self, index: usize) -> Range<usize> {
        let start = parameter_count(&self.sizes[..=index]);
        start..start + self.sizes[index + 1] * (self.sizes[index] + 1)
    }

    fn shape(&self, index: usize, batch: usize) -> LayerShape {
        LayerShape { batch, inputs: self.sizes[index], outputs: self.sizes[index + 1] }
    }
}

/// The start and the wanted columns of [`Mlp::input_gradient`].
#[derive(Clone, Debug)]
pub(crate) struct InputSeed {
    /// Derivative of the objective with respect to the output.
    pub(crate) scale: f32,
    /// The inputs wanted.
    pub(crate) columns: Range<usize>,
}

/// Values and derivatives of one network on one batch, kept between passes.
#[derive(Clone, Debug)]
pub(crate) struct Tape {
    batch: usize,
    /// After each layer, batch x width; hidden ones after `ReLU`.
    values: Vec<Vec<f32>>,
    /// Derivatives of the objective before each layer's activation, same shapes.
    deltas: Vec<Vec<f32>>,
    /// Columns of the first weights, laid out as rows.
    columns: Vec<f32>,
}

impl Tape {
    /// Buffers for a network of `sizes` on `batch` rows.
    pub(crate) fn new(sizes: &[usize], batch: usize) -> Self {
        let room: Vec<_> = sizes[1..].iter().map(|width| vec![0.0; batch * width]).collect();
        Self { batch, values: room.clone(), deltas: room, columns: Vec::new() }
    }

    /// Makes room for another number of rows, without giving memory back.
    pub(crate) fn resize(&mut self, sizes: &[usize], batch: usize) {
        self.batch = batch;
        for (values, width) in self.values.iter_mut().chain(&mut self.deltas).zip(sizes[1..].iter().cycle()) {
            values.resize(batch * width, 0.0);
        }
    }

    /// The network's output, batch x outputs.
    pub(crate) fn output(&self) -> &[f32] {
        self.values.last().expect("a network has a layer")
    }

    /// The network's output and the buffer of its derivatives, both batch x outputs.
    pub(crate) fn output_and_delta(&mut self) -> (&[f32], &mut [f32]) {
        (
            self.values.last().expect("a network has a layer"),
            self.deltas.last_mut().expect("a network has a layer"),
        )
    }
}

/// Buffers that [`Mlp::predict`] reuses.
#[derive(Clone, Debug, Default)]
pub struct Scratch {
    front: Vec<f32>,
    back: Vec<f32>,
}

fn check_parameters(sizes: &[usize], parameters: &[f32]) -> Result<(), NetworkError> {
    let expected = parameter_count(sizes);
    if parameters.len() != expected {
        return Err(NetworkError::Len { sizes: sizes.to_vec(), found: parameters.len(), expected });
    }
    match parameters.iter().position(|value| !value.is_finite()) {
        Some(index) => Err(NetworkError::NotFinite { index, value: parameters[index].to_string() }),
        None => Ok(()),
    }
}

fn is_network(sizes: &[usize]) -> bool {
    sizes.len() >= 2 && !sizes.contains(&0)
}

/// Weights and biases of all layers between `sizes`.
fn parameter_count(sizes: &[usize]) -> usize {
    sizes.windows(2).map(|pair| pair[1] * (pair[0] + 1)).sum()
}

/// Adds the bias and, in a hidden layer, applies `ReLU`.
fn add_bias(row: &mut [f32], bias: &[f32], hidden: bool) {
    if hidden {
        for (value, bias) in row.iter_mut().zip(bias) {
            let sum = *value + bias;
            // Written so that NaN passes through. `f32::max` would turn it into zero.
            *value = if sum < 0.0 { 0.0 } else { sum };
        }
    } else {
        for (value, bias) in row.iter_mut().zip(bias) {
            *value += bias;
        }
    }
}

/// Sets derivatives to zero where `ReLU` was flat.
fn mask(delta: &mut [f32], values: &[f32]) {
    for (delta, value) in delta.iter_mut().zip(values) {
        *delta = if *value > 0.0 { *delta } else { 0.0 };
    }
}

/// Sums the rows of `delta` (batch x len) into `sums`.
fn sum_rows(delta: &[f32], sums: &mut [f32]) {
    sums.fill(0.0);
    for row in delta.chunks_exact(sums.len()) {
        for (sum, value) in sums.iter_mut().zip(row) {
            *sum += value;
        }
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;

    const BATCH: usize = 12;

    fn ramp(len: usize) -> Vec<f32> {
        (0..len).map(|i| (i as f32 * 0.71).sin()).collect()
    }

    /// Half the sum of squared outputs: its output derivative is the output.
    fn objective(network: &Mlp, input: &[f32], tape: &mut Tape) -> f64 {
        network.forward(input, tape);
        tape.output().iter().map(|value| 0.5 * f64::from(*value).powi(2)).sum()
    }

    fn assert_derivative(name: &str, analytic: f32, numeric: f64) {
        let error = (f64::from(analytic) - numeric).abs();
        assert!(
            error < 2e-2 * numeric.abs().max(0.1),
            "{name}: {analytic} by hand, {numeric} by differences"
        );
    }

    #[test]
    fn gradients_agree_with_finite_differences() {
        for sizes in [vec![3, 8, 2], vec![9, 16, 10, 1], vec![7, 12, 12, 11]] {
            let mut network = Mlp::new(&sizes, &mut Stream::seed_from_u64(3));
            let input = ramp(BATCH * sizes[0]);
            let mut tape = Tape::new(&sizes, BATCH);
            objective(&network, &input, &mut tape);
            let (output, delta) = tape.output_and_delta();
            delta.copy_from_slice(output);
            let mut gradient = vec![f32::NAN; network.parameters().len()];
            network.backward(&input, &mut tape, &mut gradient);
            // Every seventh parameter reaches each layer's weights and biases.
            for index in (0..gradient.len()).step_by(7) {
                let mut shifted = |by: f32| {
                    network.parameters_mut()[index] += by;
                    objective(&network, &input, &mut tape)
                };
                let (high, low) = (shifted(2e-4), shifted(-4e-4));
                shifted(2e-4);
                assert_derivative(&format!("{sizes:?}[{index}]"), gradient[index], (high - low) / 4e-4);
            }
        }
    }

    #[test]
    fn input_derivatives_agree_with_finite_differences_on_the_chosen_rows_only() {
        let sizes = [5, 16, 12, 1];
        let network = Mlp::new(&sizes, &mut Stream::seed_from_u64(4));
        let mut input = ramp(BATCH * 5);
        let mut tape = Tape::new(&sizes, BATCH);
        network.forward(&input, &mut tape);
        let mut found = vec![7.0; BATCH * 2];
        let seed = InputSeed { scale: -0.5, columns: 3..5 };
        network.input_gradient(&mut tape, &[1, 4, 11], &seed, &mut found);
        for row in 0..BATCH {
            for column in 0..2 {
                let place = row * 5 + 3 + column;
                let mut shifted = |by: f32| {
                    input[place] += by;
                    network.forward(&input, &mut tape);
                    -0.5 * f64::from(tape.output()[row])
                };
                let (high, low) = (shifted(1e-3), shifted(-2e-3));
                shifted(1e-3);
                let value = found[row * 2 + column];
                if [1, 4, 11].contains(&row) {
                    assert_derivative(&format!("row {row} column {column}"), value, (high - low) / 2e-3);
                } else {
                    assert_eq!(value, 7.0, "row {row} was not asked for");
                }
            }
        }
    }

    #[test]
    fn one_vector_gives_the_output_of_the_batch() {
        let sizes = [31, 64, 64, 4];
        let network = Mlp::new(&sizes, &mut Stream::seed_from_u64(5));
        let input = ramp(BATCH * 31);
        let mut tape = Tape::new(&sizes, BATCH);
        network.forward(&input, &mut tape);
        let mut scratch = Scratch::default();
        for (row, (input, batch)) in input.chunks(31).zip(tape.output().chunks(4)).enumerate() {
            for (single, batch) in network.predict(input, &mut scratch).iter().zip(batch) {
                assert!((single - batch).abs() < 1e-5, "row {row}: {single} alone, {batch} in the batch");
            }
        }
    }

    #[test]
    fn two_networks_side_by_side_compute_what_each_does() {
        let rng = &mut Stream::seed_from_u64(8);
        let (first, second) = (Mlp::new(&[3, 5, 4, 1], rng), Mlp::new(&[3, 2, 7, 2], rng));
        let both = first.beside(&second).expect("as many layers");
        assert_eq!(both.sizes(), [3, 7, 11, 3]);
        let mut scratch = Scratch::default();
        for input in [[0.3, -0.2, 0.9], [-1.0, 0.5, 0.0]] {
            let mut expected = first.predict(&input, &mut scratch).to_vec();
            expected.extend_from_slice(second.predict(&input, &mut scratch));
            for (found, expected) in both.predict(&input, &mut scratch).iter().zip(expected) {
                assert!((found - expected).abs() < 1e-6, "{found}, expected {expected}");
            }
        }
        assert!(first.beside(&Mlp::new(&[2, 5, 4, 1], rng)).is_none(), "other inputs");
    }

    #[test]
    fn nan_is_not_turned_into_zero_by_relu() {
        let mut network = Mlp::new(&[2, 8, 1], &mut Stream::seed_from_u64(6));
        network.parameters_mut()[0] = f32::NAN;
        assert!(network.predict(&[1.0, 1.0], &mut Scratch::default())[0].is_nan(), "a NaN weight shows");
    }

    #[test]
    fn the_soft_update_moves_by_tau() {
        let mut target = Mlp::from_parameters(&[1, 1], vec![0.0, 4.0]).expect("a network");
        let online = Mlp::from_parameters(&[1, 1], vec![1.0, 0.0]).expect("a network");
        target.move_towards(&online, 0.25);
        assert_eq!(target.parameters(), [0.25, 3.0]);
    }

    #[test]
    fn a_zeroed_last_layer_outputs_zero() {
        let mut network = Mlp::new(&[3, 8, 2], &mut Stream::seed_from_u64(7));
        network.zero_last_layer();
        assert_eq!(network.predict(&[1.0, -2.0, 3.0], &mut Scratch::default()), [0.0, 0.0]);
    }

    #[test]
    fn parameters_that_do_not_make_a_network_are_refused() {
        let refuse = |sizes: &[usize], parameters: Vec<f32>| {
            Mlp::from_parameters(sizes, parameters).expect_err("no network").to_string()
        };
        assert_eq!(refuse(&[3], vec![]), "layer sizes [3] describe no network");
        assert_eq!(refuse(&[3, 0], vec![]), "layer sizes [3, 0] describe no network");
        assert_eq!(refuse(&[1, 1], vec![0.0]), "1 parameters for layer sizes [1, 1], expected 2");
        assert_eq!(refuse(&[1, 1], vec![0.0, f32::NAN]), "parameter 1 is NaN");
        let mut network = Mlp::from_parameters(&[1, 1], vec![1.0, 2.0]).expect("a network");
        assert!(network.set_parameters(&[1.0]).is_err(), "too few");
        assert!(network.set_parameters(&[1.0, f32::INFINITY]).is_err(), "not finite");
        assert_eq!(network.parameters(), [1.0, 2.0], "unchanged after an error");
        assert_eq!(network.set_parameters(&[3.0, 4.0]), Ok(()));
        assert_eq!(network.parameters(), [3.0, 4.0]);
    }
}
