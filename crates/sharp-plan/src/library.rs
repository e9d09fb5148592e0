//! The option library: learnt options, kept from one problem to the next.
//!
//! A library folder holds one folder per key (map, robot, noise, learning mode and format, hashed),
//! so that a policy is never used in a world it was not learnt in. Each option is one text file that
//! names its weights by their hash: a reader finds the old option or the new one, never a mix.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};
use sharp_guide::GuidePath;
use sharp_options::OptionId;
use sharp_rl::Actor;

use crate::files::{self, FileError};
use crate::learn::Learnt;
use crate::policy::{Follower, Form, OptionPolicy};
use crate::stats::Tally;

/// Raised whenever the files change their meaning.
pub const FORMAT: u32 = 1;

/// A policy as it stands in a file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) enum PolicyFile {
    /// A follower needs nothing but its settings.
    Follower(Follower),
    /// A learnt policy and the file of its weights.
    Learnt {
        /// What it sees and does.
        form: Form,
        /// File name of the weights, in the same folder.
        weights: String,
    },
}

impl PolicyFile {
    pub(crate) fn save(policy: &OptionPolicy, folder: &Path) -> Result<Self, FileError> {
        Ok(match policy {
            OptionPolicy::Follower(follower) => Self::Follower(*follower),
            OptionPolicy::Learnt { form, actor } => {
                let bytes = actor.to_bytes(&BTreeMap::new());
                Self::Learnt { form: *form, weights: files::write_blob(folder, &bytes, "safetensors")? }
            }
        })
    }

    pub(crate) fn load(&self, folder: &Path) -> Result<OptionPolicy, FileError> {
        Ok(match self {
            Self::Follower(follower) => OptionPolicy::Follower(*follower),
            Self::Learnt { form, weights } => {
                let bytes = files::read_blob(folder, weights)?;
                let path = folder.join(weights);
                let (actor, _) =
                    Actor::from_bytes(&bytes).map_err(|error| FileError::content(&path, error))?;
                let spec = actor.spec();
                if spec.observation_len != form.observation_len() || spec.action_len != 2 {
                    return Err(FileError::content(&path, "the network does not fit the policy's form"));
                }
                OptionPolicy::Learnt { form: *form, actor: Box::new(actor) }
            }
        })
    }
}

/// An option with its policy and all that was measured of it.
#[derive(Clone, Debug)]
pub struct StoredOption {
    /// Its guide path.
    pub guide: GuidePath,
    /// Its policy with its certificate.
    pub learnt: Learnt,
}

#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct OptionFile {
    format: u32,
    id: OptionId,
    guide: GuidePath,
    policy: PolicyFile,
    verified: Tally,
    mean_time_s: f64,
    env_steps: u64,
    gradient_steps: u64,
}

/// Learnt options by name, in memory and, where a folder is given, on disk.
#[derive(Debug, Default)]
pub struct OptionLibrary {
    folder: Option<PathBuf>,
    options: BTreeMap<OptionId, StoredOption>,
}

impl OptionLibrary {
    /// A library that lives as long as the process.
    #[must_use]
    pub fn in_memory() -> Self {
        Self::default()
    }

    /// Opens the part of the library at `root` that belongs to `key`, empty if there is none yet.
    ///
    /// # Errors
    /// Returns an error that names the file that is damaged or of another format.
    pub fn open(root: &Path, key: &str) -> Result<Self, FileError> {
        let folder = root.join(key);
        let mut options = BTreeMap::new();
        for path in option_files(&folder)? {
            let file: OptionFile = files::read_ron(&path)?;
            if file.format != FORMAT {
                return Err(FileError::content(
                    &path,
                    format!("format is {}, expected {FORMAT}", file.format),
                ));
            }
            if path.file_name() != Some(file_name(file.id).as_ref()) {
                return Err(FileError::content(&path, format!("holds the option {}", file.id)));
            }
            options.insert(file.id, load_option(file, &folder)?);
        }
        Ok(Self { folder: Some(folder), options })
    }

    /// The folder of its files, if it has one.
    #[must_use]
    pub fn folder(&self) -> Option<&Path> {
        self.folder.as_deref()
    }

    /// The option called `id`, if it was learnt.
    #[must_use]
    pub fn get(&self, id: OptionId) -> Option<&StoredOption> {
        self.options.get(&id)
    }

    /// All learnt options, by name.
    pub fn iter(&self) -> impl Iterator<Item = (OptionId, &StoredOption)> {
        self.options.iter().map(|(&id, option)| (id, option))
    }

    /// The number of learnt options.
    #[must_use]
    pub fn len(&self) -> usize {
        self.options.len()
    }

    /// Returns true if nothing was learnt yet.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.options.is_empty()
    }

    /// Adds or replaces the option called `id`, on disk first.
    ///
    /// # Errors
    /// Returns an error that names the file that could not be written; memory is unchanged then.
    pub fn insert(&mut self, id: OptionId, option: StoredOption) -> Result<(), FileError> {
        if let Some(folder) = &self.folder {
            let file = OptionFile {
                format: FORMAT,
                id,
                guide: option.guide.clone(),
                policy: PolicyFile::save(&option.learnt.policy, folder)?,
                verified: option.learnt.verified,
                mean_time_s: option.learnt.mean_time_s,
                env_steps: option.learnt.env_steps,
                gradient_steps: option.learnt.gradient_steps,
            };
            files::write_ron(&folder.join(file_name(id)), &file)?;
        }
        self.options.insert(id, option);
        Ok(())
    }
}

fn file_name(id: OptionId) -> String {
    format!("{}.ron", id.to_string().replace(':', "_"))
}

fn option_files(folder: &Path) -> Result<Vec<PathBuf>, FileError> {
    if !folder.exists() {
        return Ok(vec![]);
    }
    let error = |source| FileError::Io { path: folder.to_owned(), source };
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(error)? {
        let path = entry.map_err(error)?.path();
        let name = path.file_name().and_then(|name| name.to_str()).unwrap_or("");
        if name.ends_with(".ron") && (name.starts_with("c_") || name.starts_with("i_")) {
            paths.push(path);
        }
    }
    paths.sort();
    Ok(paths)
}

fn load_option(file: OptionFile, folder: &Path) -> Result<StoredOption, FileError> {
    let learnt = Learnt {
        policy: file.policy.load(folder)?,
        verified: file.verified,
        mean_time_s: file.mean_time_s,
        env_steps: file.env_steps,
        gradient_steps: file.gradient_steps,
    };
    Ok(StoredOption { guide: file.guide, learnt })
}
