//! How fast the simulators step, act and fork, and what a collision test costs.
//!
//! `cargo bench -p sharp-sim`; a time of 200 ns per step is five million steps a second.

use std::hint::black_box;
use std::sync::Arc;

use criterion::{Criterion, criterion_group, criterion_main};
use rand::RngExt;
use sharp_sim::{
    ActionSettings, AnySim, Command, NoiseModel, RobotModel, RobotState, Simulator, SimulatorKind, Vehicle,
    World,
};
use sharp_space::{CollisionChecker, GridFrame, Occupancy, OccupancyGrid, Point, Pose, Seed, Stream};

const DT_S: f64 = 1.0 / 60.0;
const KINDS: [SimulatorKind; 2] = [SimulatorKind::Kinematic, SimulatorKind::Planar];

/// A square of `side_m` with boxes everywhere but in its middle.
fn boxes(side_m: f64) -> OccupancyGrid {
    let side = (side_m / 0.1).round() as usize;
    let origin = Pose::new(-side_m / 2.0, -side_m / 2.0, 0.0);
    let frame = GridFrame { origin, resolution_m: 0.1, width: side, height: side };
    let mut cells = vec![Occupancy::Free; frame.len()];
    let stream = &mut Seed(1).stream("boxes", 0);
    for _ in 0..(side_m * side_m / 2.5) as usize {
        let corner =
            sharp_space::Cell::new(stream.random_range(0..side - 5), stream.random_range(0..side - 5));
        let center = frame.center(corner);
        if center.x.abs().max(center.y.abs()) < 3.5 {
            continue;
        }
        for index in 0..25 {
            let cell = sharp_space::Cell::new(corner.col + index % 5, corner.row + index / 5);
            cells[frame.index(cell)] = Occupancy::Occupied;
        }
    }
    OccupancyGrid::new(frame, cells).expect("a sound grid")
}

fn simulator(kind: SimulatorKind, grid: &OccupancyGrid, robot: &RobotModel) -> AnySim {
    let mut sim = AnySim::new(kind, Arc::new(World::new(grid, robot.footprint)), robot);
    sim.reset(RobotState::at_rest(Pose::new(0.0, 0.0, 0.0)));
    sim
}

fn steps(c: &mut Criterion) {
    let grid = boxes(15.0);
    for kind in KINDS {
        for robot in [RobotModel::husky(), RobotModel::limo()] {
            for (what, speed_mps) in [("idle", 0.0), ("circle", 0.8)] {
                let mut sim = simulator(kind, &grid, &robot);
                let command = Command::Twist { speed_mps, yaw_rate_radps: 1.0 };
                c.bench_function(&format!("step/{kind}/{}/{what}", robot.name), |b| {
                    b.iter(|| black_box(sim.step(command, DT_S)));
                });
                assert!(sim.state().pose.is_finite(), "still a pose");
            }
        }
    }
}

fn actions(c: &mut Criterion) {
    for (map, side_m) in [("15m", 15.0), ("75m", 75.0)] {
        let grid = boxes(side_m);
        for kind in KINDS {
            for robot in [RobotModel::husky(), RobotModel::limo()] {
                let name = format!("act/{kind}/{}/{map}", robot.name);
                let sim = simulator(kind, &grid, &robot);
                let mut vehicle =
                    Vehicle::new(sim, Arc::new(robot), NoiseModel::nominal(), ActionSettings::default());
                let mut action = 0_u64;
                c.bench_function(&name, |b| {
                    b.iter(|| {
                        // Around a square of 6 m in the clear middle, on and on.
                        action += 1;
                        let corner =
                            [(3.0, 3.0), (-3.0, 3.0), (-3.0, -3.0), (3.0, -3.0)][action as usize / 12 % 4];
                        let report = vehicle.act(Point::new(corner.0 * 0.8, corner.1 * 0.8));
                        if report.contact {
                            vehicle.reset(RobotState::at_rest(Pose::new(0.0, 0.0, 0.0)), Seed(1), action);
                        }
                        black_box(report)
                    });
                });
            }
        }
    }
}

fn forks(c: &mut Criterion) {
    for (map, side_m) in [("15m", 15.0), ("75m", 75.0)] {
        let grid = boxes(side_m);
        let footprint = RobotModel::husky().footprint;
        c.bench_function(&format!("world/{map}"), |b| b.iter(|| black_box(World::new(&grid, footprint))));
        for kind in KINDS {
            let mut sim = simulator(kind, &grid, &RobotModel::husky());
            sim.step(Command::Twist { speed_mps: 1.0, yaw_rate_radps: 0.0 }, DT_S);
            c.bench_function(&format!("fork/{kind}/{map}"), |b| b.iter(|| black_box(sim.clone())));
            let state = *sim.state();
            c.bench_function(&format!("reset/{kind}/{map}"), |b| b.iter(|| sim.reset(state)));
        }
    }
}

fn collision_checks(c: &mut Criterion) {
    let grid = boxes(15.0);
    for robot in [RobotModel::husky(), RobotModel::limo()] {
        let world = World::new(&grid, robot.footprint);
        let stream = &mut Seed(2).stream("poses", 0);
        let anywhere: Vec<Pose> = (0..4096).map(|_| random_pose(stream)).collect();
        let mut pose = Pose::new(0.0, 0.0, 0.0);
        let walk: Vec<Pose> = (0..4096)
            .map(|_| {
                let [dx, dy, turn] = [0.1, 0.1, 0.2].map(|size| stream.random_range(-size..size));
                pose = Pose::new(pose.position.x + dx, pose.position.y + dy, pose.heading.radians() + turn);
                pose
            })
            .collect();
        for (what, poses) in [("random", &anywhere), ("walk", &walk)] {
            let mut next = 0;
            c.bench_function(&format!("footprint/{}/{what}", robot.name), |b| {
                b.iter(|| {
                    next = (next + 1) % poses.len();
                    black_box(world.checker().is_free(poses[next]))
                });
            });
        }
    }
}

fn random_pose(stream: &mut Stream) -> Pose {
    Pose::new(stream.random_range(-7.5..7.5), stream.random_range(-7.5..7.5), stream.random_range(-3.0..3.0))
}

criterion_group!(benches, steps, actions, forks, collision_checks);
criterion_main!(benches);
