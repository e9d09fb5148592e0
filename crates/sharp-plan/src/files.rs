//! Files that are never half written and never silently damaged.
//!
//! Text files open with a line `// blake3: <hash of the rest>`; binary files are named by the hash
//! of their content. Both are written to a temporary name in the same folder and then renamed.

use std::fs;
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};

use serde::Serialize;
use serde::de::DeserializeOwned;
use thiserror::Error;

const PREFIX: &str = "// blake3: ";

/// Why a file of a library or a plan could not be used.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum FileError {
    /// The system refused.
    #[error("{}: {source}", path.display())]
    Io {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: std::io::Error,
    },
    /// The content does not match its checksum.
    #[error("{}: damaged: its content does not match its checksum", path.display())]
    Checksum {
        /// The file.
        path: PathBuf,
    },
    /// The content cannot be understood.
    #[error("{}: {problem}", path.display())]
    Content {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        problem: String,
    },
}

impl FileError {
    pub(crate) fn content(path: &Path, problem: impl ToString) -> Self {
        Self::Content { path: path.to_owned(), problem: problem.to_string() }
    }
}

fn io(path: &Path) -> impl FnOnce(std::io::Error) -> FileError {
    let path = path.to_owned();
    |source| FileError::Io { path, source }
}

/// The hash of `bytes` as hexadecimal text.
#[must_use]
pub fn hash(bytes: &[u8]) -> String {
    blake3::hash(bytes).to_hex().to_string()
}

/// Writes `bytes` to `path` so that a reader sees the old content or the new, never a mix. A link stays one, and what is no
/// plain file, as a pipe or `/dev/stdout`, is written into.
///
/// # Errors
/// Returns an error that names the file if the folder cannot be made or written.
pub fn write_atomic(path: &Path, bytes: &[u8]) -> Result<(), FileError> {
    if let Ok(found) = fs::metadata(path) {
        if !found.is_file() && !found.is_dir() {
            let mut target = fs::OpenOptions::new().write(true).open(path).map_err(io(path))?;
            return target.write_all(bytes).map_err(io(path));
        }
        if path.is_symlink() {
            return write_atomic(&fs::canonicalize(path).map_err(io(path))?, bytes);
        }
    }
    let folder = path.parent().unwrap_or(Path::new("."));
    fs::create_dir_all(folder).map_err(io(folder))?;
    let mut builder = tempfile::Builder::new();
    builder.suffix(".tmp");
    // What the user's umask allows, like any other file; temporary files are private by default.
    #[cfg(unix)]
    builder.permissions(std::os::unix::fs::PermissionsExt::from_mode(0o666));
    let mut file = builder.tempfile_in(folder).map_err(io(path))?;
    file.write_all(bytes).and_then(|()| file.as_file().sync_all()).map_err(io(path))?;
    file.persist(path).map_err(|error| io(path)(error.error))?;
    Ok(())
}

/// Writes `bytes` under a line with their checksum.
pub(crate) fn write_under_checksum(path: &Path, bytes: &[u8]) -> Result<(), FileError> {
    write_atomic(path, &[format!("{PREFIX}{}\n", hash(bytes)).as_bytes(), bytes].concat())
}

/// Reads what [`write_under_checksum`] wrote.
pub(crate) fn read_under_checksum(path: &Path) -> Result<Vec<u8>, FileError> {
    let whole = fs::read(path).map_err(io(path))?;
    let end = whole.iter().position(|&byte| byte == b'\n').unwrap_or(whole.len());
    let bytes = whole.get(end + 1..).unwrap_or(&[]);
    if whole[..end] == *format!("{PREFIX}{}", hash(bytes)).as_bytes() {
        return Ok(bytes.to_vec());
    }
    Err(FileError::Checksum { path: path.to_owned() })
}

/// Writes `value` as RON with a checksum.
///
/// # Errors
/// Returns an error that names the file if it cannot be written.
pub fn write_ron<T: Serialize>(path: &Path, value: &T) -> Result<(), FileError> {
    write_atomic(path, ron_text(path, value)?.as_bytes())
}

/// The same, where `owner` is a file that only holds together with what `path` held before: it is removed before
/// anything else is written there.
pub(crate) fn write_ron_under<T: Serialize>(path: &Path, value: &T, owner: &Path) -> Result<(), FileError> {
    let text = ron_text(path, value)?;
    if fs::read(path).is_ok_and(|before| before == text.as_bytes()) {
        return Ok(());
    }
    remove(owner)?;
    write_atomic(path, text.as_bytes())
}

/// Removes the file at `path` if there is one.
pub(crate) fn remove(path: &Path) -> Result<(), FileError> {
    match fs::remove_file(path) {
        Err(error) if error.kind() != ErrorKind::NotFound => Err(io(path)(error)),
        _ => Ok(()),
    }
}

/// `value` as RON under its checksum.
fn ron_text<T: Serialize>(path: &Path, value: &T) -> Result<String, FileError> {
    let config = ron::ser::PrettyConfig::new().depth_limit(3).compact_arrays(true).new_line("\n");
    let text =
        ron::ser::to_string_pretty(value, config).map_err(|error| FileError::content(path, error))? + "\n";
    Ok(format!("{PREFIX}{}\n{text}", hash(text.as_bytes())))
}

/// Reads what [`write_ron`] wrote.
///
/// # Errors
/// Returns an error that names the file if it is missing, damaged or of another shape.
pub fn read_ron<T: DeserializeOwned>(path: &Path) -> Result<T, FileError> {
    let text = String::from_utf8(fs::read(path).map_err(io(path))?)
        .map_err(|_| FileError::Checksum { path: path.to_owned() })?;
    let (head, body) = text.split_once('\n').unwrap_or(("", ""));
    if head.strip_prefix(PREFIX) != Some(hash(body.as_bytes()).as_str()) {
        return Err(FileError::Checksum { path: path.to_owned() });
    }
    if let Some(line) = nan_line(body) {
        return Err(FileError::content(path, format!("line {line} holds NaN, expected numbers")));
    }
    ron::from_str(body).map_err(|error| FileError::content(path, error))
}

/// The first line of the RON text `body` that has NaN for a number, from 2 as the checksum is the first. Nothing that is written
/// holds one, and whoever reads it need not look.
fn nan_line(body: &str) -> Option<usize> {
    let is_nan = |line: &str| {
        // Outside of quotes: a robot may be called NaN.
        let plain = line.split('"').step_by(2);
        let mut words = plain.flat_map(|text| text.split(|c: char| !c.is_alphanumeric() && c != '_'));
        words.any(|word| word == "NaN")
    };
    body.lines().position(is_nan).map(|index| index + 2)
}

/// Writes `bytes` into `folder` under the name of their hash and returns that name.
///
/// # Errors
/// Returns an error that names the file if it cannot be written.
pub(crate) fn write_blob(folder: &Path, bytes: &[u8], ending: &str) -> Result<String, FileError> {
    let name = format!("{}.{ending}", &hash(bytes)[..32]);
    let path = folder.join(&name);
    // A damaged file is written again.
    if fs::read(&path).is_ok_and(|found| found == bytes) {
        return Ok(name);
    }
    write_atomic(&path, bytes)?;
    Ok(name)
}

/// Reads what [`write_blob`] wrote.
///
/// # Errors
/// Returns an error that names the file if it is missing, damaged or not a plain name in `folder`.
pub(crate) fn read_blob(folder: &Path, name: &str) -> Result<Vec<u8>, FileError> {
    let path = folder.join(name);
    let stem = name.split('.').next().unwrap_or("");
    if stem.len() != 32 || !stem.bytes().all(|byte| byte.is_ascii_hexdigit()) || name.contains(['/', '\\']) {
        return Err(FileError::content(&path, "not the name of a weights file"));
    }
    let bytes = fs::read(&path).map_err(io(&path))?;
    if !hash(&bytes).starts_with(stem) {
        return Err(FileError::Checksum { path });
    }
    Ok(bytes)
}

/// Whether a count is left out of a file. Serde asks with a reference.
#[allow(clippy::trivially_copy_pass_by_ref, reason = "serde asks with a reference")]
pub(crate) const fn is_zero(count: &u32) -> bool {
    *count == 0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[cfg(unix)]
    #[test]
    fn links_and_devices_stay_what_they_are() {
        let folder = tempfile::tempdir().unwrap();
        let (file, link) = (folder.path().join("file"), folder.path().join("link"));
        std::os::unix::fs::symlink(&file, &link).unwrap();
        fs::write(&file, "before").unwrap();
        write_atomic(&link, b"after").unwrap();
        assert!(link.is_symlink() && fs::read(&file).unwrap() == b"after");
        let device = folder.path().join("device");
        std::os::unix::fs::symlink("/dev/null", &device).unwrap();
        write_atomic(&device, b"gone").unwrap();
        assert!(device.is_symlink() && !fs::metadata("/dev/null").unwrap().is_file());
    }

    #[test]
    fn every_flipped_byte_is_noticed() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("value.ron");
        write_ron(&path, &vec![1.5, 2.5]).unwrap();
        assert_eq!(read_ron::<Vec<f64>>(&path).unwrap(), [1.5, 2.5]);
        let bytes = fs::read(&path).unwrap();
        for index in 0..bytes.len() {
            let mut damaged = bytes.clone();
            damaged[index] ^= 1;
            fs::write(&path, damaged).unwrap();
            assert!(read_ron::<Vec<f64>>(&path).is_err(), "byte {index} was flipped unnoticed");
        }
        let blob = write_blob(folder.path(), &[1, 2, 3], "bin").unwrap();
        fs::write(folder.path().join(&blob), [1, 2, 4]).unwrap();
        assert!(matches!(read_blob(folder.path(), &blob), Err(FileError::Checksum { .. })), "damaged blob");
        assert!(read_blob(folder.path(), "../../etc/passwd").is_err(), "path traversal");
    }

    /// Fuzzing found it: a plan with NaN for a follower's softness was read, and sent the robot nowhere.
    #[test]
    fn what_holds_no_number_is_refused_under_a_checksum_that_fits() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("value.ron");
        write_ron(&path, &vec![1.5, f64::NAN]).unwrap();
        let error = read_ron::<Vec<f64>>(&path).unwrap_err().to_string();
        assert!(error.contains("value.ron: line 2 holds NaN"), "{error}");
        write_ron(&path, &("NaN, a name", f64::INFINITY)).unwrap();
        assert_eq!(read_ron::<(String, f64)>(&path).unwrap().1, f64::INFINITY, "which is one");
    }

    #[test]
    fn nothing_is_left_behind_when_a_folder_is_read_only() {
        let folder = tempfile::tempdir().unwrap();
        let blocker = folder.path().join("file");
        fs::write(&blocker, "x").unwrap();
        let error = write_atomic(&blocker.join("below"), b"y").unwrap_err();
        assert!(error.to_string().contains("file"), "{error} names the path");
        assert_eq!(fs::read(&blocker).unwrap(), b"x", "the old content stays");
    }
}
