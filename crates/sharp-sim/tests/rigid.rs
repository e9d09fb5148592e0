//! The three-dimensional simulator drives as the wheel law says it should.

#![cfg(feature = "rigid3d")]

use std::sync::Arc;

use rand::RngExt;
use sharp_sim::{
    ActionSettings, NoiseModel, ObstacleMap, PlanarSim, RigidSim, RobotModel, RobotState, Simulator, Vehicle,
    WheelCommand,
};
use sharp_space::{GridFrame, Occupancy, OccupancyGrid, Point, Pose, Seed, trig};

const DT_S: f64 = 1.0 / 60.0;

/// A square of 20 m around the world's origin, blocked where `blocked` says so.
fn obstacles(robot: &RobotModel, blocked: impl Fn(f64, f64) -> bool) -> Arc<ObstacleMap> {
    let frame =
        GridFrame { origin: Pose::new(-10.0, -10.0, 0.0), resolution_m: 0.1, width: 200, height: 200 };
    let cells = (0..frame.len())
        .map(|index| frame.center(frame.cell(index)))
        .map(|c| if blocked(c.x, c.y) { Occupancy::Occupied } else { Occupancy::Free })
        .collect();
    Arc::new(ObstacleMap::new(&OccupancyGrid::new(frame, cells).expect("a sound grid"), robot.footprint))
}

fn on_the_plain(robot: &RobotModel) -> RigidSim {
    let mut sim = RigidSim::new(obstacles(robot, |_, _| false), robot);
    sim.reset(RobotState::at_rest(Pose::new(-5.0, 0.0, 0.0)));
    sim
}

/// Holds `command` for six seconds and returns the mean (speed ahead, turn) of the last three.
fn response(robot: &RobotModel, command: WheelCommand, dt_s: f64) -> (f64, f64) {
    let mut sim = on_the_plain(robot);
    let steps = (6.0 / dt_s).round() as usize;
    let (mut speed, mut turn) = (0.0, 0.0);
    for step in 0..steps {
        assert!(!sim.step(command, dt_s).in_contact, "the plain is free: {:?}", sim.state());
        if step >= steps / 2 {
            speed += sim.state().speed_mps();
            turn += sim.state().yaw_rate_radps;
        }
    }
    (speed / (steps / 2) as f64, turn / (steps / 2) as f64)
}

#[test]
fn wheels_that_skid_turn_the_husky_at_its_ratio() {
    let husky = RobotModel::husky();
    for hz in [60.0, 240.0] {
        for yaw_rate_radps in [0.5, -2.0] {
            let command = WheelCommand::Twist { speed_mps: 0.0, yaw_rate_radps };
            let ratio = response(&husky, command, 1.0 / hz).1 / yaw_rate_radps;
            assert!((ratio - husky.yaw_gain()).abs() < 0.02, "{ratio} at {hz} Hz, {yaw_rate_radps} rad/s");
        }
    }
}

#[test]
fn wheels_that_steer_turn_the_limo_on_forty_centimetres() {
    let limo = RobotModel::limo();
    for hz in [60.0, 240.0] {
        for (speed_mps, steer_rad) in [(0.3, 1.0), (1.0, -1.0)] {
            let (speed, turn) = response(&limo, WheelCommand::Steer { speed_mps, steer_rad }, 1.0 / hz);
            let radius_m = speed / turn.abs();
            assert!((radius_m - 0.40).abs() < 0.03, "{radius_m} m at {hz} Hz, {speed_mps} m/s");
        }
    }
}

#[test]
fn straight_ahead_robots_reach_the_commanded_speed() {
    let command = WheelCommand::Twist { speed_mps: 1.0, yaw_rate_radps: 0.0 };
    // The engine's balls roll short in proportion to the time step, small ones more than large ones:
    // the Limo's by 1.5 % at 60 Hz.
    for (hz, tolerance) in [(60.0, 0.02), (240.0, 0.005)] {
        for robot in [RobotModel::husky(), RobotModel::limo()] {
            let (speed, turn) = response(&robot, command, 1.0 / hz);
            assert!((speed - 1.0).abs() < tolerance, "{} at {hz} Hz: {speed} m/s", robot.name);
            assert!(turn.abs() < 1e-3, "{} at {hz} Hz turns at {turn} rad/s", robot.name);
        }
    }
}

#[test]
fn it_stays_near_the_planar_simulator() {
    for robot in [RobotModel::husky(), RobotModel::limo()] {
        let plain = obstacles(&robot, |_, _| false);
        let mut rigid = RigidSim::new(plain.clone(), &robot);
        let mut planar = PlanarSim::new(plain, &robot);
        let start = RobotState::rolling(Pose::new(1.0, 2.0, 0.5), 0.3);
        rigid.reset(start);
        planar.reset(start);
        let stream = &mut Seed(1).stream("commands", 0);
        for _ in 0..5 {
            let command = WheelCommand::Twist {
                speed_mps: stream.random_range(0.2..1.0),
                yaw_rate_radps: stream.random_range(-1.5..1.5),
            };
            for _ in 0..60 {
                rigid.step(command, DT_S);
                planar.step(command, DT_S);
            }
        }
        let apart_m = rigid.state().pose.distance_m(&planar.state().pose);
        assert!(apart_m < 0.15, "{}: {apart_m} m apart after 5 s", robot.name);
    }
}

#[test]
fn a_robot_pushes_a_wall_without_climbing_it_and_backs_out() {
    for robot in [RobotModel::husky(), RobotModel::limo()] {
        let mut sim = RigidSim::new(obstacles(&robot, |x, _| x > 1.0), &robot);
        sim.reset(RobotState::at_rest(Pose::new(-0.5, 0.03, 0.0)));
        let drive = |sim: &mut RigidSim, speed_mps: f64, seconds: usize| {
            let command = WheelCommand::Twist { speed_mps, yaw_rate_radps: 0.0 };
            (0..seconds * 60).map(|_| sim.step(command, DT_S).in_contact).last() == Some(true)
        };
        let name = &robot.name;
        assert!(drive(&mut sim, 1.0, 4), "{name} does not touch the wall");
        let nose_m = sim.state().pose.position.x + robot.footprint.half_length_m();
        assert!((0.97..1.03).contains(&nose_m), "{name} has its nose at {nose_m}, the wall is at 1");
        assert!(!drive(&mut sim, -0.5, 3), "{name} still touches the wall");
        assert!(sim.state().pose.position.x < -0.3, "{name} is stuck: {:?}", sim.state());
    }
}

#[test]
fn equal_seeds_and_forks_give_equal_bits() {
    for robot in [RobotModel::husky(), RobotModel::limo()] {
        let clutter = obstacles(&robot, |x, y| {
            (x.rem_euclid(2.5) < 0.4 && y.rem_euclid(2.5) < 0.4) && trig::hypot(x, y) > 1.0
        });
        let sim = RigidSim::new(clutter, &robot);
        let settings = ActionSettings { stop_at_contact: false, ..ActionSettings::default() };
        let mut vehicle = Vehicle::new(sim, Arc::new(robot.clone()), NoiseModel::harsh(), settings);
        let drive = |vehicle: &mut Vehicle<RigidSim>| -> Vec<RobotState> {
            (0..20_u32).map(|i| vehicle.act(Point::new(3.0, f64::from(i % 7) - 3.0)).after).collect()
        };
        let start = RobotState::at_rest(Pose::new(0.0, 1.0, 0.0));
        vehicle.reset(start, Seed(5), 3);
        let first = drive(&mut vehicle);
        let mut fork = vehicle.clone();
        let (on, beside) = (drive(&mut vehicle), drive(&mut fork));
        assert_eq!(on, beside, "{}: a fork continues bit for bit", robot.name);
        vehicle.reset(start, Seed(5), 3);
        assert_eq!(drive(&mut vehicle), first, "{}: a second run", robot.name);
    }
}
