//! Doors of a building as a surveyor lists them: the door files of the BWI code base.
//!
//! A YAML list; of each entry only the two corners of the door and its name are read.

use std::path::Path;

use serde::Deserialize;
use sharp_space::Point;

use super::error::MapError;
use super::files::{self, FileKind};

/// A door in a map.
#[derive(Clone, Debug, PartialEq)]
pub struct Door {
    /// What it is called.
    pub name: String,
    /// The ends of its opening, in the map's world frame.
    pub corners: [Point; 2],
}

impl Door {
    /// The middle of the opening.
    #[must_use]
    pub fn middle(&self) -> Point {
        let [a, b] = self.corners;
        a + (b - a) / 2.0
    }
}

#[derive(Deserialize)]
struct DoorEntry {
    name: String,
    door_corner_pt_1: [f64; 2],
    door_corner_pt_2: [f64; 2],
}

/// Reads the doors in the file at `path`.
///
/// # Errors
/// Returns an error if the file cannot be read, is no list of doors or an empty one, or has a corner
/// that is not finite.
pub fn load_doors(path: &Path) -> Result<Vec<Door>, MapError> {
    let file = path.display().to_string();
    let bytes = files::read(path, FileKind::Text)?;
    parse(&file, files::as_text(&file, &bytes)?)
}

fn parse(file: &str, text: &str) -> Result<Vec<Door>, MapError> {
    let entries: Vec<DoorEntry> = serde_saphyr::from_str(text).map_err(|error| {
        let reason = error.without_snippet().to_string().replace('\n', " ");
        MapError::syntax(file, format!("is no list of doors: {reason}"))
    })?;
    if entries.is_empty() {
        return Err(MapError::syntax(file, "lists no door"));
    }
    entries.into_iter().map(|entry| door(file, entry)).collect()
}

fn door(file: &str, entry: DoorEntry) -> Result<Door, MapError> {
    let DoorEntry { name, door_corner_pt_1: first, door_corner_pt_2: second } = entry;
    if let Some(value) = first.iter().chain(&second).find(|value| !value.is_finite()) {
        return Err(MapError::syntax(file, format!("a corner of door {name:?} is {value}, must be finite")));
    }
    Ok(Door { name, corners: [first, second].map(|[x, y]| Point::new(x, y)) })
}

#[cfg(test)]
mod tests {
    use super::*;

    const ONE: &str = "- name: d1\n  door_corner_pt_1: [1.0, 2]\n  door_corner_pt_2: [3, 2.0]\n";

    #[test]
    fn a_door_has_a_middle_and_other_keys_are_ignored() {
        let doors =
            parse("doors", &format!("{ONE}  approach:\n  - from: l3\n    point: [1, 2, 3]\n")).unwrap();
        assert_eq!(doors.len(), 1, "{doors:?}");
        assert_eq!((doors[0].name.as_str(), doors[0].middle()), ("d1", Point::new(2.0, 2.0)));
    }

    #[test]
    fn broken_lists_are_refused_with_the_reason() {
        let infinite = ONE.replace("[3, 2.0]", "[.inf, 2.0]");
        for (text, expected) in [
            ("name: d1", "is no list of doors"),
            ("[]", "lists no door"),
            ("- name: d1\n  door_corner_pt_1: [1.0, 2]", "door_corner_pt_2"),
            (&ONE.replace("[3, 2.0]", "[3]"), "is no list of doors"),
            (&infinite, "door \"d1\" is inf"),
        ] {
            let message = parse("doors", text).unwrap_err().to_string();
            assert!(message.starts_with("doors: ") && message.contains(expected), "{text:?}: {message}");
        }
    }
}
