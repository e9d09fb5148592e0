//! What plans cost, how robots leave their start, and which plan is the cheapest.

use std::sync::atomic::{AtomicUsize, Ordering};

use sharp_drive::SuccessCount;
use sharp_guide::{ClearanceSearch, GuideRequest, GuideRobot};
use sharp_rbvd::{Rbvd, RbvdSettings};
use sharp_sim::RobotModel;
use sharp_space::{DistanceField, GridFrame, Region, RegionId, Stream};

use super::*;
use crate::test_worlds::{HALL, RING, SEALED, along, straight, world};
use sharp_options::OptionKind;

fn names(options: &[Arc<GuidedOption>]) -> String {
    options.iter().map(|option| option.id.to_string()).collect::<Vec<_>>().join(" ")
}

/// The cheapest plan for `query` as `settings` say, where `measured` knows what options cost.
fn plan(
    (world, abstraction): &(World, Abstraction),
    query: Query,
    settings: SearchSettings,
    measured: &dyn Fn(LegId) -> Option<SuccessEstimate>,
) -> Option<Vec<Arc<GuidedOption>>> {
    let method = Method { search: settings, ..Method::fast() };
    let search = Search::new(world, abstraction, &method, &NoiseModel::nominal(), query, [], Seed(1));
    search.expect("both ends have a state").plan(measured, &()).map(|(_, plan)| plan)
}

fn unmeasured(_: LegId) -> Option<SuccessEstimate> {
    None
}

/// Round the block of the [`RING`].
fn round() -> Query {
    Query { start: Pose::new(1.4, 4.2, 0.0), goal: Pose::new(8.6, 1.4, 0.0) }
}

#[test]
fn a_hand_over_that_was_seen_to_fail_sends_the_plan_the_other_way_round() {
    let (world, abstraction) = world(RING, OptionKind::Interface);
    let method = Method::fast();
    let search = Search::new(&world, &abstraction, &method, &NoiseModel::nominal(), round(), [], Seed(1));
    let mut search = search.expect("both ends have a state");
    let (_, first) = search.plan(&unmeasured, &()).expect("two ways lead round");
    let ids = |options: &[Arc<GuidedOption>]| options.iter().map(|o| o.id).collect::<Vec<_>>();
    for pair in ids(&first).windows(2) {
        search.charge(pair[0], pair[1], 1000.0);
    }
    let (_, second) = search.plan(&unmeasured, &()).expect("the other way");
    let before = ids(&first);
    let kept = ids(&second).windows(2).any(|pair| before.windows(2).any(|joined| joined == pair));
    assert!(!kept, "{} keeps a hand-over of {}", names(&second), names(&first));
}

#[test]
fn measured_costs_make_a_plan_change_its_way() {
    let world = world(RING, OptionKind::Interface);
    let settings = SearchSettings::default();
    let first = plan(&world, round(), settings, &unmeasured).expect("two ways lead round");
    let option = first.iter().find(|o| matches!(o.id, LegId::Option(_))).expect("an option").id;
    let count = SuccessCount { episodes: 1000, successes: 1000 };
    let slow = |id| (id == option).then_some(SuccessEstimate { count, mean_time_s: 500.0 });
    let second = plan(&world, round(), settings, &slow).expect("the other way");
    assert!(second.iter().all(|o| o.id != option), "{} uses the slow {option}", names(&second));
    let settings = SearchSettings { cost_update: false, ..settings };
    let third = plan(&world, round(), settings, &slow).expect("the first way");
    assert_eq!(names(&third), names(&first), "without the update nothing flows back");
}

/// A corridor of 1.6 m with a corner, and regions on both sides of it.
const CORNER: &str = "
    ###############
    #.............#
    #.............#
    #..0..1.......#
    #.............#
    #########.....#
    #########.....#
    #########.....#
    #########..2..#
    #########.....#
    #########.....#
    ###############";

#[test]
fn a_turn_that_is_too_sharp_is_better_than_no_plan() {
    let world = world(CORNER, OptionKind::Centroid);
    let query = Query { start: Pose::new(1.2, 3.2, 0.0), goal: Pose::new(4.6, 1.2, 0.0) };
    for smooth_turn_rad in [75.0_f64.to_radians(), 0.01] {
        let settings = SearchSettings { smooth_turn_rad, ..SearchSettings::default() };
        assert!(
            plan(&world, query, settings, &unmeasured).is_some(),
            "no plan where turns of {smooth_turn_rad} rad are smooth"
        );
    }
}

/// A corridor of 2 m with a dead end off it, in which the region of the middle state lies.
const ALCOVE: &str = "
    ###########################
    ###########.....###########
    ###########.....###########
    ###########..1..###########
    ###########.....###########
    ###########.....###########
    #.........................#
    #.........................#
    #...0.................2...#
    #.........................#
    #.........................#
    ###########################";

#[test]
fn a_centroid_from_which_nobody_gets_on_is_passed_by() {
    let world = world(ALCOVE, OptionKind::Centroid);
    let query = Query { start: Pose::new(1.0, 1.4, 0.0), goal: Pose::new(9.8, 1.4, 0.0) };
    let names = |bypasses| {
        let price = PriceRule::Profile;
        let settings = SearchSettings { bypasses, price, ..SearchSettings::default() };
        names(&plan(&world, query, settings, &unmeasured).expect("a way"))
    };
    assert_eq!(names(true), "first:0 c:0-1-2 last:2");
    assert_eq!(names(false), "first:0 c:0-1 c:1-2 last:2", "the paper's options turn round in the dead end");
}

#[test]
fn guides_from_earlier_problems_are_kept() {
    let (world, abstraction) = world(HALL, OptionKind::Centroid);
    let spec = abstraction.options.options()[0];
    let ends = |id| abstraction.options.endpoint(id).center;
    let (from, to) = (ends(spec.initiation), ends(spec.termination));
    let known = straight((from.x, from.y), (to.x, to.y));
    let guides = [(LegId::Option(spec.id), known.clone())];
    let method = Method::fast();
    let search = Search::new(&world, &abstraction, &method, &NoiseModel::nominal(), along(), guides, Seed(1));
    let (_, options) = search.expect("both ends have a state").plan(&unmeasured, &()).expect("a way");
    let option = options.iter().find(|option| option.id == LegId::Option(spec.id)).expect("on the way");
    assert_eq!(option.guide, known, "planned again");
}

#[test]
fn sealed_rooms_have_no_plan_and_walls_have_no_state() {
    for kind in [OptionKind::Centroid, OptionKind::Interface] {
        let world = world(SEALED, kind);
        let through = Query { start: Pose::new(2.0, 1.4, 0.0), goal: Pose::new(6.0, 1.4, 0.0) };
        let none = plan(&world, through, SearchSettings::default(), &unmeasured);
        assert!(none.is_none(), "{kind:?}: through a wall");
        let outside = Pose::new(-5.0, 1.0, 0.0);
        let method = Method::fast();
        let placed = |query| {
            Search::new(&world.0, &world.1, &method, &NoiseModel::nominal(), query, [], Seed(1)).map(|_| ())
        };
        assert_eq!(placed(Query { start: outside, ..through }), Err(Unplaced::Start), "{kind:?}");
        assert_eq!(placed(Query { goal: outside, ..through }), Err(Unplaced::Goal), "{kind:?}");
    }
}

/// What `see` sees in a search for `query` as `settings` say, without sampled guides.
fn look<T>(
    (world, abstraction): &(World, Abstraction),
    (query, settings): (Query, SearchSettings),
    known: Vec<(LegId, GuidePath)>,
    see: impl FnOnce(&mut Search<'_>) -> T,
) -> T {
    let method = Method { search: settings, ..Method::fast().composed() };
    let search = Search::new(world, abstraction, &method, &NoiseModel::nominal(), query, known, Seed(1));
    see(&mut search.expect("both ends have a state"))
}

/// The world of `drawing` with centroid options and another robot.
fn with_robot(drawing: &str, robot: RobotModel) -> (World, Abstraction) {
    let (world, abstraction) = world(drawing, OptionKind::Centroid);
    (World::new((*world.grid).clone(), robot), abstraction)
}

/// The paper's prices: lengths at half of the top speed.
fn by_length() -> SearchSettings {
    SearchSettings { price: PriceRule::Length, ..SearchSettings::default() }
}

/// The option called `text`.
fn leg(text: &str) -> LegId {
    LegId::Option(text.parse().expect("the name of an option"))
}

/// A straight guide whose first pose looks `turn_rad` to the left of the way to the east.
fn turned(from: (f64, f64), to: (f64, f64), turn_rad: f64) -> GuidePath {
    let mut poses = straight(from, to).poses().to_vec();
    poses[0] = Pose::new(from.0, from.1, turn_rad);
    GuidePath::new(poses, 0.25).expect("short gaps")
}

/// Nose 5 cm before the wall of the [`HALL`], to the other end.
fn nose() -> Query {
    Query { start: Pose::new(9.05, 2.2, 0.0), goal: Pose::new(1.0, 2.2, 0.0) }
}

#[test]
fn a_robot_with_its_nose_at_a_wall_backs_off_first() {
    let world = world(HALL, OptionKind::Centroid);
    look(&world, (nose(), SearchSettings::default()), vec![], |search| {
        let (_, plan) = search.plan(&unmeasured, &()).expect("backwards is a way out");
        let Departure { back_off_m, careful_m } = plan[0].departure;
        assert!(back_off_m > 0.0 && careful_m == 0.0, "{}: {:?}", names(&plan), plan[0].departure);
        let begin = plan[0].guide.start().position;
        let behind = Point::new(9.05 - back_off_m, 2.2);
        assert!((begin - behind).norm() < 1e-6, "{back_off_m} m back the guide begins at {begin}");
        assert!(plan[1..].iter().all(|leg| leg.departure.is_none()), "only from the start: {plan:?}");
    });
    let settings = SearchSettings { departures: false, ..SearchSettings::default() };
    let none = look(&world, (nose(), settings), vec![], |search| search.plan(&unmeasured, &()));
    assert!(none.is_none(), "it cannot turn where it stands, and the paper's robot does not back off");
}

#[test]
fn a_guide_goes_on_where_the_way_out_of_the_start_ends() {
    let lead = [1.0, 1.2, 1.4].map(|x| Pose::new(x, 2.2, 0.0)).to_vec();
    let departure = Departure { back_off_m: 0.0, careful_m: 0.4 };
    look(&world(HALL, OptionKind::Centroid), (along(), by_length()), vec![], |search| {
        let candidate = search.graph.candidate(LegId::First(0)).expect("the leg to the own centroid");
        let option = search.departing(candidate, &(departure, lead.clone())).expect("an open hall");
        assert_eq!(option.departure, departure);
        assert_eq!(option.guide.poses()[..3], lead[..], "the way out comes first");
        let length_m = option.guide.length_m();
        assert!((length_m - 1.2).abs() < 0.05, "{length_m} m for 1.2 m: it drives some of it twice");
    });
}

/// A hall with a niche of 0.8 m by 0.8 m, in which the Husky cannot turn.
const NICHE: &str = "
    ###################
    #..............####
    #..............####
    #..0......1......##
    #................##
    #..............####
    #..............####
    ###################";

#[test]
fn in_a_hurry_those_ways_out_come_first_that_end_where_the_robot_can_turn() {
    let world = world(NICHE, OptionKind::Centroid);
    // Nose 5 cm before the end of the niche.
    let query = Query { start: Pose::new(6.25, 1.6, 0.0), goal: Pose::new(1.4, 1.6, 0.0) };
    let backs_dm = |is_hurried: bool| {
        look(&world, (query, SearchSettings::default()), vec![], |search| {
            search.is_hurried = is_hurried;
            let back_dm = |way: &(Departure, Vec<Pose>)| (10.0 * way.0.back_off_m).round() as u32;
            search.departures().iter().map(back_dm).collect::<Vec<_>>()
        })
    };
    assert_eq!(backs_dm(false), [1, 2, 3, 4, 6, 8, 10], "the shortest first");
    assert_eq!(backs_dm(true), [6, 8, 10, 1, 2, 3, 4], "out of the niche first");
}

#[test]
fn the_direct_way_leaves_the_start_as_the_leg_before_it_did() {
    let (world, abstraction) = world(HALL, OptionKind::Centroid);
    let conditions = Conditions::new(&world, NoiseModel::none());
    let method = Method::fast().composed();
    let search = Search::new(&world, &abstraction, &method, &NoiseModel::none(), nose(), [], Seed(1));
    let mut search = search.expect("both ends have a state").with_trials(&conditions, true);
    search.guide_all(&[LegId::First(2)]);
    let first = search.option(LegId::First(2)).expect("a way out").departure;
    let (well, badly) = (search.chosen.get().copied(), search.least_bad.get().map(|way| way.number));
    assert!(well.is_some() != badly.is_some(), "one of them is noted: {well:?}, {badly:?}");
    let number = well.or(badly).flatten().expect("it cannot drive at once");
    assert_eq!(first, search.departures()[number].0, "way {number} was noted");
    search.guide_all(&[LegId::Direct]);
    let direct = search.option(LegId::Direct).expect("from there the hall is open");
    assert_eq!(direct.departure, first, "the direct way leaves otherwise");
}

/// A corridor of 1.2 m with five regions in a row: no leg passes the third by.
const LINE: &str = "
    ###############################
    #.............................#
    #..0.....1.....2.....3.....4..#
    #.............................#
    ###############################";

#[test]
fn plans_cost_their_legs_and_their_hand_overs() {
    let world = world(LINE, OptionKind::Centroid);
    let query = Query { start: Pose::new(1.0, 1.0, 0.0), goal: Pose::new(11.4, 1.0, 0.0) };
    let settings = SearchSettings { bypasses: false, ..by_length() };
    let (before, after) = (leg("c:1-2"), leg("c:2-3"));
    // 10.4 m at 0.5 m/s and 5 s for each of six legs to learn; half a radian at 2 rad/s; 120 s where the robot has no
    // room to turn.
    for (turn_rad, wanted_s) in [(0.0, 50.8), (0.5, 51.05), (2.0, 170.8)] {
        let second = turned((6.2, 1.0), (8.6, 1.0), turn_rad);
        let known = vec![(before, straight((3.8, 1.0), (6.2, 1.0))), (after, second)];
        look(&world, (query, settings), known, |search| {
            let (cost_s, ids) = search.cheapest(&unmeasured, HARD_HAND_OVER_S).expect("the only way");
            assert!((cost_s - wanted_s).abs() < 1e-3, "a turn of {turn_rad} rad: {cost_s} s, {ids:?}");
            assert_eq!(search.can_follow(before, after), turn_rad < 1.0, "after {turn_rad} rad");
            assert!(search.can_follow(leg("c:0-1"), before), "one of them has no guide yet");
            assert!(!search.can_follow(before, leg("c:0-4")), "there is no such option");
            let priced_s = search.priced_s(before).expect("it has a guide");
            assert!((priced_s - 4.8).abs() < 1e-6, "2.4 m at 0.5 m/s, and nothing else: {priced_s} s");
            assert_eq!(search.priced_s(leg("c:0-1")), None, "no guide, no price");
            search.charge(before, after, 7.0);
            let (charged_s, _) = search.cheapest(&unmeasured, HARD_HAND_OVER_S).expect("the only way");
            assert!((charged_s - cost_s - 7.0).abs() < 1e-6, "{cost_s} s became {charged_s} s");
        });
    }
}

#[test]
fn a_turn_beyond_the_smooth_takes_a_stop_or_a_loop_and_room() {
    let hand_over_s = |robot: RobotModel, turn_rad: f64| {
        let second = turned((5.0, 2.2), (7.8, 2.2), turn_rad);
        let known = vec![(leg("c:0-1"), straight((2.2, 2.2), (5.0, 2.2))), (leg("c:1-2"), second)];
        look(&with_robot(HALL, robot), (along(), by_length()), known, |search| {
            let [before, after] =
                ["c:0-1", "c:1-2"].map(|text| search.graph.candidate(leg(text)).expect("an option"));
            search.hand_over_s(before, after)
        })
    };
    let slow_car = || RobotModel { max_speed_mps: 0.8, ..RobotModel::limo() };
    for (robot, turn_rad, wanted_s, what) in [
        (RobotModel::husky(), -1.0, 0.5, "a radian to the right at 2 rad/s"),
        (RobotModel::husky(), 2.0, 3.0, "and 2 s to stop"),
        (slow_car(), 2.0, 0.8, "up to 120 degrees at 2.5 rad/s"),
        (slow_car(), 2.5, 9.2832, "and 2 s and a circle of 0.4 m at 0.4 m/s"),
    ] {
        let lost_s = hand_over_s(robot, turn_rad);
        assert!((lost_s - wanted_s).abs() < 1e-3, "{what}: {turn_rad} rad take {lost_s} s");
    }
    let smooth_rad = |robot: RobotModel, clearance_m: f64| {
        let world = with_robot(HALL, robot);
        look(&world, (along(), by_length()), vec![], |search| search.smooth_turn_rad(clearance_m))
    };
    // The Limo is 0.11 m wide to each side and turns on 0.4 m: 2 atan(0.3 / 0.4).
    for (clearance_m, wanted_rad) in [(0.05, 0.0), (0.41, 1.2870), (9.9, CAR_TURN_MAX_RAD)] {
        let turn_rad = smooth_rad(RobotModel::limo(), clearance_m);
        assert!((turn_rad - wanted_rad).abs() < 1e-3, "{turn_rad} rad with {clearance_m} m of room");
    }
    assert_eq!(smooth_rad(RobotModel::husky(), 0.05), by_length().smooth_turn_rad, "it turns in place");
}

#[test]
fn a_leg_without_a_guide_costs_its_straight_length_and_what_its_kind_costs() {
    let world = with_robot(HALL, RobotModel { max_speed_mps: 0.8, ..RobotModel::husky() });
    let count = SuccessCount { episodes: 100, successes: 100 };
    let driven = Some(SuccessEstimate { count, mean_time_s: 0.1 });
    let length = by_length();
    let model = SearchSettings { unguided_speed: 0.7, ..SearchSettings::default() };
    let forgetful = SearchSettings { cost_update: false, ..length };
    let whole = SearchSettings { bypasses: false, ..length };
    for (settings, id, measured, wanted_s, what) in [
        (length, leg("c:0-1"), None, 12.0, "2.8 m at 0.4 m/s, and 5 s to learn it"),
        (length, leg("c:0-1"), driven, 7.0, "what was learnt needs no learning"),
        (forgetful, leg("c:0-1"), driven, 12.0, "without the update nothing flows back"),
        (model, leg("c:0-1"), None, 10.0, "at 0.56 m/s"),
        (length, LegId::First(0), None, 8.0, "1.2 m"),
        (length, LegId::First(1), None, 29.0, "4 m, and 14 s because it passes a centroid"),
        (length, leg("c:0-1-2"), None, 33.0, "5.6 m, past a centroid as well"),
        (whole, leg("c:0-1-2"), None, f64::INFINITY, "the paper has none of these"),
        (whole, LegId::First(1), None, 29.0, "which is no option"),
        (length, LegId::Direct, None, f64::INFINITY, "nobody offered it"),
    ] {
        let cost_s = look(&world, (along(), settings), vec![], |search| {
            search.cost_s(search.graph.candidate(id).expect("a leg"), measured)
        });
        let is_right = cost_s == wanted_s || (cost_s - wanted_s).abs() < 1e-6;
        assert!(is_right, "{id}: {cost_s} s, not {wanted_s} s: {what}");
    }
    let known = vec![(leg("c:1-2"), straight((5.0, 2.2), (7.8, 2.2)))];
    look(&world, (along(), length), known, |search| {
        let candidate = search.graph.candidate(leg("c:1-2")).expect("an option");
        let cost_s = search.cost_s(candidate, driven);
        assert!((cost_s - 3.5).abs() < 1e-6, "{cost_s} s: nobody is faster than the top speed");
    });
}

fn way(search: &mut Search<'_>) -> String {
    names(&search.plan(&unmeasured, &()).expect("a way").1)
}

#[test]
fn the_direct_way_is_taken_only_after_it_was_offered() {
    let world = world(HALL, OptionKind::Centroid);
    let query = Query { start: Pose::new(1.6, 2.2, 0.0), ..along() };
    look(&world, (query, by_length()), vec![], |search| {
        assert_eq!(way(search), "first:0 c:0-1 c:1-2 last:2");
        assert!(search.offer_direct(), "it is new");
        assert_eq!(way(search), "first:goal", "nothing is left to learn, and it is as short");
        assert!(!search.offer_direct(), "it is on offer already");
    });
    let settings = SearchSettings { direct: false, ..by_length() };
    look(&world, (query, settings), vec![], |search| {
        assert!(!search.offer_direct(), "the method has none");
        assert_eq!(way(search), "first:0 c:0-1 c:1-2 last:2");
    });
}

#[test]
fn a_robot_in_its_goal_has_arrived_unless_it_has_to_come_round() {
    let goal = Pose::new(3.7, 2.2, 0.0);
    let is_there = |robot: RobotModel, start: Pose, goal_heading_tolerance_rad: Option<f64>| {
        let settings = SearchSettings { goal_heading_tolerance_rad, ..by_length() };
        look(&with_robot(HALL, robot), (Query { start, goal }, settings), vec![], |search| search.is_there())
    };
    // In the state before the goal's, 0.2 m from it.
    let (near, askew) = (Pose::new(3.5, 2.2, 0.1), Pose::new(3.5, 2.2, 1.0));
    assert!(is_there(RobotModel::limo(), near, Some(0.3)), "well enough");
    assert!(is_there(RobotModel::limo(), askew, None), "any heading will do");
    assert!(!is_there(RobotModel::limo(), askew, Some(0.3)), "a car cannot turn where it stands");
    assert!(is_there(RobotModel::husky(), askew, Some(0.3)), "the Husky can");
    assert!(!is_there(RobotModel::husky(), Pose::new(1.0, 2.2, 0.0), Some(0.3)), "2.7 m away");
    let query = Query { start: Pose::new(3.5, 2.2, 0.0), goal };
    look(&world(HALL, OptionKind::Centroid), (query, by_length()), vec![], |search| {
        let (_, plan) = search.plan(&unmeasured, &()).expect("it is there");
        assert_eq!(names(&plan), "first:goal");
        let length_m = plan[0].guide.length_m();
        assert!((length_m - 0.125).abs() < 1e-9, "half of a guide's spacing, not {length_m} m");
        search.guide_all(&[LegId::First(0)]);
        let other = search.option(LegId::First(0)).expect("an open hall");
        assert!(other.guide.length_m() > 1.0, "the other legs lead somewhere: {} m", other.guide.length_m());
    });
}

#[test]
fn a_car_arrives_in_the_direction_that_is_asked_for_and_at_the_goal_only() {
    let guide = straight((3.0, 2.0), (7.0, 2.0));
    let end_rad = |robot: RobotModel, tolerance: Option<f64>, goal_rad: f64, id: LegId| {
        let settings = SearchSettings { goal_heading_tolerance_rad: tolerance, ..SearchSettings::default() };
        let query = Query { goal: Pose::new(7.0, 2.0, goal_rad), ..along() };
        look(&with_robot(HALL, robot), (query, settings), vec![], |search| {
            search.arriving(id, guide.clone()).end().heading.radians()
        })
    };
    let (car, last) = (RobotModel::limo, LegId::Last(1, StateId(1)));
    for (robot, tolerance, goal_rad, id, wanted_rad, what) in [
        (car(), Some(0.3), 1.5, LegId::Direct, 1.5, "a curve leads there"),
        (car(), Some(0.3), 1.5, last, 1.5, "the last leg too"),
        (car(), Some(0.3), 1.5, LegId::First(0), 0.0, "this leg ends elsewhere"),
        (car(), Some(0.3), 0.2, LegId::Direct, 0.0, "well enough as it is"),
        (car(), None, 1.5, LegId::Direct, 0.0, "nobody asked"),
        (RobotModel::husky(), Some(0.3), 1.5, LegId::Direct, 0.0, "it turns at the goal"),
    ] {
        let name = robot.name.clone();
        let found_rad = end_rad(robot, tolerance, goal_rad, id);
        assert!((found_rad - wanted_rad).abs() < 1e-4, "{name}, {id}: {found_rad} rad: {what}");
    }
}

#[test]
fn a_place_without_a_state_belongs_to_the_nearest_state_nearby() {
    // Rooms of 0.3 m in the corner, to the right of it and above it, with 0.8 m of wall between.
    let frame = GridFrame { origin: Pose::new(0.0, 0.0, 0.0), resolution_m: 0.1, width: 16, height: 16 };
    let low = |at: usize| (1..4).contains(&at);
    let high = |at: usize| (12..15).contains(&at);
    let is_free = |Cell { col, row }: Cell| (low(row) && (low(col) || high(col))) || (high(row) && low(col));
    let field = DistanceField::from_mask(frame, |index| !is_free(frame.cell(index)));
    let region = |(id, (col, row)): (u32, (usize, usize))| {
        Region::new(RegionId(id), vec![Cell::new(col, row)], &field).expect("one cell")
    };
    let regions: Vec<Region> = (0..).zip([(2, 2), (13, 2), (2, 13)]).map(region).collect();
    let states = Rbvd::build(&field, &regions, &RbvdSettings::default()).expect("three rooms");
    let state = |x: f64, y: f64| state_near(&states, Point::new(x, y)).map(|state| state.0);
    assert_eq!([state(0.75, 0.25), state(0.25, 0.75)], [Some(0), Some(0)], "0.40 m, the others 0.50 m");
    assert_eq!(state(0.85, 0.25), Some(1), "to the right it is 0.40 m, to the left 0.50 m");
    assert_eq!(state(0.25, 0.85), Some(2), "up it is 0.40 m, down 0.50 m");
    assert_eq!([state(1.55, 0.25), state(0.25, 1.55)], [Some(1), Some(2)], "at the borders of the map");
    assert_eq!(state(1.45, 1.45), None, "a metre of wall all round");
}

/// Two rooms with a door of 0.4 m; the Husky is 0.67 m wide.
const SLIT: &str = "
    #####################
    #.........#.........#
    #.........#.........#
    #....0.........1....#
    #.........#.........#
    #.........#.........#
    #####################";

#[test]
fn an_option_without_a_guide_is_named_and_no_plan_uses_it() {
    let world = world(SLIT, OptionKind::Centroid);
    let query = Query { start: Pose::new(1.4, 1.4, 0.0), goal: Pose::new(7.0, 1.4, 0.0) };
    look(&world, (query, SearchSettings::default()), vec![], |search| {
        assert!(search.plan(&unmeasured, &()).is_none(), "through a door that is too narrow");
        let unguided: Vec<LegId> = search.unguided().map(|(id, _)| id).collect();
        assert!(unguided.contains(&leg("c:0-1")), "{unguided:?} does not name the option through the door");
        assert!(!unguided.contains(&LegId::First(0)), "{unguided:?}: the own centroid can be reached");
        let through = search.graph.candidate(leg("c:0-1")).expect("an option");
        assert_eq!(search.cost_s(through, None), f64::INFINITY, "it has lost its edge");
    });
}

/// A planner that counts how often it is asked, and what it does in haste.
#[derive(Debug)]
struct Thorough {
    asked: Arc<AtomicUsize>,
    finds_in_haste: bool,
}

impl GuidePlanner for Thorough {
    fn plan(
        &self,
        request: &GuideRequest<'_>,
        robot: &GuideRobot<'_>,
        rng: &mut Stream,
    ) -> Result<GuidePath, NoGuide> {
        self.asked.fetch_add(1, Ordering::Relaxed);
        ClearanceSearch::default().plan(request, robot, rng)
    }

    fn hasty(&self) -> Option<Box<dyn GuidePlanner>> {
        Some(if self.finds_in_haste { Box::new(ClearanceSearch::default()) } else { Box::new(Never) })
    }
}

#[derive(Debug)]
struct Never;

impl GuidePlanner for Never {
    fn plan(&self, _: &GuideRequest<'_>, _: &GuideRobot<'_>, _: &mut Stream) -> Result<GuidePath, NoGuide> {
        Err(NoGuide::Unreachable)
    }
}

#[test]
fn a_planner_that_takes_its_time_is_asked_only_where_there_is_no_plan_without_it() {
    let (world, abstraction) = world(LINE, OptionKind::Centroid);
    let query = Query { start: Pose::new(1.0, 1.0, 0.0), goal: Pose::new(11.4, 1.0, 0.0) };
    let plan = |finds_in_haste| {
        let asked = Arc::new(AtomicUsize::new(0));
        let planner = Arc::new(Thorough { asked: Arc::clone(&asked), finds_in_haste });
        let method = Method::fast().with_guide_planner(planner);
        let search = Search::new(&world, &abstraction, &method, &NoiseModel::nominal(), query, [], Seed(1));
        let plan = search.expect("both ends have a state").plan(&unmeasured, &());
        (names(&plan.expect("there is a way").1), asked.load(Ordering::Relaxed))
    };
    let ((in_haste, never), (in_the_end, often)) = (plan(true), plan(false));
    assert_eq!(in_haste, in_the_end, "the same plan");
    assert_eq!(never, 0, "what was found in haste is good enough");
    assert!(often > 0, "what was not found in haste is looked for again");
}

#[test]
fn a_robot_that_has_arrived_before_it_begins_is_not_led_into_a_wall() {
    let (world, abstraction) = world(HALL, OptionKind::Centroid);
    // The nose of the Husky, half a metre ahead, touches the wall almost.
    let start = Pose::new(9.05, 2.2, 0.0);
    assert!(
        world.geometry.is_free(start) && !world.geometry.is_free(Pose::new(9.175, 2.2, 0.0)),
        "a tight place"
    );
    let query = Query { start, goal: Pose::new(9.0, 2.2, 0.0) };
    let method = Method::fast();
    let search = Search::new(&world, &abstraction, &method, &NoiseModel::nominal(), query, [], Seed(1));
    let plan = search.expect("both ends have a state").plan(&unmeasured, &()).expect("nothing to do").1;
    assert_eq!(names(&plan), "first:goal");
    for pose in plan[0].guide.poses() {
        assert!(world.geometry.is_free(*pose), "{pose:?} is not free");
    }
}
