//! A library whose option, or whose file of a whole building, is what the fuzzer wants, under a checksum that fits.
#![no_main]

use fuzz_formats::{file, folder, sealed, seed, sound};
use libfuzzer_sys::fuzz_target;
use sharp_plan::OptionLibrary;

fuzz_target!(
    init: seed(&sound().library.join("key-map"), |name| name.ends_with(".ron")),
    |bytes: &[u8]| {
        let Some(text) = sealed(bytes) else { return };
        let library = folder().join("library");
        for name in ["i_0-1-2.ron", "c_0-1.ron", "building-0.ron"] {
            let path = file(&format!("library/key-map/{name}"), &text);
            if let Err(error) = OptionLibrary::open(&library, "key-map") {
                assert!(error.to_string().contains(".ron"), "a message names the file: {error}");
            }
            std::fs::remove_file(path).expect("it was there");
        }
    }
);
