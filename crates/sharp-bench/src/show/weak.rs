//! Where a plan is weak, in words and with a place on the map.

use std::sync::Arc;

use serde::Serialize;
use sharp_drive::{EpisodeEnd, SuccessCount, World};
use sharp_guide::GuidePath;
use sharp_plan::{Moment, Plan, PlannedOption};
use sharp_space::Point;

use super::PlanPage;
use super::data::{Basis, Legs, centimetres, place};

/// Failures of the same leg and kind that are nearer to each other than this count as one place, metres.
const SAME_PLACE_M: f64 = 1.0;
/// Distance between two places at which the room beside a guide is looked at, metres.
const STEP_M: f64 = 0.1;

/// A weak place of the plan.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub(super) struct ShownPlace {
    /// What is weak there.
    pub(super) words: String,
    /// Where; nowhere for a leg whose failures nobody saw.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) at: Option<[f64; 2]>,
    /// The leg of the plan, from 0; none on a way that was planned anew.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub(super) leg: Option<usize>,
    /// Whether drives failed there.
    pub(super) failed: bool,
}

/// Where a guide has the least room.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(super) struct Tight {
    pub(super) at: [f64; 2],
    /// Room between the robot's sides and the nearest wall, metres.
    pub(super) beside_m: f64,
}

/// The place along `guide` with the least room at the robot's sides.
pub(super) fn tightest(world: &World, guide: &GuidePath) -> Tight {
    let (clearance, inscribed_m) = (world.geometry.clearance(), world.robot.footprint.inscribed_radius_m());
    let count = (guide.length_m() / STEP_M) as usize;
    let places = (0..=count).map(|i| guide.pose_at(i as f64 * STEP_M).position);
    let rooms = places.map(|at| (clearance.sample(at) - inscribed_m, at));
    let (beside_m, at) =
        rooms.min_by(|a, b| a.0.total_cmp(&b.0)).unwrap_or((f64::INFINITY, guide.start().position));
    Tight { at: place(at), beside_m: centimetres(beside_m) }
}

/// The weak places of what is shown: where drives failed, the most failures first; other legs that failed in the
/// verification or are known to fail, the worst first; the tightest place.
pub(super) fn weak_places(shown: &PlanPage<'_>, legs: &Legs) -> Vec<ShownPlace> {
    let (mut weak, steps) = (failures(shown, legs), steps(shown));
    let mut unseen: Vec<(f64, ShownPlace)> = Vec::new();
    for (leg, &(step, basis)) in steps.iter().enumerate() {
        let SuccessCount { episodes, successes } = step.on_arrival;
        if successes < episodes && weak.iter().all(|place| place.leg != Some(leg)) {
            let words = format!("{}: {}.", step.option.id, counted(step.on_arrival, basis));
            unseen.push((
                step.on_arrival.rate(),
                ShownPlace { words, at: None, leg: Some(leg), failed: false },
            ));
        }
    }
    unseen.sort_by(|a, b| a.0.total_cmp(&b.0));
    weak.extend(unseen.into_iter().map(|(_, place)| place));
    if weak.is_empty() {
        let drives = shown.recordings.len();
        let words = if steps.iter().all(|&(_, basis)| basis == Basis::Runs) {
            format!("No leg failed, neither in the runs of the verification nor in {drives} drives.")
        } else {
            format!("No leg is known to fail, and none failed in {drives} drives.")
        };
        weak.push(ShownPlace { words, at: None, leg: None, failed: false });
    }
    weak.extend(narrowest(shown, &steps));
    weak
}

/// The steps of all plans in a row, each with where its count is from.
fn steps<'a>(shown: &PlanPage<'a>) -> Vec<(&'a PlannedOption, Basis)> {
    let of_plan = |plan: &'a Arc<Plan>| plan.solution.steps.iter().map(move |step| (step, Basis::of(plan)));
    shown.tour.plans.iter().flat_map(of_plan).collect()
}

/// Failed drives of one leg that ended near each other in the same way.
struct Failures {
    leg: Option<usize>,
    end: EpisodeEnd,
    places: Vec<Point>,
}

/// Where drives failed, the most failures first.
fn failures(shown: &PlanPage<'_>, legs: &Legs) -> Vec<ShownPlace> {
    let mut groups: Vec<Failures> = Vec::new();
    for recording in shown.recordings.iter().filter(|it| it.execution.end != EpisodeEnd::Reached) {
        let Some(last) = recording.moments.last() else { continue };
        let (end, leg, at) =
            (recording.execution.end, leg_of(&recording.moments, legs), last.state.pose.position);
        let is_same = |group: &&mut Failures| {
            (group.leg, group.end) == (leg, end) && (group.places[0] - at).norm() < SAME_PLACE_M
        };
        match groups.iter_mut().find(is_same) {
            Some(group) => group.places.push(at),
            None => groups.push(Failures { leg, end, places: vec![at] }),
        }
    }
    groups.sort_by_key(|group| std::cmp::Reverse(group.places.len()));
    // What the verification counted is said once for each leg.
    let mut said: Vec<Option<usize>> = Vec::new();
    let describe = |group: Failures| {
        let is_first = !said.contains(&group.leg);
        said.push(group.leg);
        described(&group, is_first, shown)
    };
    groups.into_iter().map(describe).collect()
}

/// The leg that ran when a drive ended.
fn leg_of(moments: &[Moment], legs: &Legs) -> Option<usize> {
    moments.last().and_then(|moment| legs.at(moment))
}

fn described(Failures { leg, end, places }: &Failures, is_first: bool, shown: &PlanPage<'_>) -> ShownPlace {
    let middle = places.iter().fold(Point::origin(), |sum, at| sum + at.coords / places.len() as f64);
    let [x, y] = place(middle);
    let what = match end {
        EpisodeEnd::Collided => "touched a wall",
        EpisodeEnd::TimedOut => "ran out of time",
        EpisodeEnd::Lost | EpisodeEnd::Reached | EpisodeEnd::Stopped => "lost its way",
    };
    let drives = format!("{} of {} drives {what} near ({x}, {y})", places.len(), shown.recordings.len());
    let step = leg.map(|leg| steps(shown)[leg]);
    let words = match step {
        Some((step, basis)) if is_first => {
            format!("{}: {drives}; {}.", step.option.id, counted(step.on_arrival, basis))
        }
        Some((step, _)) => format!("{}: {drives}.", step.option.id),
        None => format!("{drives}, on a way that was planned anew."),
    };
    ShownPlace { words, at: Some([x, y]), leg: *leg, failed: true }
}

/// How often a leg fails that came to `count`.
fn counted(count: SuccessCount, basis: Basis) -> String {
    let SuccessCount { episodes, successes } = count;
    let (failed, share) = (episodes - successes, 100.0 * (1.0 - count.rate()));
    match basis {
        Basis::Runs => format!("failed in {failed} of {episodes} runs of the verification ({share:.1} %)"),
        Basis::Composed => format!("fails in {share:.1} %, composed of what the library knows"),
    }
}

/// The tightest place of all legs.
fn narrowest(shown: &PlanPage<'_>, steps: &[(&PlannedOption, Basis)]) -> Option<ShownPlace> {
    let world = &shown.tour.plans[0].world;
    let places = steps.iter().enumerate().map(|(leg, (step, _))| (leg, tightest(world, &step.option.guide)));
    let (leg, tight) = places.min_by(|a, b| a.1.beside_m.total_cmp(&b.1.beside_m))?;
    let ([x, y], beside_m) = (tight.at, tight.beside_m);
    let words = format!(
        "Tightest place: {} at ({x}, {y}), {beside_m:.2} m between the robot's sides and the nearest wall.",
        steps[leg].0.option.id
    );
    Some(ShownPlace { words, at: Some(tight.at), leg: Some(leg), failed: false })
}
