//! The lines that a robot sends to `sharp serve`: JSON objects, one a line.

use serde::Deserialize;
use sharp_plan::Reading;
use sharp_space::Pose;

/// Farther than any map reaches and faster than any robot; also what an angle may be.
const NUMBER_MAX: f64 = 1e9;
/// Each goal is planned before the line is answered.
const GOALS_MAX: usize = 1000;

/// What a line asks of a service that plans.
#[derive(Clone, Debug, PartialEq)]
pub enum ServeLine {
    /// Drive to these goals in turn.
    Drive(Vec<Pose>),
    /// Say what to do here.
    At(Reading),
    /// Stand.
    Cancel,
}

/// A key that is null counts as left out.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct LineText {
    goal: Option<Vec<f64>>,
    route: Option<Vec<Vec<f64>>>,
    pose: Option<[f64; 3]>,
    /// Forward speed, metres per second; estimated from the poses where it is left out.
    speed: Option<f64>,
    /// Yaw rate, radians per second; estimated likewise.
    yaw_rate: Option<f64>,
    cancel: Option<bool>,
}

/// Reads a line to a service that drives one plan: a pose, perhaps with speed and yaw rate.
///
/// # Errors
/// Returns what is wrong with the line.
pub fn parse_pose_line(text: &str) -> Result<Reading, String> {
    match parse_line(text)? {
        LineText { goal: None, route: None, cancel: None, pose: Some(pose), speed, yaw_rate } => {
            reading(pose, speed, yaw_rate)
        }
        LineText { goal: None, route: None, cancel: None, .. } => Err("pose is missing".to_owned()),
        _ => Err("this service drives one plan: expected pose, and perhaps speed and yaw_rate".to_owned()),
    }
}

/// Reads a line to a service that plans: one of goal, route, pose and cancel.
///
/// # Errors
/// Returns what is wrong with the line.
pub fn parse_serve_line(text: &str) -> Result<ServeLine, String> {
    let LineText { goal, route, pose, speed, yaw_rate, cancel } = parse_line(text)?;
    match (goal, route, pose, cancel) {
        (Some(goal), None, None, None) => Ok(ServeLine::Drive(vec![place(&goal)?])),
        (None, Some(route), None, None) if route.len() > GOALS_MAX => {
            Err(format!("a route has {} goals, at most {GOALS_MAX} are planned", route.len()))
        }
        (None, Some(route), None, None) if route.is_empty() => {
            Err("route is empty, expected a list of goals".to_owned())
        }
        (None, Some(route), None, None) => {
            Ok(ServeLine::Drive(route.iter().map(|goal| place(goal)).collect::<Result<_, _>>()?))
        }
        (None, None, Some(pose), None) => Ok(ServeLine::At(reading(pose, speed, yaw_rate)?)),
        (None, None, None, Some(true)) => Ok(ServeLine::Cancel),
        (None, None, None, Some(false)) => Err("cancel is false, expected true".to_owned()),
        _ => Err("expected one of goal, route, pose and cancel".to_owned()),
    }
}

fn parse_line(text: &str) -> Result<LineText, String> {
    // A list would be taken for the values of the keys, in their order.
    if !text.trim_start().starts_with('{') {
        return Err("expected a JSON object".to_owned());
    }
    serde_json::from_str(text).map_err(|error| error.to_string())
}

fn reading(pose: [f64; 3], speed: Option<f64>, yaw_rate: Option<f64>) -> Result<Reading, String> {
    if !pose.iter().chain(&speed).chain(&yaw_rate).all(|number| is_sane(*number)) {
        return Err("pose, speed and yaw_rate must be finite".to_owned());
    }
    Ok(Reading { pose: Pose::from(pose), speed_mps: speed, yaw_rate_radps: yaw_rate })
}

fn is_sane(number: f64) -> bool {
    number.is_finite() && number.abs() <= NUMBER_MAX
}

/// A goal of two or three numbers.
fn place(numbers: &[f64]) -> Result<Pose, String> {
    match *numbers {
        [x, y] if is_sane(x) && is_sane(y) => Ok(Pose::new(x, y, 0.0)),
        [x, y, yaw] if numbers.iter().all(|number| is_sane(*number)) => Ok(Pose::new(x, y, yaw)),
        // A line may hold very many numbers.
        _ if numbers.len() > 3 => {
            Err(format!("a goal has {} numbers, expected [x, y] or [x, y, yaw]", numbers.len()))
        }
        _ => Err(format!("a goal is {numbers:?}, expected [x, y] or [x, y, yaw]")),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_ask_for_one_thing() {
        let at = Reading { pose: Pose::new(1.0, 2.0, 0.5), speed_mps: Some(0.2), yaw_rate_radps: None };
        assert_eq!(parse_pose_line(r#"{"pose":[1,2,0.5],"speed":0.2}"#), Ok(at));
        assert_eq!(parse_serve_line(r#"{"pose":[1,2,0.5],"speed":0.2}"#), Ok(ServeLine::At(at)));
        assert_eq!(parse_pose_line(r#"{"pose":[1,2,0.5],"speed":0.2,"route":null}"#), Ok(at));
        assert_eq!(parse_serve_line(r#"{"cancel":true}"#), Ok(ServeLine::Cancel));
        for line in [r#"{"cancel":true}"#, r#"{"goal":[1,2]}"#] {
            let error = parse_pose_line(line).expect_err(line);
            assert!(error.contains("drives one plan"), "{line}: {error}");
        }
        assert_eq!(parse_pose_line(r#"{"speed":1}"#), Err("pose is missing".to_owned()));
        let goals = vec![Pose::new(1.0, 2.0, 0.0), Pose::new(3.0, 4.0, 1.5)];
        assert_eq!(parse_serve_line(r#"{"route":[[1,2],[3,4,1.5]]}"#), Ok(ServeLine::Drive(goals)));
        for (line, reason) in [
            ("", "expected a JSON object"),
            ("[null,null,[1,2,3],null,null,null]", "expected a JSON object"),
            ("\"x\"", "expected a JSON object"),
            ("{", "EOF"),
            ("{}", "expected one of goal, route, pose and cancel"),
            (r#"{"cancel":false}"#, "expected true"),
            (r#"{"route":[]}"#, "route is empty"),
            (r#"{"goal":[1,2],"cancel":true}"#, "expected one of"),
            (r#"{"goal":[1]}"#, "a goal is [1.0]"),
            (r#"{"goal":[1,2,3,4]}"#, "a goal has 4 numbers"),
            (r#"{"goal":[1,1e10]}"#, "a goal is [1.0, 10000000000.0]"),
            (r#"{"pose":[1,2,1e10]}"#, "must be finite"),
            (r#"{"pose":[1,2,1e400]}"#, "number out of range"),
            (r#"{"pose":[1,2]}"#, "invalid length 2"),
            (r#"{"pose":[1,2,3],"sped":1}"#, "unknown field `sped`"),
        ] {
            let error = parse_serve_line(line).expect_err(line);
            assert!(error.contains(reason), "{line}: {error}");
        }
        let long = format!(r#"{{"route":[{}[1,2]]}}"#, "[1,2],".repeat(GOALS_MAX));
        assert!(parse_serve_line(&long).expect_err("long").contains("1001 goals"), "length is bounded");
        let deep = format!("{{\"route\":{}", "[".repeat(100_000));
        assert!(parse_serve_line(&deep).expect_err("deep").contains("invalid type"), "depth is bounded");
    }
}
