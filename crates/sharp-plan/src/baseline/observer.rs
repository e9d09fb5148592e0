//! What a baseline's robot is like, learnt while it drives.

use std::sync::Arc;

use sharp_sim::{NoiseModel, RobotState};

use crate::belief::{Belief, Trim};
use crate::model::{Model, Traits};
use crate::percept::Workspace;
use crate::policy::PolarWaypoint;

/// A [`Belief`] that is told of actions when they begin and when they end.
#[derive(Clone, Debug)]
pub(crate) struct Observer {
    model: Arc<Model>,
    belief: Belief,
    /// The action under way: from where, and the command.
    begun: Option<(RobotState, PolarWaypoint)>,
}

impl Observer {
    /// An observer that has seen nothing; `noise` says what to expect.
    pub(crate) fn new(workspace: &Workspace, noise: &NoiseModel) -> Self {
        Self { model: Arc::clone(&workspace.model), belief: Belief::new(noise), begun: None }
    }

    /// The best guess so far.
    pub(crate) const fn traits(&self) -> &Traits {
        self.belief.traits()
    }

    /// Notes that `command` is carried out from `state`.
    pub(crate) const fn begin(&mut self, state: &RobotState, command: PolarWaypoint) {
        self.begun = Some((*state, command));
    }

    /// Compares what came of the last action; one that a wall ended says nothing.
    pub(crate) fn end(&mut self, after: &RobotState, bumped: bool) {
        if let Some((before, command)) = self.begun.take().filter(|_| !bumped) {
            self.belief = self.belief.after(&self.model, (&before, command), after);
        }
    }

    /// How to adapt commands like `wanted`; `share` of the pull is made up for.
    pub(crate) fn trim(&self, wanted: PolarWaypoint, share: f64) -> Trim {
        self.belief.trim(&self.model, wanted, share)
    }
}
