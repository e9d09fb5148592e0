//! Running a plan in a simulator, episode by episode.

use std::sync::Arc;

use sharp_drive::{EpisodeEnd, EpisodeRecord, EpisodeRules, SuccessCount, TIME_LIMIT_MIN_S};
use sharp_sim::{NoiseModel, Simulator, SimulatorKind};
use sharp_space::Seed;

use crate::composed::Events;
use crate::plan_file::Plan;
use crate::tour::Tour;

/// The time limit of an episode, in units of the predicted time.
pub(crate) const TIME_LIMIT_FACTOR: f64 = 3.0;

/// How a plan is run.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct RunSettings {
    /// Number of episodes.
    pub episodes: u32,
    /// The simulator; episodes run in forks of it.
    pub simulator: Box<dyn Simulator>,
    /// Its noise.
    pub noise: NoiseModel,
    /// Whether a robot that strayed, stands still or is late gets a new plan.
    pub recovery: bool,
    /// Whether touching a wall ends the episode as a failure; the paper bumps and goes on.
    pub contact_ends: bool,
    /// Simulated time after which an episode fails, seconds.
    pub time_limit_s: f64,
    /// Seed of the episodes' noise.
    pub seed: Seed,
}

impl RunSettings {
    /// `episodes` of `plan` as the project measures them: planar physics, the plan's noise, recovery,
    /// contact as failure, three times the predicted time and at least a minute.
    #[must_use]
    pub fn new(plan: &Plan, episodes: u32, seed: Seed) -> Self {
        Self {
            episodes,
            simulator: plan.world.simulator(SimulatorKind::Planar),
            noise: plan.noise.clone(),
            recovery: true,
            contact_ends: true,
            time_limit_s: (TIME_LIMIT_FACTOR * plan.solution.predicted_time_s).max(TIME_LIMIT_MIN_S),
            seed,
        }
    }
}

/// One execution of a plan.
#[derive(Clone, Debug)]
pub struct Execution {
    /// Why it ended.
    pub end: EpisodeEnd,
    /// What happened.
    pub record: EpisodeRecord,
    /// What went otherwise than planned.
    pub events: Events,
}

/// Runs `plan`; `clock_us` tells the wall time in microseconds. Executions come in order.
#[must_use]
pub fn run(plan: &Arc<Plan>, settings: &RunSettings, clock_us: &(dyn Fn() -> f64 + Sync)) -> Vec<Execution> {
    Tour::from(Arc::clone(plan)).run(settings, clock_us)
}

/// The rules that `settings` ask for.
pub(crate) fn rules(settings: &RunSettings) -> EpisodeRules {
    EpisodeRules::default().with_contact_ends(settings.contact_ends).with_time_limit_s(settings.time_limit_s)
}

/// Successes among `executions`.
#[must_use]
pub fn success(executions: &[Execution]) -> SuccessCount {
    SuccessCount::count(executions.iter().map(|execution| execution.end == EpisodeEnd::Reached))
}

#[cfg(test)]
mod tests {
    use sharp_options::OptionKind;

    use super::*;
    use crate::test_worlds::plan;

    fn episodes(settings: impl Fn(RunSettings) -> RunSettings) -> Vec<Execution> {
        let plan = plan(OptionKind::Centroid);
        run(&plan, &settings(RunSettings::new(&plan, 3, Seed(1))), &|| 0.0)
    }

    #[test]
    fn without_noise_the_plan_holds_in_both_simulators() {
        for simulator in [SimulatorKind::Planar, SimulatorKind::Kinematic] {
            let world = plan(OptionKind::Centroid).world.clone();
            let episodes =
                episodes(|settings| RunSettings { simulator: world.simulator(simulator), ..settings });
            assert_eq!(success(&episodes), SuccessCount { episodes: 3, successes: 3 }, "{simulator:?}");
            for episode in &episodes {
                assert!(
                    (6.0..10.0).contains(&episode.record.path_m),
                    "{simulator:?}: 8 m are {} m",
                    episode.record.path_m
                );
                assert_eq!(episode.record.contacts, 0, "{simulator:?}");
                assert!(
                    episode.record.decisions_us.len() >= episode.record.trace.len(),
                    "{simulator:?}: a decision a pose"
                );
            }
        }
    }

    #[test]
    fn no_time_is_no_success() {
        let episodes = episodes(|settings| RunSettings { time_limit_s: 2.0, ..settings });
        assert!(episodes.iter().all(|episode| episode.end == EpisodeEnd::TimedOut), "{episodes:?}");
        assert_eq!(success(&episodes).successes, 0, "none in two seconds");
    }

    #[test]
    fn noise_makes_episodes_differ_and_seeds_repeat_them() {
        let noisy = |seed| {
            let noise = NoiseModel::by_name("harsh").expect("a built-in noise");
            let episodes =
                episodes(|settings| RunSettings { noise: noise.clone(), seed: Seed(seed), ..settings });
            episodes.into_iter().map(|episode| episode.record.trace).collect::<Vec<_>>()
        };
        let first = noisy(1);
        assert_eq!(first, noisy(1), "equal seeds");
        assert_ne!(first, noisy(2), "other seeds");
        assert_ne!(first[0], first[1], "episodes of one run");
    }
}
