//! `sharp serve`: drives any robot or simulator from outside, one JSON line each way.

use std::path::Path;

use serde::Serialize;
use sharp_bench::parse_pose_line;
use sharp_plan::{Instruction, RemoteDriver, is_placed};

use crate::args::Serve;
use crate::commands::run::load_tour;
use crate::lines::answer_lines;
use crate::outcome::{Exit, Failure, to_json};

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
    if !args.reading.is_usual() {
        let message = "a plan has its map; --resolution, --unknown, --keepout, --downsample and --allow-outside go with --library";
        return Err(Failure::new("USAGE", message.to_owned()));
    }
    let tour = load_tour(folder)?;
    let world = &tour.plans[0].world;
    let mut driver: Option<RemoteDriver> = None;
    answer_lines(|line, number| {
        Ok(vec![match line.and_then(|line| parse_pose_line(&line)) {
            Ok(reading) if is_placed(world, &reading.pose) => {
                let begin = || RemoteDriver::new(tour.plans.clone(), &reading, true);
                reply(&driver.get_or_insert_with(begin).answer(&reading))
            }
            // What it knew of the robot before stays, for the next pose may be a real one again.
            Ok(_) => to_json(&Reply { waypoint: None, speed: 0.0, option: "", status: "lost" }),
            Err(problem) => Failure::new("POSE_INVALID", format!("line {number}: {problem}")).to_json(),
        }])
    })
}

fn reply(instruction: &Instruction) -> String {
    let Instruction { waypoint, speed_mps, option, status } = *instruction;
    let waypoint = waypoint.map(|pose| [pose.position.x, pose.position.y, pose.heading.radians()]);
    to_json(&Reply { waypoint, speed: speed_mps, option: &option.to_string(), status: status.name() })
}
