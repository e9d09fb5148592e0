//! Corridors with rooms: straight, crossing, around a block, with a bend, and the comb of bays.

use rand::RngExt;
use sharp_space::Stream;

use super::blueprint::{Blueprint, Rect};
use super::rooms::divide;
use super::sizes::{corridor_m, door_m, wall_m};

/// One corridor with a row of rooms on either side.
pub(super) fn rooms_and_corridor(plan: &mut Blueprint, rng: &mut Stream) {
    let area = plan.inside();
    let width = corridor_m(rng);
    let middle = rng.random_range(area.y0 + 3.5..=area.y1 - 3.5 - width);
    row_of_rooms(plan, rng, Rect { y1: middle, ..area }, CorridorSide::Top);
    row_of_rooms(plan, rng, Rect { y0: middle + width, ..area }, CorridorSide::Bottom);
}

/// Two corridors that cross, rooms in the four corners.
pub(super) fn cross_corridors(plan: &mut Blueprint, rng: &mut Stream) {
    let area = plan.inside();
    let (across, along) = (corridor_m(rng), corridor_m(rng));
    let x = rng.random_range(area.x0 + 4.0..=area.x1 - 4.0 - across);
    let y = rng.random_range(area.y0 + 4.0..=area.y1 - 4.0 - along);
    for (x0, x1) in [(area.x0, x), (x + across, area.x1)] {
        let wall = wall_m(rng);
        let inner = if x1 == x { (x - wall, x) } else { (x0, x0 + wall) };
        row_of_rooms(plan, rng, Rect { x0, x1, y0: area.y0, y1: y }, CorridorSide::Top);
        row_of_rooms(plan, rng, Rect { x0, x1, y0: y + along, y1: area.y1 }, CorridorSide::Bottom);
        plan.fill(Rect { x0: inner.0, x1: inner.1, y0: area.y0, y1: y });
        plan.fill(Rect { x0: inner.0, x1: inner.1, y0: y + along, y1: area.y1 });
    }
}

/// A corridor around a block, which is solid or has rooms.
pub(super) fn ring_corridor(plan: &mut Blueprint, rng: &mut Stream) {
    let area = plan.inside();
    let depth = rng.random_range(2.4..=3.2);
    let ring = corridor_m(rng);
    let core = area.shrunk(depth + ring);
    row_of_rooms(plan, rng, Rect { y1: area.y0 + depth, ..area }, CorridorSide::Top);
    row_of_rooms(plan, rng, Rect { y0: area.y1 - depth, ..area }, CorridorSide::Bottom);
    if rng.random_bool(0.3) {
        plan.fill(core);
        return;
    }
    let wall = wall_m(rng);
    plan.outline(core, wall);
    divide(plan, rng, core.shrunk(wall), 2);
    let door = door_m(rng);
    let start = rng.random_range(0.4..=(core.height() - door - 0.4).max(0.4));
    let x = if rng.random_bool(0.5) { core.x0 } else { core.x1 - wall };
    let (y0, y1) = (core.y0 + start, core.y0 + start + door);
    plan.clear(Rect { x0: x - 0.05, x1: x + wall + 0.05, y0, y1 });
}

/// A corridor with a bend and rooms outside of it.
pub(super) fn bent_corridor(plan: &mut Blueprint, rng: &mut Stream) {
    let area = plan.inside();
    let width = corridor_m(rng);
    let x = rng.random_range(area.x0 + 4.0..=area.x1 - 4.0 - width);
    let y = rng.random_range(area.y0 + 4.0..=area.y1 - 4.0 - width);
    let wall = wall_m(rng);
    let (east, west) = (x + width, x);
    row_of_rooms(plan, rng, Rect { x1: west, y1: y, ..area }, CorridorSide::Top);
    row_of_rooms(plan, rng, Rect { y0: y + width, x1: east, ..area }, CorridorSide::Bottom);
    row_of_rooms(plan, rng, Rect { x0: east, y0: area.y1 - 3.0, ..area }, CorridorSide::Bottom);
    plan.fill(Rect { x0: west - wall, x1: west, y0: area.y0, y1: y });
    // The wall between the corridor's second leg and the large room on the other side.
    let partition = Rect { x0: east, x1: east + wall, y0: area.y0, y1: area.y1 };
    plan.fill(partition);
    for start in [0.5, y - area.y0] {
        let door = door_m(rng);
        plan.clear(Rect {
            x0: east - 0.05,
            x1: east + wall + 0.05,
            y0: area.y0 + start,
            y1: area.y0 + start + door,
        });
    }
}

/// Bays on both sides of an aisle.
pub(super) fn comb(plan: &mut Blueprint, rng: &mut Stream) {
    let area = plan.inside();
    let aisle = corridor_m(rng);
    let middle = rng.random_range(area.y0 + 3.5..=area.y1 - 3.5 - aisle);
    for side in [Rect { y1: middle, ..area }, Rect { y0: middle + aisle, ..area }] {
        let bay = rng.random_range(1.6..=3.2);
        let mut x = side.x0 + bay;
        while x + bay <= side.x1 {
            plan.fill(Rect { x0: x, x1: x + wall_m(rng), ..side });
            x += bay;
        }
    }
}

/// The side of a row of rooms that faces the corridor.
#[derive(Clone, Copy)]
enum CorridorSide {
    Top,
    Bottom,
}

/// Rooms side by side, each with a door in the wall on `side`, some joined by another door.
fn row_of_rooms(plan: &mut Blueprint, rng: &mut Stream, area: Rect, side: CorridorSide) {
    let wall = wall_m(rng);
    let (y0, y1) = match side {
        CorridorSide::Top => (area.y1 - wall, area.y1),
        CorridorSide::Bottom => (area.y0, area.y0 + wall),
    };
    plan.fill(Rect { y0, y1, ..area });
    let mut x = area.x0;
    while x < area.x1 - 1.5 {
        let mut room = rng.random_range(2.4..=5.0);
        if area.x1 - (x + room) < 2.4 {
            room = area.x1 - x;
        }
        let door = door_m(rng).min(room - 0.5);
        let start = x + rng.random_range(0.2..=room - door - 0.2);
        plan.clear(Rect { x0: start, x1: start + door, y0: y0 - 0.1, y1: y1 + 0.1 });
        x += room;
        if x < area.x1 - 0.5 {
            plan.fill(Rect { x0: x, x1: x + wall, ..area });
            if rng.random_bool(0.25) && area.height() > 2.5 {
                let door = door_m(rng);
                let start = area.y0 + rng.random_range(0.4..=(area.height() - door - 0.4).max(0.4));
                plan.clear(Rect { x0: x - 0.05, x1: x + wall + 0.05, y0: start, y1: start + door });
            }
        }
    }
}
