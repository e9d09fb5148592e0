//! From what the user typed to a grid. Content and ending of the file decide what kind of map it is.

use std::fs;
use std::path::{Path, PathBuf};

use serde::Deserialize;
use sharp_space::{Cell, GridFrame, OccupancyGrid, Point, Pose};

use super::error::MapError;
use super::files::{self, FileKind};
use super::{floor_plan, movingai, named, picture, ros};

/// The side length above which Nav2 refuses a map.
pub(crate) const SIDE_MAX: usize = 32_767;

/// 8192 x 8192 cells: 409 m at 0.05 m a cell. Larger maps cost gigabytes further on.
pub(crate) const CELLS_MAX: usize = 1 << 26;

/// How to read a map.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct LoadOptions {
    /// Metres a cell, for files that do not say: `MovingAI` maps (1.0 if `None`) and plain images
    /// (required).
    pub resolution_m: Option<f64>,
    /// Takes unknown cells as free.
    pub unknown_free: bool,
    /// Lets a ROS map name an image outside its own folder.
    pub allow_outside: bool,
}

/// A problem posed in an environment: a start and a goal.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Problem {
    /// Where the robot starts.
    pub start: Pose,
    /// Where it must arrive.
    pub goal: Pose,
}

/// A map as it was read.
#[derive(Clone, Debug, PartialEq)]
pub struct MapFile {
    /// The letter of an own environment, otherwise the file's name without its ending.
    pub name: String,
    /// What is free.
    pub grid: OccupancyGrid,
    /// The problems posed in an own environment; none for files.
    pub problems: Vec<Problem>,
    /// What was accepted but is probably a mistake, one sentence each.
    pub warnings: Vec<String>,
    /// The cells as they were read, whatever was done to the grid since: pixels are counted in them.
    pub picture: GridFrame,
}

impl MapFile {
    /// The place of the middle of a pixel, counted from the upper left corner of the picture that was read; `None`
    /// outside.
    #[must_use]
    pub fn pixel(&self, col: usize, row: usize) -> Option<Point> {
        let frame = &self.picture;
        let inside = col < frame.width && row < frame.height;
        inside.then(|| frame.center(Cell::new(col, frame.height - 1 - row)))
    }
}

/// Reads the map that `spec` names: an own environment (see [`named_maps`](crate::named_maps)) or
/// else the path of a file.
///
/// # Errors
/// Returns an error if there is no such map or its file is broken, too large, or names an image
/// that may not be read.
pub fn load(spec: &str, options: &LoadOptions) -> Result<MapFile, MapError> {
    let mut map = match named::find(spec) {
        Some(map) => map?,
        None => load_file(spec, options)?,
    };
    if options.unknown_free {
        map.grid = map.grid.with_unknown_free();
    }
    Ok(map)
}

fn load_file(spec: &str, options: &LoadOptions) -> Result<MapFile, MapError> {
    let path = Path::new(spec);
    let looks_like_a_name = !spec.contains(['/', '\\', '.']);
    if looks_like_a_name && !path.exists() {
        let names = named::named_maps().collect::<Vec<_>>().join(", ");
        return Err(MapError::Unknown { spec: spec.to_owned(), names });
    }
    let mut warnings = Vec::new();
    let ending = path.extension().map(|e| e.to_string_lossy().to_ascii_lowercase()).unwrap_or_default();
    let grid = match ending.as_str() {
        ending if ros::is_ending(ending) => ros::load(path, options, &mut warnings)?,
        "ron" => {
            let bytes = files::read(path, FileKind::Text)?;
            floor_plan::parse(spec, files::as_text(spec, &bytes)?)?
        }
        _ => load_cells(spec, &ending, options, &mut warnings)?,
    };
    if (ros::is_ending(&ending) || ending == "ron") && options.resolution_m.is_some() {
        warnings.push(format!("{spec}: states its own resolution, the given one is not used"));
    }
    let name = path.file_stem().map(|stem| stem.to_string_lossy().into_owned()).unwrap_or_default();
    let picture = *grid.frame();
    Ok(MapFile { name, grid, problems: Vec::new(), warnings, picture })
}

/// The ROS map beside `image` that has the same stem and names it.
fn described_by(image: &Path) -> Option<PathBuf> {
    let named = |yaml: &PathBuf| ros::image_of(yaml).is_some_and(|named| is_same_file(&named, image));
    ["yaml", "yml"].map(|ending| image.with_extension(ending)).into_iter().find(named)
}

fn is_same_file(a: &Path, b: &Path) -> bool {
    let real = |path: &Path| fs::canonicalize(path).ok();
    real(a).is_some_and(|a| real(b).is_some_and(|b| a == b))
}

/// Images and `MovingAI` maps: files that hold the cells themselves.
fn load_cells(
    spec: &str,
    ending: &str,
    options: &LoadOptions,
    warnings: &mut Vec<String>,
) -> Result<OccupancyGrid, MapError> {
    let bytes = files::read(Path::new(spec), FileKind::Cells)?;
    if picture::is_picture(&bytes) {
        if let (None, Some(yaml)) = (options.resolution_m, described_by(Path::new(spec))) {
            warnings.push(format!("{spec}: read as {} beside it says", yaml.display()));
            return ros::load(&yaml, options, warnings);
        }
        let expected =
            "given in metres a pixel, as a plain image does not state it and no .yaml beside it does";
        let resolution_m =
            options.resolution_m.ok_or_else(|| MapError::field(spec, "resolution", "missing", expected))?;
        let picture = picture::decode(spec, &bytes)?;
        warnings.extend(picture.warning.iter().map(|warning| format!("{spec}: {warning}")));
        return ros::plain_grid(spec, &picture, resolution_m);
    }
    if ending == "map" || bytes.starts_with(b"type ") {
        return movingai::parse(spec, files::as_text(spec, &bytes)?, options.resolution_m.unwrap_or(1.0));
    }
    if matches!(ending, "png" | "pgm" | "pnm" | "pbm" | "ppm" | "bmp") {
        return Err(MapError::image(spec, "is no PNG, PGM or BMP image: its first bytes are unknown"));
    }
    Err(MapError::UnknownFormat { file: spec.to_owned() })
}

/// Refuses sizes that cannot be a map before any memory is spent on them.
pub(crate) fn check_size(file: &str, width: usize, height: usize) -> Result<(), MapError> {
    let side = 1..=SIDE_MAX;
    if side.contains(&width) && side.contains(&height) && width * height <= CELLS_MAX {
        return Ok(());
    }
    Err(MapError::field(
        file,
        "size",
        format!("{width} x {height}"),
        format!("1 to {SIDE_MAX} cells a side and at most {CELLS_MAX} in all"),
    ))
}
