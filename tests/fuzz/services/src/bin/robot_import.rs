//! A robot of others: Nav2 parameters or URDF. What is made of them is a robot file that is read again.
#![no_main]

use fuzz_formats::file;
use libfuzzer_sys::fuzz_target;
use sharp_bench::named::robot;
use sharp_bench::{ImportWishes, import_robot};

fuzz_target!(|bytes: &[u8]| {
    let path = file("params.yaml", bytes);
    let wishes = ImportWishes { max_speed_mps: Some(0.5), ..ImportWishes::default() };
    for wishes in [wishes, ImportWishes::default()] {
        match import_robot(std::slice::from_ref(&path), &wishes) {
            Ok(imported) => {
                let file = file("robot.ron", imported.text.as_bytes());
                let again = robot(file.to_str().expect("UTF-8")).expect("a robot file that is read");
                assert_eq!(again, imported.robot, "{}", imported.text);
            }
            Err(error) => {
                assert!(error.to_string().contains("params.yaml"), "a message names the file: {error}");
            }
        }
    }
});
