//! Counts and sizes of what the own environments are made of: rooms, corridors, doors, channels, dead ends.
//!
//! With closed doors and without furniture, the free space consists of separate pieces. A piece is a room or
//! a group of connected corridors.

use std::collections::{BTreeMap, BTreeSet};

use sharp_space::{Cell, DistanceField, Occupancy, OccupancyGrid};

use super::floor_plan;
use super::named::plans;

/// A corridor is nowhere as wide, metres: where two of 2.1 m cross there is room for a disc of 2.97 m.
const ROOM_WIDTH_M: f64 = 3.0;

/// A connected part of the free space.
#[derive(Debug)]
pub(crate) struct Piece {
    pub(crate) cells: Vec<Cell>,
    pub(crate) area_m2: f64,
    /// Diameter of the largest disc that fits, metres.
    pub(crate) widest_m: f64,
    /// Area by half the length of its border: the width, if it is a corridor, metres.
    pub(crate) mean_width_m: f64,
}

/// Connected parts of the free cells of `grid`.
pub(crate) fn pieces(grid: &OccupancyGrid) -> Vec<Piece> {
    let frame = grid.frame();
    let field = DistanceField::new(grid);
    let mut seen = vec![false; frame.len()];
    let mut pieces = Vec::new();
    for start in (0..frame.len()).map(|index| frame.cell(index)) {
        if seen[frame.index(start)] || !grid.is_free(start) {
            continue;
        }
        seen[frame.index(start)] = true;
        let (mut cells, mut border, mut next) = (vec![start], 0, 0);
        while let Some(&cell) = cells.get(next) {
            next += 1;
            for beside in beside(cell) {
                if beside.col >= frame.width || beside.row >= frame.height || !grid.is_free(beside) {
                    border += 1;
                } else if !std::mem::replace(&mut seen[frame.index(beside)], true) {
                    cells.push(beside);
                }
            }
        }
        let area_m2 = cells.len() as f64 * frame.resolution_m.powi(2);
        let most = cells.iter().map(|&cell| field.at(cell)).fold(0.0, f64::max);
        pieces.push(Piece {
            cells,
            area_m2,
            // From cell centre to cell centre: half a cell less on either side.
            widest_m: 2.0 * most - frame.resolution_m,
            mean_width_m: 2.0 * area_m2 / (f64::from(border) * frame.resolution_m),
        });
    }
    pieces
}

fn beside(cell: Cell) -> [Cell; 4] {
    let Cell { col, row } = cell;
    [
        Cell::new(col + 1, row),
        Cell::new(col.wrapping_sub(1), row),
        Cell::new(col, row + 1),
        Cell::new(col, row.wrapping_sub(1)),
    ]
}

/// The longest straight stretch of `grid` between two walls at most `width_m` apart, metres.
fn channel_m(grid: &OccupancyGrid, width_m: f64) -> f64 {
    let frame = grid.frame();
    let widest = (width_m / frame.resolution_m).round() as usize;
    let side = frame.width;
    assert_eq!(side, frame.height, "the environments are square");
    let mut longest = 0;
    for turned in [false, true] {
        let is_free = |col: usize, row: usize| {
            grid.is_free(if turned { Cell::new(row, col) } else { Cell::new(col, row) })
        };
        // Length of the stretch that ends in the last column, by the rows it lies between.
        let mut stretches = BTreeMap::new();
        for col in 0..side {
            let mut here = BTreeMap::new();
            let mut from = 0;
            for row in 0..side {
                if is_free(col, row) {
                    continue;
                }
                if (from + 1..=from + widest).contains(&row) {
                    let length = stretches.get(&(from, row)).unwrap_or(&0) + 1;
                    longest = longest.max(length);
                    here.insert((from, row), length);
                }
                from = row + 1;
            }
            stretches = here;
        }
    }
    longest as f64 * frame.resolution_m
}

/// The free cells of `grid`, but for a disc of `radius_m` around `middle`.
fn plugged(grid: &OccupancyGrid, middle: Cell, radius_m: f64) -> OccupancyGrid {
    let frame = grid.frame();
    let is_plugged = |index| {
        let way = frame.center(frame.cell(index)) - frame.center(middle);
        way.norm() < radius_m
    };
    let cells = grid.cells().iter().enumerate();
    let cells = cells.map(|(index, &cell)| if is_plugged(index) { Occupancy::Occupied } else { cell });
    OccupancyGrid::new(*frame, cells.collect()).expect("as large as before")
}

/// Just the cells of `piece` free.
fn alone(grid: &OccupancyGrid, piece: &Piece) -> OccupancyGrid {
    let mut cells = vec![Occupancy::Occupied; grid.frame().len()];
    piece.cells.iter().for_each(|&cell| cells[grid.frame().index(cell)] = Occupancy::Free);
    OccupancyGrid::new(*grid.frame(), cells).expect("as large as before")
}

#[test]
fn large_environments_have_rooms_doors_and_corridors_of_offices() {
    for (name, text) in plans().filter(|(name, _)| *name >= "e") {
        let (shell, doors_m) = floor_plan::shell(text);
        let (rooms, corridors): (Vec<_>, Vec<_>) =
            pieces(&shell).into_iter().partition(|piece| piece.widest_m >= ROOM_WIDTH_M);
        assert!((14..=40).contains(&rooms.len()), "{name} has {} rooms", rooms.len());
        for room in &rooms {
            assert!((50.0..450.0).contains(&room.area_m2), "{name}: a room of {} m2", room.area_m2);
        }
        assert!(!corridors.is_empty(), "{name} has no corridor");
        for Piece { mean_width_m, area_m2, .. } in &corridors {
            assert!((1.0..=2.1).contains(mean_width_m), "{name}: a corridor {mean_width_m:.2} m wide");
            assert!(*area_m2 > 10.0 * mean_width_m, "{name}: a corridor of {area_m2} m2 only");
        }
        let odd = doors_m.iter().find(|width_m| !(1.0..=2.4).contains(*width_m));
        assert_eq!(odd, None, "{name}: a door of unlikely width, metres");
    }
}

#[test]
fn small_environments_have_doors_for_both_and_doors_for_the_limo_alone() {
    for (name, text) in plans().filter(|(name, _)| *name < "e") {
        let (shell, doors_m) = floor_plan::shell(text);
        assert!(pieces(&shell).len() >= 6, "{name} has {} rooms", pieces(&shell).len());
        // The Husky is 0.67 m wide.
        let (narrow, wide): (Vec<f64>, Vec<f64>) = doors_m.iter().partition(|&&width_m| width_m < 0.67);
        assert!((1..=2).contains(&narrow.len()) && narrow.iter().all(|&m| m >= 0.5), "{name}: {narrow:?}");
        assert!(wide.iter().all(|width_m| (1.0..=2.4).contains(width_m)), "{name}: {wide:?}");
    }
}

#[test]
fn three_environments_have_a_long_narrow_channel() {
    for (letter, least_m) in [("a", 6.0), ("b", 6.0), ("d", 4.5)] {
        let (name, text) = plans().find(|(name, _)| *name == letter).expect("it is there");
        // Shut doors do not interrupt a channel between walls; some are made of furniture.
        let furnished = floor_plan::parse(name, text).expect("the assets are sound");
        let longest_m = channel_m(&floor_plan::shell(text).0, 1.3).max(channel_m(&furnished, 1.3));
        assert!(longest_m >= least_m, "{name} has no channel longer than {longest_m} m");
    }
}

#[test]
fn a_ring_corridor_has_a_dead_end_beside_it() {
    let (name, text) = plans().next().expect("there is an environment a");
    let (shell, _) = floor_plan::shell(text);
    let open = floor_plan::parse(name, text).expect("the assets are sound");
    let pieces = pieces(&shell);
    let ring = pieces.iter().find(|&piece| is_ring(&shell, piece)).expect("a corridor goes round");
    assert!((1.2..1.8).contains(&ring.mean_width_m), "{name}: the ring is {} m wide", ring.mean_width_m);
    let doors = doors(&shell, &open);
    let is_dead_end = |piece: &&Piece| {
        let mut own = doors.iter().filter(|door| touch(door, piece));
        let leads_to_ring = own.next().is_some_and(|door| touch(door, ring));
        leads_to_ring && own.next().is_none() && piece.widest_m < 1.5
    };
    let areas_m2: Vec<f64> = pieces.iter().filter(is_dead_end).map(|piece| piece.area_m2).collect();
    let is_stub = matches!(areas_m2[..], [area_m2] if (2.0..6.0).contains(&area_m2));
    assert!(is_stub, "{name}: dead ends of {areas_m2:?} m2 at the ring");
}

/// Returns true if `piece` is a corridor that holds together wherever it is plugged.
fn is_ring(grid: &OccupancyGrid, piece: &Piece) -> bool {
    let alone = alone(grid, piece);
    let holds = |middle| {
        // Closes a corridor of 1.6 m.
        let plugged = plugged(&alone, middle, 0.85);
        pieces(&plugged).iter().filter(|part| part.area_m2 > 0.5).count() == 1
    };
    let mut middles = piece.cells.iter().filter(|cell| cell.col % 10 == 5 && cell.row % 10 == 5);
    piece.area_m2 > 20.0 && piece.widest_m < 2.0 && middles.all(|&middle| holds(middle))
}

/// What is free in `open` and not in `shut`.
fn doors(shut: &OccupancyGrid, open: &OccupancyGrid) -> Vec<Piece> {
    let cells = shut.cells().iter().zip(open.cells()).map(|pair| match pair {
        (Occupancy::Occupied, Occupancy::Free) => Occupancy::Free,
        _ => Occupancy::Occupied,
    });
    pieces(&OccupancyGrid::new(*open.frame(), cells.collect()).expect("as large as before"))
}

fn touch(a: &Piece, b: &Piece) -> bool {
    let cells: BTreeSet<(usize, usize)> = b.cells.iter().map(|cell| (cell.col, cell.row)).collect();
    a.cells.iter().any(|&cell| beside(cell).iter().any(|c| cells.contains(&(c.col, c.row))))
}
