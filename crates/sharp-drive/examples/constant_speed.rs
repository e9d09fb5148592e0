//! A policy of one's own: it drives at a point ahead on the guide, always at the same speed.
//!
//! `cargo run --release -p sharp-drive --example constant_speed`

use sharp_drive::conformance::check_policy;
use sharp_drive::{
    Command, Episode, EpisodeEnd, EpisodeRules, Policy, RouteController, Situation, Supervisor, World,
};
use sharp_guide::GuidePath;
use sharp_sim::{NoiseModel, RobotModel, RobotState, SimulatorKind};
use sharp_space::{OccupancyGrid, Pose, Seed, trig};

/// Pure pursuit without any thought of bends or walls.
#[derive(Clone, Debug)]
struct ConstantSpeed {
    /// How far ahead it looks, metres along the guide.
    look_ahead_m: f64,
    /// Its speed, metres per second.
    speed_mps: f64,
}

impl Policy for ConstantSpeed {
    fn decide(&mut self, situation: &Situation<'_>) -> Command {
        let target = situation.guide.ahead(situation.progress.arc_m + self.look_ahead_m);
        Command::of(&situation.observation.state.pose, target.position, self.speed_mps)
    }

    fn uses_slip_estimate(&self) -> bool {
        false
    }
}

fn main() {
    let policy = ConstantSpeed { look_ahead_m: 0.7, speed_mps: 0.5 };
    assert_eq!(check_policy(&policy), Ok(()));

    let grid = OccupancyGrid::from_ascii(0.5, &["...................."; 12].join("\n")).expect("a drawing");
    let world = World::new(grid, RobotModel::limo());
    // A quarter of a circle with a radius of 4 m.
    let pose = |i: u32| {
        let angle = f64::from(i) * 0.05;
        Pose::new(1.0 + 4.0 * trig::sin(angle), 5.0 - 4.0 * trig::cos(angle), angle)
    };
    let guide = GuidePath::new((0..=31).map(pose).collect(), 0.25).expect("short gaps");
    let start = RobotState::at_rest(guide.start());
    let simulator = world.simulator(SimulatorKind::Kinematic);
    let vehicle = world.vehicle(&*simulator, &NoiseModel::nominal(), true);
    let mut episode = Episode::new(vehicle, EpisodeRules::default().with_time_limit_s(60.0));
    episode.begin(start, Seed(1), 0);
    let mut controller = RouteController::new(&world, guide, Box::new(policy), start, &NoiseModel::nominal());
    assert_eq!(episode.drive(&mut controller, &Supervisor::silent()), EpisodeEnd::Reached);
    let record = episode.record();
    assert!((10.0..20.0).contains(&record.time_s), "{} s for {} m", record.time_s, record.path_m);
}
