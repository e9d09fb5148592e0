//! Our side of `cargo xtask bench peers sim`: the Husky around a square, timed.
//!
//! `peer_sim MAP SIMULATOR SECONDS` prints one JSON object with steps per second at rest, on the
//! way and against a wall, and waypoints per second;
//! `peer_sim MAP walls` prints the walls, for the other side to build. The other side is
//! `assets/peers/pybullet_husky.py`: same waypoints, controller and time step.

#![allow(clippy::disallowed_methods, reason = "a measurement reads arguments and the clock")]

use std::error::Error;
use std::sync::Arc;
use std::time::{Duration, Instant};

use sharp_sim::{ObstacleMap, RobotModel, RobotState, Simulator, SimulatorKind, WheelCommand};
use sharp_space::{OccupancyGrid, Point, Pose, trig};

#[path = "../benches/support/maps.rs"]
mod maps;

/// The default of `PyBullet`.
const DT_S: f64 = 1.0 / 240.0;
/// A waypoint counts as reached within this distance.
const REACHED_M: f64 = 0.1;
const HOP_M: f64 = 2.0;
/// A square around the origin; every other hop turns by 90 degrees.
const WAYPOINTS: [(f64, f64); 8] =
    [(0.0, -2.0), (2.0, -2.0), (2.0, 0.0), (2.0, 2.0), (0.0, 2.0), (-2.0, 2.0), (-2.0, 0.0), (-2.0, -2.0)];
/// A fifth of a metre in front of the slab that the maps have for pushing.
const PUSH_FROM: (f64, f64) = (2.7, 0.0);
/// Half a second: enough to meet it.
const PUSH_STEPS: usize = 120;
/// Steps between two looks at the clock.
const BURST: usize = 64;

fn main() -> Result<(), Box<dyn Error>> {
    let args: Vec<String> = std::env::args().skip(1).collect();
    match args.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        [map, "walls"] => println!("{}", walls(&grid(map)?)),
        [map, simulator, seconds] => {
            let time = Duration::try_from_secs_f64(seconds.parse()?)?;
            println!("{}", measure(&grid(map)?, simulator.parse()?, time));
        }
        _ => return Err("usage: peer_sim MAP walls | peer_sim MAP SIMULATOR SECONDS".into()),
    }
    Ok(())
}

fn grid(map: &str) -> Result<OccupancyGrid, String> {
    maps::map(map).ok_or_else(|| format!("no map is called {map:?}"))
}

/// A list of (centre x, centre y, half length, half width) in the world's frame, metres.
fn walls(grid: &OccupancyGrid) -> String {
    let corner = grid.frame().origin;
    let obstacles = ObstacleMap::new(grid, RobotModel::husky().footprint);
    let boxes = obstacles.walls().map(|wall| {
        let center = corner.to_world(wall.center);
        format!("[{},{},{},{}]", center.x, center.y, wall.half_extents.x, wall.half_extents.y)
    });
    format!("[{}]", boxes.collect::<Vec<_>>().join(","))
}

fn measure(grid: &OccupancyGrid, kind: SimulatorKind, time: Duration) -> String {
    let robot = RobotModel::husky();
    let mut circuit = Circuit {
        sim: kind.build(Arc::new(ObstacleMap::new(grid, robot.footprint)), &robot),
        hops: 0,
        left_m: HOP_M,
    };
    circuit.sim.reset(RobotState::at_rest(Pose::new(-2.0, -2.0, 0.0)));
    let stop = WheelCommand::Twist { speed_mps: 0.0, yaw_rate_radps: 0.0 };
    let (idle_steps, idle_s) = repeat(time / 4, || {
        circuit.sim.step(stop, DT_S);
    });
    let (steps, drive_s) = repeat(time, || circuit.step());
    let hops = circuit.hops as f64 + (1.0 - circuit.left_m / HOP_M).clamp(0.0, 1.0);
    let push = measure_push(&mut circuit.sim, time / 4);
    format!(
        "{{\"name\":\"{kind}\",\"idle\":{},\"steps\":{},\"actions\":{},\"push\":{push}}}",
        idle_steps as f64 / idle_s,
        steps as f64 / drive_s,
        hops / drive_s,
    )
}

/// Steps a second while the robot pushes a wall.
fn measure_push(sim: &mut dyn Simulator, time: Duration) -> f64 {
    sim.reset(RobotState::at_rest(Pose::new(PUSH_FROM.0, PUSH_FROM.1, 0.0)));
    let command = WheelCommand::Twist { speed_mps: 1.0, yaw_rate_radps: 0.0 };
    for _ in 0..PUSH_STEPS {
        sim.step(command, DT_S);
    }
    let mut touches = 0;
    let (steps, push_s) = repeat(time, || touches += usize::from(sim.step(command, DT_S).in_contact));
    assert!(2 * touches > steps, "in {touches} of {steps} steps only it touches the wall: {:?}", sim.state());
    steps as f64 / push_s
}

/// Calls `step` for about `time`; returns how often and how long it took in seconds.
fn repeat(time: Duration, mut step: impl FnMut()) -> (usize, f64) {
    let begun = Instant::now();
    let mut count = 0;
    while begun.elapsed() < time {
        (0..BURST).for_each(|_| step());
        count += BURST;
    }
    (count, begun.elapsed().as_secs_f64())
}

/// A drive around the square.
struct Circuit {
    sim: Box<dyn Simulator>,
    /// Waypoints reached.
    hops: usize,
    /// To the next one.
    left_m: f64,
}

impl Circuit {
    fn step(&mut self) {
        let (x, y) = WAYPOINTS[self.hops % WAYPOINTS.len()];
        let target = self.sim.state().pose.to_local(Point::new(x, y));
        self.left_m = target.norm();
        if self.left_m < REACHED_M {
            self.hops += 1;
            self.left_m = HOP_M;
        }
        let bearing = trig::atan2(target.y, target.x);
        let command = WheelCommand::Twist {
            speed_mps: (2.0 * target.norm()).min(1.0) * trig::cos(bearing).max(0.0),
            yaw_rate_radps: (3.0 * bearing).clamp(-1.5, 1.5),
        };
        let info = self.sim.step(command, DT_S);
        assert!(!info.in_contact, "the square is clear: {:?}", self.sim.state());
    }
}
