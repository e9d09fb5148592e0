//! Group 7: problems without a solution, by construction. Each is answered with no plan and the right reason in words.

use std::time::{Duration, Instant};

use rand::RngExt;
use rayon::prelude::*;
use sharp_drive::World;
use sharp_plan::{Answer, Method, Query, Sharp};
use sharp_regions::GeometricDetector;
use sharp_sim::RobotModel;
use sharp_space::{OccupancyGrid, Pose, Seed, Stream};

use crate::worlds::Drawing;
use crate::{cases, told};

const CELL_M: f64 = 0.1;

/// A building without a way from the first pose to the second, and what the answer has to say.
fn problem(kind: u64, rng: &mut Stream) -> (OccupancyGrid, RobotModel, Query, &'static str) {
    let cells = |metres: f64| (metres / CELL_M).round() as usize;
    let size = 80 + rng.random_range(0..70);
    let mut drawing = Drawing::room(size, size);
    let wall = size / 2 + rng.random_range(0..10);
    drawing.paint(wall..wall + 2, 0..size, true);
    let robot = if rng.random() { RobotModel::husky() } else { RobotModel::limo() };
    let width_m = 2.0 * robot.footprint.half_width_m();
    let reason = match kind {
        // A wall without a door.
        0 => "separate parts",
        // A door that is narrower than the robot, by one cell at least.
        1 => {
            let door = (cells(width_m) - 1).max(1);
            let from = rng.random_range(20..size - 20);
            drawing.paint(wall..wall + 2, from..from + door, false);
            "wide at its narrowest place"
        }
        // A door, and behind it a closet around the goal.
        2 => {
            drawing.paint(wall..wall + 2, 20..36, false);
            drawing.paint(size - 30..size, size - 30..size - 28, true);
            drawing.paint(size - 30..size - 28, size - 30..size, true);
            "separate parts"
        }
        // Two doors in a row, the second too narrow.
        _ => {
            drawing.paint(wall..wall + 2, 20..36, false);
            drawing.paint(wall + 14..wall + 16, 0..size, true);
            let door = (cells(width_m) - 1).max(1);
            drawing.paint(wall + 14..wall + 16, 40..40 + door, false);
            "wide at its narrowest place"
        }
    };
    let turn = std::f64::consts::TAU * rng.random::<f64>();
    let start = Pose::new(1.5 + rng.random::<f64>(), 1.5 + 4.0 * rng.random::<f64>(), turn);
    let far_m = size as f64 * CELL_M - 1.4;
    let goal = Pose::new(far_m, far_m, 0.0);
    (drawing.grid(CELL_M), robot, Query { start, goal }, reason)
}

#[test]
fn what_has_no_solution_is_answered_with_the_right_reason() {
    let since = Instant::now();
    let count = cases(24, 4_000);
    let wrong: Vec<(Duration, Option<String>)> = (0..count)
        .into_par_iter()
        .map(|number| {
            let mut rng = Seed(18).stream("unsolvable", number);
            // A wall may have come to stand on an end: then another building is drawn.
            let drawn = std::iter::repeat_with(|| problem(number % 4, &mut rng));
            let mut worlds =
                drawn.map(|(grid, robot, query, reason)| (World::new(grid, robot), query, reason));
            let has_room = |(world, query, _): &(World, Query, _)| {
                world.geometry.is_free(query.start) && world.geometry.is_free(query.goal)
            };
            let (world, query, reason) = worlds.find(has_room).expect("it is drawn until it has");
            let name = format!("number {number}, {}: {query:?}", world.robot.name);
            let method = Method::fast().with_episodes(50, 50, 50);
            let begun = Instant::now();
            let answer =
                Sharp::new(world, GeometricDetector::default()).with_method(method).solve(query, &());
            let took = begun.elapsed();
            let wrong = match answer.expect("there is room") {
                Answer::NoPlan(words) if words.contains(reason) => None,
                Answer::NoPlan(words) => Some(format!("{name}: says {words:?}, not {reason:?}")),
                other => Some(format!("{name}: {other:?}")),
            };
            (took, wrong)
        })
        .collect();
    let slowest = wrong.iter().map(|case| case.0).max().unwrap_or_default();
    let wrong: Vec<String> = wrong.into_iter().filter_map(|case| case.1).collect();
    told(
        "no plan is said with its reason",
        count,
        &format!("{} wrong, the slowest {:.2} s", wrong.len(), slowest.as_secs_f64()),
        since,
    );
    assert!(wrong.is_empty(), "{} of {count}: {:#?}", wrong.len(), &wrong[..wrong.len().min(5)]);
}
