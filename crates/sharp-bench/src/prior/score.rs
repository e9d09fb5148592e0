//! How well policies drive on their own, option by option.

use std::collections::BTreeMap;

use serde::Serialize;
use sharp_drive::{Follower, OptionPolicy, Prior, ProfiledFollower, SuccessEstimate};
use sharp_plan::TrainingRoute;
use sharp_sim::{NoiseModel, RobotModel};
use sharp_space::Seed;

/// How a policy did on its own, option by option.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct PolicyScore {
    /// Mean share of successful episodes.
    pub success: f64,
    /// Share of the options on which it succeeded in at least 99 % of the episodes.
    pub legs_at_99: f64,
    /// Share of successful episodes on the option where it did worst.
    pub worst_leg: f64,
    /// Mean time of the successful episodes, seconds.
    pub mean_sim_time_s: f64,
}

impl PolicyScore {
    /// The score of estimates, one for each option.
    #[must_use]
    pub fn of(trials: &[SuccessEstimate]) -> Self {
        let count = trials.len().max(1) as f64;
        let rates = || trials.iter().map(|trial| trial.count.rate());
        let timed: Vec<f64> =
            trials.iter().map(|trial| trial.mean_time_s).filter(|s| s.is_finite()).collect();
        Self {
            success: rates().sum::<f64>() / count,
            legs_at_99: rates().filter(|&rate| rate >= 0.99).count() as f64 / count,
            worst_leg: rates().fold(1.0, f64::min),
            mean_sim_time_s: timed.iter().sum::<f64>() / timed.len().max(1) as f64,
        }
    }
}

/// Drives every option of `routes` under `noise` with each of `policies`, so many `episodes` each.
#[must_use]
pub fn score_policies(
    routes: &[TrainingRoute],
    policies: Vec<(String, OptionPolicy)>,
    noise: &NoiseModel,
    (episodes, seed): (u32, Seed),
) -> BTreeMap<String, PolicyScore> {
    let score = |policy: &OptionPolicy| {
        let trials: Vec<_> =
            routes.iter().flat_map(|route| route.estimate(policy, noise, episodes, seed)).collect();
        PolicyScore::of(&trials)
    };
    policies.into_iter().map(|(name, policy)| (name, score(&policy))).collect()
}

/// Every policy that an option may be given without learning, by a name that sorts.
#[must_use]
pub fn prior_candidates(
    prior: &Prior,
    robot: &RobotModel,
    noise: &NoiseModel,
) -> Vec<(String, OptionPolicy)> {
    let named = |kind: &str, policies: Vec<OptionPolicy>| {
        let name = |(index, policy)| (format!("{kind} {index:02}"), policy);
        policies.into_iter().enumerate().map(name).collect::<Vec<_>>()
    };
    let followers = Follower::candidates(robot).into_iter().map(OptionPolicy::Follower).collect();
    let paced = ProfiledFollower::candidates(robot).into_iter().map(OptionPolicy::Profiled).collect();
    let mut all = named("prior", prior.candidates(robot, noise));
    all.extend(named("follower", followers));
    all.extend(named("profiled", paced));
    all
}
