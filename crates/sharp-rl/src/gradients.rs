//! The losses of soft actor-critic and their gradients, as a seam between two implementations.
//!
//! [`FusedSac`](crate::fused::FusedSac) is written by hand. `BurnSac` uses burn's autodiff and
//! checks the other. Both work on the same plain [`SacState`].

use serde::{Deserialize, Serialize};

use crate::buffer::Batch;
use crate::sac_state::SacState;

/// What computes losses and gradients.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum GradientBackend {
    /// Passes written by hand, the faster ones (measured in docs/algorithms/sac.md).
    #[default]
    Fused,
    /// burn's autodiff on its flex backend. Needs the feature `burn`.
    #[cfg(any(feature = "burn", test))]
    Burn,
}

/// Losses of soft actor-critic and their gradients on one batch.
pub(crate) trait SacGradients {
    /// Writes the targets y = r + γⁿ (1 - end) (min Q̄(s', a') - α log π(a'|s')), one for each row.
    fn targets(&mut self, state: &SacState, batch: &Batch, targets: &mut [f32]);

    /// Writes the gradients of both critics' losses ½ mean (Q(s, a) - y)².
    fn critic_gradients(
        &mut self,
        state: &SacState,
        batch: &Batch,
        targets: &[f32],
        gradients: &mut [Vec<f32>; 2],
    ) -> CriticLoss;

    /// Writes the gradient of the actor's loss mean (α log π(a|s) - min Q(s, a)).
    ///
    /// The action a is drawn from the policy with the noise of the batch.
    fn actor_gradient(&mut self, state: &SacState, batch: &Batch, gradient: &mut [f32]) -> ActorLoss;
}

/// What a pass through the critics found.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct CriticLoss {
    /// Sum of both losses.
    pub(crate) loss: f32,
    /// Mean of Q₁ over the batch.
    pub(crate) mean_q: f32,
}

/// What a pass through the actor found.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct ActorLoss {
    /// The loss.
    pub(crate) loss: f32,
    /// Mean of log π over the batch: minus the entropy.
    pub(crate) mean_log_probability: f32,
}
