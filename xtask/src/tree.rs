//! The files of the repository, read once.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use anyhow::Context;

/// Names of folders that are not part of the repository.
pub(crate) const FOREIGN: [&str; 3] = [".git", "target", "out"];

/// The root of the workspace: the parent of this package's folder.
pub(crate) fn root() -> PathBuf {
    // Cargo says at run time where it found the package; the place of the build may be another
    // checkout that shares the target folder.
    let folder = std::env::var_os("CARGO_MANIFEST_DIR");
    let folder = folder.map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")), PathBuf::from);
    folder.parent().expect("xtask lies in the workspace").to_owned()
}

/// All files by their path from the root, with `/` between parts; files that are not text are empty.
#[derive(Debug)]
pub(crate) struct Tree {
    /// Path to text.
    pub(crate) files: BTreeMap<String, String>,
}

impl Tree {
    /// Reads the repository.
    ///
    /// # Errors
    /// Returns an error that names a file or folder that cannot be read.
    pub(crate) fn load() -> anyhow::Result<Self> {
        let mut files = BTreeMap::new();
        visit(&root(), "", &mut files)?;
        Ok(Self { files })
    }

    /// A tree of the given files, for tests.
    #[cfg(test)]
    pub(crate) fn of(files: &[(&str, &str)]) -> Self {
        Self { files: files.iter().map(|(path, text)| ((*path).into(), (*text).into())).collect() }
    }

    /// The files whose path begins with `prefix` and ends with `suffix`.
    pub(crate) fn matching<'a>(
        &'a self,
        prefix: &'a str,
        suffix: &'a str,
    ) -> impl Iterator<Item = (&'a str, &'a str)> {
        let files = self.files.iter().map(|(path, text)| (path.as_str(), text.as_str()));
        files.filter(move |(path, _)| path.starts_with(prefix) && path.ends_with(suffix))
    }

    /// Returns true if `path`, or anything inside a folder of that name, exists at the root or below.
    pub(crate) fn has(&self, path: &str) -> bool {
        let wanted = format!("/{}/", path.trim_start_matches("./").trim_matches('/'));
        self.files.keys().any(|file| format!("/{file}/").contains(&wanted))
    }
}

fn visit(folder: &Path, prefix: &str, files: &mut BTreeMap<String, String>) -> anyhow::Result<()> {
    let entries = fs::read_dir(folder).with_context(|| format!("cannot list {}", folder.display()))?;
    for entry in entries {
        let entry = entry.with_context(|| format!("cannot list {}", folder.display()))?;
        let name = entry.file_name().to_string_lossy().into_owned();
        let path = format!("{prefix}{name}");
        let kind = entry.file_type().with_context(|| format!("cannot inspect {path}"))?;
        if kind.is_dir() && !FOREIGN.contains(&name.as_str()) {
            visit(&entry.path(), &format!("{path}/"), files)?;
        } else if kind.is_file() {
            let bytes = fs::read(entry.path()).with_context(|| format!("cannot read {path}"))?;
            files.insert(path, String::from_utf8(bytes).unwrap_or_default());
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn paths_are_found_whole_only() {
        let tree = Tree::of(&[("crates/sharp-space/src/pose.rs", "")]);
        for path in ["pose.rs", "src/pose.rs", "crates/sharp-space/", "./crates", "sharp-space/src"] {
            assert!(tree.has(path), "{path}");
        }
        for path in ["ose.rs", "crates/sharp", "src/pose", "pose.md"] {
            assert!(!tree.has(path), "{path}");
        }
    }
}
