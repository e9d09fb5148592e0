//! The maps that the benches and the comparison with other simulators drive on: cells of 0.1 m, the
//! world's origin in the middle, seven metres around it clear but for a slab to push against.

use rand::RngExt;
use sharp_maps::{FloorplanKind, generate};
use sharp_space::{Cell, GridFrame, Occupancy, OccupancyGrid, Pose, Seed};

/// Half the side of the clear square, metres.
const CLEAR_M: f64 = 3.5;
const RESOLUTION_M: f64 = 0.1;

/// Where the slab begins, metres to the right of the origin; it is a cell thick.
const SLAB_M: f64 = 3.3;
/// Half its length along y, metres.
const SLAB_HALF_M: f64 = 0.5;

/// The map called `name`: `free`, boxes that do not touch (`boxes_N`) or furnished rooms (`grid_SIDE`).
pub(crate) fn map(name: &str) -> Option<OccupancyGrid> {
    Some(match name {
        "free" => boxes(15.0, 0),
        "boxes_100" => boxes(15.0, 100),
        "boxes_1000" => boxes(30.0, 1_000),
        "boxes_10000" => boxes(75.0, 10_000),
        "grid_15" => rooms(15.0),
        "grid_75" => rooms(75.0),
        _ => return None,
    })
}

/// Boxes of 0.2 to 0.5 m, none beside another, so that merging cells gives exactly these.
fn boxes(side_m: f64, count: usize) -> OccupancyGrid {
    let frame = frame((side_m / RESOLUTION_M).round() as usize);
    let mut cells = vec![Occupancy::Free; frame.len()];
    let stream = &mut Seed(1).stream("boxes", 0);
    let mut placed = 0;
    while placed < count {
        let [width, height] = [0; 2].map(|_| stream.random_range(2..=5));
        let col = stream.random_range(1..frame.width - width);
        let row = stream.random_range(1..frame.height - height);
        let block = |margin: usize| {
            let cols = col - margin..(col + width + margin).min(frame.width);
            (row - margin..(row + height + margin).min(frame.height))
                .flat_map(move |row| cols.clone().map(move |col| Cell::new(col, row)))
        };
        let is_open = |cell: Cell| cells[frame.index(cell)] == Occupancy::Free && !is_clear(&frame, cell);
        if block(1).all(is_open) {
            block(0).for_each(|cell| cells[frame.index(cell)] = Occupancy::Occupied);
            placed += 1;
        }
    }
    let slab = (0..frame.len()).filter(|&index| is_slab(&frame, frame.cell(index)));
    slab.for_each(|index| cells[index] = Occupancy::Occupied);
    OccupancyGrid::new(frame, cells).expect("a sound grid")
}

fn rooms(side_m: f64) -> OccupancyGrid {
    let plan = generate(FloorplanKind::FurnishedRooms, side_m, RESOLUTION_M, &mut Seed(1).stream("rooms", 0));
    let frame = frame(plan.frame().width);
    let cells = plan.cells().iter().enumerate().map(|(index, &occupancy)| match frame.cell(index) {
        cell if is_slab(&frame, cell) => Occupancy::Occupied,
        cell if is_clear(&frame, cell) => Occupancy::Free,
        _ => occupancy,
    });
    OccupancyGrid::new(frame, cells.collect()).expect("a sound grid")
}

fn frame(side: usize) -> GridFrame {
    let corner_m = -(side as f64) * RESOLUTION_M / 2.0;
    let origin = Pose::new(corner_m, corner_m, 0.0);
    GridFrame { origin, resolution_m: RESOLUTION_M, width: side, height: side }
}

fn is_clear(frame: &GridFrame, cell: Cell) -> bool {
    let center = frame.center(cell);
    center.x.abs().max(center.y.abs()) < CLEAR_M
}

fn is_slab(frame: &GridFrame, cell: Cell) -> bool {
    let center = frame.center(cell);
    (SLAB_M..SLAB_M + RESOLUTION_M).contains(&center.x) && center.y.abs() < SLAB_HALF_M
}
