//! How the robots drive: the figures of the real ones, both simulators against each other, contact,
//! forks and repeatability.

use std::f64::consts::FRAC_PI_2;
use std::sync::Arc;

use rand::RngExt;
use sharp_sim::{
    ActionSettings, KinematicSim, NoiseModel, ObstacleMap, PlanarSim, RobotModel, RobotState, Simulator,
    SimulatorKind, Vehicle, WheelCommand,
};
use sharp_space::{GridFrame, Heading, Occupancy, OccupancyGrid, Point, Pose, Seed, Vector, trig};

const DT_S: f64 = 1.0 / 60.0;
const KINDS: [SimulatorKind; 2] = [SimulatorKind::Kinematic, SimulatorKind::Planar];

/// A free square of 20 m, its centre at the world's origin.
fn plain() -> OccupancyGrid {
    walls(|_, _| false)
}

/// The same square with a wall wherever `blocked` says so of the centre of a decimetre cell.
fn walls(blocked: impl Fn(f64, f64) -> bool) -> OccupancyGrid {
    let frame =
        GridFrame { origin: Pose::new(-10.0, -10.0, 0.0), resolution_m: 0.1, width: 200, height: 200 };
    let cells = (0..frame.len())
        .map(|index| frame.center(frame.cell(index)))
        .map(|c| if blocked(c.x, c.y) { Occupancy::Occupied } else { Occupancy::Free })
        .collect();
    OccupancyGrid::new(frame, cells).expect("a sound grid")
}

/// Boxes at random places in the square, none near its centre.
fn clutter() -> OccupancyGrid {
    let stream = &mut Seed(9).stream("clutter", 0);
    let boxes: Vec<Point> = (0..40)
        .map(|_| Point::new(stream.random_range(-9.5..9.5), stream.random_range(-9.5..9.5)))
        .filter(|b| b.coords.norm() > 1.5)
        .collect();
    walls(|x, y| {
        x.abs().max(y.abs()) > 9.8 || boxes.iter().any(|b| (b.x - x).abs().max((b.y - y).abs()) < 0.4)
    })
}

fn simulator(kind: SimulatorKind, grid: &OccupancyGrid, robot: &RobotModel) -> Box<dyn Simulator> {
    kind.build(Arc::new(ObstacleMap::new(grid, robot.footprint)), robot)
}

fn vehicle(
    kind: SimulatorKind,
    grid: &OccupancyGrid,
    robot: RobotModel,
    noise: NoiseModel,
) -> Vehicle<Box<dyn Simulator>> {
    let sim = simulator(kind, grid, &robot);
    Vehicle::new(sim, Arc::new(robot), noise, ActionSettings::default())
}

/// Holds `command` for eight seconds and returns the mean (speed ahead, turn) of the last four.
fn response(kind: SimulatorKind, robot: &RobotModel, command: WheelCommand, dt_s: f64) -> (f64, f64) {
    let mut sim = simulator(kind, &plain(), robot);
    sim.reset(RobotState::at_rest(Pose::new(-5.0, 0.0, 0.0)));
    let steps = (8.0 / dt_s).round() as usize;
    let (mut speed, mut turn) = (0.0, 0.0);
    for step in 0..steps {
        let info = sim.step(command, dt_s);
        assert!(!info.in_contact, "the plain is free");
        if step >= steps / 2 {
            speed += sim.state().speed_mps();
            turn += sim.state().yaw_rate_radps;
        }
    }
    (speed / (steps / 2) as f64, turn / (steps / 2) as f64)
}

/// Asks `check` about each simulator at each of three time steps.
fn at_every_time_step(check: impl Fn(SimulatorKind, f64)) {
    for kind in KINDS {
        for hz in [60.0, 120.0, 240.0] {
            check(kind, 1.0 / hz);
        }
    }
}

#[test]
fn the_husky_turns_in_place_at_its_skid_ratio() {
    let husky = RobotModel::husky();
    at_every_time_step(|kind, dt_s| {
        for yaw_rate_radps in [0.5, 1.0, -2.0] {
            let command = WheelCommand::Twist { speed_mps: 0.0, yaw_rate_radps };
            let ratio = response(kind, &husky, command, dt_s).1 / yaw_rate_radps;
            assert!((ratio - 0.554).abs() < 0.01, "{kind} {dt_s} s: {ratio} at {yaw_rate_radps} rad/s");
        }
    });
}

#[test]
fn the_limo_turns_at_full_lock_on_forty_centimetres() {
    let limo = RobotModel::limo();
    at_every_time_step(|kind, dt_s| {
        for (speed_mps, steer_rad) in [(0.3, 1.0), (1.0, 1.0), (1.0, -1.0)] {
            let (speed, turn) = response(kind, &limo, WheelCommand::Steer { speed_mps, steer_rad }, dt_s);
            let radius_m = speed / turn.abs();
            assert!((radius_m - 0.40).abs() < 0.02, "{kind} {dt_s} s: {radius_m} m at {speed_mps} m/s");
        }
    });
}

#[test]
fn straight_ahead_robots_reach_the_commanded_speed() {
    at_every_time_step(|kind, dt_s| {
        for robot in [RobotModel::husky(), RobotModel::limo()] {
            let command = WheelCommand::Twist { speed_mps: 1.0, yaw_rate_radps: 0.0 };
            let (speed, turn) = response(kind, &robot, command, dt_s);
            assert!((speed - 1.0).abs() < 0.005, "{} {kind} {dt_s} s: {speed} m/s", robot.name);
            assert!(turn.abs() < 1e-6, "{} {kind} {dt_s} s: turns at {turn} rad/s", robot.name);
        }
    });
}

#[test]
fn wheels_obey_the_acceleration_limit() {
    for kind in KINDS {
        let mut sim = simulator(kind, &plain(), &RobotModel::husky());
        sim.reset(RobotState::at_rest(Pose::new(0.0, 0.0, 0.0)));
        for _ in 0..12 {
            sim.step(WheelCommand::Twist { speed_mps: 1.0, yaw_rate_radps: 0.0 }, DT_S);
        }
        let speed = sim.state().speed_mps();
        assert!((speed - 0.6).abs() < 0.01, "{kind}: {speed} m/s after 0.2 s at 3 m/s²");
    }
}

#[test]
fn the_simulators_agree_where_nothing_is_touched() {
    for robot in [RobotModel::husky(), RobotModel::limo()] {
        let mut sims = KINDS.map(|kind| simulator(kind, &plain(), &robot));
        for sim in &mut sims {
            sim.reset(RobotState::rolling(Pose::new(1.0, 2.0, 0.5), 0.3));
        }
        let stream = &mut Seed(1).stream("commands", 0);
        for second in 0..10 {
            let command = WheelCommand::Twist {
                speed_mps: stream.random_range(0.0..1.0),
                yaw_rate_radps: stream.random_range(-1.5..1.5),
            };
            for _ in 0..60 {
                for sim in &mut sims {
                    sim.step(command, DT_S);
                }
            }
            let [kinematic, planar] = [0, 1].map(|i| sims[i].state().pose);
            let apart_m = kinematic.distance_m(&planar);
            let apart_rad = kinematic.heading.turn_to(planar.heading).abs();
            assert!(
                apart_m < 1e-3 && apart_rad < 1e-3,
                "{} after {second} s: {apart_m} m, {apart_rad} rad",
                robot.name
            );
        }
    }
}

#[test]
fn a_turned_map_drives_like_a_straight_one() {
    let straight = plain();
    let origin = Pose::new(300.0, -200.0, 1.0);
    let turned = OccupancyGrid::new(GridFrame { origin, ..*straight.frame() }, straight.cells().to_vec())
        .expect("a sound grid");
    for kind in KINDS {
        let ends = [straight.clone(), turned.clone()].map(|grid| {
            let frame = *grid.frame();
            let mut sim = simulator(kind, &grid, &RobotModel::husky());
            let heading = Heading::new(frame.origin.heading.radians() + 0.3);
            sim.reset(RobotState::at_rest(Pose::at(frame.from_grid(Vector::new(40.0, 50.0)), heading)));
            for _ in 0..600 {
                sim.step(WheelCommand::Twist { speed_mps: 0.8, yaw_rate_radps: 0.4 }, DT_S);
            }
            frame.to_grid(sim.state().pose.position)
        });
        assert!((ends[0] - ends[1]).norm() < 0.02, "{kind}: {ends:?} cells");
    }
}

#[test]
fn a_limo_that_grazes_a_wall_keeps_moving() {
    // The wall's lower edge is at y = 0; the Limo drives into it at a flat angle.
    let grid = walls(|_, y| y > 0.0);
    let mut sim = simulator(SimulatorKind::Planar, &grid, &RobotModel::limo());
    sim.reset(RobotState::rolling(Pose::new(-2.0, -0.15, 0.1), 0.7));
    let mut touched = false;
    for _ in 0..180 {
        touched |= sim.step(WheelCommand::Steer { speed_mps: 0.7, steer_rad: 0.05 }, DT_S).in_contact;
    }
    let way_m = sim.state().pose.position.x + 2.0;
    assert!(touched, "it leans on the wall");
    assert!(way_m > 1.8, "moved {way_m} m in 3 s at 0.7 m/s");
}

#[test]
fn a_robot_pushes_a_wall_and_backs_out() {
    let grid = walls(|x, _| x > 1.0);
    for kind in KINDS {
        for robot in [RobotModel::husky(), RobotModel::limo()] {
            let mut sim = simulator(kind, &grid, &robot);
            sim.reset(RobotState::at_rest(Pose::new(-0.5, 0.03, 0.0)));
            let drive = |sim: &mut dyn Simulator, speed_mps: f64, seconds: usize| {
                let command = WheelCommand::Twist { speed_mps, yaw_rate_radps: 0.0 };
                (0..seconds * 60).map(|_| sim.step(command, DT_S).in_contact).last() == Some(true)
            };
            let name = format!("{} {kind}", robot.name);
            assert!(drive(&mut sim, 1.0, 4), "{name} does not touch the wall");
            let nose_m = sim.state().pose.position.x + robot.footprint.half_length_m();
            assert!((0.98..1.02).contains(&nose_m), "{name} has its nose at {nose_m}, the wall is at 1");
            assert!(!drive(&mut sim, -0.5, 3), "{name} still touches the wall");
            let back_m = sim.state().pose.position.x;
            assert!(back_m < -0.3, "{name} got back to {back_m} m only");
        }
    }
}

#[test]
fn random_driving_stays_inside_and_out_of_walls() {
    let grid = clutter();
    for kind in KINDS {
        for robot in [RobotModel::husky(), RobotModel::limo()] {
            let obstacles = ObstacleMap::new(&grid, robot.footprint);
            let shrunk = sharp_space::Footprint::rectangle(
                robot.footprint.half_length_m() - 0.04,
                robot.footprint.half_width_m() - 0.04,
            );
            let inner = ObstacleMap::new(&grid, shrunk.expect("both robots are wider than 8 cm"));
            let mut sim = simulator(kind, &grid, &robot);
            sim.reset(RobotState::at_rest(Pose::new(0.0, 0.0, 0.0)));
            let stream = &mut Seed(2).stream("commands", 0);
            let mut contacts = 0;
            for _ in 0..600 {
                let command = WheelCommand::Twist {
                    speed_mps: stream.random_range(-0.5..1.0),
                    yaw_rate_radps: stream.random_range(-2.0..2.0),
                };
                for _ in 0..20 {
                    contacts += usize::from(sim.step(command, DT_S).in_contact);
                    let pose = sim.state().pose;
                    let checker = if kind == SimulatorKind::Kinematic { &obstacles } else { &inner };
                    assert!(
                        checker.checker().is_free(pose),
                        "{} {kind} is inside a wall: {pose:?}",
                        robot.name
                    );
                }
            }
            assert!(contacts > 0, "{} {kind} never met a wall", robot.name);
        }
    }
}

#[test]
fn both_robots_reach_eight_waypoints() {
    let corners = [(2.0, 0.0), (2.0, 2.0), (0.0, 2.0), (0.0, 0.0)];
    for kind in KINDS {
        for robot in [RobotModel::husky(), RobotModel::limo()] {
            let mut vehicle = vehicle(kind, &plain(), robot, NoiseModel::none());
            vehicle.reset(RobotState::at_rest(Pose::new(0.0, 0.0, 0.0)), Seed(0), 0);
            for (x, y) in corners.into_iter().cycle().take(8) {
                let waypoint = Point::new(x, y);
                let away_m = |v: &Vehicle<Box<dyn Simulator>>| (v.state().pose.position - waypoint).norm();
                let actions = (0..40)
                    .take_while(|_| {
                        vehicle.act(waypoint);
                        away_m(&vehicle) > 0.15
                    })
                    .count();
                let name = &vehicle.robot().name;
                assert!(actions < 20, "{name} {kind} is {} m from {waypoint}", away_m(&vehicle));
            }
        }
    }
}

#[test]
fn the_distance_of_a_waypoint_asks_for_the_speed() {
    for robot in [RobotModel::husky(), RobotModel::limo()] {
        for reach_m in [0.1, 0.25, 0.5] {
            let mut vehicle = vehicle(SimulatorKind::Kinematic, &plain(), robot.clone(), NoiseModel::none());
            vehicle.reset(RobotState::at_rest(Pose::new(0.0, 0.0, 0.0)), Seed(0), 0);
            for _ in 0..6 {
                let ahead = vehicle.state().pose.to_world(Vector::new(reach_m, 0.0));
                vehicle.act(ahead);
            }
            let speed = vehicle.state().speed_mps();
            assert!((speed - reach_m / 0.5).abs() < 0.02, "{}: {speed} m/s for {reach_m} m", robot.name);
        }
    }
}

#[test]
fn a_waypoint_behind_turns_the_husky_in_place_and_the_limo_in_a_loop() {
    let behind = Point::new(-1.5, 0.1);
    let drive = |robot: RobotModel, actions: usize| {
        let mut vehicle = vehicle(SimulatorKind::Kinematic, &plain(), robot, NoiseModel::none());
        vehicle.reset(RobotState::at_rest(Pose::new(0.0, 0.0, 0.0)), Seed(0), 0);
        let path_m: f64 = (0..actions).map(|_| vehicle.act(behind).path_m).sum();
        (*vehicle.state(), path_m)
    };
    let (husky, path_m) = drive(RobotModel::husky(), 2);
    assert!(husky.pose.heading.radians() > FRAC_PI_2, "husky looks along {:?}", husky.pose.heading);
    assert!(path_m < 0.05, "husky moved {path_m} m while it turned");
    let (limo, path_m) = drive(RobotModel::limo(), 3);
    assert!(limo.pose.heading.radians() > FRAC_PI_2, "limo looks along {:?}", limo.pose.heading);
    assert!(path_m > 0.8, "limo moved {path_m} m only");
}

#[test]
fn robots_never_reverse_on_their_own() {
    for robot in [RobotModel::husky(), RobotModel::limo()] {
        let mut vehicle = vehicle(SimulatorKind::Kinematic, &plain(), robot, NoiseModel::harsh());
        let stream = &mut Seed(3).stream("waypoints", 0);
        for episode in 0..20 {
            vehicle.reset(RobotState::at_rest(Pose::new(0.0, 0.0, 0.0)), Seed(3), episode);
            for _ in 0..10 {
                let offset = Vector::new(stream.random_range(-0.5..0.5), stream.random_range(-0.5..0.5));
                let waypoint = vehicle.state().pose.position + offset;
                vehicle.act(waypoint);
                let wheels = vehicle.state().wheel_speed_mps;
                assert!(wheels >= 0.0, "{} rolls at {wheels} m/s", vehicle.robot().name);
            }
        }
    }
}

#[test]
fn backing_off_frees_a_robot_that_may_reverse() {
    let grid = walls(|x, _| x > 1.0);
    for kind in KINDS {
        for mut robot in [RobotModel::husky(), RobotModel::limo()] {
            let mut vehicle = vehicle(kind, &grid, robot.clone(), NoiseModel::none());
            vehicle.reset(RobotState::at_rest(Pose::new(-0.3, 0.0, 0.0)), Seed(0), 0);
            let hits = (0..10).filter(|_| vehicle.act(Point::new(3.0, 0.0)).contact).count();
            assert!(hits > 0, "{} {kind} never met the wall", robot.name);
            let report = vehicle.back_off(0.4);
            assert!(!report.contact, "{} {kind} still touches the wall", robot.name);
            let way_m = report.before.pose.position.x - report.after.pose.position.x;
            assert!((0.38..0.5).contains(&way_m), "{} {kind} backed off by {way_m} m", robot.name);

            robot.recovery_reverse_m = 0.0;
            let mut stubborn = self::vehicle(kind, &grid, robot, NoiseModel::none());
            let report = stubborn.back_off(0.4);
            assert_eq!((report.before, report.time_s), (report.after, 0.0), "one that never reverses stays");
        }
    }
}

#[test]
fn a_waypoint_that_is_no_number_stops_the_robot() {
    for robot in [RobotModel::husky(), RobotModel::limo()] {
        let mut vehicle = vehicle(SimulatorKind::Kinematic, &plain(), robot, NoiseModel::nominal());
        vehicle.reset(RobotState::rolling(Pose::new(0.0, 0.0, 0.0), 0.8), Seed(4), 0);
        for waypoint in [Point::new(f64::NAN, 0.0), Point::new(0.0, f64::INFINITY)] {
            vehicle.act(waypoint);
        }
        let state = vehicle.state();
        assert!(
            state.speed_mps().abs() < 1e-9 && state.pose.is_finite(),
            "{}: {state:?}",
            vehicle.robot().name
        );
    }
}

#[test]
fn a_contact_ends_the_action_unless_told_otherwise() {
    let grid = walls(|x, _| x > 1.0);
    let report = |stop_at_contact: bool| {
        let robot = RobotModel::limo();
        let sim = simulator(SimulatorKind::Kinematic, &grid, &robot);
        let settings = ActionSettings { stop_at_contact, ..ActionSettings::default() };
        let mut vehicle = Vehicle::new(sim, Arc::new(robot), NoiseModel::none(), settings);
        vehicle.reset(RobotState::rolling(Pose::new(0.7, 0.0, 0.0), 1.0), Seed(0), 0);
        vehicle.act(Point::new(2.0, 0.0))
    };
    let (short, long) = (report(true), report(false));
    assert!(short.contact && long.contact, "the wall is 14 cm ahead");
    assert!(short.time_s < 0.2, "stopped after {} s", short.time_s);
    assert!((long.time_s - 0.5).abs() < 1e-9, "held for {} s", long.time_s);
}

#[test]
fn delayed_commands_arrive_later() {
    let way_m = |delay_s: f64| {
        let noise = NoiseModel { delay_s, ..NoiseModel::none() };
        let mut vehicle = vehicle(SimulatorKind::Kinematic, &plain(), RobotModel::husky(), noise);
        vehicle.reset(RobotState::at_rest(Pose::new(0.0, 0.0, 0.0)), Seed(0), 0);
        (0..4).map(|_| vehicle.act(Point::new(5.0, 0.0)).path_m).sum::<f64>()
    };
    let lost_m = way_m(0.0) - way_m(0.1);
    assert!((lost_m - 0.1).abs() < 1e-6, "0.1 s at 1 m/s cost {lost_m} m");
}

/// Drives through the clutter under the worst noise and returns every state.
fn episode(vehicle: &mut Vehicle<Box<dyn Simulator>>, actions: u64) -> Vec<RobotState> {
    (0..actions)
        .map(|i| {
            let bearing = i as f64 * 2.4;
            let offset = Vector::new(trig::cos(bearing), trig::sin(bearing)) * 0.5 + Vector::new(0.4, 0.0);
            let waypoint = vehicle.state().pose.position + offset;
            vehicle.act(waypoint).after
        })
        .collect()
}

fn noisy(kind: SimulatorKind, robot: RobotModel) -> Vehicle<Box<dyn Simulator>> {
    let mut vehicle = vehicle(kind, &clutter(), robot, NoiseModel::biased());
    vehicle.reset(RobotState::at_rest(Pose::new(0.0, 0.0, 0.0)), Seed(5), 3);
    vehicle
}

#[test]
fn equal_seeds_give_equal_bits() {
    for kind in KINDS {
        for robot in [RobotModel::husky(), RobotModel::limo()] {
            let run = || episode(&mut noisy(kind, robot.clone()), 60);
            assert_eq!(run(), run(), "{} {kind}", robot.name);
            let mut used = noisy(kind, robot.clone());
            episode(&mut used, 7);
            used.reset(RobotState::at_rest(Pose::new(0.0, 0.0, 0.0)), Seed(5), 3);
            assert_eq!(episode(&mut used, 60), run(), "{} {kind} remembers what was before", robot.name);
        }
    }
}

#[test]
fn a_fork_continues_bit_for_bit() {
    for kind in KINDS {
        for robot in [RobotModel::husky(), RobotModel::limo()] {
            let mut original = noisy(kind, robot.clone());
            for _ in 0..6 {
                // Forked while it moves and while it touches walls.
                episode(&mut original, 9);
                let mut fork = original.clone();
                let expected = episode(&mut original.clone(), 30);
                let on_a_thread = std::thread::scope(|scope| {
                    scope.spawn(|| episode(&mut fork, 30)).join().expect("the thread does not panic")
                });
                assert_eq!(on_a_thread, expected, "{} {kind}", robot.name);
            }
        }
    }
}

#[test]
fn one_thread_and_two_give_equal_bits() {
    for kind in KINDS {
        let run = |number: u64| {
            let mut vehicle = noisy(kind, RobotModel::husky());
            vehicle.reset(RobotState::at_rest(Pose::new(0.0, 0.0, 0.0)), Seed(5), number);
            episode(&mut vehicle, 20)
        };
        let alone: Vec<_> = (0..8).map(run).collect();
        let by_two: Vec<_> = std::thread::scope(|scope| {
            let halves = [0..4, 4..8].map(|half| scope.spawn(|| half.map(run).collect::<Vec<_>>()));
            halves.into_iter().flat_map(|half| half.join().expect("the thread does not panic")).collect()
        });
        assert_eq!(alone, by_two, "{kind}");
    }
}

#[test]
fn a_snapshot_is_restored_bit_for_bit() {
    for kind in KINDS {
        for robot in [RobotModel::husky(), RobotModel::limo()] {
            let mut vehicle = noisy(kind, robot.clone());
            for taken in [3, 11, 40] {
                // Taken while it moves and while it touches walls; restored after another episode.
                episode(&mut vehicle, taken);
                let snapshot = vehicle.snapshot();
                let expected = episode(&mut vehicle, 30);
                vehicle.reset(RobotState::at_rest(Pose::new(0.0, 0.0, 0.0)), Seed(9), 4);
                episode(&mut vehicle, 7);
                vehicle.restore(&snapshot);
                assert_eq!(episode(&mut vehicle, 30), expected, "{} {kind} after {taken}", robot.name);
            }
        }
    }
}

#[test]
fn concrete_simulators_fit_the_vehicle_too() {
    fn moves<S: Simulator>(sim: S) -> bool {
        let settings = ActionSettings::default();
        let mut vehicle = Vehicle::new(sim, Arc::new(RobotModel::limo()), NoiseModel::nominal(), settings);
        vehicle.reset(RobotState::at_rest(Pose::new(0.0, 0.0, 0.0)), Seed(6), 0);
        vehicle.act(Point::new(0.5, 0.0)).path_m > 0.05
    }
    let limo = RobotModel::limo();
    let obstacles = Arc::new(ObstacleMap::new(&plain(), limo.footprint));
    assert!(moves(KinematicSim::new(obstacles.clone(), &limo)), "kinematic");
    assert!(moves(PlanarSim::new(obstacles, &limo)), "planar");
}
