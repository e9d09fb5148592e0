//! Guides of a plan that join smoothly.

mod worlds;

use std::sync::Arc;

use sharp_guide::{GuideSettings, GuidedOption, join_guides};
use sharp_options::OptionKind;
use sharp_space::{Point, Pose};
use worlds::{Drawn, HALL, Problem, RING, along};

/// Half way round the block of the [`RING`].
fn around() -> Problem {
    Problem { start: Pose::new(1.4, 1.2, 0.0), goal: Point::new(8.6, 4.8) }
}

/// The largest turn from one pose to the next along all guides, radians.
fn sharpest_rad(options: &[Arc<GuidedOption>]) -> f64 {
    let poses: Vec<&Pose> = options.iter().flat_map(|option| option.guide.poses()).collect();
    let turns = poses.windows(2).map(|pair| pair[0].heading.turn_to(pair[1].heading).abs());
    turns.fold(0.0, f64::max)
}

fn joined(drawn: &Drawn, options: &[Arc<GuidedOption>], start: Pose) -> Vec<Arc<GuidedOption>> {
    join_guides(options.to_vec(), start, &drawn.robot(), &GuideSettings::default())
}

fn guides_are_equal(a: &[Arc<GuidedOption>], b: &[Arc<GuidedOption>]) -> bool {
    a.iter().map(|option| &option.guide).eq(b.iter().map(|option| &option.guide))
}

#[test]
fn joined_guides_meet_in_the_sets_and_bend_less() {
    let (centroid, interface) = (OptionKind::Centroid, OptionKind::Interface);
    for (drawing, problem, kind, plan) in [
        (HALL, along(), centroid, &["first:0", "c:0-1", "c:1-2", "last:2"][..]),
        (HALL, along(), interface, &["first:0", "i:0-1-2", "last:1"]),
        (RING, around(), centroid, &["first:2", "c:2-3", "c:3-1", "last:1"]),
        (RING, around(), interface, &["first:3", "i:2-3-1", "last:2"]),
    ] {
        let drawn = Drawn::new(drawing, kind);
        let alone = drawn.plan(plan, problem);
        let joined = joined(&drawn, &alone, problem.start);
        assert!(!guides_are_equal(&joined, &alone), "{plan:?}: nothing was joined");
        for pair in joined.windows(2) {
            let (end, start) = (pair[0].guide.end(), pair[1].guide.start());
            let name = format!("{kind:?}, {} to {}", pair[0].id, pair[1].id);
            assert!(end.distance_m(&start) < 1e-9, "{name}: a gap");
            assert!(end.heading.turn_to(start.heading).abs() < 1e-9, "{name}: a kink");
            assert!(pair[0].is_done(&end), "{name}: the path misses the set");
        }
        let (before, after) = (sharpest_rad(&alone), sharpest_rad(&joined));
        assert!(after <= before + 0.05, "{kind:?}: {after} rad at once instead of {before}");
        assert!(joined.iter().all(|option| option.guide.length_m() > 0.27), "{kind:?}: a stump");
    }
}

#[test]
fn a_path_that_cannot_meet_a_set_leaves_the_guides_alone() {
    let drawn = Drawn::new(HALL, OptionKind::Centroid);
    let alone = drawn.plan(&["first:0", "c:0-1", "c:1-2", "last:2"], along());
    // Backwards, the sets come in the wrong order.
    let backwards: Vec<Arc<GuidedOption>> = alone.iter().rev().cloned().collect();
    assert!(guides_are_equal(&joined(&drawn, &backwards, along().start), &backwards), "backwards");
    let single = joined(&drawn, &alone[..1], along().start);
    assert!(guides_are_equal(&single, &alone[..1]), "one option has nothing to join");
}
