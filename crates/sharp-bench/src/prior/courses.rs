//! Generated maps and the routes that are driven in them.

use rand::RngExt;
use rayon::prelude::*;
use sharp_drive::World;
use sharp_maps::{FloorplanKind, generate};
use sharp_options::OptionKind;
use sharp_plan::{Abstraction, AbstractionSettings, Query, TrainingRoute, construct, training_routes};
use sharp_regions::GeometricDetector;
use sharp_sim::RobotModel;
use sharp_space::{GridFrame, OccupancyGrid, Pose, Seed, Stream};

/// Side of the maps, metres.
const MAP_M: f64 = 15.0;
/// Cell of the maps, metres.
const CELL_M: f64 = 0.05;
/// A small robot also sees maps shrunk by this: corridors as tight for it as for a large one.
const SHRUNK: f64 = 0.55;
/// Problems drawn in each map.
const QUERIES: u64 = 6;
/// The shortest problem worth planning, metres.
const QUERY_MIN_M: f64 = 5.0;

/// Kinds of map that scores are taken on and no prior is trained on.
pub const HELD_OUT: [FloorplanKind; 4] = [
    FloorplanKind::FurnishedRooms,
    FloorplanKind::RingCorridor,
    FloorplanKind::OffsetWalls,
    FloorplanKind::RoomGrid,
];

/// Which maps routes are planned in.
#[derive(Clone, Debug)]
pub struct PriorCourses {
    robot: RobotModel,
    kinds: Vec<FloorplanKind>,
    seed: Seed,
}

impl PriorCourses {
    /// Maps of the kinds that priors are trained on.
    #[must_use]
    pub fn training(robot: &RobotModel, seed: Seed) -> Self {
        let kinds = FloorplanKind::ALL.into_iter().filter(|kind| !HELD_OUT.contains(kind)).collect();
        Self { robot: robot.clone(), kinds, seed: seed.child("prior", 0) }
    }

    /// Maps of the kinds that scores are taken on.
    #[must_use]
    pub fn held_out(robot: &RobotModel, seed: Seed) -> Self {
        Self { robot: robot.clone(), kinds: HELD_OUT.to_vec(), seed: seed.child("prior score", 0) }
    }

    /// The routes in the first `map_count` maps; `on_map` is called after each.
    #[must_use]
    pub fn routes(&self, map_count: u32, on_map: &(dyn Fn() + Sync)) -> Vec<TrainingRoute> {
        let of_map = |index| {
            let routes = self.routes_of(index);
            on_map();
            routes
        };
        let all: Vec<_> = (0..map_count).into_par_iter().map(of_map).collect();
        all.into_iter().flatten().collect()
    }

    /// The routes in one map; none where no region was found.
    fn routes_of(&self, index: u32) -> Vec<TrainingRoute> {
        let (robot, kinds) = (&self.robot, &self.kinds);
        let map_seed = self.seed.child("map", u64::from(index));
        let rng = &mut map_seed.stream("draw", 0);
        let mut grid = generate(kinds[index as usize % kinds.len()], MAP_M, CELL_M, rng);
        if !robot.can_turn_in_place() && (index as usize / kinds.len()).is_multiple_of(2) {
            grid = shrunk(&grid);
        }
        let world = World::new(grid, robot.clone());
        let kind = if index.is_multiple_of(2) { OptionKind::Interface } else { OptionKind::Centroid };
        let Some(abstraction) = abstraction(&world, kind) else { return vec![] };
        let queries: Vec<Query> = (0..QUERIES).filter_map(|_| query(&world, rng)).collect();
        training_routes(&world, &abstraction, &queries, map_seed)
    }
}

fn shrunk(grid: &OccupancyGrid) -> OccupancyGrid {
    let frame = GridFrame { resolution_m: SHRUNK * grid.frame().resolution_m, ..*grid.frame() };
    OccupancyGrid::new(frame, grid.cells().to_vec()).expect("as many cells as before")
}

fn abstraction(world: &World, kind: OptionKind) -> Option<Abstraction> {
    let detector = GeometricDetector::default();
    let family = kind.family().expect("one of ours");
    construct(world, &detector, family, &AbstractionSettings::new(world), &()).ok().map(|built| built.0)
}

/// A problem with room at both ends.
fn query(world: &World, rng: &mut Stream) -> Option<Query> {
    let start = place(world, rng)?;
    let goal = place(world, rng)?;
    (start.distance_m(&goal) >= QUERY_MIN_M).then_some(Query { start, goal })
}

fn place(world: &World, rng: &mut Stream) -> Option<Pose> {
    let bounds = world.grid.frame().bounds();
    let room_m = world.robot.footprint.circumscribed_radius_m() + 0.05;
    for _ in 0..1000 {
        let x = rng.random_range(bounds.min.x..bounds.max.x);
        let y = rng.random_range(bounds.min.y..bounds.max.y);
        let pose = Pose::new(x, y, rng.random_range(-std::f64::consts::PI..std::f64::consts::PI));
        if world.geometry.clearance().sample(pose.position) > room_m {
            return Some(pose);
        }
    }
    None
}
