//! Guides of a plan that join smoothly.

mod worlds;

use std::sync::Arc;

use sharp_guide::{Departure, GuideSettings, GuidedOption, join_guides};
use sharp_options::OptionKind;
use sharp_space::{Point, Pose, Vector};
use worlds::{Drawn, HALL, Problem, RING, along};

/// Two halls with a door of two cells between them, and four regions in a row.
const TWO_HALLS: &str = "
    #################################################
    #.......................#.......................#
    #.......................#.......................#
    #.......................#.......................#
    #....0......1...................2.......3.......#
    #...............................................#
    #.......................#.......................#
    #.......................#.......................#
    #.......................#.......................#
    #################################################";

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
fn where_a_path_cannot_meet_a_set_the_guides_are_left_alone() {
    let drawn = Drawn::new(HALL, OptionKind::Centroid);
    let alone = drawn.plan(&["first:0", "c:0-1", "c:1-2", "last:2"], along());
    // There and back again: no path along the hall meets the same sets in the wrong order.
    let back = [0, 2, 1, 3].map(|index| Arc::clone(&alone[index])).to_vec();
    let joined_back = joined(&drawn, &back, along().start);
    let kept = back.iter().zip(&joined_back).filter(|(before, after)| before.guide == after.guide).count();
    assert!(kept > 0, "all of it was joined");
    for (before, after) in back.iter().zip(&joined_back) {
        let ends = [(before.guide.end(), after.guide.end()), (before.guide.start(), after.guide.start())];
        let off_m = ends.map(|(before, after)| before.distance_m(&after));
        assert!(off_m.iter().all(|&off_m| off_m < 0.5), "{}: moved by {off_m:?} m", after.id);
    }
    let single = joined(&drawn, &alone[..1], along().start);
    assert!(guides_are_equal(&single, &alone[..1]), "one option has nothing to join");
}

#[test]
fn a_narrow_door_takes_the_margin_from_the_options_beside_it_alone() {
    // The door in the middle is 0.8 m wide, the robot 0.67 m.
    let drawn = Drawn::new(TWO_HALLS, OptionKind::Centroid);
    let plan = ["first:0", "c:0-1", "c:1-2", "c:2-3", "last:3"];
    let problem = Problem { start: Pose::new(1.0, 2.2, 0.0), goal: Point::new(18.6, 2.2) };
    let alone = drawn.plan(&plan, problem);
    let joined = joined(&drawn, &alone, problem.start);
    let widest = &*drawn.robot().inflated[0].geometry;
    let has_margin: Vec<bool> = joined
        .iter()
        .map(|option| {
            option.guide.poses().windows(2).all(|pair| widest.is_segment_free(pair[0], pair[1], 0.05))
        })
        .collect();
    assert_eq!(has_margin, [true, true, false, true, true], "{plan:?}");
    for pair in joined.windows(2) {
        let (end, start) = (pair[0].guide.end(), pair[1].guide.start());
        assert!(end.distance_m(&start) < 1e-9, "{} to {}: a gap", pair[0].id, pair[1].id);
        assert!(end.heading.turn_to(start.heading).abs() < 0.16, "{} to {}: a kink", pair[0].id, pair[1].id);
        assert!(pair[0].is_done(&end), "{}: the path misses the set", pair[0].id);
    }
}

#[test]
fn behind_a_beginning_that_is_driven_with_care_all_others_are_joined() {
    let drawn = Drawn::new(RING, OptionKind::Centroid);
    let mut alone = drawn.plan(&["first:2", "c:2-3", "c:3-1", "last:1"], around());
    let careful = Departure { careful_m: 0.5, ..Departure::default() };
    alone[0] = Arc::new(GuidedOption::clone(&alone[0]).with_departure(careful));
    let joined = joined(&drawn, &alone, around().start);
    assert!(joined[0].guide == alone[0].guide, "it stays as it was");
    assert!(joined[1..].iter().zip(&alone[1..]).all(|(after, before)| after.guide != before.guide), "joined");
    assert!(joined[0].guide.end().distance_m(&joined[1].guide.start()) < 1e-9, "a gap");
}

#[test]
fn an_option_of_a_joined_plan_ends_where_its_set_is_passed_close_by_and_the_next_may_drive() {
    let drawn = Drawn::new(HALL, OptionKind::Interface);
    let joined = joined(&drawn, &drawn.plan(&["first:0", "i:0-1-2", "last:1"], along()), along().start);
    let ends: Vec<bool> = joined.iter().map(|option| option.ends_in_passing).collect();
    assert_eq!(ends, [true, true, false], "the last one ends at the goal only");
    let (first, next) = (&joined[0], &joined[1]);
    let radius_m = first.target.endpoint().expect("a set").radius_m;
    let beside = |factor: f64| {
        Pose::at(first.guide.end().to_world(Vector::new(0.0, factor * radius_m)), first.guide.end().heading)
    };
    assert!(!first.is_done(&beside(1.5)), "beside the set");
    assert!(first.is_passed(&beside(1.5), 0.0, next), "beside the set, the guide behind it");
    assert!(!first.is_passed(&beside(1.5), 0.2, next), "some of the guide is left");
    assert!(!first.is_passed(&beside(4.0), 0.0, next), "far from the set");
    let strict = GuidedOption { ends_in_passing: false, ..GuidedOption::clone(first) };
    assert!(!strict.is_passed(&beside(1.5), 0.0, next), "an option that ends in its set only");
    let narrow = GuidedOption { allowed: vec![], source: None, ..GuidedOption::clone(next) };
    assert!(!first.is_passed(&beside(1.5), 0.0, &narrow), "where the next one may not drive");
}
