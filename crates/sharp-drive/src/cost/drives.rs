//! Drives of the prior as data: how long each place of a guide took, and how often it was the last.

use sharp_rl::Samples;
use sharp_sim::{NoiseModel, Simulator};
use sharp_space::Seed;

use super::places::{GuidePlace, PLACE_LEN};
use super::{BIN_M, CostModel, GuideEnds};
use crate::automaton::{Automaton, Link};
use crate::episode::{Controller, Decision, Episode, EpisodeRules, Motion, Supervisor};
use crate::initial_states::InitialStates;
use crate::network::PolicyContext;
use crate::policy::{OptionPolicy, Policy};
use crate::situation::Observation;
use crate::world::World;

/// Share of failures at one place beyond which it counts less.
const HOPELESS: f32 = 0.05;

/// One place under one noise and caution, driven through several times.
#[derive(Clone, Debug, PartialEq)]
pub struct DriveRow {
    /// What the network is given.
    pub inputs: [f32; CostModel::INPUTS],
    /// How often it was reached.
    pub passes: f32,
    /// How long all that passed through took together, seconds.
    pub time_s: f32,
    /// How many failed there.
    pub failures: f32,
}

/// Rows that the logarithm of the time is fitted to: the likelihood of exponential times, whose best predictions are
/// the means.
#[derive(Clone, Copy, Debug)]
pub struct TimeSamples<'a>(pub &'a [DriveRow]);

impl Samples for TimeSamples<'_> {
    fn len(&self) -> usize {
        self.0.len()
    }

    fn inputs(&self, row: usize) -> &[f32] {
        &self.0[row].inputs
    }

    fn loss(&self, row: usize, outputs: &[f32], derivative: &mut [f32]) -> f64 {
        let DriveRow { passes, time_s, .. } = self.0[row];
        let log_time = outputs[0].clamp(-20.0, 5.0);
        let taken = time_s / libm::expf(log_time);
        derivative[0] = passes - taken;
        f64::from(taken + passes * log_time)
    }
}

/// Rows that the logarithm of the risk is fitted to: the likelihood of rare failures.
#[derive(Clone, Copy, Debug)]
pub struct RiskSamples<'a>(pub &'a [DriveRow]);

impl Samples for RiskSamples<'_> {
    fn len(&self) -> usize {
        self.0.len()
    }

    fn inputs(&self, row: usize) -> &[f32] {
        &self.0[row].inputs
    }

    fn loss(&self, row: usize, outputs: &[f32], derivative: &mut [f32]) -> f64 {
        let DriveRow { passes, failures, .. } = self.0[row];
        let log_risk = outputs[0].clamp(-20.0, 5.0);
        let expected = passes * libm::expf(log_risk);
        // Where next to nobody passes the number does not matter; it must not spread to places that look alike.
        let weight = (HOPELESS * passes / failures.max(HOPELESS * passes)).min(1.0);
        derivative[0] = weight * (expected - failures);
        f64::from(weight * (expected - failures * log_risk))
    }
}

/// Drives the chain `links` with `policy` so many times from `states`, and appends what its places showed to `rows`.
/// `context` is what the policy is told; `from_rest` says that the robot stands where the chain begins. Otherwise
/// nothing is said of the chain's first option.
pub fn drive_rows(
    (world, simulator, noise): (&World, &dyn Simulator, &NoiseModel),
    (links, policy, context): (&[Link], &OptionPolicy, PolicyContext),
    (states, from_rest): (&InitialStates, bool),
    (episodes, seed): (u32, Seed),
    rows: &mut Vec<DriveRow>,
) {
    let mut tallies: Vec<Vec<Tally>> = links
        .iter()
        .map(|link| {
            let bins = (link.option.guide.length_m() / BIN_M).ceil().max(1.0) as usize;
            vec![Tally::default(); bins]
        })
        .collect();
    let mut policy = policy.clone();
    let mut episode = Episode::new(world.vehicle(simulator, noise, true), EpisodeRules::default());
    for number in 0..u64::from(episodes) {
        let start = states.draw(&mut seed.stream("start", number));
        episode.begin(start, seed, number);
        let observation = Observation::first(start, noise).without_slip_estimate();
        let automaton = Automaton::new(links.into(), observation);
        let mut log =
            DriveLog { world, policy: &mut policy, automaton, tallies: &mut tallies, failed: false };
        episode.drive(&mut log, &Supervisor::silent());
        log.finish();
    }
    // Where a robot was put somewhere at random, its first failures say nothing of the place.
    let begun = usize::from(!from_rest);
    for (index, (link, tallies)) in links.iter().zip(tallies).enumerate().skip(begun) {
        let guide = link.guide();
        for (bin, tally) in tallies.into_iter().enumerate().filter(|(_, tally)| tally.passes > 0.0) {
            let mut inputs = [0.0; CostModel::INPUTS];
            let ends = GuideEnds { from_rest: from_rest && index == 0, to_goal: link.next.is_none() };
            let place = GuidePlace { arc_m: bin as f64 * BIN_M, ends };
            place.write(world, &guide, &mut inputs[..PLACE_LEN]);
            inputs[PLACE_LEN..].copy_from_slice(&context.entries());
            let Tally { passes, time_s, failures } = tally;
            rows.push(DriveRow { inputs, passes, time_s: time_s as f32, failures });
        }
    }
}

#[derive(Clone, Copy, Debug, Default)]
struct Tally {
    passes: f32,
    time_s: f64,
    failures: f32,
}

/// Drives a chain and notes in which bin of its guides time passes and episodes fail.
struct DriveLog<'a> {
    world: &'a World,
    policy: &'a mut OptionPolicy,
    automaton: Automaton,
    tallies: &'a mut [Vec<Tally>],
    failed: bool,
}

impl DriveLog<'_> {
    /// The bin of the robot now.
    fn bin(&mut self) -> &mut Tally {
        let bins = &mut self.tallies[self.automaton.index()];
        let bin = ((self.automaton.progress().arc_m / BIN_M) as usize).min(bins.len() - 1);
        &mut bins[bin]
    }

    fn finish(mut self) {
        if self.failed {
            self.bin().failures += 1.0;
        }
        // A place counts as passed through if the episode came as far or further.
        let (last, arc_m) = (self.automaton.index(), self.automaton.progress().arc_m);
        for (index, bins) in self.tallies.iter_mut().enumerate().take(last + 1) {
            let count = if index < last || !self.failed { bins.len() } else { (arc_m / BIN_M) as usize + 1 };
            bins.iter_mut().take(count).for_each(|bin| bin.passes += 1.0);
        }
    }
}

impl Controller for DriveLog<'_> {
    fn decide(&mut self) -> Decision {
        if !self.automaton.advance() {
            return Decision::Reached;
        }
        if self.automaton.is_late() {
            self.failed = true;
            return Decision::Lost;
        }
        Decision::Drive(self.policy.decide(&self.automaton.situation(self.world)))
    }

    fn observe(&mut self, motion: &Motion) {
        let before = (self.automaton.index(), self.automaton.progress().arc_m);
        self.automaton.observe(self.world, motion);
        let after_m = self.automaton.progress().arc_m;
        spread(&mut self.tallies[before.0], (before.1, after_m), motion.time_s);
        self.failed = motion.contact;
    }
}

/// Shares `time_s` out over the bins from `from_m` to `to_m` along the guide.
fn spread(bins: &mut [Tally], (from_m, to_m): (f64, f64), time_s: f64) {
    let last = bins.len() - 1;
    let bin = |arc_m: f64| ((arc_m / BIN_M) as usize).min(last);
    let way_m = to_m - from_m;
    if way_m <= 0.0 || bin(from_m) == bin(to_m) {
        bins[bin(from_m)].time_s += time_s;
        return;
    }
    let (first, end) = (bin(from_m), bin(to_m));
    for (index, bin) in bins.iter_mut().enumerate().take(end + 1).skip(first) {
        let begin_m = from_m.max(index as f64 * BIN_M);
        let end_m = if index == last { to_m } else { to_m.min((index + 1) as f64 * BIN_M) };
        bin.time_s += time_s * ((end_m - begin_m) / way_m).max(0.0);
    }
}
