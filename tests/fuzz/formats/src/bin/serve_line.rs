//! A line that a robot sends to `sharp serve`.
#![no_main]

use libfuzzer_sys::fuzz_target;

// By its source: the crate that holds it would take all of the project along.
#[path = "../../../../../crates/sharp-bench/src/serve_line.rs"]
mod serve_line;

use serve_line::{ServeLine, parse_pose_line, parse_serve_line};

fuzz_target!(|text: &str| {
    let at = parse_pose_line(text);
    match parse_serve_line(text) {
        Ok(ServeLine::At(reading)) => {
            assert!(reading.pose.is_finite(), "{reading:?}");
            assert!(at.is_ok(), "a pose is one for either service");
        }
        Ok(ServeLine::Drive(goals)) => assert!(goals.iter().all(|goal| goal.is_finite()), "{goals:?}"),
        Ok(ServeLine::Cancel) => {}
        Err(problem) => assert!(!problem.is_empty(), "a reason"),
    }
});
