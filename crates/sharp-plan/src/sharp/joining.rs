//! One path for a whole plan: guides that join smoothly.
//!
//! The guide of an option is drawn for the option alone, through the centres of its sets. In a plan the robot
//! comes from somewhere and goes on to somewhere: the guides of the plan are smoothed together and cut where
//! they come nearest to those centres. The library keeps the guides as they were drawn.

use std::sync::Arc;

use sharp_guide::{GuideEnd, GuidePath, GuideRequest, GuideSettings, smooth_guide};
use sharp_space::{Cell, Point, Pose};

use crate::leg::Leg;
use crate::percept::Workspace;
use crate::planner::Query;
use crate::spare::Spare;

/// A cut is looked for this far before and behind the place where the guides met, metres.
const SEARCH_M: f64 = 2.0;
/// The distance between two places of which one may become a cut, metres.
const SEARCH_STEP_M: f64 = 0.05;
/// The path meets a smaller disc within each set, by this factor.
const MEETS: f64 = 0.6;
/// A leg keeps at least this much way, metres.
const LEG_MIN_M: f64 = 0.3;

/// `legs` with guides that join smoothly; as they are where that fails.
pub(super) fn join_guides(
    workspace: &Workspace,
    query: &Query,
    legs: Vec<Arc<Leg>>,
    settings: &GuideSettings,
) -> Vec<Arc<Leg>> {
    if legs.len() < 2 {
        return legs;
    }
    match joined(workspace, query, &legs, settings) {
        Some(guides) => {
            let with = |(leg, guide): (&Arc<Leg>, GuidePath)| Arc::new(Leg { guide, ..Leg::clone(leg) });
            legs.iter().zip(guides).map(with).collect()
        }
        None => legs,
    }
}

fn joined(
    workspace: &Workspace,
    query: &Query,
    legs: &[Arc<Leg>],
    settings: &GuideSettings,
) -> Option<Vec<GuidePath>> {
    let way: Vec<Point> =
        legs.iter().flat_map(|leg| leg.guide.poses().iter().map(|pose| pose.position)).collect();
    let frame = legs[0].rbvd.frame();
    let allowed = |cell: Cell| {
        let pose = Pose::at(frame.center(cell), query.start.heading);
        legs.iter().any(|leg| leg.rbvd.state_of(cell).is_some() && leg.is_allowed(&pose))
    };
    let request = GuideRequest {
        start: GuideEnd { position: way[0], heading: Some(query.start.heading) },
        goal: GuideEnd { position: way[way.len() - 1], heading: None },
        allowed: &allowed,
    };
    let disc = |leg: &Arc<Leg>| leg.target.endpoint().map(|set| (set.center, MEETS * set.radius_m));
    let discs: Vec<(Point, f64)> = legs.iter().filter_map(disc).collect();
    let path = workspace.spares_at(Some(query.start)).find_map(|spare| {
        let Spare { checker, steering } = spare;
        let path = smooth_guide((&way, &discs), &request, checker, steering, settings).ok()?;
        cuts(legs, &path).map(|cuts| (path, cuts))
    });
    let (path, cuts) = path?;
    let pieces = cuts.windows(2).map(|ends| piece(&path, ends[0], ends[1], settings.spacing_m));
    pieces.collect()
}

/// Where `path` passes from one leg to the next, metres, with both of its ends; `None` if it misses a set.
fn cuts(legs: &[Arc<Leg>], path: &GuidePath) -> Option<Vec<f64>> {
    let total_m: f64 = legs.iter().map(|leg| leg.guide.length_m()).sum();
    let mut cuts = vec![0.0];
    let mut before_m = 0.0;
    for leg in &legs[..legs.len() - 1] {
        before_m += leg.guide.length_m();
        let expected_m = before_m / total_m * path.length_m();
        let from_m = (expected_m - SEARCH_M).max(cuts[cuts.len() - 1] + LEG_MIN_M);
        let until_m = (expected_m + SEARCH_M).min(path.length_m() - LEG_MIN_M);
        let count = ((until_m - from_m) / SEARCH_STEP_M).floor();
        let places = (0..=count.max(-1.0) as i64).map(|i| from_m + i as f64 * SEARCH_STEP_M);
        let off_m = |arc_m: f64| (path.pose_at(arc_m).position - leg.target.center()).norm();
        let nearest_m = places.min_by(|&a, &b| off_m(a).total_cmp(&off_m(b)))?;
        if !leg.is_done(&path.pose_at(nearest_m)) {
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

#[cfg(test)]
mod tests {
    use sharp_options::OptionKind;

    use super::*;
    use crate::drawn::{HALL, RING, along, legs, world};

    const AROUND: [(f64, f64); 2] = [(1.4, 1.2), (8.6, 4.8)];

    fn around() -> Query {
        let [start, goal] = AROUND;
        Query { start: Pose::new(start.0, start.1, 0.0), goal: Pose::new(goal.0, goal.1, 0.0) }
    }

    /// The largest turn from one pose to the next along all guides, radians.
    fn sharpest_rad(legs: &[Arc<Leg>]) -> f64 {
        let poses: Vec<&Pose> = legs.iter().flat_map(|leg| leg.guide.poses()).collect();
        let turns = poses.windows(2).map(|pair| pair[0].heading.turn_to(pair[1].heading).abs());
        turns.fold(0.0, f64::max)
    }

    #[test]
    fn joined_guides_meet_in_the_sets_and_bend_less() {
        for (drawing, query) in [(HALL, along()), (RING, around())] {
            for kind in [OptionKind::Centroid, OptionKind::Interface] {
                let (workspace, abstraction) = world(drawing, kind);
                let alone = legs(&workspace, &abstraction, query);
                let joined = join_guides(&workspace, &query, alone.clone(), &GuideSettings::default());
                for pair in joined.windows(2) {
                    let (end, start) = (pair[0].guide.end(), pair[1].guide.start());
                    let name = format!("{kind:?}, {} to {}", pair[0].id, pair[1].id);
                    assert!(end.distance_m(&start) < 1e-9, "{name}: a gap");
                    assert!(end.heading.turn_to(start.heading).abs() < 1e-9, "{name}: a kink");
                    assert!(pair[0].is_done(&end), "{name}: the path misses the set");
                }
                let (before, after) = (sharpest_rad(&alone), sharpest_rad(&joined));
                assert!(after <= before + 0.05, "{kind:?}: {after} rad at once instead of {before}");
                assert!(joined.iter().all(|leg| leg.guide.length_m() > 0.9 * LEG_MIN_M), "{kind:?}: a stump");
            }
        }
    }

    #[test]
    fn a_path_that_cannot_meet_a_set_leaves_the_guides_alone() {
        let (workspace, abstraction) = world(HALL, OptionKind::Centroid);
        let alone = legs(&workspace, &abstraction, along());
        // Backwards, the sets come in the wrong order.
        let backwards: Vec<Arc<Leg>> = alone.iter().rev().cloned().collect();
        let joined = join_guides(&workspace, &along(), backwards.clone(), &GuideSettings::default());
        let guides = |legs: &[Arc<Leg>]| legs.iter().map(|leg| leg.guide.clone()).collect::<Vec<_>>();
        assert_eq!(guides(&joined), guides(&backwards));
        let single = join_guides(&workspace, &along(), alone[..1].to_vec(), &GuideSettings::default());
        assert_eq!(guides(&single), guides(&alone[..1]), "one leg has nothing to join");
    }
}
