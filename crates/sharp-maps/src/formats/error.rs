//! What can be wrong with a map. Each message names file, field and value, and what is allowed.

use std::io;

use sharp_space::GridError;
use thiserror::Error;

/// Why a map was refused or could not be written.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum MapError {
    /// Neither a file nor the name of an own environment.
    #[error("map {spec:?} is neither a file nor a named map, named maps are {names}")]
    Unknown {
        /// What was asked for.
        spec: String,
        /// The names there are.
        names: String,
    },
    /// The file system refused.
    #[error("{file}: cannot be read: {source}")]
    Read {
        /// The file.
        file: String,
        /// The system's reason.
        source: io::Error,
    },
    /// A folder, a pipe or a device in place of a file.
    #[error("{file}: is {kind}, must be a regular file")]
    NotAFile {
        /// The file.
        file: String,
        /// What it is.
        kind: &'static str,
    },
    /// The file is larger than any map of its kind.
    #[error("{file}: is larger than {limit_bytes} bytes, the most that a {kind} may have")]
    TooLarge {
        /// The file.
        file: String,
        /// What it was read as.
        kind: &'static str,
        /// The limit.
        limit_bytes: u64,
    },
    /// Neither content nor ending is known.
    #[error(
        "{file}: is no map, expected a ROS map (.yaml), a MovingAI map (.map), \
         a floor plan (.ron) or a PNG, PGM or BMP image"
    )]
    UnknownFormat {
        /// The file.
        file: String,
    },
    /// The text cannot be parsed.
    #[error("{file}: {reason}")]
    Syntax {
        /// The file.
        file: String,
        /// Where, and what was expected.
        reason: String,
    },
    /// A field has a value that it may not have.
    #[error("{file}: {field} is {value}, must be {expected}")]
    Field {
        /// The file.
        file: String,
        /// The field.
        field: String,
        /// Its value, or `missing`.
        value: String,
        /// What is allowed.
        expected: String,
    },
    /// The image of a ROS map lies outside the map's folder.
    #[error(
        "{file}: image is {image:?}, must lie inside the map's folder \
         (--allow-outside allows images elsewhere)"
    )]
    ImageOutside {
        /// The map file.
        file: String,
        /// The image as the map names it.
        image: String,
    },
    /// The image of a ROS map is broken.
    #[error("{file}: image is {image:?}, which is refused: {source}")]
    InImage {
        /// The map file.
        file: String,
        /// The image as the map names it.
        image: String,
        /// What is wrong with it.
        source: Box<Self>,
    },
    /// An image cannot be decoded.
    #[error("{file}: {reason}")]
    Image {
        /// The image file.
        file: String,
        /// What is wrong with it.
        reason: String,
    },
    /// The size, the resolution or the origin is out of range.
    #[error("{file}: {source}")]
    Grid {
        /// The file.
        file: String,
        /// What is wrong.
        source: GridError,
    },
    /// A map could not be written.
    #[error("{file}: cannot be written: {source}")]
    Write {
        /// The file.
        file: String,
        /// The system's reason.
        source: io::Error,
    },
}

impl MapError {
    /// A short constant name for programs that read error messages.
    #[must_use]
    pub fn code(&self) -> &'static str {
        match self {
            Self::Unknown { .. } => "MAP_UNKNOWN",
            Self::Read { .. } => "MAP_UNREADABLE",
            Self::NotAFile { .. } => "MAP_NOT_A_FILE",
            Self::TooLarge { .. } => "MAP_TOO_LARGE",
            Self::UnknownFormat { .. } => "MAP_FORMAT",
            Self::Syntax { .. } => "MAP_SYNTAX",
            Self::Field { .. } | Self::Grid { .. } => "MAP_FIELD",
            Self::ImageOutside { .. } => "MAP_IMAGE_OUTSIDE",
            Self::InImage { source, .. } => source.code(),
            Self::Image { .. } => "MAP_IMAGE",
            Self::Write { .. } => "MAP_WRITE",
        }
    }

    pub(crate) fn field(
        file: &str,
        field: impl Into<String>,
        value: impl ToString,
        expected: impl Into<String>,
    ) -> Self {
        Self::Field {
            file: file.to_owned(),
            field: field.into(),
            value: value.to_string(),
            expected: expected.into(),
        }
    }

    pub(crate) fn syntax(file: &str, reason: impl Into<String>) -> Self {
        Self::Syntax { file: file.to_owned(), reason: reason.into() }
    }

    pub(crate) fn image(file: &str, reason: impl Into<String>) -> Self {
        Self::Image { file: file.to_owned(), reason: reason.into() }
    }

    pub(crate) fn grid(file: &str, source: GridError) -> Self {
        Self::Grid { file: file.to_owned(), source }
    }
}
