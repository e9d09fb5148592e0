//! The policies at hand while a problem is solved: from the library, or learnt now.

use sharp_guide::{GuidePath, GuidedOption, LegId, Role};
use sharp_space::OccupancyGrid;
use std::collections::{BTreeMap, BTreeSet};

use crate::files::{self, FileError};
use crate::learn::LearntPolicy;
use crate::library::{OptionLibrary, StoredOption};

/// Everything with a policy in this problem.
#[derive(Debug)]
pub(crate) struct Policies<'a> {
    library: &'a mut OptionLibrary,
    learnt: BTreeMap<LegId, LearntPolicy>,
    /// Options whose policy existed before this problem.
    before: BTreeSet<LegId>,
}

impl<'a> Policies<'a> {
    /// The policies of `library`.
    pub(crate) fn new(library: &'a mut OptionLibrary) -> Self {
        let learnt: BTreeMap<LegId, LearntPolicy> =
            library.iter().map(|(id, stored)| (LegId::Option(id), stored.learnt.clone())).collect();
        let before = learnt.keys().copied().collect();
        Self { library, learnt, before }
    }

    /// The guides of `library`.
    pub(crate) fn guides(library: &OptionLibrary) -> Vec<(LegId, GuidePath)> {
        library.iter().map(|(id, stored)| (LegId::Option(id), stored.guide.clone())).collect()
    }

    pub(crate) fn get(&self, id: LegId) -> Option<&LearntPolicy> {
        self.learnt.get(&id)
    }

    /// The policy of an option that has one.
    pub(crate) fn learnt(&self, id: LegId) -> &LearntPolicy {
        &self.learnt[&id]
    }

    /// Whether the policy of the option existed before this problem.
    pub(crate) fn is_reused(&self, id: LegId) -> bool {
        self.before.contains(&id)
    }

    /// Takes the policy of `option` from another map of the library where its corridor is the same.
    pub(crate) fn adopt(&mut self, option: &GuidedOption, grid: &OccupancyGrid) -> Result<(), FileError> {
        if self.learnt.contains_key(&option.id) || option.id.role() != Role::Option {
            return Ok(());
        }
        if let Some(stored) = self.library.adopt(&corridor(option, grid)) {
            self.before.insert(option.id);
            self.keep(option, stored.learnt, grid)?;
        }
        Ok(())
    }

    /// Keeps what was learnt of `option`, in the library as well if it can be used again.
    pub(crate) fn keep(
        &mut self,
        option: &GuidedOption,
        learnt: LearntPolicy,
        grid: &OccupancyGrid,
    ) -> Result<(), FileError> {
        if let (LegId::Option(id), true) = (option.id, learnt.estimate.count.successes > 0) {
            let corridor = corridor(option, grid);
            let stored = StoredOption { guide: option.guide.clone(), learnt: learnt.clone(), corridor };
            self.library.insert(id, stored)?;
        }
        self.learnt.insert(option.id, learnt);
        Ok(())
    }
}

/// The hash of all that a policy of `option` depends on.
pub(crate) fn corridor(option: &GuidedOption, grid: &OccupancyGrid) -> String {
    files::hash(&option.corridor(grid))
}
