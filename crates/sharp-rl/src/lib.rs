//! Soft actor-critic on plain vectors: the learner of option policies (Sec. 4.3).
//!
//! An [`Environment`] is a world of `f32` vectors; [`train`] turns one or several of them into an
//! [`Actor`], the deployable policy, by the updates of [`Sac`]. The mathematics exists twice behind
//! the trait [`Learner`]: [`FusedSac`], hand-written and the default, and [`BurnSac`], through
//! burn's autodiff, which checks it. All randomness comes from the caller's [`Stream`]s: the same
//! seed gives the same weights, and a saved [`TrainState`] continues bit for bit.
//!
//! ```
//! use std::ops::ControlFlow;
//!
//! use rand::SeedableRng;
//! use sharp_rl::toy::Identity;
//! use sharp_rl::{SacSettings, StopRule, Stream, TrainSettings, train};
//!
//! let settings = TrainSettings {
//!     sac: SacSettings { hidden: vec![32], warmup_steps: 100, gamma: 0.5, ..SacSettings::fast() },
//!     evaluate_every: 500,
//!     max_env_steps: 5_000,
//!     stop: StopRule::MeanReturn(-1.0),
//!     ..TrainSettings::fast()
//! };
//! let mut worlds = [Identity::new(1)];
//! let mut rng = Stream::seed_from_u64(1);
//! let trained = train(&mut worlds, &settings, &mut rng, &mut |_| ControlFlow::Continue(()))?;
//! assert!(trained.evaluation.mean_return > -1.0, "ten steps with an error below 0.1 each");
//! # Ok::<(), sharp_rl::TrainError>(())
//! ```

mod actor;
mod adam;
mod buffer;
mod burn_sac;
mod check;
mod environment;
mod evaluation;
mod fused;
mod matrix;
mod n_step;
mod network;
mod sac;
mod settings;
mod state;
mod store;
mod train;

pub mod toy;

pub use actor::{Actor, ActorError, ActorScratch, Normaliser, NormaliserError};
pub use adam::Adam;
pub use buffer::{Batch, ReplayBuffer, SampleSettings, Transition};
pub use burn_sac::BurnSac;
pub use check::{CheckError, check_environment};
pub use environment::{Environment, EnvironmentSpec, Step, Stream};
pub use evaluation::{Evaluation, evaluate};
pub use fused::FusedSac;
pub use n_step::NStep;
pub use network::{Layer, Mlp, NetworkError, Scratch};
pub use sac::{ActorLoss, CriticLoss, Learner, LearnerKind, Sac, SacState, UpdateReport};
pub use settings::{Exploration, SacSettings, SettingsError};
pub use state::{Best, TrainState};
pub use store::{FORMAT_VERSION, StoreError};
pub use train::{
    Normalisation, Observer, Progress, Stop, StopRule, TrainError, TrainSettings, Trained, fine_tune, resume,
    train,
};
