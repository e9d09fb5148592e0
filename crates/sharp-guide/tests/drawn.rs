//! Guides on drawn maps: doors, ends, walls in the way, and options of a small abstraction.

use sharp_guide::{
    Abstraction, GuideEnd, GuidePath, GuideRequest, GuideSettings, NoGuide, OptionGuide, Place, Robot,
    Steering, plan_guide, smooth_guide,
};
use sharp_options::{AllowedRule, OptionKind, OptionSet, OptionSettings};
use sharp_rbvd::{Rbvd, RbvdSettings};
use sharp_space::{
    Cell, DistanceField, Footprint, FootprintChecker, Heading, OccupancyGrid, Point, Pose, Region, RegionId,
    Seed,
};

/// Two rooms, one door of 1.2 m whose middle is at (4.1, 2.4); cells of 0.2 m.
const DOOR: &str = "
    #########################################
    #...................#...................#
    #...................#...................#
    #...................#...................#
    #...................#...................#
    #...................#...................#
    #.......................................#
    #.......................................#
    #.......................................#
    #.......................................#
    #.......................................#
    #.......................................#
    #...................#...................#
    #...................#...................#
    #...................#...................#
    #...................#...................#
    #...................#...................#
    #...................#...................#
    #########################################";

const HUSKY: Steering = Steering::RotateTranslate;
const LIMO: Steering = Steering::Dubins { radius_m: 0.4 };

fn husky() -> Footprint {
    Footprint::rectangle(0.5, 0.335).expect("sound")
}

fn end(x: f64, y: f64) -> GuideEnd {
    GuideEnd { position: Point::new(x, y), heading: None }
}

fn grid(drawing: &str) -> OccupancyGrid {
    OccupancyGrid::from_ascii(0.2, drawing).expect("a sound drawing")
}

/// The [`DOOR`], closed.
fn grid_with_wall() -> OccupancyGrid {
    grid(
        &DOOR.replace(
            "#.......................................#",
            "#...................#...................#",
        ),
    )
}

fn plan(drawing: &str, start: GuideEnd, goal: GuideEnd, steering: &Steering) -> Result<GuidePath, NoGuide> {
    let checker = FootprintChecker::new(&grid(drawing), husky());
    let request = GuideRequest { start, goal, allowed: &|_| true };
    let mut rng = Seed(1).stream("guide", 0);
    plan_guide(&request, &checker, steering, &GuideSettings::default(), &mut rng)
}

/// Where `guide` crosses the wall of [`DOOR`], and in which direction.
fn crossing(guide: &GuidePath) -> Pose {
    let poses = (0..=1000).map(|i| guide.pose_at(guide.length_m() * f64::from(i) / 1000.0));
    poses.min_by(|a, b| (a.position.x - 4.1).abs().total_cmp(&(b.position.x - 4.1).abs())).expect("many")
}

#[test]
fn a_door_is_passed_in_the_middle_and_straight() {
    for (start, goal) in [((1.2, 0.8), (7.0, 0.8)), ((1.2, 2.8), (7.0, 0.8)), ((2.6, 0.7), (6.0, 3.0))] {
        let guide = plan(DOOR, end(start.0, start.1), end(goal.0, goal.1), &HUSKY).expect("the door is wide");
        let door = crossing(&guide);
        assert!((door.position.y - 1.9).abs() < 0.15, "off the middle: {door:?}");
        assert!(door.heading.radians().abs() < 0.35, "askew: {door:?}");
    }
}

#[test]
fn the_goal_is_reached_along_its_heading() {
    let goal = GuideEnd { heading: Some(Heading::new(0.9)), ..end(7.0, 2.2) };
    for steering in [HUSKY, LIMO] {
        let guide = plan(DOOR, end(5.2, 1.9), goal, &steering).expect("an open room");
        assert!(
            guide.end().heading.turn_to(Heading::new(0.9)).abs() < 0.01,
            "{steering:?}: {:?}",
            guide.end()
        );
    }
}

#[test]
fn a_heading_at_the_goal_that_does_not_fit_is_let_go() {
    let backwards = GuideEnd { heading: Some(Heading::new(3.1)), ..end(7.0, 1.9) };
    let guide = plan(DOOR, end(5.2, 1.9), backwards, &HUSKY).expect("an open room");
    assert!(guide.length_m() < 2.0, "a detour of {} m to please the heading", guide.length_m());
}

#[test]
fn a_car_that_looks_away_turns_round_first() {
    let start = GuideEnd { heading: Some(Heading::new(3.1)), ..end(2.2, 1.9) };
    let guide = plan(DOOR, start, end(7.0, 1.9), &LIMO).expect("there is room for a loop");
    assert!(guide.start().heading.turn_to(Heading::new(3.1)).abs() < 0.6, "{:?}", guide.start());
    assert!(guide.length_m() > 5.5, "only {} m with a loop", guide.length_m());
}

#[test]
fn a_way_of_ones_own_becomes_smooth_and_keeps_to_its_discs() {
    let grid = grid(DOOR);
    let checker = FootprintChecker::new(&grid, husky());
    let way = [(1.2, 1.0), (2.6, 3.0), (4.1, 1.9), (7.0, 1.9)].map(|(x, y)| Point::new(x, y));
    let (start, goal) = (end(1.2, 1.0), end(7.0, 1.9));
    let request = GuideRequest { start, goal, allowed: &|_| true };
    let smooth = |discs: &[(Point, f64)]| {
        smooth_guide((&way, discs), &request, &checker, &HUSKY, &GuideSettings::default())
    };
    let off_m = |guide: &GuidePath| {
        guide.poses().iter().map(|pose| (pose.position - way[1]).norm()).fold(f64::INFINITY, f64::min)
    };
    let (free, held) = (smooth(&[]).expect("a room"), smooth(&[(way[1], 0.2)]).expect("a room"));
    assert!(off_m(&free) > 0.4, "the corner is cut: {} m", off_m(&free));
    assert!(off_m(&held) < 0.35, "the disc is missed by {} m", off_m(&held) - 0.2);
    for guide in [&free, &held] {
        let bends = guide.poses().windows(2).map(|pair| pair[0].heading.turn_to(pair[1].heading).abs());
        let worst_rad = bends.fold(0.0, f64::max);
        assert!(worst_rad < 0.8, "a kink of {worst_rad} rad");
    }
    let through_wall = [start.position, goal.position];
    let blocked = grid_with_wall();
    let walled = FootprintChecker::new(&blocked, husky());
    let refused = smooth_guide((&through_wall, &[]), &request, &walled, &HUSKY, &GuideSettings::default());
    assert!(matches!(refused, Err(NoGuide::Footprint(_))), "{refused:?}");
}

#[test]
fn hopeless_requests_are_named() {
    let sealed = DOOR
        .replace("#.......................................#", "#...................#...................#");
    assert_eq!(plan(&sealed, end(1.2, 0.8), end(7.0, 0.8), &HUSKY), Err(NoGuide::Unreachable));
    let (inside, outside, wall) = (end(1.2, 0.8), end(-3.0, 0.5), end(4.1, 0.5));
    assert_eq!(plan(DOOR, outside, inside, &HUSKY), Err(NoGuide::Start(outside.position)));
    assert_eq!(plan(DOOR, inside, outside, &HUSKY), Err(NoGuide::Goal(outside.position)));
    assert_eq!(plan(DOOR, wall, inside, &HUSKY), Err(NoGuide::Footprint(wall.position)));
    assert_eq!(plan(DOOR, inside, inside, &HUSKY), Err(NoGuide::NoLength(inside.position)));
}

/// Three regions: the rooms' middles and the door.
fn abstraction() -> (Rbvd, FootprintChecker) {
    let grid = grid(DOOR);
    let checker = FootprintChecker::new(&grid, husky());
    let clearance = DistanceField::new(&grid);
    let region = |id, col| Region::new(RegionId(id), vec![Cell::new(col, 9)], &clearance).expect("one cell");
    let settings = RbvdSettings::for_footprint(&husky(), 0.02, 0.2);
    let rbvd = Rbvd::build(&clearance, &[region(0, 8), region(1, 20), region(2, 32)], &settings);
    (rbvd.expect("three regions in free space"), checker)
}

#[test]
fn an_option_guide_joins_its_endpoints_and_knows_three_places() {
    let (rbvd, checker) = abstraction();
    let robot = Robot { checker: &checker, steering: &HUSKY };
    for kind in [OptionKind::Centroid, OptionKind::Interface] {
        let options = OptionSet::synthesize(&rbvd, kind, &OptionSettings::default());
        let abstraction = Abstraction { rbvd: &rbvd, options: &options, rule: AllowedRule::default() };
        assert!(!options.options().is_empty(), "{kind:?}");
        for option in options.options() {
            let mut rng = Seed(1).stream("guide", 0);
            let guide = OptionGuide::new(option, &abstraction, &robot, &GuideSettings::default(), &mut rng)
                .unwrap_or_else(|reason| panic!("{}: {reason}", option.id));
            let (start, goal) = (guide.path.start(), guide.path.end());
            assert!((start.position - guide.initiation.center).norm() < 1e-9, "{} starts at c_I", option.id);
            assert!((goal.position - guide.termination.center).norm() < 1e-9, "{} ends at c_β", option.id);
            assert_eq!(guide.place(&goal, &abstraction), Place::Termination, "{}", option.id);
            assert_eq!(guide.place(&start, &abstraction), Place::Allowed, "{}", option.id);
            let elsewhere = Pose::new(-5.0, 0.0, 0.0);
            assert_eq!(guide.value(&elsewhere, &abstraction), -100.0, "{} astray", option.id);
            assert_eq!(guide.value(&goal, &abstraction), 1000.0, "{} done", option.id);
            let least = -(start.distance_m(&goal));
            assert!((guide.value(&start, &abstraction) - least).abs() < 1e-9, "{} at p_1", option.id);
        }
    }
}

#[test]
fn guides_of_successors_join_without_a_kink() {
    let (rbvd, checker) = abstraction();
    let robot = Robot { checker: &checker, steering: &HUSKY };
    let options = OptionSet::synthesize(&rbvd, OptionKind::Interface, &OptionSettings::default());
    let abstraction = Abstraction { rbvd: &rbvd, options: &options, rule: AllowedRule::default() };
    for option in options.options() {
        let mut rng = Seed(1).stream("guide", 0);
        let guide = OptionGuide::new(option, &abstraction, &robot, &GuideSettings::default(), &mut rng)
            .unwrap_or_else(|reason| panic!("{}: {reason}", option.id));
        // Both interfaces of this map are crossed along the x axis.
        for pose in [guide.path.start(), guide.path.end()] {
            assert!(pose.heading.unit().y.abs() < 0.35, "{} crosses at {pose:?}", option.id);
        }
    }
}
