//! `sharp serve`: drives any robot or simulator from outside, one JSON line each way.

use std::io::{BufRead, Write};
use std::path::Path;

use serde::{Deserialize, Serialize};
use sharp_drive::{Command, Controller, Decision, Motion};
use sharp_plan::{Plan, Tour, TourPolicy};
use sharp_sim::{ActionSettings, RobotState};
use sharp_space::{Occupancy, Pose, Vector, trig};

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
    /// Speed at which the waypoint is to be approached, metres per second.
    speed: f64,
    option: &'a str,
    status: &'static str,
}

pub(crate) fn run(args: &Serve) -> Result<Exit, Failure> {
    let tour = load_tour(Path::new(&args.place))?;
    let plan = &tour.plans[0];
    let mut driver: Option<Served> = None;
    let mut out = std::io::stdout().lock();
    for (index, line) in std::io::stdin().lock().lines().enumerate() {
        let line = line.map_err(|error| Failure::new("INPUT", format!("line {}: {error}", index + 1)))?;
        if line.trim().is_empty() {
            continue;
        }
        let reply = match parse(&line, index + 1) {
            Ok(request) => {
                let state = state(&request, driver.as_ref().map(|served| &served.state));
                if is_placed(plan, &state.pose) {
                    driver.get_or_insert_with(|| Served::new(&tour, state)).answer(state)
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

fn state(request: &Request, before: Option<&RobotState>) -> RobotState {
    estimated_state(request.pose, (request.speed, request.yaw_rate), before)
}

/// The robot's state; motion that was not told is taken from the last two poses, one action apart.
pub(crate) fn estimated_state(
    pose: [f64; 3],
    (speed, yaw_rate): (Option<f64>, Option<f64>),
    before: Option<&RobotState>,
) -> RobotState {
    let pose = Pose::from(pose);
    let mut state = RobotState::at_rest(pose);
    let action_s = ActionSettings::default().action_s;
    if let Some(before) = before {
        state.velocity = before.pose.to_local(pose.position) / action_s;
        state.yaw_rate_radps = before.pose.heading.turn_to(pose.heading) / action_s;
        state.steer_rad = before.steer_rad;
    }
    if let Some(speed) = speed {
        state.velocity = Vector::new(speed, 0.0);
    }
    state.yaw_rate_radps = yaw_rate.unwrap_or(state.yaw_rate_radps);
    state
}

/// A robot that is being driven.
struct Served {
    policy: TourPolicy,
    state: RobotState,
    /// The last answer, until its outcome is known.
    pending: Option<Command>,
}

impl Served {
    fn new(tour: &Tour, state: RobotState) -> Self {
        Self { policy: TourPolicy::new(tour.plans.clone(), state, true), state, pending: None }
    }

    /// What to do for a robot that is now in `state`.
    fn answer(&mut self, state: RobotState) -> String {
        if let Some(command) = self.pending.take() {
            self.policy.observe(&Motion::commanded(command, state));
        }
        self.state = state;
        let decision = self.policy.decide();
        let option = self.policy.option().id.to_string();
        let (command, status) = match decision {
            Decision::Drive(command) if self.policy.is_recovering() => (Some(command), "recovering"),
            Decision::Drive(command) => (Some(command), "running"),
            // Nobody tells this robot of contacts, so it is never asked to back off.
            Decision::BackOff => (None, "recovering"),
            Decision::Reached => (None, "reached"),
            Decision::Lost => (None, "lost"),
        };
        self.pending = command;
        let waypoint = command.map(|command| {
            let point = command.to_world(&state.pose);
            let towards = point - state.pose.position;
            [point.x, point.y, trig::atan2(towards.y, towards.x)]
        });
        let speed = command.map_or(0.0, |command| command.speed_mps);
        to_json(&Reply { waypoint, speed, option: &option, status })
    }
}
