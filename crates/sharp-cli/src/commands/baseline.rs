//! `sharp baseline`: the systems to compare with, on the same map, robot, noise and simulator.

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use serde::Serialize;
use sharp_bench::{
    ComparisonSettings, Contender as System, DecisionTimes, Driven, FlatSac, Mpc, RoutePlanner, Rrt,
    SacBudget, Track, compare,
};
use sharp_drive::{EpisodeEnd, MppiSettings, ProfiledFollower, SuccessCount, Supervisor, World};
use sharp_motion::{Budget, RrtSettings};
use sharp_plan::{Conditions, Query};
use sharp_rl::Progress;
use sharp_sim::NoiseModel;
use sharp_space::Seed;

use crate::args::{Baseline, BaselineName, Collisions};
use crate::curves::CurveFolder;
use crate::input;
use crate::outcome::{Exit, Failure, say, to_json};
use crate::progress::{Stopwatch, is_interrupted, spinner};
use crate::report::MapReport;

/// Wall time that the paper gives its baselines, seconds.
const TIME_LIMIT_S: f64 = 2400.0;
/// Longest crossing of a flat policy where no path tells, simulated seconds.
const HORIZON_S: f64 = 300.0;

/// Wall time by phase, seconds. `plan` and `learn` are what one execution needs before and while it
/// drives; `drive` is what simulating all of them took, their planning included.
#[derive(Clone, Copy, Debug, Serialize)]
pub(crate) struct BaselineTimes {
    pub(crate) load: f64,
    pub(crate) plan: f64,
    pub(crate) learn: f64,
    pub(crate) drive: f64,
    pub(crate) total: f64,
}

/// `sharp.baseline/1`.
#[derive(Debug, Serialize)]
pub(crate) struct BaselineReport {
    pub(crate) schema: &'static str,
    pub(crate) method: &'static str,
    pub(crate) status: &'static str,
    pub(crate) robot: String,
    pub(crate) noise: String,
    pub(crate) simulator: String,
    pub(crate) seed: u64,
    pub(crate) map: MapReport,
    pub(crate) episodes: u32,
    pub(crate) successes: u32,
    pub(crate) success_rate: f64,
    pub(crate) lower95: f64,
    pub(crate) upper95: f64,
    pub(crate) collisions: u32,
    pub(crate) timeouts: u32,
    pub(crate) strays: u32,
    pub(crate) recoveries: u32,
    pub(crate) mean_sim_time_s: f64,
    pub(crate) mean_path_m: f64,
    pub(crate) env_steps: u64,
    pub(crate) gradient_steps: u64,
    pub(crate) decision_us: DecisionTimes,
    pub(crate) time_s: BaselineTimes,
}

/// The problem with everything around it.
struct Bench<'a> {
    args: &'a Baseline,
    world: World,
    query: Query,
    settings: ComparisonSettings,
    seed: Seed,
}

/// What preparing and driving gave.
#[derive(Default)]
struct Measured {
    driven: Vec<Driven>,
    env_steps: u64,
    gradient_steps: u64,
}

pub(crate) fn run(args: &Baseline, seed: u64, json: bool) -> Result<Exit, Failure> {
    let bar = spinner(args.system.name());
    let report = measure(args, seed)?;
    bar.finish_and_clear();
    if json {
        say!("{}", to_json(&report));
    } else {
        print_report(&report);
    }
    Ok(match report.status {
        _ if is_interrupted() => Exit::Interrupted,
        "driven" => Exit::Done,
        _ => Exit::No,
    })
}

/// Prepares the system, drives and counts; prints nothing. After an interrupt the counts are those so far.
pub(crate) fn measure(args: &Baseline, seed: u64) -> Result<BaselineReport, Failure> {
    let mut stopwatch = Stopwatch::start();
    stopwatch.enter("load");
    let limit_s = args.time_limit.unwrap_or(TIME_LIMIT_S);
    let limit = Duration::try_from_secs_f64(limit_s).map_err(|_| {
        Failure::new("USAGE", format!("--time-limit is {limit_s}, expected a number of seconds from 0 on"))
    })?;
    let deadline = Instant::now().checked_add(limit);
    let map = input::map(&args.map)?;
    let query = input::query(&map, args.start.as_deref(), args.goal.as_deref(), args.problem)?;
    let noise = input::noise(&args.noise)?;
    let world = World::new(map.grid.clone(), input::robot(&args.robot)?);
    input::check_query(&world, &query)?;
    let settings = comparison(args, &world, noise, seed)?;
    let bench = Bench { args, world, query, settings, seed: Seed(seed).child("baseline", 0) };
    let stop = || is_interrupted() || deadline.is_some_and(|deadline| Instant::now() >= deadline);
    let measured = bench.measure(&mut stopwatch, &stop)?;
    Ok(bench.report(seed, MapReport::new(&map.name, &map.grid), measured.as_ref(), &stopwatch))
}

fn comparison(
    args: &Baseline,
    world: &World,
    noise: NoiseModel,
    seed: u64,
) -> Result<ComparisonSettings, Failure> {
    let simulator = world.simulator(input::simulator(&args.simulator)?);
    Ok(ComparisonSettings {
        episodes: args.episodes,
        simulator,
        noise,
        contact_ends: args.collisions == Collisions::End,
        // The noise of `sharp run --seed`: what is compared meets the same luck.
        seed: Seed(seed),
    })
}

impl Bench<'_> {
    /// Prepares the system and lets it drive; `None` if no path leads to the goal.
    fn measure(
        &self,
        stopwatch: &mut Stopwatch,
        stop: &(dyn Fn() -> bool + Sync),
    ) -> Result<Option<Measured>, Failure> {
        let Self { args, world, query, seed, .. } = self;
        stopwatch.enter("plan");
        let planner = RoutePlanner::new(world, query.goal);
        if args.system == BaselineName::Rrt {
            let budget = Budget { iterations: args.rrt_samples };
            let settings = RrtSettings { budget, ..RrtSettings::default() };
            let rrt = Rrt {
                world,
                planner: &planner,
                query: *query,
                settings,
                contact_ends: self.settings.contact_ends,
                seed: *seed,
            };
            return Ok(Some(self.drive(&rrt, stopwatch, stop)));
        }
        let route = planner.plan_from(query.start);
        stopwatch.stop();
        if args.system == BaselineName::Sac {
            let length_s = route.map(|route| 6.0 * route.length_m() / world.robot.max_speed_mps);
            return self.learn(length_s.unwrap_or(HORIZON_S).max(60.0), stopwatch, stop).map(Some);
        }
        let Some(route) = route else { return Ok(None) };
        let (robot, noise) = (&world.robot, self.settings.noise.clone());
        Ok(Some(if args.system == BaselineName::Track {
            self.drive(
                &Track {
                    world,
                    planner: &planner,
                    query: *query,
                    route,
                    follower: ProfiledFollower::tuned(robot, &noise),
                    noise,
                },
                stopwatch,
                stop,
            )
        } else {
            let settings = MppiSettings::new(robot, &noise);
            self.drive(
                &Mpc { world, planner: &planner, query: *query, route, settings, noise, seed: *seed },
                stopwatch,
                stop,
            )
        }))
    }

    fn learn(
        &self,
        horizon_s: f64,
        stopwatch: &mut Stopwatch,
        stop: &(dyn Fn() -> bool + Sync),
    ) -> Result<Measured, Failure> {
        stopwatch.enter("learn");
        let budget = SacBudget { max_env_steps: self.args.max_env_steps, horizon_s };
        let mut curves = self.args.tensorboard.as_deref().map(CurveFolder::new);
        let mut observer = |progress: &Progress<'_>| {
            if let Some(curves) = &mut curves {
                curves.note("sac", progress);
            }
            if stop() { ControlFlow::Break(()) } else { ControlFlow::Continue(()) }
        };
        let conditions = Conditions::new(&self.world, self.settings.noise.clone());
        let learnt = FlatSac::learn(&self.world, self.query, (&conditions, self.seed), budget, &mut observer)
            .map_err(|error| Failure::from(anyhow::Error::from(error)))?;
        // The limit is for learning: what was learnt is driven in any case.
        let driven = self.drive(&learnt, stopwatch, &is_interrupted);
        Ok(Measured { env_steps: learnt.env_steps(), gradient_steps: learnt.gradient_steps(), ..driven })
    }

    fn drive(
        &self,
        system: &dyn System,
        stopwatch: &mut Stopwatch,
        stop: &(dyn Fn() -> bool + Sync),
    ) -> Measured {
        stopwatch.enter("drive");
        let begun = Instant::now();
        let clock_us = || begun.elapsed().as_secs_f64() * 1e6;
        let supervisor = Supervisor { clock_us: &clock_us, should_stop: stop };
        let driven = compare(system, &self.world, &self.query, &self.settings, &supervisor);
        stopwatch.stop();
        Measured { driven, ..Measured::default() }
    }

    fn report(
        &self,
        seed: u64,
        map: MapReport,
        measured: Option<&Measured>,
        watch: &Stopwatch,
    ) -> BaselineReport {
        let nothing = Measured::default();
        let Measured { driven, env_steps, gradient_steps } = measured.unwrap_or(&nothing);
        let ended = |end: EpisodeEnd| driven.iter().filter(|one| one.end == end).count() as u32;
        let tally = SuccessCount { episodes: self.args.episodes, successes: ended(EpisodeEnd::Reached) };
        let mean = |of: fn(&Driven) -> f64| {
            let reached = driven.iter().filter(|one| one.end == EpisodeEnd::Reached);
            reached.map(of).fold(0.0, |sum, value| sum + value) / f64::from(tally.successes.max(1))
        };
        let planning_us =
            driven.iter().map(|one| one.record.planning_us).sum::<f64>() / driven.len().max(1) as f64;
        BaselineReport {
            schema: "sharp.baseline/1",
            method: self.args.system.name(),
            status: if measured.is_some() { "driven" } else { "no_plan" },
            robot: self.world.robot.name.clone(),
            noise: self.args.noise.clone(),
            simulator: self.args.simulator.clone(),
            seed,
            map,
            episodes: tally.episodes,
            successes: tally.successes,
            success_rate: tally.rate(),
            lower95: tally.lower95(),
            upper95: tally.upper95(),
            collisions: driven.iter().map(|one| one.record.contacts).sum(),
            timeouts: ended(EpisodeEnd::TimedOut) + ended(EpisodeEnd::Lost),
            strays: 0,
            recoveries: driven.iter().map(Driven::replans).sum(),
            mean_sim_time_s: mean(|one| one.record.time_s),
            mean_path_m: mean(|one| one.record.path_m),
            env_steps: *env_steps,
            gradient_steps: *gradient_steps,
            decision_us: decision_times(driven),
            time_s: BaselineTimes {
                load: watch.spent_s("load"),
                plan: watch.spent_s("plan") + 1e-6 * planning_us,
                learn: watch.spent_s("learn"),
                drive: watch.spent_s("drive"),
                total: watch.total_s(),
            },
        }
    }
}

fn decision_times(driven: &[Driven]) -> DecisionTimes {
    let mut times: Vec<f64> = driven.iter().flat_map(|one| one.record.decisions_us.iter().copied()).collect();
    times.sort_by(f64::total_cmp);
    let quantile = |q: f64| {
        let last = times.len().saturating_sub(1);
        times.get(((times.len() as f64 * q) as usize).min(last)).copied().unwrap_or(0.0)
    };
    DecisionTimes { p50: quantile(0.5), p99: quantile(0.99) }
}

fn print_report(report: &BaselineReport) {
    if report.status == "no_plan" {
        say!("{}: no path leads to the goal", report.method);
        return;
    }
    say!(
        "{}: {} of {} reached the goal ({:.1} %, between {:.1} and {:.1} %)",
        report.method,
        report.successes,
        report.episodes,
        100.0 * report.success_rate,
        100.0 * report.lower95,
        100.0 * report.upper95
    );
    say!(
        "{} collisions, {} out of time, {} new plans on the way; {:.1} s and {:.1} m on average; a decision takes {:.1} us (p99 {:.1})",
        report.collisions,
        report.timeouts,
        report.recoveries,
        report.mean_sim_time_s,
        report.mean_path_m,
        report.decision_us.p50,
        report.decision_us.p99
    );
    let BaselineTimes { plan, learn, drive, total, .. } = report.time_s;
    say!(
        "took {total:.1} s: planning {plan:.2} an execution, learning {learn:.1} ({} steps), all executions {drive:.1}",
        report.env_steps
    );
}
