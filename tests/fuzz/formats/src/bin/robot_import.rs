//! A robot of others: Nav2 parameters or URDF. What is made of them is a robot file that is read again.
#![no_main]

use fuzz_formats::file;
use libfuzzer_sys::fuzz_target;
use sharp_sim::RobotModel;

// By its source: the crate that holds it would take all of the project along.
#[allow(dead_code, reason = "the command shows more of what is found")]
#[path = "../../../../../crates/sharp-bench/src/robot_import/mod.rs"]
mod robot_import;

use robot_import::{ImportWishes, import_robot};

fuzz_target!(|bytes: &[u8]| {
    let path = file("params.yaml", bytes);
    let wishes = ImportWishes { max_speed_mps: Some(0.5), ..ImportWishes::default() };
    for wishes in [wishes, ImportWishes::default()] {
        match import_robot(std::slice::from_ref(&path), &wishes) {
            Ok(imported) => {
                let again =
                    RobotModel::from_ron_named(&imported.text, "robot").expect("a robot file that is read");
                assert_eq!(again, imported.robot, "{}", imported.text);
            }
            Err(error) => {
                assert!(error.to_string().contains("params.yaml"), "a message names the file: {error}");
            }
        }
    }
});
