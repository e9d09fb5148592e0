//! What does it cost to call a simulator through `Box<dyn Simulator>`?
//!
//! `cargo bench -p sharp-sim --bench dispatch` times actions of half a second with the concrete simulator and the
//! boxed one, in turns, so that both see the same state of the machine. It prints both medians and their ratio.

#![allow(clippy::disallowed_methods, reason = "a measurement reads the clock")]

use std::hint::black_box;
use std::sync::Arc;
use std::time::Instant;

use sharp_sim::{
    ActionSettings, KinematicSim, NoiseModel, ObstacleMap, RobotModel, RobotState, Simulator, SimulatorKind,
    Vehicle,
};
use sharp_space::{Point, Pose, Seed};

#[path = "support/maps.rs"]
mod maps;

const ROUNDS: usize = 60;
const ACTIONS: u64 = 2000;

fn main() {
    let grid = maps::map("grid_15").expect("the benches know their maps");
    for robot in [RobotModel::husky(), RobotModel::limo()] {
        let map = Arc::new(ObstacleMap::new(&grid, robot.footprint));
        let kind = SimulatorKind::Kinematic;
        let mut concrete = vehicle(KinematicSim::new(map.clone(), &robot), &robot);
        let mut boxed = vehicle(kind.build(map, &robot), &robot);
        let mut times_ns = [const { Vec::new() }; 2];
        for round in 0..ROUNDS as u64 {
            times_ns[0].push(time_ns(&mut concrete, round));
            times_ns[1].push(time_ns(&mut boxed, round));
        }
        let [concrete, boxed] = times_ns.map(median);
        println!(
            "{}: an action takes {concrete:.0} ns concrete, {boxed:.0} ns boxed ({:.3})",
            robot.name,
            boxed / concrete,
        );
    }
}

fn vehicle<S: Simulator>(sim: S, robot: &RobotModel) -> Vehicle<S> {
    Vehicle::new(sim, Arc::new(robot.clone()), NoiseModel::nominal(), ActionSettings::default())
}

/// Nanoseconds per action of episode `round`, around a square of five metres in the clear middle.
fn time_ns<S: Simulator>(vehicle: &mut Vehicle<S>, round: u64) -> f64 {
    vehicle.reset(RobotState::at_rest(Pose::new(0.0, 0.0, 0.0)), Seed(1), round);
    let begun = Instant::now();
    for action in 0..ACTIONS {
        let (x, y) = [(2.4, 2.4), (-2.4, 2.4), (-2.4, -2.4), (2.4, -2.4)][action as usize / 12 % 4];
        if black_box(vehicle.act(Point::new(x, y))).contact {
            vehicle.reset(RobotState::at_rest(Pose::new(0.0, 0.0, 0.0)), Seed(2), action);
        }
    }
    begun.elapsed().as_nanos() as f64 / ACTIONS as f64
}

fn median(mut times_ns: Vec<f64>) -> f64 {
    times_ns.sort_by(f64::total_cmp);
    times_ns[times_ns.len() / 2]
}
