//! Floor plans drawn in metres: walls with doors, furniture, and the grid they become.
//!
//! A plan is RON. Walls run along an axis; each ends half a thickness beyond its end points, so
//! that corners close. A door is a gap in its own wall. A cell is occupied if its centre lies in a
//! wall or in furniture.
//!
//! ```ron
//! (
//!     size_m: (6.0, 4.0), resolution_m: 0.05, wall_thickness_m: 0.2,
//!     walls: [
//!         Across(y: 2.0, x: (0.0, 6.0), doors: [(at: 4.5, width: 1.2)]),
//!         Along(x: 3.0, y: (0.0, 2.0)),
//!     ],
//!     furniture: [Box(x: (0.4, 1.2), y: (0.5, 0.9)), Disc(x: 5.0, y: 1.0, radius: 0.4)],
//! )
//! ```

use serde::Deserialize;
use sharp_space::{GridFrame, Occupancy, OccupancyGrid, Pose, trig};

use super::error::MapError;
use super::load::check_size;

/// Rounding must not decide about a cell whose centre lies on an edge, metres.
const EDGE_M: f64 = 1e-6;

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct FloorPlan {
    size_m: (f64, f64),
    resolution_m: f64,
    wall_thickness_m: f64,
    walls: Vec<PlanWall>,
    #[serde(default)]
    furniture: Vec<Furniture>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
enum PlanWall {
    /// Along the x axis.
    Across {
        y: f64,
        x: (f64, f64),
        #[serde(default)]
        doors: Vec<DoorGap>,
    },
    /// Along the y axis.
    Along {
        x: f64,
        y: (f64, f64),
        #[serde(default)]
        doors: Vec<DoorGap>,
    },
}

/// A gap of `width` metres around the coordinate `at` along the wall.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct DoorGap {
    at: f64,
    width: f64,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
enum Furniture {
    Box { x: (f64, f64), y: (f64, f64) },
    Disc { x: f64, y: f64, radius: f64 },
}

/// Reads a floor plan and draws it as a grid whose lower-left corner is the world's origin.
pub(crate) fn parse(file: &str, text: &str) -> Result<OccupancyGrid, MapError> {
    draw(file, &read(file, text)?)
}

fn read(file: &str, text: &str) -> Result<FloorPlan, MapError> {
    ron::from_str(text).map_err(|e| MapError::syntax(file, format!("is no floor plan: {e}")))
}

fn draw(file: &str, plan: &FloorPlan) -> Result<OccupancyGrid, MapError> {
    let mut canvas = Canvas::new(file, plan)?;
    for (number, wall) in plan.walls.iter().enumerate() {
        let field = format!("walls[{number}]");
        check_doors(file, &field, wall)?;
        canvas.wall(wall).map_err(|value| MapError::field(file, field, value, SOUND))?;
    }
    for (number, piece) in plan.furniture.iter().enumerate() {
        let field = format!("furniture[{number}]");
        canvas.furniture(piece).map_err(|value| MapError::field(file, field, value, SOUND))?;
    }
    OccupancyGrid::new(canvas.frame, canvas.cells).map_err(|e| MapError::grid(file, e))
}

const SOUND: &str =
    "made of finite numbers, with intervals that run upwards, lengths above 0 and a part inside the map";

/// Refuses doors that are not in their wall, or in each other.
fn check_doors(file: &str, wall_field: &str, wall: &PlanWall) -> Result<(), MapError> {
    let (PlanWall::Across { x: wall, doors, .. } | PlanWall::Along { y: wall, doors, .. }) = wall;
    let span = |door: &DoorGap| (door.at - 0.5 * door.width, door.at + 0.5 * door.width);
    for (number, door) in doors.iter().enumerate() {
        let (from, to) = span(door);
        let refuse = |expected| {
            let value = format!("{} m wide at {}", door.width, door.at);
            Err(MapError::field(file, format!("{wall_field}.doors[{number}]"), value, expected))
        };
        if !(from < to && from >= wall.0 - EDGE_M && to <= wall.1 + EDGE_M) {
            return refuse(format!("wider than 0 and within its wall, from {} to {}", wall.0, wall.1));
        }
        let meets = |other: &&DoorGap| from < span(other).1 - EDGE_M && span(other).0 < to - EDGE_M;
        if let Some(other) = doors[..number].iter().find(meets) {
            return refuse(format!("clear of the door {} m wide at {}", other.width, other.at));
        }
    }
    Ok(())
}

struct Canvas {
    frame: GridFrame,
    half_thickness_m: f64,
    cells: Vec<Occupancy>,
}

impl Canvas {
    fn new(file: &str, plan: &FloorPlan) -> Result<Self, MapError> {
        let FloorPlan { size_m: (width_m, height_m), resolution_m, wall_thickness_m, .. } = *plan;
        for (field, value) in [
            ("size_m.0", width_m),
            ("size_m.1", height_m),
            ("resolution_m", resolution_m),
            ("wall_thickness_m", wall_thickness_m),
        ] {
            if !(value > 0.0 && value.is_finite()) {
                return Err(MapError::field(file, field, value, "a finite number of metres above 0"));
            }
        }
        let (width, height) =
            ((width_m / resolution_m).round() as usize, (height_m / resolution_m).round() as usize);
        check_size(file, width, height)?;
        let frame = GridFrame { origin: Pose::new(0.0, 0.0, 0.0), resolution_m, width, height };
        let half_thickness_m = 0.5 * wall_thickness_m;
        Ok(Self { frame, half_thickness_m, cells: vec![Occupancy::Free; width * height] })
    }

    /// Draws a wall. The error is the text of a wall that is not sound.
    fn wall(&mut self, wall: &PlanWall) -> Result<(), String> {
        let half = self.half_thickness_m;
        let (line, span, doors) = match wall {
            PlanWall::Across { y, x, doors } => (*y, *x, doors),
            PlanWall::Along { x, y, doors } => (*x, *y, doors),
        };
        let (across_m, along_m) = match wall {
            PlanWall::Across { .. } => (self.frame.height_m(), self.frame.width_m()),
            PlanWall::Along { .. } => (self.frame.width_m(), self.frame.height_m()),
        };
        let is_inside = overlaps((line - half, line + half), across_m) && overlaps(span, along_m);
        if !(line.is_finite() && is_interval(span) && is_inside) {
            return Err(format!("{wall:?}"));
        }
        for stretch in stretches((span.0 - half, span.1 + half), doors) {
            match wall {
                PlanWall::Across { .. } => self.fill(stretch, (line - half, line + half), |_, _| true),
                PlanWall::Along { .. } => self.fill((line - half, line + half), stretch, |_, _| true),
            }
        }
        Ok(())
    }

    /// Draws a piece of furniture. The error is the text of a piece that is not sound.
    fn furniture(&mut self, piece: &Furniture) -> Result<(), String> {
        let (x, y) = match *piece {
            Furniture::Box { x, y } => (x, y),
            Furniture::Disc { x, y, radius } => ((x - radius, x + radius), (y - radius, y + radius)),
        };
        let (width_m, height_m) = (self.frame.width_m(), self.frame.height_m());
        if !(is_interval(x) && is_interval(y) && overlaps(x, width_m) && overlaps(y, height_m)) {
            return Err(format!("{piece:?}"));
        }
        match *piece {
            Furniture::Box { .. } => self.fill(x, y, |_, _| true),
            Furniture::Disc { x: cx, y: cy, radius } => {
                self.fill(x, y, |px, py| trig::hypot(px - cx, py - cy) <= radius);
            }
        }
        Ok(())
    }

    /// Occupies the cells of a rectangle whose centres satisfy `inside`.
    fn fill(&mut self, x: (f64, f64), y: (f64, f64), inside: impl Fn(f64, f64) -> bool) {
        let resolution_m = self.frame.resolution_m;
        let center = |index: usize| (index as f64 + 0.5) * resolution_m;
        // Negative values become 0 in the cast: what lies outside the map is cut off.
        let index = |edge: f64| ((edge - EDGE_M) / resolution_m - 0.5).ceil() as usize;
        for row in index(y.0)..index(y.1).min(self.frame.height) {
            for col in index(x.0)..index(x.1).min(self.frame.width) {
                if inside(center(col), center(row)) {
                    self.cells[row * self.frame.width + col] = Occupancy::Occupied;
                }
            }
        }
    }
}

fn is_interval((from, to): (f64, f64)) -> bool {
    from.is_finite() && to.is_finite() && from < to
}

/// Returns true if a part of the interval lies between 0 and `length_m`.
fn overlaps((from, to): (f64, f64), length_m: f64) -> bool {
    from < length_m && to > 0.0
}

/// What the doors leave of a wall.
fn stretches(wall: (f64, f64), doors: &[DoorGap]) -> Vec<(f64, f64)> {
    let mut gaps: Vec<DoorGap> = doors.to_vec();
    gaps.sort_by(|a, b| a.at.total_cmp(&b.at));
    let mut stretches = Vec::with_capacity(gaps.len() + 1);
    let mut from = wall.0;
    for DoorGap { at, width } in gaps {
        stretches.push((from, at - 0.5 * width));
        from = from.max(at + 0.5 * width);
    }
    stretches.push((from, wall.1));
    stretches.retain(|(from, to)| from < to);
    stretches
}

/// The plan without its doors and furniture, and how wide the doors are, metres.
#[cfg(test)]
pub(crate) fn shell(text: &str) -> (OccupancyGrid, Vec<f64>) {
    let mut plan = read("plan", text).expect("a sound plan");
    let mut widths_m = Vec::new();
    for wall in &mut plan.walls {
        let (PlanWall::Across { doors, .. } | PlanWall::Along { doors, .. }) = wall;
        widths_m.extend(doors.drain(..).map(|door| door.width));
    }
    plan.furniture.clear();
    (draw("plan", &plan).expect("a sound plan"), widths_m)
}

#[cfg(test)]
mod tests {
    use expect_test::{Expect, expect};

    use super::*;

    fn check(plan: &str, expected: &Expect) {
        let text = match parse("plan", plan) {
            Ok(grid) => grid.to_string(),
            Err(error) => error.to_string(),
        };
        expected.assert_eq(&text);
    }

    #[test]
    fn walls_meet_in_closed_corners_and_doors_are_gaps() {
        check(
            "(size_m: (8.0, 5.0), resolution_m: 0.5, wall_thickness_m: 1.0,
              walls: [Across(y: 4.0, x: (1.0, 7.0), doors: [(at: 5.5, width: 1.0)]), Along(x: 1.0, y: (1.0, 4.0))],
              furniture: [Box(x: (3.0, 5.0), y: (1.0, 2.0)), Disc(x: 7.0, y: 1.0, radius: 0.8)])",
            &expect![[r#"
                ................
                .#########..###.
                .#########..###.
                .##.............
                .##.............
                .##.............
                .##...####...##.
                .##...####..####
                .##.........####
                .............##.
            "#]],
        );
    }

    #[test]
    fn unsound_plans_name_the_field() {
        let plan = |walls: &str| {
            format!("(size_m: (2.0, 1.0), resolution_m: 0.5, wall_thickness_m: 0.5, walls: [{walls}])")
        };
        check(
            &plan("Across(y: 0.5, x: (2.0, 0.0))"),
            &expect![
                "plan: walls[0] is Across { y: 0.5, x: (2.0, 0.0), doors: [] }, must be made of finite numbers, with intervals that run upwards, lengths above 0 and a part inside the map"
            ],
        );
        check(
            &plan("Along(x: inf, y: (0.0, 1.0))"),
            &expect![
                "plan: walls[0] is Along { x: inf, y: (0.0, 1.0), doors: [] }, must be made of finite numbers, with intervals that run upwards, lengths above 0 and a part inside the map"
            ],
        );
        check(
            &plan("Along(x: 1.0, z: (0.0, 1.0))"),
            &expect![
                "plan: is no floor plan: 1:86-1:87: Unexpected field named `z` in `Along`, expected one of `x`, `y`, or `doors` instead"
            ],
        );
        check(
            &plan("Along(x: 1.0, y: (0.0, 1.0), doors: [(at: 0.5, width: 1.2)])"),
            &expect![
                "plan: walls[0].doors[0] is 1.2 m wide at 0.5, must be wider than 0 and within its wall, from 0 to 1"
            ],
        );
        check(
            &plan("Across(y: 0.5, x: (0.0, 2.0), doors: [(at: 0.5, width: 0.6), (at: 1.0, width: 0.6)])"),
            &expect![
                "plan: walls[0].doors[1] is 0.6 m wide at 1, must be clear of the door 0.6 m wide at 0.5"
            ],
        );
        check(
            &plan("Across(y: 20.0, x: (0.0, 2.0))"),
            &expect![
                "plan: walls[0] is Across { y: 20.0, x: (0.0, 2.0), doors: [] }, must be made of finite numbers, with intervals that run upwards, lengths above 0 and a part inside the map"
            ],
        );
        check(
            "(size_m: (1e9, 1.0), resolution_m: 0.5, wall_thickness_m: 0.5, walls: [])",
            &expect![
                "plan: size is 2000000000 x 2, must be 1 to 32767 cells a side and at most 67108864 in all"
            ],
        );
        check(
            "(size_m: (1.0, -1.0), resolution_m: 0.5, wall_thickness_m: 0.5, walls: [])",
            &expect!["plan: size_m.1 is -1, must be a finite number of metres above 0"],
        );
    }
}
