//! `sharp serve`: drives any robot or simulator from outside, one JSON line each way.

use std::path::Path;

use serde::{Deserialize, Serialize};
use sharp_plan::{Instruction, Plan, Reading, RemoteDriver};
use sharp_space::{Occupancy, Pose};

use crate::args::Serve;
use crate::commands::lines::answer_lines;
use crate::commands::run::load_tour;
use crate::outcome::{Exit, Failure, to_json};

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Request {
    pose: [f64; 3],
    /// Forward speed, metres per second; estimated from the poses where it is left out.
    speed: Option<f64>,
    /// Yaw rate, radians per second; estimated likewise.
    yaw_rate: Option<f64>,
}

#[derive(Serialize)]
struct Reply<'a> {
    waypoint: Option<[f64; 3]>,
    /// Speed at which the waypoint is to be approached, metres per second; negative for backwards.
    speed: f64,
    option: &'a str,
    status: &'static str,
}

pub(crate) fn run(args: &Serve) -> Result<Exit, Failure> {
    let folder = Path::new(&args.place);
    if folder.is_file() {
        let message = format!("{} is no plan's folder; a map is served with --library DIR", args.place);
        return Err(Failure::new("USAGE", message));
    }
    let tour = load_tour(folder)?;
    let plan = &tour.plans[0];
    let mut driver: Option<RemoteDriver> = None;
    answer_lines(|line, number| {
        let reading = match parse(line, number) {
            Ok(request) => reading(&request),
            Err(failure) => return Ok(vec![failure.to_json()]),
        };
        Ok(vec![if is_placed(plan, &reading.pose) {
            let begin = || RemoteDriver::new(tour.plans.clone(), &reading, true);
            reply(&driver.get_or_insert_with(begin).answer(&reading))
        } else {
            // What it knew of the robot before stays, for the next pose may be a real one again.
            to_json(&Reply { waypoint: None, speed: 0.0, option: "", status: "lost" })
        }])
    })
}

fn parse(line: &str, number: usize) -> Result<Request, Failure> {
    let broken = |problem: String| Failure::new("POSE_INVALID", format!("line {number}: {problem}"));
    let request: Request = serde_json::from_str(line).map_err(|error| broken(error.to_string()))?;
    let numbers = request.pose.iter().chain(&request.speed).chain(&request.yaw_rate);
    if numbers.into_iter().any(|number| !number.is_finite() || number.abs() > 1e9) {
        return Err(broken("pose, speed and yaw_rate must be finite".to_owned()));
    }
    Ok(request)
}

/// Returns true if a robot can be at `pose`: its middle is in the free space of the map.
fn is_placed(plan: &Plan, pose: &Pose) -> bool {
    let grid = &plan.world.grid;
    grid.frame().cell_at(pose.position).is_some_and(|cell| grid.get(cell) == Occupancy::Free)
}

fn reading(request: &Request) -> Reading {
    let Request { pose, speed, yaw_rate } = *request;
    Reading { pose: Pose::from(pose), speed_mps: speed, yaw_rate_radps: yaw_rate }
}

fn reply(instruction: &Instruction) -> String {
    let Instruction { waypoint, speed_mps, option, status } = *instruction;
    let waypoint = waypoint.map(|pose| [pose.position.x, pose.position.y, pose.heading.radians()]);
    to_json(&Reply { waypoint, speed: speed_mps, option: &option.to_string(), status: status.name() })
}
