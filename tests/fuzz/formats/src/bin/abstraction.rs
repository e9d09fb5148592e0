//! An abstraction that is what the fuzzer wants, under a checksum that fits.
#![no_main]

use fuzz_formats::{file, sealed, seed, sound};
use libfuzzer_sys::fuzz_target;
use sharp_plan::{AbstractionFile, map_hash};

fuzz_target!(
    init: seed(&sound().plan, |name| name == "abstraction.ron"),
    |bytes: &[u8]| {
        let Some(text) = sealed(bytes) else { return };
        let path = file("abstraction.ron", &text);
        match AbstractionFile::load(&path, &map_hash(&sound().grid)) {
            Ok(file) => _ = file.abstraction(),
            Err(error) => {
                assert!(error.to_string().contains("abstraction.ron"), "a message names the file: {error}");
            }
        }
    }
);
