//! Seeded generator of indoor maps for training, tests and benches.
//!
//! The plans have the statistics of the paper's environments (doors of 1.0 to 1.8 m, corridors of
//! 1.1 to 2.1 m, walls of 0.1 to 0.25 m, a closed border) and are all our own. Equal arguments and
//! equal streams give equal maps.

use rand::RngExt;
use serde::{Deserialize, Serialize};

use crate::distance_field::DistanceField;
use crate::grid::{Cell, GridFrame, Occupancy, OccupancyGrid};
use crate::pose::{Point, Pose, Vector};
use crate::seed::Stream;

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
    /// Parallel walls attached to one side and the other by turns.
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

/// The clearance that a plan's main part is connected at, metres: the half width of a Husky and a
/// hand's breadth, so that it passes with room to steer.
const ROOM_TO_PASS_M: f64 = 0.42;

/// Share of the passable area that must be connected.
const CONNECTED_SHARE: f64 = 0.8;

/// A square map of `kind`, `size_m` metres wide, turned and mirrored at random.
///
/// At least four fifths of the area that a Husky (1.0 m by 0.67 m) can reach at all are connected.
///
/// # Panics
/// If the map would have fewer than 40 or more than 32 767 cells a side, or is under 8 m wide.
#[must_use]
pub fn generate(kind: FloorplanKind, size_m: f64, resolution_m: f64, rng: &mut Stream) -> OccupancyGrid {
    assert!(size_m >= 8.0, "a floor plan of {size_m} m is too small for doors and corridors");
    let side = (size_m / resolution_m).round();
    assert!((40.0..=32_767.0).contains(&side), "a floor plan {side} cells wide");
    // Nearly every draw is connected; a plan without any wall ends the search.
    const ATTEMPTS: usize = 40;
    let (border, side) = (rng.random_range(0.1..=0.25), side as usize);
    for _ in 0..ATTEMPTS {
        let mut plan = Plan::new(side, resolution_m, border);
        draw(kind, &mut plan, rng);
        let grid = plan.into_grid(rng.random_range(0..8));
        if is_connected(&grid) {
            return grid;
        }
    }
    Plan::new(side, resolution_m, border).into_grid(0)
}

fn draw(kind: FloorplanKind, plan: &mut Plan, rng: &mut Stream) {
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

fn door_m(rng: &mut Stream) -> f64 {
    rng.random_range(1.0..=1.8)
}

fn corridor_m(rng: &mut Stream) -> f64 {
    rng.random_range(1.1..=2.1)
}

fn wall_m(rng: &mut Stream) -> f64 {
    rng.random_range(0.1..=0.25)
}

/// `count` walls across the map, top to bottom, with doors at random heights.
fn walls_with_doors(plan: &mut Plan, rng: &mut Stream, count: usize, doors: std::ops::RangeInclusive<usize>) {
    let area = plan.inside();
    let pitch = area.width() / (count + 1) as f64;
    for i in 1..=count {
        let x = area.x0 + pitch * (i as f64 + rng.random_range(-0.25..=0.25));
        let wall = wall_m(rng);
        plan.fill(Rect { x0: x, x1: x + wall, ..area });
        for _ in 0..rng.random_range(doors.clone()) {
            let door = door_m(rng);
            let y = rng.random_range(area.y0 + 0.3..=area.y1 - door - 0.3);
            plan.clear(Rect { x0: x - 0.1, x1: x + wall + 0.1, y0: y, y1: y + door });
        }
    }
}

fn offset_walls(plan: &mut Plan, rng: &mut Stream) {
    let area = plan.inside();
    let count = rng.random_range(3..=6);
    let pitch = area.width() / (count + 1) as f64;
    for i in 1..=count {
        let x = area.x0 + pitch * i as f64;
        let gap = rng.random_range(1.2..=3.0);
        let (y0, y1) = if i % 2 == 0 { (area.y0, area.y1 - gap) } else { (area.y0 + gap, area.y1) };
        plan.fill(Rect { x0: x, x1: x + wall_m(rng), y0, y1 });
    }
}

fn bricks(plan: &mut Plan, rng: &mut Stream) {
    let area = plan.inside();
    let (long, thick, gap) =
        (rng.random_range(1.5..=3.5), rng.random_range(0.6..=1.6), rng.random_range(1.2..=2.0));
    let mut y = area.y0 + gap;
    let mut shift = 0.0;
    while y + thick + gap <= area.y1 {
        let mut x = area.x0 + gap * 0.6 - shift;
        while x < area.x1 {
            plan.fill(Rect { x0: x, x1: x + long, y0: y, y1: y + thick });
            x += long + gap;
        }
        shift = if shift == 0.0 { (long + gap) / 2.0 } else { 0.0 };
        y += thick + gap;
    }
}

fn comb(plan: &mut Plan, rng: &mut Stream) {
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

fn maze(plan: &mut Plan, rng: &mut Stream) {
    let area = plan.inside();
    let side = (area.width() / rng.random_range(2.0..=2.9)) as usize;
    let (pitch, wall) = (area.width() / side as f64, wall_m(rng));
    let grid = Lattice { area, columns: side, rows: side, wall };
    let open = spanning_tree(side, side, rng);
    grid.draw(plan, |edge| {
        let width = if open.contains(&edge) || rng.random_bool(0.06) { pitch - wall } else { 0.0 };
        (0.0, width)
    });
}

/// Divides `area` by walls with doors, at most `depth` times.
fn divide(plan: &mut Plan, rng: &mut Stream, area: Rect, depth: usize) {
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

fn rooms_and_corridor(plan: &mut Plan, rng: &mut Stream) {
    let area = plan.inside();
    let width = corridor_m(rng);
    let middle = rng.random_range(area.y0 + 3.5..=area.y1 - 3.5 - width);
    row_of_rooms(plan, rng, Rect { y1: middle, ..area }, Side::Top);
    row_of_rooms(plan, rng, Rect { y0: middle + width, ..area }, Side::Bottom);
}

#[derive(Clone, Copy)]
enum Side {
    Top,
    Bottom,
}

/// Rooms side by side, each with a door in the wall on `side`, some joined by another door.
fn row_of_rooms(plan: &mut Plan, rng: &mut Stream, area: Rect, side: Side) {
    let wall = wall_m(rng);
    let (y0, y1) = match side {
        Side::Top => (area.y1 - wall, area.y1),
        Side::Bottom => (area.y0, area.y0 + wall),
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
                let start = area.y0 + rng.random_range(0.4..=area.height() - door - 0.4);
                plan.clear(Rect { x0: x - 0.05, x1: x + wall + 0.05, y0: start, y1: start + door });
            }
        }
    }
}

fn cross_corridors(plan: &mut Plan, rng: &mut Stream) {
    let area = plan.inside();
    let (across, along) = (corridor_m(rng), corridor_m(rng));
    let x = rng.random_range(area.x0 + 4.0..=area.x1 - 4.0 - across);
    let y = rng.random_range(area.y0 + 4.0..=area.y1 - 4.0 - along);
    for (x0, x1) in [(area.x0, x), (x + across, area.x1)] {
        let wall = wall_m(rng);
        let inner = if x1 == x { (x - wall, x) } else { (x0, x0 + wall) };
        row_of_rooms(plan, rng, Rect { x0, x1, y0: area.y0, y1: y }, Side::Top);
        row_of_rooms(plan, rng, Rect { x0, x1, y0: y + along, y1: area.y1 }, Side::Bottom);
        plan.fill(Rect { x0: inner.0, x1: inner.1, y0: area.y0, y1: y });
        plan.fill(Rect { x0: inner.0, x1: inner.1, y0: y + along, y1: area.y1 });
    }
}

fn ring_corridor(plan: &mut Plan, rng: &mut Stream) {
    let area = plan.inside();
    let depth = rng.random_range(2.4..=3.2);
    let ring = corridor_m(rng);
    let core = area.shrunk(depth + ring);
    row_of_rooms(plan, rng, Rect { y1: area.y0 + depth, ..area }, Side::Top);
    row_of_rooms(plan, rng, Rect { y0: area.y1 - depth, ..area }, Side::Bottom);
    if rng.random_bool(0.3) {
        plan.fill(core);
        return;
    }
    let wall = wall_m(rng);
    plan.outline(core, wall);
    divide(plan, rng, core.shrunk(wall), 2);
    let door = door_m(rng);
    let start = rng.random_range(0.4..=core.height() - door - 0.4);
    let x = if rng.random_bool(0.5) { core.x0 } else { core.x1 - wall };
    let (y0, y1) = (core.y0 + start, core.y0 + start + door);
    plan.clear(Rect { x0: x - 0.05, x1: x + wall + 0.05, y0, y1 });
}

fn room_grid(plan: &mut Plan, rng: &mut Stream) {
    let area = plan.inside();
    let side = rng.random_range(2..=4).min((area.width() / 3.0) as usize);
    let grid = Lattice { area, columns: side, rows: side, wall: wall_m(rng) };
    let room = area.width() / side as f64 - grid.wall;
    let open = spanning_tree(side, side, rng);
    grid.draw(plan, |edge| {
        let door = if open.contains(&edge) || rng.random_bool(0.3) { door_m(rng) } else { 0.0 };
        (rng.random_range(0.2..=(room - door - 0.2).max(0.21)), door)
    });
}

/// Boxes at random until `share` of `area` is covered.
fn clutter(plan: &mut Plan, rng: &mut Stream, area: Rect, share: f64, side_m: std::ops::RangeInclusive<f64>) {
    let mut left = share * area.width() * area.height();
    while left > 0.0 {
        let (w, h) = (rng.random_range(side_m.clone()), rng.random_range(side_m.clone()));
        let x = rng.random_range(area.x0..=area.x1 - w);
        let y = rng.random_range(area.y0..=area.y1 - h);
        plan.fill(Rect { x0: x, x1: x + w, y0: y, y1: y + h });
        left -= w * h;
    }
}

fn pillars(plan: &mut Plan, rng: &mut Stream) {
    let area = plan.inside();
    let (pitch, side) = (rng.random_range(2.2..=3.5), rng.random_range(0.4..=0.9));
    let mut y = area.y0 + pitch / 2.0;
    while y + side < area.y1 {
        let mut x = area.x0 + pitch / 2.0;
        while x + side < area.x1 {
            let (dx, dy) = (rng.random_range(-0.3..=0.3), rng.random_range(-0.3..=0.3));
            plan.fill(Rect { x0: x + dx, x1: x + dx + side, y0: y + dy, y1: y + dy + side });
            x += pitch;
        }
        y += pitch;
    }
}

fn islands(plan: &mut Plan, rng: &mut Stream) {
    let area = plan.inside();
    let mut discs: Vec<(Point, f64)> = Vec::new();
    for _ in 0..60 {
        let center = Point::new(rng.random_range(area.x0..=area.x1), rng.random_range(area.y0..=area.y1));
        let radius = rng.random_range(0.5..=2.2);
        // Islands keep a corridor's width from one another, or the hall falls apart.
        if discs.iter().all(|(other, r)| (other - center).norm() > radius + r + 1.1) {
            plan.fill_where(|point| (point - center).norm() <= radius);
            discs.push((center, radius));
        }
    }
}

fn spiral(plan: &mut Plan, rng: &mut Stream) {
    let (wall, pitch) = (wall_m(rng), rng.random_range(1.5..=2.3));
    let mut ring = plan.inside().shrunk(pitch);
    let mut corner = rng.random_range(0..2);
    while ring.width() > 2.0 * pitch {
        plan.outline(ring, wall);
        // One opening a ring, at opposite corners by turns: the way in goes round.
        let x0 = if corner == 0 { ring.x0 + wall } else { ring.x1 - wall - pitch };
        let y0 = if corner == 0 { ring.y0 - 0.05 } else { ring.y1 - wall - 0.05 };
        plan.clear(Rect { x0, x1: x0 + pitch, y0, y1: y0 + wall + 0.1 });
        ring = ring.shrunk(pitch + wall);
        corner = 1 - corner;
    }
}

fn slanted(plan: &mut Plan, rng: &mut Stream) {
    let area = plan.inside();
    let count = rng.random_range(2..=3);
    for i in 1..=count {
        let middle = area.x0 + area.width() * i as f64 / (count + 1) as f64;
        let lean = rng.random_range(-0.12..=0.12) * area.width();
        let from = Point::new(middle - lean, area.y0);
        let to = Point::new(middle + lean, area.y1);
        let length = (to - from).norm();
        let (wall, door) = (wall_m(rng), door_m(rng));
        let start = rng.random_range(0.5..=length - door - 0.5);
        let along = (to - from) / length;
        let across = Vector::new(-along.y, along.x);
        plan.fill_where(|point| {
            let s = (point - from).dot(&along);
            let beside = (point - from).dot(&across).abs() <= wall / 2.0;
            beside && !(start..=start + door).contains(&s)
        });
    }
}

fn channel(plan: &mut Plan, rng: &mut Stream) {
    let area = plan.inside();
    let length = rng.random_range(2.5..=6.0);
    let x0 = rng.random_range(area.x0 + 3.0..=area.x1 - 3.0 - length);
    let block = Rect { x0, x1: x0 + length, ..area };
    plan.fill(block);
    for _ in 0..rng.random_range(1..=2) {
        let width = rng.random_range(1.1..=1.6);
        let y0 = rng.random_range(area.y0 + 0.2..=area.y1 - width - 0.2);
        plan.clear(Rect { y0, y1: y0 + width, ..block });
    }
}

fn funnels(plan: &mut Plan, rng: &mut Stream) {
    let area = plan.inside();
    let middle = (area.x0 + area.x1) / 2.0 + rng.random_range(-1.5..=1.5);
    let depth = rng.random_range(1.0..=2.5);
    let count = rng.random_range(1..=2);
    let pitch = area.height() / f64::from(count);
    let throats: Vec<(f64, f64)> = (0..count)
        .map(|i| {
            let center = area.y0 + pitch * (f64::from(i) + rng.random_range(0.3..=0.7));
            (center, door_m(rng) / 2.0)
        })
        .collect();
    plan.fill_where(|point| {
        let off = (point.x - middle).abs();
        off <= depth && throats.iter().all(|(y, half)| (point.y - y).abs() > half + off * 0.8)
    });
}

fn rooms_and_clutter(plan: &mut Plan, rng: &mut Stream) {
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

fn bent_corridor(plan: &mut Plan, rng: &mut Stream) {
    let area = plan.inside();
    let width = corridor_m(rng);
    let x = rng.random_range(area.x0 + 4.0..=area.x1 - 4.0 - width);
    let y = rng.random_range(area.y0 + 4.0..=area.y1 - 4.0 - width);
    let wall = wall_m(rng);
    let (east, west) = (x + width, x);
    row_of_rooms(plan, rng, Rect { x1: west, y1: y, ..area }, Side::Top);
    row_of_rooms(plan, rng, Rect { y0: y + width, x1: east, ..area }, Side::Bottom);
    row_of_rooms(plan, rng, Rect { x0: east, y0: area.y1 - 3.0, ..area }, Side::Bottom);
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

/// A rectangle in metres from the map's lower-left corner.
#[derive(Clone, Copy, Debug)]
struct Rect {
    x0: f64,
    x1: f64,
    y0: f64,
    y1: f64,
}

impl Rect {
    fn width(&self) -> f64 {
        self.x1 - self.x0
    }

    fn height(&self) -> f64 {
        self.y1 - self.y0
    }

    fn shrunk(&self, by: f64) -> Self {
        Self { x0: self.x0 + by, x1: self.x1 - by, y0: self.y0 + by, y1: self.y1 - by }
    }

    /// The parts before and after a wall `at` metres in, upright or level, and the wall.
    fn cut(self, upright: bool, at: f64, wall: f64) -> (Self, Self, Self) {
        let half = wall / 2.0;
        if upright {
            let x = self.x0 + at;
            let partition = Self { x0: x - half, x1: x + half, ..self };
            (Self { x1: x - half, ..self }, Self { x0: x + half, ..self }, partition)
        } else {
            let y = self.y0 + at;
            let partition = Self { y0: y - half, y1: y + half, ..self };
            (Self { y1: y - half, ..self }, Self { y0: y + half, ..self }, partition)
        }
    }

    /// The opening of `door` metres, `start` metres along this wall.
    fn door(self, upright: bool, start: f64, door: f64) -> Self {
        // A little deeper than the wall, so that rounding to cells leaves no sill.
        const SILL_M: f64 = 0.05;
        if upright {
            let y0 = self.y0 + start;
            Self { x0: self.x0 - SILL_M, x1: self.x1 + SILL_M, y0, y1: y0 + door }
        } else {
            let x0 = self.x0 + start;
            Self { x0, x1: x0 + door, y0: self.y0 - SILL_M, y1: self.y1 + SILL_M }
        }
    }
}

/// A wall between the rooms (column, row) and its right or upper neighbour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Edge {
    column: usize,
    row: usize,
    /// True for the wall on the right, false for the one above.
    right: bool,
}

/// Equal rooms in columns and rows.
struct Lattice {
    area: Rect,
    columns: usize,
    rows: usize,
    wall: f64,
}

impl Lattice {
    /// Draws the inner walls; `opening` gives where along each wall the door starts and its width.
    fn draw(&self, plan: &mut Plan, mut opening: impl FnMut(Edge) -> (f64, f64)) {
        let (w, h) = (self.area.width() / self.columns as f64, self.area.height() / self.rows as f64);
        let half = self.wall / 2.0;
        let mut doors = Vec::new();
        for edge in edges(self.columns, self.rows) {
            let x = self.area.x0 + w * edge.column as f64;
            let y = self.area.y0 + h * edge.row as f64;
            let wall = if edge.right {
                Rect { x0: x + w - half, x1: x + w + half, y0: y - half, y1: y + h + half }
            } else {
                Rect { x0: x - half, x1: x + w + half, y0: y + h - half, y1: y + h + half }
            };
            plan.fill(wall);
            let (start, width) = opening(edge);
            if width > 0.0 {
                doors.push(wall.door(edge.right, self.wall + start, width));
            }
        }
        doors.into_iter().for_each(|door| plan.clear(door));
    }
}

fn edges(columns: usize, rows: usize) -> impl Iterator<Item = Edge> {
    (0..rows).flat_map(move |row| {
        (0..columns).flat_map(move |column| {
            let right = (column + 1 < columns).then_some(Edge { column, row, right: true });
            let above = (row + 1 < rows).then_some(Edge { column, row, right: false });
            right.into_iter().chain(above)
        })
    })
}

/// A random spanning tree of the rooms of a lattice, as its open walls.
fn spanning_tree(columns: usize, rows: usize, rng: &mut Stream) -> Vec<Edge> {
    let mut waiting: Vec<Edge> = edges(columns, rows).collect();
    let mut part: Vec<usize> = (0..columns * rows).collect();
    let mut open = Vec::new();
    while !waiting.is_empty() {
        let edge = waiting.swap_remove(rng.random_range(0..waiting.len()));
        let a = edge.row * columns + edge.column;
        let b = if edge.right { a + 1 } else { a + columns };
        let (from, to) = (part[a], part[b]);
        if from != to {
            part.iter_mut().filter(|p| **p == from).for_each(|p| *p = to);
            open.push(edge);
        }
    }
    open
}

/// A square drawing board.
struct Plan {
    side: usize,
    resolution_m: f64,
    border_m: f64,
    blocked: Vec<bool>,
}

impl Plan {
    fn new(side: usize, resolution_m: f64, border_m: f64) -> Self {
        // At least one cell of border, however coarse the grid.
        let border_m = border_m.max(resolution_m);
        let mut plan = Self { side, resolution_m, border_m, blocked: vec![true; side * side] };
        plan.set(plan.inside(), false);
        plan
    }

    /// What lies within the border walls.
    fn inside(&self) -> Rect {
        let size = self.side as f64 * self.resolution_m;
        Rect { x0: 0.0, x1: size, y0: 0.0, y1: size }.shrunk(self.border_m)
    }

    /// Blocks the cells of `rect`, at least one cell across.
    fn fill(&mut self, rect: Rect) {
        self.set(rect, true);
    }

    fn clear(&mut self, rect: Rect) {
        self.set(rect, false);
    }

    fn set(&mut self, rect: Rect, blocked: bool) {
        let inside = self.span(self.border_m, self.side as f64 * self.resolution_m - self.border_m);
        let clip = |(a, b): (usize, usize)| (a.max(inside.0), b.min(inside.1));
        let (cols, rows) = (clip(self.span(rect.x0, rect.x1)), clip(self.span(rect.y0, rect.y1)));
        for row in rows.0..rows.1 {
            if cols.0 < cols.1 {
                self.blocked[row * self.side + cols.0..row * self.side + cols.1].fill(blocked);
            }
        }
    }

    /// The cells between two coordinates, at least one.
    fn span(&self, from_m: f64, to_m: f64) -> (usize, usize) {
        let from = (from_m / self.resolution_m).round().max(0.0) as usize;
        let to = ((to_m / self.resolution_m).round().max(0.0) as usize).max(from + 1);
        (from.min(self.side), to.min(self.side))
    }

    /// Blocks the four walls inside `rect`.
    fn outline(&mut self, rect: Rect, wall: f64) {
        self.fill(Rect { x1: rect.x0 + wall, ..rect });
        self.fill(Rect { x0: rect.x1 - wall, ..rect });
        self.fill(Rect { y1: rect.y0 + wall, ..rect });
        self.fill(Rect { y0: rect.y1 - wall, ..rect });
    }

    fn fill_where(&mut self, solid: impl Fn(Point) -> bool) {
        for index in 0..self.blocked.len() {
            let (col, row) = (index % self.side, index / self.side);
            let center =
                Point::new((col as f64 + 0.5) * self.resolution_m, (row as f64 + 0.5) * self.resolution_m);
            self.blocked[index] |= solid(center);
        }
    }

    /// The map, turned by one of the eight symmetries of the square.
    fn into_grid(self, symmetry: usize) -> OccupancyGrid {
        let side = self.side;
        let cells = (0..side * side).map(|index| {
            if self.blocked[turned_from(index, side, symmetry)] {
                Occupancy::Occupied
            } else {
                Occupancy::Free
            }
        });
        let origin = Pose::new(0.0, 0.0, 0.0);
        let frame = GridFrame { origin, resolution_m: self.resolution_m, width: side, height: side };
        OccupancyGrid::new(frame, cells.collect()).expect("the side was checked on entry")
    }
}

/// Returns true if the largest passable part holds [`CONNECTED_SHARE`] of all passable cells.
fn is_connected(grid: &OccupancyGrid) -> bool {
    let clearance = DistanceField::new(grid);
    let frame = grid.frame();
    let mut open: Vec<bool> =
        (0..frame.len()).map(|i| clearance.at(frame.cell(i)) >= ROOM_TO_PASS_M).collect();
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

/// The cell of a square of `side` by `side` cells that comes to cell number `index` when the square is
/// turned by one of its eight symmetries, 0 to 7.
#[must_use]
pub const fn turned_from(index: usize, side: usize, symmetry: usize) -> usize {
    let (mut col, mut row) = (index % side, index / side);
    if symmetry & 1 != 0 {
        col = side - 1 - col;
    }
    if symmetry & 2 != 0 {
        row = side - 1 - row;
    }
    if symmetry & 4 != 0 {
        (col, row) = (row, col);
    }
    row * side + col
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Seed;

    fn map(kind: FloorplanKind, seed: u64) -> OccupancyGrid {
        generate(kind, 15.0, 0.1, &mut Seed(seed).stream("floorplan", kind as u64))
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
                let inner =
                    (10..side - 10).flat_map(|row| (10..side - 10).map(move |col| Cell::new(col, row)));
                assert!(
                    inner.into_iter().any(|c| !grid.is_free(c)),
                    "{kind:?} {seed}: no draw was connected"
                );
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
