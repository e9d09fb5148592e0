//! Proximal policy optimisation (Schulman et al. 2017) for many environments that are stepped together.
//!
//! One iteration has three phases: collect a rollout with the policy as it is, compute advantages by
//! generalised advantage estimation, and improve actor and critic on it for a few epochs. The
//! critic has two heads, because a failure must not be discounted while seconds must: discounting it would pay
//! for postponing it. It may be told what the actor cannot see ([`BatchSpec::privileged_len`]).

mod advantages;
mod batch;
mod gradients;
mod iteration;
mod learner;
mod rollout;
mod settings;
mod state;
mod train;

pub use batch::{BatchEnvironment, BatchSpec, BatchStep, SeenBatch};
pub use learner::{PpoBudget, PpoLearner};
pub use settings::{FailurePrice, PpoSettings, Schedule};
pub use state::PpoState;
pub use train::{resume_ppo, train_ppo};
