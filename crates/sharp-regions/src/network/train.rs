//! Training of the region network for one robot: labels, optimisation, checkpoints.
//!
//! Adam on the weighted logarithmic loss, as in the paper; the step size falls along a cosine.
//! Every map is used in its eight symmetries. Each batch has a random stream of its own, so a run that
//! resumes from its checkpoint ends with the same network as a run that never stopped.

use std::collections::BTreeMap;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use burn::module::Module;
use burn::optim::{AdamConfig, GradientsParams, ModuleOptimizer, OptimizerRecord};
use burn::tensor::{Bytes, Device};
use sharp_maps::FloorplanKind;
use sharp_space::trig;
use thiserror::Error;

use crate::labels::LabelRobot;
use crate::network::batch::batch;
use crate::network::loss::losses;
use crate::network::predictor::RegionPredictor;
use crate::network::samples::{DatasetError, Sample, write_manifest, write_whole};
use crate::network::settings::RegionTrainSettings;
use crate::network::store::{ModelCard, ModelError, extra_bytes, from_bytes, to_bytes};
use crate::network::unet::UNet;
use crate::recipe::{HELD_OUT_KINDS, Recipe, VALIDATION_KINDS};

/// The name of the tensor with the optimiser's state in a checkpoint.
const OPTIMIZER: &str = "optimizer";
/// The name of the tensor with the settings of the run in a checkpoint, as JSON.
const SETTINGS: &str = "settings";

/// A folder with a training run's labels and checkpoint.
#[derive(Clone, Copy, Debug)]
pub struct TrainFolder<'a> {
    /// Where it is; made if it is not there.
    pub path: &'a Path,
    /// Resume from the checkpoint in it instead of starting again. Labels in it are used in both
    /// cases.
    pub resume: bool,
}

/// What training reports while it runs.
#[derive(Clone, Copy, Debug)]
#[non_exhaustive]
pub enum TrainProgress<'a> {
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
        /// The loss before it: what is minimised.
        loss: f32,
        /// Its part from the criticality.
        critical_loss: f32,
        /// Its part from the headings, before it is weighted.
        heading_loss: f32,
        /// The step size.
        learning_rate: f64,
    },
    /// A checkpoint is due; it has been written if there is a folder.
    Checkpoint {
        /// Steps done.
        step: usize,
        /// The network as it is.
        predictor: &'a RegionPredictor,
    },
}

/// Why training stopped without a network.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum RegionTrainError {
    /// A setting is out of range.
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
    /// The loss is not finite.
    #[error("loss is {loss} at step {step}, try a smaller learning rate")]
    Diverged {
        /// The step.
        step: usize,
        /// The loss.
        loss: f32,
    },
    /// Training cannot resume from the checkpoint.
    #[error("checkpoint {path} {reason}; delete it to start over", path = path.display())]
    Checkpoint {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// The observer asked for it.
    #[error("stopped after {step} steps, as asked")]
    Stopped {
        /// Steps done, 0 while maps were labelled.
        step: usize,
    },
}

/// A function that is called for every map, step and checkpoint, and may stop training.
pub type TrainObserver<'a> = dyn FnMut(&TrainProgress<'_>) -> ControlFlow<()> + 'a;

/// Trains a network on the plans of `robot`; `observer` is called for every map, step and checkpoint.
///
/// With a `folder`, labels and checkpoints are kept there, and a run that was stopped can be resumed.
/// A run that the observer stops leaves a checkpoint.
///
/// # Errors
/// Returns an error if a setting is out of range, the folder cannot be written, its checkpoint is
/// damaged or of another run, the loss diverges, or the observer stops the run.
pub fn train_regions(
    robot: &LabelRobot,
    settings: &RegionTrainSettings,
    folder: Option<TrainFolder<'_>>,
    observer: &mut TrainObserver<'_>,
) -> Result<RegionPredictor, RegionTrainError> {
    check(settings)?;
    let samples = label_maps(robot, settings, folder.map(|folder| folder.path), observer)?;
    let checkpoint = folder.map(|folder| folder.path.join("checkpoint.safetensors"));
    let resumed = checkpoint.as_deref().filter(|path| folder.is_some_and(|f| f.resume) && path.exists());
    let mut run = match resumed {
        Some(path) => RegionTraining::resume(robot, settings, path)?,
        None => RegionTraining::start(robot, settings),
    };
    while run.card.steps < settings.steps {
        let progress = run.step(&samples, settings)?;
        let step = run.card.steps;
        let stop = observer(&progress).is_break();
        let is_due = step.is_multiple_of(settings.checkpoint_steps) || step == settings.steps;
        if let Some(path) = checkpoint.as_deref().filter(|_| is_due || stop) {
            run.save(settings, path)?;
        }
        let stop = stop
            || is_due
                && observer(&TrainProgress::Checkpoint { step, predictor: &run.predictor(settings) })
                    .is_break();
        if stop && step < settings.steps {
            return Err(RegionTrainError::Stopped { step });
        }
    }
    Ok(run.predictor(settings))
}

fn check(settings: &RegionTrainSettings) -> Result<(), RegionTrainError> {
    let counts =
        [("maps", settings.maps), ("batch", settings.batch), ("checkpoint_steps", settings.checkpoint_steps)];
    if let Some((field, value)) = counts.into_iter().find(|&(_, value)| value == 0) {
        return Err(RegionTrainError::Setting { field, value });
    }
    if !settings.network.is_sound() {
        return Err(ModelError::Network(settings.network).into());
    }
    Ok(())
}

/// Labels the training maps, or reads those that are already labelled.
fn label_maps(
    robot: &LabelRobot,
    settings: &RegionTrainSettings,
    folder: Option<&Path>,
    observer: &mut TrainObserver<'_>,
) -> Result<Vec<Sample>, RegionTrainError> {
    let is_kept = |kind: &FloorplanKind| HELD_OUT_KINDS.contains(kind) || VALIDATION_KINDS.contains(kind);
    let kinds: Vec<_> = FloorplanKind::ALL.into_iter().filter(|kind| !is_kept(kind)).collect();
    let maps = folder.map(|folder| folder.join("maps"));
    let mut samples = Vec::with_capacity(settings.maps);
    let mut entries = Vec::with_capacity(settings.maps);
    for number in 0..settings.maps {
        let kind = kinds[number % kinds.len()];
        let recipe = Recipe::new(kind, number as u64, robot, settings.labels, settings.seed);
        let sample = match &maps {
            Some(folder) => recipe.load_or_make(robot, folder)?,
            None => recipe.make(robot),
        };
        let solved = sample.labels.solved;
        entries.push(recipe.entry(&sample));
        samples.push(sample);
        if observer(&TrainProgress::Labelled { map: number + 1, of: settings.maps, solved }).is_break() {
            return Err(RegionTrainError::Stopped { step: 0 });
        }
    }
    if let Some(folder) = &maps {
        write_manifest(folder, &entries)?;
    }
    Ok(samples)
}

/// A network in training.
struct RegionTraining {
    network: UNet,
    optimizer: ModuleOptimizer,
    card: ModelCard,
    device: Device,
}

impl RegionTraining {
    fn start(robot: &LabelRobot, settings: &RegionTrainSettings) -> Self {
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
        let network = UNet::init(settings.network, &device, &mut settings.seed.stream("weights", 0));
        Self { network, optimizer: optimizer(), card, device }
    }

    /// Resumes from the checkpoint at `path`.
    fn resume(
        robot: &LabelRobot,
        settings: &RegionTrainSettings,
        path: &Path,
    ) -> Result<Self, RegionTrainError> {
        let refused = |reason: String| RegionTrainError::Checkpoint { path: path.to_owned(), reason };
        let damaged = |error: &dyn std::fmt::Display| refused(format!("is damaged: {error}"));
        let bytes = std::fs::read(path).map_err(|error| refused(format!("cannot be read: {error}")))?;
        let fresh = Self::start(robot, settings);
        let (network, card) = from_bytes(&bytes, &fresh.device).map_err(|error| damaged(&error))?;
        let stored = extra_bytes(&bytes, SETTINGS).map_err(|error| damaged(&error))?;
        if (ModelCard { steps: 0, ..card.clone() }) != fresh.card || stored != as_json(settings) {
            return Err(refused("is of a run with other settings".to_owned()));
        }
        let state = extra_bytes(&bytes, OPTIMIZER).map_err(|error| damaged(&error))?;
        let record = OptimizerRecord::from_bytes(Bytes::from_bytes_vec(state));
        let optimizer = optimizer().load_record(record.map_err(|error| damaged(&error))?);
        Ok(Self { network, optimizer, card, device: fresh.device })
    }

    fn save(&self, settings: &RegionTrainSettings, path: &Path) -> Result<(), RegionTrainError> {
        let state = self.optimizer.into_bytes().expect("a CPU optimiser's state can be read");
        let extra = BTreeMap::from([
            (OPTIMIZER.to_owned(), state.to_vec()),
            (SETTINGS.to_owned(), as_json(settings)),
        ]);
        Ok(write_whole(path, &to_bytes(&self.network, &self.card, &extra))?)
    }

    fn predictor(&self, settings: &RegionTrainSettings) -> RegionPredictor {
        RegionPredictor::new(self.network.valid(), self.card.clone(), settings.device)
    }

    /// One gradient step.
    fn step(
        &mut self,
        samples: &[Sample],
        settings: &RegionTrainSettings,
    ) -> Result<TrainProgress<'static>, RegionTrainError> {
        let step = self.card.steps;
        let mut rng = settings.seed.stream("batch", step as u64);
        let base = settings.device.device();
        let (images, targets) = batch(samples, settings.batch, &base, &mut rng);
        let (critical, heading) =
            losses(self.network.forward(images.to_device(&self.device)), &targets, settings.positive_weight);
        let [critical_loss, heading_loss] = [&critical, &heading].map(|l| l.clone().into_scalar::<f32>());
        let loss = critical + heading * settings.heading_weight;
        let value = loss.clone().into_scalar::<f32>();
        if !value.is_finite() {
            return Err(RegionTrainError::Diverged { step, loss: value });
        }
        let gradients = GradientsParams::from_grads(loss.backward(), &self.network);
        let learning_rate = learning_rate(settings, step);
        self.network = self.optimizer.step(learning_rate, self.network.clone(), gradients);
        self.card.steps += 1;
        let (step, of) = (self.card.steps, settings.steps);
        Ok(TrainProgress::Step { step, of, loss: value, critical_loss, heading_loss, learning_rate })
    }
}

/// All settings that the result depends on; how often it is saved does not count.
fn as_json(settings: &RegionTrainSettings) -> Vec<u8> {
    let settings = RegionTrainSettings { checkpoint_steps: 1, ..settings.clone() };
    serde_json::to_vec(&settings).expect("settings have no keys that are not text")
}

fn optimizer() -> ModuleOptimizer {
    // burn's default of 1e-5 would damp the small gradients of rare critical pixels.
    AdamConfig::new().with_epsilon(1e-8).init()
}

/// A short ramp, then half a cosine down to zero.
fn learning_rate(settings: &RegionTrainSettings, step: usize) -> f64 {
    const RAMP_STEPS: f64 = 20.0;
    let ramp = ((step + 1) as f64 / RAMP_STEPS).min(1.0);
    let share = step as f64 / settings.steps as f64;
    settings.learning_rate * ramp * 0.5 * (1.0 + trig::cos(std::f64::consts::PI * share))
}

#[cfg(test)]
mod tests {
    use rand::RngExt;
    use sharp_motion::Steering;
    use sharp_space::{DistanceField, Footprint, Seed};

    use super::*;
    use crate::labels::LabelSettings;
    use crate::network::unet::{Activation, UNetConfig};
    use crate::{RegionScore, RegionSettings, find_regions, random_regions, score_regions, scoring_maps};

    fn robot() -> LabelRobot {
        let footprint = Footprint::rectangle(0.3, 0.2).unwrap();
        LabelRobot { footprint, steering: Steering::RotateTranslate }
    }

    fn settings(steps: usize) -> RegionTrainSettings {
        RegionTrainSettings {
            network: UNetConfig { width: 4, levels: 2, patch: 2, activation: Activation::Relu },
            maps: 2,
            labels: LabelSettings { goals: 4, starts: 5, ..LabelSettings::default() },
            steps,
            batch: 2,
            learning_rate: 1e-2,
            checkpoint_steps: 4,
            ..RegionTrainSettings::default()
        }
    }

    /// Trains to the end, or until after step `stop`.
    fn train(
        settings: &RegionTrainSettings,
        folder: Option<TrainFolder<'_>>,
        stop: Option<usize>,
    ) -> (Result<RegionPredictor, RegionTrainError>, Vec<f32>) {
        let mut losses = Vec::new();
        let mut observer = |progress: &TrainProgress<'_>| {
            if let TrainProgress::Step { loss, step, .. } = progress {
                losses.push(*loss);
                if Some(*step) == stop {
                    return ControlFlow::Break(());
                }
            }
            ControlFlow::Continue(())
        };
        let outcome = train_regions(&robot(), settings, folder, &mut observer);
        (outcome, losses)
    }

    #[test]
    fn a_few_seconds_of_training_reduce_the_loss() {
        let losses = train(&settings(40), None, None).1;
        let mean = |values: &[f32]| values.iter().sum::<f32>() / values.len() as f32;
        let (first, last) = (mean(&losses[..5]), mean(&losses[35..]));
        assert!(last < 0.75 * first, "from {first} to {last}");
    }

    #[test]
    fn the_tiny_preset_beats_random_regions_on_kinds_it_never_saw() {
        let predictor = train(&RegionTrainSettings::tiny(), None, None).0.unwrap();
        let labels = LabelSettings { goals: 8, starts: 10, ..LabelSettings::default() };
        let mut scores = [Vec::new(), Vec::new()];
        for (index, (grid, labels)) in
            scoring_maps(&HELD_OUT_KINDS, &robot(), labels, Seed(3)).iter().enumerate()
        {
            let clearance = DistanceField::new(grid);
            let heatmap = predictor.heatmap(grid, &clearance);
            let settings = RegionSettings::default();
            let found = find_regions(&heatmap, &clearance, &robot().footprint, &settings);
            let mut rng = Seed(3).stream("random", index as u64);
            let random = random_regions(&clearance, 0.2, found.len(), 0.5, &mut rng);
            scores[0].push(score_regions(&found, grid.frame(), labels));
            scores[1].push(score_regions(&random, grid.frame(), labels));
        }
        let [found, random] = scores.map(|scores| RegionScore::mean(&scores));
        assert!(found.density > 1.5 * random.density, "{found:?} against {random:?}");
        assert!(found.precision > 2.0 * random.precision, "{found:?} against {random:?}");
    }

    #[test]
    fn equal_seeds_give_equal_weights_stopped_anywhere_or_not() {
        let whole = train(&settings(8), None, None).0.unwrap().to_bytes();
        let other = RegionTrainSettings { seed: Seed(2), ..settings(8) };
        assert_ne!(train(&other, None, None).0.unwrap().to_bytes(), whole, "another seed");
        let stop = Seed(77).stream("stop", 0).random_range(1..8);
        let folder = tempfile::tempdir().unwrap();
        let at = |resume| Some(TrainFolder { path: folder.path(), resume });
        let stopped = train(&settings(8), at(false), Some(stop)).0.unwrap_err();
        assert_eq!(stopped.to_string(), format!("stopped after {stop} steps, as asked"));
        let (resumed, losses) = train(&settings(8), at(true), None);
        assert_eq!(losses.len(), 8 - stop, "steps after the stop");
        assert_eq!(resumed.unwrap().to_bytes(), whole, "stopped after {stop} steps");
        let manifest = std::fs::read_to_string(folder.path().join("maps/manifest.json")).unwrap();
        assert!(manifest.contains("map-0001.safetensors"), "{manifest}");
    }

    #[test]
    fn a_checkpoint_that_is_damaged_or_of_another_run_is_refused() {
        let folder = tempfile::tempdir().unwrap();
        let at = |resume| Some(TrainFolder { path: folder.path(), resume });
        train(&settings(4), at(false), None).0.unwrap();
        let refusal =
            |settings: &RegionTrainSettings| train(settings, at(true), None).0.unwrap_err().to_string();
        let other = RegionTrainSettings { learning_rate: 1e-3, ..settings(4) };
        assert!(refusal(&other).contains("is of a run with other settings"), "{}", refusal(&other));
        let path = folder.path().join("checkpoint.safetensors");
        let bytes = std::fs::read(&path).unwrap();
        for length in [0, 100, bytes.len() - 9] {
            std::fs::write(&path, &bytes[..length]).unwrap();
            assert!(refusal(&settings(4)).contains("is damaged"), "cut to {length}");
        }
        // A label file that is damaged is made again: its recipe is known.
        let map = folder.path().join("maps/map-0000.safetensors");
        let labels = std::fs::read(&map).unwrap();
        std::fs::write(&map, b"no safetensors").unwrap();
        train(&settings(4), at(false), None).0.unwrap();
        assert_eq!(std::fs::read(&map).unwrap(), labels, "made again");
    }

    #[test]
    fn settings_out_of_range_are_refused() {
        let refused = RegionTrainSettings { batch: 0, ..settings(1) };
        let error = train(&refused, None, None).0.unwrap_err();
        assert_eq!(error.to_string(), "training setting batch is 0, must be at least 1");
    }
}
