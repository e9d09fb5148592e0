//! Where tensors are computed.

use burn::tensor::Device;
use serde::{Deserialize, Serialize};

/// The backend that computes; chosen at run time, never from the environment.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum ComputeDevice {
    /// burn's own CPU backend.
    #[default]
    Flex,
    /// The older CPU backend; `sharp_regions` computes convolutions for it as matrix products.
    #[cfg(feature = "ndarray")]
    Ndarray,
}

impl ComputeDevice {
    pub(crate) fn device(self) -> Device {
        match self {
            Self::Flex => Device::flex(),
            #[cfg(feature = "ndarray")]
            #[allow(deprecated, reason = "kept as a second opinion while burn ships it")]
            Self::Ndarray => Device::ndarray(),
        }
    }
}

/// Returns true if the backend of `device` multiplies matrices much faster than it convolves.
#[cfg(feature = "ndarray")]
pub(crate) fn convolves_slowly(device: &Device) -> bool {
    *device == ComputeDevice::Ndarray.device()
}

/// Returns true if the backend of `device` multiplies matrices much faster than it convolves.
#[cfg(not(feature = "ndarray"))]
pub(crate) const fn convolves_slowly(_: &Device) -> bool {
    false
}
