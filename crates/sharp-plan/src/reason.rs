//! Why there is no plan, in words that lead to a remedy.

use std::cmp::Ordering;
use std::collections::BinaryHeap;

use rayon::prelude::*;
use sharp_drive::World;
use sharp_guide::ridge_routes;
use sharp_space::{Cell, GridFrame, Heading, Occupancy, Point, Pose, trig};

use crate::query::Query;
use crate::search::goal_of;

/// Room beside the outline below which a way counts as narrow for a robot under noise, metres.
const NARROW_M: f64 = 0.1;
/// Headings at the start that are tried where none leads on from the robot's own, over a full turn.
const HEADINGS: u32 = 16;
/// Directions in which the width of a place is measured, over half a turn.
const DIRECTIONS: u32 = 24;

/// What the map itself says: that no free way joins start and goal, or that even the widest is narrow for the robot.
/// `None` where the map leaves room.
pub(crate) fn obstruction(world: &World, query: &Query) -> Option<String> {
    let frame = world.grid.frame();
    for (end, pose) in [("start", query.start), ("goal", query.goal)] {
        if frame.cell_at(pose.position).is_none() {
            return Some(format!("the {end} lies outside the map"));
        }
    }
    let Some(place) = narrowest_place(world, query) else {
        let separate = "start and goal lie in separate parts of the free space: no free way joins them";
        return Some(if is_joined_by_unknown(world, query) {
            format!("{separate}, only unknown space does (--unknown free takes it as free)")
        } else {
            format!("{separate}, however small the robot")
        });
    };
    let robot_m = 2.0 * world.robot.footprint.inscribed_radius_m();
    let width_m = width_at(world, place);
    (width_m < robot_m + 2.0 * NARROW_M).then(|| {
        format!(
            "the widest way from start to goal is {width_m:.2} m wide at its narrowest place, near ({:.2}, {:.2}), and the \
             {} is {robot_m:.2} m wide",
            place.x, place.y, world.robot.name
        )
    })
}

/// Whether the robot fits through no way from start to goal, whatever it does.
pub(crate) fn is_shut(world: &World, query: &Query) -> bool {
    let robot_m = 2.0 * world.robot.footprint.inscribed_radius_m();
    narrowest_place(world, query).is_none_or(|place| width_at(world, place) < robot_m)
}

/// Whether the headings are what is in the way: the robot finds no manoeuvre from its heading at the start, though a robot that
/// looks another way there would get through, or none to the heading that the goal `asks_heading` for. `None` where they are not.
pub(crate) fn unturned(world: &World, query: &Query, asks_heading: bool) -> Option<String> {
    let robot = world.guide_robot();
    let goal = goal_of(query.goal, world, None);
    let end = goal.easiest_end(world.geometry.clearance(), world.robot.footprint.inscribed_radius_m());
    let leads_on = |start: Pose| ridge_routes(&robot, start, (end, None)).next().is_some();
    let model = &world.robot;
    if goal.contains(query.start.position) || leads_on(query.start) {
        return asks_heading.then(|| {
            "the goal can be reached, but no way was found that arrives in the heading that is asked for"
                .to_owned()
        });
    }
    let turned = |i: u32| {
        let turn_rad = f64::from(i) * std::f64::consts::TAU / f64::from(HEADINGS);
        Pose::at(query.start.position, Heading::new(query.start.heading.radians() + turn_rad))
    };
    if !(1..HEADINGS)
        .into_par_iter()
        .map(turned)
        .any(|start| world.geometry.is_free(start) && leads_on(start))
    {
        return None;
    }
    let needs = if model.can_turn_in_place() {
        format!("in place it needs {:.2} m of room on all sides", model.footprint.circumscribed_radius_m())
    } else {
        format!("its tightest bend has a radius of {:.2} m", model.min_turning_radius_m())
    };
    let back = match model.recovery_reverse_m {
        reverse_m if reverse_m > 0.0 => {
            format!("backing off does not help enough (recovery_reverse_m is {reverse_m:.2})")
        }
        _ => "it never reverses (recovery_reverse_m is 0)".to_owned(),
    };
    Some(format!(
        "the way to the goal is wide enough, but the {} cannot turn onto it from its heading at the start: {needs}, and {back}",
        model.name
    ))
}

/// Returns true if some free way joins start and goal, however narrow.
pub(crate) fn is_joined(world: &World, query: &Query) -> bool {
    narrowest_place(world, query).is_some()
}

/// Returns true if start and goal are joined where unknown space counts as free.
fn is_joined_by_unknown(world: &World, query: &Query) -> bool {
    let frame = world.grid.frame();
    let ends = (frame.cell_at(query.start.position), frame.cell_at(query.goal.position));
    let (Some(start), Some(goal)) = ends else { return false };
    let mut seen = vec![false; frame.len()];
    let mut open = vec![start];
    while let Some(cell) = open.pop() {
        if cell == goal {
            return true;
        }
        for next in beside(frame, cell).filter(|&next| world.grid.get(next) != Occupancy::Occupied) {
            if !std::mem::replace(&mut seen[frame.index(next)], true) {
                open.push(next);
            }
        }
    }
    false
}

/// The cells of the map on the four sides of `cell`.
fn beside(frame: &GridFrame, Cell { row, col }: Cell) -> impl Iterator<Item = Cell> + use<> {
    let (width, height) = (frame.width, frame.height);
    let sides = [(row.wrapping_sub(1), col), (row + 1, col), (row, col.wrapping_sub(1)), (row, col + 1)];
    sides
        .into_iter()
        .filter(move |&(row, col)| row < height && col < width)
        .map(|(row, col)| Cell::new(col, row))
}

/// A cell with the least clearance on the way to it; the one with the most comes first.
#[derive(PartialEq)]
struct Reached {
    least_m: f64,
    narrowest: Cell,
    cell: Cell,
}

impl Eq for Reached {}

impl PartialOrd for Reached {
    fn partial_cmp(&self, other: &Self) -> Option<Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Reached {
    fn cmp(&self, other: &Self) -> Ordering {
        self.least_m.total_cmp(&other.least_m).then_with(|| other.cell.cmp(&self.cell))
    }
}

/// The place with the least clearance on the way from start to goal whose least clearance is largest; `None` if no
/// free way joins them. Ways begin and end with the clearance that start and goal have.
fn narrowest_place(world: &World, query: &Query) -> Option<Point> {
    let (frame, field) = (world.grid.frame(), world.geometry.clearance());
    let start = frame.cell_at(query.start.position)?;
    let goal = frame.cell_at(query.goal.position)?;
    // Near its ends a way may be as narrow as they are: that the robot fits there is checked elsewhere.
    let near_end = 2.0 * world.robot.footprint.circumscribed_radius_m();
    let clearance_m = |cell: Cell| {
        let at = frame.center(cell);
        let is_near = |end: Point| (at - end).norm() < near_end;
        if is_near(query.start.position) || is_near(query.goal.position) {
            f64::INFINITY
        } else {
            field.at(cell)
        }
    };
    let mut seen = vec![false; frame.len()];
    let mut open = BinaryHeap::from([Reached { least_m: f64::INFINITY, narrowest: start, cell: start }]);
    while let Some(Reached { least_m, narrowest, cell }) = open.pop() {
        if std::mem::replace(&mut seen[frame.index(cell)], true) {
            continue;
        }
        if cell == goal {
            return Some(frame.center(narrowest));
        }
        for next in beside(frame, cell) {
            if !seen[frame.index(next)] && field.at(next) > 0.0 {
                let here_m = clearance_m(next);
                let (least_m, narrowest) =
                    if here_m < least_m { (here_m, next) } else { (least_m, narrowest) };
                open.push(Reached { least_m, narrowest, cell: next });
            }
        }
    }
    None
}

/// The free length of the shortest straight line through `place`, metres.
pub(crate) fn width_at(world: &World, place: Point) -> f64 {
    let frame = world.grid.frame();
    let step_m = 0.05 * frame.resolution_m;
    let is_free =
        |point: Point| frame.cell_at(point).is_some_and(|cell| world.grid.get(cell) == Occupancy::Free);
    let free_m = |angle_rad: f64| {
        let (sin, cos) = (trig::sin(angle_rad), trig::cos(angle_rad));
        let along = |distance_m: f64| Point::new(place.x + distance_m * cos, place.y + distance_m * sin);
        // The edge lies somewhere in the step after the last free one.
        let free = (1..).map(|i| f64::from(i) * step_m).take_while(|&at_m| is_free(along(at_m))).last();
        free.unwrap_or(0.0) + 0.5 * step_m
    };
    let width = |direction: u32| {
        let angle_rad = std::f64::consts::PI * f64::from(direction) / f64::from(DIRECTIONS);
        free_m(angle_rad) + free_m(angle_rad + std::f64::consts::PI)
    };
    (0..DIRECTIONS).map(width).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use sharp_sim::RobotModel;
    use sharp_space::OccupancyGrid;

    use super::*;

    /// Two rooms of 3 m side by side, joined by a door of so many cells of 0.1 m.
    fn rooms(door: usize) -> (World, Query) {
        let row = |row: usize| match row {
            0 | 31 => "#".repeat(61),
            row if row > 10 && row <= 10 + door => format!("#{}#", ".".repeat(59)),
            _ => format!("#{0}#{0}#", ".".repeat(29)),
        };
        let rows: Vec<String> = (0..32).rev().map(row).collect();
        let grid = OccupancyGrid::from_ascii(0.1, &rows.join("\n")).expect("a sound drawing");
        let query = Query { start: Pose::new(1.5, 1.5, 0.0), goal: Pose::new(4.5, 1.5, 0.0) };
        (World::new(grid, RobotModel::husky()), query)
    }

    #[test]
    fn rooms_without_a_door_are_separate() {
        let (world, query) = rooms(0);
        let reason = obstruction(&world, &query).expect("no way");
        assert!(reason.contains("separate parts"), "{reason}");
        assert!(is_shut(&world, &query), "nothing leads through");
    }

    #[test]
    fn a_robot_that_cannot_turn_round_is_told_so() {
        // A corridor of 1 m with walls at both ends: a Husky looks at one of them and wants to go to the other.
        let row = |row: usize| {
            if (4..14).contains(&row) { format!("#{}#", ".".repeat(78)) } else { "#".repeat(80) }
        };
        let rows: Vec<String> = (0..18).map(row).collect();
        let grid = OccupancyGrid::from_ascii(0.1, &rows.join("\n")).expect("a sound drawing");
        let world = World::new(grid, RobotModel::husky());
        let query = |yaw| Query { start: Pose::new(6.0, 0.9, yaw), goal: Pose::new(1.0, 0.9, 0.0) };
        let reason = unturned(&world, &query(0.0), false).expect("it cannot turn");
        assert!(reason.contains("cannot turn onto it") && reason.contains("0.60 m of room"), "{reason}");
        let there = query(std::f64::consts::PI);
        assert_eq!(unturned(&world, &there, false), None, "it looks the right way");
        let reason = unturned(&world, &there, true).expect("another heading at the goal");
        assert!(reason.contains("heading that is asked for"), "{reason}");
    }

    #[test]
    fn unknown_space_between_two_rooms_is_named() {
        let row = |row: usize| {
            if matches!(row, 0 | 31) { "#".repeat(61) } else { format!("#{0}?{0}#", ".".repeat(29)) }
        };
        let rows: Vec<String> = (0..32).map(row).collect();
        let grid = OccupancyGrid::from_ascii(0.1, &rows.join("\n")).expect("a sound drawing");
        let (_, query) = rooms(0);
        let reason = obstruction(&World::new(grid, RobotModel::husky()), &query).expect("no way");
        assert!(reason.contains("only unknown space does"), "{reason}");
    }

    #[test]
    fn a_narrow_door_is_measured() {
        let (world, query) = rooms(7);
        let reason = obstruction(&world, &query).expect("a narrow way");
        assert!(reason.contains("is 0.70 m wide at its narrowest place, near (3.0"), "{reason}");
        assert!(reason.contains("the husky is 0.67 m wide"), "{reason}");
        let (world, query) = rooms(12);
        assert_eq!(obstruction(&world, &query), None, "a door of 1.2 m leaves room");
        let is_shut = [6, 7, 12].map(rooms).map(|(world, query)| is_shut(&world, &query));
        assert_eq!(is_shut, [true, false, false], "doors of 0.6, 0.7 and 1.2 m for a robot of 0.67 m");
    }
}
