//! How does the time for a diagram (growth, components, borders, portals) rise from a quarter of a
//! million to sixteen million cells?

use std::hint::black_box;

use criterion::{Criterion, criterion_group, criterion_main};
use sharp_rbvd::{CellMetric, Rbvd, RbvdSettings};
use sharp_space::{Cell, DistanceField, GridFrame, Pose, Region, RegionId};

/// Rooms of 100 x 100 cells with doors 24 cells wide, each door a region of 24 x 6 cells.
fn rooms(side: usize) -> (DistanceField, Vec<Region>) {
    let origin = Pose::new(0.0, 0.0, 0.0);
    let frame = GridFrame { origin, resolution_m: 0.067, width: side, height: side };
    let is_door = |along: usize| (38..62).contains(&(along % 100));
    let blocked = |index: usize| {
        let Cell { row, col } = frame.cell(index);
        (col % 100 < 4 && !is_door(row)) || (row % 100 < 4 && !is_door(col))
    };
    let field = DistanceField::from_mask(frame, blocked);
    let mut regions = Vec::new();
    for wall in (100..side).step_by(100) {
        for middle in (50..side).step_by(100) {
            for upright in [true, false] {
                let along = middle - 12..middle + 12;
                let cell = |a, b| if upright { Cell::new(b, a) } else { Cell::new(a, b) };
                let cells = along.flat_map(|a| (wall..wall + 6).map(move |b| cell(a, b))).collect();
                regions.extend(Region::new(RegionId(regions.len() as u32), cells, &field));
            }
        }
    }
    (field, regions)
}

fn rbvd_build(criterion: &mut Criterion) {
    for (name, side) in [("0.25m", 500), ("1m", 1000), ("4m", 2000), ("16m", 4000)] {
        let (field, regions) = rooms(side);
        for metric in [CellMetric::Geodesic, CellMetric::Euclidean] {
            let mut settings = RbvdSettings::default();
            (settings.metric, settings.min_clearance_m) = (metric, 0.4);
            let build = || Rbvd::build(&field, &regions, &settings).expect("the rooms have room");
            assert_eq!(build().len(), regions.len(), "a door's region got lost");
            assert_eq!(build().component_count(), 1, "the rooms are not connected");
            let label = format!("rbvd_build/{metric:?}/{name}").to_lowercase();
            criterion.bench_function(&label, |bencher| bencher.iter(|| black_box(build())));
        }
    }
}

criterion_group! {
    name = benches;
    config = Criterion::default().sample_size(10);
    targets = rbvd_build
}
criterion_main!(benches);
