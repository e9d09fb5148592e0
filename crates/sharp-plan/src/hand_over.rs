//! Hand-overs: what driving from the middle of one option to the middle of the next shows.
//!
//! The success of a plan is no product of the successes of its options: how an option is entered matters, and so does
//! where its guide comes from once the guides of the plan are joined. Some metres on, both are forgotten. So a plan is
//! cut in the middle of each option, and each piece between two cuts is measured as a plan would drive it: with joined
//! guides, by robots that have driven three metres before the first cut. Where the first option is too short for that,
//! they come from the option before it that leads on most straight.

use std::collections::BTreeMap;
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use sharp_drive::{
    ChainRun, Driver, EpisodeEnd, InitialStates, OptionPolicy, StateSpread, SuccessCount, SuccessEstimate,
    World,
};
use sharp_guide::{GuidedOption, join_guides};
use sharp_options::OptionId;
use sharp_rbvd::StateId;
use sharp_rl::Actor;
use sharp_space::Seed;

use crate::conditions::Conditions;
use crate::files;
use crate::method::Method;

/// Runs of a hand-over, at least and at most: counting ends when the 95 % interval is as narrow as for 256 successes.
const EPISODES: (u32, u32) = (256, 1024);
/// Half the width of the interval at which counting ends.
const HALF_WIDTH: f64 = 0.0075;
/// States in which the first option of a hand-over begins.
const STATE_POOL: usize = 64;
/// How they spread: as robots arrive there. They have half an option left to get onto the guide.
const ARRIVING: StateSpread = StateSpread { radius_m: 0.15, heading_sd_rad: 0.15, speed_max_mps: 1.0 };
/// Raised whenever hand-overs are measured in another way.
const RULE: u32 = 5;
/// Way that is driven before the first cut, metres.
pub(crate) const RUN_UP_M: f64 = 3.0;
/// Options before the first one, at most.
pub(crate) const RUN_UP_MAX: usize = 4;

/// What driving from the middle of one option to the middle of the next showed.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct HandOver {
    /// The first option.
    pub before: OptionId,
    /// The second one.
    pub after: OptionId,
    /// Options that robots came from, in order.
    pub run_up: Vec<OptionId>,
    /// The hash of all that was driven: guides, what lies around them, and policies.
    pub key: String,
    /// Robots that came to the middle of the first option, and those of them that came to the middle of the second.
    pub count: SuccessCount,
    /// Mean time between the two, seconds; infinite if none arrived.
    pub mean_time_s: f64,
}

impl HandOver {
    /// What `estimate` says under `key`, of options that are named later.
    pub(crate) fn new(key: String, estimate: SuccessEstimate) -> Self {
        let unnamed = OptionId::Centroid { from: StateId(0), to: StateId(1) };
        let (count, mean_time_s) = (estimate.count, estimate.mean_time_s);
        Self { before: unnamed, after: unnamed, run_up: vec![], key, count, mean_time_s }
    }
}

/// Hashes of what decides how options are driven. Many options share a network, which is hashed once.
#[derive(Debug, Default)]
pub(crate) struct Identities {
    weights: Vec<(Arc<Actor>, String)>,
}

impl Identities {
    /// Of an option with this corridor and policy.
    pub(crate) fn of(&mut self, corridor: &str, policy: &OptionPolicy) -> String {
        let policy = match policy {
            OptionPolicy::Network(network) => {
                format!("{:?} {}", network.interface, self.weights_hash(&network.actor))
            }
            other => format!("{other:?}"),
        };
        files::hash(format!("{corridor} {policy}").as_bytes())
    }

    fn weights_hash(&mut self, actor: &Arc<Actor>) -> &str {
        let known = self.weights.iter().position(|(known, _)| Arc::ptr_eq(known, actor));
        let index = known.unwrap_or_else(|| {
            let hash = files::hash(&actor.to_bytes(&BTreeMap::new()));
            self.weights.push((Arc::clone(actor), hash));
            self.weights.len() - 1
        });
        &self.weights[index].1
    }
}

/// The key of the hand-over between the last two of options with these identities, in the order of driving.
pub(crate) fn chain_key(identities: &[&str]) -> String {
    files::hash(format!("{RULE} {}", identities.join(" ")).as_bytes())[..32].to_owned()
}

/// An option with the policy that drives it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct DrivenOption<'a> {
    pub(crate) option: &'a Arc<GuidedOption>,
    pub(crate) policy: &'a OptionPolicy,
}

/// Drives from the middle of the last option but one of `chain` to the middle of the last.
pub(crate) fn drive_hand_over(
    (world, conditions, method): (&World, &Conditions, &Method),
    chain: &[DrivenOption<'_>],
    seed: Seed,
) -> SuccessEstimate {
    let mut options: Vec<_> = chain.iter().map(|driven| Arc::clone(driven.option)).collect();
    if method.join_guides {
        let start = options[0].guide.start();
        options = join_guides(options, start, &world.guide_robot(), &method.search.guide);
    }
    let states = InitialStates::spread(world, &options[0], &ARRIVING, STATE_POOL, seed);
    let policies: Vec<&OptionPolicy> = chain.iter().map(|driven| driven.policy).collect();
    let cut = Some(chain.len() - 2);
    let stretch = Stretch { options: &options, policies: &policies, from_middle_of: cut, to_middle: true };
    stretch.drive(
        (world, conditions),
        &states,
        RunBudget { episodes: EPISODES, half_width: HALF_WIDTH },
        seed,
    )
}

/// How many runs a stretch is worth.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct RunBudget {
    /// At least and at most.
    pub(crate) episodes: (u32, u32),
    /// Half the width of the 95 % interval at which counting ends between the two.
    pub(crate) half_width: f64,
}

/// Consecutive legs of a plan, joined already.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Stretch<'a> {
    pub(crate) options: &'a [Arc<GuidedOption>],
    pub(crate) policies: &'a [&'a OptionPolicy],
    /// The leg in whose middle it begins; robots drive there first. `None` where it begins with the first leg.
    pub(crate) from_middle_of: Option<usize>,
    /// Whether it ends in the middle of the last leg.
    pub(crate) to_middle: bool,
}

impl Stretch<'_> {
    /// How often robots that come to its beginning come to its end, and how long they take between them. They set out
    /// in `states` of the first leg.
    pub(crate) fn drive(
        &self,
        (world, conditions): (&World, &Conditions),
        states: &InitialStates,
        budget: RunBudget,
        seed: Seed,
    ) -> SuccessEstimate {
        let legs = self.options.iter().zip(self.policies).enumerate();
        let mut drivers: Vec<Driver<'_>> =
            legs.map(|(i, (option, policy))| Driver::new(option, policy, self.options.get(i + 1))).collect();
        if let (true, Some(last)) = (self.to_middle, drivers.last_mut()) {
            last.link.until_m = 0.5 * last.link.option.guide.length_m();
        }
        let (least, most) = budget.episodes;
        let is_enough = |runs: &[ChainRun]| {
            let count = self.count(runs).count;
            runs.len() >= least as usize && count.half_width95() <= budget.half_width
        };
        let trial = conditions.monte_carlo(world).with_episodes(most).with_seed(seed);
        self.count(&trial.runs_from(&drivers, states, is_enough))
    }

    fn count(&self, runs: &[ChainRun]) -> SuccessEstimate {
        let ends = runs.iter().filter_map(|run| {
            let before_s = match self.from_middle_of {
                None => 0.0,
                Some(cut) => {
                    let visit = run.visits.get(cut)?;
                    let run_up_s: f64 = run.visits[..cut].iter().map(|visit| visit.time_s).sum();
                    // An option may end before its middle where its termination set is near.
                    run_up_s + visit.half_s.or_else(|| run.passed(cut).then_some(visit.time_s))?
                }
            };
            Some((run.end == EpisodeEnd::Reached, run.time_s() - before_s))
        });
        SuccessEstimate::of(ends.collect::<Vec<_>>().into_iter())
    }
}
