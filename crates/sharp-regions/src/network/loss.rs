//! The weighted logarithmic loss (paper, "Learning Critical Regions") and the loss of the headings.

use burn::tensor::activation::log_softmax;
use burn::tensor::{Tensor, s};

/// What the network is trained to answer, f32 `[batch, planes, rows, columns]`.
#[derive(Clone, Debug)]
pub(crate) struct Targets {
    /// Criticality, 0 to 1; one plane.
    pub critical: Tensor<4>,
    /// 1 where the criticality counts: in free space; one plane.
    pub free: Tensor<4>,
    /// Share of each heading class; ten planes.
    pub headings: Tensor<4>,
    /// 1 where the headings count: at critical pixels; one plane.
    pub headed: Tensor<4>,
}

/// The losses of criticality and headings of `logits` `[batch, 11, rows, columns]`, one number each;
/// a critical pixel weighs `positive_weight`, one that is not weighs 1.
///
/// Unlike in the published code, the heading loss counts at critical pixels only. Elsewhere the labels
/// are zero and would train the network to answer the first class.
pub(crate) fn losses(logits: Tensor<4>, targets: &Targets, positive_weight: f64) -> (Tensor<1>, Tensor<1>) {
    let critical = criticality_loss(logits.clone().slice(s![.., 0..1, .., ..]), targets, positive_weight);
    let log_share = log_softmax(logits.slice(s![.., 1.., .., ..]), 1);
    let missed = (targets.headings.clone() * log_share).sum_dim(1).neg() * targets.headed.clone();
    (critical, missed.sum() / targets.headed.clone().sum().clamp_min(1.0))
}

/// −w·y·ln σ(z) − (1 − y)·ln(1 − σ(z)), averaged over free pixels.
fn criticality_loss(z: Tensor<4>, targets: &Targets, positive_weight: f64) -> Tensor<1> {
    let y = targets.critical.clone();
    // softplus(z) = ln(1 + eᶻ) = −ln(1 − σ(z)), in the form that does not overflow.
    let softplus = z.clone().clamp_min(0.0) + z.clone().abs().neg().exp().log1p();
    let miss = (softplus.clone() - z) * y.clone() * positive_weight;
    let alarm = softplus * (y.neg() + 1.0);
    ((miss + alarm) * targets.free.clone()).sum() / targets.free.clone().sum().clamp_min(1.0)
}

#[cfg(test)]
mod tests {
    use burn::tensor::{Device, TensorData};

    use super::*;
    use crate::network::unet::OUTPUT_PLANES;

    /// The losses of one pixel with the criticality logit `z` and heading logits that are all equal.
    fn pixel(z: f32, y: f32, headed: f32) -> (f32, f32) {
        let plane = |values: Vec<f32>| {
            let planes = values.len();
            Tensor::<4>::from_data(TensorData::new(values, [1, planes, 1, 1]), &Device::flex())
        };
        let mut logits = vec![0.0; OUTPUT_PLANES];
        logits[0] = z;
        let mut headings = vec![0.0; OUTPUT_PLANES - 1];
        headings[3] = 1.0;
        let targets = Targets {
            critical: plane(vec![y]),
            free: plane(vec![1.0]),
            headings: plane(headings),
            headed: plane(vec![headed]),
        };
        let (critical, heading) = losses(plane(logits), &targets, 2.0);
        (critical.into_scalar::<f32>(), heading.into_scalar::<f32>())
    }

    #[test]
    fn the_loss_is_the_weighted_logarithm() {
        let sigma = |z: f32| 1.0 / (1.0 + (-z).exp());
        for z in [-3.0, 0.0, 1.5] {
            assert!((pixel(z, 1.0, 0.0).0 + 2.0 * sigma(z).ln()).abs() < 1e-5, "critical, logit {z}");
            assert!((pixel(z, 0.0, 0.0).0 + (1.0 - sigma(z)).ln()).abs() < 1e-5, "not critical, logit {z}");
        }
        let headed = pixel(0.0, 0.0, 1.0).1;
        assert!((headed - 10.0_f32.ln()).abs() < 1e-5, "ten equal classes: {headed}");
        assert_eq!(pixel(0.0, 0.0, 0.0).1, 0.0, "no heading counts where nothing is critical");
    }

    #[test]
    fn huge_logits_stay_finite() {
        for (z, y) in [(1e4, 0.0), (-1e4, 1.0), (1e4, 1.0)] {
            assert!(pixel(z, y, 0.0).0.is_finite(), "logit {z}, label {y}");
        }
    }
}
