//! Guides on drawn maps: doors, ends, walls in the way, and options of a small abstraction.

use std::sync::Arc;

use sharp_guide::{
    ClearanceSearch, Goal, GuideEnd, GuidePath, GuidePlanner, GuideRequest, GuideRobot, GuidedOption, LegId,
    NoGuide, OptionSpace, Place, PseudoReward, Steering, UnguidedOption,
};
use sharp_options::{AllowedRule, OptionKind, OptionSet, OptionSettings, OptionSpec};
use sharp_rbvd::{Rbvd, RbvdSettings, StateId};
use sharp_space::{
    Cell, DistanceField, Footprint, FootprintChecker, Heading, OccupancyGrid, Point, Pose, Region, RegionId,
    RobotGeometry, Seed,
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

fn plan(drawing: &str, start: GuideEnd, goal: GuideEnd, steering: Steering) -> Result<GuidePath, NoGuide> {
    let checker = FootprintChecker::new(&grid(drawing), husky());
    let request = GuideRequest { start, goal, allowed: &|_| true };
    let mut rng = Seed(1).stream("guide", 0);
    ClearanceSearch::default().plan(&request, &GuideRobot::new(&checker, steering), &mut rng)
}

/// Where `guide` crosses the wall of [`DOOR`], and in which direction.
fn crossing(guide: &GuidePath) -> Pose {
    let poses = (0..=1000).map(|i| guide.pose_at(guide.length_m() * f64::from(i) / 1000.0));
    poses.min_by(|a, b| (a.position.x - 4.1).abs().total_cmp(&(b.position.x - 4.1).abs())).expect("many")
}

#[test]
fn a_door_is_passed_in_the_middle_and_straight() {
    for (start, goal) in [((1.2, 0.8), (7.0, 0.8)), ((1.2, 2.8), (7.0, 0.8)), ((2.6, 0.7), (6.0, 3.0))] {
        let guide = plan(DOOR, end(start.0, start.1), end(goal.0, goal.1), HUSKY).expect("the door is wide");
        let door = crossing(&guide);
        assert!((door.position.y - 1.9).abs() < 0.15, "off the middle: {door:?}");
        assert!(door.heading.radians().abs() < 0.35, "askew: {door:?}");
    }
}

#[test]
fn the_goal_is_reached_along_its_heading() {
    let goal = GuideEnd { heading: Some(Heading::new(0.9)), ..end(7.0, 2.2) };
    for steering in [HUSKY, LIMO] {
        let guide = plan(DOOR, end(5.2, 1.9), goal, steering).expect("an open room");
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
    let guide = plan(DOOR, end(5.2, 1.9), backwards, HUSKY).expect("an open room");
    assert!(guide.length_m() < 2.0, "a detour of {} m to please the heading", guide.length_m());
}

#[test]
fn a_car_that_looks_away_turns_round_first() {
    let start = GuideEnd { heading: Some(Heading::new(3.1)), ..end(2.2, 1.9) };
    let guide = plan(DOOR, start, end(7.0, 1.9), LIMO).expect("there is room for a loop");
    assert!(guide.start().heading.turn_to(Heading::new(3.1)).abs() < 0.6, "{:?}", guide.start());
    assert!(guide.length_m() > 5.5, "only {} m with a loop", guide.length_m());
}

#[test]
fn hopeless_requests_are_named() {
    let sealed = DOOR
        .replace("#.......................................#", "#...................#...................#");
    assert_eq!(plan(&sealed, end(1.2, 0.8), end(7.0, 0.8), HUSKY), Err(NoGuide::Unreachable));
    let (inside, outside, wall) = (end(1.2, 0.8), end(-3.0, 0.5), end(4.1, 0.5));
    assert_eq!(plan(DOOR, outside, inside, HUSKY), Err(NoGuide::Start(outside.position)));
    assert_eq!(plan(DOOR, inside, outside, HUSKY), Err(NoGuide::Goal(outside.position)));
    assert_eq!(plan(DOOR, wall, inside, HUSKY), Err(NoGuide::Footprint(wall.position)));
    assert_eq!(plan(DOOR, inside, inside, HUSKY), Err(NoGuide::NoLength(inside.position)));
}

/// Columns of the three regions: the rooms' middles and the door. All lie in row 9.
const REGION_COLUMNS: [usize; 3] = [8, 20, 32];

/// Options of `kind` between the three regions.
fn space(kind: OptionKind) -> (OptionSpace, FootprintChecker) {
    let grid = grid(DOOR);
    let clearance = DistanceField::new(&grid);
    let region =
        |(id, col)| Region::new(RegionId(id), vec![Cell::new(col, 9)], &clearance).expect("one cell");
    let regions: Vec<Region> = (0..).zip(REGION_COLUMNS).map(region).collect();
    let settings = RbvdSettings::for_footprint(&husky(), 0.02, 0.2);
    let rbvd = Rbvd::build(&clearance, &regions, &settings).expect("three regions in free space");
    let options = Arc::new(OptionSet::synthesize(&rbvd, kind, &OptionSettings::default()));
    let space = OptionSpace { states: Arc::new(rbvd), options, rule: AllowedRule::default() };
    (space, FootprintChecker::new(&grid, husky()))
}

/// Option `spec` with its guide.
fn guided(space: &OptionSpace, spec: &OptionSpec, checker: &FootprintChecker) -> GuidedOption {
    let center = |endpoint| space.options.endpoint(endpoint).center;
    let (start, end) = (center(spec.initiation), center(spec.termination));
    let (id, from, to) = (LegId::Option(spec.id), spec.id.from(), spec.id.to());
    let option = UnguidedOption { id, from, to, start, end, heading: None, goal_heading: None };
    let (robot, mut rng) = (GuideRobot::new(checker, HUSKY), Seed(1).stream("guide", 0));
    let guide = option
        .plan_guide(space, &robot, &ClearanceSearch::default(), &mut rng)
        .unwrap_or_else(|reason| panic!("{id}: {reason}"));
    GuidedOption::new(space, id, (from, to), guide, Goal::new(end, 0.4, checker.clearance()))
}

#[test]
fn a_guided_option_joins_its_endpoints_and_knows_three_places() {
    for kind in [OptionKind::Centroid, OptionKind::Interface] {
        let (space, checker) = space(kind);
        assert!(!space.options.options().is_empty(), "{kind:?}");
        for spec in space.options.options() {
            let option = guided(&space, spec, &checker);
            let (start, goal) = (option.guide.start(), option.guide.end());
            let source = option.source.as_ref().expect("an option begins at an endpoint");
            assert!((start.position - source.center).norm() < 1e-9, "{} starts at c_I", spec.id);
            assert!((goal.position - option.target.center()).norm() < 1e-9, "{} ends at c_β", spec.id);
            assert_eq!(option.place(&goal), Place::Termination, "{}", spec.id);
            assert_eq!(option.place(&start), Place::Allowed, "{}", spec.id);
            let outside = (0..).map(StateId).zip(REGION_COLUMNS);
            let outside = outside.filter(|(state, _)| !option.allowed.contains(state)).map(|(_, col)| col);
            let elsewhere: Vec<Pose> =
                outside.map(|col| Pose::new(0.2 * (col as f64 + 0.5), 1.9, 0.0)).collect();
            assert!(!elsewhere.is_empty(), "{} may be everywhere", spec.id);
            let value = |pose: &Pose| PseudoReward::default().value(&option.guide, pose, option.place(pose));
            for pose in &elsewhere {
                assert_eq!(value(pose), -100.0, "{} astray at {pose:?}", spec.id);
            }
            assert_eq!(value(&goal), 1000.0, "{} done", spec.id);
            let least = -start.distance_m(&goal);
            assert!((value(&start) - least).abs() < 1e-9, "{} at p_1", spec.id);
        }
    }
}

#[test]
fn guides_of_successors_join_without_a_kink() {
    let (space, checker) = space(OptionKind::Interface);
    for spec in space.options.options() {
        let option = guided(&space, spec, &checker);
        // Both interfaces of this map are crossed along the x axis.
        for pose in [option.guide.start(), option.guide.end()] {
            assert!(pose.heading.unit().y.abs() < 0.35, "{} crosses at {pose:?}", spec.id);
        }
    }
}
