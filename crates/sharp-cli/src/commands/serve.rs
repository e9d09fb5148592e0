//! `sharp serve`: drives any robot or simulator from outside, one JSON line each way.

use std::io::{BufRead, Write};
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use sharp_plan::{ComposedPolicy, Decision};
use sharp_sim::{ActionSettings, RobotState};
use sharp_space::{Point, Pose, Vector};

use crate::args::Serve;
use crate::commands::run::load_plan;
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
    let plan = Arc::new(load_plan(&args.plan_dir)?);
    let mut driver: Option<(ComposedPolicy, RobotState)> = None;
    let mut out = std::io::stdout().lock();
    for (index, line) in std::io::stdin().lock().lines().enumerate() {
        let line = line.map_err(|error| Failure::new("INPUT", format!("line {}: {error}", index + 1)))?;
        if line.trim().is_empty() {
            continue;
        }
        let reply = match parse(&line, index + 1) {
            Ok(request) => {
                let state = state(&request, driver.as_ref().map(|(_, state)| state));
                let policy = match driver.take() {
                    Some((mut policy, _)) => {
                        policy.observe(state);
                        policy
                    }
                    None => ComposedPolicy::new(Arc::clone(&plan), state, true),
                };
                let (policy, _) = driver.insert((policy, state));
                answer(policy, &state.pose)
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

/// The robot's state; motion that was not told is taken from the last two poses, one action apart.
fn state(request: &Request, before: Option<&RobotState>) -> RobotState {
    let pose = Pose::from(request.pose);
    let mut state = RobotState::at_rest(pose);
    let action_s = ActionSettings::default().action_s;
    if let Some(before) = before {
        state.velocity = before.pose.to_local(pose.position) / action_s;
        state.yaw_rate_radps = before.pose.heading.turn_to(pose.heading) / action_s;
        state.steer_rad = before.steer_rad;
    }
    if let Some(speed) = request.speed {
        state.velocity = Vector::new(speed, 0.0);
    }
    state.yaw_rate_radps = request.yaw_rate.unwrap_or(state.yaw_rate_radps);
    state
}

fn answer(policy: &mut ComposedPolicy, pose: &Pose) -> String {
    let decision = policy.decide();
    let option = policy.leg().id.to_string();
    let to = |point: Point| {
        let towards = point - pose.position;
        Some([point.x, point.y, towards.y.atan2(towards.x)])
    };
    let (waypoint, speed, status) = match decision {
        Decision::Waypoint(point, speed) => (to(point), speed, "running"),
        Decision::Recovering(point, speed) => (to(point), speed, "recovering"),
        Decision::Reached => (None, 0.0, "reached"),
        Decision::Lost => (None, 0.0, "lost"),
    };
    to_json(&Reply { waypoint, speed, option: &option, status })
}
