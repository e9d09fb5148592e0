//! `sharp serve --library`: a learnt building takes goals and poses as JSON lines, and answers with plans and waypoints.

use serde::{Deserialize, Serialize};
use sharp_bench::{Dispatcher, NamedWorld, SolveSettings};
use sharp_maps::{LoadOptions, load};
use sharp_plan::{Method, Reading};
use sharp_sim::SimulatorKind;
use sharp_space::Pose;

use crate::args::Serve;
use crate::commands::lines::answer_lines;
use crate::outcome::{Exit, Failure, to_json};

/// A line from outside: one of goal, route, pose and cancel.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Line {
    goal: Option<Vec<f64>>,
    route: Option<Vec<Vec<f64>>>,
    pose: Option<[f64; 3]>,
    /// Forward speed, metres per second; estimated from the poses where it is left out.
    speed: Option<f64>,
    /// Yaw rate, radians per second; estimated likewise.
    yaw_rate: Option<f64>,
    cancel: Option<bool>,
}

/// What a line asks for.
enum Wish {
    Drive(Vec<Pose>),
    At(Reading),
    Cancel,
}

/// A goal that waits for the first pose.
#[derive(Serialize)]
struct Waiting {
    status: &'static str,
    goals: usize,
}

pub(crate) fn run(args: &Serve, seed: u64) -> Result<Exit, Failure> {
    let library = args.library.as_deref().expect("asked for");
    let map = load(&args.place, &LoadOptions { resolution_m: args.resolution, ..LoadOptions::default() })?;
    let place = NamedWorld::new(&map, &args.abstraction.robot, &args.noise)?;
    let settings = SolveSettings {
        abstraction: args.abstraction.request(),
        method: Method::fast().composed(),
        simulator: SimulatorKind::Kinematic,
        seed,
    };
    let mut dispatcher = Dispatcher::new(place, settings, library)?;
    let (options, hand_overs) = dispatcher.known();
    eprintln!("{options} options and {hand_overs} hand-overs known; goals and poses as lines");
    if hand_overs == 0 {
        eprintln!(
            "warning: the library knows no hand-overs, sharp learn makes them; answers take longer without"
        );
    }
    answer_lines(|line, number| match parse(line, number) {
        Ok(wish) => answer(&mut dispatcher, wish),
        Err(failure) => Ok(vec![failure.to_json()]),
    })
}

fn answer(dispatcher: &mut Dispatcher, wish: Wish) -> Result<Vec<String>, Failure> {
    let lines = match wish {
        Wish::Drive(goals) => {
            let lines = dispatcher.send(&goals)?;
            if lines.is_empty() {
                return Ok(vec![to_json(&Waiting { status: "waiting_for_pose", goals: goals.len() })]);
            }
            lines
        }
        Wish::At(reading) => dispatcher.drive(&reading)?,
        Wish::Cancel => {
            dispatcher.cancel();
            return Ok(vec![to_json(&Waiting { status: "cancelled", goals: 0 })]);
        }
    };
    Ok(lines.iter().map(to_json).collect())
}

fn parse(line: &str, number: usize) -> Result<Wish, Failure> {
    let broken = |problem: String| Failure::new("LINE_INVALID", format!("line {number}: {problem}"));
    let line: Line = serde_json::from_str(line).map_err(|error| broken(error.to_string()))?;
    let Line { goal, route, pose, speed, yaw_rate, cancel } = line;
    let is_sane = |value: &f64| value.is_finite() && value.abs() <= 1e9;
    match (goal, route, pose, cancel) {
        (Some(goal), None, None, None) => Ok(Wish::Drive(vec![place(&goal).map_err(&broken)?])),
        (None, Some(route), None, None) if route.is_empty() => {
            Err(broken("route is empty, expected a list of goals".to_owned()))
        }
        (None, Some(route), None, None) => {
            Ok(Wish::Drive(route.iter().map(|goal| place(goal)).collect::<Result<_, _>>().map_err(&broken)?))
        }
        (None, None, Some(pose), None) => {
            if !pose.iter().chain(&speed).chain(&yaw_rate).all(is_sane) {
                return Err(broken("pose, speed and yaw_rate must be finite".to_owned()));
            }
            Ok(Wish::At(Reading { pose: Pose::from(pose), speed_mps: speed, yaw_rate_radps: yaw_rate }))
        }
        (None, None, None, Some(true)) => Ok(Wish::Cancel),
        (None, None, None, Some(false)) => Err(broken("cancel is false, expected true".to_owned())),
        _ => Err(broken("expected one of goal, route, pose and cancel".to_owned())),
    }
}

/// A goal of two or three numbers.
fn place(numbers: &[f64]) -> Result<Pose, String> {
    match *numbers {
        [x, y] if x.is_finite() && y.is_finite() => Ok(Pose::new(x, y, 0.0)),
        [x, y, yaw] if numbers.iter().all(|number| number.is_finite()) => Ok(Pose::new(x, y, yaw)),
        _ => Err(format!("a goal is {numbers:?}, expected [x, y] or [x, y, yaw]")),
    }
}
