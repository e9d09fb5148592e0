//! Drawn problems for all baselines, and pilots that only a test would let drive.

use rayon::ThreadPoolBuilder;
use sharp_motion::{Budget, RrtSettings};
use sharp_sim::{NoiseModel, RobotModel, RobotState, SimulatorKind};
use sharp_space::{OccupancyGrid, Pose, Seed};

use super::*;
use crate::drawn::{HALL, RING, SEALED};
use crate::pace::ProfiledFollower;

const SILENT: Host<'static> = Host { clock_us: &|| 0.0, stop: &|| false };

fn world(drawing: &str, robot: RobotModel) -> World {
    let plain: String = drawing.chars().map(|c| if c.is_ascii_digit() { '.' } else { c }).collect();
    World::new(OccupancyGrid::from_ascii(0.4, &plain).expect("a sound drawing"), robot)
}

fn query(start: (f64, f64), goal: (f64, f64)) -> Query {
    Query { start: Pose::new(start.0, start.1, 0.0), goal: Pose::new(goal.0, goal.1, 0.0) }
}

fn settings(noise: NoiseModel, contact_ends: bool) -> ComparisonSettings {
    let (episodes, simulator, seed) = (4, SimulatorKind::Kinematic, Seed(1));
    ComparisonSettings { episodes, simulator, noise, contact_ends, seed }
}

fn rrt<'a>(world: &'a World, planner: &'a RoutePlanner<'a>, query: Query) -> Rrt<'a> {
    let settings = RrtSettings { budget: Budget { iterations: 3_000 }, ..RrtSettings::default() };
    Rrt { world, planner, query, settings, seed: Seed(2) }
}

/// Lets every method that plans drive `query` and hands what came of it to `check`.
fn each_drives(
    world: &World,
    query: Query,
    settings: &ComparisonSettings,
    check: impl Fn(&str, Vec<Driven>),
) {
    let planner = RoutePlanner::new(world);
    let route = planner.plan(&query).expect("there is a way");
    let (robot, noise) = (&world.robot, &settings.noise);
    let track = Track {
        world,
        planner: &planner,
        query,
        route: route.clone(),
        settings: ProfiledFollower::tuned(robot, noise),
        noise: noise.clone(),
    };
    let mppi = Mppi {
        world,
        planner: &planner,
        query,
        route,
        settings: MppiSettings { samples: 16, ..MppiSettings::new(robot, noise) },
        noise: noise.clone(),
        seed: Seed(3),
    };
    let rrt = rrt(world, &planner, query);
    let methods: [(&str, &dyn Baseline); 3] = [("rrt", &rrt), ("track", &track), ("mppi", &mppi)];
    for (name, method) in methods {
        check(name, compare(method, world, &query, settings, &SILENT));
    }
}

#[test]
fn every_method_reaches_the_goal_of_a_ring_without_noise() {
    for robot in [RobotModel::husky(), RobotModel::limo()] {
        let world = world(RING, robot);
        let query = query((1.4, 4.6), (8.6, 1.4));
        each_drives(&world, query, &settings(NoiseModel::none(), true), |name, driven| {
            let ends: Vec<_> = driven.iter().map(|one| one.episode.end).collect();
            assert_eq!(ends, [EpisodeEnd::Reached; 4], "{name} with the {}", world.robot.name);
            assert!(driven.iter().all(|one| one.episode.contacts == 0), "{name} touched a wall");
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
            each_drives(&world, query, &settings(NoiseModel::harsh(), false), |name, driven| {
                let traces: Vec<_> =
                    driven.into_iter().map(|one| (one.episode.end, one.episode.trace)).collect();
                told.lock().expect("no panic").push((name.to_owned(), traces));
            });
        });
        told.into_inner().expect("no panic")
    };
    let (one, two) = (all(1), all(2));
    assert_eq!(one, two, "threads changed what happened");
    assert_ne!(one[0].1[0], one[0].1[1], "two episodes met the same noise");
}

/// Drives straight ahead and plans anew with every decision.
struct Bull {
    nominal_time_s: f64,
    speed_mps: f64,
}

impl Baseline for Bull {
    fn pilot(&self, _episode: u64) -> Box<dyn Pilot + '_> {
        Box::new(Self { ..*self })
    }
}

impl Pilot for Bull {
    fn prepare(&mut self, _situation: &Situation) -> Readiness {
        Readiness::Planned { nominal_time_s: self.nominal_time_s }
    }

    fn decide(&mut self, _state: &RobotState) -> Command {
        Command { reach_m: 0.5, bearing_rad: 0.0, speed_mps: self.speed_mps }
    }
}

fn bull(speed_mps: f64, nominal_time_s: f64, contact_ends: bool) -> Episode {
    let world = world(HALL, RobotModel::husky());
    // Beside the goal and past it, into the wall.
    let query = query((7.0, 1.0), (9.0, 3.0));
    let settings = settings(NoiseModel::none(), contact_ends);
    let mut driven = compare(&Bull { nominal_time_s, speed_mps }, &world, &query, &settings, &SILENT);
    driven.swap_remove(0).episode
}

#[test]
fn a_wall_ends_an_episode_or_is_bumped_into_again() {
    let ended = bull(1.0, 10.0, true);
    assert_eq!((ended.end, ended.contacts), (EpisodeEnd::Collided, 1), "the first contact is the end");
    let bumping = bull(1.0, 10.0, false);
    assert_eq!(bumping.end, EpisodeEnd::TimedOut, "a bull learns nothing");
    assert!(bumping.contacts > 5, "it backs off and comes again: {} contacts", bumping.contacts);
    assert!(bumping.path_m > ended.path_m, "the way back is part of the way");
}

#[test]
fn episodes_end_at_three_times_the_planned_time_but_not_before_a_minute() {
    for (nominal_time_s, expected_s) in [(10.0, 60.0), (30.0, 90.0)] {
        let episode = bull(0.0, nominal_time_s, true);
        assert_eq!(episode.end, EpisodeEnd::TimedOut, "it stands still");
        assert!((episode.time_s - expected_s).abs() < 0.6, "{} s, expected {expected_s}", episode.time_s);
        let plans = episode.decisions_us.len() as u32;
        assert_eq!(episode.events.recoveries, plans - 1, "every plan but the first counts");
    }
}

#[test]
fn no_way_is_said_and_not_driven() {
    let world = world(SEALED, RobotModel::husky());
    let query = query((2.0, 1.4), (6.4, 1.4));
    let planner = RoutePlanner::new(&world);
    assert!(planner.plan(&query).is_none(), "a route through a wall");
    let rrt = rrt(&world, &planner, query);
    let state = RobotState::at_rest(query.start);
    let readiness = rrt.pilot(0).prepare(&Situation { state, bumped: false });
    assert_eq!(readiness, Readiness::NoWay);
    for contact_ends in [true, false] {
        let driven = compare(&rrt, &world, &query, &settings(NoiseModel::none(), contact_ends), &SILENT);
        assert!(driven.iter().all(|one| one.episode.end == EpisodeEnd::Lost), "contact ends: {contact_ends}");
    }
}

#[test]
fn whoever_leaves_the_route_gets_a_new_one() {
    let world = world(HALL, RobotModel::husky());
    let query = query((1.0, 2.2), (9.0, 2.2));
    let planner = RoutePlanner::new(&world);
    let (settings, noise) = (ProfiledFollower::tuned(&world.robot, &NoiseModel::none()), NoiseModel::none());
    let route = planner.plan(&query).expect("a hall");
    let track = Track { world: &world, planner: &planner, query, route, settings, noise };
    let mut pilot = track.pilot(0);
    let mut look = |x: f64, y: f64, bumped| {
        pilot.prepare(&Situation { state: RobotState::at_rest(Pose::new(x, y, 0.0)), bumped })
    };
    assert!(matches!(look(1.0, 2.2, false), Readiness::Planned { .. }), "the first plan");
    for step in 1..8 {
        assert_eq!(look(1.0 + 0.2 * f64::from(step), 2.2, false), Readiness::Ready, "on the route");
    }
    assert!(matches!(look(3.0, 3.2, false), Readiness::Planned { .. }), "a metre beside it");
    assert!(matches!(look(3.2, 3.2, true), Readiness::Planned { .. }), "a wall in the way");
}
