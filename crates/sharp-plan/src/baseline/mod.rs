//! The systems to compare with (Sec. 5 and beyond it), under the rules that options are run by.
//!
//! A [`Baseline`] is everything that is prepared once for a problem; a [`Pilot`] of it drives one
//! episode. [`compare`] gives all of them the same simulator, noise, collision rule, success rule and
//! time limit: three times what its own first path takes at half the robot's top speed, and at least
//! a minute. [`Rrt`] and [`Sac`] are the paper's; [`Track`] and [`Mppi`] are what an engineer would use.

mod mppi;
mod observer;
mod route;
mod rrt;
mod sac;
mod track;

#[cfg(test)]
mod tests;

use std::sync::Arc;

use rayon::prelude::*;
use sharp_sim::{ActionSettings, AnySim, NoiseModel, RobotState, SimulatorKind, Vehicle};
use sharp_space::Seed;

pub use mppi::{Mppi, MppiSettings};
pub use route::RoutePlanner;
pub use rrt::Rrt;
pub use sac::{Sac, SacBudget};
pub use track::Track;

use crate::composed::Events;
use crate::execute::{Episode, EpisodeEnd};
use crate::percept::Workspace;
use crate::planner::Query;
use crate::policy::PolarWaypoint;

/// A system that is prepared for one problem.
pub trait Baseline: Sync {
    /// Who drives episode number `episode`.
    fn pilot(&self, episode: u64) -> Box<dyn Pilot + '_>;
}

/// Drives one episode.
pub trait Pilot {
    /// Looks at where the robot is and plans where that is due; comes before every decision.
    fn prepare(&mut self, situation: &Situation) -> Readiness;

    /// The next waypoint; only after [`Readiness::Ready`] or [`Readiness::Planned`].
    fn decide(&mut self, state: &RobotState) -> PolarWaypoint;
}

/// What a pilot is told before a decision.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Situation {
    /// The state of the robot.
    pub state: RobotState,
    /// True if the robot has just met a wall and backed off: its way led there.
    pub bumped: bool,
}

/// What came of preparing.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Readiness {
    /// The plan at hand still holds.
    Ready,
    /// There is a new plan; at half the robot's top speed it takes this long, seconds.
    Planned {
        /// Simulated time, seconds.
        nominal_time_s: f64,
    },
    /// No way leads on.
    NoWay,
}

/// How a comparison is run.
#[derive(Clone, Debug)]
pub struct ComparisonSettings {
    /// Number of episodes.
    pub episodes: u32,
    /// The simulator.
    pub simulator: SimulatorKind,
    /// Its noise.
    pub noise: NoiseModel,
    /// Whether touching a wall ends the episode as a failure; the paper bumps and goes on.
    pub contact_ends: bool,
    /// Seed of the episodes' noise.
    pub seed: Seed,
}

/// The world outside: its clock and its wish to stop.
#[derive(Clone, Copy)]
pub struct Host<'a> {
    /// Wall time, microseconds.
    pub clock_us: &'a (dyn Fn() -> f64 + Sync),
    /// Whether to give up; episodes that run then count as out of time.
    pub stop: &'a (dyn Fn() -> bool + Sync),
}

impl std::fmt::Debug for Host<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Host").finish_non_exhaustive()
    }
}

/// An episode of a baseline.
#[derive(Clone, Debug)]
pub struct Driven {
    /// What happened; plans after the first count as recoveries.
    pub episode: Episode,
    /// Wall time spent on planning during the episode, microseconds.
    pub plan_us: f64,
}

/// Lets `baseline` drive `query` as often as `settings` say. Episodes come in order.
#[must_use]
pub fn compare(
    baseline: &dyn Baseline,
    workspace: &Workspace,
    query: &Query,
    settings: &ComparisonSettings,
    host: &Host<'_>,
) -> Vec<Driven> {
    let actions = ActionSettings { stop_at_contact: settings.contact_ends, ..ActionSettings::default() };
    let sim = AnySim::new(settings.simulator, Arc::clone(&workspace.world), &workspace.robot);
    let vehicle = Vehicle::new(sim, Arc::clone(&workspace.robot), settings.noise.clone(), actions);
    (0..settings.episodes)
        .into_par_iter()
        .map(|episode| {
            let episode = u64::from(episode);
            let mut vehicle = vehicle.clone();
            vehicle.reset(RobotState::at_rest(query.start), settings.seed, episode);
            let drive = Drive::new(workspace, query, settings.contact_ends, vehicle);
            drive.run(&mut *baseline.pilot(episode), host)
        })
        .collect()
}

/// Simulated time that `length_m` metres of path and `turn_rad` of turns in place take at half the
/// robot's top speed, seconds.
fn nominal_time_s(workspace: &Workspace, length_m: f64, turn_rad: f64) -> f64 {
    let robot = &workspace.robot;
    length_m / (0.5 * robot.max_speed_mps) + turn_rad / (0.5 * robot.max_yaw_rate_radps)
}

/// One episode under way.
struct Drive<'a> {
    workspace: &'a Workspace,
    query: &'a Query,
    contact_ends: bool,
    vehicle: Vehicle<AnySim>,
    driven: Driven,
    plans: u32,
    time_limit_s: f64,
    bumped: bool,
}

impl<'a> Drive<'a> {
    fn new(workspace: &'a Workspace, query: &'a Query, contact_ends: bool, vehicle: Vehicle<AnySim>) -> Self {
        let episode = Episode {
            end: EpisodeEnd::TimedOut,
            time_s: 0.0,
            path_m: 0.0,
            contacts: 0,
            events: Events::default(),
            trace: vec![vehicle.state().pose],
            decisions_us: vec![],
        };
        let driven = Driven { episode, plan_us: 0.0 };
        Self { workspace, query, contact_ends, vehicle, driven, plans: 0, time_limit_s: 60.0, bumped: false }
    }

    fn run(mut self, pilot: &mut dyn Pilot, host: &Host<'_>) -> Driven {
        while self.driven.episode.time_s < self.time_limit_s && !(host.stop)() {
            let end = if self.is_at_goal() { Some(EpisodeEnd::Reached) } else { self.step(pilot, host) };
            if let Some(end) = end {
                self.driven.episode.end = end;
                break;
            }
        }
        self.driven.episode.events.recoveries = self.plans.saturating_sub(1);
        self.driven
    }

    fn is_at_goal(&self) -> bool {
        let position = self.vehicle.state().pose.position;
        (position - self.query.goal.position).norm() <= self.workspace.robot.goal_tolerance_m
    }

    /// One decision and one action; says if and how the episode ended with it.
    fn step(&mut self, pilot: &mut dyn Pilot, host: &Host<'_>) -> Option<EpisodeEnd> {
        let state = *self.vehicle.state();
        let before_us = (host.clock_us)();
        let readiness = pilot.prepare(&Situation { state, bumped: self.bumped });
        let prepared_us = (host.clock_us)();
        match readiness {
            Readiness::Ready => {}
            Readiness::Planned { nominal_time_s } => {
                if self.plans == 0 {
                    self.time_limit_s = (3.0 * nominal_time_s).max(60.0);
                }
                self.plans += 1;
                self.driven.plan_us += prepared_us - before_us;
            }
            Readiness::NoWay => {
                self.driven.plan_us += prepared_us - before_us;
                return self.give_way();
            }
        }
        let command = pilot.decide(&state);
        self.driven.episode.decisions_us.push((host.clock_us)() - prepared_us);
        self.act(command)
    }

    fn act(&mut self, command: PolarWaypoint) -> Option<EpisodeEnd> {
        let pose = self.vehicle.state().pose;
        let report = self.vehicle.act_at(command.to_world(&pose), command.speed_mps);
        let episode = &mut self.driven.episode;
        episode.time_s += report.time_s;
        episode.path_m += report.path_m;
        episode.trace.push(report.after.pose);
        episode.contacts += u32::from(report.contact);
        self.bumped = report.contact;
        if report.contact && self.contact_ends {
            return Some(EpisodeEnd::Collided);
        }
        if report.contact {
            // A forward-only robot with its nose at a wall can do nothing else.
            self.back_off();
        }
        None
    }

    /// Without a way on: the end, or where walls may be touched another step back.
    fn give_way(&mut self) -> Option<EpisodeEnd> {
        if self.contact_ends || self.plans == 0 {
            return Some(EpisodeEnd::Lost);
        }
        self.back_off();
        None
    }

    fn back_off(&mut self) {
        let report = self.vehicle.back_off(self.workspace.robot.recovery_reverse_m);
        self.driven.episode.time_s += report.time_s;
        self.driven.episode.path_m += report.path_m;
    }
}
