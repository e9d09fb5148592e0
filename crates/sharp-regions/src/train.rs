//! Training of the region network for one robot: labels, optimisation, checkpoints.
//!
//! Adam on the weighted logarithmic loss, as in the paper; the step size falls along a cosine.
//! Every map is seen in its eight symmetries. Each batch has a random stream of its own, so that a
//! run that is continued from its checkpoint ends with the network of a run that never stopped.

use std::collections::BTreeMap;
use std::path::Path;

use burn::module::Module;
use burn::optim::{AdamConfig, GradientsParams, ModuleOptimizer, OptimizerRecord};
use burn::tensor::{Bytes, Device, Tensor, TensorData};
use rand::RngExt;
use serde::{Deserialize, Serialize};
use sharp_space::floorplan::FloorplanKind;
use sharp_space::{Seed, Stream};
use thiserror::Error;

use crate::dataset::{DatasetError, Recipe, Sample, write_whole};
use crate::device::ComputeDevice;
use crate::heatmap::HEADING_BINS;
use crate::labels::{CRITICAL_MIN, FINE_BINS, LabelRobot, LabelSettings, source_bin, target};
use crate::loss::{LossWeights, Targets, loss};
use crate::predict::RegionPredictor;
use crate::store::{ModelCard, ModelError, extra_bytes, from_bytes, to_bytes};
use crate::unet::{INPUT_PLANES, UNet, UNetConfig};

/// Kinds of floor plans that training never sees: scores are measured on them.
pub const HELD_OUT_KINDS: [FloorplanKind; 5] = [
    FloorplanKind::Gaps,
    FloorplanKind::CrossCorridors,
    FloorplanKind::Islands,
    FloorplanKind::RoomsAndClutter,
    FloorplanKind::BentCorridor,
];

/// The name of the tensor with the optimiser's state in a checkpoint.
const OPTIMIZER: &str = "optimizer";

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
    /// Too small to be of use, but done in seconds: for trying the machinery.
    #[must_use]
    pub fn tiny() -> Self {
        Self {
            network: UNetConfig { width: 8, levels: 2, ..UNetConfig::compact() },
            maps: 4,
            labels: LabelSettings { goals: 6, starts: 8, ..LabelSettings::default() },
            steps: 40,
            batch: 2,
            learning_rate: 1e-2,
            ..Self::default()
        }
    }

    /// The paper's numbers: 20 maps, 100 goals, 50 starts each, 50,000 steps of Adam at 1e-4; days
    /// on a CPU.
    #[must_use]
    pub fn paper() -> Self {
        Self {
            network: UNetConfig::paper(),
            maps: 20,
            labels: LabelSettings { goals: 100, starts: 50, ..LabelSettings::default() },
            steps: 50_000,
            batch: 5,
            learning_rate: 1e-4,
            ..Self::default()
        }
    }
}

/// What training tells while it runs.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum TrainProgress {
    /// A map has its labels.
    Labelled {
        /// Maps done.
        map: usize,
        /// Maps in all.
        of: usize,
        /// Problems solved on it.
        solved: usize,
    },
    /// A gradient step was taken.
    Step {
        /// Steps done.
        step: usize,
        /// Steps in all.
        of: usize,
        /// The loss before it.
        loss: f32,
    },
}

/// Why training stopped without a network.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum TrainError {
    /// A setting is of no use.
    #[error("training setting {field} is {value}, must be at least 1")]
    Setting {
        /// Its name.
        field: &'static str,
        /// Its value.
        value: usize,
    },
    /// The network's shape cannot be built.
    #[error(transparent)]
    Model(#[from] ModelError),
    /// Labels or checkpoints could not be read or written.
    #[error(transparent)]
    Dataset(#[from] DatasetError),
    /// The loss is no number any more.
    #[error("loss is {loss} at step {step}, try a smaller learning rate")]
    Diverged {
        /// The step.
        step: usize,
        /// The loss.
        loss: f32,
    },
}

/// Trains a network on the plans of `robot`; `observer` hears of every map and every step.
///
/// With a `folder`, labels and checkpoints are kept there, and a run that was stopped goes on where
/// it was.
///
/// # Errors
/// Returns an error if a setting is of no use, the folder cannot be written, or the loss diverges.
pub fn train_regions(
    robot: &LabelRobot,
    settings: &TrainSettings,
    folder: Option<&Path>,
    observer: &mut dyn FnMut(&TrainProgress),
) -> Result<RegionPredictor, TrainError> {
    let counts =
        [("maps", settings.maps), ("batch", settings.batch), ("checkpoint_steps", settings.checkpoint_steps)];
    for (field, value) in counts {
        if value == 0 {
            return Err(TrainError::Setting { field, value });
        }
    }
    if !settings.network.is_sound() {
        return Err(ModelError::Network(settings.network).into());
    }
    let samples = label_maps(robot, settings, folder, observer)?;
    let checkpoint = folder.map(|folder| folder.join("checkpoint.safetensors"));
    let mut run = Run::start_or_resume(robot, settings, checkpoint.as_deref());
    while run.card.steps < settings.steps {
        let loss = run.step(&samples, settings)?;
        let done = run.card.steps;
        observer(&TrainProgress::Step { step: done, of: settings.steps, loss });
        if let Some(path) = &checkpoint
            && (done.is_multiple_of(settings.checkpoint_steps) || done == settings.steps)
        {
            run.save(path)?;
        }
    }
    Ok(RegionPredictor::new(run.network.valid(), run.card, settings.device))
}

/// Labels the training maps, or reads those that are already labelled.
fn label_maps(
    robot: &LabelRobot,
    settings: &TrainSettings,
    folder: Option<&Path>,
    observer: &mut dyn FnMut(&TrainProgress),
) -> Result<Vec<Sample>, TrainError> {
    let kinds: Vec<_> = FloorplanKind::ALL.into_iter().filter(|k| !HELD_OUT_KINDS.contains(k)).collect();
    let mut samples = Vec::with_capacity(settings.maps);
    for number in 0..settings.maps {
        let kind = kinds[number % kinds.len()];
        let recipe = Recipe::new(kind, number as u64, robot, settings.labels, settings.seed);
        let sample = match folder {
            Some(folder) => recipe.load_or_make(robot, &folder.join("maps"))?,
            None => recipe.make(robot),
        };
        let solved = sample.labels.solved;
        observer(&TrainProgress::Labelled { map: number + 1, of: settings.maps, solved });
        samples.push(sample);
    }
    Ok(samples)
}

/// A network on its way.
struct Run {
    network: UNet,
    optimizer: ModuleOptimizer,
    card: ModelCard,
    device: Device,
}

impl Run {
    /// Goes on from the checkpoint if there is a sound one of the same run, else starts.
    fn start_or_resume(robot: &LabelRobot, settings: &TrainSettings, checkpoint: Option<&Path>) -> Self {
        let device = settings.device.device().autodiff();
        let card = ModelCard {
            format: ModelCard::format(),
            network: settings.network,
            half_length_m: robot.footprint.half_length_m(),
            half_width_m: robot.footprint.half_width_m(),
            radius_m: robot.steering.radius_m(),
            steps: 0,
            maps: settings.maps,
            seed: settings.seed,
        };
        let stored = checkpoint.and_then(|path| Self::load(path, &device));
        if let Some(run) = stored
            && (ModelCard { steps: 0, ..run.card.clone() }) == card
            && run.card.steps <= settings.steps
        {
            return run;
        }
        let network = UNet::init(settings.network, &device, &mut settings.seed.stream("weights", 0));
        Self { network, optimizer: optimizer(), card, device }
    }

    fn load(path: &Path, device: &Device) -> Option<Self> {
        let bytes = std::fs::read(path).ok()?;
        let (network, card) = from_bytes(&bytes, device).ok()?;
        let state = Bytes::from_bytes_vec(extra_bytes(&bytes, OPTIMIZER).ok()?);
        let optimizer = optimizer().load_record(OptimizerRecord::from_bytes(state).ok()?);
        Some(Self { network, optimizer, card, device: device.clone() })
    }

    fn save(&self, path: &Path) -> Result<(), TrainError> {
        let state = self.optimizer.into_bytes().expect("a CPU optimiser's state can be read");
        let extra = BTreeMap::from([(OPTIMIZER.to_owned(), state.to_vec())]);
        Ok(write_whole(path, &to_bytes(&self.network, &self.card, &extra))?)
    }

    /// One gradient step; returns the loss before it.
    fn step(&mut self, samples: &[Sample], settings: &TrainSettings) -> Result<f32, TrainError> {
        let step = self.card.steps;
        let mut rng = settings.seed.stream("batch", step as u64);
        let base = settings.device.device();
        let (images, targets) = batch(samples, settings.batch, &base, &mut rng);
        let weights = LossWeights { positive: settings.positive_weight, heading: settings.heading_weight };
        let loss = loss(self.network.forward(images.to_device(&self.device)), &targets, weights);
        let value = loss.clone().into_scalar::<f32>();
        if !value.is_finite() {
            return Err(TrainError::Diverged { step, loss: value });
        }
        let gradients = GradientsParams::from_grads(loss.backward(), &self.network);
        let rate = learning_rate(settings, step);
        self.network = self.optimizer.step(rate, self.network.clone(), gradients);
        self.card.steps += 1;
        Ok(value)
    }
}

fn optimizer() -> ModuleOptimizer {
    // burn's default of 1e-5 would damp the small gradients of rare critical pixels.
    AdamConfig::new().with_epsilon(1e-8).init()
}

/// A short ramp, then half a cosine down to nothing.
fn learning_rate(settings: &TrainSettings, step: usize) -> f64 {
    const RAMP_STEPS: f64 = 20.0;
    let ramp = ((step + 1) as f64 / RAMP_STEPS).min(1.0);
    let share = step as f64 / settings.steps as f64;
    settings.learning_rate * ramp * 0.5 * (1.0 + (std::f64::consts::PI * share).cos())
}

/// `count` random samples, each in a random symmetry.
fn batch(samples: &[Sample], count: usize, device: &Device, rng: &mut Stream) -> (Tensor<4>, Targets) {
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
        let order: Vec<usize> = (0..side * side).map(|index| source_pixel(index, side, symmetry)).collect();
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

/// The pixel of the original that comes to `index` of the turned image.
fn source_pixel(index: usize, side: usize, symmetry: usize) -> usize {
    let (mut col, mut row) = (index % side, index / side);
    if symmetry & 1 != 0 {
        col = side - 1 - col;
    }
    if symmetry & 2 != 0 {
        row = side - 1 - row;
    }
    if symmetry & 4 != 0 {
        std::mem::swap(&mut col, &mut row);
    }
    row * side + col
}

#[cfg(test)]
mod tests {
    use sharp_motion::Steering;
    use sharp_space::Footprint;

    use super::*;
    use crate::unet::Activation;

    fn robot() -> LabelRobot {
        let footprint = Footprint::rectangle(0.3, 0.2).unwrap();
        LabelRobot { footprint, steering: Steering::RotateTranslate }
    }

    fn settings(steps: usize) -> TrainSettings {
        TrainSettings {
            network: UNetConfig { width: 4, levels: 2, patch: 2, activation: Activation::Relu },
            maps: 2,
            labels: LabelSettings { goals: 4, starts: 5, ..LabelSettings::default() },
            steps,
            batch: 2,
            learning_rate: 1e-2,
            checkpoint_steps: 4,
            ..TrainSettings::default()
        }
    }

    #[test]
    fn a_few_seconds_of_training_reduce_the_loss() {
        let mut losses = Vec::new();
        let mut observer = |progress: &TrainProgress| {
            if let TrainProgress::Step { loss, .. } = progress {
                losses.push(*loss);
            }
        };
        train_regions(&robot(), &settings(40), None, &mut observer).unwrap();
        let mean = |values: &[f32]| values.iter().sum::<f32>() / values.len() as f32;
        let (first, last) = (mean(&losses[..5]), mean(&losses[35..]));
        assert!(last < 0.75 * first, "from {first} to {last}");
    }

    #[test]
    fn a_run_that_was_stopped_ends_like_one_that_was_not() {
        let folder = tempfile::tempdir().unwrap();
        let train = |steps, folder: Option<&Path>| {
            train_regions(&robot(), &settings(steps), folder, &mut |_| ()).unwrap()
        };
        // The step size depends on the total, so the stop is made by a panic in the observer.
        let stopped = std::panic::catch_unwind(|| {
            let mut stop = |progress: &TrainProgress| {
                let stop_at = 6;
                assert!(!matches!(progress, TrainProgress::Step { step, .. } if *step == stop_at), "stop");
            };
            train_regions(&robot(), &settings(8), Some(folder.path()), &mut stop).map(drop)
        });
        assert!(stopped.is_err(), "the run was to be stopped");
        let resumed = train(8, Some(folder.path()));
        assert_eq!(resumed.to_bytes(), train(8, None).to_bytes());
    }

    #[test]
    fn useless_settings_are_refused() {
        let refused = TrainSettings { batch: 0, ..settings(1) };
        let error = train_regions(&robot(), &refused, None, &mut |_| ()).unwrap_err();
        assert_eq!(error.to_string(), "training setting batch is 0, must be at least 1");
    }
}
