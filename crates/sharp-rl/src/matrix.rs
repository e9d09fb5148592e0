//! Products of row-major matrices over plain slices.
//!
//! Wide products go through nalgebra to the packed kernels of matrixmultiply. A transpose is a
//! stride, never a copy. For layers with a narrow side (a critic's single output, an observation of
//! two components) nalgebra would work column by column, so they are written out as dot products
//! and sums.

use nalgebra::{DMatrixView, DMatrixViewMut, Dyn};

/// Up to this width of the output, a loop over contiguous rows is faster than packing for the kernel.
const NARROW_OUTPUTS: usize = 8;
/// Up to this length of a side, nalgebra does not use the packed kernel.
const NARROW_INPUTS: usize = 5;

/// The shape of a dense layer, or of a batch that passes through it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct LayerShape {
    pub(crate) batch: usize,
    pub(crate) inputs: usize,
    pub(crate) outputs: usize,
}

impl LayerShape {
    const fn is_narrow(self) -> bool {
        self.outputs <= NARROW_OUTPUTS || self.inputs <= NARROW_INPUTS || self.batch <= NARROW_INPUTS
    }
}

/// `y = x wᵀ`: x is batch x inputs, w outputs x inputs, y batch x outputs.
pub(crate) fn multiply(shape: LayerShape, x: &[f32], w: &[f32], y: &mut [f32]) {
    let LayerShape { batch, inputs, outputs } = shape;
    match inputs {
        // The lengths of small observations.
        2 => return multiply_few::<2>(outputs, x, w, y),
        3 => return multiply_few::<3>(outputs, x, w, y),
        4 => return multiply_few::<4>(outputs, x, w, y),
        5 => return multiply_few::<5>(outputs, x, w, y),
        _ => {}
    }
    if shape.is_narrow() {
        for (x, y) in x.chunks_exact(inputs).zip(y.chunks_exact_mut(outputs)) {
            matvec(w, x, y);
        }
        return;
    }
    let x = rows(x, batch, inputs);
    let w = columns(w, inputs, outputs);
    product(&x, &w, y, batch, outputs);
}

/// `dx = dy w`: dy is batch x outputs, w outputs x inputs, dx batch x inputs.
pub(crate) fn multiply_back(shape: LayerShape, dy: &[f32], w: &[f32], dx: &mut [f32]) {
    let LayerShape { batch, inputs, outputs } = shape;
    if shape.is_narrow() {
        for (dy, dx) in dy.chunks_exact(outputs).zip(dx.chunks_exact_mut(inputs)) {
            dx.fill(0.0);
            for (d, w) in dy.iter().zip(w.chunks_exact(inputs)) {
                add_scaled(dx, *d, w);
            }
        }
        return;
    }
    let dy = rows(dy, batch, outputs);
    let w = rows(w, outputs, inputs);
    product(&dy, &w, dx, batch, inputs);
}

/// `dw = dyᵀ x`: dy is batch x outputs, x batch x inputs, dw outputs x inputs.
pub(crate) fn multiply_weights(shape: LayerShape, dy: &[f32], x: &[f32], dw: &mut [f32]) {
    let LayerShape { batch, inputs, outputs } = shape;
    match inputs {
        2 => return multiply_few_weights::<2>(outputs, dy, x, dw),
        3 => return multiply_few_weights::<3>(outputs, dy, x, dw),
        4 => return multiply_few_weights::<4>(outputs, dy, x, dw),
        5 => return multiply_few_weights::<5>(outputs, dy, x, dw),
        _ => {}
    }
    if shape.is_narrow() {
        dw.fill(0.0);
        for (dy, x) in dy.chunks_exact(outputs).zip(x.chunks_exact(inputs)) {
            for (d, dw) in dy.iter().zip(dw.chunks_exact_mut(inputs)) {
                add_scaled(dw, *d, x);
            }
        }
        return;
    }
    let dy = columns(dy, outputs, batch);
    let x = rows(x, batch, inputs);
    product(&dy, &x, dw, outputs, inputs);
}

/// [`multiply`] of so few inputs that a row of weights is shorter than a register: the compiler unrolls the rows.
fn multiply_few<const INPUTS: usize>(outputs: usize, x: &[f32], w: &[f32], y: &mut [f32]) {
    let (x, w) = (x.as_chunks::<INPUTS>().0, w.as_chunks::<INPUTS>().0);
    for (x, y) in x.iter().zip(y.chunks_exact_mut(outputs)) {
        for (w, y) in w.iter().zip(y) {
            *y = x.iter().zip(w).fold(0.0, |sum, (x, w)| sum + x * w);
        }
    }
}

/// [`multiply_weights`] of so few inputs.
fn multiply_few_weights<const INPUTS: usize>(outputs: usize, dy: &[f32], x: &[f32], dw: &mut [f32]) {
    dw.fill(0.0);
    let dw = dw.as_chunks_mut::<INPUTS>().0;
    for (dy, x) in dy.chunks_exact(outputs).zip(x.as_chunks::<INPUTS>().0) {
        for (d, dw) in dy.iter().zip(&mut *dw) {
            for (dw, x) in dw.iter_mut().zip(x) {
                *dw += d * x;
            }
        }
    }
}

/// `y = w x` for one vector.
pub(crate) fn matvec(w: &[f32], x: &[f32], y: &mut [f32]) {
    for (w, y) in w.chunks_exact(x.len()).zip(y) {
        *y = dot(w, x);
    }
}

/// The dot product, summed in sixteen lanes. The order is fixed, and the compiler can vectorise it.
pub(crate) fn dot(a: &[f32], b: &[f32]) -> f32 {
    const LANES: usize = 16;
    let mut sums = [0.0_f32; LANES];
    let (a_chunks, a_rest) = a.as_chunks::<LANES>();
    let (b_chunks, b_rest) = b.as_chunks::<LANES>();
    for (a, b) in a_chunks.iter().zip(b_chunks) {
        for lane in 0..LANES {
            sums[lane] += a[lane] * b[lane];
        }
    }
    let rest: f32 = a_rest.iter().zip(b_rest).map(|(a, b)| a * b).sum();
    sums.iter().sum::<f32>() + rest
}

/// `y += scale x`.
fn add_scaled(y: &mut [f32], scale: f32, x: &[f32]) {
    for (y, x) in y.iter_mut().zip(x) {
        *y += scale * x;
    }
}

type View<'a> = DMatrixView<'a, f32, Dyn, Dyn>;

/// A row-major matrix.
fn rows(data: &[f32], rows: usize, cols: usize) -> View<'_> {
    View::from_slice_with_strides(data, rows, cols, cols, 1)
}

/// The transpose of a row-major matrix: `rows` and `cols` are those of the transpose.
fn columns(data: &[f32], rows: usize, cols: usize) -> View<'_> {
    View::from_slice_with_strides(data, rows, cols, 1, rows)
}

/// `c = a b`, c row-major.
fn product(a: &View<'_>, b: &View<'_>, c: &mut [f32], rows: usize, cols: usize) {
    let mut c = DMatrixViewMut::<f32, Dyn, Dyn>::from_slice_with_strides_mut(c, rows, cols, cols, 1);
    c.gemm(1.0, a, b, 0.0);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ramp(len: usize, phase: f32) -> Vec<f32> {
        (0..len).map(|i| (i as f32 * 0.37 + phase).sin()).collect()
    }

    fn assert_close(actual: &[f32], expected: &[f32], what: &str) {
        for (index, (a, e)) in actual.iter().zip(expected).enumerate() {
            assert!((a - e).abs() < 1e-4, "{what}: element {index} is {a}, expected {e}");
        }
    }

    /// Compares all three products with the definition, element by element.
    fn check(batch: usize, inputs: usize, outputs: usize) {
        let shape = LayerShape { batch, inputs, outputs };
        let (x, w, d) = (ramp(batch * inputs, 0.0), ramp(outputs * inputs, 1.0), ramp(batch * outputs, 2.0));
        let (mut y, mut dx, mut dw) =
            (vec![0.0; batch * outputs], vec![0.0; batch * inputs], vec![0.0; outputs * inputs]);
        let (mut slow_y, mut slow_dx, mut slow_dw) = (y.clone(), dx.clone(), dw.clone());
        for b in 0..batch {
            for o in 0..outputs {
                for i in 0..inputs {
                    slow_y[b * outputs + o] += x[b * inputs + i] * w[o * inputs + i];
                    slow_dx[b * inputs + i] += d[b * outputs + o] * w[o * inputs + i];
                    slow_dw[o * inputs + i] += d[b * outputs + o] * x[b * inputs + i];
                }
            }
        }
        multiply(shape, &x, &w, &mut y);
        multiply_back(shape, &d, &w, &mut dx);
        multiply_weights(shape, &d, &x, &mut dw);
        assert_close(&y, &slow_y, &format!("x wᵀ of {shape:?}"));
        assert_close(&dx, &slow_dx, &format!("dy w of {shape:?}"));
        assert_close(&dw, &slow_dw, &format!("dyᵀ x of {shape:?}"));
    }

    #[test]
    fn products_follow_the_definition_on_wide_and_narrow_sides() {
        for (batch, inputs, outputs) in [
            (32, 33, 64),
            (32, 64, 1),
            (32, 2, 64),
            (9, 5, 20),
            (3, 17, 9),
            (1, 1, 1),
            (19, 20, 8),
            (7, 6, 9),
        ] {
            check(batch, inputs, outputs);
        }
    }
}
