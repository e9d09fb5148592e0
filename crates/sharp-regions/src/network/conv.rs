//! A convolution, computed in the way that the backend does fastest.
//!
//! burn's ndarray backend convolves with plain loops, whose gradients take ten times as long as
//! they should; its matrix product is fast. There the image is shifted once for each position of
//! the kernel, and one matrix product sums the shifted copies up. Both ways give the same numbers
//! up to rounding.

use burn::module::{Module, Param};
use burn::tensor::module::conv2d;
use burn::tensor::ops::{ConvOptions, PadMode};
use burn::tensor::{Device, Tensor, TensorData, s};
use rand_distr::{Distribution, Normal};
use sharp_space::Stream;

use crate::network::device::convolves_slowly;

/// A convolution with bias whose output is as large as its input.
#[derive(Module, Debug)]
pub(crate) struct Conv {
    weight: Param<Tensor<4>>,
    bias: Param<Tensor<1>>,
}

impl Conv {
    /// Draws the weights from N(0, `gain` / fan-in); a kernel has `side` x `side` pixels.
    pub(crate) fn init(
        ends: (usize, usize),
        side: usize,
        gain: f64,
        device: &Device,
        rng: &mut Stream,
    ) -> Self {
        let (inputs, outputs) = ends;
        let fan_in = inputs * side * side;
        let normal = Normal::new(0.0, (gain / fan_in as f64).sqrt()).expect("the deviation is positive");
        let values: Vec<f32> = (0..outputs * fan_in).map(|_| normal.sample(rng) as f32).collect();
        Self {
            weight: Param::from_data(TensorData::new(values, [outputs, inputs, side, side]), device),
            bias: Param::from_data(TensorData::new(vec![0.0_f32; outputs], [outputs]), device),
        }
    }

    /// `[batch, inputs, rows, columns]` to `[batch, outputs, rows, columns]`.
    pub(crate) fn forward(&self, x: Tensor<4>) -> Tensor<4> {
        let (weight, bias) = (self.weight.val(), self.bias.val());
        if convolves_slowly(&x.device()) {
            return shift_and_multiply(x, weight, bias);
        }
        let padding = weight.dims()[2] / 2;
        conv2d(x, weight, Some(bias), ConvOptions::new([1, 1], [padding, padding], [1, 1], 1))
    }
}

/// The convolution as one matrix product over shifted copies of the image.
fn shift_and_multiply(x: Tensor<4>, weight: Tensor<4>, bias: Tensor<1>) -> Tensor<4> {
    let [batch, inputs, rows, columns] = x.dims();
    let [outputs, _, side, _] = weight.dims();
    let copies = if side == 1 {
        x
    } else {
        let edge = side / 2;
        let padded = x.pad((edge, edge, edge, edge), PadMode::Constant(0.0));
        let shifts = (0..side * side).map(|shift| {
            let (down, right) = (shift / side, shift % side);
            padded.clone().slice(s![.., .., down..down + rows, right..right + columns])
        });
        Tensor::cat(shifts.collect(), 1)
    };
    let copies: Tensor<3> = copies.reshape([batch, side * side * inputs, rows * columns]);
    // The copies come shift by shift, the weights input by input.
    let weight: Tensor<3> = weight.permute([0, 2, 3, 1]).reshape([1, outputs, side * side * inputs]);
    weight.matmul(copies).reshape([batch, outputs, rows, columns]) + bias.reshape([1, outputs, 1, 1])
}

#[cfg(test)]
mod tests {
    use sharp_space::Seed;

    use super::*;

    fn random(shape: [usize; 4], number: u64, device: &Device) -> Tensor<4> {
        let normal = Normal::new(0.0, 1.0).unwrap();
        let mut rng = Seed(3).stream("values", number);
        let values: Vec<f32> = (0..shape.iter().product()).map(|_| normal.sample(&mut rng) as f32).collect();
        Tensor::from_data(TensorData::new(values, shape), device)
    }

    /// The output, and the gradients of a weighted sum of it by image, weights and bias.
    fn pass(
        kernel: fn(Tensor<4>, Tensor<4>, Tensor<1>) -> Tensor<4>,
        side: usize,
        device: &Device,
    ) -> Vec<Vec<f32>> {
        let device = device.clone().autodiff();
        let x = random([2, 3, 5, 7], 1, &device).require_grad();
        let weight = random([4, 3, side, side], 2, &device).require_grad();
        let bias = random([1, 1, 1, 4], 3, &device).reshape([4]).require_grad();
        let y = kernel(x.clone(), weight.clone(), bias.clone());
        let gradients = (y.clone() * random([2, 4, 5, 7], 4, &device)).sum().backward();
        let read = |tensor: Tensor<4>| tensor.try_to_vec_as::<f32>().unwrap();
        let by_bias = bias.grad(&gradients).unwrap().try_to_vec_as::<f32>().unwrap();
        vec![read(y), read(x.grad(&gradients).unwrap()), read(weight.grad(&gradients).unwrap()), by_bias]
    }

    fn check_equal(a: &[Vec<f32>], b: &[Vec<f32>], what: &str) {
        for (name, (a, b)) in ["output", "image", "weights", "bias"].iter().zip(a.iter().zip(b)) {
            assert_eq!(a.len(), b.len(), "{what}: {name}");
            for (i, (a, b)) in a.iter().zip(b).enumerate() {
                assert!((a - b).abs() < 1e-3, "{what}: {name} {i} is {a} and {b}");
            }
        }
    }

    fn built_in(x: Tensor<4>, weight: Tensor<4>, bias: Tensor<1>) -> Tensor<4> {
        let padding = weight.dims()[2] / 2;
        conv2d(x, weight, Some(bias), ConvOptions::new([1, 1], [padding, padding], [1, 1], 1))
    }

    #[test]
    fn shifted_copies_give_the_convolution_and_its_gradients() {
        for side in [1, 3] {
            let expected = pass(built_in, side, &Device::flex());
            check_equal(&pass(shift_and_multiply, side, &Device::flex()), &expected, "flex");
            #[cfg(feature = "ndarray")]
            {
                let ndarray = crate::ComputeDevice::Ndarray.device();
                check_equal(&pass(shift_and_multiply, side, &ndarray), &expected, "ndarray");
            }
        }
    }
}
