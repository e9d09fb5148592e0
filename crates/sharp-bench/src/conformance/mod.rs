//! The suites that every [`Contender`](crate::Contender) and every [`Engine`](crate::Engine) must pass, ours and
//! anybody's.

mod contender;
mod engine;

pub use contender::{ContenderViolation, check_contender};
pub use engine::{EngineViolation, check_engine};
