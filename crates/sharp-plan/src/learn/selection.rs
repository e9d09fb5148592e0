//! The default: the prior where it succeeds often enough, else a follower, and training only in repairs.

use std::sync::Arc;

use rayon::prelude::*;
use sharp_drive::{OptionPolicy, PolicyContext, Prior, SuccessCount, SuccessEstimate, prior_interface};
use sharp_guide::ProgressReward;
use sharp_rl::{Exploration, SacLearner, SacStart, SacState, StopRule, TrainSettings};

use super::network::{NetworkTraining, train_network};
use super::{LearnFailure, LearningMonitor, LearningTask, LearntPolicy, OptionLearner};

/// Rounds of successive halving: the share of the screening episodes that each candidate drives, and how many
/// candidates go on. Those that the last round leaves are compared on all episodes.
const ROUNDS: [(f64, usize); 2] = [(0.3, 3), (1.0, 2)];
/// Widths of the prior's hidden layers.
const PRIOR_HIDDEN: [usize; 2] = [128, 128];
/// Reward of a contact while a prior is trained on: what it was trained with at full caution.
const FINE_CONTACT: f64 = -20.0;

/// Takes the prior, and a follower where that falls short; trains the prior on where a plan falls short and nothing
/// at hand succeeds often enough.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub struct Selection {
    /// The prior is doubted where it succeeds less often, share of episodes: then it is compared with followers.
    pub doubted_below: f64,
    /// Episodes in which candidates are compared.
    pub screening_episodes: u32,
    /// Fresh episodes that the best of them are judged by.
    pub judge_episodes: u32,
    /// The prior is trained on where nothing else succeeds as often as this, share of episodes; 0 for never.
    pub train_below: f64,
    /// Budget and hyperparameters of training.
    pub train: TrainSettings,
    /// Environments that are stepped in turn.
    pub environments: u64,
}

impl Default for Selection {
    fn default() -> Self {
        Self {
            doubted_below: 0.975,
            screening_episodes: 100,
            judge_episodes: 500,
            train_below: 0.97,
            // Few steps: the prior drives already, and what it has not learnt then it hardly will.
            train: TrainSettings::fast().with(|train| {
                train.sac.hidden = PRIOR_HIDDEN.to_vec();
                train.sac.learning_rate = 3e-4;
                train.sac.updates_per_step = 0.25;
                train.sac.warmup_steps = 1_000;
                train.sac.exploration = Exploration::Policy;
                train.max_env_steps = 12_000;
                train.evaluate_every = 2_000;
                train.stop = StopRule::Success { rate: 0.995, episodes: 400 };
            }),
            environments: 16,
        }
    }
}

impl OptionLearner for Selection {
    fn learn(
        &self,
        task: &LearningTask<'_>,
        monitor: &dyn LearningMonitor,
    ) -> Result<LearntPolicy, LearnFailure> {
        if monitor.should_stop() {
            return Err(LearnFailure::Stopped);
        }
        let policy = prior(task);
        let estimate = task.estimate(&policy);
        if estimate.count.rate() >= self.doubted_below {
            return Ok(LearntPolicy::untrained(policy, estimate));
        }
        let task = &LearningTask { estimate_episodes: self.judge_episodes, ..task.clone() };
        let (estimate, policy) = self.choose(task, None, monitor)?.expect("there are candidates");
        let alone = task.estimate_alone(&policy, estimate);
        Ok(LearntPolicy::untrained(policy, alone))
    }

    fn improve(
        &self,
        task: &LearningTask<'_>,
        beaten: SuccessCount,
        may_train: bool,
        monitor: &dyn LearningMonitor,
    ) -> Result<Option<LearntPolicy>, LearnFailure> {
        let chosen = self.choose(task, Some(beaten), monitor)?;
        let most = chosen.as_ref().map(|(judged, _)| judged.count);
        let most = most.filter(|count| count.successes > beaten.successes).unwrap_or(beaten);
        let mut effort = (0, 0);
        // What a first choice lacks the plan may not need: training takes longer than all the rest.
        if may_train && most.rate() < self.train_below {
            match self.train_prior(task, monitor) {
                Ok(trained) => {
                    let is_judged = task.tail.is_empty();
                    let judged = if is_judged { trained.estimate } else { task.judge(&trained.policy) };
                    if judged.count.successes > most.successes {
                        return Ok(Some(trained));
                    }
                    effort = (trained.env_steps, trained.gradient_steps);
                }
                // The chosen policy is kept if a training went wrong.
                Err(LearnFailure::Broken(_)) => {}
                Err(failure) => return Err(failure),
            }
        }
        Ok(chosen.map(|(judged, policy)| {
            let estimate = task.estimate_alone(&policy, judged);
            let (env_steps, gradient_steps) = effort;
            LearntPolicy { env_steps, gradient_steps, ..LearntPolicy::untrained(policy, estimate) }
        }))
    }

    fn at_hand(&self, task: &LearningTask<'_>) -> Option<OptionPolicy> {
        Some(prior(task))
    }

    fn has_stand_in(&self) -> bool {
        true
    }

    fn train_below(&self) -> f64 {
        self.train_below
    }
}

impl Selection {
    /// The cheapest of the prior and the fallbacks; `None` if nothing succeeds more often than `beaten`, or as often as is
    /// wanted.
    fn choose(
        &self,
        task: &LearningTask<'_>,
        beaten: Option<SuccessCount>,
        monitor: &dyn LearningMonitor,
    ) -> Result<Option<(SuccessEstimate, OptionPolicy)>, LearnFailure> {
        let robot = &task.world.robot;
        let episodes = task.estimate_episodes;
        let allowed = (f64::from(episodes) * (1.0 - task.wanted_success)).floor() as u32;
        let mut candidates = vec![prior(task)];
        candidates.extend(OptionPolicy::fallbacks(robot));
        let mut best: Option<(SuccessEstimate, OptionPolicy)> = None;
        for policy in self.cheapest(task, candidates) {
            if monitor.should_stop() {
                return Err(LearnFailure::Stopped);
            }
            let useful = beaten.map_or(episodes, |beaten| beaten.failures().saturating_sub(1));
            let judged = task.judge_while(&policy, useful.max(allowed));
            if judged.count.episodes < episodes {
                continue;
            }
            let is_useful = beaten.is_none_or(|beaten| judged.count.successes > beaten.successes);
            let is_good = is_useful || judged.count.failures() <= allowed;
            let cost_s = |judged: &SuccessEstimate| judged.cost_s(task.failure_cost_s);
            if is_good && best.as_ref().is_none_or(|best| cost_s(&judged) < cost_s(&best.0)) {
                best = Some((judged, policy));
            }
        }
        Ok(best)
    }

    /// The few of `candidates` that cost least, the cheapest first.
    fn cheapest(&self, task: &LearningTask<'_>, candidates: Vec<OptionPolicy>) -> Vec<OptionPolicy> {
        successive_halving(candidates, self.screening_episodes, |policy, episodes, round| {
            let trial = task.monte_carlo(episodes, "screen", round);
            trial.estimate(&task.drivers(policy), &task.states).cost_s(task.failure_cost_s)
        })
    }

    /// The prior, trained further on this option alone.
    fn train_prior(
        &self,
        task: &LearningTask<'_>,
        monitor: &dyn LearningMonitor,
    ) -> Result<LearntPolicy, LearnFailure> {
        let robot = &task.world.robot;
        let reward = ProgressReward { contact: FINE_CONTACT, ..ProgressReward::default() };
        let actor = task.world.prior().actor().clone();
        let mut train = self.train.clone();
        // A prior of somebody's own may be wider than the shipped ones.
        let sizes = actor.network().sizes();
        train.sac.hidden = sizes[1..sizes.len() - 1].to_vec();
        let networks = SacState::with_actor(actor, &train.sac, &mut task.seed.stream("critics", 0));
        let start = SacStart::Networks(Box::new(networks));
        let learner = SacLearner::new(train).with_start(start);
        let training = NetworkTraining {
            interface: prior_interface(robot, PolicyContext::new(&task.conditions.noise, 1.0)),
            reward: Arc::new(reward),
            learner: &learner,
            ends_at_standstill: false,
            environments: self.environments,
        };
        train_network(task, &training, monitor)
    }
}

/// The prior at the caution that fits the price of a failure.
fn prior(task: &LearningTask<'_>) -> OptionPolicy {
    let (robot, noise) = (&task.world.robot, &task.conditions.noise);
    task.world.prior().at(Prior::caution(robot, task.failure_cost_s), robot, noise)
}

/// Successive halving (Jamieson and Talwalkar 2016): each round compares fewer candidates on more episodes.
/// `cost_s(policy, episodes, round)` drives a policy. The cheapest comes first.
fn successive_halving(
    mut candidates: Vec<OptionPolicy>,
    episodes: u32,
    cost_s: impl Fn(&OptionPolicy, u32, u64) -> f64 + Sync,
) -> Vec<OptionPolicy> {
    for (round, (share, keep)) in (0..).zip(ROUNDS) {
        let episodes = (share * f64::from(episodes)).ceil() as u32;
        let mut costs: Vec<(f64, OptionPolicy)> =
            candidates.into_par_iter().map(|policy| (cost_s(&policy, episodes, round), policy)).collect();
        costs.sort_by(|a, b| a.0.total_cmp(&b.0));
        candidates = costs.into_iter().take(keep).map(|(_, policy)| policy).collect();
    }
    candidates
}

#[cfg(test)]
mod tests {
    use sharp_drive::InitialStates;
    use sharp_options::OptionKind;
    use sharp_sim::NoiseModel;
    use sharp_sim::RobotState;
    use sharp_space::Seed;

    use super::*;
    use crate::conditions::Conditions;
    use crate::method::Method;
    use crate::test_worlds::{HALL, along, options, world};

    #[test]
    fn an_easy_option_needs_no_training() {
        let (world, abstraction) = world(HALL, OptionKind::Centroid);
        let options = options(&world, &abstraction, along());
        let start = RobotState::at_rest(options[1].guide.start());
        let (conditions, method) = (Conditions::new(&world, NoiseModel::nominal()), Method::fast());
        let task = LearningTask {
            world: &world,
            conditions: &conditions,
            option: &options[1],
            next: None,
            tail: &[],
            states: Arc::new(InitialStates::exactly(start)),
            wanted_success: method.option_success,
            failure_cost_s: method.failure_cost_s,
            estimate_episodes: method.estimate_episodes,
            seed: Seed(1),
        };
        let learnt = method.learner.learn(&task, &|| false).expect("a sound task");
        assert_eq!((learnt.env_steps, learnt.gradient_steps), (0, 0), "trained in an open hall");
        assert_eq!(learnt.estimate.count.episodes, 100, "estimated on fresh episodes");
        assert!(learnt.estimate.count.rate() >= 0.99, "only {:?}", learnt.estimate);
        let stopped = method.learner.learn(&task, &|| true);
        assert!(matches!(stopped, Err(LearnFailure::Stopped)), "a stop is heard");
    }
}
