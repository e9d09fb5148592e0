//! Our planners and samplers keep the promises of the traits; and what more our planners promise, checked for
//! each algorithm with each steering.

use sharp_motion::conformance::{PlannerViolation, SamplerViolation, check_motion_planner, check_sampler};
use sharp_motion::{
    Algorithm, Budget, FromCells, Mixture, MotionPlanner, MotionQuery, Path, PathOutcome, RrtSettings,
    Sampler, SamplingPlanner, ShortcutSettings, Steering, Uniform, shortcut,
};
use sharp_space::{Cell, CollisionChecker, Footprint, FootprintChecker, OccupancyGrid, Pose, Seed, Stream};

const ROOMS: &str = "
    ################################
    #..............##..............#
    #..............##..............#
    #..............................#
    #..............................#
    #..............##..............#
    #..............##..............#
    #..............##..............#
    ######..##############..########
    ######..##############..########
    #..............##..............#
    #..............##..............#
    #..............##..............#
    #..............##..............#
    #..............##..............#
    ################################";

struct PlannerCase {
    planner: SamplingPlanner,
    checker: FootprintChecker,
    query: MotionQuery,
}

/// Calls `check` for each planner with a query from the lower left to the lower right room.
fn for_each_planner(check: impl Fn(&PlannerCase)) {
    let grid = OccupancyGrid::from_ascii(0.5, ROOMS).expect("a sound drawing");
    let seeds = [(3.5, 3.5, 1.57), (8.0, 6.0, 0.0), (11.5, 3.5, -1.57)].map(|(x, y, h)| Pose::new(x, y, h));
    let algorithms =
        [Algorithm::Rrt, Algorithm::RrtConnect, Algorithm::LearnAndLink { seeds: seeds.to_vec() }];
    for algorithm in algorithms {
        for steering in [Steering::RotateTranslate, Steering::Dubins { radius_m: 0.4 }] {
            check(&PlannerCase {
                planner: SamplingPlanner {
                    algorithm: algorithm.clone(),
                    steering,
                    bounds: grid.frame().bounds(),
                    settings: RrtSettings::default(),
                },
                checker: FootprintChecker::new(&grid, Footprint::rectangle(0.25, 0.15).expect("sound")),
                query: MotionQuery { start: Pose::new(2.0, 1.5, 0.3), goal: Pose::new(14.0, 1.5, -2.0) },
            });
        }
    }
}

impl PlannerCase {
    fn plan(&self, seed: u64) -> PathOutcome {
        self.planner.plan(&self.query, &self.checker, &mut Seed(seed).stream("plan", 0))
    }

    fn solve(&self, seed: u64) -> Path {
        match self.plan(seed) {
            PathOutcome::Solved(path) => path,
            outcome => panic!("{:?}, seed {seed}: {outcome:?}", self.planner),
        }
    }

    fn name(&self) -> String {
        format!("{:?} with {:?}", self.planner.algorithm, self.planner.steering)
    }
}

#[test]
fn planners_conform() {
    for_each_planner(|case| {
        let build = |grid: &OccupancyGrid| SamplingPlanner {
            bounds: grid.frame().bounds(),
            settings: RrtSettings { budget: Budget { iterations: 500 }, ..case.planner.settings },
            ..case.planner.clone()
        };
        assert_eq!(check_motion_planner(build), Ok(()), "{}", case.name());
    });
}

#[test]
fn samplers_conform() {
    let grid = OccupancyGrid::from_ascii(0.5, ROOMS).expect("a sound drawing");
    let frame = *grid.frame();
    let cells = [Cell::new(3, 4), Cell::new(5, 6)];
    let uniform = || Uniform { bounds: frame.bounds() };
    let from_cells = || FromCells::new(frame, &cells).expect("there are cells");
    assert_eq!(check_sampler(uniform), Ok(()), "uniform");
    assert_eq!(check_sampler(from_cells), Ok(()), "from cells");
    let mixture = || Mixture { first: from_cells(), second: uniform(), share: 0.3 };
    assert_eq!(check_sampler(mixture), Ok(()), "mixture");
}

/// A planner made of a closure.
struct Closure<F>(F);

impl<F: Fn(&MotionQuery) -> PathOutcome> MotionPlanner for Closure<F> {
    fn plan(&self, query: &MotionQuery, _: &dyn CollisionChecker, _: &mut Stream) -> PathOutcome {
        (self.0)(query)
    }
}

impl<F: FnMut() -> Pose> Sampler for Closure<F> {
    fn sample(&mut self, _: &mut Stream) -> Pose {
        (self.0)()
    }
}

#[test]
fn broken_planners_and_samplers_are_noticed() {
    let check =
        |plan: &dyn Fn(&MotionQuery) -> PathOutcome| check_motion_planner(|_| Closure(plan)).unwrap_err();
    let through = |poses: Vec<Pose>| PathOutcome::Solved(Path::new(poses).expect("there are poses"));
    let none = check(&|_| PathOutcome::Exhausted { iterations: 1 });
    assert!(matches!(none, PlannerViolation::OpenRoom(_)), "{none}");
    let short = check(&|query| through(vec![query.start]));
    assert!(matches!(short, PlannerViolation::Ends { .. }), "{short}");
    let jump = check(&|query| through(vec![query.start, query.goal]));
    assert!(matches!(jump, PlannerViolation::Jump(..)), "{jump}");
    let wall = check(&|query| through(vec![query.start, Pose::new(0.1, 0.1, 0.0), query.goal]));
    assert!(matches!(wall, PlannerViolation::Collision(_)), "{wall}");
    let straight =
        |query: &MotionQuery| through(Steering::RotateTranslate.connect(query.start, query.goal, 0.05));
    let far = |outcome: PathOutcome| {
        check(&|query| if query.goal.position.x > 5.0 { outcome.clone() } else { straight(query) })
    };
    let afraid = far(PathOutcome::InvalidGoal);
    assert!(matches!(afraid, PlannerViolation::FreeEnd(_)), "{afraid}");
    let blind = far(PathOutcome::Exhausted { iterations: 1 });
    assert!(matches!(blind, PlannerViolation::BlockedEnd { .. }), "{blind}");
    let nowhere = check_sampler(|| Closure(|| Pose::new(f64::NAN, 0.0, 0.0)));
    assert_eq!(nowhere, Err(SamplerViolation::NotFinite { number: 0 }));
}

#[test]
fn paths_start_and_end_right_and_are_free_throughout() {
    for_each_planner(|case| {
        for seed in 0..5 {
            let path = case.solve(seed);
            assert_eq!((path.start(), path.end()), (case.query.start, case.query.goal), "{}", case.name());
            for pair in path.poses().windows(2) {
                assert!(case.checker.is_free(pair[0]), "{}: {:?} is blocked", case.name(), pair[0]);
                assert!(
                    pair[0].distance_m(&pair[1]) < 0.0501,
                    "{}: the path jumps from {:?} to {:?}",
                    case.name(),
                    pair[0],
                    pair[1]
                );
            }
        }
    });
}

#[test]
fn paths_are_drivable_forward() {
    for_each_planner(|case| {
        let radius = case.planner.steering.radius_m();
        for pair in case.solve(1).poses().windows(2) {
            let (ahead, turn) =
                (pair[0].to_local(pair[1].position), pair[0].heading.turn_to(pair[1].heading));
            assert!(ahead.x > -1e-9, "{} goes backwards at {:?}", case.name(), pair[0]);
            // The chord of an arc is shorter than the arc by less than a per mille here.
            assert!(
                turn.abs() * radius <= ahead.norm() * 1.001 + 1e-9,
                "{} turns too fast at {:?}",
                case.name(),
                pair[0]
            );
        }
    });
}

#[test]
fn a_zero_budget_is_respected() {
    for_each_planner(|case| {
        let settings = RrtSettings { budget: Budget { iterations: 0 }, ..case.planner.settings };
        let planner = SamplingPlanner { settings, ..case.planner.clone() };
        let outcome = planner.plan(&case.query, &case.checker, &mut Seed(0).stream("plan", 0));
        assert_eq!(outcome, PathOutcome::Exhausted { iterations: 0 }, "{}", case.name());
    });
}

#[test]
fn equal_seeds_give_equal_paths_and_others_differ() {
    for_each_planner(|case| {
        assert_eq!(case.solve(3), case.solve(3), "{}", case.name());
        assert_ne!(case.solve(3), case.solve(4), "{}", case.name());
    });
}

#[test]
fn blocked_ends_are_named() {
    for_each_planner(|case| {
        let wall = Pose::new(0.0, 0.0, 0.0);
        let nowhere = Pose::new(f64::NAN, 1.0, 0.0);
        let ask = |query| case.planner.plan(&query, &case.checker, &mut Seed(0).stream("plan", 0));
        assert_eq!(
            ask(MotionQuery { start: wall, ..case.query }),
            PathOutcome::InvalidStart,
            "{}",
            case.name()
        );
        assert_eq!(
            ask(MotionQuery { goal: wall, ..case.query }),
            PathOutcome::InvalidGoal,
            "{}",
            case.name()
        );
        assert_eq!(
            ask(MotionQuery { goal: nowhere, ..case.query }),
            PathOutcome::InvalidGoal,
            "{}",
            case.name()
        );
    });
}

#[test]
fn unreachable_goals_exhaust_the_budget() {
    for_each_planner(|case| {
        let sealed = ROOMS.replace("######..####", "############");
        let grid = OccupancyGrid::from_ascii(0.5, &sealed).expect("a sound drawing");
        let checker = FootprintChecker::new(&grid, *case.checker.footprint());
        let settings = RrtSettings { budget: Budget { iterations: 100 }, ..case.planner.settings };
        let planner = SamplingPlanner { settings, ..case.planner.clone() };
        let outcome = planner.plan(&case.query, &checker, &mut Seed(0).stream("plan", 0));
        assert_eq!(outcome, PathOutcome::Exhausted { iterations: 100 }, "{}", case.name());
    });
}

#[test]
fn standing_at_the_goal_is_a_path() {
    for_each_planner(|case| {
        let query = MotionQuery { goal: case.query.start, ..case.query };
        let outcome = case.planner.plan(&query, &case.checker, &mut Seed(0).stream("plan", 0));
        let path = outcome.path().unwrap_or_else(|| panic!("{} found no path", case.name()));
        assert_eq!((path.start(), path.end()), (query.start, query.goal), "{}", case.name());
    });
}

#[test]
fn short_cuts_keep_the_ends_stay_free_and_never_lengthen() {
    for_each_planner(|case| {
        let path = case.solve(2);
        let mut rng = Seed(2).stream("shortcut", 0);
        let steering = case.planner.steering;
        let short = shortcut(&path, &case.checker, &steering, &ShortcutSettings::default(), &mut rng);
        assert_eq!((short.start(), short.end()), (path.start(), path.end()), "{}", case.name());
        assert!(short.length_m() <= path.length_m() + 0.5, "{} grew", case.name());
        assert!(short.poses().iter().all(|&pose| case.checker.is_free(pose)), "{} hits a wall", case.name());
    });
}
