//! Robots of any shape, from their files to driven runs. Whether a run touched anything is decided once more, by a
//! checker that shares no code with the planner.

use std::path::PathBuf;
use std::sync::Arc;

use sharp_drive::{EpisodeEnd, World};
use sharp_maps::{LoadOptions, load};
use sharp_plan::{Answer, Method, Query, RunSettings, Sharp, run};
use sharp_regions::GeometricDetector;
use sharp_sim::RobotModel;
use sharp_space::{OccupancyGrid, Pose, Seed};

use crate::checker::{Outline, deepest_m};
use crate::worlds::ROOMS;

const TRACTOR: &[(f64, f64)] = &[(0.55, 0.0), (0.4, 0.25), (-0.12, 0.25), (-0.12, -0.25), (0.4, -0.25)];

fn tractor() -> (RobotModel, Outline) {
    let corners: Vec<String> = TRACTOR.iter().rev().map(|(x, y)| format!("[{x}, {y}]")).collect();
    let text =
        format!("(footprint: \"[{}]\", drive: Differential(), max_speed_mps: 0.8)", corners.join(", "));
    (RobotModel::from_ron_named(&text, "tractor").expect("a robot"), Outline::Corners(TRACTOR.to_vec()))
}

fn burger() -> (RobotModel, Outline) {
    (RobotModel::built_in("TurtleBot3").expect("built in"), Outline::Disc(0.105))
}

/// Solves, drives, and looks at every pose of every run that was counted as a success.
fn check(grid: OccupancyGrid, (robot, outline): (RobotModel, Outline), from: Pose, to: Pose) {
    let name = robot.name.clone();
    let world = World::new(grid.clone(), robot);
    let method = Method::fast().with_episodes(200, 200, 200);
    let mut sharp = Sharp::new(world, GeometricDetector::default()).with_method(method);
    let answer = sharp.solve(Query { start: from, goal: to }, &()).expect("nothing is written");
    let Answer::Solved(plan) = answer else { panic!("{name}: {answer:?}") };
    let plan = Arc::new(*plan);
    for step in &plan.solution.steps {
        for &pose in step.option.guide.poses() {
            let deepest_m = deepest_m(&grid, &outline, pose);
            assert!(deepest_m <= 1e-9, "{name}: the guide overlaps a cell by {deepest_m} m at {pose:?}");
        }
    }
    let runs = run(&plan, &RunSettings::new(&plan, 40, Seed(5)), &|| 0.0);
    let reached: Vec<_> = runs.iter().filter(|run| run.end == EpisodeEnd::Reached).collect();
    assert!(reached.len() >= 36, "{name}: {} of 40 runs arrive", reached.len());
    for run in reached {
        assert_eq!(run.record.contacts, 0, "{name}: a success without contact");
        for &pose in &run.record.trace {
            let deepest_m = deepest_m(&grid, &outline, pose);
            assert!(deepest_m <= 1e-9, "{name}: a run overlaps a cell by {deepest_m} m at {pose:?}");
        }
    }
}

#[test]
fn a_round_robot_and_one_with_a_nose_never_touch_a_wall_that_they_pass() {
    let drawing: String = ROOMS.chars().map(|c| if c.is_ascii_digit() { '.' } else { c }).collect();
    let grid = OccupancyGrid::from_ascii(0.2, &drawing).expect("a sound drawing");
    for robot in [burger(), tractor()] {
        check(grid.clone(), robot, Pose::new(1.0, 2.8, 1.57), Pose::new(6.6, 0.8, 0.0));
    }
}

#[test]
#[expect(
    clippy::disallowed_methods,
    reason = "real maps lie outside the repository, and the caller says where"
)]
fn real_maps_are_crossed_by_robots_of_any_shape() {
    let Some(folder) = std::env::var_os("SHARP_REAL_MAPS").map(PathBuf::from) else {
        println!("skipped: SHARP_REAL_MAPS names no folder of real maps");
        return;
    };
    let real = |file: &str| {
        let path = folder.join(file);
        load(path.to_str().expect("printable"), &LoadOptions::default()).expect("a real map").grid
    };
    check(real("turtlebot3/map.yaml"), burger(), Pose::new(-2.0, -0.5, 0.0), Pose::new(1.8, 0.5, 0.0));
    let house = real("aws_small_house/map.yaml");
    check(house.clone(), tractor(), Pose::new(-7.0, -3.0, 0.0), Pose::new(7.0, -1.0, 0.0));
    check(house, burger(), Pose::new(-7.0, -3.0, 0.0), Pose::new(7.0, -1.0, 0.0));
    let world = real("nav2/smoothers_world.yaml");
    check(world, tractor(), Pose::new(1.5, 1.0, 0.0), Pose::new(13.8, 13.0, 0.0));
}
