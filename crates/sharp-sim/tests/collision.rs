//! The robot's collision test on a large map against itself without short cuts and against another
//! library's test of the same walls.

use parry2d::math::{Pose as EnginePose, Vector as EngineVector};
use parry2d::query::intersection_test;
use parry2d::shape::{Cuboid, SharedShape};
use rand::RngExt;
use sharp_sim::{ObstacleMap, RobotModel};
use sharp_space::{CollisionChecker, Footprint, FootprintChecker, OccupancyGrid, Pose, Seed, Stream};

#[path = "../benches/support/maps.rs"]
mod maps;

const POSES: usize = 200_000;

fn large_map() -> OccupancyGrid {
    maps::map("grid_75").expect("a map of the benches")
}

fn random_pose(grid: &OccupancyGrid, stream: &mut Stream) -> Pose {
    let half_m = grid.frame().width_m() / 2.0;
    let [x, y] = [(); 2].map(|()| stream.random_range(-half_m..half_m));
    Pose::new(x, y, stream.random_range(-4.0..4.0))
}

#[test]
fn short_cuts_miss_no_collision_among_200_000_poses() {
    let grid = large_map();
    for robot in [RobotModel::husky(), RobotModel::limo()] {
        let checker = FootprintChecker::new(&grid, robot.footprint);
        let stream = &mut Seed(1).stream("poses", 0);
        let mut free = 0;
        for _ in 0..POSES {
            let pose = random_pose(&grid, stream);
            let exact = checker.is_free_exact(pose);
            assert_eq!(checker.is_free(pose), exact, "{} at {pose:?}", robot.name);
            free += usize::from(exact);
        }
        assert!((POSES / 10..POSES * 9 / 10).contains(&free), "{}: {free} poses are free", robot.name);
    }
}

#[test]
fn the_engines_own_test_of_the_merged_walls_agrees() {
    let grid = large_map();
    let hair_m = 1e-4;
    for robot in [RobotModel::husky(), RobotModel::limo()] {
        let obstacles = ObstacleMap::new(&grid, robot.footprint);
        let walls = compound(&obstacles);
        // The engine computes in single precision: between a hair less and a hair more either
        // answer is right.
        let [thin, thick] = [-hair_m, hair_m].map(|hair_m| outline(&robot.footprint, hair_m));
        let stream = &mut Seed(2).stream("poses", 0);
        for _ in 0..POSES {
            let pose = random_pose(&grid, stream);
            let local = obstacles.frame().origin.to_local(pose.position);
            let place = EngineVector::new(local.x as f32, local.y as f32);
            let engine_pose = EnginePose::new(place, pose.heading.radians() as f32);
            let touches = |outline: &Cuboid| {
                intersection_test(&EnginePose::IDENTITY, &*walls, &engine_pose, outline)
                    .expect("compounds and boxes are supported")
                    .intersecting
            };
            if obstacles.checker().is_free(pose) {
                assert!(!touches(&thin), "{} at {pose:?} is called free", robot.name);
            } else {
                assert!(touches(&thick), "{} at {pose:?} is called blocked", robot.name);
            }
        }
    }
}

fn compound(obstacles: &ObstacleMap) -> SharedShape {
    let walls = obstacles.walls().map(|wall| {
        let center = EngineVector::new(wall.center.x as f32, wall.center.y as f32);
        let shape = SharedShape::cuboid(wall.half_extents.x as f32, wall.half_extents.y as f32);
        (EnginePose::new(center, 0.0), shape)
    });
    SharedShape::compound(walls.collect())
}

fn outline(footprint: &Footprint, hair_m: f64) -> Cuboid {
    let half = [footprint.half_length_m(), footprint.half_width_m()].map(|half_m| (half_m + hair_m) as f32);
    Cuboid::new(half.into())
}
