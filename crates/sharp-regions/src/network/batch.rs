//! Batches: random samples of a dataset, each in a random symmetry of the square.

use burn::tensor::{Device, Tensor, TensorData};
use rand::RngExt;
use sharp_maps::turned_from;
use sharp_space::Stream;

use crate::heatmap::HEADING_BINS;
use crate::labels::{CRITICAL_MIN, FINE_BINS};
use crate::network::loss::Targets;
use crate::network::samples::Sample;
use crate::network::unet::INPUT_PLANES;

/// Half the width of the ramp between certainly not critical and certainly critical.
const RAMP: f32 = 0.4;

/// `count` random samples, each in a random symmetry.
pub(crate) fn batch(
    samples: &[Sample],
    count: usize,
    device: &Device,
    rng: &mut Stream,
) -> (Tensor<4>, Targets) {
    let mut planes = Planes::default();
    for _ in 0..count {
        let sample = &samples[rng.random_range(0..samples.len())];
        planes.add(sample, rng.random_range(0..8));
    }
    let frame = &samples[0].image.frame;
    let tensor = |values: Vec<f32>, depth: usize| {
        let shape = [count, depth, frame.height, frame.width];
        Tensor::<4>::from_data(TensorData::new(values, shape), device)
    };
    let targets = Targets {
        critical: tensor(planes.critical, 1),
        free: tensor(planes.free, 1),
        headings: tensor(planes.headings, HEADING_BINS),
        headed: tensor(planes.headed, 1),
    };
    (tensor(planes.images, INPUT_PLANES), targets)
}

/// The values of a batch, sample after sample, plane after plane.
#[derive(Default)]
struct Planes {
    images: Vec<f32>,
    critical: Vec<f32>,
    free: Vec<f32>,
    headings: Vec<f32>,
    headed: Vec<f32>,
}

impl Planes {
    /// Adds `sample` turned by one of the eight symmetries of the square.
    fn add(&mut self, sample: &Sample, symmetry: usize) {
        let (image, labels) = (&sample.image, &sample.labels);
        let side = image.frame.width;
        assert_eq!(side, image.frame.height, "training maps are square");
        let order: Vec<usize> = (0..side * side).map(|index| turned_from(index, side, symmetry)).collect();
        let criticality = labels.criticality();
        self.images.extend(order.iter().map(|&i| image.blocked[i]));
        self.images.extend(order.iter().map(|&i| image.clearance[i]));
        self.critical.extend(order.iter().map(|&i| target(criticality[i])));
        self.free.extend(order.iter().map(|&i| f32::from(u8::from(image.blocked[i] < 1.0))));
        let bins = |pixel: usize| &labels.headings[pixel * FINE_BINS..(pixel + 1) * FINE_BINS];
        let sums: Vec<f32> = order.iter().map(|&i| bins(i).iter().map(|&v| f32::from(v)).sum()).collect();
        for class in 0..HEADING_BINS {
            let halves = [2 * class, 2 * class + 1].map(|bin| source_bin(bin, symmetry));
            let share = |(&i, sum): (&usize, &f32)| {
                halves.iter().map(|&bin| f32::from(bins(i)[bin])).sum::<f32>() / sum.max(1.0)
            };
            self.headings.extend(order.iter().zip(&sums).map(share));
        }
        let headed = |(&i, &sum): (&usize, &f32)| criticality[i] >= CRITICAL_MIN && sum > 0.0;
        self.headed.extend(order.iter().zip(&sums).map(|pair| f32::from(u8::from(headed(pair)))));
    }
}

/// The network's target for a pixel with this criticality: a ramp instead of the paper's two classes,
/// so that the most critical part of a corridor differs from the rest.
fn target(criticality: f32) -> f32 {
    ((criticality - (CRITICAL_MIN - RAMP)) / (2.0 * RAMP)).clamp(0.0, 1.0)
}

/// The sector of direction `bin` after the map's symmetries have been undone: the bits of `symmetry`
/// mirror left and right, mirror up and down, and swap the axes, in this order.
fn source_bin(mut bin: usize, symmetry: usize) -> usize {
    const HALF: usize = FINE_BINS / 2;
    if symmetry & 1 != 0 {
        bin = (FINE_BINS + HALF - 1 - bin) % FINE_BINS;
    }
    if symmetry & 2 != 0 {
        bin = FINE_BINS - 1 - bin;
    }
    if symmetry & 4 != 0 {
        bin = (FINE_BINS + FINE_BINS / 4 - 1 - bin) % FINE_BINS;
    }
    bin
}

#[cfg(test)]
mod tests {
    use sharp_space::trig;

    use super::*;
    use crate::labels::fine_bin;

    #[test]
    fn sectors_follow_the_symmetries_of_the_map() {
        for symmetry in 0..8 {
            for bin in 0..FINE_BINS {
                let angle =
                    (bin as f64 + 0.5) / FINE_BINS as f64 * std::f64::consts::TAU - std::f64::consts::PI;
                let (mut y, mut x) = trig::sin_cos(angle);
                x *= if symmetry & 1 != 0 { -1.0 } else { 1.0 };
                y *= if symmetry & 2 != 0 { -1.0 } else { 1.0 };
                if symmetry & 4 != 0 {
                    std::mem::swap(&mut x, &mut y);
                }
                assert_eq!(
                    source_bin(bin, symmetry),
                    fine_bin(trig::atan2(y, x)),
                    "bin {bin}, symmetry {symmetry}"
                );
            }
        }
    }
}
