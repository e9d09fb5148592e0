//! How long do the baselines plan before they drive: from room to room in furnished maps of 15 and
//! 75 m, cells of 0.1 m?

use std::time::Duration;

use criterion::{Criterion, criterion_group, criterion_main};
use rand::RngExt;
use sharp_bench::RoutePlanner;
use sharp_drive::World;
use sharp_maps::{FloorplanKind, generate};
use sharp_plan::Query;
use sharp_sim::RobotModel;
use sharp_space::{Point, Pose, Seed, Stream};

/// Problems of each map.
const QUERIES: usize = 10;

/// Two places where the robot can turn round, at least half a map apart.
fn query(world: &World, side_m: f64, stream: &mut Stream) -> Query {
    let room_m = world.robot.footprint.circumscribed_radius_m() + 0.2;
    let field = world.geometry.clearance();
    let mut place = || loop {
        let point = Point::new(stream.random_range(0.0..side_m), stream.random_range(0.0..side_m));
        if field.clearance_lower_bound(point) > room_m {
            return Pose::at(point, stream.random_range(-3.0..3.0).into());
        }
    };
    loop {
        let query = Query { start: place(), goal: place() };
        if query.start.distance_m(&query.goal) > 0.5 * side_m {
            return query;
        }
    }
}

fn routes(c: &mut Criterion) {
    for side_m in [15.0, 75.0] {
        for robot in [RobotModel::husky(), RobotModel::limo()] {
            let name = format!("route/{}/{side_m}m", robot.name);
            let stream = &mut Seed(1).stream("rooms", 0);
            let world = World::new(generate(FloorplanKind::FurnishedRooms, side_m, 0.1, stream), robot);
            let plan = |query: &Query| RoutePlanner::new(&world, query.goal).plan_from(query.start);
            let queries: Vec<Query> = (0..QUERIES).map(|_| query(&world, side_m, stream)).collect();
            let solved = queries.iter().filter(|query| plan(query).is_some()).count();
            assert!(2 * solved > QUERIES, "{name}: {solved} of {QUERIES} have a route");
            let mut next = queries.iter().cycle();
            c.bench_function(&name, |b| b.iter(|| next.next().map(plan)));
        }
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default()
        .sample_size(10)
        .warm_up_time(Duration::from_millis(300))
        .measurement_time(Duration::from_secs(3));
    targets = routes
}
criterion_main!(benches);
