//! Monte Carlo estimates: how often a policy succeeds, counted on fresh episodes.

use std::ops::Range;

use rayon::prelude::*;
use sharp_sim::{NoiseModel, RobotState, Simulator};
use sharp_space::Seed;

use crate::chain::{Chain, ChainRun, Driver};
use crate::count::SuccessCount;
use crate::episode::{Episode, EpisodeEnd, EpisodeRules};
use crate::initial_states::InitialStates;
use crate::world::World;

/// What a number of episodes showed of a policy.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SuccessEstimate {
    /// Episodes, and those that ended in the termination set in time and without contact.
    pub count: SuccessCount,
    /// Mean simulated time of the successful episodes, seconds; infinite without any.
    pub mean_time_s: f64,
}

/// Episodes that are driven before it is checked whether to go on.
const BLOCK: u32 = 128;
/// What a failure costs by default, seconds: somebody has to walk there and free the robot.
pub const FAILURE_COST_S: f64 = 1000.0;
/// Success rate below which costs do not rise further: no division by zero.
const RATE_MIN: f64 = 1e-3;

impl SuccessEstimate {
    /// The estimate of `ends`: for each episode whether it succeeded, and its time in seconds.
    pub fn of(ends: impl Iterator<Item = (bool, f64)> + Clone) -> Self {
        let count = SuccessCount::count(ends.clone().map(|(succeeded, _)| succeeded));
        let total_s: f64 = ends.filter(|end| end.0).map(|end| end.1).sum();
        let successes = f64::from(count.successes);
        let mean_time_s = if count.successes == 0 { f64::INFINITY } else { total_s / successes };
        Self { count, mean_time_s }
    }

    /// The estimate of all episodes of both.
    #[must_use]
    pub fn and(&self, other: &Self) -> Self {
        let total_s = |of: &Self| {
            if of.count.successes == 0 { 0.0 } else { f64::from(of.count.successes) * of.mean_time_s }
        };
        let count = SuccessCount {
            episodes: self.count.episodes + other.count.episodes,
            successes: self.count.successes + other.count.successes,
        };
        let mean_time_s = match count.successes {
            0 => f64::INFINITY,
            successes => (total_s(self) + total_s(other)) / f64::from(successes),
        };
        Self { count, mean_time_s }
    }

    /// The expected cost of a use, seconds: mean time per success, and `failure_cost_s` for each failure.
    #[must_use]
    pub fn cost_s(&self, failure_cost_s: f64) -> f64 {
        expected_cost_s(self.mean_time_s, self.count.rate(), failure_cost_s)
    }
}

/// The expected cost of a use, seconds, where a success takes `time_s` and has this chance: mean time per success, and
/// `failure_cost_s` for each failure.
#[must_use]
pub fn expected_cost_s(time_s: f64, success: f64, failure_cost_s: f64) -> f64 {
    let success = success.max(RATE_MIN);
    time_s / success + failure_cost_s * (1.0 - success)
}

/// An experiment: which world, simulator and noise, how many episodes, on which random streams.
#[derive(Clone, Copy, Debug)]
pub struct MonteCarlo<'a> {
    world: &'a World,
    simulator: &'a dyn Simulator,
    noise: &'a NoiseModel,
    episodes: u32,
    seed: Seed,
    /// Whether touching an obstacle is a failure.
    contact_ends: bool,
}

impl<'a> MonteCarlo<'a> {
    /// No episodes yet, in forks of `simulator` under `noise`; contact counts as failure.
    #[must_use]
    pub const fn new(world: &'a World, simulator: &'a dyn Simulator, noise: &'a NoiseModel) -> Self {
        Self { world, simulator, noise, episodes: 0, seed: Seed(0), contact_ends: true }
    }

    /// The same with so many episodes.
    #[must_use]
    pub const fn with_episodes(self, episodes: u32) -> Self {
        Self { episodes, ..self }
    }

    /// The same with the streams of `seed`; a fresh one gives fresh episodes.
    #[must_use]
    pub const fn with_seed(self, seed: Seed) -> Self {
        Self { seed, ..self }
    }

    /// The same with contact as a failure, or not: then the robot bumps and goes on, as in the paper.
    #[must_use]
    pub const fn with_contact_ends(self, contact_ends: bool) -> Self {
        Self { contact_ends, ..self }
    }

    /// Runs `drivers` one after the other from `states`; a success is to finish the last one.
    #[must_use]
    pub fn estimate(&self, drivers: &[Driver<'_>], states: &InitialStates) -> SuccessEstimate {
        self.estimate_while(drivers, states, u32::MAX)
    }

    /// The same, but stops soon after more than `failures_max` failures: with fewer episodes than asked for.
    #[must_use]
    pub fn estimate_while(
        &self,
        drivers: &[Driver<'_>],
        states: &InitialStates,
        failures_max: u32,
    ) -> SuccessEstimate {
        let drive = |chain: &Chain, episode: &mut Episode, number| {
            let start = states.draw(&mut self.seed.stream("trial start", number));
            let run = chain.run(self.world, episode, start, (self.seed, number));
            (run.passed(drivers.len() - 1), run.time_s())
        };
        let mut ends: Vec<(bool, f64)> = Vec::with_capacity(self.episodes as usize);
        let (mut next, mut failures) = (0, 0);
        while next < self.episodes && failures <= failures_max {
            let last = self.episodes.min(next + BLOCK);
            let block = self.parallel(drivers, next..last, drive);
            failures += block.iter().filter(|end| !end.0).count() as u32;
            ends.extend(block);
            next = last;
        }
        SuccessEstimate::of(ends.into_iter())
    }

    /// Runs `driver` once from each of `states` and returns the states in which it arrived.
    #[must_use]
    pub fn arrivals(&self, driver: &Driver<'_>, states: &[RobotState]) -> Vec<RobotState> {
        let seed = self.seed.child("exit", 0);
        let runs =
            self.parallel(std::slice::from_ref(driver), 0..states.len() as u32, |chain, episode, number| {
                chain.run(self.world, episode, states[number as usize], (seed, number))
            });
        runs.iter().filter(|run| run.end == EpisodeEnd::Reached).map(|run| run.arrival).collect()
    }

    /// Runs the chain of `drivers` from `start`, so many times.
    #[must_use]
    pub fn runs(&self, drivers: &[Driver<'_>], start: RobotState) -> Vec<ChainRun> {
        self.parallel(drivers, 0..self.episodes, |chain, episode, number| {
            chain.run(self.world, episode, start, (self.seed, number))
        })
    }

    /// Runs the chain of `drivers` from `states`, as often as asked for, and stops after a block of runs as soon as
    /// `is_enough` of all so far.
    #[must_use]
    pub fn runs_from(
        &self,
        drivers: &[Driver<'_>],
        states: &InitialStates,
        is_enough: impl Fn(&[ChainRun]) -> bool,
    ) -> Vec<ChainRun> {
        let mut runs = Vec::with_capacity(self.episodes as usize);
        while runs.len() < self.episodes as usize && (runs.is_empty() || !is_enough(&runs)) {
            let next = runs.len() as u32;
            let block = next..self.episodes.min(next + BLOCK);
            runs.extend(self.parallel(drivers, block, |chain, episode, number| {
                let start = states.draw(&mut self.seed.stream("trial start", number));
                chain.run(self.world, episode, start, (self.seed, number))
            }));
        }
        runs
    }

    /// The same from `start`.
    #[must_use]
    pub fn runs_until(
        &self,
        drivers: &[Driver<'_>],
        start: RobotState,
        is_enough: impl Fn(&[ChainRun]) -> bool,
    ) -> Vec<ChainRun> {
        self.runs_from(drivers, &InitialStates::exactly(start), is_enough)
    }

    /// Results come in the order of the episodes, whatever thread ran them.
    fn parallel<T: Send>(
        &self,
        drivers: &[Driver<'_>],
        episodes: Range<u32>,
        run: impl Fn(&Chain, &mut Episode, u64) -> T + Sync,
    ) -> Vec<T> {
        let vehicle = self.world.vehicle(self.simulator, self.noise, self.contact_ends);
        let rules = EpisodeRules::default().with_contact_ends(self.contact_ends);
        let (chain, episode) = (Chain::new(drivers), Episode::new(vehicle, rules));
        episodes
            .into_par_iter()
            .with_min_len(4)
            .map_init(|| episode.clone(), |episode, number| run(&chain, episode, u64::from(number)))
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use sharp_sim::SimulatorKind;

    use super::*;
    use crate::automaton::Link;
    use crate::follower::Follower;
    use crate::policy::OptionPolicy;
    use crate::test_worlds::{hall, hall_options};

    #[test]
    fn an_estimate_stops_once_too_many_have_failed() {
        let (world, options) = (hall(), hall_options());
        let policy = OptionPolicy::Follower(Follower::cautious(&world.robot));
        let noise = NoiseModel::harsh().scaled(2.0);
        let simulator = world.simulator(SimulatorKind::Kinematic);
        let trial = MonteCarlo::new(&world, &*simulator, &noise).with_episodes(300).with_seed(Seed(1));
        let states = InitialStates::exactly(RobotState::at_rest(options[1].guide.start()));
        let drivers = [Driver::new(&options[1], &policy, None)];
        let all = trial.estimate(&drivers, &states);
        let failures = all.count.failures();
        assert!((20..280).contains(&failures), "the policy fails sometimes: {all:?}");
        assert_eq!(trial.estimate_while(&drivers, &states, failures), all, "as many were allowed");
        let early = trial.estimate_while(&drivers, &states, 0).count;
        assert_eq!(early.episodes, BLOCK, "the first block was enough");
    }

    #[test]
    fn an_option_may_be_judged_by_its_first_metres_alone() {
        let (world, options) = (hall(), hall_options());
        let policy = OptionPolicy::Follower(Follower::cautious(&world.robot));
        let noise = NoiseModel::none();
        let simulator = world.simulator(SimulatorKind::Kinematic);
        let trial = MonteCarlo::new(&world, &*simulator, &noise).with_episodes(4).with_seed(Seed(1));
        let states = InitialStates::exactly(RobotState::at_rest(options[1].guide.start()));
        let whole = Driver::new(&options[1], &policy, None);
        let until_m = 0.5 * options[1].guide.length_m();
        let part = Driver { link: Link { until_m, ..whole.link.clone() }, ..whole.clone() };
        let times_s = [whole, part].map(|driver| trial.estimate(&[driver], &states).mean_time_s);
        assert!((0.35..0.65).contains(&(times_s[1] / times_s[0])), "half the way took {times_s:?}");
    }

    #[test]
    fn failures_cost_their_recoveries() {
        let with = |successes| SuccessEstimate {
            count: SuccessCount { episodes: 100, successes },
            mean_time_s: 5.0,
        };
        assert_eq!(with(100).cost_s(1000.0), 5.0, "its mean time");
        assert_eq!(with(50).cost_s(1000.0), 510.0, "twice the time and half of what a failure costs");
        assert_eq!(with(50).cost_s(0.0), 10.0, "twice the time");
        assert!(with(0).cost_s(1000.0) > 2000.0, "too expensive to use");
    }
}
