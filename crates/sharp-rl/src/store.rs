//! Networks as safetensors bytes: weights as tensors, everything else as one JSON header.
//!
//! The header is in the metadata under `sharp-rl`. It is a single key, because the metadata of the
//! format is an unordered map, and equal contents shall give equal bytes. Weights have `PyTorch`'s
//! names and layout (`actor.0.weight`, outputs x inputs). Reading checks version, kind, shapes and
//! that all values are finite.

use std::collections::{BTreeMap, HashMap};

use safetensors::tensor::TensorView;
use safetensors::{Dtype, SafeTensors};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::actor::{Actor, ActorError};
use crate::network::{Mlp, NetworkError};
use crate::normaliser::{Normaliser, NormaliserError};

/// Version of the layout. Files of another version are refused.
pub const FORMAT_VERSION: u32 = 1;

const HEADER_KEY: &str = "sharp-rl";

/// Why bytes are not a stored network.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum StoreError {
    /// The bytes are not a safetensors file, or are truncated.
    #[error("no safetensors file: {0}")]
    Container(#[from] safetensors::SafeTensorError),
    /// The header is missing or malformed.
    #[error("broken header: {0}")]
    Header(String),
    /// The file has another format version.
    #[error("format version {found}, expected {FORMAT_VERSION}")]
    Version {
        /// The version found.
        found: u32,
    },
    /// The file holds another kind of content.
    #[error("a file of kind {found:?}, expected {expected:?}")]
    Kind {
        /// The kind of the file.
        found: String,
        /// The kind wanted.
        expected: &'static str,
    },
    /// A tensor has another type or shape than the header says.
    #[error("tensor {name} is {found}, expected {expected}")]
    Tensor {
        /// Its name.
        name: String,
        /// Type and shape found.
        found: String,
        /// Type and shape expected.
        expected: String,
    },
    /// A tensor holds NaN or infinity.
    #[error("tensor {name} holds {value} at {index}")]
    NotFinite {
        /// Its name.
        name: String,
        /// The index in it.
        index: usize,
        /// The value.
        value: f32,
    },
    /// The weights do not make a network.
    #[error(transparent)]
    Network(#[from] NetworkError),
    /// Network and normaliser do not fit each other.
    #[error(transparent)]
    Actor(#[from] ActorError),
    /// The values do not make a normaliser.
    #[error("normaliser: {0}")]
    Normaliser(#[from] NormaliserError),
}

#[derive(Serialize, Deserialize)]
struct NetworkHeader {
    sizes: Vec<usize>,
    notes: BTreeMap<String, String>,
}

impl Mlp {
    const KIND: &'static str = "network";

    /// The network as bytes of a safetensors file, with free text `notes` of the caller.
    #[must_use]
    pub fn to_bytes(&self, notes: &BTreeMap<String, String>) -> Vec<u8> {
        let mut writer = TensorWriter::default();
        writer.network("network", self);
        writer.finish(Self::KIND, &NetworkHeader { sizes: self.sizes().to_vec(), notes: notes.clone() })
    }

    /// Reads what [`Self::to_bytes`] wrote, bit for bit, and its notes.
    ///
    /// # Errors
    /// If the bytes are truncated, of another version or kind, of inconsistent shapes, or hold a
    /// value that is not finite.
    pub fn from_bytes(bytes: &[u8]) -> Result<(Self, BTreeMap<String, String>), StoreError> {
        let (reader, header) = TensorReader::open::<NetworkHeader>(bytes, Self::KIND)?;
        Ok((reader.network("network", &header.sizes)?, header.notes))
    }
}

impl Actor {
    const KIND: &'static str = "actor";

    /// The actor as bytes of a safetensors file, with free text `notes` of the caller.
    #[must_use]
    pub fn to_bytes(&self, notes: &BTreeMap<String, String>) -> Vec<u8> {
        let mut writer = TensorWriter::default();
        writer.actor("actor", self);
        let header = NetworkHeader { sizes: self.network().sizes().to_vec(), notes: notes.clone() };
        writer.finish(Self::KIND, &header)
    }

    /// Reads what [`Self::to_bytes`] wrote, bit for bit, and its notes.
    ///
    /// # Errors
    /// If the bytes are truncated, of another version or kind, of inconsistent shapes, or hold a
    /// value that is not finite.
    pub fn from_bytes(bytes: &[u8]) -> Result<(Self, BTreeMap<String, String>), StoreError> {
        let (reader, header) = TensorReader::open::<NetworkHeader>(bytes, Self::KIND)?;
        Ok((reader.actor("actor", &header.sizes)?, header.notes))
    }
}

/// What every header has in common.
#[derive(Serialize, Deserialize)]
struct StoredHeader<H> {
    format: u32,
    kind: String,
    #[serde(flatten)]
    header: H,
}

/// The part of a header that can be read before its kind is known.
#[derive(Deserialize)]
struct HeaderKind {
    format: u32,
    kind: String,
}

/// Collects tensors and writes them with their header.
#[derive(Default)]
pub(crate) struct TensorWriter {
    tensors: Vec<(String, Dtype, Vec<usize>, Vec<u8>)>,
}

impl TensorWriter {
    pub(crate) fn floats(&mut self, name: &str, shape: &[usize], values: &[f32]) {
        let bytes = values.iter().flat_map(|value| value.to_le_bytes()).collect();
        self.tensors.push((name.to_owned(), Dtype::F32, shape.to_vec(), bytes));
    }

    pub(crate) fn vector(&mut self, name: &str, values: &[f32]) {
        self.floats(name, &[values.len()], values);
    }

    pub(crate) fn bytes(&mut self, name: &str, values: &[u8]) {
        self.tensors.push((name.to_owned(), Dtype::U8, vec![values.len()], values.to_vec()));
    }

    pub(crate) fn network(&mut self, name: &str, network: &Mlp) {
        for (index, pair) in network.sizes().windows(2).enumerate() {
            let layer = network.layer(index);
            self.floats(&format!("{name}.{index}.weight"), &[pair[1], pair[0]], layer.weights);
            self.vector(&format!("{name}.{index}.bias"), layer.bias);
        }
    }

    pub(crate) fn actor(&mut self, name: &str, actor: &Actor) {
        self.network(name, actor.network());
        self.vector(&format!("{name}.mean"), actor.normaliser().mean());
        self.vector(&format!("{name}.std"), actor.normaliser().std());
    }

    pub(crate) fn finish<H: Serialize>(&self, kind: &str, header: &H) -> Vec<u8> {
        let stored = StoredHeader { format: FORMAT_VERSION, kind: kind.to_owned(), header };
        let json = serde_json::to_string(&stored).expect("headers are plain data");
        let views = self.tensors.iter().map(|(name, dtype, shape, bytes)| {
            let view = TensorView::new(*dtype, shape.clone(), bytes).expect("shapes fit their data");
            (name.as_str(), view)
        });
        let metadata = HashMap::from([(HEADER_KEY.to_owned(), json)]);
        safetensors::serialize(views, Some(metadata)).expect("headers stay far below the format's limit")
    }
}

/// Tensors by name, checked when they are read.
pub(crate) struct TensorReader<'a> {
    tensors: SafeTensors<'a>,
}

impl<'a> TensorReader<'a> {
    /// Opens a file of the given kind and reads its header.
    pub(crate) fn open<H: DeserializeOwned>(
        bytes: &'a [u8],
        expected: &'static str,
    ) -> Result<(Self, H), StoreError> {
        let (_, metadata) = SafeTensors::read_metadata(bytes)?;
        let json = metadata.metadata().as_ref().and_then(|map| map.get(HEADER_KEY));
        let json = json.ok_or_else(|| StoreError::Header(format!("no entry {HEADER_KEY:?}")))?;
        let broken = |error: serde_json::Error| StoreError::Header(error.to_string());
        let kind: HeaderKind = serde_json::from_str(json).map_err(broken)?;
        if kind.format != FORMAT_VERSION {
            return Err(StoreError::Version { found: kind.format });
        }
        if kind.kind != expected {
            return Err(StoreError::Kind { found: kind.kind, expected });
        }
        let stored: StoredHeader<H> = serde_json::from_str(json).map_err(broken)?;
        Ok((Self { tensors: SafeTensors::deserialize(bytes)? }, stored.header))
    }

    /// A tensor of finite numbers of exactly this shape.
    pub(crate) fn floats(&self, name: &str, shape: &[usize]) -> Result<Vec<f32>, StoreError> {
        let data = self.data(name, Dtype::F32, shape)?;
        let (words, _) = data.as_chunks::<4>();
        let values: Vec<f32> = words.iter().map(|word| f32::from_le_bytes(*word)).collect();
        match values.iter().position(|value| !value.is_finite()) {
            Some(index) => Err(StoreError::NotFinite { name: name.to_owned(), index, value: values[index] }),
            None => Ok(values),
        }
    }

    pub(crate) fn bytes(&self, name: &str, len: usize) -> Result<Vec<u8>, StoreError> {
        self.data(name, Dtype::U8, &[len]).map(<[u8]>::to_vec)
    }

    pub(crate) fn network(&self, name: &str, sizes: &[usize]) -> Result<Mlp, StoreError> {
        let mut parameters = Vec::new();
        for (index, pair) in sizes.windows(2).enumerate() {
            parameters.extend(self.floats(&format!("{name}.{index}.weight"), &[pair[1], pair[0]])?);
            parameters.extend(self.floats(&format!("{name}.{index}.bias"), &[pair[1]])?);
        }
        Ok(Mlp::from_parameters(sizes, parameters)?)
    }

    pub(crate) fn actor(&self, name: &str, sizes: &[usize]) -> Result<Actor, StoreError> {
        let network = self.network(name, sizes)?;
        let shape = [network.sizes()[0]];
        let mean = self.floats(&format!("{name}.mean"), &shape)?;
        let std = self.floats(&format!("{name}.std"), &shape)?;
        Ok(Actor::from_parts(network, Normaliser::new(mean, std)?)?)
    }

    fn data(&self, name: &str, dtype: Dtype, shape: &[usize]) -> Result<&[u8], StoreError> {
        let tensor = self.tensors.tensor(name)?;
        if tensor.dtype() == dtype && tensor.shape() == shape {
            return Ok(tensor.data());
        }
        Err(StoreError::Tensor {
            name: name.to_owned(),
            found: format!("{:?} {:?}", tensor.dtype(), tensor.shape()),
            expected: format!("{dtype:?} {shape:?}"),
        })
    }
}

#[cfg(test)]
mod tests {
    use rand::SeedableRng;

    use super::*;
    use crate::environment::{EnvironmentSpec, Stream};

    fn actor() -> Actor {
        let spec = EnvironmentSpec { observation_len: 3, action_len: 2 };
        let mut actor = Actor::new(spec, &[8], &mut Stream::seed_from_u64(1));
        let normaliser = Normaliser::new(vec![0.1, -2.0, 3.0], vec![1.0, 0.5, 2.0]).expect("positive");
        actor.set_normaliser(normaliser);
        actor
    }

    fn notes() -> BTreeMap<String, String> {
        BTreeMap::from([("option".to_owned(), "3 to 5".to_owned()), ("map".to_owned(), "a\"b".to_owned())])
    }

    fn refusal(bytes: &[u8]) -> String {
        Actor::from_bytes(bytes).expect_err("broken bytes").to_string()
    }

    /// Replaces the first occurrence of `from` by `to`, which is as long.
    fn edited(from: &str, to: &str) -> Vec<u8> {
        let mut bytes = actor().to_bytes(&notes());
        let start = bytes.windows(from.len()).position(|w| w == from.as_bytes()).expect("text to replace");
        bytes[start..start + to.len()].copy_from_slice(to.as_bytes());
        bytes
    }

    #[test]
    fn an_actor_survives_bit_for_bit() {
        let bytes = actor().to_bytes(&notes());
        let (loaded, loaded_notes) = Actor::from_bytes(&bytes).expect("own bytes");
        assert_eq!(loaded, actor());
        assert_eq!(loaded_notes, notes());
        assert_eq!(loaded.to_bytes(&notes()), bytes, "equal contents, equal bytes");
    }

    #[test]
    fn bytes_cut_anywhere_are_refused() {
        let bytes = actor().to_bytes(&notes());
        for len in (0..bytes.len()).step_by(13).chain([bytes.len() - 1]) {
            assert!(Actor::from_bytes(&bytes[..len]).is_err(), "{len} of {} bytes", bytes.len());
        }
    }

    #[test]
    fn another_version_kind_or_shape_is_refused() {
        assert_eq!(refusal(&edited(r#"format\":1"#, r#"format\":7"#)), "format version 7, expected 1");
        assert_eq!(
            refusal(&edited(r#"\"actor\""#, r#"\"motor\""#)),
            r#"a file of kind "motor", expected "actor""#
        );
        assert_eq!(
            refusal(&edited("[3,8,4]", "[3,9,4]")),
            "tensor actor.0.weight is F32 [8, 3], expected F32 [9, 3]"
        );
        assert!(refusal(&edited("sharp-rl", "shark-rl")).starts_with("broken header"), "no header");
    }

    #[test]
    fn nan_weights_are_refused() {
        let mut network = actor().network().clone();
        network.parameters_mut()[5] = f32::NAN;
        let bytes = Actor::from_parts(network, actor().normaliser().clone())
            .expect("lengths fit")
            .to_bytes(&BTreeMap::new());
        assert_eq!(refusal(&bytes), "tensor actor.0.weight holds NaN at 5");
    }

    #[test]
    fn sizes_without_a_network_are_refused() {
        assert!(Actor::from_bytes(&edited("[3,8,4]", "[     ]")).is_err(), "no sizes at all");
    }
}
