//! Guides on generated floor plans: Definition 8 as a property, and how often there is a guide.

use rand::RngExt;
use sharp_guide::{
    ClearanceSearch, GuideEnd, GuidePath, GuidePlanner, GuideRequest, GuideRobot, LearnAndLink, NoGuide,
    Steering,
};
use sharp_maps::{FloorplanKind, generate};
use sharp_space::{
    Cell, CollisionChecker, Footprint, FootprintChecker, GridFrame, Heading, Point, Pose, Seed,
};

struct Robot {
    name: &'static str,
    footprint: Footprint,
    steering: Steering,
}

fn robots() -> [Robot; 2] {
    let rectangle = |l, w| Footprint::rectangle(l, w).expect("sound");
    [
        Robot { name: "husky", footprint: rectangle(0.5, 0.335), steering: Steering::RotateTranslate },
        Robot {
            name: "limo",
            footprint: rectangle(0.16, 0.11),
            steering: Steering::Dubins { radius_m: 0.4 },
        },
    ]
}

/// Ends as an abstraction would give them: roomy places, 3 to 9 m apart, joined by open cells.
fn pairs(checker: &FootprintChecker, seed: u64) -> Vec<(Point, Point)> {
    let field = checker.field();
    let frame = field.frame();
    let least_m = checker.footprint().inscribed_radius_m() + 0.12;
    let mut rng = Seed(seed).stream("pairs", 0);
    let mut roomy = || loop {
        let cell = frame.cell(rng.random_range(0..frame.len()));
        if field.at(cell) > least_m {
            return frame.center(cell);
        }
    };
    let drawn: Vec<(Point, Point)> = (0..200).map(|_| (roomy(), roomy())).collect();
    drawn.into_iter().filter(|(a, b)| (3.0..9.0).contains(&(a - b).norm())).take(12).collect()
}

/// Everything that Definition 8 and the certificate promise.
fn check_guide(guide: &GuidePath, request: &GuideRequest<'_>, checker: &FootprintChecker, robot: &Robot) {
    let frame: &GridFrame = checker.field().frame();
    let (first, last) = (guide.start().position, guide.end().position);
    assert!((first - request.start.position).norm() < 1e-9, "p_1 is {first}");
    assert!((last - request.goal.position).norm() < 1e-9, "p_n is {last}");
    for pair in guide.poses().windows(2) {
        assert!(pair[0].distance_m(&pair[1]) < guide.spacing_m(), "gap at {:?}", pair[0]);
        let turn = pair[0].heading.turn_to(pair[1].heading).abs();
        let bend = robot.steering.radius_m() * turn / pair[0].distance_m(&pair[1]);
        assert!(bend <= 1.1 + 1e-9, "{} cannot drive the bend at {:?}", robot.name, pair[0]);
    }
    for pose in &guide.poses()[1..guide.poses().len() - 1] {
        let cell = frame.cell_at(pose.position).expect("inside the map");
        assert!((request.allowed)(cell), "{pose:?} is astray");
    }
    for i in 0..=(guide.length_m() / 0.05).ceil() as usize {
        let pose = guide.pose_at(f64::from(i as u32) * 0.05);
        assert!(checker.is_free(pose), "{} touches a wall at {pose:?}", robot.name);
    }
}

/// Plans all pairs on one map of each kind; returns how many were asked for and the failures.
fn plan_everywhere(robot: &Robot, planner: &dyn GuidePlanner) -> (usize, Vec<(FloorplanKind, NoGuide)>) {
    let (mut asked, mut failures) = (0, Vec::new());
    for (number, kind) in FloorplanKind::ALL.into_iter().enumerate() {
        let grid = generate(kind, 15.0, 0.067, &mut Seed(9).stream("map", number as u64));
        let checker = FootprintChecker::new(&grid, robot.footprint);
        for (start, goal) in pairs(&checker, number as u64) {
            let end = |position| GuideEnd { position, heading: None };
            // A strip without meaning, but it must be respected.
            let allowed = |cell: Cell| cell.col > 8;
            let request = GuideRequest { start: end(start), goal: end(goal), allowed: &allowed };
            let mut rng = Seed(1).stream("guide", 0);
            match planner.plan(&request, &GuideRobot::new(&checker, robot.steering), &mut rng) {
                Ok(guide) => {
                    check_guide(&guide, &request, &checker, robot);
                    asked += 1;
                }
                // Two places in different rooms without a door for this robot.
                Err(NoGuide::Unreachable | NoGuide::Start(_) | NoGuide::Goal(_)) => {}
                Err(reason) => {
                    asked += 1;
                    failures.push((kind, reason));
                }
            }
        }
    }
    (asked, failures)
}

#[test]
fn clearance_guides_fulfil_definition_8_nearly_everywhere() {
    for robot in robots() {
        let (asked, failures) = plan_everywhere(&robot, &ClearanceSearch::default());
        println!("{}: {} of {asked} failed: {failures:?}", robot.name, failures.len());
        assert!(asked > 100, "only {asked} queries make sense");
        assert!(failures.len() * 20 < asked, "{}: {asked} asked, failed: {failures:?}", robot.name);
    }
}

#[test]
fn equal_seeds_give_equal_guides() {
    let robot = &robots()[0];
    let grid = generate(FloorplanKind::Rooms, 15.0, 0.067, &mut Seed(2).stream("map", 0));
    let checker = FootprintChecker::new(&grid, robot.footprint);
    let planners: [&dyn GuidePlanner; 2] = [&ClearanceSearch::default(), &LearnAndLink::default()];
    for planner in planners {
        for (start, goal) in pairs(&checker, 3).into_iter().take(4) {
            let end = |position| GuideEnd { position, heading: None };
            let request = GuideRequest { start: end(start), goal: end(goal), allowed: &|_| true };
            let plan = || {
                let mut rng = Seed(1).stream("guide", 0);
                planner.plan(&request, &GuideRobot::new(&checker, robot.steering), &mut rng)
            };
            assert_eq!(plan(), plan(), "{planner:?} from {start} to {goal}");
        }
    }
}

#[test]
fn robots_that_look_elsewhere_are_led_onto_the_path() {
    for robot in robots() {
        let grid = generate(FloorplanKind::Gap, 15.0, 0.067, &mut Seed(4).stream("map", 0));
        let checker = FootprintChecker::new(&grid, robot.footprint);
        let (mut planned, mut asked) = (0, 0);
        for (start, goal) in pairs(&checker, 5) {
            for turn in [-3.0, -1.5, 0.0, 1.5] {
                let heading = Heading::new(turn);
                if !checker.is_free(Pose::at(start, heading)) {
                    continue;
                }
                asked += 1;
                let start = GuideEnd { position: start, heading: Some(heading) };
                let goal = GuideEnd { position: goal, heading: None };
                let request = GuideRequest { start, goal, allowed: &|_| true };
                let mut rng = Seed(1).stream("guide", 0);
                let guide_robot = GuideRobot::new(&checker, robot.steering);
                let plan = ClearanceSearch::default().plan(&request, &guide_robot, &mut rng);
                let Ok(guide) = plan else { continue };
                check_guide(&guide, &request, &checker, &robot);
                planned += 1;
                let off = guide.start().heading.turn_to(heading).abs();
                assert!(
                    robot.steering == Steering::RotateTranslate || off < 0.55,
                    "{} off by {off}",
                    robot.name
                );
            }
        }
        assert!(planned * 10 >= asked * 9, "{}: {planned} of {asked}", robot.name);
    }
}
