//! `sharp serve`: drives any robot or simulator from outside, one JSON line each way.

use std::io::{BufRead, Write};
use std::path::Path;

use serde::{Deserialize, Serialize};
use sharp_plan::{Instruction, Plan, Reading, RemoteDriver};
use sharp_space::{Occupancy, Pose};

use crate::args::Serve;
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
    let tour = load_tour(Path::new(&args.place))?;
    let plan = &tour.plans[0];
    let mut driver: Option<RemoteDriver> = None;
    let mut out = std::io::stdout().lock();
    for (index, line) in std::io::stdin().lock().split(b'\n').enumerate() {
        let line = line.map_err(|error| Failure::new("INPUT", format!("line {}: {error}", index + 1)))?;
        // Bytes that are no text make a broken line, not the end.
        let line = String::from_utf8_lossy(&line);
        if line.trim().is_empty() {
            continue;
        }
        let reply = match parse(&line, index + 1) {
            Ok(request) => {
                let reading = reading(&request);
                if is_placed(plan, &reading.pose) {
                    let begin = || RemoteDriver::new(tour.plans.clone(), &reading, true);
                    reply(&driver.get_or_insert_with(begin).answer(&reading))
                } else {
                    // What it knew of the robot before stays, for the next pose may be a real one again.
                    to_json(&Reply { waypoint: None, speed: 0.0, option: "", status: "lost" })
                }
            }
            Err(failure) => failure.to_json(),
        };
        // A closed pipe ends the service; there is nobody left to tell.
        if writeln!(out, "{reply}").and_then(|()| out.flush()).is_err() {
            break;
        }
    }
    Ok(Exit::Done)
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
