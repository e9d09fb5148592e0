//! Group 15: every guide and every driven run of the project's own problems, looked at by a checker of its own: at every
//! step of the simulator and three times between two steps.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Instant;

use rayon::prelude::*;
use sharp_drive::EpisodeEnd;
use sharp_maps::{LoadOptions, MapFile, load, named_maps};
use sharp_options::OptionKind;
use sharp_plan::{Answer, Method, Plan, Query, RunSettings, Sharp, run};
use sharp_sim::{
    BACK_OFF_MPS, Drive, NoiseModel, RobotModel, RobotState, Simulator, SimulatorKind, StepInfo, WheelCommand,
};
use sharp_space::{Cell, Occupancy, OccupancyGrid, Point, Pose, Seed};

use crate::checker::{Outline, deepest_m};
use crate::plans::fault;
use crate::{cases, told};

/// Looks at each step of the simulator.
const LOOKS: u32 = 4;
/// Overlap without contact up to which a run counts as clear, metres: what two solids of an engine may sink in.
const ALLOWED_M: f64 = 0.002;
/// By how much the body may be faster than its wheels, as a share: they push it sideways in a bend, and it keeps that speed
/// while it turns.
const SLIDE: f64 = 0.03;
/// The same of speeds near 0, metres per second.
const SLIDE_MPS: f64 = 0.005;
/// Runs of each plan under noise.
const RUNS: u32 = 5;

/// What was seen of a robot that is driven.
#[derive(Debug, Default)]
struct Seen {
    steps: u64,
    deepest_m: f64,
    faults: Vec<String>,
}

/// A simulator whose every step is looked at.
#[derive(Clone, Debug)]
struct WatchedSimulator {
    simulator: Box<dyn Simulator>,
    robot: Arc<RobotModel>,
    outline: Outline,
    map: Arc<MapFile>,
    /// Whether the robot keeps its limits exactly: noise pushes it beyond them.
    is_exact: bool,
    seen: Arc<Mutex<Seen>>,
}

impl Simulator for WatchedSimulator {
    fn reset(&mut self, state: RobotState) {
        self.simulator.reset(state);
    }

    fn step(&mut self, command: WheelCommand, dt_s: f64) -> StepInfo {
        let before = self.simulator.state().pose;
        let info = self.simulator.step(command, dt_s);
        self.look(before, command, info);
        info
    }

    fn state(&self) -> &RobotState {
        self.simulator.state()
    }
}

impl WatchedSimulator {
    fn look(&self, before: Pose, command: WheelCommand, info: StepInfo) {
        let state = *self.simulator.state();
        let mut seen = self.seen.lock().unwrap_or_else(PoisonError::into_inner);
        seen.steps += 1;
        if !info.in_contact {
            let turn = before.heading.turn_to(state.pose.heading);
            for look in 1..=LOOKS {
                let share = f64::from(look) / f64::from(LOOKS);
                let position = before.position + (state.pose.position - before.position) * share;
                let pose = Pose::at(position, (before.heading.radians() + share * turn).into());
                let overlap_m = deepest_m(&self.map.grid, &self.outline, pose);
                seen.deepest_m = seen.deepest_m.max(overlap_m);
                if overlap_m > ALLOWED_M {
                    seen.faults.push(format!("{overlap_m} m inside an obstacle at {pose:?}"));
                }
            }
        }
        if self.is_exact {
            let broken = beyond_limits(&self.robot, command).or_else(|| too_fast(&self.robot, &state));
            seen.faults.extend(broken.map(|what| format!("{what} at {:?}", state.pose)));
        }
    }
}

/// Which limit of `robot` a command breaks.
fn beyond_limits(robot: &RobotModel, command: WheelCommand) -> Option<String> {
    // Backing off is slow, and a robot that may do it says how far.
    let back_mps = if robot.recovery_reverse_m > 0.0 { -BACK_OFF_MPS } else { 0.0 };
    let speeds = robot.min_speed_mps.min(back_mps)..=robot.max_speed_mps;
    let is_kept = match (command, robot.drive) {
        (WheelCommand::Twist { speed_mps, yaw_rate_radps }, Drive::Differential { .. }) => {
            speeds.contains(&speed_mps) && yaw_rate_radps.abs() * robot.yaw_gain() <= robot.max_yaw_rate_radps
        }
        (WheelCommand::Steer { speed_mps, steer_rad }, Drive::Ackermann { max_steer_rad, .. }) => {
            speeds.contains(&speed_mps) && steer_rad.abs() <= max_steer_rad
        }
        _ => false,
    };
    (!is_kept).then(|| format!("{command:?}"))
}

/// What `robot` does that its wheels cannot.
fn too_fast(robot: &RobotModel, state: &RobotState) -> Option<String> {
    let (speed_mps, yaw_radps) = (state.velocity.x.abs(), state.yaw_rate_radps.abs());
    let bend_mps = robot.min_turning_radius_m() * yaw_radps;
    let limits = [
        (speed_mps, robot.max_speed_mps.max(-robot.min_speed_mps), "a speed of"),
        (yaw_radps, robot.max_yaw_rate_radps, "a yaw rate of"),
        (bend_mps, speed_mps, "a bend that is too tight:"),
    ];
    let broken = limits.into_iter().find(|(value, most, _)| *value > most * (1.0 + SLIDE) + SLIDE_MPS);
    broken.map(|(value, most, what)| format!("{what} {value}, at most {most}"))
}

/// The suite's robots and once more their outlines: half the length and half the width, metres.
fn robots() -> [(RobotModel, Outline); 2] {
    let corners = |x: f64, y: f64| Outline::Corners(vec![(x, y), (-x, y), (-x, -y), (x, -y)]);
    [(RobotModel::husky(), corners(0.5, 0.335)), (RobotModel::limo(), corners(0.16, 0.11))]
}

/// What is wrong with the runs of `plan` in `kind` of simulator under `noise`; and how many steps and arrivals there were.
fn drive(
    plan: &Arc<Plan>,
    map: &Arc<MapFile>,
    outline: &Outline,
    (kind, noise, runs): (SimulatorKind, NoiseModel, u32),
) -> (Seen, u32) {
    let seen = Arc::new(Mutex::new(Seen::default()));
    let watched = WatchedSimulator {
        simulator: plan.world.simulator(kind),
        robot: Arc::clone(&plan.world.robot),
        outline: outline.clone(),
        map: Arc::clone(map),
        is_exact: noise == NoiseModel::none(),
        seen: Arc::clone(&seen),
    };
    let mut settings = RunSettings::new(plan, runs, Seed(5));
    settings.simulator = Box::new(watched);
    settings.noise = noise;
    let (goal, tolerance_m) = (plan.solution.query.goal.position, plan.world.robot.goal_tolerance_m);
    let mut arrived = 0;
    let mut ends = Vec::new();
    for run in run(plan, &settings, &|| 0.0) {
        if run.end == EpisodeEnd::Reached {
            arrived += 1;
            let end = run.record.trace.last().expect("the start at least").position;
            ends.extend(wrong_end(map, end, goal, tolerance_m));
            if run.record.contacts > 0 {
                ends.push(format!("a success with {} contacts", run.record.contacts));
            }
        }
    }
    let mut seen = std::mem::take(&mut *seen.lock().unwrap_or_else(PoisonError::into_inner));
    seen.faults.extend(ends);
    (seen, arrived)
}

/// Why `end` is not at `goal`, if it is not.
fn wrong_end(map: &MapFile, end: Point, goal: Point, tolerance_m: f64) -> Option<String> {
    let off_m = (end - goal).norm();
    if off_m > tolerance_m {
        return Some(format!("it ends {off_m} m from its goal, allowed are {tolerance_m}"));
    }
    (!is_joined(&map.grid, end, goal, tolerance_m))
        .then(|| format!("a wall stands between {end:?} and the goal"))
}

/// Whether a way over free cells leads from `from` to `to` no further than `radius_m` from `to`.
fn is_joined(grid: &OccupancyGrid, from: Point, to: Point, radius_m: f64) -> bool {
    let frame = grid.frame();
    let (Some(first), Some(last)) = (frame.cell_at(from), frame.cell_at(to)) else { return false };
    // A cell counts as near if any part of it is.
    let reach_m = radius_m + frame.resolution_m;
    let (mut seen, mut open) = (vec![first], vec![first]);
    while let Some(Cell { col, row }) = open.pop() {
        if Cell::new(col, row) == last {
            return true;
        }
        let beside = [(col.wrapping_sub(1), row), (col + 1, row), (col, row.wrapping_sub(1)), (col, row + 1)];
        for next in beside.map(|(col, row)| Cell::new(col, row)) {
            let is_inside = next.col < frame.width && next.row < frame.height;
            let is_open = is_inside && grid.get(next) == Occupancy::Free;
            if is_open && (frame.center(next) - to).norm() <= reach_m && !seen.contains(&next) {
                seen.push(next);
                open.push(next);
            }
        }
    }
    false
}

/// Problem `number`: the first of all maps with both robots and kinds of option, then the second of all maps.
fn problem(
    number: u64,
    posed: &[(Arc<MapFile>, Query)],
) -> (Arc<MapFile>, Query, (RobotModel, Outline), OptionKind) {
    let (place, variant) = (number / 4, number % 4);
    let (map, query) = posed[place as usize].clone();
    let robot = robots()[(variant % 2) as usize].clone();
    let kind = if matches!(variant, 0 | 3) { OptionKind::Interface } else { OptionKind::Centroid };
    (map, query, robot, kind)
}

/// All problems, the first of each map before the second of any.
fn posed() -> Vec<(Arc<MapFile>, Query)> {
    let maps = named_maps().map(|name| Arc::new(load(name, &LoadOptions::default()).expect("it is our own")));
    let of_map = |map: Arc<MapFile>| {
        let problems = map.problems.clone().into_iter().enumerate();
        problems.map(move |(number, posed)| {
            (number, Arc::clone(&map), Query { start: posed.start, goal: posed.goal })
        })
    };
    let mut all: Vec<_> = maps.flat_map(of_map).collect();
    all.sort_by_key(|(number, ..)| *number);
    all.into_iter().map(|(_, map, query)| (map, query)).collect()
}

#[test]
fn nothing_that_is_planned_or_driven_in_the_suite_breaks_a_limit() {
    let since = Instant::now();
    let posed = posed();
    let all = 4 * posed.len() as u64;
    let count = cases(2, all).min(all);
    let results: Vec<(Seen, u32)> = (0..count)
        .into_par_iter()
        .map(|number| {
            let (map, query, (robot, outline), kind) = problem(number, &posed);
            let name = format!("{} {}, {kind:?} {query:?}", map.name, robot.name);
            let world = sharp_bench::named::world(&map, robot.clone());
            let detector = sharp_bench::named::detector(&world, "net").expect("it is our own");
            let method = Method::fast().with_episodes(100, 100, 100);
            let mut sharp = Sharp::new(world, detector).with_options(kind).with_method(method);
            let answer = sharp.solve(query, &()).unwrap_or_else(|error| panic!("{name}: {error}"));
            let Answer::Solved(plan) = answer else { panic!("{name}: {answer:?}") };
            let plan = Arc::new(*plan);
            let guides: Vec<_> = plan.solution.steps.iter().map(|step| Arc::clone(&step.option)).collect();
            let (mut seen, arrived) =
                drive(&plan, &map, &outline, (SimulatorKind::Planar, NoiseModel::nominal(), RUNS));
            let exact = drive(&plan, &map, &outline, (SimulatorKind::Kinematic, NoiseModel::none(), 1));
            seen.faults.extend(fault(&map.grid, &robot, &outline, &guides));
            seen.faults.extend(exact.0.faults);
            seen.faults.iter_mut().for_each(|fault| *fault = format!("{name}: {fault}"));
            seen.steps += exact.0.steps;
            seen.deepest_m = seen.deepest_m.max(exact.0.deepest_m);
            (seen, arrived + exact.1)
        })
        .collect();
    let steps: u64 = results.iter().map(|(seen, _)| seen.steps).sum();
    let arrived: u32 = results.iter().map(|(_, arrived)| arrived).sum();
    let deepest_mm = 1000.0 * results.iter().map(|(seen, _)| seen.deepest_m).fold(0.0, f64::max);
    let faults: Vec<&String> = results.iter().flat_map(|(seen, _)| &seen.faults).collect();
    told(
        "plans of the suite and their runs keep clear and within limits",
        count,
        &format!(
            "{} faults in {steps} steps, {arrived} of {} arrive, the deepest overlap {deepest_mm:.2} mm",
            faults.len(),
            count * u64::from(RUNS + 1)
        ),
        since,
    );
    assert!(faults.is_empty(), "{} faults: {:#?}", faults.len(), &faults[..faults.len().min(10)]);
    assert!(u64::from(arrived) * 10 >= 9 * count * u64::from(RUNS + 1), "{arrived} runs arrive");
}
