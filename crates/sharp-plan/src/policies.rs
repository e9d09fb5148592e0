//! The policies at hand while a problem is solved: from the library, or learnt now.

use sharp_drive::SuccessEstimate;
use sharp_guide::{GuidedOption, LegId, Role};
use sharp_space::OccupancyGrid;
use std::collections::{BTreeMap, BTreeSet};
use std::path::Path;

use crate::files::{self, FileError};
use crate::learn::LearntPolicy;
use crate::library::{OptionLibrary, StoredOption};

/// Trainings of one option that may come to nothing, each with another seed. After that it counts as impossible.
const TRAININGS_MAX: u32 = 3;

/// Everything with a policy in this problem.
#[derive(Debug)]
pub(crate) struct Policies<'a> {
    library: &'a mut OptionLibrary,
    /// Whether the library gets what is learnt.
    adds: bool,
    /// Legs that only this problem has, and options that changed in it.
    learnt: BTreeMap<LegId, LearntPolicy>,
    /// Options that had no policy before this problem.
    fresh: BTreeSet<LegId>,
}

impl<'a> Policies<'a> {
    /// The policies of `library`.
    pub(crate) const fn new(library: &'a mut OptionLibrary) -> Self {
        Self { library, adds: true, learnt: BTreeMap::new(), fresh: BTreeSet::new() }
    }

    /// Forgets the legs of this problem alone, and leaves the library as it is from now on.
    pub(crate) fn leave_library(&mut self) {
        self.adds = false;
        self.learnt.clear();
    }

    /// The policy of the leg called `id`. One that was trained without a single success is none while it may be trained again.
    pub(crate) fn get(&self, id: LegId) -> Option<&LearntPolicy> {
        let stored = || self.stored(id).filter(|learnt| !may_train_again(learnt));
        self.learnt.get(&id).or_else(stored)
    }

    fn stored(&self, id: LegId) -> Option<&LearntPolicy> {
        let LegId::Option(id) = id else { return None };
        self.library.get(id).map(|stored| &stored.learnt)
    }

    /// How many trainings of the leg called `id` in the library came to nothing.
    pub(crate) fn failed_trainings(&self, id: LegId) -> u32 {
        self.stored(id).map_or(0, LearntPolicy::failed_trainings)
    }

    /// What was measured of the leg called `id`.
    pub(crate) fn estimate(&self, id: LegId) -> Option<SuccessEstimate> {
        self.get(id).map(|learnt| learnt.estimate)
    }

    /// The policy of an option that has one.
    pub(crate) fn learnt(&self, id: LegId) -> &LearntPolicy {
        self.get(id).expect("an option of a plan has a policy")
    }

    /// Whether the policy of the option existed before this problem.
    pub(crate) fn is_reused(&self, id: LegId) -> bool {
        id.role() == Role::Option && !self.fresh.contains(&id)
    }

    /// Notes what was seen of the leg called `id` in this problem.
    pub(crate) fn note(&mut self, id: LegId, estimate: SuccessEstimate) {
        if let Some(learnt) = self.learnt.get_mut(&id) {
            learnt.estimate = estimate;
        }
    }

    /// Takes the policy of `option` from another map of the library where its corridor is the same.
    pub(crate) fn adopt(&mut self, option: &GuidedOption, grid: &OccupancyGrid) -> Result<(), FileError> {
        if self.get(option.id).is_some() || option.id.role() != Role::Option {
            return Ok(());
        }
        let stored = self.library.adopt(&corridor(option, grid));
        if let Some(stored) = stored.filter(|stored| !may_train_again(&stored.learnt)) {
            self.keep(option, stored.learnt, grid)?;
            self.fresh.remove(&option.id);
        }
        Ok(())
    }

    /// Where trainings are kept while they run.
    pub(crate) fn trainings(&self) -> Option<&Path> {
        self.library.trainings()
    }

    /// Notes the file of the training of the leg called `id`, which is finished.
    pub(crate) fn note_training(&mut self, id: LegId, file: &Path) {
        self.library.note_training(id, file);
    }

    /// Keeps what was learnt of `option`, in the library as well if it can be used again.
    pub(crate) fn keep(
        &mut self,
        option: &GuidedOption,
        learnt: LearntPolicy,
        grid: &OccupancyGrid,
    ) -> Result<(), FileError> {
        if self.get(option.id).is_none() {
            self.fresh.insert(option.id);
        }
        // A failed training is kept too: the next one has another seed.
        let is_worth_keeping = learnt.estimate.count.successes > 0 || learnt.training.is_some();
        if let (LegId::Option(id), true) = (option.id, self.adds && is_worth_keeping) {
            let corridor = corridor(option, grid);
            let stored = StoredOption { guide: option.guide.clone(), learnt: learnt.clone(), corridor };
            self.library.insert(id, stored)?;
        }
        self.learnt.insert(option.id, learnt);
        Ok(())
    }
}

/// Whether `learnt` is the result of a training that came to nothing and may be tried again.
fn may_train_again(learnt: &LearntPolicy) -> bool {
    (1..TRAININGS_MAX).contains(&learnt.failed_trainings())
}

/// The hash of all that a policy of `option` depends on.
pub(crate) fn corridor(option: &GuidedOption, grid: &OccupancyGrid) -> String {
    files::hash(&option.corridor(grid))
}
