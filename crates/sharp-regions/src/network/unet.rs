//! The network Θ that maps an occupancy matrix to critical regions (paper, "Learning Critical
//! Regions"): a U-Net, fully convolutional, so that one set of weights serves every map size.
//!
//! Two presets. [`UNetConfig::paper`] has the paper's shape (Tanh inside, width 64). The default,
//! [`UNetConfig::compact`], reads blocks of 2 x 2 pixels as one, uses `ReLU` and has a hundredth of
//! the weights: it trains in minutes on one core. Both end in linear logits; the paper's sigmoid is
//! applied where probabilities are read, which keeps the loss finite.

use burn::module::{Module, ModuleMapper, Param, ParamId};
use burn::tensor::activation::{relu, tanh};
use burn::tensor::module::max_pool2d;
use burn::tensor::ops::MaxPoolOptions;
use burn::tensor::{Device, Tensor};
use serde::{Deserialize, Serialize};
use sharp_space::Stream;

use crate::heatmap::HEADING_BINS;
use crate::network::conv::Conv;

/// Input planes: share of the pixel that is blocked, and clearance.
pub(crate) const INPUT_PLANES: usize = 2;
/// Output planes: one criticality logit and the heading logits.
pub(crate) const OUTPUT_PLANES: usize = 1 + HEADING_BINS;

/// The nonlinearity between the layers.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Activation {
    /// max(x, 0): the cheaper one on a CPU.
    Relu,
    /// tanh(x): the paper's.
    Tanh,
}

/// The shape of the network.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct UNetConfig {
    /// Channels of the first level; each level below has twice as many.
    pub width: usize,
    /// Number of levels, 1 to 6; each halves the resolution.
    pub levels: usize,
    /// Side of the block of pixels that the first layer reads as one: 1 or 2.
    pub patch: usize,
    /// The nonlinearity.
    pub activation: Activation,
}

impl Default for UNetConfig {
    fn default() -> Self {
        Self::compact()
    }
}

impl UNetConfig {
    /// Small enough to ship and to train on one core: 0.27 million weights.
    #[must_use]
    pub const fn compact() -> Self {
        Self { width: 24, levels: 3, patch: 2, activation: Activation::Relu }
    }

    /// The paper's: Tanh inside, five levels from 64 channels.
    #[must_use]
    pub const fn paper() -> Self {
        Self { width: 64, levels: 5, patch: 1, activation: Activation::Tanh }
    }

    /// The number that both sides of an image must be a multiple of, pixels.
    pub(crate) const fn stride(&self) -> usize {
        self.patch << (self.levels - 1)
    }

    /// Fewer weights than any network of this shape has: those of its widest convolution from one plane to another.
    pub(crate) const fn least_weights(&self) -> usize {
        let widest = self.width << (self.levels - 1);
        9 * widest * widest
    }

    /// Returns true if a network of this shape can be built.
    pub(crate) fn is_sound(&self) -> bool {
        (1..=512).contains(&self.width) && (1..=6).contains(&self.levels) && matches!(self.patch, 1 | 2)
    }
}

/// Two 3 x 3 convolutions, each followed by the nonlinearity.
#[derive(Module, Debug)]
pub(crate) struct Block {
    first: Conv,
    second: Conv,
}

impl Block {
    fn init(ends: (usize, usize), gain: f64, device: &Device, rng: &mut Stream) -> Self {
        let first = Conv::init(ends, 3, gain, device, rng);
        Self { first, second: Conv::init((ends.1, ends.1), 3, gain, device, rng) }
    }

    fn forward(&self, x: Tensor<4>, activate: Activate) -> Tensor<4> {
        activate(self.second.forward(activate(self.first.forward(x))))
    }
}

type Activate = fn(Tensor<4>) -> Tensor<4>;

/// The network; its tensors are f32 `[batch, planes, rows, columns]`.
#[derive(Module, Debug)]
pub(crate) struct UNet {
    down: Vec<Block>,
    /// 1 x 1 convolutions to four times the channels, which then become 2 x 2 pixels.
    rise: Vec<Conv>,
    up: Vec<Block>,
    head: Conv,
    #[module(skip)]
    config: FixedConfig,
}

/// The configuration in the form that a burn module may hold.
#[derive(Clone, Copy, Debug)]
struct FixedConfig(UNetConfig);

impl UNet {
    /// A network with weights drawn from `rng`.
    pub(crate) fn init(config: UNetConfig, device: &Device, rng: &mut Stream) -> Self {
        assert!(config.is_sound(), "{config:?} is no network");
        // He's gain for ReLU, LeCun's for Tanh: the variance stays the same from layer to layer.
        let gain = match config.activation {
            Activation::Relu => 2.0,
            Activation::Tanh => 1.0,
        };
        let channels: Vec<usize> = (0..config.levels).map(|level| config.width << level).collect();
        let pixels = config.patch * config.patch;
        let inputs = std::iter::once(INPUT_PLANES * pixels).chain(channels.iter().copied());
        let down =
            inputs.zip(&channels).map(|(from, &to)| Block::init((from, to), gain, device, rng)).collect();
        let steps: Vec<usize> = channels.iter().rev().skip(1).copied().collect();
        let rise = steps.iter().map(|&to| Conv::init((2 * to, 4 * to), 1, 1.0, device, rng)).collect();
        let up = steps.iter().map(|&to| Block::init((2 * to, to), gain, device, rng)).collect();
        let head = Conv::init((config.width, OUTPUT_PLANES * pixels), 1, 1.0, device, rng);
        let network = Self { down, rise, up, head, config: FixedConfig(config) };
        // Equal networks have equal parameter ids, so that a stored optimiser finds its weights.
        network.map(&mut Renumber { next: 1 })
    }

    /// The shape it was made with.
    pub(crate) fn config(&self) -> UNetConfig {
        self.config.0
    }

    /// Logits `[batch, 11, rows, columns]` of images `[batch, 2, rows, columns]`.
    ///
    /// Rows and columns must be multiples of the stride of the configuration.
    pub(crate) fn forward(&self, images: Tensor<4>) -> Tensor<4> {
        let config = self.config();
        let activate: Activate = match config.activation {
            Activation::Relu => relu,
            Activation::Tanh => tanh,
        };
        let mut x = space_to_depth(images, config.patch);
        let mut skips = Vec::new();
        for (level, block) in self.down.iter().enumerate() {
            if level > 0 {
                skips.push(x.clone());
                x = max_pool2d(x, MaxPoolOptions::new([2, 2]));
            }
            x = block.forward(x, activate);
        }
        for (rise, up) in self.rise.iter().zip(&self.up) {
            let skip = skips.pop().expect("one skip a step up");
            x = depth_to_space(rise.forward(x), 2);
            x = up.forward(Tensor::cat(vec![x, skip], 1), activate);
        }
        depth_to_space(self.head.forward(x), config.patch)
    }
}

struct Renumber {
    next: u64,
}

impl ModuleMapper for Renumber {
    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let (_, value, mapper) = param.consume();
        let id = ParamId::from(self.next);
        self.next += 1;
        Param::from_mapped_value(id, value, mapper)
    }
}

/// `[b, c, p·h, p·w]` to `[b, c·p², h, w]`.
fn space_to_depth(x: Tensor<4>, patch: usize) -> Tensor<4> {
    if patch == 1 {
        return x;
    }
    let [batch, planes, rows, columns] = x.dims();
    let (h, w) = (rows / patch, columns / patch);
    let blocks: Tensor<6> = x.reshape([batch, planes, h, patch, w, patch]);
    blocks.permute([0, 1, 3, 5, 2, 4]).reshape([batch, planes * patch * patch, h, w])
}

/// The inverse of [`space_to_depth`].
fn depth_to_space(x: Tensor<4>, patch: usize) -> Tensor<4> {
    if patch == 1 {
        return x;
    }
    let [batch, deep, h, w] = x.dims();
    let planes = deep / (patch * patch);
    let blocks: Tensor<6> = x.reshape([batch, planes, patch, patch, h, w]);
    blocks.permute([0, 1, 4, 2, 5, 3]).reshape([batch, planes, h * patch, w * patch])
}

#[cfg(test)]
mod tests {
    use burn::tensor::TensorData;
    use sharp_space::Seed;

    use super::*;

    fn tiny(activation: Activation, patch: usize) -> UNet {
        let config = UNetConfig { width: 4, levels: 3, patch, activation };
        UNet::init(config, &Device::flex(), &mut Seed(1).stream("weights", 0))
    }

    #[test]
    fn logits_have_the_size_of_the_image() {
        for (activation, patch) in [(Activation::Relu, 2), (Activation::Tanh, 1)] {
            let images = Tensor::<4>::zeros([2, INPUT_PLANES, 16, 24], &Device::flex());
            let dims = tiny(activation, patch).forward(images).dims();
            assert_eq!(dims, [2, OUTPUT_PLANES, 16, 24], "{activation:?} {patch}");
        }
    }

    #[test]
    fn blocks_and_pixels_round_trip() {
        let values: Vec<f32> = (0..2 * 8 * 12).map(|v| v as f32).collect();
        let x = Tensor::<4>::from_data(TensorData::new(values.clone(), [1, 2, 8, 12]), &Device::flex());
        let back: Vec<f32> = depth_to_space(space_to_depth(x, 2), 2).try_to_vec_as().unwrap();
        assert_eq!(back, values);
    }

    #[test]
    fn the_compact_network_is_small_enough_to_ship() {
        let network = UNet::init(UNetConfig::compact(), &Device::flex(), &mut Seed(1).stream("weights", 0));
        assert!(network.num_params() < 480_000, "{} weights", network.num_params());
    }
}
