//! The option library: learnt options, kept from one problem to the next.
//!
//! A library folder holds one folder per key (`world-map`: robot, noise, learning mode and format
//! make the world), so that a policy is never used in a world it was not learnt in. Each option is
//! one text file that names its weights by their hash: a reader finds the old option or the new one,
//! never a mix. Options that are saved together are first written to one file, the intent, whose name
//! appears at once: a reader finds all of them or none, wherever the writer was killed. When the map
//! changes, an option whose corridor did not change keeps its policy and its estimate
//! ([`OptionLibrary::adopt`]).

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::sync::{Arc, OnceLock};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use sharp_drive::{
    Follower, NetworkPolicy, OptionPolicy, PolicyInterface, ProfiledFollower, SuccessCount, SuccessEstimate,
    World,
};
use sharp_guide::{GuidePath, LegId};
use sharp_options::OptionId;
use sharp_rl::Actor;
use sharp_sim::{NoiseModel, SimulatorKind};

use crate::building::{BUILDING_FORMAT, Building};
use crate::files::{self, FileError};
use crate::hand_over::HandOver;
use crate::learn::{LearntPolicy, Training};
use crate::method::Method;
use crate::plan_file::{AbstractionFile, map_hash};

/// Raised whenever the files change their meaning.
pub const FORMAT: u32 = 6;
/// How the names of files of whole buildings begin.
const BUILDING: &str = "building-";
/// The folder, beside the options, of trainings that are under way.
const TRAININGS: &str = "training";
/// How the names of intents begin: options that are about to be written, all of them or none.
const INTENT: &str = "saving-";

/// A policy as it stands in a file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub(crate) enum PolicyFile {
    /// A follower needs nothing but its settings.
    Follower(Follower),
    /// Nor does one with a speed profile.
    Profiled(ProfiledFollower),
    /// A network and the file of its weights.
    Network {
        /// What it sees and does.
        interface: PolicyInterface,
        /// File name of the weights, in the same folder.
        weights: String,
    },
}

impl PolicyFile {
    pub(crate) fn save(policy: &OptionPolicy, folder: &Path) -> Result<Self, FileError> {
        Ok(match policy {
            OptionPolicy::Follower(follower) => Self::Follower(*follower),
            OptionPolicy::Profiled(follower) => Self::Profiled(*follower),
            OptionPolicy::Network(NetworkPolicy { interface, actor, .. }) => {
                let bytes = actor.to_bytes(&BTreeMap::new());
                let weights = files::write_blob(folder, &bytes, "safetensors")?;
                Self::Network { interface: *interface, weights }
            }
            OptionPolicy::Custom(policy) => {
                let problem = format!("a policy from outside cannot be stored: {policy:?}");
                return Err(FileError::content(folder, problem));
            }
        })
    }

    pub(crate) fn load(&self, folder: &Path) -> Result<OptionPolicy, FileError> {
        self.load_with(folder, &mut Networks::default())
    }

    /// The same; networks that were read before are taken from `networks`.
    fn load_with(&self, folder: &Path, networks: &mut Networks) -> Result<OptionPolicy, FileError> {
        Ok(match self {
            Self::Follower(follower) => OptionPolicy::Follower(*follower),
            Self::Profiled(follower) => OptionPolicy::Profiled(*follower),
            Self::Network { interface, weights } => {
                if let Some(network) = networks.get(weights) {
                    let fits = network.actor.spec().observation_len == interface.observation_len();
                    if fits {
                        return Ok(OptionPolicy::Network(network.with_interface(*interface)));
                    }
                }
                let bytes = files::read_blob(folder, weights)?;
                let path = folder.join(weights);
                let (actor, _) =
                    Actor::from_bytes(&bytes).map_err(|error| FileError::content(&path, error))?;
                let spec = actor.spec();
                if spec.observation_len != interface.observation_len()
                    || spec.action_len != PolicyInterface::ACTION_LEN
                {
                    return Err(FileError::content(&path, "the network does not fit the policy's interface"));
                }
                let network = NetworkPolicy::new(*interface, Arc::new(actor));
                networks.insert(weights.clone(), network.clone());
                OptionPolicy::Network(network)
            }
        })
    }
}

/// Networks by the names of their weights: the options of a building share few.
type Networks = BTreeMap<String, NetworkPolicy>;

/// An option with its policy and all that was measured of it.
#[derive(Clone, Debug)]
pub struct StoredOption {
    /// Its guide path.
    pub guide: GuidePath,
    /// Its policy with its estimate.
    pub learnt: LearntPolicy,
    /// The hash of all that the two depend on ([`GuidedOption::corridor`](sharp_guide::GuidedOption::corridor)).
    pub corridor: String,
}

#[derive(Clone, Debug, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct OptionFile {
    format: u32,
    id: OptionId,
    corridor: String,
    guide: GuidePath,
    policy: PolicyFile,
    verified: SuccessCount,
    mean_time_s: f64,
    env_steps: u64,
    gradient_steps: u64,
    #[serde(default, skip_serializing_if = "Option::is_none")]
    training: Option<Training>,
}

/// Options that were to be written at once.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct IntentFile {
    format: u32,
    options: Vec<OptionFile>,
}

/// What the policies of a library depend on beside the map: those of two worlds never mix.
#[derive(Clone, Copy, Debug)]
pub struct LibraryKey<'a> {
    /// Map, robot, speed limits and prior.
    pub world: &'a World,
    /// The noise.
    pub noise: &'a NoiseModel,
    /// The simulator of learning.
    pub simulator: SimulatorKind,
    /// Its name tells how policies are learnt.
    pub method: &'a Method,
    /// How the states were made, empty for the usual way: under equal names the options of two ways lead to different
    /// places.
    pub states: &'a str,
}

impl LibraryKey<'_> {
    /// The name of the folder for it: of the world, a hyphen, of the map.
    fn folder_name(&self) -> String {
        let LibraryKey { world, noise, simulator, method, states } = *self;
        let mut conditions = format!("{:?} {noise:?} {} {FORMAT}", world.robot, method.name);
        // The usual simulator is not named, so that libraries from before there was a choice stay valid.
        if simulator != SimulatorKind::Kinematic {
            conditions += &format!(" {simulator:?}");
        }
        // The caution of the prior follows from the cost of a failure, and options keep their guides.
        let usual = Method::by_name(&method.name).unwrap_or_default();
        if method.failure_cost_s.to_bits() != usual.failure_cost_s.to_bits() {
            conditions += &format!(" failure {:?} s", method.failure_cost_s);
        }
        if method.search.guide.planner != usual.search.guide.planner {
            conditions += &format!(" {:?}", method.search.guide.planner);
        }
        // What was trained with other settings is another policy.
        if method.keeps_trainings {
            conditions += &format!(" {:?}", method.learner);
        }
        if let Some(limits) = &world.speed_limits {
            let text = ron::to_string(&**limits).expect("limits are plain numbers");
            conditions += &format!(" {}", files::hash(text.as_bytes()));
        }
        if let Some(prior) = &world.own_prior {
            conditions += &format!(" {}", files::hash(&prior.to_bytes()));
        }
        if !states.is_empty() {
            conditions += &format!(" {states}");
        }
        let conditions = &files::hash(conditions.as_bytes())[..8];
        format!("{}-{conditions}-{}", world.robot.name, &map_hash(&world.grid)[..16])
    }
}

/// Learnt options by name, in memory and, where a folder is given, on disk.
#[derive(Debug, Default)]
pub struct OptionLibrary {
    folder: Option<PathBuf>,
    options: BTreeMap<OptionId, StoredOption>,
    /// What is known of whole buildings, by fingerprint.
    buildings: BTreeMap<String, Building>,
    /// Folders of the same world with other maps.
    other_maps: Vec<PathBuf>,
    /// Their options by corridor with their folders, read when the first option is looked for.
    elsewhere: OnceLock<BTreeMap<String, (PathBuf, OptionFile)>>,
    /// Intents that a killed process left, and the options in them.
    left_behind: Vec<PathBuf>,
    unfinished: BTreeSet<OptionId>,
    /// Changes whenever an option or a building does.
    version: u64,
    /// Options that are to be written by [`OptionLibrary::save`]; `None` where they are written at once.
    unsaved: Option<BTreeSet<OptionId>>,
    /// Where trainings are kept while they run.
    trainings: Option<PathBuf>,
    /// Those that were finished in this problem.
    trained: Vec<(LegId, PathBuf)>,
    /// Those that nothing needs once all is saved.
    obsolete: Vec<PathBuf>,
}

impl OptionLibrary {
    /// A library that lives as long as the process.
    #[must_use]
    pub fn in_memory() -> Self {
        Self::default()
    }

    /// Opens the part of the library at `root` that belongs to `key`, empty if there is none yet. The
    /// name of the world ends at the last hyphen of `key`, the map's follows.
    ///
    /// # Errors
    /// Returns an error that names the file that is damaged or of another format.
    pub fn open(root: &Path, key: &str) -> Result<Self, FileError> {
        let folder = root.join(key);
        let mut files = BTreeMap::new();
        // Whoever saves meanwhile has an intent before, or after, or both.
        let before = read_intents(&folder)?;
        let read: Vec<_> = option_files(&folder)?.par_iter().map(|path| read_option(path)).collect();
        for file in read {
            let file = file?;
            files.insert(file.id, file);
        }
        let after = read_intents(&folder)?;
        let left_behind: Vec<PathBuf> = after.iter().map(|(path, _)| path.clone()).collect();
        let unfinished = after.iter().flat_map(|(_, options)| options).map(|file| file.id).collect();
        files.extend(
            before.into_iter().chain(after).flat_map(|(_, options)| options).map(|file| (file.id, file)),
        );
        let mut networks = Networks::new();
        let load = |(id, file)| Ok((id, load_option(file, &folder, &mut networks)?));
        let options = files.into_iter().map(load).collect::<Result<_, FileError>>()?;
        let buildings = read_buildings(&folder)?;
        let other_maps = folders_elsewhere(root, key);
        let folder = Some(folder);
        Ok(Self { folder, options, buildings, other_maps, left_behind, unfinished, ..Self::default() })
    }

    /// Opens the part of the library at `root` for the world that `key` names. Options learnt in one world say nothing
    /// about another.
    ///
    /// # Errors
    /// Returns an error that names the file that is damaged or of another format.
    pub fn open_for(root: &Path, key: &LibraryKey<'_>) -> Result<Self, FileError> {
        let name = key.folder_name();
        let mut library = Self::open(root, &name)?;
        if key.method.keeps_trainings {
            library.trainings = Some(root.join(name).join(TRAININGS));
        }
        library.defer();
        Ok(library)
    }

    /// The same, while its trainings are kept below `root` in a folder of the world that `key` names. Otherwise those of a
    /// library that was [opened](Self::open_for) lie beside its options, and those of one in memory are not kept.
    #[must_use]
    pub fn with_trainings(self, root: &Path, key: &LibraryKey<'_>) -> Self {
        let trainings = key.method.keeps_trainings.then(|| root.join(key.folder_name()));
        Self { trainings, ..self }
    }

    /// Where trainings are kept while they run.
    pub(crate) fn trainings(&self) -> Option<&Path> {
        self.trainings.as_deref()
    }

    /// Notes the file of a training that was finished in this problem.
    pub(crate) fn note_training(&mut self, id: LegId, file: &Path) {
        self.trained.push((id, file.to_owned()));
    }

    /// The problem has ended. Once all is saved nothing needs the trainings of a problem that is solved. Of another one only
    /// those that the files of this library do not hold: whoever tries again goes on with them.
    pub(crate) fn end_problem(&mut self, is_solved: bool) {
        for (id, file) in std::mem::take(&mut self.trained) {
            let is_stored = matches!(id, LegId::Option(id) if self.options.contains_key(&id));
            if is_solved || (is_stored && self.folder.is_some()) {
                self.obsolete.push(file);
            }
        }
    }

    /// From now on what is inserted reaches the disk with [`save`](Self::save) only: whoever is killed
    /// before that begins anew from the same library, and so comes to the same plan.
    fn defer(&mut self) {
        self.unsaved.get_or_insert_default();
    }

    /// From now on what is inserted is written at once, and what was not written yet is written now.
    ///
    /// # Errors
    /// Returns an error that names the file that could not be written.
    pub fn save_at_once(&mut self) -> Result<(), FileError> {
        self.save()?;
        self.unsaved = None;
        Ok(())
    }

    /// Writes what was inserted and is not on disk yet, all of it or nothing: whoever is killed here leaves a library with
    /// all these options or with none.
    ///
    /// # Errors
    /// Returns an error that names the file that could not be written; what is not on disk stays unsaved.
    pub fn save(&mut self) -> Result<(), FileError> {
        let unsaved: BTreeSet<OptionId> =
            self.unsaved.iter().flatten().chain(&self.unfinished).copied().collect();
        if let (Some(folder), true) = (&self.folder, unsaved.len() > 1 || !self.left_behind.is_empty()) {
            let files = unsaved.iter().map(|&id| option_file(id, &self.options[&id], folder));
            let intent = IntentFile { format: FORMAT, options: files.collect::<Result<_, _>>()? };
            let path = intent_path(folder, &intent)?;
            files::write_ron(&path, &intent)?;
            // It holds what the older ones hold, or something newer.
            for older in std::mem::replace(&mut self.left_behind, vec![path]) {
                files::remove(&older)?;
            }
        }
        for id in unsaved {
            self.write(id, &self.options[&id])?;
        }
        for intent in std::mem::take(&mut self.left_behind) {
            files::remove(&intent)?;
        }
        self.unfinished.clear();
        self.unsaved.iter_mut().for_each(BTreeSet::clear);
        for training in std::mem::take(&mut self.obsolete) {
            files::remove(&training)?;
        }
        // Others may be at work there: only what is empty goes.
        for folder in self.trainings.iter().flat_map(|folder| folder.ancestors().take(2)) {
            _ = std::fs::remove_dir(folder);
        }
        Ok(())
    }

    /// The option that was learnt in the same world with another map, in a corridor that is the same
    /// cell by cell. Damaged files of other maps are passed over.
    #[must_use]
    pub fn adopt(&self, corridor: &str) -> Option<StoredOption> {
        let (folder, file) = self.elsewhere.get_or_init(|| files_in(&self.other_maps)).get(corridor)?;
        load_option(file.clone(), folder, &mut Networks::new()).ok()
    }

    /// What is known of the building whose options have this fingerprint.
    #[must_use]
    pub fn building(&self, fingerprint: &str) -> Option<&Building> {
        self.buildings.get(fingerprint)
    }

    /// All hand-overs that were driven in this map.
    pub fn hand_overs(&self) -> impl Iterator<Item = &HandOver> {
        self.buildings.values().flat_map(|building| &building.hand_overs)
    }

    /// All hand-overs that were driven in this world, in this map or another, by key. Damaged files of other maps are
    /// passed over.
    pub(crate) fn hand_overs_by_key(&self) -> BTreeMap<String, HandOver> {
        let elsewhere = self.other_maps.iter().filter_map(|folder| read_buildings(folder).ok());
        let elsewhere = elsewhere.flat_map(BTreeMap::into_values).flat_map(|building| building.hand_overs);
        elsewhere.chain(self.hand_overs().cloned()).map(|one| (one.key.clone(), one)).collect()
    }

    /// Reads the abstractions that are kept beside the options of the world `key` and verifies their checksums; returns how
    /// many there are.
    ///
    /// # Errors
    /// Returns an error that names the damaged file.
    pub fn check_abstractions(root: &Path, key: &str) -> Result<usize, FileError> {
        let paths = files_named(&root.join(key), |name| name.starts_with("abstraction-"))?;
        paths.iter().try_for_each(|path| files::read_ron::<AbstractionFile>(path).map(drop))?;
        Ok(paths.len())
    }

    /// Keeps what is known of a building, on disk first, and clears the blocks of `work` away.
    pub(crate) fn keep_building(&mut self, building: Building, work: &str) -> Result<(), FileError> {
        let fingerprint = building.fingerprint.clone();
        if self.buildings.get(&fingerprint) != Some(&building) {
            if let Some(folder) = &self.folder {
                files::write_ron(&folder.join(building_file(&fingerprint)), &building)?;
            }
            self.buildings.insert(fingerprint, building);
            self.version += 1;
        }
        if let Some(folder) = self.folder.as_ref().map(|folder| folder.join(blocks_folder(work))) {
            // Blocks that stay behind are read and found to be the same.
            let _ = std::fs::remove_dir_all(folder);
        }
        Ok(())
    }

    /// The hand-overs of block number `unit` of `work`, none if nobody did it.
    pub(crate) fn read_block(&self, work: &str, unit: usize) -> Result<Vec<HandOver>, FileError> {
        let path = self.folder.as_ref().map(|folder| block_file(folder, work, unit));
        path.filter(|path| path.exists()).map_or(Ok(vec![]), |path| files::read_ron(&path))
    }

    /// Keeps the hand-overs of block number `unit` of `work` until that is done.
    pub(crate) fn write_block(&self, work: &str, unit: usize, block: &[HandOver]) -> Result<(), FileError> {
        let Some(folder) = &self.folder else { return Ok(()) };
        files::write_ron(&block_file(folder, work, unit), &block)
    }

    /// A number that changes whenever an option or a building does.
    pub(crate) const fn version(&self) -> u64 {
        self.version
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

    /// Adds or replaces the option called `id`, on disk first unless the method saves at the end only.
    ///
    /// # Errors
    /// Returns an error that names the file that could not be written; memory is unchanged then.
    pub fn insert(&mut self, id: OptionId, option: StoredOption) -> Result<(), FileError> {
        match &mut self.unsaved {
            Some(unsaved) => _ = unsaved.insert(id),
            None => {
                // An intent that stayed would speak against it.
                if !self.left_behind.is_empty() {
                    self.save()?;
                }
                self.write(id, &option)?;
            }
        }
        self.options.insert(id, option);
        self.version += 1;
        Ok(())
    }

    fn write(&self, id: OptionId, option: &StoredOption) -> Result<(), FileError> {
        if let Some(folder) = &self.folder {
            files::write_ron(&folder.join(file_name(id)), &option_file(id, option, folder)?)?;
        }
        Ok(())
    }
}

/// The file of `option`, whose weights are written into `folder`.
fn option_file(id: OptionId, option: &StoredOption, folder: &Path) -> Result<OptionFile, FileError> {
    Ok(OptionFile {
        format: FORMAT,
        id,
        corridor: option.corridor.clone(),
        guide: option.guide.clone(),
        policy: PolicyFile::save(&option.learnt.policy, folder)?,
        verified: option.learnt.estimate.count,
        mean_time_s: option.learnt.estimate.mean_time_s,
        env_steps: option.learnt.env_steps,
        gradient_steps: option.learnt.gradient_steps,
        training: option.learnt.training.clone(),
    })
}

/// The option file at `path`.
fn read_option(path: &Path) -> Result<OptionFile, FileError> {
    let file: OptionFile = files::read_ron(path)?;
    check_format(path, file.format)?;
    if path.file_name() != Some(file_name(file.id).as_ref()) {
        return Err(FileError::content(path, format!("holds the option {}", file.id)));
    }
    Ok(file)
}

fn check_format(path: &Path, format: u32) -> Result<(), FileError> {
    let problem = || format!("format is {format}, expected {FORMAT}");
    if format == FORMAT { Ok(()) } else { Err(FileError::content(path, problem())) }
}

/// The intents in `folder`, the oldest first.
fn intent_files(folder: &Path) -> Result<Vec<PathBuf>, FileError> {
    files_named(folder, |name| name.starts_with(INTENT))
}

/// The intents in `folder`, the oldest first, with their options. Those whose writers end meanwhile are left out.
fn read_intents(folder: &Path) -> Result<Vec<(PathBuf, Vec<OptionFile>)>, FileError> {
    let mut intents = Vec::new();
    for path in intent_files(folder)? {
        match files::read_ron::<IntentFile>(&path) {
            Ok(file) => {
                check_format(&path, file.format)?;
                intents.push((path, file.options));
            }
            Err(_) if !path.exists() => {}
            Err(error) => return Err(error),
        }
    }
    Ok(intents)
}

/// Where `intent` is written in `folder`: after those that are there, and apart from those of other writers.
fn intent_path(folder: &Path, intent: &IntentFile) -> Result<PathBuf, FileError> {
    let number = |path: &PathBuf| {
        let name = path.file_name()?.to_str()?.strip_prefix(INTENT)?;
        name.split('-').next()?.parse::<u32>().ok()
    };
    let last = intent_files(folder)?.iter().filter_map(number).max().unwrap_or(0);
    let text = ron::to_string(intent).map_err(|error| FileError::content(folder, error))?;
    Ok(folder.join(format!("{INTENT}{:06}-{}.ron", last + 1, &files::hash(text.as_bytes())[..8])))
}

fn file_name(id: OptionId) -> String {
    format!("{}.ron", id.to_string().replace(':', "_"))
}

fn option_files(folder: &Path) -> Result<Vec<PathBuf>, FileError> {
    let is_option = |name: &str| {
        let mut bytes = name.bytes();
        bytes.next().is_some_and(|family| family.is_ascii_lowercase()) && bytes.next() == Some(b'_')
    };
    files_named(folder, is_option)
}

/// The RON files in `folder` whose names `is_wanted`, sorted; none if there is no such folder.
fn files_named(folder: &Path, is_wanted: impl Fn(&str) -> bool) -> Result<Vec<PathBuf>, FileError> {
    if !folder.exists() {
        return Ok(vec![]);
    }
    let error = |source| FileError::Io { path: folder.to_owned(), source };
    let mut paths = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(error)? {
        let path = entry.map_err(error)?.path();
        let name = path.file_name().and_then(|name| name.to_str()).unwrap_or("");
        if name.ends_with(".ron") && is_wanted(name) {
            paths.push(path);
        }
    }
    paths.sort();
    Ok(paths)
}

fn load_option(file: OptionFile, folder: &Path, networks: &mut Networks) -> Result<StoredOption, FileError> {
    let learnt = LearntPolicy {
        policy: file.policy.load_with(folder, networks)?,
        estimate: SuccessEstimate { count: file.verified, mean_time_s: file.mean_time_s },
        env_steps: file.env_steps,
        gradient_steps: file.gradient_steps,
        training: file.training,
    };
    Ok(StoredOption { guide: file.guide, learnt, corridor: file.corridor })
}

fn building_file(fingerprint: &str) -> String {
    format!("{BUILDING}{fingerprint}.ron")
}

fn blocks_folder(work: &str) -> String {
    format!("hand-overs-{work}")
}

fn block_file(folder: &Path, work: &str, unit: usize) -> PathBuf {
    folder.join(blocks_folder(work)).join(format!("{unit:05}.ron"))
}

/// What the files of whole buildings in `folder` say, by fingerprint.
fn read_buildings(folder: &Path) -> Result<BTreeMap<String, Building>, FileError> {
    let mut buildings = BTreeMap::new();
    for path in files_named(folder, |name| name.starts_with(BUILDING))? {
        let building: Building = files::read_ron(&path)?;
        if building.format != BUILDING_FORMAT {
            let problem = format!("format is {}, expected {BUILDING_FORMAT}", building.format);
            return Err(FileError::content(&path, problem));
        }
        buildings.insert(building.fingerprint.clone(), building);
    }
    Ok(buildings)
}

/// The folders of the world of `key` with other maps.
fn folders_elsewhere(root: &Path, key: &str) -> Vec<PathBuf> {
    let Some((world, _)) = key.rsplit_once('-') else { return vec![] };
    let folders = std::fs::read_dir(root).into_iter().flatten().flatten();
    let mut folders: Vec<PathBuf> = folders
        .filter(|entry| {
            let name = entry.file_name();
            let name = name.to_string_lossy();
            name != key && name.rsplit_once('-').is_some_and(|(other, _)| other == world)
        })
        .map(|entry| entry.path())
        .collect();
    folders.sort();
    folders
}

/// The options in `folders` by corridor, with their folders. Damaged files are passed over.
fn files_in(folders: &[PathBuf]) -> BTreeMap<String, (PathBuf, OptionFile)> {
    let of_folder = |folder: &PathBuf| {
        let single = option_files(folder).into_iter().flatten().filter_map(|path| read_option(&path).ok());
        let together = read_intents(folder).into_iter().flatten().flat_map(|(_, options)| options);
        // What is about to be written stands in for what is there.
        let newest = single.chain(together).map(|file| (file.id, file)).collect::<BTreeMap<_, _>>();
        let folder = folder.clone();
        newest.into_values().map(move |file| (file.corridor.clone(), (folder.clone(), file)))
    };
    folders.iter().flat_map(of_folder).collect()
}

#[cfg(test)]
mod tests {
    use std::fs;

    use sharp_rbvd::StateId;
    use sharp_rl::EnvironmentSpec;
    use sharp_sim::RobotModel;
    use sharp_space::Seed;

    use super::*;
    use crate::test_worlds::straight;

    const TO_ONE: OptionId = OptionId::Centroid { from: StateId(0), to: StateId(1) };
    const TO_TWO: OptionId = OptionId::Centroid { from: StateId(1), to: StateId(2) };

    fn stored(policy: OptionPolicy) -> StoredOption {
        let count = SuccessCount { episodes: 1000, successes: 990 };
        let estimate = SuccessEstimate { count, mean_time_s: 4.5 };
        let untrained = LearntPolicy::untrained(policy, estimate);
        let learnt = LearntPolicy { env_steps: 600, gradient_steps: 300, ..untrained };
        StoredOption { guide: straight((0.0, 0.0), (2.0, 0.0)), learnt, corridor: "c".repeat(8) }
    }

    fn follower() -> OptionPolicy {
        OptionPolicy::Follower(Follower::cautious(&RobotModel::husky()))
    }

    fn network() -> OptionPolicy {
        let interface = PolicyInterface::Absolute { reach_m: 0.5 };
        let spec = EnvironmentSpec { observation_len: interface.observation_len(), action_len: 2 };
        let actor = Actor::new(spec, &[8, 8], &mut Seed(1).stream("actor", 0));
        OptionPolicy::Network(NetworkPolicy::new(interface, Arc::new(actor)))
    }

    /// A library of a follower and a network on disk.
    fn library(root: &Path) -> OptionLibrary {
        let mut library = OptionLibrary::open(root, "here").unwrap();
        library.insert(TO_ONE, stored(follower())).unwrap();
        library.insert(TO_TWO, stored(network())).unwrap();
        library
    }

    fn weights(root: &Path) -> PathBuf {
        let mut files = fs::read_dir(root.join("here")).unwrap().map(|entry| entry.unwrap().path());
        files.find(|path| path.extension().is_some_and(|ending| ending == "safetensors")).unwrap()
    }

    #[test]
    fn options_survive_a_round_trip() {
        let root = tempfile::tempdir().unwrap();
        let library = library(root.path());
        let opened = OptionLibrary::open(root.path(), "here").unwrap();
        assert_eq!(opened.iter().map(|(id, _)| id).collect::<Vec<_>>(), [TO_ONE, TO_TWO], "by name");
        for (id, option) in library.iter() {
            let read = opened.get(id).unwrap();
            assert_eq!(read.guide, option.guide, "{id}");
            let numbers = |learnt: &LearntPolicy| (learnt.estimate, learnt.env_steps);
            assert_eq!(numbers(&read.learnt), numbers(&option.learnt), "{id}");
            match (&read.learnt.policy, &option.learnt.policy) {
                (OptionPolicy::Follower(read), OptionPolicy::Follower(written)) => assert_eq!(read, written),
                (OptionPolicy::Network(read), OptionPolicy::Network(written)) => {
                    assert_eq!(read.actor, written.actor);
                }
                (read, written) => panic!("{id}: {written:?} became {read:?}"),
            }
        }
        assert!(
            OptionLibrary::open(root.path(), "elsewhere").unwrap().is_empty(),
            "another key, another world"
        );
    }

    #[test]
    fn options_of_other_families_are_read_again() {
        let root = tempfile::tempdir().unwrap();
        let steps = OptionId::Custom { family: 'w', from: StateId(0), to: StateId(2), number: 0 };
        OptionLibrary::open(root.path(), "here").unwrap().insert(steps, stored(follower())).unwrap();
        let opened = OptionLibrary::open(root.path(), "here").unwrap();
        assert_eq!(opened.iter().map(|(id, _)| id).collect::<Vec<_>>(), [steps]);
    }

    #[test]
    fn what_decides_policies_and_guides_decides_the_folder() {
        let (world, _) =
            crate::test_worlds::world(crate::test_worlds::HALL, sharp_options::OptionKind::Centroid);
        let (noise, simulator) = (NoiseModel::nominal(), SimulatorKind::Kinematic);
        let name = |method: &Method| {
            LibraryKey { world: &world, noise: &noise, simulator, method, states: "" }.folder_name()
        };
        let usual = Method::fast();
        assert_eq!(name(&usual), name(&usual.clone().composed()), "answers come from what was learnt");
        let careful = Method { failure_cost_s: 33_000.0, ..usual.clone() };
        let others = [careful, usual.clone().with_learn_and_link(), Method::paper()];
        assert!(others.iter().all(|other| name(other) != name(&usual)));
    }

    #[test]
    fn an_option_is_adopted_where_world_and_corridor_are_the_same() {
        let root = tempfile::tempdir().unwrap();
        let mut library = OptionLibrary::open(root.path(), "husky-1-mapa").unwrap();
        library.insert(TO_ONE, stored(network())).unwrap();
        let adopts = |key: &str, corridor: &str| {
            OptionLibrary::open(root.path(), key).unwrap().adopt(corridor).is_some()
        };
        assert!(adopts("husky-1-mapb", "cccccccc"), "another map, the same corridor");
        assert!(!adopts("husky-1-mapb", "cccccccd"), "another corridor");
        assert!(!adopts("husky-2-mapb", "cccccccc"), "another world");
        let file = root.path().join("husky-1-mapa/c_0-1.ron");
        let text = fs::read_to_string(&file).unwrap().replace("episodes:1000", "episodes:1001");
        fs::write(&file, text.replace("episodes: 1000", "episodes: 1001")).unwrap();
        assert!(!adopts("husky-1-mapb", "cccccccc"), "a damaged file of another map is passed over");
    }

    #[test]
    fn damage_is_named_with_its_file() {
        let root = tempfile::tempdir().unwrap();
        library(root.path());
        let refused = || OptionLibrary::open(root.path(), "here").unwrap_err().to_string();
        let weights = weights(root.path());
        let sound = fs::read(&weights).unwrap();
        fs::write(&weights, &sound[..sound.len() - 1]).unwrap();
        assert!(refused().contains(&*weights.to_string_lossy()), "{}", refused());
        fs::remove_file(&weights).unwrap();
        assert!(refused().contains(&*weights.to_string_lossy()), "{}", refused());
        fs::write(&weights, sound).unwrap();

        let option = root.path().join("here/c_0-1.ron");
        fs::rename(&option, root.path().join("here/c_5-6.ron")).unwrap();
        assert!(refused().contains("c_5-6.ron: holds the option c:0-1"), "{}", refused());
        fs::rename(root.path().join("here/c_5-6.ron"), &option).unwrap();
        assert_eq!(OptionLibrary::open(root.path(), "here").unwrap().len(), 2, "all is well again");
    }

    #[test]
    fn options_that_are_saved_together_appear_together() {
        let root = tempfile::tempdir().unwrap();
        let here = root.path().join("w-1-here");
        let mut library = OptionLibrary::open(root.path(), "w-1-here").unwrap();
        library.defer();
        library.insert(TO_ONE, stored(follower())).unwrap();
        library.insert(TO_TWO, stored(network())).unwrap();
        // A folder in the place of the second file ends the saving half-way, as a kill would.
        fs::create_dir_all(here.join("c_1-2.ron/in_the_way")).unwrap();
        assert!(library.save().is_err());
        fs::remove_dir_all(here.join("c_1-2.ron")).unwrap();
        assert!(here.join("c_0-1.ron").exists() && !here.join("c_1-2.ron").exists(), "half of the files");
        let corridor = "c".repeat(8);
        let elsewhere = OptionLibrary::open(root.path(), "w-1-there").unwrap();
        assert!(elsewhere.adopt(&corridor).is_some(), "another map sees it");

        let mut opened = OptionLibrary::open(root.path(), "w-1-here").unwrap();
        assert_eq!(opened.len(), 2, "all of them are there");
        let mut newer = stored(follower());
        newer.learnt.env_steps = 7;
        opened.insert(TO_ONE, newer).unwrap();
        opened.save().unwrap();
        assert!(intent_files(&here).unwrap().is_empty(), "nothing is left to do");
        let again = OptionLibrary::open(root.path(), "w-1-here").unwrap();
        assert_eq!((again.len(), again.get(TO_ONE).unwrap().learnt.env_steps), (2, 7), "the newest");
    }

    #[test]
    fn what_an_interrupted_write_leaves_is_ignored() {
        let root = tempfile::tempdir().unwrap();
        library(root.path());
        fs::write(root.path().join("here/.half.tmp"), "c").unwrap();
        assert_eq!(
            OptionLibrary::open(root.path(), "here").unwrap().len(),
            2,
            "temporary files are no options"
        );
    }
}
