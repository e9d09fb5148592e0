//! How long do regions take: by geometry from a quarter of a million to sixteen million cells, by
//! the network on a map of each of the paper's sizes?

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use sharp_maps::{FloorplanKind, generate};
use sharp_regions::{GeometricSettings, RegionPredictor, RegionSettings, detect_geometric, predict_regions};
use sharp_space::{DistanceField, Footprint, GridFrame, OccupancyGrid, Pose, Seed};

fn husky() -> Footprint {
    Footprint::rectangle(0.5, 0.335).expect("a sound footprint")
}

/// Rooms of 6 m with doors of 1.2 m, `side` cells of 0.05 m wide and high.
fn rooms(side: usize) -> DistanceField {
    let frame = GridFrame { origin: Pose::new(0.0, 0.0, 0.0), resolution_m: 0.05, width: side, height: side };
    let is_door = |along: usize| (48..72).contains(&(along % 120));
    let is_wall = |across: usize, along: usize| across % 120 < 3 && !is_door(along);
    DistanceField::from_mask(frame, |index| {
        let cell = frame.cell(index);
        is_wall(cell.col, cell.row) || is_wall(cell.row, cell.col)
    })
}

fn geometric(criterion: &mut Criterion) {
    for (name, side) in [("0.25m", 500), ("1m", 1000), ("4m", 2000), ("16m", 4000)] {
        let field = rooms(side);
        let detect = || detect_geometric(&field, &husky(), &GeometricSettings::default());
        let rooms = side / 120;
        let doors = 2 * rooms * (rooms - 1);
        let found = detect().len();
        assert!(found >= doors, "{found} regions for at least {doors} doors on {name}");
        criterion.bench_function(&format!("geometric/{name}"), |bencher| {
            bencher.iter(|| black_box(detect()));
        });
    }
}

fn network(criterion: &mut Criterion) {
    let predictor = RegionPredictor::shipped("husky").expect("the network is shipped");
    for (name, size_m, resolution_m) in [("15m", 15.0, 0.05), ("75m", 75.0, 0.1)] {
        let mut rng = Seed(1).stream("bench", 0);
        let grid: OccupancyGrid = generate(FloorplanKind::Rooms, size_m, resolution_m, &mut rng);
        let predict = || predict_regions(&grid, &husky(), &predictor, &RegionSettings::default());
        assert!(!predict().regions.is_empty(), "no regions on {name}");
        criterion.bench_function(&format!("network/{name}"), |bencher| {
            bencher.iter(|| black_box(predict()));
        });
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(10);
    targets = geometric, network
}
criterion_main!(benches);
