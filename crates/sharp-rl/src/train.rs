//! Training with soft actor-critic: fresh networks, given networks, or an interrupted run.
//!
//! The paper (Sec. 5) trains for at most 150,000 steps, evaluates 20 episodes every 10,000 and
//! stops at a mean return of 500; [`TrainSettings::default`] does the same with the hyperparameters of
//! Stable-Baselines3, [`TrainSettings::paper`] with others. Training is a function of environments,
//! settings and stream: equal inputs give equal weights, and a checkpoint continues bit for bit.

use serde::{Deserialize, Serialize};

use crate::environment::{Environment, EnvironmentSpec, Stream};
use crate::error::TrainError;
use crate::gradients::GradientBackend;
use crate::learner::{Observer, Trained};
use crate::sac_state::SacState;
use crate::settings::SacSettings;
use crate::state::TrainState;
use crate::stop::{BestRule, RestartRule, StopRule};
use crate::training_loop::TrainingLoop;

/// How observations are scaled before the networks see them.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
#[non_exhaustive]
pub enum Normalisation {
    /// The actor's own normaliser stays as it is. In a fresh actor it changes nothing.
    #[default]
    AsGiven,
    /// By mean and standard deviation of the observations of the warm-up, fixed from then on.
    ///
    /// They stay fixed so that a stored observation means the same during all of training.
    FromWarmup,
}

/// Everything about a training run but its environments and its seed.
///
/// Begin with a preset and change fields, in place or with [`TrainSettings::with`].
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
#[non_exhaustive]
pub struct TrainSettings {
    /// Hyperparameters of soft actor-critic.
    pub sac: SacSettings,
    /// What computes the gradients. Results differ by rounding only.
    pub backend: GradientBackend,
    /// How observations are scaled before the networks see them.
    pub normalisation: Normalisation,
    /// The budget: environment steps, all environments together (paper: 150,000).
    pub max_env_steps: u64,
    /// Environment steps between evaluations (paper: 10,000).
    pub evaluate_every: u64,
    /// Episodes in an evaluation (paper: 20).
    pub evaluation_episodes: usize,
    /// When to stop before the budget is used up.
    pub stop: StopRule,
    /// Which of the evaluated policies is returned if none met the stop rule.
    pub best: BestRule,
    /// When to begin anew, with fresh networks, within the budget; `None` for never, as in the paper. A run that goes on with
    /// networks from elsewhere ([`fine_tune`]) would lose them.
    pub restart: Option<RestartRule>,
}

impl Default for TrainSettings {
    fn default() -> Self {
        Self {
            sac: SacSettings::default(),
            backend: GradientBackend::default(),
            normalisation: Normalisation::default(),
            max_env_steps: 150_000,
            evaluate_every: 10_000,
            evaluation_episodes: 20,
            stop: StopRule::MeanReturn(500.0),
            best: BestRule::Success,
            restart: None,
        }
    }
}

impl TrainSettings {
    /// Small networks, frequent evaluation, and a stop at 99 % success, confirmed on 1,000 episodes.
    #[must_use]
    pub fn fast() -> Self {
        Self {
            sac: SacSettings::fast(),
            max_env_steps: 30_000,
            evaluate_every: 1_000,
            evaluation_episodes: 200,
            stop: StopRule::Success { rate: 0.99, episodes: 1_000 },
            ..Self::default()
        }
    }

    /// The paper's settings (Sec. 5), as [`default`](Self::default). Where the paper gives none, settings that learn well in
    /// coordinates of a map with rewards of hundreds: observations and rewards scaled to the size of one, a learning rate of
    /// 1e-3, γ 0.97 (docs/decisions/0025-what-the-paper-leaves-open.md).
    #[must_use]
    pub fn paper() -> Self {
        Self {
            sac: SacSettings::default().with(|sac| {
                sac.batch = 128;
                sac.gamma = 0.97;
                sac.tau = 0.01;
                sac.learning_rate = 1e-3;
                sac.reward_scale = 0.01;
            }),
            normalisation: Normalisation::FromWarmup,
            ..Self::default()
        }
    }

    /// The same with small networks, frequent evaluation, and a stop at 97 % success, confirmed on 500 episodes. Training begins
    /// anew after 25,000 steps without a mean return above 0, because then the robot hardly ever arrives. If no policy meets
    /// the stop, the best one is chosen by mean return + 1,000 x success rate.
    #[must_use]
    pub fn absolute() -> Self {
        let paper = Self::paper();
        Self {
            sac: SacSettings { hidden: vec![64, 64], ..paper.sac },
            max_env_steps: 100_000,
            evaluate_every: 5_000,
            evaluation_episodes: 100,
            stop: StopRule::Success { rate: 0.97, episodes: 500 },
            best: BestRule::ReturnAndSuccess(1_000.0),
            restart: Some(RestartRule { after: 25_000, below: 0.0 }),
            ..paper
        }
    }

    /// The same settings after `change`.
    #[must_use]
    pub fn with(mut self, change: impl FnOnce(&mut Self)) -> Self {
        change(&mut self);
        self
    }
}

/// Trains fresh networks on `environments`, which are stepped in turn.
///
/// [`Trained::sac`] holds the networks of the best policy.
///
/// # Errors
/// If settings or environments do not fit, or if a number is not finite (see [`TrainError`]).
pub fn train<E: Environment + Clone>(
    environments: &mut [E],
    settings: &TrainSettings,
    rng: &mut Stream,
    observer: &mut Observer<'_>,
) -> Result<Trained, TrainError> {
    settings.sac.validate()?;
    let spec = EnvironmentSpec::common(environments)?;
    let sac = SacState::new(spec, &settings.sac, rng);
    let state = TrainState::new(spec, &settings.sac, sac, environments.len(), rng);
    TrainingLoop::new(environments, settings, state)?.finish(observer)
}

/// Trains `networks` further, with fresh optimisers, temperature and buffer.
///
/// # Errors
/// As [`train`], and if the networks have other widths than the settings.
pub fn fine_tune<E: Environment + Clone>(
    environments: &mut [E],
    networks: &SacState,
    settings: &TrainSettings,
    rng: &mut Stream,
    observer: &mut Observer<'_>,
) -> Result<Trained, TrainError> {
    settings.sac.validate()?;
    let spec = EnvironmentSpec::common(environments)?;
    let sac = networks.restarted(&settings.sac);
    let state = TrainState::new(spec, &settings.sac, sac, environments.len(), rng);
    TrainingLoop::new(environments, settings, state)?.finish(observer)
}

/// Continues a run from a saved state, bit for bit as if it had not been interrupted.
///
/// `environments` and `settings` are those of the run. Only its budget and stop rule may differ; with another budget it may
/// also begin anew at another time.
///
/// # Errors
/// As [`train`], and if the state belongs to other environments.
pub fn resume<E: Environment + Clone>(
    environments: &mut [E],
    state: TrainState,
    settings: &TrainSettings,
    observer: &mut Observer<'_>,
) -> Result<Trained, TrainError> {
    settings.sac.validate()?;
    TrainingLoop::new(environments, settings, state)?.finish(observer)
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use rand::SeedableRng;

    use super::*;
    use crate::environment::Step;
    use crate::evaluation::evaluate;
    use crate::learner::Progress;
    use crate::settings::Exploration;
    use crate::stop::StopReason;
    use crate::toy::{Identity, PointMass};

    fn quiet(_: &Progress<'_>) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    fn rng(seed: u64) -> Stream {
        Stream::seed_from_u64(seed)
    }

    fn networks(trained: Trained) -> SacState {
        trained.sac.expect("soft actor-critic returns its networks")
    }

    /// A short run of a few hundred updates.
    fn short() -> TrainSettings {
        let sac = SacSettings {
            hidden: vec![16, 16],
            batch: 32,
            buffer_capacity: 400,
            warmup_steps: 60,
            n_step: 3,
            ..SacSettings::fast()
        };
        TrainSettings {
            sac,
            normalisation: Normalisation::FromWarmup,
            max_env_steps: 600,
            evaluate_every: 150,
            evaluation_episodes: 10,
            stop: StopRule::Never,
            ..TrainSettings::fast()
        }
    }

    #[test]
    fn identity_is_learned() {
        let settings = TrainSettings {
            sac: SacSettings { hidden: vec![32, 32], batch: 64, gamma: 0.5, ..SacSettings::fast() },
            evaluate_every: 500,
            evaluation_episodes: 20,
            max_env_steps: 8_000,
            stop: StopRule::MeanReturn(-0.3),
            ..TrainSettings::fast()
        };
        let trained = train(&mut [Identity::new(2)], &settings, &mut rng(1), &mut quiet).expect("trains");
        assert_eq!(trained.stop, StopReason::Rule, "{:?}", trained.evaluation);
        assert!(trained.evaluation.mean_return >= -0.3, "{:?}", trained.evaluation);
    }

    #[test]
    fn a_point_mass_reaches_the_origin() {
        let settings = TrainSettings {
            sac: SacSettings { hidden: vec![32, 32], batch: 128, ..SacSettings::fast() },
            evaluate_every: 1_000,
            evaluation_episodes: 50,
            max_env_steps: 20_000,
            stop: StopRule::Success { rate: 0.95, episodes: 100 },
            ..TrainSettings::fast()
        };
        let mut worlds = vec![PointMass::default(); 4];
        let trained = train(&mut worlds, &settings, &mut rng(2), &mut quiet).expect("trains");
        assert_eq!(trained.stop, StopReason::Rule, "{:?}", trained.evaluation);
        let fresh = evaluate(&mut worlds, &trained.actor, 200, &mut rng(77)).expect("evaluates");
        assert!(fresh.success_rate() >= 0.9, "on fresh seeds: {fresh:?}");
    }

    #[test]
    fn the_same_seed_gives_the_same_weights() {
        let run = |seed| {
            let trained = train(&mut vec![PointMass::default(); 3], &short(), &mut rng(seed), &mut quiet);
            networks(trained.expect("trains")).to_bytes()
        };
        assert_eq!(run(1), run(1), "equal seeds");
        assert_ne!(run(1), run(2), "other seeds");
    }

    #[test]
    fn a_resumed_run_ends_as_the_uninterrupted_one() {
        let worlds = || vec![PointMass::default(); 3];
        let whole = train(&mut worlds(), &short(), &mut rng(5), &mut quiet).expect("trains");
        // Before and after the warm-up, right after an evaluation, and with a full buffer.
        check_resumed(&worlds, &short(), &whole, &[3, 59, 61, 152, 451, 598]);
    }

    /// Stops at each of the steps, goes on, and compares the end with that of the `whole` run.
    fn check_resumed(
        worlds: &dyn Fn() -> Vec<PointMass>,
        settings: &TrainSettings,
        whole: &Trained,
        stops: &[u64],
    ) {
        for &stop_at in stops {
            let mut saved = Vec::new();
            let mut stop = |progress: &Progress<'_>| {
                if progress.env_steps < stop_at {
                    return ControlFlow::Continue(());
                }
                saved = progress.checkpoint().expect("a run can be saved");
                ControlFlow::Break(())
            };
            train(&mut worlds(), settings, &mut rng(5), &mut stop).expect("trains");
            let state = TrainState::from_bytes(&saved).expect("own bytes");
            assert_eq!(state.to_bytes(), saved, "stopped at {stop_at}: equal contents, equal bytes");
            let resumed = resume(&mut worlds(), state, settings, &mut quiet).expect("resumes");
            assert!(resumed == *whole, "stopped at {stop_at}: other weights or counters");
        }
    }

    /// Begins anew after every 150 steps, as long as 300 are left: at 150 and 300 of 600.
    fn hopeless() -> TrainSettings {
        TrainSettings { restart: Some(RestartRule { after: 150, below: f64::INFINITY }), ..short() }
    }

    #[test]
    fn a_hopeless_run_begins_anew_with_fresh_networks() {
        let mut seen = Vec::new();
        let mut watch = |progress: &Progress<'_>| {
            seen.push((progress.env_steps, progress.updates, progress.began_at));
            ControlFlow::Continue(())
        };
        let trained =
            train(&mut [PointMass::default()], &hopeless(), &mut rng(5), &mut watch).expect("trains");
        let at = |steps| seen.iter().find(|seen| seen.0 == steps).expect("each step is reported");
        assert_eq!([150, 151, 300, 301, 600].map(|steps| at(steps).2), [0, 150, 150, 300, 300]);
        let updates_at = |steps| at(steps).1;
        // Each attempt has a warm-up of 60 steps, and half an update a step after that.
        let counts = [60, 150, 210, 300, 360, 600].map(updates_at);
        let earned = f64::from(short().sac.updates_per_step) * 90.0;
        let earned = earned as u64;
        assert_eq!(counts[1], earned, "{counts:?}");
        assert_eq!(counts[2], earned, "a new warm-up: {counts:?}");
        assert_eq!(counts[3..5], [2 * earned; 2], "and another: {counts:?}");
        assert!(counts[5] > 3 * earned, "the last attempt has the rest: {counts:?}");
        assert_eq!((trained.stop, trained.env_steps), (StopReason::Steps, 600));

        let plain = train(&mut [PointMass::default()], &short(), &mut rng(5), &mut quiet).expect("trains");
        let never = TrainSettings { restart: Some(RestartRule { after: 150, below: -1e9 }), ..short() };
        let never = train(&mut [PointMass::default()], &never, &mut rng(5), &mut quiet).expect("trains");
        assert!(never == plain, "one that does well enough is left alone");
        assert!(networks(trained) != networks(plain), "fresh networks end elsewhere");
    }

    #[test]
    fn a_run_that_began_anew_is_resumed_all_the_same() {
        let worlds = || vec![PointMass::default(); 3];
        let whole = train(&mut worlds(), &hopeless(), &mut rng(5), &mut quiet).expect("trains");
        check_resumed(&worlds, &hopeless(), &whole, &[148, 151, 200, 299, 301, 400, 598]);
    }

    #[test]
    fn another_environment_or_setting_does_not_resume() {
        let mut state = None;
        let mut save = |progress: &Progress<'_>| {
            state = progress.checkpoint();
            if progress.env_steps < 35 { ControlFlow::Continue(()) } else { ControlFlow::Break(()) }
        };
        train(&mut [PointMass::default()], &short(), &mut rng(5), &mut save).expect("trains");
        let state = TrainState::from_bytes(&state.expect("saved")).expect("own bytes");
        let refusal = |worlds: usize, settings: &TrainSettings, state: &TrainState| {
            let mut worlds = vec![PointMass::default(); worlds];
            resume(&mut worlds, state.clone(), settings, &mut quiet).expect_err("refuses").to_string()
        };
        assert_eq!(refusal(2, &short(), &state), "a state of 1 environments resumed with 2");
        let wide = TrainSettings { sac: SacSettings { hidden: vec![8], ..short().sac }, ..short() };
        assert_eq!(
            refusal(1, &wide, &state),
            "the state to continue from has an actor of hidden widths [16, 16], the settings say [8]"
        );
        let mut moved = state;
        moved.records[0].observation[0] += 0.5;
        assert_eq!(
            refusal(1, &short(), &moved),
            "environment 0 did not repeat its episode: it is not the one that was saved"
        );
    }

    /// A point mass whose observation or reward turns NaN at some step of an episode.
    #[derive(Clone)]
    struct Failing {
        inner: PointMass,
        steps: u64,
        observation_at: u64,
        reward_at: u64,
    }

    impl Environment for Failing {
        fn spec(&self) -> EnvironmentSpec {
            self.inner.spec()
        }

        fn reset(&mut self, rng: &mut Stream, observation: &mut [f32]) {
            self.steps = 0;
            self.inner.reset(rng, observation);
        }

        fn step(&mut self, action: &[f32], observation: &mut [f32]) -> Step {
            self.steps += 1;
            let mut step = self.inner.step(action, observation);
            if self.steps == self.observation_at {
                observation[2] = f32::NAN;
            }
            if self.steps == self.reward_at {
                step.reward = f32::INFINITY;
            }
            step
        }
    }

    #[test]
    fn nan_from_an_environment_is_reported_with_its_place() {
        let refusal = |observation_at, reward_at| {
            let sound = Failing { inner: PointMass::default(), steps: 0, observation_at: 0, reward_at: 0 };
            let mut worlds = [sound.clone(), Failing { observation_at, reward_at, ..sound }];
            train(&mut worlds, &short(), &mut rng(1), &mut quiet).expect_err("refuses").to_string()
        };
        assert_eq!(refusal(5, 0), "component 2 of the observation of environment 1 is NaN after 5 steps");
        assert_eq!(refusal(0, 7), "the reward of environment 1 is inf after 7 steps");
    }

    #[test]
    fn a_huge_learning_rate_is_reported_as_divergence() {
        let sac = SacSettings { learning_rate: 1e30, ..short().sac };
        let settings = TrainSettings { sac, ..short() };
        let error = train(&mut [PointMass::default()], &settings, &mut rng(1), &mut quiet);
        assert!(matches!(error, Err(TrainError::Diverged { .. })), "{error:?}");
    }

    #[test]
    fn the_best_checkpoint_is_kept_and_the_last_policy_is_evaluated() {
        let mut seen = Vec::new();
        let mut watch = |progress: &Progress<'_>| {
            seen.extend(progress.evaluation);
            ControlFlow::Continue(())
        };
        let trained =
            train(&mut vec![PointMass::default(); 3], &short(), &mut rng(3), &mut watch).expect("trains");
        let steps: Vec<u64> = seen.iter().map(|evaluation| evaluation.env_steps).collect();
        assert_eq!(steps, [150, 300, 450, 600]);
        assert!(seen.iter().all(|evaluation| !evaluation.beats(&trained.evaluation)), "{seen:?}");
        assert!(seen.contains(&trained.evaluation), "the result is one of those seen");
        assert_eq!((trained.stop, trained.env_steps, trained.updates), (StopReason::Steps, 600, 270));
    }

    #[test]
    fn fine_tuning_starts_from_the_given_networks() {
        let mut worlds = vec![PointMass::default(); 2];
        let first = train(&mut worlds, &short(), &mut rng(3), &mut quiet).expect("trains");
        let settings = TrainSettings {
            sac: SacSettings { exploration: Exploration::Policy, ..short().sac },
            normalisation: Normalisation::AsGiven,
            max_env_steps: 20,
            ..short()
        };
        let tuned = fine_tune(&mut worlds, &networks(first.clone()), &settings, &mut rng(4), &mut quiet)
            .expect("trains");
        assert_eq!(tuned.actor, first.actor, "no update within the warm-up");
        assert_eq!(tuned.stop, StopReason::Steps);
    }

    #[test]
    fn training_with_burn_takes_the_same_path() {
        let run = |backend| {
            let settings = TrainSettings { backend, max_env_steps: 120, ..short() };
            train(&mut [PointMass::default()], &settings, &mut rng(3), &mut quiet).expect("trains")
        };
        let (hand, burn) = (run(GradientBackend::Fused), run(GradientBackend::Burn));
        assert_eq!((hand.updates, hand.episodes), (burn.updates, burn.episodes));
        let far = |(a, b): (&f32, &f32)| (a - b).abs() > 1e-3;
        let weights = |trained: &Trained| trained.actor.network().parameters().to_vec();
        let (hand, burn) = (weights(&hand), weights(&burn));
        assert!(!hand.iter().zip(&burn).any(far), "weights after thirty updates");
    }

    #[test]
    fn training_without_environments_is_an_error() {
        let none: &mut [PointMass] = &mut [];
        let error = train(none, &short(), &mut rng(1), &mut quiet).expect_err("refuses");
        assert_eq!(error, TrainError::NoEnvironments);
    }
}
