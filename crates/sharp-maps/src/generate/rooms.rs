//! Rooms: by recursive division, in a regular grid, and beside clutter.

use rand::RngExt;
use sharp_space::Stream;

use super::blueprint::{Blueprint, Rect};
use super::lattice::{RoomLattice, spanning_tree};
use super::obstacles::clutter;
use super::sizes::{door_m, wall_m};

/// Divides `area` by walls with doors, at most `depth` times.
pub(super) fn divide(plan: &mut Blueprint, rng: &mut Stream, area: Rect, depth: usize) {
    // A room under 2.6 m is not divided into rooms that a Husky can turn in.
    const ROOM_MIN_M: f64 = 2.6;
    let upright = area.width() > area.height() * rng.random_range(0.8..=1.25);
    let along = if upright { area.width() } else { area.height() };
    if depth == 0 || along < 2.0 * ROOM_MIN_M || (depth <= 2 && rng.random_bool(0.15)) {
        return;
    }
    let at = rng.random_range(ROOM_MIN_M..=along - ROOM_MIN_M);
    let wall = wall_m(rng);
    let (first, second, partition) = area.cut(upright, at, wall);
    divide(plan, rng, first, depth - 1);
    divide(plan, rng, second, depth - 1);
    plan.fill(partition);
    let across = if upright { area.height() } else { area.width() };
    let doors = if across > 6.0 { rng.random_range(1..=2) } else { 1 };
    for _ in 0..doors {
        let door = door_m(rng).min(across - 0.4);
        let start = rng.random_range(0.2..=across - door - 0.2);
        plan.clear(partition.door(upright, start, door));
    }
}

/// Equal rooms; a spanning tree of doors and a few more.
pub(super) fn room_grid(plan: &mut Blueprint, rng: &mut Stream) {
    let area = plan.inside();
    let side = rng.random_range(2..=4).min((area.width() / 3.0) as usize);
    let grid = RoomLattice { area, columns: side, rows: side, wall: wall_m(rng) };
    let room = area.width() / side as f64 - grid.wall;
    let open = spanning_tree(side, side, rng);
    grid.draw(plan, |edge| {
        let door = if open.contains(&edge) || rng.random_bool(0.3) { door_m(rng) } else { 0.0 };
        (rng.random_range(0.2..=(room - door - 0.2).max(0.21)), door)
    });
}

/// Rooms on one half, clutter on the other, and two doors between them.
pub(super) fn rooms_and_clutter(plan: &mut Blueprint, rng: &mut Stream) {
    let area = plan.inside();
    let (first, second, partition) = area.cut(true, area.width() * rng.random_range(0.4..=0.6), wall_m(rng));
    divide(plan, rng, first, 3);
    clutter(plan, rng, second, 0.12, 0.4..=1.8);
    plan.fill(partition);
    for part in 0..2 {
        let door = door_m(rng);
        let half = area.height() / 2.0;
        let start = half * f64::from(part) + rng.random_range(0.2..=half - door - 0.2);
        plan.clear(partition.door(true, start, door));
    }
}
