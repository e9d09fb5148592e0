//! Reading files that may come from anywhere: regular files only, and never more bytes than a limit.

use std::fs::{self, File, FileType};
use std::io::Read;
use std::path::Path;

use super::error::MapError;

/// What a file is read as, with the most bytes that makes sense for it.
#[derive(Clone, Copy, Debug)]
pub(crate) enum FileKind {
    /// YAML or RON: a person wrote it.
    Text,
    /// An image or a `MovingAI` map: a cell or more for every few bytes.
    Cells,
}

impl FileKind {
    const fn limit_bytes(self) -> u64 {
        match self {
            // Map descriptions have some hundred bytes, large floor plans some ten thousand.
            Self::Text => 1 << 18,
            // Twice the bytes of the largest grey image that is accepted.
            Self::Cells => 1 << 27,
        }
    }

    const fn name(self) -> &'static str {
        match self {
            Self::Text => "map description",
            Self::Cells => "map image",
        }
    }
}

/// Reads a regular file of at most the kind's limit.
///
/// The file's type is looked at before it is opened, because opening a pipe waits for its writer.
pub(crate) fn read(path: &Path, kind: FileKind) -> Result<Vec<u8>, MapError> {
    let file = path.display().to_string();
    let unreadable = |source| MapError::Read { file: file.clone(), source };
    let metadata = fs::metadata(path).map_err(unreadable)?;
    if !metadata.is_file() {
        return Err(MapError::NotAFile { file, kind: type_name(metadata.file_type()) });
    }
    let limit_bytes = kind.limit_bytes();
    let mut bytes = Vec::new();
    if metadata.len() <= limit_bytes {
        let opened = File::open(path).map_err(unreadable)?;
        // The length of a growing or a special file cannot be trusted.
        opened.take(limit_bytes + 1).read_to_end(&mut bytes).map_err(unreadable)?;
    }
    if metadata.len().max(bytes.len() as u64) > limit_bytes {
        return Err(MapError::TooLarge { file, kind: kind.name(), limit_bytes });
    }
    Ok(bytes)
}

/// The text of `bytes` without its byte order mark.
pub(crate) fn as_text<'a>(file: &str, bytes: &'a [u8]) -> Result<&'a str, MapError> {
    let text = std::str::from_utf8(bytes)
        .map_err(|e| MapError::syntax(file, format!("byte {} is not UTF-8 text", e.valid_up_to())))?;
    Ok(text.strip_prefix('\u{feff}').unwrap_or(text))
}

fn type_name(file_type: FileType) -> &'static str {
    if file_type.is_dir() { "a folder" } else { "a pipe, socket or device" }
}
