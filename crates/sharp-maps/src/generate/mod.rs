//! Seeded generator of indoor maps for training, tests and benches.
//!
//! The plans have the statistics of the paper's environments (doors of 1.0 to 1.8 m, corridors of
//! 1.1 to 2.1 m, walls of 0.1 to 0.25 m, a closed border) and are all our own. Equal arguments and
//! equal streams give equal maps.

mod blueprint;
mod corridors;
mod lattice;
mod mazes;
mod obstacles;
mod rooms;
mod sizes;
mod walls;

use rand::RngExt;
use serde::{Deserialize, Serialize};
use sharp_space::{Cell, DistanceField, GridFrame, OccupancyGrid, Stream};

use self::blueprint::Blueprint;
pub use self::blueprint::turned_from;
use self::corridors::{bent_corridor, comb, cross_corridors, ring_corridor, rooms_and_corridor};
use self::mazes::{maze, spiral};
use self::obstacles::{bricks, clutter, islands, pillars};
use self::rooms::{divide, room_grid, rooms_and_clutter};
use self::walls::{channel, funnels, offset_walls, slanted, walls_with_doors};

/// What a plan is built of.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
#[non_exhaustive]
pub enum FloorplanKind {
    /// One wall across with one door.
    Gap,
    /// One wall across with two or three doors.
    Gaps,
    /// Parallel walls, each with a door of its own.
    Screens,
    /// Parallel walls, attached to one side and the other in turn.
    OffsetWalls,
    /// Free-standing bricks in staggered rows.
    Bricks,
    /// Bays along an open aisle.
    Comb,
    /// A maze of wide passages with a few loops.
    Maze,
    /// Rooms by recursive division.
    Rooms,
    /// Rooms by recursive division, furnished.
    FurnishedRooms,
    /// Rooms on both sides of one corridor.
    RoomsAndCorridor,
    /// Rooms around corridors that cross.
    CrossCorridors,
    /// A block of rooms inside a ring corridor.
    RingCorridor,
    /// A regular grid of rooms with doors between some neighbours.
    RoomGrid,
    /// Boxes of all sizes at random.
    Clutter,
    /// A hall with pillars.
    Pillars,
    /// A hall with round islands.
    Islands,
    /// A corridor that winds inwards.
    Spiral,
    /// Slanted walls with doors.
    Slanted,
    /// Two halls joined by a long narrow channel.
    Channel,
    /// Two halls joined by funnels.
    Funnels,
    /// Rooms on one half, clutter on the other.
    RoomsAndClutter,
    /// A corridor with bends and rooms outside them.
    BentCorridor,
}

impl FloorplanKind {
    /// Every kind, in order of declaration.
    pub const ALL: [Self; 22] = [
        Self::Gap,
        Self::Gaps,
        Self::Screens,
        Self::OffsetWalls,
        Self::Bricks,
        Self::Comb,
        Self::Maze,
        Self::Rooms,
        Self::FurnishedRooms,
        Self::RoomsAndCorridor,
        Self::CrossCorridors,
        Self::RingCorridor,
        Self::RoomGrid,
        Self::Clutter,
        Self::Pillars,
        Self::Islands,
        Self::Spiral,
        Self::Slanted,
        Self::Channel,
        Self::Funnels,
        Self::RoomsAndClutter,
        Self::BentCorridor,
    ];
}

/// The clearance at which the main part of a plan is connected, metres: half the width of a Husky and 8 cm,
/// so that it has room to steer.
const CLEARANCE_TO_PASS_M: f64 = 0.42;

/// Share of the passable area that must be connected.
const CONNECTED_SHARE: f64 = 0.8;

/// The least side of a map, metres. A corridor around a block, with rooms inside and outside, needs this much.
const SIDE_MIN_M: f64 = 14.0;

/// A square map of `kind`, `size_m` metres wide, turned and mirrored at random.
///
/// At least four fifths of the area that a Husky (1.0 m by 0.67 m) can reach at all are connected.
///
/// # Panics
/// If the map would have fewer than 40 or more than 32 767 cells a side, or is under 14 m wide.
#[must_use]
pub fn generate(kind: FloorplanKind, size_m: f64, resolution_m: f64, rng: &mut Stream) -> OccupancyGrid {
    assert!(size_m >= SIDE_MIN_M, "a floor plan of {size_m} m is too small, it needs {SIDE_MIN_M} m");
    let side = (size_m / resolution_m).round();
    assert!((40.0..=32_767.0).contains(&side), "a floor plan {side} cells wide");
    // Nearly every draw is connected. If none of these is, the result is an empty hall.
    const ATTEMPTS: usize = 40;
    let (border, side) = (rng.random_range(0.1..=0.25), side as usize);
    for _ in 0..ATTEMPTS {
        let mut plan = Blueprint::new(side, resolution_m, border);
        draw(kind, &mut plan, rng);
        let grid = plan.into_grid(rng.random_range(0..8));
        if is_connected(&grid) {
            return grid;
        }
    }
    Blueprint::new(side, resolution_m, border).into_grid(0)
}

fn draw(kind: FloorplanKind, plan: &mut Blueprint, rng: &mut Stream) {
    let all = plan.inside();
    match kind {
        FloorplanKind::Gap => walls_with_doors(plan, rng, 1, 1..=1),
        FloorplanKind::Gaps => walls_with_doors(plan, rng, 1, 2..=3),
        FloorplanKind::Screens => walls_with_doors(plan, rng, 4, 1..=2),
        FloorplanKind::OffsetWalls => offset_walls(plan, rng),
        FloorplanKind::Bricks => bricks(plan, rng),
        FloorplanKind::Comb => comb(plan, rng),
        FloorplanKind::Maze => maze(plan, rng),
        FloorplanKind::Rooms => divide(plan, rng, all, 4),
        FloorplanKind::FurnishedRooms => {
            divide(plan, rng, all, 3);
            clutter(plan, rng, all, 0.05, 0.4..=1.0);
        }
        FloorplanKind::RoomsAndCorridor => rooms_and_corridor(plan, rng),
        FloorplanKind::CrossCorridors => cross_corridors(plan, rng),
        FloorplanKind::RingCorridor => ring_corridor(plan, rng),
        FloorplanKind::RoomGrid => room_grid(plan, rng),
        FloorplanKind::Clutter => clutter(plan, rng, all, 0.2, 0.4..=2.5),
        FloorplanKind::Pillars => pillars(plan, rng),
        FloorplanKind::Islands => islands(plan, rng),
        FloorplanKind::Spiral => spiral(plan, rng),
        FloorplanKind::Slanted => slanted(plan, rng),
        FloorplanKind::Channel => channel(plan, rng),
        FloorplanKind::Funnels => funnels(plan, rng),
        FloorplanKind::RoomsAndClutter => rooms_and_clutter(plan, rng),
        FloorplanKind::BentCorridor => bent_corridor(plan, rng),
    }
}

/// Returns true if the largest passable part holds [`CONNECTED_SHARE`] of all passable cells.
fn is_connected(grid: &OccupancyGrid) -> bool {
    let clearance = DistanceField::new(grid);
    let frame = grid.frame();
    let mut open: Vec<bool> =
        (0..frame.len()).map(|i| clearance.at(frame.cell(i)) >= CLEARANCE_TO_PASS_M).collect();
    let total = open.iter().filter(|&&cell| cell).count();
    let mut largest = 0;
    for seed in 0..frame.len() {
        if std::mem::take(&mut open[seed]) {
            largest = largest.max(flood(frame, &mut open, frame.cell(seed)));
        }
    }
    total > 0 && largest as f64 >= CONNECTED_SHARE * total as f64
}

/// Takes the open cells connected to `seed` away and counts them.
fn flood(frame: &GridFrame, open: &mut [bool], seed: Cell) -> usize {
    let mut stack = vec![seed];
    let mut count = 0;
    while let Some(cell) = stack.pop() {
        count += 1;
        for next in frame.neighbors4(cell) {
            if std::mem::take(&mut open[frame.index(next)]) {
                stack.push(next);
            }
        }
    }
    count
}

#[cfg(test)]
mod tests {
    use sharp_space::{Occupancy, Seed};

    use super::*;

    fn map(kind: FloorplanKind, seed: u64) -> OccupancyGrid {
        generate(kind, 15.0, 0.1, &mut Seed(seed).stream("floorplan", kind as u64))
    }

    /// Whether a cell is occupied that is further than `border` cells from the edge; an empty hall has none.
    fn has_walls_inside(grid: &OccupancyGrid, border: usize) -> bool {
        let inner = border..grid.frame().width - border;
        inner.clone().any(|row| inner.clone().any(|col| !grid.is_free(Cell::new(col, row))))
    }

    #[test]
    fn every_kind_is_connected_walled_and_not_empty() {
        for kind in FloorplanKind::ALL {
            for seed in 0..4 {
                let grid = map(kind, seed);
                let side = grid.frame().width;
                let share = grid.free_count() as f64 / grid.frame().len() as f64;
                assert!(is_connected(&grid), "{kind:?} {seed} is in pieces");
                assert!(share > 0.3, "{kind:?} {seed}: only {share} of the cells are free");
                assert!(has_walls_inside(&grid, 10), "{kind:?} {seed}: no draw was connected");
                let border_closed = (0..side).all(|i| {
                    [(i, 0), (i, side - 1), (0, i), (side - 1, i)]
                        .iter()
                        .all(|&(col, row)| !grid.is_free(Cell::new(col, row)))
                });
                assert!(border_closed, "{kind:?} {seed} has a hole in its border");
            }
        }
    }

    #[test]
    fn every_kind_has_room_in_the_smallest_map() {
        for kind in FloorplanKind::ALL {
            let count = if kind == FloorplanKind::RingCorridor { 300 } else { 10 };
            for seed in 0..count {
                let grid = generate(kind, SIDE_MIN_M, 0.2, &mut Seed(seed).stream("small", kind as u64));
                assert!(has_walls_inside(&grid, 5), "{kind:?} {seed}: no draw was connected");
            }
        }
    }

    #[test]
    fn equal_streams_give_equal_maps() {
        for kind in FloorplanKind::ALL {
            assert_eq!(map(kind, 7), map(kind, 7), "{kind:?}");
        }
        assert_ne!(map(FloorplanKind::Rooms, 1), map(FloorplanKind::Rooms, 2), "seeds 1 and 2");
    }

    #[test]
    fn every_kind_draws_the_maps_it_always_drew() {
        // FNV-1a over the cells of three maps.
        let hash = |kind| {
            let cells = (0..3).flat_map(|seed| map(kind, seed).cells().to_vec());
            cells.fold(0xcbf2_9ce4_8422_2325_u64, |hash, cell| {
                (hash ^ u64::from(cell == Occupancy::Free)).wrapping_mul(0x0100_0000_01b3)
            })
        };
        let found: Vec<String> =
            FloorplanKind::ALL.into_iter().map(|kind| format!("{kind:?} {:016x}", hash(kind))).collect();
        assert_eq!(found, HASHES);
    }

    const HASHES: [&str; 22] = [
        "Gap 4e3606043313aaa1",
        "Gaps 296bc741a1885731",
        "Screens f863f2ad8e933526",
        "OffsetWalls 22d5ae8ee114e234",
        "Bricks 7969bbf4bd37abc4",
        "Comb 729c8c5bf2e03374",
        "Maze 6d9a2d189ddb8b0e",
        "Rooms d008db658aa77531",
        "FurnishedRooms 91b4c5a0c8c364f6",
        "RoomsAndCorridor 3f56c82aa0d45233",
        "CrossCorridors 1cd6a360cd9002a9",
        "RingCorridor 388314c688e08a91",
        "RoomGrid 8f5c675ac046ad5b",
        "Clutter e391cd3ed68a2340",
        "Pillars 050f79c65c5dbf87",
        "Islands 9330f7d5d94388da",
        "Spiral 03e878d5bf9378ed",
        "Slanted 7809e580eb7fb741",
        "Channel 2774e98d7d6d0da1",
        "Funnels 4d0b18212b37e7a8",
        "RoomsAndClutter 9788702a21208eef",
        "BentCorridor e87545a5cfaec327",
    ];
}
