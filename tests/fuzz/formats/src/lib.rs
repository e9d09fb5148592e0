//! What the fuzz targets share: a folder to put files into, and checksums for files that need one.

mod sound;

use std::fs;
use std::path::PathBuf;
use std::sync::OnceLock;

pub use sound::{Sound, seed, sound};

/// The folder of this process for files; whoever starts it says with `TMPDIR` where, and clears it away.
///
/// # Panics
/// If the folder cannot be made.
pub fn folder() -> &'static PathBuf {
    static FOLDER: OnceLock<PathBuf> = OnceLock::new();
    FOLDER.get_or_init(|| {
        let folder = std::env::temp_dir().join(format!("fuzz-{}", std::process::id()));
        fs::create_dir_all(&folder).expect("a folder for files");
        folder
    })
}

/// Writes `bytes` to the file called `name` and returns its path.
///
/// # Panics
/// If the file cannot be written.
pub fn file(name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder().join(name);
    fs::create_dir_all(path.parent().expect("below the folder")).expect("a folder for the file");
    fs::write(&path, bytes).expect("a file");
    path
}

/// The text of a library's or plan's file under a checksum that fits, whatever stood there before: a fuzzer would never
/// guess one.
pub fn sealed(bytes: &[u8]) -> Option<Vec<u8>> {
    let text = std::str::from_utf8(bytes).ok()?;
    let body = match text.split_once('\n') {
        Some((head, body)) if head.starts_with("// blake3: ") => body,
        _ => text,
    };
    Some(format!("// blake3: {}\n{body}", sharp_plan::hash(body.as_bytes())).into_bytes())
}
