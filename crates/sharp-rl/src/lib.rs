//! Soft actor-critic and proximal policy optimisation on plain vectors: how an option gets its policy (Sec. 4.3).
//!
//! * [`Environment`] is a task: `f32` vectors in, `f32` vectors out.
//! * [`Learner`] is an algorithm that turns environments into a policy. [`SacLearner`] is soft
//!   actor-critic; [`train`], [`fine_tune`] and [`resume`] are the same as functions.
//! * [`BatchEnvironment`] is many episodes side by side, for proximal policy optimisation: [`train_ppo`] for tasks
//!   with failures and with inputs that only the critic sees, [`PpoLearner`] for ordinary environments.
//! * [`Actor`] is the policy. It decides in about a microsecond and is stored as safetensors.
//! * [`Evaluation`] says how good a policy is.
//!
//! All randomness comes from the caller's [`Stream`]s: equal seeds give equal weights, and a saved
//! [`TrainState`] continues bit for bit. Functions in [`conformance`] check environments and
//! learners of your own.
//!
//! The gradients are written by hand. With the feature `burn` (on by default),
//! [`GradientBackend`] offers burn's autodiff too; without it the crate does not depend on burn.
//!
//! ```
//! use std::ops::ControlFlow;
//!
//! use rand::SeedableRng;
//! use sharp_rl::toy::Identity;
//! use sharp_rl::{Environment, Learner, SacLearner, StopRule, Stream, TrainSettings};
//!
//! let mut settings = TrainSettings::fast();
//! settings.sac.hidden = vec![32];
//! settings.sac.gamma = 0.5;
//! settings.max_env_steps = 5_000;
//! settings.stop = StopRule::MeanReturn(-1.0);
//!
//! let mut environments: Vec<Box<dyn Environment>> = vec![Box::new(Identity::new(1))];
//! let mut rng = Stream::seed_from_u64(1);
//! let learner = SacLearner::new(settings);
//! let trained = learner.learn(&mut environments, &mut rng, &mut |_| ControlFlow::Continue(()))?;
//! assert!(trained.evaluation.mean_return > -1.0, "ten steps with a squared error below 0.1 each");
//! # Ok::<(), sharp_rl::TrainError>(())
//! ```

mod actor;
mod adam;
mod buffer;
#[cfg(any(feature = "burn", test))]
mod burn_sac;
mod deployed;
mod environment;
mod error;
mod evaluation;
mod fused;
mod gradients;
mod learner;
mod matrix;
mod n_step;
mod network;
mod normaliser;
mod ppo;
mod regression;
mod sac;
mod sac_learner;
mod sac_state;
mod settings;
mod state;
mod state_file;
mod stop;
mod store;
mod train;
mod training_loop;

pub mod conformance;
pub mod toy;

pub use actor::{Actor, ActorError, ActorScratch};
pub use adam::Adam;
pub use buffer::{Batch, ReplayBuffer, ReplayTransition, SampleSettings};
pub use deployed::{DeployedActor, DeployedMlp, DeployedScratch};
pub use environment::{Environment, EnvironmentSpec, ForkEnvironment, Step, Stream};
pub use error::TrainError;
pub use evaluation::{Evaluation, evaluate};
pub use gradients::GradientBackend;
pub use learner::{Learner, Observer, Progress, Trained};
pub use n_step::NStep;
pub use network::{Layer, Mlp, NetworkError, Scratch};
pub use normaliser::{Normaliser, NormaliserError};
pub use ppo::{
    BatchEnvironment, BatchSpec, BatchStep, FailurePrice, PpoBudget, PpoLearner, PpoSettings, PpoState,
    Schedule, SeenBatch, resume_ppo, train_ppo,
};
pub use regression::{FitError, FitSettings, Samples, fit};
pub use sac::{Sac, UpdateReport};
pub use sac_learner::{SacLearner, SacStart};
pub use sac_state::SacState;
pub use settings::{Exploration, SacSettings, SettingsError};
pub use state::{BestNetworks, TrainState};
pub use stop::{BestRule, RestartRule, StopReason, StopRule};
pub use store::{FORMAT_VERSION, StoreError};
pub use train::{Normalisation, TrainSettings, fine_tune, resume, train};
