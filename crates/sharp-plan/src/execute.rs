//! Running a plan in a simulator, episode by episode.

use std::sync::Arc;

use rayon::prelude::*;
use sharp_sim::{ActionSettings, AnySim, NoiseModel, RobotState, SimulatorKind, Vehicle};
use sharp_space::{Pose, Seed};

use crate::composed::{ComposedPolicy, Decision, Events};
use crate::plan::Plan;
use crate::stats::Tally;

/// How a plan is run.
#[derive(Clone, Debug)]
pub struct RunSettings {
    /// Number of episodes.
    pub episodes: u32,
    /// The simulator.
    pub simulator: SimulatorKind,
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
            simulator: SimulatorKind::Planar,
            noise: plan.noise.clone(),
            recovery: true,
            contact_ends: true,
            time_limit_s: (3.0 * plan.solution.predicted_time_s).max(60.0),
            seed,
        }
    }
}

/// Why an episode ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum EpisodeEnd {
    /// At the goal.
    Reached,
    /// Against a wall.
    Collided,
    /// At the time limit.
    TimedOut,
    /// Where no plan leads on.
    Lost,
}

/// One episode.
#[derive(Clone, Debug)]
pub struct Episode {
    /// Why it ended.
    pub end: EpisodeEnd,
    /// Simulated time, seconds.
    pub time_s: f64,
    /// Distance driven, metres.
    pub path_m: f64,
    /// Collisions with a wall, however the episode went on.
    pub contacts: u32,
    /// What went otherwise than planned.
    pub events: Events,
    /// The pose after each action, the start first.
    pub trace: Vec<Pose>,
    /// Wall time of each decision, microseconds.
    pub decisions_us: Vec<f64>,
}

/// Runs `plan`; `clock_us` tells the wall time in microseconds. Episodes come in order.
#[must_use]
pub fn run(plan: &Arc<Plan>, settings: &RunSettings, clock_us: &(dyn Fn() -> f64 + Sync)) -> Vec<Episode> {
    let workspace = &plan.workspace;
    let actions = ActionSettings { stop_at_contact: settings.contact_ends, ..ActionSettings::default() };
    let sim = AnySim::new(settings.simulator, Arc::clone(&workspace.world), &workspace.robot);
    let vehicle = Vehicle::new(sim, Arc::clone(&workspace.robot), settings.noise.clone(), actions);
    (0..settings.episodes)
        .into_par_iter()
        .map(|episode| {
            let mut vehicle = vehicle.clone();
            vehicle.reset(RobotState::at_rest(plan.solution.query.start), settings.seed, u64::from(episode));
            run_episode(plan, settings, vehicle, clock_us)
        })
        .collect()
}

fn run_episode(
    plan: &Arc<Plan>,
    settings: &RunSettings,
    mut vehicle: Vehicle<AnySim>,
    clock_us: &dyn Fn() -> f64,
) -> Episode {
    let start = *vehicle.state();
    let mut policy = ComposedPolicy::new(Arc::clone(plan), start, settings.recovery);
    let mut episode = Episode {
        end: EpisodeEnd::TimedOut,
        time_s: 0.0,
        path_m: 0.0,
        contacts: 0,
        events: Events::default(),
        trace: vec![start.pose],
        decisions_us: vec![],
    };
    while episode.time_s < settings.time_limit_s {
        let before_us = clock_us();
        let decision = policy.decide();
        episode.decisions_us.push(clock_us() - before_us);
        let (waypoint, speed_mps) = match decision {
            Decision::Waypoint(waypoint, speed_mps) => (waypoint, speed_mps),
            Decision::Recovering(waypoint, speed_mps) => {
                let reverse_m = plan.workspace.robot.recovery_reverse_m;
                if episode.contacts > 0 && reverse_m > 0.0 {
                    // Out of contact first: a forward-only robot with its nose at a wall cannot turn.
                    let report = vehicle.back_off(reverse_m);
                    episode.time_s += report.time_s;
                    policy.observe(report.after);
                    continue;
                }
                (waypoint, speed_mps)
            }
            Decision::Reached => {
                episode.end = EpisodeEnd::Reached;
                break;
            }
            Decision::Lost => {
                episode.end = EpisodeEnd::Lost;
                break;
            }
        };
        let report = vehicle.act_at(waypoint, speed_mps);
        episode.time_s += report.time_s;
        episode.path_m += report.path_m;
        episode.trace.push(report.after.pose);
        episode.contacts += u32::from(report.contact);
        if report.contact && settings.contact_ends {
            episode.end = EpisodeEnd::Collided;
            break;
        }
        policy.observe(report.after);
    }
    episode.events = policy.events();
    episode
}

/// Successes among `episodes`.
#[must_use]
pub fn success(episodes: &[Episode]) -> Tally {
    Tally::count(episodes.iter().map(|episode| episode.end == EpisodeEnd::Reached))
}

#[cfg(test)]
mod tests {
    use sharp_options::OptionKind;

    use super::*;
    use crate::drawn::plan;

    fn episodes(settings: impl Fn(RunSettings) -> RunSettings) -> Vec<Episode> {
        let plan = plan(OptionKind::Centroid);
        run(&plan, &settings(RunSettings::new(&plan, 3, Seed(1))), &|| 0.0)
    }

    #[test]
    fn without_noise_the_plan_holds_in_both_simulators() {
        for simulator in [SimulatorKind::Planar, SimulatorKind::Kinematic] {
            let episodes = episodes(|settings| RunSettings { simulator, ..settings });
            assert_eq!(success(&episodes), Tally { episodes: 3, successes: 3 }, "{simulator:?}");
            for episode in &episodes {
                assert!((6.0..10.0).contains(&episode.path_m), "{simulator:?}: 8 m are {} m", episode.path_m);
                assert_eq!(episode.contacts, 0, "{simulator:?}");
                assert!(
                    episode.decisions_us.len() >= episode.trace.len(),
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
            episodes.into_iter().map(|episode| episode.trace).collect::<Vec<_>>()
        };
        let first = noisy(1);
        assert_eq!(first, noisy(1), "equal seeds");
        assert_ne!(first, noisy(2), "other seeds");
        assert_ne!(first[0], first[1], "episodes of one run");
    }
}
