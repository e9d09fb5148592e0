//! Certification: how often a policy holds, counted on fresh episodes.

use rayon::prelude::*;
use sharp_sim::{NoiseModel, RobotState, Simulator, Vehicle};
use sharp_space::Seed;

use crate::learn::kinematic_vehicle;
use crate::percept::{Percept, Workspace};
use crate::policy::DecisionScratch;
use crate::rollout::{ChainRun, Driver, LegOutcome, drive_chain};
use crate::starts::Starts;
use crate::stats::Tally;

/// What a number of episodes showed of one policy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Certificate {
    /// Episodes and successes: the termination set was reached in time and without contact.
    pub tally: Tally,
    /// Mean simulated time of the successful episodes, seconds; infinite without any.
    pub mean_time_s: f64,
}

/// A trial: which world, which noise, how often, on which random streams.
#[derive(Clone, Copy, Debug)]
pub struct Trial<'a> {
    /// Map and robot.
    pub workspace: &'a Workspace,
    /// The noise of the simulator.
    pub noise: &'a NoiseModel,
    /// Number of episodes.
    pub episodes: u32,
    /// Seed of starts and noise; a fresh one gives fresh episodes.
    pub seed: Seed,
}

impl Trial<'_> {
    /// Runs `driver` alone from `starts`.
    #[must_use]
    pub fn of_leg(&self, driver: &Driver<'_>, starts: &Starts) -> Certificate {
        let horizon = driver.leg.horizon_actions(crate::SLOWEST_REACH_M);
        let ends =
            self.run(kinematic_vehicle(self.workspace, self.noise, true), |vehicle, scratch, episode| {
                let state = starts.draw(&mut self.seed.stream("trial start", episode));
                vehicle.reset(state, self.seed, episode);
                let end = driver.drive(self.workspace, vehicle, Percept::first(state), horizon, scratch);
                (end.outcome == LegOutcome::Done, end.time_s)
            });
        certificate(&ends)
    }

    /// Runs the chain of `drivers` from `start`.
    #[must_use]
    pub fn of_chain(&self, drivers: &[Driver<'_>], start: RobotState) -> Vec<ChainRun> {
        self.run(kinematic_vehicle(self.workspace, self.noise, true), |vehicle, scratch, episode| {
            vehicle.reset(start, self.seed, episode);
            drive_chain(self.workspace, vehicle, start, drivers, scratch)
        })
    }

    /// Results come in the order of the episodes, whatever thread ran them.
    fn run<S: Simulator + Sync, T: Send>(
        &self,
        vehicle: Vehicle<S>,
        episode: impl Fn(&mut Vehicle<S>, &mut DecisionScratch, u64) -> T + Sync,
    ) -> Vec<T> {
        (0..self.episodes)
            .into_par_iter()
            .with_min_len(16)
            .map_init(
                || (vehicle.clone(), DecisionScratch::default()),
                |(vehicle, scratch), index| episode(vehicle, scratch, u64::from(index)),
            )
            .collect()
    }
}

fn certificate(ends: &[(bool, f64)]) -> Certificate {
    let tally = Tally::count(ends.iter().map(|end| end.0));
    let total_s: f64 = ends.iter().filter(|end| end.0).map(|end| end.1).sum();
    let mean_time_s = if tally.successes == 0 { f64::INFINITY } else { total_s / f64::from(tally.successes) };
    Certificate { tally, mean_time_s }
}
