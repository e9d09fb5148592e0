//! An image as a map: PGM, PNG, BMP, by its first bytes.
#![no_main]

use fuzz_formats::file;
use libfuzzer_sys::fuzz_target;
use sharp_maps::{LoadOptions, load};

fuzz_target!(|bytes: &[u8]| {
    let path = file("image.pgm", bytes);
    let options = LoadOptions { resolution_m: Some(0.05), ..LoadOptions::default() };
    match load(path.to_str().expect("UTF-8"), &options) {
        Ok(map) => {
            let frame = map.grid.frame();
            assert_eq!(map.grid.cells().len(), frame.width * frame.height, "a cell each");
        }
        Err(error) => assert!(error.to_string().contains("image.pgm"), "a message names the file: {error}"),
    }
});
