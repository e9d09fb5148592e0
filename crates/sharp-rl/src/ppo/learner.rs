//! Proximal policy optimisation behind the trait [`Learner`].

use rand::SeedableRng;
use serde::{Deserialize, Serialize};

use super::batch::{BatchEnvironment, PlainBatch};
use super::iteration::PpoRun;
use super::settings::PpoSettings;
use super::state::PpoState;
use crate::actor::Actor;
use crate::environment::{Environment, Stream};
use crate::error::TrainError;
use crate::evaluation::{Evaluation, evaluate};
use crate::learner::{Learner, Observer, Trained};
use crate::stop::{StopReason, StopRule};

/// Proximal policy optimisation as a [`Learner`] of ordinary environments: without failures and privileged inputs.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct PpoLearner {
    /// Hyperparameters and the budget of steps.
    pub settings: PpoSettings,
    /// When to evaluate and when to stop early.
    pub budget: PpoBudget,
    /// The policy to begin with; a fresh one if there is none.
    pub start: Option<Actor>,
}

/// When a run is evaluated and when it ends.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PpoBudget {
    /// Environment steps between evaluations.
    pub evaluate_every: u64,
    /// Episodes in an evaluation.
    pub evaluation_episodes: usize,
    /// When to stop before the budget is used up.
    pub stop: StopRule,
}

impl Default for PpoBudget {
    fn default() -> Self {
        Self { evaluate_every: 10_000, evaluation_episodes: 20, stop: StopRule::Never }
    }
}

impl PpoLearner {
    /// A learner that begins with fresh networks.
    #[must_use]
    pub const fn new(settings: PpoSettings, budget: PpoBudget) -> Self {
        Self { settings, budget, start: None }
    }

    /// The same learner, which begins with `actor`.
    #[must_use]
    pub fn with_actor(self, actor: Actor) -> Self {
        Self { start: Some(actor), ..self }
    }
}

/// The best policy so far.
struct BestPolicy {
    actor: Actor,
    evaluation: Evaluation,
}

impl Learner for PpoLearner {
    fn learn(
        &self,
        environments: &mut [Box<dyn Environment>],
        rng: &mut Stream,
        observer: &mut Observer<'_>,
    ) -> Result<Trained, TrainError> {
        self.settings.validate()?;
        let batch = PlainBatch::new(environments)?;
        let spec = batch.spec();
        let state = match &self.start {
            Some(actor) => PpoState::with_actor(actor.clone(), &spec, &self.settings, rng),
            None => PpoState::new(&spec, &self.settings, rng),
        };
        let mut evaluation_rng = Stream::from_rng(rng);
        let mut run = PpoRun::new(batch, &self.settings, state)?;
        let (mut best, mut evaluated_at) = (None, 0);
        let stop = loop {
            if run.is_done() {
                break StopReason::Steps;
            }
            run.iterate()?;
            let is_due = run.state.env_steps >= evaluated_at + self.budget.evaluate_every || run.is_done();
            let mut found = None;
            let mut reached = false;
            if is_due {
                evaluated_at = run.state.env_steps;
                let (evaluation, is_met) = self.judge(&run, &mut evaluation_rng)?;
                // The policy that met the rule is the result.
                if is_met {
                    best = None;
                }
                keep(&mut best, &run, evaluation);
                (found, reached) = (Some(evaluation), is_met);
            }
            let mut progress = run.progress();
            progress.evaluation = found;
            progress.stop = Some(self.budget.stop);
            let asked = observer(&progress).is_break();
            if reached || asked {
                break if reached { StopReason::Rule } else { StopReason::Observer };
            }
        };
        if best.is_none() {
            let (evaluation, _) = self.judge(&run, &mut evaluation_rng)?;
            keep(&mut best, &run, evaluation);
        }
        let BestPolicy { actor, evaluation } = best.expect("an evaluation keeps a best policy");
        let PpoState { env_steps, updates, episodes, .. } = run.state;
        Ok(Trained { updates, episodes, ..Trained::new(actor, evaluation, stop, env_steps) })
    }
}

impl PpoLearner {
    /// Evaluates the policy as it is, on copies; true if the stop rule is met, after a confirmation.
    fn judge<E: Environment + Clone>(
        &self,
        run: &PpoRun<'_, PlainBatch<'_, E>>,
        rng: &mut Stream,
    ) -> Result<(Evaluation, bool), TrainError> {
        let mut copies = run.batch.environments.to_vec();
        let mut judged = |episodes| -> Result<Evaluation, TrainError> {
            let found = evaluate(&mut copies, &run.state.actor, episodes, rng)?;
            Ok(Evaluation { env_steps: run.state.env_steps, updates: run.state.updates, ..found })
        };
        let first = judged(self.budget.evaluation_episodes)?;
        let is_met = self.budget.stop.is_met(&first);
        match self.budget.stop {
            StopRule::Success { rate, episodes } if is_met && episodes > 0 => {
                let second = judged(episodes)?;
                Ok((first.pooled(&second), second.success_rate() >= rate))
            }
            StopRule::Success { .. } | StopRule::MeanReturn(_) | StopRule::Never => Ok((first, is_met)),
        }
    }
}

fn keep<B: BatchEnvironment>(best: &mut Option<BestPolicy>, run: &PpoRun<'_, B>, evaluation: Evaluation) {
    if best.as_ref().is_none_or(|best| evaluation.beats(&best.evaluation)) {
        *best = Some(BestPolicy { actor: run.state.actor.clone(), evaluation });
    }
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;

    use super::*;
    use crate::conformance::check_learner;
    use crate::learner::Progress;
    use crate::toy::{Identity, PointMass};

    #[test]
    fn proximal_policy_optimisation_conforms() {
        let settings = PpoSettings::default().with(|s| {
            s.hidden = vec![32];
            s.max_env_steps = 40_000;
            s.learning_rate = 2e-3;
            s.gamma = 0.5;
        });
        let budget = PpoBudget { stop: StopRule::MeanReturn(-0.3), ..PpoBudget::default() };
        let learner = PpoLearner::new(settings, budget);
        assert_eq!(check_learner(&learner, &mut Stream::seed_from_u64(1)), Ok(()));
    }

    #[test]
    fn an_actor_that_waits_does_not_change() {
        let actor = Actor::new(PointMass::default().spec(), &[8], &mut Stream::seed_from_u64(3));
        let settings = PpoSettings::default().with(|s| {
            (s.hidden, s.max_env_steps, s.actor_waits) = (vec![8], 1_000, 100);
        });
        let learner = PpoLearner::new(settings, PpoBudget::default()).with_actor(actor.clone());
        let mut worlds: Vec<Box<dyn Environment>> = vec![Box::new(PointMass::default())];
        let mut quiet = |_: &Progress<'_>| ControlFlow::Continue(());
        let trained = learner.learn(&mut worlds, &mut Stream::seed_from_u64(4), &mut quiet).expect("trains");
        let mut scratch = crate::ActorScratch::default();
        let mut mean = |actor: &Actor| {
            let mut action = [0.0; 2];
            actor.act_mean(&[0.3, -0.2, 0.1, 0.5], &mut scratch, &mut action);
            action
        };
        assert_eq!(mean(&trained.actor), mean(&actor));
        assert!(trained.updates > 0 && Identity::new(1).spec().action_len == 1, "the critic learnt");
    }
}
