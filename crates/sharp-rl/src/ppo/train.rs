//! Training on a batch of environments, from the beginning or from a saved state.

use super::batch::BatchEnvironment;
use super::iteration::PpoRun;
use super::settings::PpoSettings;
use super::state::PpoState;
use crate::environment::Stream;
use crate::error::TrainError;
use crate::learner::Observer;
use crate::stop::StopReason;

/// Trains fresh networks on `batch` by proximal policy optimisation, until the budget is used up.
///
/// Nothing is evaluated: the result is the last policy, and `observer` sees it after every iteration.
///
/// # Errors
/// If settings or environments do not fit, or if a number is not finite (see [`TrainError`]).
pub fn train_ppo<B: BatchEnvironment>(
    batch: &mut B,
    settings: &PpoSettings,
    rng: &mut Stream,
    observer: &mut Observer<'_>,
) -> Result<(PpoState, StopReason), TrainError> {
    settings.validate()?;
    let state = PpoState::new(&batch.spec(), settings, rng);
    resume_ppo(batch, state, settings, observer)
}

/// Continues from `state`: an actor with a fresh critic ([`PpoState::with_actor`]), or an interrupted run, which
/// goes on bit for bit as if it had not been interrupted.
///
/// # Errors
/// As [`train_ppo`], and if the state belongs to another batch or other settings.
pub fn resume_ppo<B: BatchEnvironment>(
    batch: &mut B,
    state: PpoState,
    settings: &PpoSettings,
    observer: &mut Observer<'_>,
) -> Result<(PpoState, StopReason), TrainError> {
    let mut run = PpoRun::new(batch, settings, state)?;
    let mut stop = StopReason::Steps;
    while !run.is_done() {
        run.iterate()?;
        let checkpoint = || run.state.to_bytes();
        if observer(&run.progress().with_checkpoint(&checkpoint)).is_break() {
            stop = StopReason::Observer;
            break;
        }
    }
    Ok((run.state, stop))
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use rand::SeedableRng;

    use super::super::batch::PlainBatch;
    use super::super::settings::{FailurePrice, Schedule};
    use super::*;
    use crate::actor::ActorScratch;
    use crate::evaluation::evaluate;
    use crate::learner::Progress;
    use crate::toy::{Ledge, PointMass};

    fn quiet(_: &Progress<'_>) -> ControlFlow<()> {
        ControlFlow::Continue(())
    }

    fn rng(seed: u64) -> Stream {
        Stream::seed_from_u64(seed)
    }

    fn short() -> PpoSettings {
        PpoSettings::default().with(|s| {
            s.hidden = vec![16];
            s.max_env_steps = 4_000;
            s.rollout_steps = Schedule::between(20.0, 60.0);
            s.epochs = 2;
            s.target_kl = 0.01;
        })
    }

    #[test]
    fn a_point_mass_reaches_the_origin() {
        let mut worlds = vec![PointMass::default(); 16];
        let settings = PpoSettings::default().with(|s| {
            s.max_env_steps = 60_000;
            s.minibatch = 256;
            s.learning_rate = 1e-3;
        });
        let mut batch = PlainBatch::new(&mut worlds).expect("equal lengths");
        let (state, stop) = train_ppo(&mut batch, &settings, &mut rng(2), &mut quiet).expect("trains");
        assert_eq!(stop, StopReason::Steps);
        let found = evaluate(&mut worlds, &state.actor, 200, &mut rng(77)).expect("evaluates");
        assert!(found.success_rate() >= 0.95, "on fresh seeds: {found:?}");
    }

    #[test]
    fn a_resumed_run_ends_with_the_bytes_of_the_uninterrupted_one() {
        let worlds = || vec![PointMass::default(); 4];
        let whole = |seed| {
            let mut worlds = worlds();
            let mut batch = PlainBatch::new(&mut worlds).expect("equal lengths");
            train_ppo(&mut batch, &short(), &mut rng(seed), &mut quiet).expect("trains").0.to_bytes()
        };
        let expected = whole(5);
        assert_eq!(whole(5), expected, "equal seeds");
        assert_ne!(whole(6), expected, "other seeds");
        for stop_at in [1, 1_500, 3_000] {
            let mut saved = Vec::new();
            let mut stop = |progress: &Progress<'_>| {
                if progress.env_steps < stop_at {
                    return ControlFlow::Continue(());
                }
                saved = progress.checkpoint().expect("a run can be saved");
                ControlFlow::Break(())
            };
            let (mut first, mut second) = (worlds(), worlds());
            let mut batch = PlainBatch::new(&mut first).expect("equal lengths");
            train_ppo(&mut batch, &short(), &mut rng(5), &mut stop).expect("trains");
            let state = PpoState::from_bytes(&saved).expect("own bytes");
            assert_eq!(state.to_bytes(), saved, "stopped at {stop_at}: equal contents, equal bytes");
            let mut batch = PlainBatch::new(&mut second).expect("equal lengths");
            let resumed = resume_ppo(&mut batch, state, &short(), &mut quiet).expect("resumes").0;
            assert!(resumed.to_bytes() == expected, "stopped at {stop_at}: other bytes");
        }
    }

    #[test]
    fn another_batch_or_setting_does_not_resume() {
        let mut worlds = vec![PointMass::default(); 2];
        let mut batch = PlainBatch::new(&mut worlds).expect("equal lengths");
        let state = PpoState::new(&batch.spec(), &short(), &mut rng(1));
        let wide = short().with(|s| s.hidden = vec![8]);
        let error = resume_ppo(&mut batch, state.clone(), &wide, &mut quiet).expect_err("other widths");
        assert!(
            error.to_string().starts_with("the state to continue from has an actor of hidden"),
            "{error}"
        );
        let mut other = vec![PointMass::default(); 3];
        let mut batch = PlainBatch::new(&mut other).expect("equal lengths");
        let error = resume_ppo(&mut batch, state, &short(), &mut quiet).expect_err("other slots");
        assert_eq!(error.to_string(), "a state of 2 environments resumed with 3");
    }

    #[test]
    fn caution_makes_the_policy_avoid_failures() {
        let mut ledge = Ledge::new(32);
        let settings = PpoSettings::default().with(|s| {
            s.hidden = vec![16];
            s.max_env_steps = 80_000;
            s.minibatch = 512;
            s.learning_rate = 3e-3;
            s.failure_price = FailurePrice { least: 1.0, most: Schedule::constant(300.0) };
            s.caution_bins = 2;
            s.gamma = 0.9;
            s.deviation = Schedule::between(0.6, 0.4);
        });
        let (state, _) = train_ppo(&mut ledge, &settings, &mut rng(1), &mut quiet).expect("trains");
        let action = |observation: f32| {
            let mut action = [0.0];
            state.actor.act_mean(&[observation], &mut ActorScratch::default(), &mut action);
            action[0]
        };
        assert!(action(-1.0) > 0.5, "without caution it is fast: {}", action(-1.0));
        assert!(action(1.0) < -0.5, "with caution it is slow: {}", action(1.0));
    }
}
