//! Where a robot has trouble in a building that was learnt: the places where its hand-overs fail most.

use std::collections::BTreeMap;

use sharp_drive::{SuccessCount, World};
use sharp_guide::GuidePath;
use sharp_options::OptionId;
use sharp_space::Point;

use crate::building::Building;
use crate::reason::width_at;
use crate::roster::Roster;

/// Two weak stretches whose narrowest places are nearer than this count as one place, metres.
const SAME_PLACE_M: f64 = 1.5;

/// What was measured from the middle of one option to the middle of the next, and where.
#[derive(Clone, Debug)]
pub struct MeasuredStretch {
    /// The first option.
    pub before: OptionId,
    /// The second one.
    pub after: OptionId,
    /// The way between the two middles, points of the guides.
    pub way: Vec<Point>,
    /// How often it was driven through.
    pub count: SuccessCount,
    /// Its length divided by the mean time, metres per second; 0 if nobody came through.
    pub speed_mps: f64,
}

/// A place where drives fail.
#[derive(Clone, Debug, PartialEq)]
pub struct WeakPlace {
    /// The narrowest point of the weakest way through it.
    pub at: Point,
    /// The free width there, metres.
    pub width_m: f64,
    /// The option that leads there.
    pub before: OptionId,
    /// The option that leads on.
    pub after: OptionId,
    /// Drives from the middle of one to the middle of the other.
    pub count: SuccessCount,
}

/// All hand-overs of `building` with their ways, in the order of the building.
#[must_use]
pub fn measured_stretches(roster: &Roster, building: &Building) -> Vec<MeasuredStretch> {
    let guides: BTreeMap<OptionId, &GuidePath> =
        roster.options.iter().map(|entry| (entry.id, &entry.option.guide)).collect();
    let stretch = |one: &crate::hand_over::HandOver| {
        let [first, second] = [guides.get(&one.before)?, guides.get(&one.after)?];
        let is_late = |index: usize| first.arc_m(index) >= 0.5 * first.length_m();
        let is_early = |index: usize| second.arc_m(index) <= 0.5 * second.length_m();
        let late = (0..first.poses().len()).filter(|&index| is_late(index)).map(|index| first.poses()[index]);
        let early =
            (0..second.poses().len()).filter(|&index| is_early(index)).map(|index| second.poses()[index]);
        let way = late.chain(early).map(|pose| pose.position).collect();
        let length_m = 0.5 * (first.length_m() + second.length_m());
        let speed_mps = if one.mean_time_s > 0.0 { length_m / one.mean_time_s } else { 0.0 };
        let (before, after, count) = (one.before, one.after, one.count);
        Some(MeasuredStretch { before, after, way, count, speed_mps })
    };
    building.hand_overs.iter().filter_map(stretch).collect()
}

/// The weakest places of a building, the weakest first, at most `most` of them. Places without a failure are left out.
#[must_use]
pub fn weak_places(world: &World, stretches: &[MeasuredStretch], most: usize) -> Vec<WeakPlace> {
    let mut weakest: Vec<&MeasuredStretch> =
        stretches.iter().filter(|stretch| stretch.count.failures() > 0).collect();
    let names = |stretch: &MeasuredStretch| (stretch.before, stretch.after);
    weakest.sort_by(|a, b| a.count.rate().total_cmp(&b.count.rate()).then(names(a).cmp(&names(b))));
    let clearance = world.geometry.clearance();
    let mut places: Vec<WeakPlace> = Vec::new();
    for stretch in weakest {
        let room_m = |point: &Point| clearance.sample(*point);
        let Some(&at) = stretch.way.iter().min_by(|a, b| room_m(a).total_cmp(&room_m(b))) else { continue };
        if places.len() == most || places.iter().any(|place| (place.at - at).norm() < SAME_PLACE_M) {
            continue;
        }
        let (before, after) = names(stretch);
        places.push(WeakPlace { at, width_m: width_at(world, at), before, after, count: stretch.count });
    }
    places
}
