//! Why there is no plan, in words that lead to a remedy.

use std::collections::BTreeSet;

use rayon::prelude::*;
use sharp_drive::World;
use sharp_guide::{gap_m, joining, ridge_routes, route_beyond};
use sharp_space::{Cell, GridFrame, Heading, Occupancy, Point, Pose};

use crate::query::Query;
use crate::search::{JOINED_FROM_M, goal_of};

/// Room beside the outline below which a way counts as narrow for a robot under noise, metres.
const NARROW_M: f64 = 0.1;
/// Headings at the start that are tried where none leads on from the robot's own, over a full turn.
const HEADINGS: u32 = 16;
/// Directions in which the width of a place is measured, over half a turn.
const DIRECTIONS: u32 = 24;

/// What the map itself says: that no free way joins start and goal, or that even the widest is narrow for the robot.
/// `None` where the map leaves room.
pub(crate) fn obstruction(world: &World, query: &Query, gap: Option<&Gap>) -> Option<String> {
    let frame = world.grid.frame();
    for (end, pose) in [("start", query.start), ("goal", query.goal)] {
        if frame.cell_at(pose.position).is_none() {
            return Some(format!("the {end} lies outside the map"));
        }
    }
    let Some(Gap { place, width_m }) = gap else {
        let separate = "start and goal lie in separate parts of the free space: no free way joins them";
        return Some(if is_joined_by_unknown(world, query) {
            format!("{separate}, only unknown space does (--unknown free takes it as free)")
        } else {
            format!("{separate}, however small the robot")
        });
    };
    let robot_m = 2.0 * world.robot.footprint.inscribed_radius_m();
    (*width_m < robot_m + 2.0 * NARROW_M).then(|| {
        format!(
            "the widest way from start to goal is {width_m:.2} m wide at its narrowest place, near ({:.2}, {:.2}), and the \
             {} is {robot_m:.2} m wide",
            place.x, place.y, world.robot.name
        )
    })
}

/// A narrow place.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Gap {
    place: Point,
    /// The free length of the shortest straight line through it, metres.
    width_m: f64,
}

/// The narrowest place of the widest way from start to goal; `None` if no free way joins them.
pub(crate) fn narrowest_gap(world: &World, query: &Query) -> Option<Gap> {
    let place = narrowest_place(world, query)?;
    Some(Gap { place, width_m: width_at(world, place) })
}

/// Whether the robot fits through the narrowest place on its way, which `gap` is; false where there is no way.
pub(crate) fn fits(world: &World, gap: Option<&Gap>) -> bool {
    gap.is_some_and(|gap| gap.width_m >= 2.0 * world.robot.footprint.inscribed_radius_m())
}

/// Whether the headings are what is in the way: the robot finds no manoeuvre from its heading at the start, though a robot that
/// looks another way there would get through, or none to the heading that the goal `asks_heading` for. `None` where they are not.
pub(crate) fn unturned(world: &World, query: &Query, asks_heading: bool) -> Option<String> {
    let robot = world.guide_robot();
    let goal = goal_of(query.goal, world, None);
    let end = goal.easiest_end(world.geometry.clearance(), world.robot.footprint.inscribed_radius_m());
    let model = &world.robot;
    // Headings matter near the start alone: all of them join one way.
    let is_far = query.start.distance_m(&query.goal) >= JOINED_FROM_M;
    let beyond = is_far.then(|| route_beyond(&robot, query.start.position, (end, None)));
    if let Some(Err(_)) = beyond {
        return None;
    }
    let beyond = beyond.and_then(Result::ok);
    let leads_on = |start: Pose| match &beyond {
        Some(beyond) => joining(&robot, start, beyond).is_some(),
        None => ridge_routes(&robot, start, (end, None)).any(|route| route.is_ok()),
    };
    let leads_on_as_it_looks = leads_on(query.start);
    if goal.contains(query.start.position) || leads_on_as_it_looks {
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

/// The place with the least clearance on the way from start to goal whose least clearance is largest; `None` if no
/// free way joins them. Ways begin and end with the clearance that start and goal have.
fn narrowest_place(world: &World, query: &Query) -> Option<Point> {
    let frame = world.grid.frame();
    let ends = (around(world, query.start.position)?, around(world, query.goal.position)?);
    // Both are in order; in pairs they would take milliseconds.
    if ends.0.iter().any(|cell| ends.1.binary_search(cell).is_ok()) {
        return Some(query.start.position);
    }
    let place = world.geometry.clearance().widest_paths().narrowest_between(&ends.0, &ends.1)?;
    Some(frame.center(place))
}

/// The free cells near `end` that a way from it leads to, and those where it leaves them: near its ends a way may be as narrow
/// as they are, for that the robot fits there is checked elsewhere. In order; `None` outside the map.
fn around(world: &World, end: Point) -> Option<Vec<Cell>> {
    let (frame, field) = (world.grid.frame(), world.geometry.clearance());
    let near_m = 2.0 * world.robot.footprint.circumscribed_radius_m();
    let middle = frame.cell_at(end)?;
    let (mut seen, mut open) = (BTreeSet::from([middle]), vec![middle]);
    while let Some(cell) = open.pop() {
        if cell != middle && (frame.center(cell) - end).norm() >= near_m {
            continue;
        }
        for next in beside(frame, cell).filter(|&next| field.at(next) > 0.0) {
            if seen.insert(next) {
                open.push(next);
            }
        }
    }
    Some(seen.into_iter().collect())
}

/// The free length of the shortest straight line through `place`, metres.
pub(crate) fn width_at(world: &World, place: Point) -> f64 {
    let direction = |i: u32| std::f64::consts::PI * f64::from(i) / f64::from(DIRECTIONS);
    gap_m(world.geometry.clearance(), place, (0..DIRECTIONS).map(direction))
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
        let reason = obstruction(&world, &query, None).expect("no way");
        assert!(reason.contains("separate parts"), "{reason}");
        assert!(narrowest_gap(&world, &query).is_none(), "nothing leads through");
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
        let reason = obstruction(&World::new(grid, RobotModel::husky()), &query, None).expect("no way");
        assert!(reason.contains("only unknown space does"), "{reason}");
    }

    #[test]
    fn a_narrow_door_is_measured() {
        let obstruction =
            |(world, query): &(World, Query)| obstruction(world, query, narrowest_gap(world, query).as_ref());
        let reason = obstruction(&rooms(7)).expect("a narrow way");
        assert!(reason.contains("is 0.70 m wide at its narrowest place, near (3.0"), "{reason}");
        assert!(reason.contains("the husky is 0.67 m wide"), "{reason}");
        assert_eq!(obstruction(&rooms(12)), None, "a door of 1.2 m leaves room");
        let fits = |(world, query)| fits(&world, narrowest_gap(&world, &query).as_ref());
        let found = [6, 7, 12].map(rooms).map(fits);
        assert_eq!(found, [false, true, true], "doors of 0.6, 0.7 and 1.2 m for a robot of 0.67 m");
    }
}
