//! One path for a whole plan: guides that join smoothly.
//!
//! The guide of an option is planned for the option alone, through the centres of its sets. In a plan the robot
//! comes from somewhere and goes on to somewhere. So the guides of the plan are smoothed together and cut where
//! they come nearest to those centres. The library keeps the guides as they were planned.

use std::cell::Cell as Memory;
use std::collections::BTreeSet;
use std::sync::Arc;

use sharp_options::Endpoint;
use sharp_rbvd::StateId;
use sharp_space::{Cell, Heading, Point, Pose};

use crate::context::{first_touch, tight_bend};
use crate::gap::narrowest_gap_m;
use crate::guided_option::GuidedOption;
use crate::inflate::GuideRobot;
use crate::path::GuidePath;
use crate::plan::smooth_guide;
use crate::request::{GuideEnd, GuideRequest};
use crate::settings::GuideSettings;

/// A cut is looked for this far before and behind the place where the guides met, metres.
const SEARCH_M: f64 = 2.0;
/// The distance between two places of which one may become a cut, metres.
const SEARCH_STEP_M: f64 = 0.05;
/// The path meets a smaller disc within each set, by this factor.
const DISC_FACTOR: f64 = 0.6;
/// An option keeps at least this much way, metres.
const OPTION_MIN_M: f64 = 0.3;

/// `options`, which follow one another from `start`, with guides that join smoothly; unchanged where that fails.
#[must_use]
pub fn join_guides(
    options: Vec<Arc<GuidedOption>>,
    start: Pose,
    robot: &GuideRobot<'_>,
    settings: &GuideSettings,
) -> Vec<Arc<GuidedOption>> {
    let departure = options.first().map(|option| option.departure).unwrap_or_default();
    // The beginning of a guide that is driven with care must stay as it is.
    if options.len() < 2 || departure.careful_m > 0.0 {
        return options;
    }
    let start = departure.after_back_off(start);
    match joined(&options, start, robot, settings) {
        Some(guides) => {
            let with = |(option, guide): (&Arc<GuidedOption>, GuidePath)| {
                Arc::new(GuidedOption { guide, ..GuidedOption::clone(option) })
            };
            options.iter().zip(guides).map(with).collect()
        }
        None => options,
    }
}

fn joined(
    options: &[Arc<GuidedOption>],
    start: Pose,
    robot: &GuideRobot<'_>,
    settings: &GuideSettings,
) -> Option<Vec<GuidePath>> {
    let way: Vec<Point> =
        options.iter().flat_map(|option| option.guide.poses().iter().map(|pose| pose.position)).collect();
    let states = &*options[0].states;
    let frame = states.frame();
    let allowed: BTreeSet<StateId> =
        options.iter().flat_map(|option| option.allowed.iter().copied()).collect();
    let sources: Vec<&Endpoint> = options.iter().filter_map(|option| option.source.as_ref()).collect();
    let looked = |cell: Cell| {
        let contains = |source: &&Endpoint| source.contains(frame.center(cell), states);
        states.state_of(cell).is_some_and(|state| allowed.contains(&state) || sources.iter().any(contains))
    };
    // Smoothing looks at the same cells hundreds of times.
    let seen = vec![Memory::new(None); frame.len()];
    let allowed = |cell: Cell| {
        let memory = &seen[frame.index(cell)];
        memory.get().unwrap_or_else(|| {
            let is_allowed = looked(cell);
            memory.set(Some(is_allowed));
            is_allowed
        })
    };
    let request = GuideRequest {
        start: GuideEnd { position: way[0], heading: Some(start.heading) },
        goal: GuideEnd { position: way[way.len() - 1], heading: goal_heading(&options[options.len() - 1]) },
        allowed: &allowed,
    };
    let disc = |option: &Arc<GuidedOption>| {
        option.target.endpoint().map(|set| (set.center, DISC_FACTOR * set.radius_m))
    };
    let discs: Vec<(Point, f64)> = options.iter().filter_map(disc).collect();
    // A margin that a door on the way has no room for need not be tried.
    let inscribed_m = |robot: &GuideRobot<'_>| robot.geometry.footprint().inscribed_radius_m();
    let widest_m = robot.inflated_at(Some(start)).map(|robot| inscribed_m(&robot)).fold(0.0, f64::max);
    let gap_m = narrowest_gap_m(robot.geometry.clearance(), &way, widest_m);
    let mut fitting = robot.inflated_at(Some(start)).filter(|robot| 2.0 * inscribed_m(robot) <= gap_m);
    fitting.find_map(|inflated| {
        let path = smooth_guide((&way, &discs), &request, &inflated, settings).ok()?;
        let cuts = cuts(options, &path)?;
        let pieces = cuts.windows(2).map(|ends| piece(&path, ends[0], ends[1], settings.spacing_m));
        let pieces: Vec<GuidePath> = pieces.collect::<Option<_>>()?;
        // The chords of a piece lie between those of the whole path: they cut its corners.
        let is_sound = |piece: &GuidePath| {
            tight_bend(piece, robot.steering.radius_m()).is_none()
                && first_touch(piece, robot.geometry).is_none()
        };
        pieces.iter().all(is_sound).then_some(pieces)
    })
}

/// The direction in which `option` should arrive, where it ends at a goal that asks for one.
fn goal_heading(option: &GuidedOption) -> Option<Heading> {
    option.target.goal()?.heading.map(|(heading, _)| heading)
}

/// Where `path` passes from one option to the next, metres, with both of its ends; `None` if it misses a set.
fn cuts(options: &[Arc<GuidedOption>], path: &GuidePath) -> Option<Vec<f64>> {
    let total_m: f64 = options.iter().map(|option| option.guide.length_m()).sum();
    let mut cuts = vec![0.0];
    let mut before_m = 0.0;
    for option in &options[..options.len() - 1] {
        before_m += option.guide.length_m();
        let expected_m = before_m / total_m * path.length_m();
        let from_m = (expected_m - SEARCH_M).max(cuts[cuts.len() - 1] + OPTION_MIN_M);
        let until_m = (expected_m + SEARCH_M).min(path.length_m() - OPTION_MIN_M);
        let count = ((until_m - from_m) / SEARCH_STEP_M).floor();
        let places = (0..=count.max(-1.0) as i64).map(|i| from_m + i as f64 * SEARCH_STEP_M);
        let off_m = |arc_m: f64| (path.pose_at(arc_m).position - option.target.center()).norm();
        let nearest_m = places.min_by(|&a, &b| off_m(a).total_cmp(&off_m(b)))?;
        if !option.is_done(&path.pose_at(nearest_m)) {
            return None;
        }
        cuts.push(nearest_m);
    }
    cuts.push(path.length_m());
    Some(cuts)
}

/// The piece of `path` between two arc lengths.
fn piece(path: &GuidePath, from_m: f64, to_m: f64, spacing_m: f64) -> Option<GuidePath> {
    // One segment more than fits, so that every gap stays under the threshold.
    let count = ((to_m - from_m) / spacing_m).floor() + 1.0;
    let pose = |i: usize| path.pose_at(from_m + (to_m - from_m) * i as f64 / count);
    GuidePath::new((0..=count as usize).map(pose).collect(), spacing_m).ok()
}
