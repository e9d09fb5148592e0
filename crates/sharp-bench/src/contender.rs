//! Systems to compare, and the comparison.

use std::fmt::Debug;
use std::sync::Arc;

use rayon::prelude::*;
use sharp_drive::{Controller, Episode, EpisodeEnd, EpisodeRecord, EpisodeRules, Supervisor, World};
use sharp_plan::{ComposedPolicy, Plan, Query};
use sharp_sim::{NoiseModel, RobotState, Simulator};
use sharp_space::Seed;

/// The time limit of an episode, in units of the nominal time of the contender's first plan.
const TIME_LIMIT_FACTOR: f64 = 3.0;

/// A system that is prepared for one problem. Implement [`controller`](Self::controller).
pub trait Contender: Debug + Sync {
    /// Who drives episode number `episode`, which begins in `start`. Everything random comes from streams that are
    /// keyed by `episode`: asked twice, it drives alike.
    fn controller(&self, start: RobotState, episode: u64) -> Box<dyn Controller + '_>;
}

/// SHARP as a contender: a plan that is executed.
#[derive(Clone, Debug)]
pub struct Composed {
    /// The plan.
    pub plan: Arc<Plan>,
    /// Whether a robot that strayed, stands still or is late gets a new plan.
    pub recovery: bool,
}

impl Contender for Composed {
    fn controller(&self, start: RobotState, _episode: u64) -> Box<dyn Controller + '_> {
        Box::new(ComposedPolicy::new(Arc::clone(&self.plan), start, self.recovery))
    }
}

/// How a comparison is run.
#[derive(Clone, Debug)]
pub struct ComparisonSettings {
    /// Number of episodes.
    pub episodes: u32,
    /// The simulator; episodes run in forks of it.
    pub simulator: Box<dyn Simulator>,
    /// Its noise.
    pub noise: NoiseModel,
    /// Whether touching a wall ends the episode as a failure; the paper bumps and goes on.
    pub contact_ends: bool,
    /// Seed of the episodes' noise.
    pub seed: Seed,
}

/// An episode of a contender.
#[derive(Clone, Debug)]
pub struct Driven {
    /// Why it ended.
    pub end: EpisodeEnd,
    /// What happened.
    pub record: EpisodeRecord,
}

impl Driven {
    /// Plans made on the way, after the first.
    #[must_use]
    pub const fn replans(&self) -> u32 {
        self.record.plans.saturating_sub(1)
    }
}

/// Lets `contender` drive `query` as often as `settings` say. Episodes come in order.
///
/// An episode may take three times what the contender's own first path takes at half the robot's top speed, and at
/// least a minute.
#[must_use]
pub fn compare(
    contender: &dyn Contender,
    world: &World,
    query: &Query,
    settings: &ComparisonSettings,
    supervisor: &Supervisor<'_>,
) -> Vec<Driven> {
    let rules = EpisodeRules::default()
        .with_contact_ends(settings.contact_ends)
        .with_time_limit_s(sharp_drive::TIME_LIMIT_MIN_S)
        .with_limit_by_plan(TIME_LIMIT_FACTOR)
        .with_trace();
    let vehicle = world.vehicle(&*settings.simulator, &settings.noise, settings.contact_ends);
    let episode = Episode::new(vehicle, rules);
    let start = RobotState::at_rest(query.start);
    let drive = |number: u32| {
        let number = u64::from(number);
        let mut episode = episode.clone();
        episode.begin(start, settings.seed, number);
        let end = episode.drive(&mut *contender.controller(start, number), supervisor);
        Driven { end, record: episode.into_record() }
    };
    (0..settings.episodes).into_par_iter().map(drive).collect()
}
