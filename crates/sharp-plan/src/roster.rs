//! What there is to learn in a building: every option with its guide, the most used first, and every hand-over.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};
use std::sync::Arc;

use sharp_guide::{GuidedOption, LegId};
use sharp_options::{OptionId, OptionSet, OptionSpec};
use sharp_rbvd::StateId;
use sharp_space::{Point, Pose};

use crate::abstraction::Abstraction;
use crate::building::LearningSite;
use crate::files;
use crate::hand_over::{RUN_UP_M, RUN_UP_MAX};
use crate::policies::corridor;
use crate::query::Query;
use crate::search::Search;

/// A rectangle of the map, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Area {
    /// Its lower left corner.
    pub min: Point,
    /// Its upper right corner.
    pub max: Point,
}

impl Area {
    /// Returns true if `point` lies in it.
    #[must_use]
    pub fn contains(&self, point: Point) -> bool {
        (self.min.x..=self.max.x).contains(&point.x) && (self.min.y..=self.max.y).contains(&point.y)
    }
}

/// An option that is to be learnt.
#[derive(Clone, Debug)]
pub struct RosterOption {
    /// Its name.
    pub id: OptionId,
    /// With its guide, as a search plans it.
    pub option: Arc<GuidedOption>,
    /// The hash of all that its policy and its estimates depend on.
    pub corridor: String,
    /// Shortest ways between two options of the building that lead through it.
    pub uses: u64,
    /// Options from which robots come to its middle in measurements, in order, as positions in the roster.
    pub(crate) run_up: Vec<usize>,
}

/// All options of a building that can be guided, the most used first, and all hand-overs between them.
#[derive(Clone, Debug)]
pub struct Roster {
    /// The hash of the set of options that it was made of.
    pub fingerprint: String,
    /// The options.
    pub options: Vec<RosterOption>,
    /// Options without a guide: no robot gets through.
    pub unguided: Vec<OptionId>,
    /// Hand-overs, as positions in `options`, in the order of the first option.
    pub hand_overs: Vec<(usize, usize)>,
}

/// A hash of which options there are and where they lead.
pub(crate) fn fingerprint(options: &OptionSet) -> String {
    let centers = options.endpoints().iter().map(|end| (end.center.x, end.center.y, end.radius_m));
    let names = options.options().iter().chain(options.bypasses()).map(|spec| spec.id.to_string());
    let text = format!("{:?} {:?}", centers.collect::<Vec<_>>(), names.collect::<Vec<_>>());
    files::hash(text.as_bytes())[..16].to_owned()
}

impl Roster {
    /// The roster of the building at `site`: of the options whose both ends lie in `within`, or of all.
    ///
    /// Options past a centroid are part of it where the two options that they replace do not join.
    #[must_use]
    pub fn new(site: &LearningSite<'_>, within: Option<Area>) -> Self {
        let LearningSite { world, abstraction, method, conditions, seed } = *site;
        let Abstraction { states, options } = abstraction;
        // The options of a building depend on no query; the search needs one all the same, in a state that has cells.
        let mut centers = states.states().map(|state| (state, states.center(state)));
        let anywhere = centers.find(|&(state, center)| states.state_at(center) == Some(state));
        let anywhere = anywhere.map_or(Point::origin(), |(_, center)| center);
        let query = Query {
            start: Pose::new(anywhere.x, anywhere.y, 0.0),
            goal: Pose::new(anywhere.x, anywhere.y, 0.0),
        };
        let fingerprint = fingerprint(options);
        let search = Search::new(world, abstraction, method, &conditions.noise, query, [], seed);
        let Ok(mut search) = search else {
            return Self { fingerprint, options: vec![], unguided: vec![], hand_overs: vec![] };
        };
        let is_inside = |spec: &&OptionSpec| {
            let ends = [spec.initiation, spec.termination].map(|end| options.endpoint(end).center);
            within.is_none_or(|area| ends.iter().all(|&center| area.contains(center)))
        };
        let leg = |spec: &OptionSpec| LegId::Option(spec.id);
        let ids: Vec<LegId> = options.options().iter().filter(is_inside).map(leg).collect();
        search.guide_all(&ids);
        let bypasses: Vec<LegId> = if method.search.bypasses {
            let needed = options.bypasses().iter().filter(is_inside).filter(|spec| !joins(&search, spec.id));
            needed.map(leg).collect()
        } else {
            vec![]
        };
        search.guide_all(&bypasses);
        let all: Vec<OptionId> = ids.iter().chain(&bypasses).filter_map(|&id| option_id(id)).collect();
        let (guided, unguided): (Vec<OptionId>, Vec<OptionId>) =
            all.into_iter().partition(|&id| search.option(LegId::Option(id)).is_some());
        let pairs: Vec<(OptionId, OptionId)> = search
            .graph()
            .option_pairs()
            .filter(|&(before, after)| search.can_follow(LegId::Option(before), LegId::Option(after)))
            .collect();
        ordered(site, &search, (guided, unguided), &pairs, fingerprint)
    }
}

fn option_id(leg: LegId) -> Option<OptionId> {
    match leg {
        LegId::Option(id) => Some(id),
        _ => None,
    }
}

/// Whether the two options that the bypass option called `id` replaces join.
fn joins(search: &Search<'_>, id: OptionId) -> bool {
    let Some(through) = id.through() else { return false };
    let half = |from: StateId, to: StateId| LegId::Option(OptionId::Centroid { from, to });
    let halves = [half(id.from(), through), half(through, id.to())];
    halves.iter().all(|&half| search.option(half).is_some()) && search.can_follow(halves[0], halves[1])
}

/// The roster of the options `guided`, the most used first.
fn ordered(
    site: &LearningSite<'_>,
    search: &Search<'_>,
    (guided, unguided): (Vec<OptionId>, Vec<OptionId>),
    pairs: &[(OptionId, OptionId)],
    fingerprint: String,
) -> Roster {
    let positions: BTreeMap<OptionId, usize> = guided.iter().copied().zip(0..).collect();
    let costs_s: Vec<f64> =
        guided.iter().map(|&id| search.priced_s(LegId::Option(id)).unwrap_or(f64::INFINITY)).collect();
    let mut next = vec![Vec::new(); guided.len()];
    for (before, after) in pairs {
        if let (Some(&before), Some(&after)) = (positions.get(before), positions.get(after)) {
            next[before].push(after);
        }
    }
    next.iter_mut().for_each(|after| after.sort_unstable());
    let uses = uses(&next, &costs_s);
    let mut order: Vec<usize> = (0..guided.len()).collect();
    order.sort_by_key(|&position| (Reverse(uses[position]), guided[position]));
    let mut rank = vec![0; guided.len()];
    order.iter().enumerate().for_each(|(new, &old)| rank[old] = new);
    let guide =
        |position: usize| &search.option(LegId::Option(guided[position])).expect("it was guided").guide;
    let lengths_m: Vec<f64> = (0..guided.len()).map(|position| guide(position).length_m()).collect();
    let turn =
        |before: usize, after: usize| guide(before).end().heading.turn_to(guide(after).start().heading).abs();
    let before = straightest(&next, turn);
    let entry = |&position: &usize| {
        let id = guided[position];
        let option = search.found(LegId::Option(id)).and_then(Result::ok).expect("it was guided");
        let corridor = corridor(option, &site.world.grid);
        let run_up = run_up(&before, &lengths_m, position).into_iter().map(|old| rank[old]).collect();
        RosterOption { id, option: Arc::clone(option), corridor, uses: uses[position], run_up }
    };
    let hand_overs =
        order.iter().enumerate().flat_map(|(new, &old)| next[old].iter().map(move |&after| (new, after)));
    let mut hand_overs: Vec<(usize, usize)> =
        hand_overs.map(|(before, after)| (before, rank[after])).collect();
    hand_overs.sort_unstable();
    Roster { fingerprint, options: order.iter().map(entry).collect(), unguided, hand_overs }
}

/// For each option the one before it that leads on most straight; `turn(before, after)` is the angle between their guides.
/// It depends on the options nearby alone, so that a change of the map far away changes nothing.
fn straightest(next: &[Vec<usize>], turn: impl Fn(usize, usize) -> f64) -> Vec<Option<usize>> {
    let mut best: Vec<Option<(f64, usize)>> = vec![None; next.len()];
    for (before, after) in
        next.iter().enumerate().flat_map(|(before, next)| next.iter().map(move |&after| (before, after)))
    {
        let angle = turn(before, after);
        if best[after].is_none_or(|(least, _)| angle < least) {
            best[after] = Some((angle, before));
        }
    }
    best.into_iter().map(|best| best.map(|(_, before)| before)).collect()
}

/// The options that robots drive before option number `of`, until they have some metres behind them in its middle.
fn run_up(before: &[Option<usize>], lengths_m: &[f64], of: usize) -> Vec<usize> {
    let (mut chain, mut way_m, mut at) = (Vec::new(), 0.5 * lengths_m[of], of);
    while way_m < RUN_UP_M && chain.len() < RUN_UP_MAX {
        let Some(previous) = before[at].filter(|previous| *previous != of && !chain.contains(previous))
        else {
            break;
        };
        chain.push(previous);
        way_m += lengths_m[previous];
        at = previous;
    }
    chain.reverse();
    chain
}

/// How many shortest ways from one option to another lead through each, its ends included.
///
/// `next[i]` follow option i, which costs `costs_s[i]`. Of ways of equal cost the one through lower numbers counts.
fn uses(next: &[Vec<usize>], costs_s: &[f64]) -> Vec<u64> {
    let mut uses = vec![0; next.len()];
    for source in 0..next.len() {
        let (settled, before) = shortest_ways(next, costs_s, source);
        // What lies beyond an option on a way from the source was reached through it.
        let mut beyond = vec![0_u64; next.len()];
        for &option in settled.iter().rev() {
            beyond[option] += 1;
            uses[option] += beyond[option];
            if let Some(parent) = before[option] {
                beyond[parent] += beyond[option];
            }
        }
    }
    uses
}

/// The options in the order in which they are reached from `source`, and which one each is reached from.
fn shortest_ways(next: &[Vec<usize>], costs_s: &[f64], source: usize) -> (Vec<usize>, Vec<Option<usize>>) {
    let mut cost_s = vec![f64::INFINITY; next.len()];
    let (mut before, mut is_settled) = (vec![None; next.len()], vec![false; next.len()]);
    let mut settled = Vec::new();
    // Costs are positive, and the bits of positive numbers sort like the numbers.
    let mut open = BinaryHeap::from([Reverse((0_u64, source))]);
    cost_s[source] = 0.0;
    while let Some(Reverse((_, option))) = open.pop() {
        if std::mem::replace(&mut is_settled[option], true) {
            continue;
        }
        settled.push(option);
        for &after in &next[option] {
            let reached_s = cost_s[option] + costs_s[after];
            if reached_s < cost_s[after] {
                (cost_s[after], before[after]) = (reached_s, Some(option));
                open.push(Reverse((reached_s.to_bits(), after)));
            }
        }
    }
    (settled, before)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn short_options_are_reached_over_those_before_them() {
        let before = [None, Some(0), Some(1), Some(2)];
        let lengths_m = [3.0, 1.2, 0.4, 7.0];
        let chains = [0, 1, 2, 3].map(|of| run_up(&before, &lengths_m, of));
        assert_eq!(chains, [vec![], vec![0], vec![0, 1], vec![]]);
    }

    #[test]
    fn what_lies_between_others_is_used_most() {
        // 0 and 1 lead to 2, which leads to 3 and 4; 1 also leads to 4 by a detour through 5.
        let next = [vec![2], vec![2, 5], vec![3, 4], vec![], vec![], vec![4]];
        let uses = uses(&next, &[1.0, 1.0, 1.0, 1.0, 1.0, 9.0]);
        assert_eq!(uses, [4, 5, 9, 4, 5, 3]);
    }
}
