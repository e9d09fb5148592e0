//! `sharp serve --library`: a learnt building takes goals and poses as JSON lines, and answers with plans and waypoints.

use serde::Serialize;
use sharp_bench::{Dispatcher, NamedWorld, ServeLine, SolveSettings, parse_serve_line};
use sharp_plan::Method;
use sharp_sim::SimulatorKind;

use crate::args::Serve;
use crate::input;
use crate::lines::answer_lines;
use crate::outcome::{Exit, Failure, to_json};

/// A goal that waits for the first pose.
#[derive(Serialize)]
struct Waiting {
    status: &'static str,
    goals: usize,
}

pub(crate) fn run(args: &Serve, seed: u64) -> Result<Exit, Failure> {
    let library = args.library.as_deref().expect("asked for");
    let map = input::map_called(&args.place, &args.reading)?;
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
    answer_lines(|line, number| match line.and_then(|line| parse_serve_line(&line)) {
        Ok(wish) => answer(&mut dispatcher, wish),
        Err(problem) => Ok(vec![Failure::new("LINE_INVALID", format!("line {number}: {problem}")).to_json()]),
    })
}

fn answer(dispatcher: &mut Dispatcher, wish: ServeLine) -> Result<Vec<String>, Failure> {
    let lines = match wish {
        ServeLine::Drive(goals) => {
            let lines = dispatcher.send(&goals)?;
            if lines.is_empty() {
                return Ok(vec![to_json(&Waiting { status: "waiting_for_pose", goals: goals.len() })]);
            }
            lines
        }
        ServeLine::At(reading) => dispatcher.drive(&reading)?,
        ServeLine::Cancel => {
            dispatcher.cancel();
            return Ok(vec![to_json(&Waiting { status: "cancelled", goals: 0 })]);
        }
    };
    Ok(lines.iter().map(to_json).collect())
}
