//! A building learnt once: all its options and hand-overs, before anybody asks for a way.
//!
//! The work falls into small units: an option, or a block of hand-overs. Each depends on nothing but what it drives
//! through, and its random streams are named by that (the hash of the corridor), not by its number. So the library is
//! the same whoever did which unit, in whatever order, however often the work was killed. And on a changed map a unit
//! whose corridor did not change is taken over from the old map: it would come out the same.

use std::collections::{BTreeMap, BTreeSet};

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use sharp_drive::{InitialStates, World};
use sharp_options::OptionId;
use sharp_space::Seed;

use crate::abstraction::Abstraction;
use crate::conditions::Conditions;
use crate::files::{self, FileError};
use crate::hand_over::{DrivenOption, HandOver, Identities, chain_key, drive_hand_over};
use crate::learn::{LearnFailure, LearningTask, LearntPolicy};
use crate::library::{OptionLibrary, StoredOption};
use crate::method::Method;
use crate::roster::{Area, Roster, RosterOption};

/// Options that are learnt before it is asked whether to go on.
const OPTIONS_AT_ONCE: usize = 16;
/// Hand-overs in one file of work that is not finished.
const BLOCK: usize = 64;
/// Initial states of an option.
const STATE_POOL: usize = 128;

/// Where and how options are learnt.
#[derive(Clone, Copy, Debug)]
pub struct LearningSite<'a> {
    /// Map and robot.
    pub world: &'a World,
    /// The states and options of the map.
    pub abstraction: &'a Abstraction,
    /// How options get policies.
    pub method: &'a Method,
    /// Simulator and noise.
    pub conditions: &'a Conditions,
    /// The root of all randomness.
    pub seed: Seed,
}

/// What a library knows of a building beyond single options.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Building {
    pub(crate) format: u32,
    /// The hash of the set of options that it speaks of.
    pub fingerprint: String,
    /// Options without a guide.
    pub unguided: Vec<OptionId>,
    /// What driving from the middle of one option to the middle of the next showed.
    pub hand_overs: Vec<HandOver>,
}

/// Raised whenever the file of a building changes its meaning.
pub(crate) const BUILDING_FORMAT: u32 = 1;

/// Which share of the work is done here: part `index` of `count`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Part {
    /// From 0.
    pub index: usize,
    /// At least 1.
    pub count: usize,
}

impl Part {
    /// All of the work.
    pub const ALL: Self = Self { index: 0, count: 1 };
    /// Nothing of it: what is there is looked at.
    pub const NONE: Self = Self { index: 1, count: 1 };

    const fn has(self, unit: usize) -> bool {
        unit % self.count == self.index
    }
}

/// What is wanted of the learning of a building.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BuildingShare {
    /// Only the options whose both ends lie there, and the hand-overs between them.
    pub within: Option<Area>,
    /// Which part of the options.
    pub options: Part,
    /// Which part of the hand-overs, of those whose options are there.
    pub hand_overs: Part,
}

impl BuildingShare {
    /// The whole building.
    pub const ALL: Self = Self { within: None, options: Part::ALL, hand_overs: Part::ALL };

    /// The part `part` of both options and hand-overs.
    #[must_use]
    pub const fn part(part: Part) -> Self {
        Self { within: None, options: part, hand_overs: part }
    }
}

/// Watches the learning of a building and may stop it. `()` watches nothing.
pub trait BuildingMonitor: Sync {
    /// So many options and hand-overs there are.
    fn planned(&self, _options: usize, _hand_overs: usize) {}
    /// An option is there: learnt now, or before.
    fn option(&self, _option: &RosterOption, _learnt: &LearntPolicy) {}
    /// A hand-over is there: driven now, or before.
    fn hand_over(&self, _hand_over: &HandOver) {}
    /// Asked often; true ends the work. What is finished is kept.
    fn should_stop(&self) -> bool {
        false
    }
}

impl BuildingMonitor for () {}

/// What became of the work.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct BuildingWork {
    /// Options that were learnt now.
    pub learnt: Vec<OptionId>,
    /// Options whose corridor in another map is the same.
    pub adopted: usize,
    /// Options that were there.
    pub kept: usize,
    /// Hand-overs that were driven now, and those that were known.
    pub hand_overs: (usize, usize),
    /// True if nothing is missing.
    pub is_whole: bool,
}

/// What is to be learnt where, and by whom.
#[derive(Clone, Copy)]
pub struct BuildingTask<'a> {
    /// Where and how.
    pub site: &'a LearningSite<'a>,
    /// What there is to learn.
    pub roster: &'a Roster,
    /// What of it is done here.
    pub share: BuildingShare,
    /// Who watches.
    pub monitor: &'a dyn BuildingMonitor,
}

impl std::fmt::Debug for BuildingTask<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("BuildingTask").field("share", &self.share).finish_non_exhaustive()
    }
}

impl BuildingTask<'_> {
    /// Learns the options of this part that `library` lacks.
    ///
    /// # Errors
    /// If the library cannot be written.
    pub fn learn_options(
        &self,
        library: &mut OptionLibrary,
        work: &mut BuildingWork,
    ) -> Result<(), FileError> {
        let Self { site, roster, share, monitor } = *self;
        let mine: Vec<&RosterOption> = roster
            .options
            .iter()
            .enumerate()
            .filter(|(unit, _)| share.options.has(*unit))
            .map(|(_, option)| option)
            .collect();
        for chunk in mine.chunks(OPTIONS_AT_ONCE) {
            let shared = &*library;
            let results: Vec<_> =
                chunk.par_iter().map(|option| obtain(site, shared, option, monitor)).collect();
            let mut is_stopped = false;
            for (option, result) in chunk.iter().zip(results) {
                match result {
                    Obtained::Kept => work.kept += 1,
                    Obtained::Adopted(learnt) => {
                        work.adopted += 1;
                        keep(library, option, learnt)?;
                    }
                    Obtained::Learnt(learnt) => {
                        work.learnt.push(option.id);
                        keep(library, option, learnt)?;
                    }
                    Obtained::Stopped => {
                        is_stopped = true;
                        continue;
                    }
                }
                if let Some(stored) = library.get(option.id) {
                    monitor.option(option, &stored.learnt);
                }
            }
            // Those beside the one that was stopped may be done.
            if is_stopped {
                break;
            }
        }
        Ok(())
    }

    /// The hand-overs of this part that have all they need, driven where nobody did before. Blocks of them are kept until
    /// the building is whole.
    ///
    /// # Errors
    /// If the library cannot be read or written.
    pub fn learn_hand_overs(
        &self,
        library: &mut OptionLibrary,
        work: &mut BuildingWork,
    ) -> Result<(), FileError> {
        let Self { roster, share, monitor, .. } = *self;
        let mut hashed = Identities::default();
        let identities: Vec<Option<String>> =
            roster.options.iter().map(|option| known_identity(library, option, &mut hashed)).collect();
        let known = library.hand_overs_by_key();
        // The blocks of an area are others than those of the building.
        let blocks = match share.within {
            None => roster.fingerprint.clone(),
            Some(area) => {
                format!("{}-{}", roster.fingerprint, &files::hash(format!("{area:?}").as_bytes())[..8])
            }
        };
        let (mut all, mut is_whole) = (Vec::with_capacity(roster.hand_overs.len()), true);
        for (unit, block) in roster.hand_overs.chunks(BLOCK).enumerate() {
            let kept = library.read_block(&blocks, unit)?;
            let kept: BTreeMap<String, HandOver> =
                kept.into_iter().map(|one| (one.key.clone(), one)).collect();
            let wanted: Vec<Option<Wanted>> = block
                .iter()
                .map(|&(before, after)| Wanted::new(roster, &identities, before, after))
                .collect();
            let find = |key: &String| kept.get(key).or_else(|| known.get(key));
            let is_known = wanted.iter().all(|one| one.as_ref().is_some_and(|one| find(&one.key).is_some()));
            if !share.hand_overs.has(unit) && !is_known || monitor.should_stop() {
                is_whole = false;
                continue;
            }
            let shared = &*library;
            let obtain = |one: &Option<Wanted>| -> Option<(bool, HandOver)> {
                let Wanted { chain, key } = one.as_ref()?;
                let found = find(key).map(|found| (false, found.clone()));
                let (is_new, hand_over) = found.or_else(|| Some((true, self.drive(shared, chain, key)?)))?;
                Some((is_new, named(roster, chain, hand_over)))
            };
            let done: Vec<Option<(bool, HandOver)>> = wanted.par_iter().map(obtain).collect();
            is_whole &= done.iter().all(Option::is_some);
            let done: Vec<(bool, HandOver)> = done.into_iter().flatten().collect();
            let fresh = done.iter().filter(|one| one.0).count();
            work.hand_overs.0 += fresh;
            work.hand_overs.1 += done.len() - fresh;
            let done: Vec<HandOver> = done.into_iter().map(|one| one.1).collect();
            done.iter().for_each(|one| monitor.hand_over(one));
            if fresh > 0 {
                library.write_block(&blocks, unit, &done)?;
            }
            all.extend(done);
        }
        work.is_whole = is_whole && identities.iter().all(Option::is_some);
        if work.is_whole {
            let building = Building {
                format: BUILDING_FORMAT,
                fingerprint: roster.fingerprint.clone(),
                unguided: roster.unguided.clone(),
                hand_overs: all,
            };
            library.keep_building(building.with_rest_of(library.building(&roster.fingerprint)), &blocks)?;
        }
        Ok(())
    }

    /// Drives the hand-over of `chain`; `None` while one of its options is not learnt.
    fn drive(&self, library: &OptionLibrary, chain: &[usize], key: &str) -> Option<HandOver> {
        let driven = |&position: &usize| {
            let RosterOption { id, option, .. } = &self.roster.options[position];
            Some(DrivenOption { option, policy: &library.get(*id)?.learnt.policy })
        };
        let driven = chain.iter().map(driven).collect::<Option<Vec<_>>>()?;
        let LearningSite { world, method, conditions, seed, .. } = *self.site;
        let seed = seed.child(&format!("hand-over {key}"), 0);
        let estimate = drive_hand_over((world, conditions, method), &driven, seed);
        Some(HandOver::new(key.to_owned(), estimate))
    }
}

enum Obtained {
    Kept,
    Adopted(LearntPolicy),
    Learnt(LearntPolicy),
    Stopped,
}

fn obtain(
    site: &LearningSite<'_>,
    library: &OptionLibrary,
    option: &RosterOption,
    monitor: &dyn BuildingMonitor,
) -> Obtained {
    if library.get(option.id).is_some_and(|stored| stored.corridor == option.corridor) {
        return Obtained::Kept;
    }
    if monitor.should_stop() {
        return Obtained::Stopped;
    }
    if let Some(stored) = library.adopt(&option.corridor) {
        return Obtained::Adopted(stored.learnt);
    }
    let LearningSite { world, method, conditions, .. } = *site;
    let seed = site.seed.child(&format!("option {}", option.corridor), 0);
    let states =
        InitialStates::of_option(world, &option.option, option.option.guide.start(), STATE_POOL, seed);
    let task = LearningTask {
        world,
        conditions,
        option: &option.option,
        next: None,
        tail: &[],
        states: states.into(),
        wanted_success: method.option_success,
        failure_cost_s: method.failure_cost_s,
        estimate_episodes: method.estimate_episodes,
        seed,
    };
    match method.learner.learn(&task, &|| monitor.should_stop()) {
        Ok(learnt) => Obtained::Learnt(learnt),
        Err(LearnFailure::Stopped) => Obtained::Stopped,
        // Buildings keep no trainings.
        Err(LearnFailure::Broken(_) | LearnFailure::File(_)) => {
            Obtained::Learnt(LearntPolicy::useless(&world.robot))
        }
    }
}

fn keep(library: &mut OptionLibrary, option: &RosterOption, learnt: LearntPolicy) -> Result<(), FileError> {
    let RosterOption { id, option, corridor, .. } = option;
    let stored = StoredOption { guide: option.guide.clone(), learnt, corridor: corridor.clone() };
    library.insert(*id, stored)
}

impl Building {
    /// The same, and what `before` knew of other options: of those outside of the area that was learnt now.
    fn with_rest_of(mut self, before: Option<&Self>) -> Self {
        let Some(before) = before else { return self };
        let pair = |one: &HandOver| (one.before, one.after);
        let here: BTreeSet<_> = self.hand_overs.iter().map(pair).collect();
        self.hand_overs.extend(before.hand_overs.iter().filter(|one| !here.contains(&pair(one))).cloned());
        self.unguided
            .extend(before.unguided.iter().filter(|id| !self.unguided.contains(id)).collect::<Vec<_>>());
        self
    }
}

/// A hand-over that is to be known.
struct Wanted {
    /// Positions in the roster, in the order of driving: the run-up, the first option, the second one.
    chain: Vec<usize>,
    key: String,
}

impl Wanted {
    /// `None` while one of the options is not learnt.
    fn new(roster: &Roster, identities: &[Option<String>], before: usize, after: usize) -> Option<Self> {
        let mut chain = roster.options[before].run_up.clone();
        chain.extend([before, after]);
        let identities = chain.iter().map(|&position| identities[position].as_deref());
        let key = chain_key(&identities.collect::<Option<Vec<_>>>()?);
        Some(Self { chain, key })
    }
}

/// `hand_over` with the names that the options of `chain` have in this building.
fn named(roster: &Roster, chain: &[usize], hand_over: HandOver) -> HandOver {
    let ids: Vec<OptionId> = chain.iter().map(|&position| roster.options[position].id).collect();
    let (run_up, pair) = ids.split_at(ids.len() - 2);
    HandOver { before: pair[0], after: pair[1], run_up: run_up.to_vec(), ..hand_over }
}

fn known_identity(
    library: &OptionLibrary,
    option: &RosterOption,
    identities: &mut Identities,
) -> Option<String> {
    let stored = library.get(option.id).filter(|stored| stored.corridor == option.corridor)?;
    Some(identities.of(&stored.corridor, &stored.learnt.policy))
}

#[cfg(test)]
mod tests {
    use std::fs;
    use std::path::Path;
    use std::sync::atomic::{AtomicUsize, Ordering};

    use sharp_options::OptionKind;
    use sharp_sim::NoiseModel;

    use super::*;
    use crate::test_worlds::world;

    /// A corridor of 30 m with regions all along it, and at its far end, with or without a pillar.
    fn corridor(pillar: bool) -> String {
        let row = |middle: bool, pillar: bool| {
            let mark = |col: usize| match col {
                6 => '0',
                20 => '1',
                34 => '2',
                48 => '3',
                62 => '4',
                _ => '.',
            };
            let cell = |col: usize| match col {
                56..=57 if pillar => '#',
                col if middle => mark(col),
                _ => '.',
            };
            format!("#{}#", (0..74).map(cell).collect::<String>())
        };
        let rows = (0..9).map(|index| row(index == 4, pillar && index >= 7));
        let wall = "#".repeat(76);
        [vec![wall.clone()], rows.collect(), vec![wall]].concat().join("\n")
    }

    /// Stops when it was asked so often.
    struct StopAfter(AtomicUsize);

    impl BuildingMonitor for StopAfter {
        fn should_stop(&self) -> bool {
            let asked = |left: usize| left.checked_sub(1);
            self.0.fetch_update(Ordering::SeqCst, Ordering::SeqCst, asked).is_err()
        }
    }

    /// Learns a corridor into the folder of `map`.
    fn learn(
        root: &Path,
        map: &str,
        pillar: bool,
        part: Part,
        monitor: &dyn BuildingMonitor,
    ) -> BuildingWork {
        let (world, abstraction) = world(&corridor(pillar), OptionKind::Interface);
        let method = Method::fast().with_episodes(50, 50, 50);
        let conditions = Conditions::new(&world, NoiseModel::nominal());
        let site = LearningSite {
            world: &world,
            abstraction: &abstraction,
            method: &method,
            conditions: &conditions,
            seed: Seed(1),
        };
        let roster = Roster::new(&site, None);
        let mut library = OptionLibrary::open(root, map).expect("a sound folder");
        let mut work = BuildingWork::default();
        let task = BuildingTask { site: &site, roster: &roster, share: BuildingShare::part(part), monitor };
        task.learn_options(&mut library, &mut work).expect("written");
        if !monitor.should_stop() {
            task.learn_hand_overs(&mut library, &mut work).expect("written");
        }
        work
    }

    /// The files of a library, by name.
    fn files(root: &Path, map: &str) -> Vec<(String, Vec<u8>)> {
        let entries =
            fs::read_dir(root.join(map)).expect("a folder").map(|entry| entry.expect("a file").path());
        let name = |path: &Path| path.file_name().expect("a name").to_string_lossy().into_owned();
        let mut files: Vec<_> =
            entries.map(|path| (name(&path), fs::read(&path).expect("no folder is left"))).collect();
        files.sort();
        files
    }

    #[test]
    fn a_building_is_the_same_in_one_go_in_parts_and_after_stops() {
        let root = tempfile::tempdir().expect("a folder");
        let whole = learn(root.path(), "w-1-whole", false, Part::ALL, &());
        assert!(whole.is_whole && whole.hand_overs.0 > 3, "{whole:?}");
        let part = |index| learn(root.path(), "x-1-parts", false, Part { index, count: 2 }, &());
        let parts = [part(1), part(0), part(1)];
        assert!(!parts[0].is_whole && parts[2].is_whole, "{parts:?}");
        let mut stops = 0;
        while !learn(root.path(), "y-1-stopped", false, Part::ALL, &StopAfter(AtomicUsize::new(stops)))
            .is_whole
        {
            stops += 1;
            assert!(stops < 50, "it never ends");
        }
        assert!(stops > 0, "it was over before the first stop");
        let expected = files(root.path(), "w-1-whole");
        assert_eq!(files(root.path(), "x-1-parts"), expected);
        assert_eq!(files(root.path(), "y-1-stopped"), expected);
    }

    #[test]
    fn a_changed_map_relearns_what_the_change_touches_and_equals_learning_from_nothing() {
        let root = tempfile::tempdir().expect("a folder");
        let before = learn(root.path(), "w-1-before", false, Part::ALL, &());
        let changed = learn(root.path(), "w-1-changed", true, Part::ALL, &());
        assert!(changed.adopted > 0 && !changed.learnt.is_empty(), "{changed:?}");
        assert!(changed.learnt.len() < before.learnt.len(), "{changed:?}");
        assert!(changed.hand_overs.1 > 0 && changed.hand_overs.0 < before.hand_overs.0, "{changed:?}");
        learn(root.path(), "v-1-afresh", true, Part::ALL, &());
        assert_eq!(files(root.path(), "w-1-changed"), files(root.path(), "v-1-afresh"));
    }
}
