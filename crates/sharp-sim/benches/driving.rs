//! How fast the simulators step, act and fork, and what a collision test costs.
//!
//! `cargo bench -p sharp-sim`; a time of 200 ns per step is five million steps a second. The feature
//! `rigid3d` adds the three-dimensional simulator.

use std::hint::black_box;
use std::sync::Arc;

use criterion::{Criterion, criterion_group, criterion_main};
use rand::RngExt;
use sharp_sim::{
    ActionSettings, NoiseModel, ObstacleMap, RobotModel, RobotState, Simulator, SimulatorKind, Vehicle,
    WheelCommand,
};
use sharp_space::{OccupancyGrid, Point, Pose, Seed, Stream};

#[path = "support/maps.rs"]
mod maps;

const DT_S: f64 = 1.0 / 60.0;
#[cfg(not(feature = "rigid3d"))]
const KINDS: [SimulatorKind; 2] = [SimulatorKind::Kinematic, SimulatorKind::Planar];
#[cfg(feature = "rigid3d")]
const KINDS: [SimulatorKind; 3] = [SimulatorKind::Kinematic, SimulatorKind::Planar, SimulatorKind::Rigid];
/// Enough that they do not fit the processor's nearest memory, as a planner's do not.
const POSES: usize = 1 << 16;

fn grid(map: &str) -> OccupancyGrid {
    maps::map(map).expect("the benches know their maps")
}

fn simulator(kind: SimulatorKind, grid: &OccupancyGrid, robot: &RobotModel) -> Box<dyn Simulator> {
    let mut sim = kind.build(Arc::new(ObstacleMap::new(grid, robot.footprint)), robot);
    sim.reset(RobotState::at_rest(Pose::new(0.0, 0.0, 0.0)));
    sim
}

/// Does the number of obstacles or the size of the map matter?
fn steps_on_maps(c: &mut Criterion) {
    for map in ["free", "boxes_100", "boxes_1000", "boxes_10000", "grid_15", "grid_75"] {
        let grid = grid(map);
        for kind in KINDS {
            let mut sim = simulator(kind, &grid, &RobotModel::husky());
            circle(c, &format!("step/{kind}/husky/{map}"), &mut sim);
        }
    }
}

/// What does a step cost at rest, and for the other robot?
fn steps_of_robots(c: &mut Criterion) {
    let grid = grid("grid_15");
    for kind in KINDS {
        let limo = RobotModel::limo();
        circle(c, &format!("step/{kind}/limo/grid_15"), &mut simulator(kind, &grid, &limo));
        let mut sim = simulator(kind, &grid, &RobotModel::husky());
        let stop = WheelCommand::Twist { speed_mps: 0.0, yaw_rate_radps: 0.0 };
        c.bench_function(&format!("step/{kind}/husky/idle"), |b| b.iter(|| black_box(sim.step(stop, DT_S))));
    }
}

/// What does a step cost that pushes a wall, where the engine has to work?
fn pushes(c: &mut Criterion) {
    for map in ["boxes_100", "boxes_10000", "grid_75"] {
        let grid = grid(map);
        for kind in KINDS {
            let mut sim = simulator(kind, &grid, &RobotModel::husky());
            let command = WheelCommand::Twist { speed_mps: 1.0, yaw_rate_radps: 0.0 };
            // The slab is 3.3 m ahead.
            let contacts = (0..300).filter(|_| sim.step(command, DT_S).in_contact).count();
            assert!(contacts > 50, "{kind} on {map} touches in {contacts} steps: {:?}", sim.state());
            let name = format!("push/{kind}/husky/{map}");
            c.bench_function(&name, |b| b.iter(|| black_box(sim.step(command, DT_S))));
        }
    }
}

/// Times steps on a circle of a metre, checked once to be clear.
fn circle(c: &mut Criterion, name: &str, sim: &mut dyn Simulator) {
    let command = WheelCommand::Twist { speed_mps: 0.8, yaw_rate_radps: 1.0 };
    for _ in 0..1200 {
        assert!(!sim.step(command, DT_S).in_contact, "{name}: {:?}", sim.state());
    }
    c.bench_function(name, |b| b.iter(|| black_box(sim.step(command, DT_S))));
}

/// What does an action of half a second cost, controller and noise included?
fn actions(c: &mut Criterion) {
    for map in ["grid_15", "grid_75"] {
        let grid = grid(map);
        for kind in KINDS {
            for robot in [RobotModel::husky(), RobotModel::limo()] {
                let name = format!("act/{kind}/{}/{map}", robot.name);
                let sim = simulator(kind, &grid, &robot);
                let mut vehicle =
                    Vehicle::new(sim, Arc::new(robot), NoiseModel::nominal(), ActionSettings::default());
                let mut action = 0_u64;
                c.bench_function(&name, |b| b.iter(|| black_box(act(&mut vehicle, &mut action))));
                assert!(vehicle.state().pose.is_finite(), "{name}: {:?}", vehicle.state());
            }
        }
    }
}

/// The next action around a square of five metres in the clear middle, on and on.
fn act(vehicle: &mut Vehicle<Box<dyn Simulator>>, action: &mut u64) -> f64 {
    *action += 1;
    let (x, y) = [(2.4, 2.4), (-2.4, 2.4), (-2.4, -2.4), (2.4, -2.4)][*action as usize / 12 % 4];
    let report = vehicle.act(Point::new(x, y));
    if report.contact {
        vehicle.reset(RobotState::at_rest(Pose::new(0.0, 0.0, 0.0)), Seed(1), *action);
    }
    report.path_m
}

/// Is a fork cheap on any map?
fn forks(c: &mut Criterion) {
    for map in ["grid_15", "grid_75", "boxes_10000"] {
        let grid = grid(map);
        let footprint = RobotModel::husky().footprint;
        c.bench_function(&format!("obstacle_map/{map}"), |b| {
            b.iter(|| black_box(ObstacleMap::new(&grid, footprint)));
        });
        for kind in KINDS {
            let mut sim = simulator(kind, &grid, &RobotModel::husky());
            sim.step(WheelCommand::Twist { speed_mps: 1.0, yaw_rate_radps: 0.0 }, DT_S);
            c.bench_function(&format!("fork/{kind}/{map}"), |b| b.iter(|| black_box(sim.clone())));
            let state = *sim.state();
            c.bench_function(&format!("reset/{kind}/{map}"), |b| b.iter(|| sim.reset(state)));
        }
    }
}

/// What does the exact test of the outline cost, alone and along a way?
fn collision_checks(c: &mut Criterion) {
    for map in ["grid_15", "grid_75"] {
        let grid = grid(map);
        for robot in [RobotModel::husky(), RobotModel::limo()] {
            let obstacles = ObstacleMap::new(&grid, robot.footprint);
            let half_m = grid.frame().width_m() / 2.0;
            let anywhere = random_poses(half_m, &mut Seed(2).stream("poses", 0));
            let walk = walk(half_m, &mut Seed(2).stream("walk", 0));
            for (what, poses) in [("random", &anywhere), ("walk", &walk)] {
                let free = poses.iter().filter(|pose| obstacles.checker().is_free(**pose)).count();
                assert!((POSES / 10..POSES).contains(&free), "{map} {what}: {free} of {POSES} are free");
                let mut next = poses.iter().cycle();
                c.bench_function(&format!("footprint/{}/{map}/{what}", robot.name), |b| {
                    b.iter(|| next.next().map(|pose| obstacles.checker().is_free(*pose)));
                });
            }
            let mut ways = anywhere.iter().map(|from| (*from, two_metres_ahead(from))).cycle();
            c.bench_function(&format!("sweep/{}/{map}", robot.name), |b| {
                // Half a cell at a time.
                b.iter(|| ways.next().map(|(from, to)| obstacles.checker().is_segment_free(from, to, 0.05)));
            });
        }
    }
}

fn random_poses(half_m: f64, stream: &mut Stream) -> Vec<Pose> {
    let mut pose = || {
        let [x, y] = [(); 2].map(|()| stream.random_range(-half_m..half_m));
        Pose::new(x, y, stream.random_range(-3.0..3.0))
    };
    (0..POSES).map(|_| pose()).collect()
}

/// A way through the map, walls or no walls, a decimetre at a time.
fn walk(half_m: f64, stream: &mut Stream) -> Vec<Pose> {
    let mut pose = Pose::new(0.0, 0.0, 0.0);
    let mut next = || {
        let ahead = pose.position + pose.heading.unit() * 0.1;
        let is_inside = ahead.x.abs().max(ahead.y.abs()) < half_m - 0.6;
        let turn = if is_inside { stream.random_range(-0.2..0.2) } else { stream.random_range(1.0..2.0) };
        let position = if is_inside { ahead } else { pose.position };
        pose = Pose::new(position.x, position.y, pose.heading.radians() + turn);
        pose
    };
    (0..POSES).map(|_| next()).collect()
}

fn two_metres_ahead(from: &Pose) -> Pose {
    Pose::at(from.position + from.heading.unit() * 2.0, from.heading)
}

criterion_group!(benches, steps_on_maps, steps_of_robots, pushes, actions, forks, collision_checks);
criterion_main!(benches);
