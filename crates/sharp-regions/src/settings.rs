//! How a network is trained: presets, and which kinds of maps are kept from it.

use serde::{Deserialize, Serialize};
use sharp_maps::FloorplanKind;
use sharp_space::Seed;

use crate::device::ComputeDevice;
use crate::labels::LabelSettings;
use crate::unet::{Activation, UNetConfig};

/// Kinds of floor plans that training never sees: scores are measured on them.
pub const HELD_OUT_KINDS: [FloorplanKind; 3] =
    [FloorplanKind::CrossCorridors, FloorplanKind::Islands, FloorplanKind::BentCorridor];

/// Kinds that neither training nor scores see: what is tuned is tuned on them.
pub const VALIDATION_KINDS: [FloorplanKind; 2] = [FloorplanKind::Gaps, FloorplanKind::RoomsAndClutter];

/// How a network is trained.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct TrainSettings {
    /// The network's shape.
    pub network: UNetConfig,
    /// Number of training maps; the kinds take turns.
    pub maps: usize,
    /// How each map is labelled.
    pub labels: LabelSettings,
    /// Gradient steps.
    pub steps: usize,
    /// Maps in a step.
    pub batch: usize,
    /// Adam's largest step size; the paper's 1e-4 needs far more than a few hundred steps.
    pub learning_rate: f64,
    /// Weight of a critical pixel against one that is not.
    pub positive_weight: f64,
    /// Weight of the heading loss.
    pub heading_weight: f64,
    /// Steps between two checkpoints.
    pub checkpoint_steps: usize,
    /// The root of all randomness.
    pub seed: Seed,
    /// Where to compute.
    pub device: ComputeDevice,
}

impl Default for TrainSettings {
    fn default() -> Self {
        Self {
            network: UNetConfig::compact(),
            // Five of each kind that training sees; the paper has 20.
            maps: 85,
            labels: LabelSettings::default(),
            steps: 700,
            batch: 8,
            learning_rate: 2e-3,
            positive_weight: 2.0,
            heading_weight: 0.1,
            checkpoint_steps: 100,
            seed: Seed(1),
            device: ComputeDevice::default(),
        }
    }
}

impl TrainSettings {
    /// Done in seconds: better than chance, no more. For trying the machinery.
    #[must_use]
    pub fn tiny() -> Self {
        Self {
            network: UNetConfig { width: 8, levels: 2, ..UNetConfig::compact() },
            maps: 8,
            labels: LabelSettings { goals: 8, starts: 10, ..LabelSettings::default() },
            steps: 120,
            batch: 2,
            learning_rate: 1e-2,
            ..Self::default()
        }
    }

    /// The paper's nonlinearity, learning rate and batch with the default's network and labels: what they
    /// are worth where the budget is the same.
    #[must_use]
    pub fn paper_small() -> Self {
        let network = UNetConfig { activation: Activation::Tanh, ..UNetConfig::compact() };
        Self { network, batch: 5, learning_rate: 1e-4, ..Self::default() }
    }

    /// The paper's numbers: 20 maps, 100 goals, 50 starts each, 50,000 steps of Adam at 1e-4; days
    /// on a CPU.
    #[must_use]
    pub fn paper() -> Self {
        Self {
            network: UNetConfig::paper(),
            maps: 20,
            steps: 50_000,
            batch: 5,
            learning_rate: 1e-4,
            ..Self::default()
        }
    }
}
