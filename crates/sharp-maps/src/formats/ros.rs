//! ROS maps: a YAML description beside an image, read as Nav2's map server reads them.
//!
//! The reference is `nav2_map_server/src/map_io.cpp`: which keys there are, in which order the two
//! thresholds apply, what the modes `trinary`, `scale` and `raw` make of a grey value, and that
//! image rows run downwards while grid rows run upwards. Stricter than Nav2 are only the limits on
//! sizes and numbers, the refusal of repeated keys, and where the image may lie.

use std::fs;
use std::path::{Component, Path, PathBuf};

use serde::de::{Deserialize, Deserializer, MapAccess, SeqAccess, Visitor};
use serde_saphyr::Error;
use serde_saphyr::budget::BudgetBreach;
use serde_saphyr::options::{DuplicateKeyPolicy, MergeKeyPolicy, NonFiniteFloatPolicy};
use sharp_space::{GridFrame, Occupancy, OccupancyGrid, Pose};

use super::error::MapError;
use super::files::{self, FileKind};
use super::load::LoadOptions;
use super::picture::{self, GreyImage};

/// What the map saver writes and plain images are read with.
pub(crate) const OCCUPIED_THRESHOLD: f64 = 0.65;
/// Just below 1 - 205/255, so that the grey 205 stays unknown.
pub(crate) const FREE_THRESHOLD: f64 = 0.196;

/// The grey that map savers write for cells that were never observed.
pub(crate) const UNKNOWN_GREY: u8 = 205;

/// Beyond this, a double is too coarse for micrometres, metres.
const ORIGIN_MAX_M: f64 = 1e9;

/// The value of an occupancy message for a cell that was never observed.
const UNKNOWN: i8 = -1;

/// How grey values become occupancy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum GreyMode {
    Trinary,
    Scale,
    Raw,
}

/// The rules by which an image becomes a grid.
#[derive(Clone, Copy, Debug)]
struct GreyRules {
    mode: GreyMode,
    negate: bool,
    occupied_threshold: f64,
    free_threshold: f64,
}

impl GreyRules {
    /// The value 0..=100 or −1 that Nav2 publishes for a grey value.
    fn value_of(&self, grey: u8) -> i8 {
        if self.mode == GreyMode::Raw {
            return if grey <= 100 { grey as i8 } else { UNKNOWN };
        }
        // Single precision, as in Nav2: the comparison at a threshold depends on it.
        let (occupied, free) = (self.occupied_threshold as f32, self.free_threshold as f32);
        let share = f32::from(grey) / 255.0;
        let share = if self.negate { share } else { 1.0 - share };
        // The free threshold is applied last and wins where the thresholds cross.
        if share <= free {
            0
        } else if share >= occupied {
            100
        } else if self.mode == GreyMode::Scale {
            ((share - free) / (occupied - free) * 100.0).round() as i8
        } else {
            UNKNOWN
        }
    }

    /// What a published value means for a robot that must not collide: only a certain 0 is free.
    fn occupancy_of(&self, grey: u8) -> Occupancy {
        match self.value_of(grey) {
            0 => Occupancy::Free,
            100 => Occupancy::Occupied,
            _ => Occupancy::Unknown,
        }
    }
}

/// The keys that a map's YAML may have.
const KEYS: [&str; 7] = ["image", "resolution", "origin", "negate", "occupied_thresh", "free_thresh", "mode"];

/// Everything that the YAML says.
#[derive(Clone, Debug)]
struct RosDescription {
    image: String,
    resolution_m: f64,
    origin: Pose,
    rules: GreyRules,
    /// Keys that no map has; one of them may be `mode`, misspelt.
    unread: Vec<String>,
}

/// Returns true if files that end so are ROS maps.
pub(crate) fn is_ending(ending: &str) -> bool {
    ["yaml", "yml"].iter().any(|known| ending.eq_ignore_ascii_case(known))
}

/// Reads the map described by the YAML file at `path`.
pub(crate) fn load(
    path: &Path,
    options: &LoadOptions,
    warnings: &mut Vec<String>,
) -> Result<OccupancyGrid, MapError> {
    let file = path.display().to_string();
    let (description, picture) = read(path, options, warnings)?;
    warnings.extend(unknown_as_free(&file, &picture, &description.rules));
    to_grid(&file, &picture, &description)
}

/// Reads the frame and the values (-1 or 0 to 100, row-major from the lower left cell) that Nav2 publishes for the map
/// described by the YAML file at `path`.
pub(crate) fn values(
    path: &Path,
    options: &LoadOptions,
    warnings: &mut Vec<String>,
) -> Result<(GridFrame, Vec<i8>), MapError> {
    let file = path.display().to_string();
    let (description, picture) = read(path, options, warnings)?;
    if description.rules.mode == GreyMode::Trinary {
        warnings.push(format!(
            "{file}: is of mode trinary, whose values are 0 and 100 only; the modes scale and raw have those in between"
        ));
    }
    // What is a sound grid has a sound frame.
    let frame = *to_grid(&file, &picture, &description)?.frame();
    let GreyImage { width, grey, transparent, .. } = &picture;
    let transparent = transparent.as_ref().filter(|_| description.rules.mode != GreyMode::Raw);
    let is_transparent = |index: usize| transparent.is_some_and(|transparent| transparent[index]);
    let value =
        |index: usize| if is_transparent(index) { UNKNOWN } else { description.rules.value_of(grey[index]) };
    let rows = (0..picture.height).rev();
    Ok((frame, rows.flat_map(|row| row * width..(row + 1) * width).map(value).collect()))
}

/// Reads the YAML file at `path` and the image that it names.
fn read(
    path: &Path,
    options: &LoadOptions,
    warnings: &mut Vec<String>,
) -> Result<(RosDescription, GreyImage), MapError> {
    let file = path.display().to_string();
    let bytes = files::read(path, FileKind::Text)?;
    let description = describe(&file, files::as_text(&file, &bytes)?)?;
    if let Some(key) = description.unread.first() {
        let others = description.unread.len() - 1;
        let others = if others > 0 { format!(" and {others} more are") } else { " is".to_owned() };
        let key: String = key.chars().take(60).collect();
        warnings
            .push(format!("{file}: unknown key {key:?}{others} ignored; a ROS map has {}", KEYS.join(", ")));
    }
    let GreyRules { occupied_threshold, free_threshold, .. } = description.rules;
    if free_threshold > occupied_threshold {
        warnings.push(format!(
            "{file}: free_thresh {free_threshold} is above occupied_thresh {occupied_threshold}, \
             cells in between count as free"
        ));
    }
    let image = find_image(path, &file, &description.image, options)?;
    let image_file = image.display().to_string();
    let picture = files::read(&image, FileKind::Cells).and_then(|bytes| picture::decode(&image_file, &bytes));
    let picture = picture.map_err(|source| in_image(&file, &description.image, source))?;
    warnings.extend(picture.warning.iter().map(|warning| format!("{image_file}: {warning}")));
    Ok((description, picture))
}

/// The image that the ROS map at `path` (YAML) names; `None` if that is no sound description of a map.
#[must_use]
pub fn image_of(path: &Path) -> Option<PathBuf> {
    let file = path.display().to_string();
    let bytes = files::read(path, FileKind::Text).ok()?;
    let description = describe(&file, files::as_text(&file, &bytes).ok()?).ok()?;
    Some(path.parent()?.join(description.image))
}

/// A warning if the grey that map savers write for unknown cells is there and counts as free.
fn unknown_as_free(file: &str, picture: &GreyImage, rules: &GreyRules) -> Option<String> {
    let counts_as_free =
        rules.mode == GreyMode::Trinary && !rules.negate && rules.value_of(UNKNOWN_GREY) == 0;
    (counts_as_free && picture.grey.contains(&UNKNOWN_GREY)).then(|| {
        format!(
            "{file}: with free_thresh {} the grey {UNKNOWN_GREY} counts as free, map savers write it for unknown cells; \
             {FREE_THRESHOLD} keeps it unknown",
            rules.free_threshold
        )
    })
}

/// An image without a description: white is free, black is occupied, the grey 205 is unknown.
pub(crate) fn plain_grid(
    file: &str,
    picture: &GreyImage,
    resolution_m: f64,
) -> Result<OccupancyGrid, MapError> {
    let rules = GreyRules {
        mode: GreyMode::Trinary,
        negate: false,
        occupied_threshold: OCCUPIED_THRESHOLD,
        free_threshold: FREE_THRESHOLD,
    };
    let origin = Pose::new(0.0, 0.0, 0.0);
    let (image, unread) = (String::new(), Vec::new());
    to_grid(file, picture, &RosDescription { image, resolution_m, origin, rules, unread })
}

fn to_grid(file: &str, picture: &GreyImage, description: &RosDescription) -> Result<OccupancyGrid, MapError> {
    let GreyImage { width, height, grey, transparent, .. } = picture;
    let table: Vec<Occupancy> = (0..=255).map(|grey| description.rules.occupancy_of(grey)).collect();
    // Raw images state values, not looks: transparency means nothing there.
    let transparent = transparent.as_ref().filter(|_| description.rules.mode != GreyMode::Raw);
    let mut cells = Vec::with_capacity(grey.len());
    for row in (0..*height).rev() {
        let row = row * width..(row + 1) * width;
        cells.extend(grey[row.clone()].iter().map(|&grey| table[usize::from(grey)]));
        if let Some(transparent) = transparent {
            let start = cells.len() - width;
            for (cell, &transparent) in cells[start..].iter_mut().zip(&transparent[row]) {
                *cell = if transparent { Occupancy::Unknown } else { *cell };
            }
        }
    }
    let frame = GridFrame {
        origin: description.origin,
        resolution_m: description.resolution_m,
        width: *width,
        height: *height,
    };
    OccupancyGrid::new(frame, cells).map_err(|e| MapError::grid(file, e))
}

/// The image's path, which must be inside the YAML's folder unless allowed otherwise.
fn find_image(yaml: &Path, file: &str, image: &str, options: &LoadOptions) -> Result<PathBuf, MapError> {
    let folder = match yaml.parent() {
        Some(folder) if folder != Path::new("") => folder,
        _ => Path::new("."),
    };
    let path = folder.join(image);
    // Names decide: a link inside the folder was put there by whoever owns the folder, and an installed workspace
    // is made of links.
    let is_inside = matches!((spelt_out(&path), spelt_out(folder)), (Some(path), Some(folder)) if path.starts_with(&folder));
    let resolve = |path: &Path| fs::canonicalize(path).ok();
    let leads_inside = || matches!((resolve(&path), resolve(folder)), (Some(path), Some(folder)) if path.starts_with(&folder));
    if !options.allow_outside && !is_inside && !leads_inside() {
        return Err(MapError::ImageOutside { file: file.to_owned(), image: image.to_owned() });
    }
    Ok(path)
}

/// `path` from the root, without `.` and `..`; links are not followed.
fn spelt_out(path: &Path) -> Option<PathBuf> {
    let mut spelt = PathBuf::new();
    for part in std::path::absolute(path).ok()?.components() {
        match part {
            Component::ParentDir => _ = spelt.pop(),
            part => spelt.push(part),
        }
    }
    Some(spelt)
}

fn in_image(file: &str, image: &str, source: MapError) -> MapError {
    MapError::InImage { file: file.to_owned(), image: image.to_owned(), source: Box::new(source) }
}

fn describe(file: &str, text: &str) -> Result<RosDescription, MapError> {
    let fields = YamlFields { file, entries: parse_yaml(file, text)? };
    let image = fields.text("image", "the path of an image file")?;
    if image.is_empty() || image.contains('\0') {
        return Err(MapError::field(file, "image", format!("{image:?}"), "the path of an image file"));
    }
    let resolution_m = fields.number("resolution", "metres a pixel, from 1e-6 to 1000")?;
    if !(1e-6..=1000.0).contains(&resolution_m) {
        let found = number_text(resolution_m);
        return Err(MapError::field(file, "resolution", found, "metres a pixel, from 1e-6 to 1000"));
    }
    let rules = GreyRules {
        mode: fields.mode()?,
        negate: fields.negate()?,
        occupied_threshold: fields.threshold("occupied_thresh")?,
        free_threshold: fields.threshold("free_thresh")?,
    };
    let keys = fields.entries.iter().map(|(key, _)| key);
    let unread = keys.filter(|key| !KEYS.contains(&key.as_str())).cloned().collect();
    Ok(RosDescription { image, resolution_m, origin: fields.origin()?, rules, unread })
}

/// The entries of the YAML and the file's name for messages.
struct YamlFields<'a> {
    file: &'a str,
    entries: Vec<(String, YamlValue)>,
}

impl YamlFields<'_> {
    fn find(&self, key: &str) -> Option<&YamlValue> {
        self.entries.iter().find(|(name, _)| name == key).map(|(_, node)| node)
    }

    fn error(&self, key: &str, expected: &str) -> MapError {
        let value = self.find(key).map_or_else(|| "missing".to_owned(), YamlValue::describe);
        MapError::field(self.file, key, value, expected)
    }

    fn text(&self, key: &str, expected: &str) -> Result<String, MapError> {
        match self.find(key) {
            Some(YamlValue::Text(text)) => Ok(text.clone()),
            // An image may be called `1`.
            Some(node @ (YamlValue::Int(_) | YamlValue::Float(_) | YamlValue::Bool(_))) => {
                Ok(node.describe())
            }
            _ => Err(self.error(key, expected)),
        }
    }

    fn number(&self, key: &str, expected: &str) -> Result<f64, MapError> {
        self.find(key).and_then(YamlValue::number).ok_or_else(|| self.error(key, expected))
    }

    fn threshold(&self, key: &str) -> Result<f64, MapError> {
        let expected = "a number from 0 to 1";
        let value = self.number(key, expected)?;
        if (0.0..=1.0).contains(&value) { Ok(value) } else { Err(self.error(key, expected)) }
    }

    fn origin(&self) -> Result<Pose, MapError> {
        let error = || self.error("origin", "three finite numbers [x, y, yaw], metres and radians");
        let Some(YamlValue::List(list)) = self.find("origin") else { return Err(error()) };
        let numbers: Vec<f64> = list.iter().filter_map(YamlValue::number).collect();
        match numbers[..] {
            [x, y, yaw] if list.len() == 3 && [x, y, yaw].iter().all(|n| n.abs() <= ORIGIN_MAX_M) => {
                Ok(Pose::new(x, y, yaw))
            }
            _ => Err(error()),
        }
    }

    fn negate(&self) -> Result<bool, MapError> {
        let negate = match self.find("negate") {
            Some(YamlValue::Int(number)) => Some(*number != 0),
            Some(YamlValue::Bool(value)) => Some(*value),
            Some(YamlValue::Text(text)) => match text.to_ascii_lowercase().as_str() {
                "0" | "false" | "no" | "off" | "n" => Some(false),
                "1" | "true" | "yes" | "on" | "y" => Some(true),
                _ => None,
            },
            _ => None,
        };
        negate.ok_or_else(|| self.error("negate", "0, 1, true or false"))
    }

    fn mode(&self) -> Result<GreyMode, MapError> {
        match self.find("mode") {
            None => Ok(GreyMode::Trinary),
            Some(YamlValue::Text(text)) if text == "trinary" => Ok(GreyMode::Trinary),
            Some(YamlValue::Text(text)) if text == "scale" => Ok(GreyMode::Scale),
            Some(YamlValue::Text(text)) if text == "raw" => Ok(GreyMode::Raw),
            Some(_) => Err(self.error("mode", "trinary, scale or raw")),
        }
    }
}

fn parse_yaml(file: &str, text: &str) -> Result<Vec<(String, YamlValue)>, MapError> {
    let options = serde_saphyr::options! {
        // Two orders of magnitude above any real map; aliases serve no purpose in one.
        budget: serde_saphyr::budget! {
            max_events: 2000,
            max_nodes: 1000,
            max_depth: 16,
            max_aliases: 16,
            max_anchors: 16,
            max_documents: 1,
        },
        duplicate_keys: DuplicateKeyPolicy::Error,
        merge_keys: MergeKeyPolicy::AsOrdinary,
        non_finite_float_policy: NonFiniteFloatPolicy::PassThrough,
    };
    let node: YamlValue = serde_saphyr::from_str_with_options(text, options).map_err(|error| {
        let error = error.without_snippet();
        if matches!(error, Error::Budget { breach: BudgetBreach::Documents { .. }, .. }) {
            return MapError::syntax(file, "holds several YAML documents, a ROS map is one");
        }
        MapError::syntax(file, format!("is no valid YAML: {}", error.to_string().replace('\n', " ")))
    })?;
    match node {
        YamlValue::Entries(entries) => Ok(entries),
        _ => Err(MapError::syntax(file, "is no list of `key: value` lines, as a ROS map is")),
    }
}

/// A YAML value of any type, so that a wrong type can be reported with field and value.
#[derive(Clone, Debug, PartialEq)]
enum YamlValue {
    Null,
    Bool(bool),
    Int(i64),
    Float(f64),
    Text(String),
    List(Vec<Self>),
    Entries(Vec<(String, Self)>),
}

impl YamlValue {
    /// The value as a number; quoted numbers count, as they do in Nav2.
    fn number(&self) -> Option<f64> {
        match self {
            Self::Int(value) => Some(*value as f64),
            Self::Float(value) => Some(*value),
            Self::Text(text) => text.trim().parse().ok(),
            _ => None,
        }
    }

    fn describe(&self) -> String {
        match self {
            Self::Null => "empty".to_owned(),
            Self::Bool(value) => value.to_string(),
            Self::Int(value) => value.to_string(),
            Self::Float(value) => number_text(*value),
            Self::Text(text) => format!("{:?}", text.chars().take(60).collect::<String>()),
            Self::List(list) if list.len() <= 8 => {
                format!("[{}]", list.iter().map(Self::describe).collect::<Vec<_>>().join(", "))
            }
            Self::List(list) => format!("a list of {} values", list.len()),
            Self::Entries(_) => "a mapping".to_owned(),
        }
    }
}

/// A number for messages: those that would fill a line with digits have an exponent.
fn number_text(value: f64) -> String {
    let size = value.abs();
    let is_long = size.is_finite() && size != 0.0 && !(1e-15..1e15).contains(&size);
    if is_long { format!("{value:e}") } else { value.to_string() }
}

impl<'de> Deserialize<'de> for YamlValue {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(YamlVisitor)
    }
}

struct YamlVisitor;

impl<'de> Visitor<'de> for YamlVisitor {
    type Value = YamlValue;

    fn expecting(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str("a YAML value")
    }

    fn visit_bool<E>(self, value: bool) -> Result<YamlValue, E> {
        Ok(YamlValue::Bool(value))
    }

    fn visit_i64<E>(self, value: i64) -> Result<YamlValue, E> {
        Ok(YamlValue::Int(value))
    }

    fn visit_u64<E>(self, value: u64) -> Result<YamlValue, E> {
        Ok(i64::try_from(value).map_or(YamlValue::Float(value as f64), YamlValue::Int))
    }

    fn visit_f64<E>(self, value: f64) -> Result<YamlValue, E> {
        Ok(YamlValue::Float(value))
    }

    fn visit_str<E>(self, value: &str) -> Result<YamlValue, E> {
        Ok(YamlValue::Text(value.to_owned()))
    }

    fn visit_unit<E>(self) -> Result<YamlValue, E> {
        Ok(YamlValue::Null)
    }

    fn visit_none<E>(self) -> Result<YamlValue, E> {
        Ok(YamlValue::Null)
    }

    fn visit_some<D: Deserializer<'de>>(self, deserializer: D) -> Result<YamlValue, D::Error> {
        YamlValue::deserialize(deserializer)
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<YamlValue, A::Error> {
        let mut list = Vec::new();
        while let Some(node) = seq.next_element()? {
            list.push(node);
        }
        Ok(YamlValue::List(list))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<YamlValue, A::Error> {
        let mut entries = Vec::new();
        while let Some(entry) = map.next_entry()? {
            entries.push(entry);
        }
        Ok(YamlValue::Entries(entries))
    }
}
