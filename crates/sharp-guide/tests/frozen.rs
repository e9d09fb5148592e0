//! Guides are what they were: to the bit, for two robots on floor plans of every kind.
//!
//! The other tests say what a guide must fulfil. A wrong sign in the smoothing may still pass them. Here it shows, and by
//! how much.
//! After an intended change `UPDATE_EXPECT=1 cargo test --release -p sharp-guide --test frozen` writes the new lines.

mod worlds;

use std::fmt::Write;
use std::sync::Arc;

use expect_test::expect_file;
use rand::RngExt;
use sharp_guide::{
    ClearanceSearch, Goal, GuideEnd, GuidePath, GuidePlanner, GuideRequest, GuideRobot, GuideSettings,
    LearnAndLink, NoGuide, Steering, arriving, crossing_heading, departures, gap_m, inflated_robots,
    is_tight, join_guides, ridge_routes, routes,
};
use sharp_maps::{FloorplanKind, generate};
use sharp_options::{Endpoint, OptionKind};
use sharp_space::{
    Cell, Footprint, FootprintChecker, Heading, OccupancyGrid, Point, Pose, RobotGeometry, Seed, Stream,
    Vector,
};
use worlds::{Drawn, HALL, Problem, RING, along};

/// Two rooms whose walls run aslant, so that no way between them is straight.
const SLANTED: &str = "
    #########################
    #......##...............#
    #.......##..............#
    #........##.............#
    #..0......##............#
    #..........#............#
    #......................1#
    #.......................#
    #......##...............#
    #.....####.....2........#
    #....######.............#
    #########################";

/// FNV-1a over the bits of `numbers`.
fn hash(numbers: impl IntoIterator<Item = f64>) -> u64 {
    let bytes = numbers.into_iter().flat_map(f64::to_le_bytes);
    bytes.fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

fn numbers(poses: &[Pose]) -> impl Iterator<Item = f64> {
    poses.iter().flat_map(|pose| [pose.position.x, pose.position.y, pose.heading.radians()])
}

/// A guide in a few words: how long it is, and the hash of all its poses.
fn told(guide: &GuidePath) -> String {
    format!("{:.3} m {:016x}", guide.length_m(), hash(numbers(guide.poses())))
}

fn told_or_not(guide: &Result<GuidePath, NoGuide>) -> String {
    guide.as_ref().map_or_else(|reason| format!("none: {reason}"), told)
}

/// A robot that turns in place and a car, on one map, with their turning radii in metres.
fn robots(grid: &OccupancyGrid) -> [(&'static str, Arc<dyn RobotGeometry>, f64); 2] {
    [("husky", 0.5, 0.335, 0.0), ("limo", 0.16, 0.11, 0.4)].map(
        |(name, half_length_m, half_width_m, radius_m)| {
            let outline = Footprint::rectangle(half_length_m, half_width_m).expect("a sound outline");
            (name, Arc::new(FootprintChecker::new(grid, outline)) as Arc<dyn RobotGeometry>, radius_m)
        },
    )
}

/// A place in which the robot fits at a random heading.
fn pose(geometry: &dyn RobotGeometry, rng: &mut Stream) -> Pose {
    let frame = *geometry.clearance().frame();
    loop {
        let cell: Cell = frame.cell(rng.random_range(0..frame.len()));
        let heading = Heading::new(rng.random_range(-3.1..3.1));
        let pose = Pose::at(frame.center(cell), heading);
        if geometry.is_free(pose) {
            return pose;
        }
    }
}

#[test]
fn guides_on_floor_plans() {
    let mut lines = String::new();
    for (number, kind) in FloorplanKind::ALL.into_iter().enumerate() {
        let grid = generate(kind, 15.0, 0.067, &mut Seed(9).stream("map", number as u64));
        for (name, geometry, radius_m) in robots(&grid) {
            let inflated = inflated_robots(&geometry, radius_m);
            let robot =
                GuideRobot { geometry: &*geometry, steering: Steering::of(radius_m), inflated: &inflated };
            let mut rng = Seed(3).stream(name, number as u64);
            for ask in 0..5 {
                let (start, goal) = (pose(&*geometry, &mut rng), pose(&*geometry, &mut rng));
                let heading = |pose: &Pose, bit: u32| (ask & bit != 0).then_some(pose.heading);
                let request = GuideRequest {
                    start: GuideEnd { position: start.position, heading: heading(&start, 1) },
                    goal: GuideEnd { position: goal.position, heading: heading(&goal, 2) },
                    // A strip without meaning, but it must be respected.
                    allowed: &|cell: Cell| cell.col > 8,
                };
                let settings = GuideSettings { margins: ask != 4, ..GuideSettings::default() }.unsampled();
                let guide =
                    ClearanceSearch { settings }.plan(&request, &robot, &mut Seed(1).stream("guide", 0));
                writeln!(lines, "{kind:?} {name} {ask}: {}", told_or_not(&guide)).expect("a string");
                let Ok(guide) = guide else { continue };
                if radius_m > 0.0 {
                    let arrived = arriving(&robot, &guide, goal.heading);
                    let arrived = arrived.as_ref().map_or_else(|| "none".to_owned(), told);
                    writeln!(lines, "  arriving as asked: {arrived}").expect("a string");
                }
            }
        }
    }
    expect_file!["frozen/guides.txt"].assert_eq(&lines);
}

#[test]
fn routes_and_samples() {
    let mut lines = String::new();
    let grid = generate(FloorplanKind::Gap, 15.0, 0.067, &mut Seed(4).stream("map", 0));
    for (name, geometry, radius_m) in robots(&grid) {
        let inflated = inflated_robots(&geometry, radius_m);
        let robot =
            GuideRobot { geometry: &*geometry, steering: Steering::of(radius_m), inflated: &inflated };
        let mut rng = Seed(5).stream(name, 0);
        for ask in 0..3 {
            let (start, goal) = (pose(&*geometry, &mut rng), pose(&*geometry, &mut rng));
            for route in ridge_routes(&robot, start, (goal.position, Some(goal.heading))) {
                writeln!(lines, "{name} {ask} along the ridge: {}", told_or_not(&route)).expect("a string");
            }
            if let Some(route) = routes(&robot, start, (goal.position, 0.2), 20_000).next() {
                writeln!(lines, "{name} {ask} by any means: {}", told(&route)).expect("a string");
            }
            let request = GuideRequest {
                start: GuideEnd { position: start.position, heading: None },
                goal: GuideEnd { position: goal.position, heading: None },
                allowed: &|_| true,
            };
            let sampled = LearnAndLink::default().plan(&request, &robot, &mut Seed(5).stream("samples", ask));
            writeln!(lines, "{name} {ask} by samples: {}", told_or_not(&sampled)).expect("a string");
        }
    }
    expect_file!["frozen/routes.txt"].assert_eq(&lines);
}

#[test]
fn ways_out_of_tight_places_and_gaps() {
    let mut lines = String::new();
    let grid = generate(FloorplanKind::Rooms, 15.0, 0.067, &mut Seed(9).stream("map", 0));
    for (name, geometry, radius_m) in robots(&grid) {
        let robot = GuideRobot::new(&*geometry, Steering::of(radius_m));
        let mut rng = Seed(6).stream(name, 0);
        for _ in 0..12 {
            let start = pose(&*geometry, &mut rng);
            let is_tight = is_tight(&robot, start);
            let across = (0..8).map(|turn| std::f64::consts::PI * f64::from(turn) / 8.0);
            let gap_m = gap_m(geometry.clearance(), start.position, across);
            write!(lines, "{name} tight: {is_tight}, gap {gap_m:.4} m, ways").expect("a string");
            for (departure, lead) in departures(&robot, start, 0.4) {
                let (back_m, careful_m) = (departure.back_off_m, departure.careful_m);
                write!(lines, " {back_m:.2}+{careful_m:.2} {:x}", hash(numbers(&lead)) >> 48)
                    .expect("a string");
            }
            lines.push('\n');
        }
    }
    expect_file!["frozen/departures.txt"].assert_eq(&lines);
}

#[test]
fn guides_of_options_alone_and_joined() {
    let around = Problem { start: Pose::new(1.4, 1.2, 0.0), goal: Point::new(8.6, 4.8) };
    let mut lines = String::new();
    for (drawing, problem, kind, plan) in [
        (HALL, along(), OptionKind::Centroid, &["first:0", "c:0-1", "c:1-2", "last:2"][..]),
        (HALL, along(), OptionKind::Interface, &["first:0", "i:0-1-2", "last:1"]),
        (RING, around, OptionKind::Centroid, &["first:2", "c:2-3", "c:3-1", "last:1"]),
        (RING, around, OptionKind::Interface, &["first:3", "i:2-3-1", "last:2"]),
    ] {
        let drawn = Drawn::new(drawing, kind);
        let alone = drawn.plan(plan, problem);
        let joined = join_guides(alone.clone(), problem.start, &drawn.robot(), &GuideSettings::default());
        for (alone, joined) in alone.iter().zip(&joined) {
            let corridor = joined.corridor(&drawn.grid);
            let bytes = hash(corridor.iter().map(|&byte| f64::from(byte)));
            let (alone_m, joined_m) = (told(&alone.guide), told(&joined.guide));
            writeln!(lines, "{}: {alone_m}, joined {joined_m}", alone.id).expect("a string");
            writeln!(lines, "  corridor of {} bytes {bytes:016x}", corridor.len()).expect("a string");
        }
    }
    expect_file!["frozen/options.txt"].assert_eq(&lines);
}

#[test]
fn crossings_and_ends_of_goals() {
    let mut lines = String::new();
    for (name, drawing) in [("slanted", SLANTED), ("ring", RING)] {
        let drawn = Drawn::new(drawing, OptionKind::Interface);
        let (geometry, options) = (drawn.robot().geometry, &drawn.space.options);
        for (number, endpoint) in options.endpoints().iter().enumerate() {
            for (&into, askew_rad) in
                endpoint.states.iter().flat_map(|into| [0.0, 0.3, -0.3].map(|rad| (into, rad)))
            {
                // A border that lies askew is crossed along the corridor all the same.
                let normal = endpoint.normal.map(|normal| Heading::new(normal.radians() + askew_rad));
                let askew = Endpoint { normal, ..endpoint.clone() };
                let heading = crossing_heading(geometry, &askew, into).map(Heading::radians);
                writeln!(lines, "{name} {number} into {}, {askew_rad}: {heading:.6?}", into.0)
                    .expect("a string");
            }
        }
        let field = geometry.clearance();
        let cells = (0..field.frame().len()).map(|index| field.frame().cell(index));
        // Beside a wall, so that there are easier places near by.
        for cell in cells.filter(|&cell| (0.1..0.5).contains(&field.at(cell))).step_by(5) {
            let place = field.frame().center(cell) + Vector::new(0.07, -0.04);
            let goal = Goal::new(place, 0.4, geometry.clearance());
            let end = goal.easiest_end(geometry.clearance(), 0.335);
            writeln!(lines, "{name} goal {place:.3}: guides end at {end:.3}").expect("a string");
        }
    }
    expect_file!["frozen/crossings.txt"].assert_eq(&lines);
}
