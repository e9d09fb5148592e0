//! Drawn problems for all baselines, and controllers that only a test would let drive.

use std::ops::ControlFlow;
use std::sync::Arc;

use rayon::ThreadPoolBuilder;
use sharp_drive::{
    Command, Controller, Decision, EpisodeEnd, Motion, MppiSettings, ProfiledFollower, Readiness, Supervisor,
    World,
};
use sharp_motion::{Budget, RrtSettings};
use sharp_plan::{Answer, Conditions, Method, Query, Sharp};
use sharp_rl::Progress;
use sharp_sim::{NoiseModel, RobotModel, RobotState, SimulatorKind};
use sharp_space::{
    Cell, Detection, DistanceField, Footprint, OccupancyGrid, Pose, Region, RegionDetector, RegionId, Seed,
};

use super::*;
use crate::conformance::check_contender;
use crate::contender::{ComparisonSettings, Composed, Contender, Driven, compare};

/// A hall of 10 by 4 m, 0.4 m a cell.
const HALL: &str = "
    #########################
    #.......................#
    #.......................#
    #.......................#
    #.......................#
    #.......................#
    #.......................#
    #.......................#
    #.......................#
    #########################";

/// A block with a corridor of 2 m all around.
const RING: &str = "
    #########################
    #.......................#
    #.......................#
    #.......................#
    #.......................#
    #.......................#
    #.....#############.....#
    #.....#############.....#
    #.....#############.....#
    #.......................#
    #.......................#
    #.......................#
    #.......................#
    #.......................#
    #########################";

/// Two rooms without a door.
const SEALED: &str = "
    #####################
    #.........#.........#
    #.........#.........#
    #.........#.........#
    #.........#.........#
    #.........#.........#
    #####################";

fn world(drawing: &str, robot: RobotModel) -> World {
    World::new(OccupancyGrid::from_ascii(0.4, drawing).expect("a sound drawing"), robot)
}

fn query(start: (f64, f64), goal: (f64, f64)) -> Query {
    Query { start: Pose::new(start.0, start.1, 0.0), goal: Pose::new(goal.0, goal.1, 0.0) }
}

fn settings(world: &World, noise: NoiseModel, contact_ends: bool) -> ComparisonSettings {
    let simulator = world.simulator(SimulatorKind::Kinematic);
    ComparisonSettings { episodes: 4, simulator, noise, contact_ends, seed: Seed(1) }
}

fn rrt<'a>(planner: &'a RoutePlanner<'a>, world: &'a World, query: Query, contact_ends: bool) -> Rrt<'a> {
    let settings = RrtSettings { budget: Budget { iterations: 3_000 }, ..RrtSettings::default() };
    Rrt { world, planner, query, settings, contact_ends, seed: Seed(2) }
}

/// Hands every system that plans to `check`, prepared for `query` under `noise`.
fn each_system(
    world: &World,
    query: Query,
    (noise, contact_ends): (&NoiseModel, bool),
    check: impl Fn(&str, &dyn Contender),
) {
    let planner = &RoutePlanner::new(world, query.goal);
    let route = planner.plan_from(query.start).expect("there is a way");
    let (robot, noise) = (&world.robot, noise.clone());
    let follower = ProfiledFollower::tuned(robot, &noise);
    let settings = MppiSettings { samples: 16, ..MppiSettings::new(robot, &noise) };
    let seed = Seed(3);
    let mpc = Mpc { world, planner, query, route: route.clone(), settings, noise: noise.clone(), seed };
    let track = Track { world, planner, query, route, follower, noise };
    let rrt = rrt(planner, world, query, contact_ends);
    let systems: [(&str, &dyn Contender); 3] = [("rrt", &rrt), ("track", &track), ("mppi", &mpc)];
    for (name, system) in systems {
        check(name, system);
    }
}

/// Lets every system that plans drive `query` and hands what came of it to `check`.
fn each_drives(
    world: &World,
    query: Query,
    settings: &ComparisonSettings,
    check: impl Fn(&str, Vec<Driven>),
) {
    each_system(world, query, (&settings.noise, settings.contact_ends), |name, system| {
        check(name, compare(system, world, &query, settings, &Supervisor::silent()));
    });
}

/// Finds one critical region at each end of the hall.
struct BothEnds;

impl RegionDetector for BothEnds {
    fn detect(&self, grid: &OccupancyGrid, _: &Footprint) -> Detection {
        let field = DistanceField::new(grid);
        let region = |id, col| Region::new(RegionId(id), vec![Cell::new(col, 5)], &field).expect("one cell");
        Detection::new(vec![region(0, 5), region(1, 19)], "ends")
    }
}

/// SHARP in the hall.
fn composed(world: &World, query: Query) -> Composed {
    let method = Method::prior().with_episodes(50, 50, 50);
    let answer = Sharp::new(world.clone(), BothEnds).with_method(method).solve(query, &()).expect("room");
    let Answer::Solved(plan) = answer else { panic!("{answer:?}") };
    Composed { plan: Arc::new(*plan), recovery: true }
}

#[test]
fn our_contenders_conform() {
    let world = world(HALL, RobotModel::husky());
    let query = query((1.0, 2.2), (9.0, 2.2));
    for contact_ends in [true, false] {
        each_system(&world, query, (&NoiseModel::nominal(), contact_ends), |name, system| {
            assert_eq!(check_contender(system, &world, &query), Ok(()), "{name}");
        });
    }
    assert_eq!(check_contender(&composed(&world, query), &world, &query), Ok(()), "sharp");
    let conditions = Conditions::new(&world, NoiseModel::nominal());
    let budget = SacBudget { max_env_steps: 200, horizon_s: 10.0 };
    let mut unwatched = |_: &Progress<'_>| ControlFlow::Continue(());
    let flat = FlatSac::learn(&world, query, (&conditions, Seed(1)), budget, &mut unwatched);
    let flat = flat.expect("a sound task");
    assert_eq!(check_contender(&flat, &world, &query), Ok(()), "sac");
}

#[test]
fn every_method_reaches_the_goal_of_a_ring_without_noise() {
    for robot in [RobotModel::husky(), RobotModel::limo()] {
        let world = world(RING, robot);
        let query = query((1.4, 4.6), (8.6, 1.4));
        each_drives(&world, query, &settings(&world, NoiseModel::none(), true), |name, driven| {
            let ends: Vec<_> = driven.iter().map(|one| one.end).collect();
            assert_eq!(ends, [EpisodeEnd::Reached; 4], "{name} with the {}", world.robot.name);
            assert!(driven.iter().all(|one| one.record.contacts == 0), "{name} touched a wall");
        });
    }
}

#[test]
fn one_thread_and_two_drive_alike() {
    let world = world(HALL, RobotModel::limo());
    let query = query((1.0, 2.2), (9.0, 2.2));
    let all = |threads: usize| {
        let pool = ThreadPoolBuilder::new().num_threads(threads).build().expect("a pool of threads");
        let told = std::sync::Mutex::new(Vec::new());
        pool.install(|| {
            each_drives(&world, query, &settings(&world, NoiseModel::harsh(), false), |name, driven| {
                let traces: Vec<_> = driven.into_iter().map(|one| (one.end, one.record.trace)).collect();
                told.lock().expect("no panic").push((name.to_owned(), traces));
            });
        });
        told.into_inner().expect("no panic")
    };
    let (one, two) = (all(1), all(2));
    assert_eq!(one, two, "threads changed what happened");
    assert_ne!(one[0].1[0], one[0].1[1], "two episodes met the same noise");
}

/// Drives straight ahead, plans anew with every decision, and backs off after each contact.
#[derive(Clone, Copy, Debug)]
struct Bull {
    nominal_time_s: f64,
    speed_mps: f64,
    bumped: bool,
}

impl Contender for Bull {
    fn controller(&self, _start: RobotState, _episode: u64) -> Box<dyn Controller + '_> {
        Box::new(*self)
    }
}

impl Controller for Bull {
    fn prepare(&mut self) -> Readiness {
        Readiness::Planned { nominal_time_s: self.nominal_time_s }
    }

    fn decide(&mut self) -> Decision {
        if std::mem::take(&mut self.bumped) {
            return Decision::BackOff { distance_m: 0.4 };
        }
        Decision::Drive(Command { reach_m: 0.5, bearing_rad: 0.0, speed_mps: self.speed_mps })
    }

    fn observe(&mut self, motion: &Motion) {
        self.bumped = motion.contact && motion.command.is_some();
    }
}

fn bull(speed_mps: f64, nominal_time_s: f64, contact_ends: bool) -> Driven {
    let world = world(HALL, RobotModel::husky());
    // Beside the goal and past it, into the wall.
    let query = query((7.0, 1.0), (9.0, 3.0));
    let settings = settings(&world, NoiseModel::none(), contact_ends);
    let bull = Bull { nominal_time_s, speed_mps, bumped: false };
    compare(&bull, &world, &query, &settings, &Supervisor::silent()).swap_remove(0)
}

#[test]
fn a_wall_ends_an_episode_or_is_bumped_into_again() {
    let ended = bull(1.0, 10.0, true);
    assert_eq!((ended.end, ended.record.contacts), (EpisodeEnd::Collided, 1), "the first contact is the end");
    let bumping = bull(1.0, 10.0, false);
    assert_eq!(bumping.end, EpisodeEnd::TimedOut, "a bull learns nothing");
    let contacts = bumping.record.contacts;
    assert!(contacts > 5, "it backs off and comes again: {contacts} contacts");
    assert!(bumping.record.path_m > ended.record.path_m, "the way back is part of the way");
}

#[test]
fn episodes_end_at_three_times_the_planned_time_but_not_before_a_minute() {
    for (nominal_time_s, expected_s) in [(10.0, 60.0), (30.0, 90.0)] {
        let driven = bull(0.0, nominal_time_s, true);
        assert_eq!(driven.end, EpisodeEnd::TimedOut, "it stands still");
        let time_s = driven.record.time_s;
        assert!((time_s - expected_s).abs() < 0.6, "{time_s} s, expected {expected_s}");
        let plans = driven.record.decisions_us.len() as u32;
        assert_eq!(driven.replans(), plans - 1, "every plan but the first counts");
    }
}

#[test]
fn no_way_is_said_and_not_driven() {
    let world = world(SEALED, RobotModel::husky());
    let query = query((2.0, 1.4), (6.4, 1.4));
    let planner = RoutePlanner::new(&world, query.goal);
    assert!(planner.plan_from(query.start).is_none(), "a route through a wall");
    for contact_ends in [true, false] {
        let rrt = rrt(&planner, &world, query, contact_ends);
        let mut controller = rrt.controller(RobotState::at_rest(query.start), 0);
        assert_eq!((controller.prepare(), controller.decide()), (Readiness::Ready, Decision::Lost));
        let settings = settings(&world, NoiseModel::none(), contact_ends);
        let driven = compare(&rrt, &world, &query, &settings, &Supervisor::silent());
        assert!(driven.iter().all(|one| one.end == EpisodeEnd::Lost), "contact ends: {contact_ends}");
        assert!(driven.iter().all(|one| one.record.path_m == 0.0), "nobody drove");
    }
}

#[test]
fn whoever_leaves_the_route_gets_a_new_one() {
    let world = world(HALL, RobotModel::husky());
    let query = query((1.0, 2.2), (9.0, 2.2));
    let planner = &RoutePlanner::new(&world, query.goal);
    let (follower, noise) = (ProfiledFollower::tuned(&world.robot, &NoiseModel::none()), NoiseModel::none());
    let route = planner.plan_from(query.start).expect("a hall");
    let track = Track { world: &world, planner, query, route, follower, noise };
    let mut controller = track.controller(RobotState::at_rest(query.start), 0);
    assert!(matches!(controller.prepare(), Readiness::Planned { .. }), "the first plan");
    let mut look = |x: f64, y: f64, contact| {
        let after = RobotState::at_rest(Pose::new(x, y, 0.0));
        controller.observe(&Motion { contact, ..Motion::commanded(Command::default(), after) });
        if contact {
            assert!(matches!(controller.decide(), Decision::BackOff { .. }), "first away from the wall");
        }
        controller.prepare()
    };
    for step in 1..8 {
        assert_eq!(look(1.0 + 0.2 * f64::from(step), 2.2, false), Readiness::Ready, "on the route");
    }
    assert!(matches!(look(3.0, 3.2, false), Readiness::Planned { .. }), "a metre beside it");
    assert!(matches!(look(3.2, 3.2, true), Readiness::Planned { .. }), "a wall in the way");
}
