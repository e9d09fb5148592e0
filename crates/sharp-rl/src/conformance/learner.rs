//! The rules for learners: errors instead of panics, a prompt stop, equal seeds, and learning.

use std::ops::ControlFlow;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use std::sync::atomic::{AtomicU64, Ordering};

use rand::SeedableRng;
use thiserror::Error;

use crate::environment::{Environment, EnvironmentSpec, Step, Stream};
use crate::error::TrainError;
use crate::evaluation::evaluate;
use crate::learner::{Learner, Observer, Progress, Trained};
use crate::stop::StopReason;
use crate::toy::Identity;

/// Environment steps of training within which a learner must learn [`Identity`].
pub const LEARNING_BUDGET_STEPS: u64 = 50_000;
/// The mean return on [`Identity`] that counts as learnt.
///
/// It is an error of 0.1 (squared) per step. Uniform actions have -6, the best constant action -2.7.
pub const MEAN_RETURN_MIN: f64 = -1.0;
/// Environment steps that a learner may take before it calls the observer, and after it was
/// stopped. They leave time for a last evaluation.
pub const STOP_STEPS_MAX: u64 = 20_000;
/// Episodes that judge the learnt policy.
const JUDGE_EPISODES: usize = 100;

/// The rule that a learner breaks.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum LearnerViolation {
    /// A panic where an error was due.
    #[error("a panic on {on}")]
    Panicked {
        /// The environments.
        on: &'static str,
    },
    /// A policy where an error was due.
    #[error("no error on {on}")]
    Accepted {
        /// The environments.
        on: &'static str,
    },
    /// An error on sound environments.
    #[error("failed on sound environments: {0}")]
    Failed(TrainError),
    /// The observer is called too rarely to stop the learner.
    #[error("{steps} environment steps without a call of the observer")]
    Unobserved {
        /// Environment steps before the first call, evaluation included.
        steps: u64,
    },
    /// The observer was called again after it had stopped the learner.
    #[error("the observer stopped the learner and was called again")]
    CalledAfterStop,
    /// Learning went on after the observer had stopped it.
    #[error("{steps} environment steps after the observer's stop")]
    LateStop {
        /// Environment steps after the stop, evaluation included.
        steps: u64,
    },
    /// The result of a run that the observer stopped names another reason.
    #[error("the observer stopped the learner, the result says {found:?}")]
    WrongReason {
        /// The reason in the result.
        found: StopReason,
    },
    /// A counter of the progress went back.
    #[error("the progress goes back from {before} to {after} environment steps")]
    ProgressGoesBack {
        /// Environment steps in one call.
        before: u64,
        /// Environment steps in the next.
        after: u64,
    },
    /// The result reports no steps, or more than were taken.
    #[error("the result reports {reported} environment steps, {taken} were taken")]
    WrongCount {
        /// Environment steps in the result.
        reported: u64,
        /// Environment steps taken, evaluation included.
        taken: u64,
    },
    /// The policy has other lengths than the environments.
    #[error("the policy has {found:?}, the environments have {expected:?}")]
    Spec {
        /// Lengths of the policy.
        found: EnvironmentSpec,
        /// Lengths of the environments.
        expected: EnvironmentSpec,
    },
    /// Equal streams gave different results.
    #[error("equal streams gave different results")]
    NotReproducible,
    /// The policy is not good enough.
    #[error("a mean return of {mean_return} on the toy `Identity`, expected {MEAN_RETURN_MIN}")]
    NotLearnt {
        /// Its mean return on fresh episodes.
        mean_return: f64,
    },
}

/// Checks the rules of [`Learner`] on the toy [`Identity`] with one component.
///
/// * No environments, vectors without components, different lengths, a NaN observation and an
///   infinite reward give errors.
/// * A stop by the observer is obeyed within [`STOP_STEPS_MAX`] environment steps.
/// * [`MEAN_RETURN_MIN`] is reached within [`LEARNING_BUDGET_STEPS`], on fresh episodes.
/// * Equal streams give equal results.
///
/// Give the learner settings for a small task: it learns twice.
///
/// # Errors
/// Names the first rule that is broken.
pub fn check_learner(learner: &dyn Learner, rng: &mut Stream) -> Result<(), LearnerViolation> {
    check_errors(learner, &Stream::from_rng(rng))?;
    check_stop(learner, &mut Stream::from_rng(rng))?;
    let (first, mut judge) = (Stream::from_rng(rng), Stream::from_rng(rng));
    let trained = learn_within_budget(learner, &mut first.clone())?;
    check_policy(&trained, &mut judge)?;
    if learn_within_budget(learner, &mut first.clone())? == trained {
        Ok(())
    } else {
        Err(LearnerViolation::NotReproducible)
    }
}

/// Environments that must give an error.
fn check_errors(learner: &dyn Learner, rng: &Stream) -> Result<(), LearnerViolation> {
    let faulty = |fault| CountedIdentity { fault: Some(fault), ..CountedIdentity::new(1) };
    let cases: [(&'static str, Vec<CountedIdentity>); 5] = [
        ("no environments", vec![]),
        ("an environment without components", vec![CountedIdentity::new(0)]),
        ("environments of different lengths", vec![CountedIdentity::new(1), CountedIdentity::new(2)]),
        ("an observation that is NaN", vec![faulty(IdentityFault::Observation)]),
        ("a reward that is infinite", vec![faulty(IdentityFault::Reward)]),
    ];
    for (on, environments) in cases {
        let mut calls = 0_u64;
        // A learner that does not see the fault shall not use up its whole budget.
        let mut observer = |progress: &Progress<'_>| {
            calls += 1;
            let is_over = progress.env_steps > STOP_STEPS_MAX || calls > STOP_STEPS_MAX;
            if is_over { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let mut environments = boxed(environments);
        let learn = || learner.learn(&mut environments, &mut rng.clone(), &mut observer).is_ok();
        match catch_unwind(AssertUnwindSafe(learn)) {
            Ok(false) => {}
            Ok(true) => return Err(LearnerViolation::Accepted { on }),
            Err(_) => return Err(LearnerViolation::Panicked { on }),
        }
    }
    Ok(())
}

/// A stop at the first call of the observer.
fn check_stop(learner: &dyn Learner, rng: &mut Stream) -> Result<(), LearnerViolation> {
    let (environment, steps) = counted();
    let (mut calls, mut stopped_at) = (0, None);
    let mut observer = |_: &Progress<'_>| {
        calls += 1;
        stopped_at.get_or_insert(steps.load(Ordering::Relaxed));
        ControlFlow::Break(())
    };
    let trained = learn(learner, environment, rng, &mut observer)?;
    let taken = steps.load(Ordering::Relaxed);
    let stopped_at = stopped_at.unwrap_or(taken);
    if calls == 0 || stopped_at > STOP_STEPS_MAX {
        return Err(LearnerViolation::Unobserved { steps: stopped_at });
    }
    if calls > 1 {
        return Err(LearnerViolation::CalledAfterStop);
    }
    if taken - stopped_at > STOP_STEPS_MAX {
        return Err(LearnerViolation::LateStop { steps: taken - stopped_at });
    }
    if trained.stop != StopReason::Observer {
        return Err(LearnerViolation::WrongReason { found: trained.stop });
    }
    Ok(())
}

/// A run that ends by itself or with [`LEARNING_BUDGET_STEPS`].
fn learn_within_budget(learner: &dyn Learner, rng: &mut Stream) -> Result<Trained, LearnerViolation> {
    let (environment, steps) = counted();
    let (mut last, mut violation) = (0, None);
    let mut observer = |progress: &Progress<'_>| {
        if progress.env_steps < last {
            violation = Some(LearnerViolation::ProgressGoesBack { before: last, after: progress.env_steps });
        }
        last = progress.env_steps;
        // A learner that reports no steps shall not learn forever.
        let taken = steps.load(Ordering::Relaxed) / 20;
        let is_over = last.max(taken) >= LEARNING_BUDGET_STEPS || violation.is_some();
        if is_over { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
    };
    let trained = learn(learner, environment, rng, &mut observer)?;
    violation.map_or(Ok(()), Err)?;
    let (reported, taken) = (trained.env_steps, steps.load(Ordering::Relaxed));
    if reported == 0 || reported > taken {
        return Err(LearnerViolation::WrongCount { reported, taken });
    }
    Ok(trained)
}

/// The policy on fresh episodes.
fn check_policy(trained: &Trained, rng: &mut Stream) -> Result<(), LearnerViolation> {
    let mut environment = [Identity::new(1)];
    let (found, expected) = (trained.actor.spec(), environment[0].spec());
    if found != expected {
        return Err(LearnerViolation::Spec { found, expected });
    }
    let judged = evaluate(&mut environment, &trained.actor, JUDGE_EPISODES, rng);
    let mean_return = judged.map_err(LearnerViolation::Failed)?.mean_return;
    // Written so that NaN is a violation too.
    if mean_return >= MEAN_RETURN_MIN { Ok(()) } else { Err(LearnerViolation::NotLearnt { mean_return }) }
}

/// Learns on two copies of `environment`.
fn learn(
    learner: &dyn Learner,
    environment: CountedIdentity,
    rng: &mut Stream,
    observer: &mut Observer<'_>,
) -> Result<Trained, LearnerViolation> {
    let mut environments = boxed(vec![environment.clone(), environment]);
    let learn = || learner.learn(&mut environments, rng, observer);
    catch_unwind(AssertUnwindSafe(learn))
        .map_err(|_| LearnerViolation::Panicked { on: "sound environments" })?
        .map_err(LearnerViolation::Failed)
}

fn boxed(environments: Vec<CountedIdentity>) -> Vec<Box<dyn Environment>> {
    environments.into_iter().map(|environment| Box::new(environment) as Box<dyn Environment>).collect()
}

/// An identity and the counter of its steps.
fn counted() -> (CountedIdentity, Arc<AtomicU64>) {
    let environment = CountedIdentity::new(1);
    let steps = Arc::clone(&environment.steps);
    (environment, steps)
}

/// What is not finite.
#[derive(Clone, Copy, Debug)]
enum IdentityFault {
    Observation,
    Reward,
}

/// The toy [`Identity`], which counts the steps of all its copies and may have a fault.
#[derive(Clone, Debug)]
struct CountedIdentity {
    inner: Identity,
    steps: Arc<AtomicU64>,
    fault: Option<IdentityFault>,
}

impl CountedIdentity {
    fn new(len: usize) -> Self {
        Self { inner: Identity::new(len), steps: Arc::default(), fault: None }
    }
}

impl Environment for CountedIdentity {
    fn spec(&self) -> EnvironmentSpec {
        self.inner.spec()
    }

    fn reset(&mut self, rng: &mut Stream, observation: &mut [f32]) {
        self.inner.reset(rng, observation);
    }

    fn step(&mut self, action: &[f32], observation: &mut [f32]) -> Step {
        self.steps.fetch_add(1, Ordering::Relaxed);
        let mut step = self.inner.step(action, observation);
        match self.fault {
            Some(IdentityFault::Observation) => observation[0] = f32::NAN,
            Some(IdentityFault::Reward) => step.reward = f32::INFINITY,
            None => {}
        }
        step
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::actor::Actor;

    /// Knows the answer and has a fault to choose; counts its runs.
    #[derive(Debug)]
    struct FaultyLearner(&'static str, AtomicU64);

    impl Learner for FaultyLearner {
        fn learn(
            &self,
            environments: &mut [Box<dyn Environment>],
            rng: &mut Stream,
            observer: &mut Observer<'_>,
        ) -> Result<Trained, TrainError> {
            if self.0 == "panics" {
                assert!(!environments.is_empty(), "a panic where an error is due");
            }
            let spec = EnvironmentSpec::common(environments)?;
            let mut actor = Actor::new(spec, &[], rng);
            if self.0 != "lazy" && spec.observation_len == 1 {
                actor.set_parameters(&[1.2, 0.0, 0.0, 0.0])?;
            }
            if self.0 == "irreproducible" && spec.observation_len == 1 {
                actor.set_parameters(&[1.2, 0.0, 0.0, self.1.fetch_add(1, Ordering::Relaxed) as f32])?;
            }
            if self.0 == "gives up" {
                return Err(TrainError::Other("no time".to_owned()));
            }
            let mut stop = StopReason::Steps;
            let mut env_steps = 0;
            for round in 0..3 {
                if self.0 != "accepts" {
                    evaluate(environments, &actor, 10, rng)?;
                }
                env_steps += 100;
                if self.0 == "silent" {
                    continue;
                }
                let seen = if self.0 == "goes back" { 1_000 - round } else { env_steps };
                if observer(&Progress::new(&actor, seen)).is_break() {
                    stop = StopReason::Observer;
                    if self.0 != "deaf" {
                        break;
                    }
                }
            }
            if self.0 == "slow" {
                evaluate(environments, &actor, 5_000, rng)?;
            }
            if self.0 == "reason" {
                stop = StopReason::Rule;
            }
            if self.0 == "miscounts" {
                env_steps = 0;
            }
            let evaluation = evaluate(environments, &actor, 10, rng)?;
            Ok(Trained::new(actor, evaluation, stop, env_steps))
        }
    }

    #[test]
    fn every_broken_rule_is_named() {
        let check =
            |fault| check_learner(&FaultyLearner(fault, AtomicU64::new(0)), &mut Stream::seed_from_u64(1));
        assert_eq!(check("none"), Ok(()));
        for (fault, message) in [
            ("panics", "a panic on no environments"),
            ("gives up", "failed on sound environments: no time"),
            ("silent", "400 environment steps without a call of the observer"),
            ("deaf", "the observer stopped the learner and was called again"),
            ("slow", "50100 environment steps after the observer's stop"),
            ("reason", "the observer stopped the learner, the result says Rule"),
            ("goes back", "the progress goes back from 1000 to 999 environment steps"),
            ("miscounts", "the result reports 0 environment steps, 400 were taken"),
            ("irreproducible", "equal streams gave different results"),
        ] {
            assert_eq!(check(fault).expect_err(fault).to_string(), message, "{fault}");
        }
        assert!(matches!(check("lazy"), Err(LearnerViolation::NotLearnt { .. })), "a policy that is bad");
    }
}
