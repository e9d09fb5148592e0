//! Soft actor-critic behind the trait [`Learner`].

use crate::environment::{Environment, Stream};
use crate::error::TrainError;
use crate::learner::{Learner, Observer, Trained};
use crate::sac_state::SacState;
use crate::state::TrainState;
use crate::train::{TrainSettings, fine_tune, resume, train};

/// Soft actor-critic as a [`Learner`].
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct SacLearner {
    /// Hyperparameters, budget and stop rule.
    pub settings: TrainSettings,
    /// What training begins with.
    pub start: SacStart,
}

/// What soft actor-critic begins with.
#[derive(Clone, Debug, Default, PartialEq)]
#[non_exhaustive]
pub enum SacStart {
    /// Fresh networks, drawn from the stream: [`train`].
    #[default]
    Fresh,
    /// Networks that exist already, with fresh optimisers: [`fine_tune`].
    Networks(Box<SacState>),
    /// An interrupted run. The caller's stream is not used: [`resume`].
    Checkpoint(Box<TrainState>),
}

impl SacLearner {
    /// A learner that begins with fresh networks.
    #[must_use]
    pub const fn new(settings: TrainSettings) -> Self {
        Self { settings, start: SacStart::Fresh }
    }

    /// The same learner with another beginning.
    #[must_use]
    pub fn with_start(self, start: SacStart) -> Self {
        Self { start, ..self }
    }
}

impl Learner for SacLearner {
    fn learn(
        &self,
        environments: &mut [Box<dyn Environment>],
        rng: &mut Stream,
        observer: &mut Observer<'_>,
    ) -> Result<Trained, TrainError> {
        match &self.start {
            SacStart::Fresh => train(environments, &self.settings, rng, observer),
            SacStart::Networks(networks) => fine_tune(environments, networks, &self.settings, rng, observer),
            SacStart::Checkpoint(state) => resume(environments, (**state).clone(), &self.settings, observer),
        }
    }

    fn resume(
        &self,
        checkpoint: &[u8],
        environments: &mut [Box<dyn Environment>],
        observer: &mut Observer<'_>,
    ) -> Option<Result<Trained, TrainError>> {
        let state = TrainState::from_bytes(checkpoint).ok()?;
        Some(resume(environments, state, &self.settings, observer))
    }
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use rand::SeedableRng;

    use super::*;
    use crate::conformance::check_learner;
    use crate::settings::SacSettings;
    use crate::stop::StopRule;
    use crate::toy::Identity;

    fn settings() -> TrainSettings {
        TrainSettings {
            sac: SacSettings { hidden: vec![32], batch: 64, gamma: 0.5, ..SacSettings::fast() },
            max_env_steps: 8_000,
            evaluate_every: 500,
            evaluation_episodes: 20,
            stop: StopRule::MeanReturn(-0.3),
            ..TrainSettings::fast()
        }
    }

    fn boxed() -> Vec<Box<dyn Environment>> {
        vec![Box::new(Identity::new(1)), Box::new(Identity::new(1))]
    }

    fn quiet(_: &crate::Progress<'_>) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    #[test]
    fn soft_actor_critic_conforms() {
        assert_eq!(check_learner(&SacLearner::new(settings()), &mut Stream::seed_from_u64(1)), Ok(()));
    }

    #[test]
    fn boxed_environments_give_the_weights_of_plain_ones() {
        let learner = SacLearner::new(TrainSettings { max_env_steps: 1_500, ..settings() });
        let rng = || Stream::seed_from_u64(4);
        let boxed = learner.learn(&mut boxed(), &mut rng(), &mut quiet).expect("trains");
        let mut plain = [Identity::new(1), Identity::new(1)];
        let plain = train(&mut plain, &learner.settings, &mut rng(), &mut quiet).expect("trains");
        assert_eq!(boxed, plain);
    }

    #[test]
    fn a_learner_continues_from_networks_and_from_a_checkpoint() {
        let fresh = SacLearner::new(TrainSettings { max_env_steps: 1_500, ..settings() });
        let rng = || Stream::seed_from_u64(4);
        let mut saved = None;
        let mut save_at_800 = |progress: &crate::Progress<'_>| {
            if progress.env_steps == 800 {
                saved = progress.checkpoint();
            }
            ControlFlow::Continue(())
        };
        let whole = fresh.learn(&mut boxed(), &mut rng(), &mut save_at_800).expect("trains");
        let saved = saved.expect("saved");
        assert_eq!(fresh.resume(&saved, &mut boxed(), &mut quiet), Some(Ok(whole.clone())));
        assert_eq!(fresh.resume(b"nothing", &mut boxed(), &mut quiet), None, "of no run");
        let state = TrainState::from_bytes(&saved).expect("own bytes");
        let resumed = fresh.clone().with_start(SacStart::Checkpoint(Box::new(state)));
        assert_eq!(resumed.learn(&mut boxed(), &mut rng(), &mut quiet), Ok(whole.clone()));

        let networks = Box::new(whole.sac.expect("soft actor-critic returns its networks"));
        let short = TrainSettings { max_env_steps: 100, ..settings() };
        let tuned = SacLearner::new(short).with_start(SacStart::Networks(networks));
        let tuned = tuned.learn(&mut boxed(), &mut rng(), &mut quiet).expect("trains");
        assert_eq!(tuned.actor, whole.actor, "no update within the warm-up");
    }
}
