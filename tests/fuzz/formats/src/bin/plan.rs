//! A plan that is what the fuzzer wants, under a checksum that fits. What is read answers a robot.
#![no_main]

use std::sync::Arc;

use fuzz_formats::{sealed, seed, sound};
use libfuzzer_sys::fuzz_target;
use sharp_plan::{Plan, Reading, RemoteDriver};
use sharp_space::Pose;

fuzz_target!(
    init: seed(&sound().plan, |name| name == "plan.ron"),
    |bytes: &[u8]| {
        let Some(text) = sealed(bytes) else { return };
        let folder = &sound().plan;
        std::fs::write(folder.join("plan.ron"), text).expect("written");
        match Plan::load(folder, sound().grid.clone()) {
            Ok(plan) => {
                let reading = Reading { pose: Pose::new(1.0, 1.0, 0.0), speed_mps: None, yaw_rate_radps: None };
                let mut driver = RemoteDriver::new(vec![Arc::new(plan)], &reading, true);
                let answer = driver.answer(&reading);
                assert!(answer.speed_mps.is_finite(), "{answer:?}");
                assert!(answer.waypoint.is_none_or(|at| at.is_finite()), "{answer:?}");
            }
            Err(error) => {
                let message = error.to_string();
                assert!(message.contains("plan"), "a message names the file: {message}");
            }
        }
    }
);
