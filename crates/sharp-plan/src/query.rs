//! Problems, and how solving them may be watched.

use serde::{Deserialize, Serialize};
use sharp_guide::GuidedOption;
use sharp_rl::Progress;
use sharp_space::Pose;

use crate::learn::{LearningMonitor, LearntPolicy};

/// Where a plan begins and ends.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Query {
    /// The initial configuration `x_i`.
    pub start: Pose,
    /// The goal configuration `x_g`; its heading is free.
    pub goal: Pose,
}

/// What the solver is busy with; a new phase ends the one before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Phase {
    /// Predicting critical regions.
    Regions,
    /// Building the diagram and synthesising options.
    Abstraction,
    /// A* over options.
    Search,
    /// The guides that the search asked for.
    Guide,
    /// Learning the policies of this many options.
    Learn(usize),
    /// Running the whole plan, and repairing weak options.
    Verify,
    /// Finished.
    Done,
}

/// Watches the solver and may stop it. `()` watches nothing.
pub trait Monitor: Sync {
    /// A phase begins.
    fn phase(&self, _phase: Phase) {}
    /// The training of an option took a step; several options may train at once.
    fn trained(&self, _option: &GuidedOption, _progress: &Progress<'_>) {}
    /// An option was learnt.
    fn learnt(&self, _option: &GuidedOption, _learnt: &LearntPolicy) {}
    /// Asked often; true ends the search as soon as possible. What was learnt is kept.
    fn should_stop(&self) -> bool {
        false
    }
}

impl Monitor for () {}

/// A monitor, on one option.
pub(crate) struct OptionMonitor<'a> {
    pub(crate) monitor: &'a dyn Monitor,
    pub(crate) option: &'a GuidedOption,
}

impl LearningMonitor for OptionMonitor<'_> {
    fn should_stop(&self) -> bool {
        self.monitor.should_stop()
    }

    fn trained(&self, progress: &Progress<'_>) {
        self.monitor.trained(self.option, progress);
    }
}
