//! Networks as files: safetensors, with what the network is as JSON beside the weights.
//!
//! A file that is cut short, has other shapes than its own description asks for, or holds a number
//! that is not finite is refused with the reason.

use std::collections::{BTreeMap, HashMap};

use burn::module::{Module, ModuleMapper, ModuleVisitor, Param};
use burn::tensor::{Device, Tensor, TensorData};
use safetensors::tensor::{Dtype, SafeTensors, TensorView, serialize};
use serde::{Deserialize, Serialize};
use sharp_space::Seed;
use thiserror::Error;

use crate::network::unet::{UNet, UNetConfig};

/// The version of the format that is written and read.
const FORMAT: u32 = 1;

/// The metadata key under which the card is stored.
const CARD_KEY: &str = "sharp.regions";

/// What a stored network is and where it comes from.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct ModelCard {
    /// Version of the file format.
    pub format: u32,
    /// Its shape.
    pub network: UNetConfig,
    /// Half the length of the robot whose plans it learnt from, metres.
    pub half_length_m: f64,
    /// Half the width of that robot, metres.
    pub half_width_m: f64,
    /// That robot's smallest turning radius, metres; 0 for one that turns in place.
    pub radius_m: f64,
    /// Training steps done.
    pub steps: usize,
    /// Number of training maps.
    pub maps: usize,
    /// The seed of its labels and its weights.
    pub seed: Seed,
}

impl ModelCard {
    pub(crate) const fn format() -> u32 {
        FORMAT
    }
}

/// Why a file with a network was refused.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ModelError {
    /// Not a safetensors file, or cut short.
    #[error("model is no whole safetensors file: {0}")]
    Broken(String),
    /// The description is missing or unreadable.
    #[error("model has no readable metadata {CARD_KEY:?}: {0}")]
    Card(String),
    /// Written by another version.
    #[error("model has format {found}, expected {FORMAT}")]
    Format {
        /// The version found.
        found: u32,
    },
    /// The description asks for a network that cannot be built.
    #[error("model describes a network of width {}, {} levels and patch {}", .0.width, .0.levels, .0.patch)]
    Network(UNetConfig),
    /// A tensor is missing.
    #[error("model has no tensor {0:?}")]
    Missing(String),
    /// A tensor has the wrong shape or type.
    #[error("model tensor {name:?} is {found}, expected f32 {expected:?}")]
    Shape {
        /// The tensor.
        name: String,
        /// Its type and shape.
        found: String,
        /// The shape expected.
        expected: Vec<usize>,
    },
    /// A weight is NaN or infinite.
    #[error("model tensor {name:?} holds {value} at position {position}")]
    NotFinite {
        /// The tensor.
        name: String,
        /// The position of the weight, row-major.
        position: usize,
        /// The weight.
        value: f32,
    },
}

/// The bytes of a safetensors file with `network`, `card` and more tensors of bytes.
pub(crate) fn to_bytes(network: &UNet, card: &ModelCard, extra: &BTreeMap<String, Vec<u8>>) -> Vec<u8> {
    let mut weights = Weights::default();
    network.visit(&mut weights);
    let buffers: Vec<_> = weights
        .found
        .iter()
        .map(|(name, shape, values)| {
            let bytes: Vec<u8> = values.iter().flat_map(|v| v.to_le_bytes()).collect();
            (name.clone(), shape.clone(), bytes)
        })
        .collect();
    let floats = buffers.iter().map(|(name, shape, bytes)| {
        let view = TensorView::new(Dtype::F32, shape.clone(), bytes);
        (name.clone(), view.expect("four bytes a weight"))
    });
    let others = extra.iter().map(|(name, bytes)| {
        let view = TensorView::new(Dtype::U8, vec![bytes.len()], bytes);
        (name.clone(), view.expect("one byte a byte"))
    });
    let json = serde_json::to_string(card).expect("a card has no keys that are not text");
    // A single key: the library writes metadata in no fixed order.
    let metadata = HashMap::from([(CARD_KEY.to_owned(), json)]);
    serialize(floats.chain(others), Some(metadata)).expect("names are unique")
}

/// The network in `bytes`, with its card.
pub(crate) fn from_bytes(bytes: &[u8], device: &Device) -> Result<(UNet, ModelCard), ModelError> {
    let broken = |error: safetensors::SafeTensorError| ModelError::Broken(error.to_string());
    let card = read_card(bytes)?;
    let tensors = SafeTensors::deserialize(bytes).map_err(broken)?;
    // A damaged card must not make it take gigabytes.
    if card.network.least_weights() > bytes.len() / size_of::<f32>() {
        return Err(ModelError::Network(card.network));
    }
    let network = UNet::init(card.network, device, &mut card.seed.stream("weights", 0));
    let mut weights = Weights::default();
    network.visit(&mut weights);
    let mut values = Vec::new();
    for (name, shape, _) in weights.found {
        values.push(read_tensor(&tensors, &name, &shape)?);
    }
    Ok((network.map(&mut Replace { values: values.into_iter(), device }), card))
}

/// The extra tensor of bytes called `name`.
pub(crate) fn extra_bytes(bytes: &[u8], name: &str) -> Result<Vec<u8>, ModelError> {
    let tensors = SafeTensors::deserialize(bytes).map_err(|e| ModelError::Broken(e.to_string()))?;
    let view = tensors.tensor(name).map_err(|_| ModelError::Missing(name.to_owned()))?;
    Ok(view.data().to_vec())
}

fn read_card(bytes: &[u8]) -> Result<ModelCard, ModelError> {
    let (_, metadata) =
        SafeTensors::read_metadata(bytes).map_err(|error| ModelError::Broken(error.to_string()))?;
    let json = metadata.metadata().as_ref().and_then(|all| all.get(CARD_KEY));
    let json = json.ok_or_else(|| ModelError::Card("not there".to_owned()))?;
    let card: ModelCard = serde_json::from_str(json).map_err(|error| ModelError::Card(error.to_string()))?;
    if card.format != FORMAT {
        return Err(ModelError::Format { found: card.format });
    }
    if !card.network.is_sound() {
        return Err(ModelError::Network(card.network));
    }
    Ok(card)
}

fn read_tensor(tensors: &SafeTensors<'_>, name: &str, shape: &[usize]) -> Result<TensorData, ModelError> {
    let view = tensors.tensor(name).map_err(|_| ModelError::Missing(name.to_owned()))?;
    if view.dtype() != Dtype::F32 || view.shape() != shape {
        let found = format!("{:?} {:?}", view.dtype(), view.shape());
        return Err(ModelError::Shape { name: name.to_owned(), found, expected: shape.to_vec() });
    }
    let (words, _) = view.data().as_chunks::<4>();
    let values: Vec<f32> = words.iter().map(|&word| f32::from_le_bytes(word)).collect();
    match values.iter().position(|value| !value.is_finite()) {
        Some(position) => {
            Err(ModelError::NotFinite { name: name.to_owned(), position, value: values[position] })
        }
        None => Ok(TensorData::new(values, shape.to_vec())),
    }
}

/// Collects every parameter with its path and shape.
#[derive(Default)]
struct Weights {
    path: Vec<String>,
    found: Vec<(String, Vec<usize>, Vec<f32>)>,
}

impl ModuleVisitor for Weights {
    fn enter_module(&mut self, name: &str, _container_type: &str) {
        self.path.push(name.to_owned());
    }

    fn exit_module(&mut self, _name: &str, _container_type: &str) {
        self.path.pop();
    }

    fn visit_float<const D: usize>(&mut self, param: &Param<Tensor<D>>) {
        let tensor = param.val();
        let values = tensor.try_to_vec_as::<f32>().expect("a CPU tensor can be read");
        self.found.push((self.path.join("."), tensor.dims().to_vec(), values));
    }
}

/// Replaces every parameter's value, in order.
struct Replace<'a> {
    values: std::vec::IntoIter<TensorData>,
    device: &'a Device,
}

impl ModuleMapper for Replace<'_> {
    fn map_float<const D: usize>(&mut self, param: Param<Tensor<D>>) -> Param<Tensor<D>> {
        let data = self.values.next().expect("one value a parameter");
        let tracked = param.val().is_require_grad();
        param.map(|_| Tensor::from_data(data, self.device).set_require_grad(tracked))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::network::unet::Activation;

    fn model() -> (UNet, ModelCard) {
        let network = UNetConfig { width: 2, levels: 2, patch: 2, activation: Activation::Relu };
        let card = ModelCard {
            format: FORMAT,
            network,
            half_length_m: 0.5,
            half_width_m: 0.3,
            radius_m: 0.0,
            steps: 3,
            maps: 1,
            seed: Seed(5),
        };
        (UNet::init(network, &Device::flex(), &mut Seed(9).stream("other", 0)), card)
    }

    fn logits(network: &UNet) -> Vec<f32> {
        network.forward(Tensor::ones([1, 2, 8, 8], &Device::flex())).try_to_vec_as().unwrap()
    }

    #[test]
    fn a_network_survives_a_round_trip() {
        let (network, card) = model();
        let bytes = to_bytes(&network, &card, &BTreeMap::new());
        let (read, read_card) = from_bytes(&bytes, &Device::flex()).unwrap();
        assert_eq!(read_card, card);
        assert_eq!(logits(&read), logits(&network), "same weights, same answer");
        assert_eq!(to_bytes(&read, &card, &BTreeMap::new()), bytes, "same bytes");
    }

    #[test]
    fn broken_files_are_refused_with_the_reason() {
        let (network, card) = model();
        let bytes = to_bytes(&network, &card, &BTreeMap::new());
        let refusal = |bytes: &[u8]| from_bytes(bytes, &Device::flex()).unwrap_err().to_string();
        for length in [0, 7, 40, bytes.len() - 1] {
            assert!(refusal(&bytes[..length]).contains("no whole safetensors"), "cut to {length}");
        }
        let mut not_finite = bytes.clone();
        let end = not_finite.len();
        not_finite[end - 4..].copy_from_slice(&f32::NAN.to_le_bytes());
        assert!(refusal(&not_finite).contains("holds NaN"), "{}", refusal(&not_finite));
        let other = ModelCard { network: UNetConfig { width: 3, ..card.network }, ..card.clone() };
        let wider = refusal(&to_bytes(&network, &other, &BTreeMap::new()));
        assert!(wider.contains("expected f32"), "{wider}");
        let giant = UNetConfig { width: 512, levels: 6, ..card.network };
        let giant =
            refusal(&to_bytes(&network, &ModelCard { network: giant, ..card.clone() }, &BTreeMap::new()));
        assert!(giant.contains("describes a network of width 512, 6 levels"), "{giant}");
        let newer = ModelCard { format: 2, ..card };
        assert!(refusal(&to_bytes(&network, &newer, &BTreeMap::new())).contains("format 2"), "format");
    }
}
