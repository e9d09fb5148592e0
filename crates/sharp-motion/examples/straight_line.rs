//! A planner and a sampler of one's own, checked by the conformance suites.
//!
//! `cargo run --release -p sharp-motion --example straight_line`

use rand::RngExt;
use sharp_motion::conformance::{check_motion_planner, check_sampler};
use sharp_motion::{
    MotionPlanner, MotionQuery, Path, PathOutcome, RrtSettings, Sampler, Steering, rrt_connect,
};
use sharp_space::{CollisionChecker, Footprint, FootprintChecker, OccupancyGrid, Pose, Seed, Stream};

/// Turns, drives straight to the goal and turns again, or gives up.
struct StraightLine;

impl MotionPlanner for StraightLine {
    fn plan(&self, query: &MotionQuery, checker: &dyn CollisionChecker, _: &mut Stream) -> PathOutcome {
        if !checker.is_free(query.start) {
            return PathOutcome::InvalidStart;
        }
        if !checker.is_free(query.goal) {
            return PathOutcome::InvalidGoal;
        }
        let poses = Steering::RotateTranslate.connect(query.start, query.goal, 0.05);
        match Path::new(poses) {
            Some(path) if path.poses().iter().all(|&pose| checker.is_free(pose)) => PathOutcome::Solved(path),
            _ => PathOutcome::Exhausted { iterations: 1 },
        }
    }
}

/// Looks along a corridor only.
struct Corridor {
    length_m: f64,
}

impl Sampler for Corridor {
    fn sample(&mut self, rng: &mut Stream) -> Pose {
        Pose::new(rng.random_range(0.0..self.length_m), 1.5, 0.0)
    }
}

fn main() {
    assert_eq!(check_motion_planner(|_| StraightLine), Ok(()));
    assert_eq!(check_sampler(|| Corridor { length_m: 8.0 }), Ok(()));
    let grid = OccupancyGrid::from_ascii(1.0, "########\n#......#\n########").expect("the drawing is sound");
    let checker =
        FootprintChecker::new(&grid, Footprint::rectangle(0.4, 0.3).expect("the sizes are positive"));
    let query = MotionQuery { start: Pose::new(1.5, 1.5, 0.0), goal: Pose::new(6.5, 1.5, 0.0) };
    let mut rng = Seed(1).stream("example", 0);
    let straight = StraightLine.plan(&query, &checker, &mut rng).path().expect("nothing is in the way");
    let settings = RrtSettings::default();
    let mut sampler = Corridor { length_m: 8.0 };
    let found = rrt_connect(&query, &checker, &Steering::RotateTranslate, &mut sampler, &settings, &mut rng);
    assert!((found.path().expect("the corridor is open").length_m() - straight.length_m()).abs() < 1e-9);
}
