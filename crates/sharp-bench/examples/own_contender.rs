//! A contender of one's own: it drives straight at the goal, and gives up at the first wall.
//!
//! `cargo run --release -p sharp-bench --example own_contender`

use sharp_bench::conformance::check_contender;
use sharp_bench::{ComparisonSettings, Contender, compare};
use sharp_drive::{Command, Controller, Decision, EpisodeEnd, Motion, Supervisor, World};
use sharp_plan::Query;
use sharp_sim::{NoiseModel, RobotModel, RobotState, SimulatorKind};
use sharp_space::{OccupancyGrid, Point, Pose, Seed};

/// What it knows before an episode: the goal, and how near is near enough.
#[derive(Clone, Debug)]
struct Beeline {
    goal: Point,
    tolerance_m: f64,
}

/// What it knows on the way.
struct BeelineController<'a> {
    contender: &'a Beeline,
    at: Pose,
    bumped: bool,
}

impl Contender for Beeline {
    fn controller(&self, start: RobotState, _episode: u64) -> Box<dyn Controller + '_> {
        Box::new(BeelineController { contender: self, at: start.pose, bumped: false })
    }
}

impl Controller for BeelineController<'_> {
    fn decide(&mut self) -> Decision {
        let left_m = (self.contender.goal - self.at.position).norm();
        match (left_m < self.contender.tolerance_m, self.bumped) {
            (true, _) => Decision::Reached,
            (false, true) => Decision::Lost,
            (false, false) => Decision::Drive(Command::of(&self.at, self.contender.goal, 0.5)),
        }
    }

    fn observe(&mut self, motion: &Motion) {
        (self.at, self.bumped) = (motion.after.pose, motion.contact);
    }
}

fn main() {
    let grid = OccupancyGrid::from_ascii(0.5, &["....................."; 10].join("\n")).expect("a drawing");
    let world = World::new(grid, RobotModel::husky());
    let query = Query { start: Pose::new(2.0, 2.0, 0.0), goal: Pose::new(8.0, 3.0, 0.0) };
    let beeline = Beeline { goal: query.goal.position, tolerance_m: world.robot.goal_tolerance_m };
    assert_eq!(check_contender(&beeline, &world, &query), Ok(()));

    let (simulator, noise) = (world.simulator(SimulatorKind::Planar), NoiseModel::nominal());
    let settings = ComparisonSettings { episodes: 10, simulator, noise, contact_ends: true, seed: Seed(1) };
    let driven = compare(&beeline, &world, &query, &settings, &Supervisor::silent());
    assert!(driven.iter().all(|episode| episode.end == EpisodeEnd::Reached), "nothing is in the way");
}
