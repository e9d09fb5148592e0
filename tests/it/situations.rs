//! Small situations in which planners are often wrong: each is solved and driven, and the right answer is asserted.

use std::sync::Arc;

use sharp_drive::EpisodeEnd;
use sharp_guide::{Departure, is_tight};
use sharp_options::OptionKind;
use sharp_plan::{
    Conditions, Method, OptionLibrary, Outcome, Plan, PlanningProblem, Query, RunSettings, Solution, record,
    solve,
};
use sharp_sim::{NoiseModel, RobotModel};
use sharp_space::{OccupancyGrid, Pose, Seed};

use crate::worlds::TestWorld;

/// Side of a cell, metres.
const CELL_M: f64 = 0.05;

/// A room of `width_m` x `height_m` with walls of 0.1 m around it, and `walls` in it: left, bottom, right and top of
/// each, metres.
fn room((width_m, height_m): (f64, f64), walls: &[[f64; 4]]) -> OccupancyGrid {
    let cells = |metres: f64| (metres / CELL_M).round() as usize;
    let (width, height) = (cells(width_m), cells(height_m));
    let border = [
        [0.0, 0.0, width_m, 0.1],
        [0.0, height_m - 0.1, width_m, height_m],
        [0.0, 0.0, 0.1, height_m],
        [width_m - 0.1, 0.0, width_m, height_m],
    ];
    let is_wall = |col: usize, row: usize| {
        let holds = |wall: &[f64; 4]| {
            let [left, bottom, right, top] = wall.map(cells);
            (left..right).contains(&col) && (bottom..top).contains(&row)
        };
        border.iter().chain(walls).any(holds)
    };
    let line =
        |row: usize| (0..width).map(|col| if is_wall(col, row) { '#' } else { '.' }).collect::<String>();
    let lines: Vec<String> = (0..height).rev().map(line).collect();
    OccupancyGrid::from_ascii(CELL_M, &lines.join("\n")).expect("a sound drawing")
}

/// Solves `query` in `grid`, and drives the plan thirty times.
fn solved(grid: OccupancyGrid, robot: RobotModel, query: Query) -> (TestWorld, Solution, usize) {
    let (world, solution, ends) = driven(grid, robot, query, Method::fast());
    (world, solution, ends.len())
}

/// The same by `method`; gives the poses in which the drives that reached the goal end.
fn driven(
    grid: OccupancyGrid,
    robot: RobotModel,
    query: Query,
    method: Method,
) -> (TestWorld, Solution, Vec<Pose>) {
    let world = TestWorld::with_one_region(grid, robot, OptionKind::Interface);
    let noise = NoiseModel::nominal();
    let conditions = Conditions::new(&world.world, noise.clone());
    let problem = PlanningProblem {
        world: &world.world,
        method: &method,
        conditions: &conditions,
        query,
        seed: Seed(1),
        monitor: &(),
    };
    let outcome = solve(&problem, &world.abstraction, &mut OptionLibrary::in_memory()).expect("no files");
    let Outcome::Solved(solution) = outcome else { panic!("{query:?}: {outcome:?}") };
    let plan = Arc::new(Plan {
        world: world.world.clone(),
        abstraction: world.abstraction.clone(),
        noise,
        method,
        seed: Seed(1),
        solution: (*solution).clone(),
    });
    let runs = record(&plan, &RunSettings::new(&plan, 30, Seed(2)), &|| 0.0);
    let reached = runs.iter().filter(|run| run.execution.end == EpisodeEnd::Reached);
    let ends = reached.map(|run| run.moments[run.moments.len() - 1].state.pose).collect();
    (world, *solution, ends)
}

/// From `start` to `goal` (x, y, yaw).
fn from_to(start: [f64; 3], goal: [f64; 3]) -> Query {
    Query { start: Pose::from(start), goal: Pose::from(goal) }
}

fn departure(solution: &Solution) -> Departure {
    solution.steps[0].option.departure
}

#[test]
fn nose_in_at_a_wall_a_robot_backs_off_first() {
    for robot in [RobotModel::husky(), RobotModel::limo()] {
        let nose_m = robot.footprint.half_length_m();
        // 8 cm before the wall at the left, which it faces.
        let query = from_to([0.1 + 0.08 + nose_m, 2.0, std::f64::consts::PI], [5.0, 2.5, 0.0]);
        let name = robot.name.clone();
        let (_, solution, reached) = solved(room((6.0, 5.0), &[]), robot, query);
        assert!(departure(&solution).back_off_m > 0.0, "{name}: {:?}", departure(&solution));
        assert!(solution.predicted.rate() > 0.8, "{name}: {:?}", solution.predicted);
        assert!(reached >= 22, "{name}: {reached} of 30 arrived");
    }
}

#[test]
fn close_beside_a_wall_a_robot_leaves_on_a_curve() {
    let robot = RobotModel::husky();
    // 3 cm to the wall on its left.
    let start = [1.5, 5.9 - 0.03 - robot.footprint.half_width_m(), 0.0];
    let query = from_to(start, [3.0, 1.5, 0.0]);
    let (world, solution, reached) = solved(room((7.0, 6.0), &[]), robot, query);
    assert!(is_tight(&world.world.guide_robot(), query.start), "a tight start");
    assert!(departure(&solution).careful_m > 0.0, "{:?}", departure(&solution));
    assert!(solution.predicted.rate() > 0.9 && reached >= 25, "{:?}, {reached} of 30", solution.predicted);
}

#[test]
fn in_the_open_a_robot_follows_its_guide_at_once() {
    let query = from_to([1.5, 2.0, 0.0], [5.0, 2.5, 0.0]);
    let (world, solution, reached) = solved(room((6.0, 5.0), &[]), RobotModel::husky(), query);
    assert!(!is_tight(&world.world.guide_robot(), query.start), "an open start");
    assert!(departure(&solution).is_none() && reached >= 27, "{:?}, {reached} of 30", departure(&solution));
}

#[test]
fn a_car_takes_a_door_beside_it_without_a_loop() {
    // A wall across the room with a door of 0.9 m. The car stands close before the wall, beside the door.
    let walls = [[2.4, 0.0, 2.6, 1.2], [2.4, 2.1, 2.6, 4.0]];
    let query = from_to([1.85, 0.5, 0.0], [4.0, 0.6, 0.0]);
    let (_, solution, reached) = solved(room((6.0, 4.0), &walls), RobotModel::limo(), query);
    let length_m: f64 = solution.steps.iter().map(|step| step.option.guide.length_m()).sum();
    assert!(length_m < 4.4, "{length_m} m, the straight way through the door is 3 m");
    assert!(solution.predicted.rate() > 0.85 && reached >= 24, "{:?}, {reached} of 30", solution.predicted);
}

#[test]
fn a_goal_behind_a_thin_wall_is_reached_round_its_end() {
    let walls = [[3.0, 0.0, 3.05, 2.8]];
    let query = from_to([2.85, 1.2, 1.57], [3.2, 1.2, 0.0]);
    let (_, solution, reached) = solved(room((6.0, 4.0), &walls), RobotModel::limo(), query);
    let length_m: f64 = solution.steps.iter().map(|step| step.option.guide.length_m()).sum();
    assert!(length_m > 2.5 && reached >= 27, "{length_m} m, {reached} of 30: 0.35 m away, behind the wall");
}

#[test]
fn at_its_goal_a_robot_stays_whatever_its_heading() {
    for heading in [0.0, 2.0] {
        let query = from_to([2.0, 2.0, 0.0], [2.05, 2.0, heading]);
        let (_, solution, reached) = solved(room((4.0, 4.0), &[]), RobotModel::husky(), query);
        assert_eq!((solution.predicted.failures(), solution.predicted_time_s, reached), (0, 0.0, 30));
    }
}

#[test]
fn a_goal_that_asks_for_a_heading_is_reached_in_it() {
    for (robot, heading) in [(RobotModel::husky(), 2.5), (RobotModel::limo(), -1.5)] {
        let mut method = Method::fast();
        method.search.goal_heading_tolerance_rad = Some(0.3);
        let (name, query) = (robot.name.clone(), from_to([1.5, 2.5, 0.0], [5.0, 2.5, heading]));
        let (_, solution, ends) = driven(room((8.0, 5.0), &[]), robot, query, method);
        assert!(solution.predicted.rate() > 0.9 && ends.len() >= 27, "{name}: {:?}", solution.predicted);
        for end in ends {
            let off_rad = end.heading.turn_to(query.goal.heading).abs();
            assert!(off_rad <= 0.3, "{name}: {off_rad} rad off");
        }
    }
}
