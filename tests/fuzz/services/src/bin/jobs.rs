//! The plan of many jobs, and results to compare with.
#![no_main]

use fuzz_formats::{file, folder};
use libfuzzer_sys::fuzz_target;
use sharp_bench::{Manifest, read_baselines};

fuzz_target!(|bytes: &[u8]| {
    let path = file("manifest.jsonl", bytes);
    if let Err(error) = Manifest::open(folder()) {
        assert!(error.to_string().contains("manifest.jsonl"), "a message names the file: {error}");
    }
    _ = read_baselines(&path);
});
