//! Random buildings and robots, drawn by this file alone: none of it is shared with the maps that the project ships.

use std::sync::Arc;

use rand::RngExt;
use sharp_drive::World;
use sharp_options::{OptionKind, OptionSet, OptionSettings};
use sharp_plan::{Abstraction, Query};
use sharp_rbvd::{Rbvd, RbvdSettings};
use sharp_regions::{GeometricSettings, geometric_regions};
use sharp_sim::RobotModel;
use sharp_space::{Cell, OccupancyGrid, Pose, Stream};

use crate::checker::Outline;

/// A grid under construction, row 0 at the bottom.
pub(crate) struct Drawing {
    cells: Vec<Vec<bool>>,
}

impl Drawing {
    /// A walled room of so many cells.
    pub(crate) fn room(width: usize, height: usize) -> Self {
        let is_wall = |col: usize, row: usize| col == 0 || row == 0 || col + 1 == width || row + 1 == height;
        let row = |row: usize| (0..width).map(|col| is_wall(col, row)).collect();
        Self { cells: (0..height).map(row).collect() }
    }

    /// Fills or clears a rectangle, as far as it lies inside the outer walls.
    pub(crate) fn paint(
        &mut self,
        cols: std::ops::Range<usize>,
        rows: std::ops::Range<usize>,
        is_wall: bool,
    ) {
        let (width, height) = (self.cells[0].len(), self.cells.len());
        for row in rows.start.max(1)..rows.end.min(height - 1) {
            for col in cols.start.max(1)..cols.end.min(width - 1) {
                self.cells[row][col] = is_wall;
            }
        }
    }

    pub(crate) fn grid(&self, resolution_m: f64) -> OccupancyGrid {
        let line = |row: &Vec<bool>| row.iter().map(|&wall| if wall { '#' } else { '.' }).collect::<String>();
        let lines: Vec<String> = self.cells.iter().rev().map(line).collect();
        OccupancyGrid::from_ascii(resolution_m, &lines.join("\n")).expect("a sound drawing")
    }
}

/// A building of 6 to 9 m with walls across it, doors of 0.5 to 1.6 m in them, and boxes.
pub(crate) fn building(rng: &mut Stream) -> OccupancyGrid {
    let resolution_m = [0.05, 0.1][rng.random_range(0..2)];
    let cells = |metres: f64| (metres / resolution_m).round() as usize;
    let mut between = |low: f64, high: f64| low + (high - low) * rng.random::<f64>();
    let (width, height) = (cells(between(6.0, 9.0)), cells(between(6.0, 9.0)));
    let mut drawing = Drawing::room(width, height);
    for _ in 0..(between(1.0, 4.0) as usize) {
        let (across, door) = (between(0.0, 1.0) < 0.5, cells(between(0.5, 1.6)));
        let size = if across { width } else { height };
        let at = cells(between(1.0, size as f64 * resolution_m - 1.0));
        let thick = cells(between(0.1, 0.3)).max(1);
        let from = cells(between(0.2, (if across { height } else { width }) as f64 * resolution_m - 2.0));
        if across {
            drawing.paint(at..at + thick, 0..height, true);
            drawing.paint(at..at + thick, from..from + door, false);
        } else {
            drawing.paint(0..width, at..at + thick, true);
            drawing.paint(from..from + door, at..at + thick, false);
        }
    }
    for _ in 0..(between(0.0, 6.0) as usize) {
        let (col, row) = (cells(between(0.5, 8.0)), cells(between(0.5, 8.0)));
        let (w, h) = (cells(between(0.1, 0.8)).max(1), cells(between(0.1, 0.8)).max(1));
        drawing.paint(col..col + w, row..row + h, true);
    }
    drawing.grid(resolution_m)
}

/// A robot of random outline and drive, and its outline once more for the checker.
pub(crate) fn robot(rng: &mut Stream) -> (RobotModel, Outline) {
    let mut between = |low: f64, high: f64| low + (high - low) * rng.random::<f64>();
    let speed = between(0.3, 1.2);
    let (length, width) = (between(0.1, 0.5), between(0.08, 0.33));
    let car = format!("Ackermann(wheelbase_m: {length}, max_steer_rad: 0.45)");
    let (shape, drive, outline) = match between(0.0, 4.0) as u32 {
        0 => {
            let corners = vec![(length, width), (-length, width), (-length, -width), (length, -width)];
            (
                format!("footprint: (half_length_m: {length}, half_width_m: {width})"),
                "Differential()",
                corners,
            )
        }
        1 => {
            // A nose, and the reference point behind the middle.
            let corners = vec![
                (length, 0.0),
                (0.6 * length, width),
                (-0.4 * length, width),
                (-0.4 * length, -width),
                (0.6 * length, -width),
            ];
            let text: Vec<String> = corners.iter().map(|(x, y)| format!("[{x}, {y}]")).collect();
            (format!("footprint: \"[{}]\"", text.join(", ")), "Differential()", corners)
        }
        2 => (format!("robot_radius: {width}"), "Differential()", vec![]),
        _ => {
            let (length, width) = (0.5 * length, 0.5 * width);
            let corners = vec![(length, width), (-length, width), (-length, -width), (length, -width)];
            (format!("footprint: (half_length_m: {length}, half_width_m: {width})"), &*car, corners)
        }
    };
    let text = format!("({shape}, drive: {drive}, max_speed_mps: {speed})");
    let robot = RobotModel::from_ron_named(&text, "random").unwrap_or_else(|error| panic!("{text}: {error}"));
    let outline = if outline.is_empty() { Outline::Disc(width) } else { Outline::Corners(outline) };
    (robot, outline)
}

/// The abstraction of `robot` in `grid` by geometric regions; `None` where it has no room.
pub(crate) fn abstraction(
    grid: &OccupancyGrid,
    robot: RobotModel,
    kind: OptionKind,
) -> Option<(World, Abstraction)> {
    let prediction = geometric_regions(grid, &robot.footprint, &GeometricSettings::default());
    let resolution_m = grid.frame().resolution_m;
    let world = World::new(grid.clone(), robot);
    let settings = RbvdSettings::for_footprint(&world.robot.footprint, 0.5 * resolution_m, resolution_m);
    let rbvd = Rbvd::build(world.geometry.clearance(), &prediction.regions, &settings).ok()?;
    let options = OptionSet::synthesize(&rbvd, kind, &OptionSettings::default());
    Some((world, Abstraction { states: Arc::new(rbvd), options: Arc::new(options) }))
}

/// Two random poses at which the robot fits; `None` where a hundred draws find none.
pub(crate) fn query(world: &World, rng: &mut Stream) -> Option<Query> {
    let frame = *world.grid.frame();
    let mut pose = || {
        (0..100).find_map(|_| {
            let cell = Cell::new(rng.random_range(0..frame.width), rng.random_range(0..frame.height));
            let pose = Pose::at(frame.center(cell), (std::f64::consts::TAU * rng.random::<f64>()).into());
            world.geometry.is_free(pose).then_some(pose)
        })
    };
    Some(Query { start: pose()?, goal: pose()? })
}
