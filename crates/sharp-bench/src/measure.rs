//! Measuring a baseline: prepared, driven and counted on the same map, robot, noise and simulator as SHARP.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use sharp_drive::{EpisodeEnd, MppiSettings, ProfiledFollower, SuccessCount, Supervisor};
use sharp_motion::{Budget, RrtSettings};
use sharp_plan::Conditions;
use sharp_rl::Progress;
use sharp_sim::SimulatorKind;
use sharp_space::Seed;

use crate::baselines::{FlatSac, Mpc, RoutePlanner, Rrt, SacBudget, Track};
use crate::contender::{ComparisonSettings, Contender, Driven, compare};
use crate::error::BenchError;
use crate::named::NamedProblem;
use crate::reports::{BaselineReport, BaselineTimes, MapReport, mean_of_successes};
use crate::stopwatch::{Stopwatch, clock_us, is_over};
use crate::times::DecisionTimes;

/// Longest crossing of a flat policy where no path tells, simulated seconds.
const HORIZON_S: f64 = 300.0;

/// A system to compare with.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum BaselineKind {
    /// The paper's: RRT, executed open-loop, planned anew from where it ended.
    Rrt,
    /// A drivable path, tracked in closed loop, planned anew on deviation.
    Track,
    /// Model-predictive path integral control along that path.
    Mppi,
    /// The paper's: one soft actor-critic policy from start to goal.
    Sac,
}

impl BaselineKind {
    /// Its name in results.
    #[must_use]
    pub const fn name(self) -> &'static str {
        match self {
            Self::Rrt => "rrt",
            Self::Track => "track",
            Self::Mppi => "mppi",
            Self::Sac => "sac",
        }
    }
}

/// How a baseline is measured.
#[derive(Clone, Debug)]
#[non_exhaustive]
pub struct BaselineSettings {
    /// Which one.
    pub kind: BaselineKind,
    /// Number of executions.
    pub episodes: u32,
    /// The simulator that it drives in.
    pub simulator: SimulatorKind,
    /// Whether touching a wall ends an execution; the paper bumps and goes on.
    pub contact_ends: bool,
    /// Wall time after which learning stops, or driving is given up; `None` is no limit. What is measured under a
    /// limit that strikes depends on the machine.
    pub time_limit: Option<Duration>,
    /// Samples of one plan of [`BaselineKind::Rrt`]; a plan that takes more has failed.
    pub rrt_samples: usize,
    /// Environment steps that [`BaselineKind::Sac`] may learn from.
    pub max_env_steps: u64,
    /// Root of all randomness; the noise of executions is the one that a plan run with the same seed meets.
    pub seed: u64,
}

impl BaselineSettings {
    /// Samples of one plan of RRT, unless asked otherwise.
    pub const RRT_SAMPLES: usize = 30_000;
    /// Environment steps of a flat policy, unless asked otherwise.
    pub const MAX_ENV_STEPS: u64 = 1_000_000;
    /// The wall time that the paper gives its baselines.
    pub const TIME_LIMIT: Duration = Duration::from_secs(2400);

    /// `kind` with `episodes` executions in rapier2d, where a contact is a failure.
    #[must_use]
    pub const fn new(kind: BaselineKind, episodes: u32, seed: u64) -> Self {
        Self {
            kind,
            episodes,
            simulator: SimulatorKind::Planar,
            contact_ends: true,
            time_limit: Some(Self::TIME_LIMIT),
            rrt_samples: Self::RRT_SAMPLES,
            max_env_steps: Self::MAX_ENV_STEPS,
            seed,
        }
    }
}

/// Watches a measurement and may stop it. `()` watches nothing.
pub trait MeasureMonitor: Sync {
    /// Learning took a step.
    fn trained(&self, _progress: &Progress<'_>) {}
    /// Asked often; true ends the measurement with the counts so far.
    fn should_stop(&self) -> bool {
        false
    }
}

impl MeasureMonitor for () {}

/// What preparing and driving gave.
#[derive(Default)]
struct Measured {
    driven: Vec<Driven>,
    env_steps: u64,
    gradient_steps: u64,
}

/// A measurement that is under way.
struct Measurement<'a> {
    problem: &'a NamedProblem,
    settings: &'a BaselineSettings,
    monitor: &'a dyn MeasureMonitor,
    comparison: ComparisonSettings,
    stopwatch: Stopwatch,
    deadline: Option<Instant>,
    seed: Seed,
}

/// Prepares a baseline for `problem`, lets it drive and counts; goes on with `stopwatch`, from whose start the time
/// limit counts.
///
/// # Errors
/// If the robot does not fit at an end of the problem, or learning fails.
pub fn measure(
    problem: &NamedProblem,
    settings: &BaselineSettings,
    stopwatch: Stopwatch,
    monitor: &dyn MeasureMonitor,
) -> Result<BaselineReport, BenchError> {
    problem.query.check(&problem.world)?;
    let comparison = ComparisonSettings {
        episodes: settings.episodes,
        simulator: problem.world.simulator(settings.simulator),
        noise: problem.noise_model.clone(),
        contact_ends: settings.contact_ends,
        seed: Seed(settings.seed),
    };
    let deadline = stopwatch.deadline(settings.time_limit);
    let seed = Seed(settings.seed).child("baseline", 0);
    let mut measurement = Measurement { problem, settings, monitor, comparison, stopwatch, deadline, seed };
    let measured = measurement.measure()?;
    Ok(measurement.report(measured.as_ref()))
}

impl Measurement<'_> {
    /// Prepares the system and lets it drive; `None` if no path leads to the goal.
    fn measure(&mut self) -> Result<Option<Measured>, BenchError> {
        let (settings, seed) = (self.settings, self.seed);
        let NamedProblem { world, query, noise_model, .. } = self.problem;
        let (noise, robot) = (noise_model.clone(), &world.robot);
        self.stopwatch.enter("plan");
        let planner = RoutePlanner::new(world, query.goal);
        if settings.kind == BaselineKind::Rrt {
            let budget = Budget { iterations: settings.rrt_samples };
            let rrt = Rrt {
                world,
                planner: &planner,
                query: *query,
                settings: RrtSettings { budget, ..RrtSettings::default() },
                contact_ends: settings.contact_ends,
                seed,
            };
            return Ok(Some(self.drive(&rrt)));
        }
        let route = planner.plan_from(query.start);
        self.stopwatch.stop();
        if settings.kind == BaselineKind::Sac {
            let length_s = route.map(|route| 6.0 * route.length_m() / robot.max_speed_mps);
            return self.learn(length_s.unwrap_or(HORIZON_S).max(60.0)).map(Some);
        }
        let Some(route) = route else { return Ok(None) };
        Ok(Some(if settings.kind == BaselineKind::Track {
            let follower = ProfiledFollower::tuned(robot, &noise);
            self.drive(&Track { world, planner: &planner, query: *query, route, follower, noise })
        } else {
            let settings = MppiSettings::new(robot, &noise);
            self.drive(&Mpc { world, planner: &planner, query: *query, route, settings, noise, seed })
        }))
    }

    fn learn(&mut self, horizon_s: f64) -> Result<Measured, BenchError> {
        self.stopwatch.enter("learn");
        let NamedProblem { world, query, noise_model, .. } = self.problem;
        let budget = SacBudget { max_env_steps: self.settings.max_env_steps, horizon_s };
        let mut observer = |progress: &Progress<'_>| {
            self.monitor.trained(progress);
            if self.should_stop() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let simulator = self.comparison.simulator.clone();
        let conditions = Conditions { simulator, noise: noise_model.clone() };
        let learnt = FlatSac::learn(world, *query, (&conditions, self.seed), budget, &mut observer)
            .map_err(|error| BenchError::Learning(error.to_string()))?;
        // The limit is for learning: what was learnt is driven in any case.
        self.deadline = None;
        let driven = self.drive(&learnt);
        Ok(Measured { env_steps: learnt.env_steps(), gradient_steps: learnt.gradient_steps(), ..driven })
    }

    fn should_stop(&self) -> bool {
        self.monitor.should_stop() || is_over(self.deadline)
    }

    fn drive(&mut self, contender: &dyn Contender) -> Measured {
        self.stopwatch.enter("drive");
        let clock_us = clock_us();
        let supervisor = Supervisor { clock_us: &clock_us, should_stop: &|| self.should_stop() };
        let NamedProblem { world, query, .. } = self.problem;
        let mut driven = compare(contender, world, query, &self.comparison, &supervisor);
        driven.retain(|one| one.end != EpisodeEnd::Stopped);
        self.stopwatch.stop();
        Measured { driven, ..Measured::default() }
    }

    fn report(&self, measured: Option<&Measured>) -> BaselineReport {
        let nothing = Measured::default();
        let Measured { driven, env_steps, gradient_steps } = measured.unwrap_or(&nothing);
        let (problem, settings, watch) = (self.problem, self.settings, &self.stopwatch);
        let ended = |end: EpisodeEnd| driven.iter().filter(|one| one.end == end).count() as u32;
        let episodes = driven.len() as u32;
        let count = SuccessCount { episodes, successes: ended(EpisodeEnd::Reached) };
        let records = || driven.iter().map(|one| (one.end, &one.record));
        let planning_us = driven.iter().map(|one| one.record.planning_us).sum::<f64>();
        BaselineReport {
            schema: "sharp.baseline/1",
            method: settings.kind.name(),
            status: match measured {
                None => "no_plan",
                Some(_) if episodes < settings.episodes => "timeout",
                Some(_) => "driven",
            },
            robot: problem.world.robot.name.clone(),
            noise: problem.noise.clone(),
            simulator: settings.simulator.to_string(),
            seed: settings.seed,
            map: MapReport::new(&problem.map, &problem.world.grid),
            episodes: count.episodes,
            successes: count.successes,
            success_rate: count.rate(),
            lower95: count.lower95(),
            upper95: count.upper95(),
            collisions: driven.iter().map(|one| one.record.contacts).sum(),
            timeouts: ended(EpisodeEnd::TimedOut) + ended(EpisodeEnd::Lost),
            strays: 0,
            recoveries: driven.iter().map(Driven::replans).sum(),
            mean_sim_time_s: mean_of_successes(records(), |record| record.time_s),
            mean_path_m: mean_of_successes(records(), |record| record.path_m),
            env_steps: *env_steps,
            gradient_steps: *gradient_steps,
            decision_us: DecisionTimes::of(driven.iter().map(|one| &one.record)),
            time_s: BaselineTimes {
                load: watch.spent_s("load"),
                plan: watch.spent_s("plan") + 1e-6 * planning_us / driven.len().max(1) as f64,
                learn: watch.spent_s("learn"),
                drive: watch.spent_s("drive"),
                total: watch.total_s(),
            },
        }
    }
}
