//! Training samples: labelled maps, kept on disk so that labelling can be stopped and resumed.
//!
//! One safetensors file a map, named after its number. Each carries the recipe it was made by and a
//! checksum of its tensors; a file whose recipe or checksum does not match is made again.

use std::collections::HashMap;
use std::io::Write;
use std::path::{Path, PathBuf};

use safetensors::tensor::{Dtype, SafeTensors, TensorView, serialize};
use serde::{Deserialize, Serialize};
use sharp_maps::FloorplanKind;
use sharp_space::{DistanceField, GridFrame, Pose};
use thiserror::Error;

use crate::labels::{FINE_BINS, LabelRobot, Labels};
use crate::network::image::Image;
use crate::pixel::PIXEL_M;
use crate::recipe::{FORMAT, Recipe};

/// A labelled map.
#[derive(Clone, Debug)]
pub(crate) struct Sample {
    pub image: Image,
    pub labels: Labels,
}

/// Why a dataset could not be read or written.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum DatasetError {
    /// The file system refused.
    #[error("cannot {action} {path}: {error}", path = path.display())]
    File {
        /// What was tried.
        action: &'static str,
        /// The file or folder.
        path: PathBuf,
        /// The reason.
        error: std::io::Error,
    },
}

impl Recipe {
    /// Makes the sample.
    pub(crate) fn make(&self, robot: &LabelRobot) -> Sample {
        let grid = self.map();
        let image = Image::new(&grid, &DistanceField::new(&grid));
        Sample { image, labels: self.label(&grid, robot) }
    }

    /// The sample from `folder` if it is there and sound, else a new one, which is then stored.
    pub(crate) fn load_or_make(&self, robot: &LabelRobot, folder: &Path) -> Result<Sample, DatasetError> {
        let path = folder.join(self.file_name());
        if let Some(sample) = std::fs::read(&path).ok().and_then(|bytes| self.read(&bytes)) {
            return Ok(sample);
        }
        let sample = self.make(robot);
        write_whole(&path, &self.to_bytes(&sample))?;
        Ok(sample)
    }

    /// The line of the manifest about `sample`.
    pub(crate) fn entry(&self, sample: &Sample) -> DatasetEntry {
        let file = self.file_name();
        let hash = blake3::hash(&self.to_bytes(sample)).to_hex().to_string();
        DatasetEntry { file, kind: self.kind, solved: sample.labels.solved, blake3: hash }
    }

    fn file_name(&self) -> String {
        format!("map-{:04}.safetensors", self.number)
    }

    fn to_bytes(&self, sample: &Sample) -> Vec<u8> {
        let bytes = |plane: &[f32]| plane.iter().flat_map(|v| v.to_le_bytes()).collect::<Vec<u8>>();
        let planes = [
            ("blocked", bytes(&sample.image.blocked)),
            ("clearance", bytes(&sample.image.clearance)),
            ("visits", bytes(&sample.labels.visits)),
        ];
        let frame = &sample.image.frame;
        let shape = vec![frame.height, frame.width];
        let mut views: Vec<_> = planes
            .iter()
            .map(|(name, data)| (*name, TensorView::new(Dtype::F32, shape.clone(), data)))
            .collect();
        let shape = vec![frame.height, frame.width, FINE_BINS];
        views.push(("headings", TensorView::new(Dtype::U8, shape, &sample.labels.headings)));
        let views = views.into_iter().map(|(name, view)| (name, view.expect("one value a pixel")));
        let note = SampleNote {
            recipe: self.clone(),
            solved: sample.labels.solved,
            checksum: checksum(planes.iter().map(|(_, data)| data.as_slice()), &sample.labels.headings),
        };
        let json = serde_json::to_string(&note).expect("a note has no keys that are not text");
        let metadata = HashMap::from([("sharp.sample".to_owned(), json)]);
        serialize(views, Some(metadata)).expect("names are unique")
    }

    /// The sample in `bytes`, or `None` if it is not the one of this recipe or is damaged.
    fn read(&self, bytes: &[u8]) -> Option<Sample> {
        let (_, metadata) = SafeTensors::read_metadata(bytes).ok()?;
        let note: SampleNote =
            serde_json::from_str(metadata.metadata().as_ref()?.get("sharp.sample")?).ok()?;
        let tensors = SafeTensors::deserialize(bytes).ok()?;
        let data = |name| tensors.tensor(name).map(|view| view.data()).ok();
        let planes = [data("blocked")?, data("clearance")?, data("visits")?];
        let headings = data("headings")?;
        if note.recipe != *self || note.checksum != checksum(planes.into_iter(), headings) {
            return None;
        }
        let frame = self.frame();
        let floats = |bytes: &[u8]| -> Option<Vec<f32>> {
            let values: Vec<f32> = bytes.as_chunks::<4>().0.iter().map(|&b| f32::from_le_bytes(b)).collect();
            (values.len() == frame.len()).then_some(values)
        };
        let [blocked, clearance, visits] = planes;
        let image = Image { frame, blocked: floats(blocked)?, clearance: floats(clearance)? };
        let headings = headings.to_vec();
        let labels = Labels { frame, visits: floats(visits)?, headings, solved: note.solved };
        (labels.headings.len() == frame.len() * FINE_BINS).then_some(Sample { image, labels })
    }

    fn frame(&self) -> GridFrame {
        let side = (self.size_m / PIXEL_M).round() as usize;
        GridFrame { origin: Pose::new(0.0, 0.0, 0.0), resolution_m: PIXEL_M, width: side, height: side }
    }
}

/// What the manifest says of a map.
#[derive(Debug, Serialize)]
pub(crate) struct DatasetEntry {
    file: String,
    kind: FloorplanKind,
    solved: usize,
    blake3: String,
}

/// Lists the files of a dataset with their hashes, so that a copy can be checked.
pub(crate) fn write_manifest(folder: &Path, maps: &[DatasetEntry]) -> Result<(), DatasetError> {
    #[derive(Serialize)]
    struct DatasetManifest<'a> {
        format: u32,
        maps: &'a [DatasetEntry],
    }
    let json = serde_json::to_string_pretty(&DatasetManifest { format: FORMAT, maps });
    let json = json.expect("a manifest has no keys that are not text") + "\n";
    write_whole(&folder.join("manifest.json"), json.as_bytes())
}

#[derive(Serialize, Deserialize)]
struct SampleNote {
    recipe: Recipe,
    solved: usize,
    checksum: String,
}

fn checksum<'a>(planes: impl Iterator<Item = &'a [u8]>, headings: &[u8]) -> String {
    let mut hasher = blake3::Hasher::new();
    for plane in planes {
        hasher.update(plane);
    }
    hasher.update(headings);
    hasher.finalize().to_hex().to_string()
}

/// Writes a file under another name and renames it, so that readers see the whole file or none.
pub(crate) fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), DatasetError> {
    let failed = |action| move |error| DatasetError::File { action, path: path.to_owned(), error };
    if let Some(folder) = path.parent() {
        std::fs::create_dir_all(folder).map_err(failed("create the folder of"))?;
    }
    // Two processes that write the same file do not write into one another's.
    let partial = path.with_extension(format!("{}.partial", std::process::id()));
    let mut file = std::fs::File::create(&partial).map_err(failed("write"))?;
    file.write_all(bytes).and_then(|()| file.sync_all()).map_err(failed("write"))?;
    std::fs::rename(&partial, path).map_err(failed("rename"))
}

#[cfg(test)]
mod tests {
    use sharp_motion::Steering;
    use sharp_space::{Footprint, Seed};

    use super::*;
    use crate::labels::LabelSettings;

    fn robot() -> LabelRobot {
        let footprint = Footprint::rectangle(0.3, 0.2).unwrap();
        LabelRobot { footprint, steering: Steering::RotateTranslate }
    }

    fn recipe(seed: Seed) -> Recipe {
        let labels = LabelSettings { goals: 2, starts: 3, ..LabelSettings::default() };
        Recipe::new(FloorplanKind::Gap, 3, &robot(), labels, seed)
    }

    #[test]
    fn samples_survive_a_round_trip_and_damage_is_noticed() {
        let first = recipe(Seed(1));
        let sample = first.make(&robot());
        let bytes = first.to_bytes(&sample);
        let read = first.read(&bytes).expect("an undamaged sample is read");
        assert_eq!(read.labels, sample.labels);
        assert_eq!(read.image.blocked, sample.image.blocked);
        let mut damaged = bytes.clone();
        *damaged.last_mut().unwrap() ^= 1;
        assert!(first.read(&damaged).is_none(), "one bit is wrong");
        assert!(first.read(&bytes[..bytes.len() / 2]).is_none(), "cut in half");
        assert!(recipe(Seed(2)).read(&bytes).is_none(), "made by another recipe");
    }
}
