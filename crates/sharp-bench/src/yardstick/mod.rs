//! How cheap driving an option can be: value iteration by someone who knows slip and pull of the episode.
//!
//! A policy has to find out how its robot slips; this one is told. For a few pulls it computes the least expected cost from every
//! pose and motion near the guide ([`ValueTable`]), and decides by looking one action ahead with the exact simulator. No
//! policy that is not told can expect to drive cheaper, but for what grid and sampling miss. So the
//! difference between a policy's cost and this one, its regret, bounds what better learning could gain.

mod grid;
mod motions;
mod policy;
mod report;
mod value;

use std::collections::BTreeMap;
use std::sync::Arc;

use rayon::prelude::*;
use sharp_drive::{
    ChainController, Episode, EpisodeEnd, EpisodeRules, FAILURE_COST_S, InitialStates, Link, Mppi,
    MppiSettings, Observation, OptionPolicy, Policy, Prior, SuccessEstimate, Supervisor, World,
};
use sharp_guide::GuidedOption;
use sharp_sim::{EpisodeBias, EpisodeNoise, NoiseModel, SimulatorKind};
use sharp_space::Seed;

pub use policy::InformedPolicy;
pub use report::{PolicyCost, YardstickLine, yardstick_picture, yardstick_table};
pub use value::{ValueSettings, ValueTable};

/// An option on which policies are compared.
#[derive(Clone, Copy, Debug)]
pub struct YardstickOption<'a> {
    /// Map and robot.
    pub world: &'a World,
    /// The option.
    pub option: &'a Arc<GuidedOption>,
    /// The option after it, which policies look ahead into.
    pub next: Option<&'a Arc<GuidedOption>>,
    /// Where episodes begin.
    pub states: &'a InitialStates,
    /// The noise of the episodes.
    pub noise: &'a NoiseModel,
}

impl YardstickOption<'_> {
    /// Drives so many episodes in the kinematic simulator, each with what `policy` makes for its number, its slip and its pull.
    /// Equal seeds give equal starts and equal noise, whatever drives.
    #[must_use]
    pub fn estimate<P: Policy>(
        &self,
        policy: impl Fn(u64, EpisodeBias) -> P + Sync,
        (episodes, seed): (u32, Seed),
    ) -> SuccessEstimate {
        let simulator = self.world.simulator(SimulatorKind::Kinematic);
        let vehicle = self.world.vehicle(&*simulator, self.noise, true);
        let blank = Episode::new(vehicle, EpisodeRules::default());
        let link = Link::new(Arc::clone(self.option), self.next.cloned());
        let links: Arc<[Link]> = [link].into();
        let drive = |number: u32| {
            let number = u64::from(number);
            let start = self.states.draw(&mut seed.stream("trial start", number));
            let bias = EpisodeNoise::new(self.noise, seed, number).bias();
            let mut episode = blank.clone();
            episode.begin(start, seed, number);
            let mut policies = [policy(number, bias)];
            let first = Observation::first(start, self.noise);
            let mut chain = ChainController::new(self.world, Arc::clone(&links), &mut policies, first);
            let end = episode.drive(&mut chain, &Supervisor::silent());
            (end == EpisodeEnd::Reached, episode.record().time_s)
        };
        let ends: Vec<(bool, f64)> = (0..episodes).into_par_iter().map(drive).collect();
        SuccessEstimate::of(ends.into_iter())
    }

    /// Drives so many episodes with every policy that is compared.
    #[must_use]
    pub fn compare(&self, (episodes, seed): (u32, Seed)) -> (f64, BTreeMap<String, PolicyCost>) {
        let Self { world, option, noise, .. } = *self;
        let informed = InformedPolicy::new(world, option, noise, &ValueSettings::default(), seed);
        let runs = (episodes, seed.child("yardstick", 0));
        let of = |number: u64| seed.child("policy", number);
        let fixed = |policy: &OptionPolicy| self.estimate(|_, _| policy.clone(), runs);
        let mppi = MppiSettings::new(&world.robot, noise);
        let prior = Prior::shipped(&world.robot).at(1.0, &world.robot, noise);
        let followers = OptionPolicy::fallbacks(&world.robot)
            .iter()
            .map(fixed)
            .min_by(|a, b| a.cost_s(FAILURE_COST_S).total_cmp(&b.cost_s(FAILURE_COST_S)));
        let mut costs: BTreeMap<String, PolicyCost> = [
            ("informed", self.estimate(|number, bias| informed.told(bias, of(number)), runs)),
            ("estimating", self.estimate(|number, _| informed.estimating(of(number)), runs)),
            ("prior", fixed(&prior)),
            ("mppi", self.estimate(|number, _| Mppi::new(mppi, of(number)), runs)),
            ("track", fixed(&OptionPolicy::Profiled(mppi.base))),
        ]
        .iter()
        .map(|(name, estimate)| ((*name).to_owned(), PolicyCost::of(estimate)))
        .collect();
        costs.extend(followers.map(|best| ("follower".to_owned(), PolicyCost::of(&best))));
        let expected_s = (0..u64::from(episodes)).map(|number| {
            let start = self.states.draw(&mut runs.1.stream("trial start", number));
            informed.expected_cost_s(&start, EpisodeNoise::new(noise, runs.1, number).bias())
        });
        (expected_s.sum::<f64>() / f64::from(episodes.max(1)), costs)
    }
}
