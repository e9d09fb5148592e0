//! A floor plan in RON.
#![no_main]

use fuzz_formats::file;
use libfuzzer_sys::fuzz_target;
use sharp_maps::{LoadOptions, load};

fuzz_target!(|bytes: &[u8]| {
    let path = file("plan.ron", bytes);
    if let Err(error) = load(path.to_str().expect("UTF-8"), &LoadOptions::default()) {
        assert!(error.to_string().contains("plan.ron"), "a message names the file: {error}");
    }
});
