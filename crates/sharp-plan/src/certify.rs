//! Certification: how often a policy holds, counted on fresh episodes.

use std::ops::Range;

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

/// Episodes that are driven before anybody asks whether to go on.
const BLOCK: u32 = 128;
/// What a failure usually counts for, seconds: somebody has to walk there and free the robot.
pub const FAILURE_COST_S: f64 = 1000.0;

impl Certificate {
    /// What `ends` showed: for each episode whether it succeeded, and its time in seconds.
    pub(crate) fn of(ends: impl Iterator<Item = (bool, f64)> + Clone) -> Self {
        let tally = Tally::count(ends.clone().map(|(succeeded, _)| succeeded));
        let total_s: f64 = ends.filter(|end| end.0).map(|end| end.1).sum();
        let successes = f64::from(tally.successes);
        let mean_time_s = if tally.successes == 0 { f64::INFINITY } else { total_s / successes };
        Self { tally, mean_time_s }
    }

    /// Seconds per success, and `failure_cost_s` seconds for each failure.
    #[must_use]
    pub fn cost_s(&self, failure_cost_s: f64) -> f64 {
        let success = self.tally.rate().max(1e-3);
        self.mean_time_s / success + failure_cost_s * (1.0 - success)
    }
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
        self.of_legs(std::slice::from_ref(driver), starts)
    }

    /// Runs `drivers` one after the other from `starts`; a success is to arrive where the last one leads.
    #[must_use]
    pub fn of_legs(&self, drivers: &[Driver<'_>], starts: &Starts) -> Certificate {
        self.of_legs_while(drivers, starts, u32::MAX)
    }

    /// The same, but gives up soon after more than `failures_max` failures: with fewer episodes than asked for.
    #[must_use]
    pub(crate) fn of_legs_while(
        &self,
        drivers: &[Driver<'_>],
        starts: &Starts,
        failures_max: u32,
    ) -> Certificate {
        let vehicle = kinematic_vehicle(self.workspace, self.noise, true);
        let drive = |vehicle: &mut Vehicle<_>, scratch: &mut DecisionScratch, episode| {
            let state = starts.draw(&mut self.seed.stream("trial start", episode));
            vehicle.reset(state, self.seed, episode);
            let run = drive_chain(self.workspace, vehicle, state, drivers, scratch);
            (run.passed(drivers.len() - 1), run.times_s.iter().sum())
        };
        let mut ends: Vec<(bool, f64)> = Vec::with_capacity(self.episodes as usize);
        let (mut next, mut failures) = (0, 0);
        while next < self.episodes && failures <= failures_max {
            let last = self.episodes.min(next + BLOCK);
            let block = self.run(&vehicle, next..last, drive);
            failures += block.iter().filter(|end| !end.0).count() as u32;
            ends.extend(block);
            next = last;
        }
        Certificate::of(ends.into_iter())
    }

    /// Runs `driver` once from each of `states` and returns the states in which it arrived.
    #[must_use]
    pub fn exits(&self, driver: &Driver<'_>, states: &[RobotState]) -> Vec<RobotState> {
        let trial = Trial { episodes: states.len() as u32, ..*self };
        let horizon = driver.leg.horizon_actions(crate::SLOWEST_REACH_M);
        let ends = trial.run(
            &kinematic_vehicle(self.workspace, self.noise, true),
            0..trial.episodes,
            |vehicle, scratch, episode| {
                let state = states[episode as usize];
                vehicle.reset(state, self.seed.child("exit", 0), episode);
                driver.drive(self.workspace, vehicle, Percept::first(state, self.noise), horizon, scratch)
            },
        );
        ends.iter().filter(|end| end.outcome == LegOutcome::Done).map(|end| end.percept.state).collect()
    }

    /// Runs the chain of `drivers` from `start`.
    #[must_use]
    pub fn of_chain(&self, drivers: &[Driver<'_>], start: RobotState) -> Vec<ChainRun> {
        let vehicle = kinematic_vehicle(self.workspace, self.noise, true);
        self.run(&vehicle, 0..self.episodes, |vehicle, scratch, episode| {
            vehicle.reset(start, self.seed, episode);
            drive_chain(self.workspace, vehicle, start, drivers, scratch)
        })
    }

    /// Results come in the order of the episodes, whatever thread ran them.
    fn run<S: Simulator + Clone, T: Send>(
        &self,
        vehicle: &Vehicle<S>,
        episodes: Range<u32>,
        episode: impl Fn(&mut Vehicle<S>, &mut DecisionScratch, u64) -> T + Sync,
    ) -> Vec<T> {
        episodes
            .into_par_iter()
            .with_min_len(16)
            .map_init(
                || (vehicle.clone(), DecisionScratch::default()),
                |(vehicle, scratch), index| episode(vehicle, scratch, u64::from(index)),
            )
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use sharp_options::OptionKind;

    use super::*;
    use crate::drawn::{HALL, along, followed, legs, world};

    #[test]
    fn a_trial_gives_up_once_too_many_have_failed() {
        let (workspace, abstraction) = world(HALL, OptionKind::Centroid);
        let leg = &legs(&workspace, &abstraction, along())[1];
        let policy = followed(&workspace).policy;
        let (noise, seed) = (NoiseModel::harsh().scaled(2.0), Seed(1));
        let trial = Trial { workspace: &workspace, noise: &noise, episodes: 300, seed };
        let starts = Starts::exactly(RobotState::at_rest(leg.guide.start()));
        let drivers = [Driver::new(leg, &policy, None)];
        let all = trial.of_legs(&drivers, &starts);
        let failures = all.tally.failures();
        assert!((20..280).contains(&failures), "not a trial that fails at times: {all:?}");
        assert_eq!(trial.of_legs_while(&drivers, &starts, failures), all, "as many were allowed");
        let early = trial.of_legs_while(&drivers, &starts, 0).tally;
        assert_eq!(early.episodes, BLOCK, "the first block told");
    }

    #[test]
    fn a_driver_may_be_judged_by_the_first_metres_alone() {
        let (workspace, abstraction) = world(HALL, OptionKind::Centroid);
        let leg = &legs(&workspace, &abstraction, along())[1];
        let policy = followed(&workspace).policy;
        let noise = NoiseModel::none();
        let trial = Trial { workspace: &workspace, noise: &noise, episodes: 4, seed: Seed(1) };
        let starts = Starts::exactly(RobotState::at_rest(leg.guide.start()));
        let whole = Driver::new(leg, &policy, None);
        let part = Driver { until_m: 0.5 * leg.guide.length_m(), ..whole };
        let times_s = [whole, part].map(|driver| trial.of_leg(&driver, &starts).mean_time_s);
        assert!((0.35..0.65).contains(&(times_s[1] / times_s[0])), "half the way took {times_s:?}");
    }
}
