//! A ROS map's YAML beside a small image. What is read, is saved and read again as the same grid.
#![no_main]

use fuzz_formats::{file, folder};
use libfuzzer_sys::fuzz_target;
use sharp_maps::{LoadOptions, load, load_doors, load_values, save_ros};

const IMAGE: &[u8] = b"P5\n4 3\n255\n\x00\xfe\xcd\xfe\xfe\xfe\x64\xfe\xff\x01\xfe\x00";

fuzz_target!(|bytes: &[u8]| {
    for name in ["m.pgm", "map.pgm", "a/m.pgm"] {
        file(name, IMAGE);
    }
    let path = file("m.yaml", bytes);
    _ = load_doors(&path);
    _ = load_values(&path, &LoadOptions::default());
    let path = path.to_str().expect("UTF-8");
    match load(path, &LoadOptions::default()) {
        Ok(map) => {
            let saved = folder().join("saved/again.yaml");
            if save_ros(&map.grid, &saved).is_ok() {
                let again =
                    load(saved.to_str().expect("UTF-8"), &LoadOptions::default()).expect("just saved");
                assert_eq!(again.grid.cells(), map.grid.cells(), "saved and loaded");
            }
        }
        Err(error) => assert!(error.to_string().contains("m."), "a message names the file: {error}"),
    }
});
