//! A scenario of the `MovingAI` benchmarks.
#![no_main]

use fuzz_formats::file;
use libfuzzer_sys::fuzz_target;
use sharp_maps::load_scenario;

fuzz_target!(|bytes: &[u8]| {
    let path = file("m.scen", bytes);
    for number in [0, 1, 2, usize::MAX] {
        if let Err(error) = load_scenario(&path, number) {
            assert!(error.to_string().contains("m.scen"), "a message names the file: {error}");
        }
    }
});
