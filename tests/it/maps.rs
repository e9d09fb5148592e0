//! Map input end to end: real maps, ROS semantics, round trips, and files made to do harm.

use std::f64::consts::PI;
use std::fs;
use std::path::{Path, PathBuf};

use sharp_maps::{LoadOptions, MapError, MapFile, load, load_values, save_ros};
use sharp_space::{Cell, GridFrame, Occupancy, OccupancyGrid, Pose};
use tempfile::TempDir;

const SOUND_YAML: &str = "image: map.pgm\nresolution: 0.5\norigin: [1.0, 2.0, 0.0]\nnegate: 0\n\
                          occupied_thresh: 0.65\nfree_thresh: 0.196\n";

/// A folder with a sound map: 3 x 2 pixels, black and white.
fn sound_map() -> TempDir {
    let folder = tempfile::tempdir().expect("a temporary folder");
    fs::write(folder.path().join("map.yaml"), SOUND_YAML).expect("written");
    fs::write(folder.path().join("map.pgm"), b"P5\n3 2\n255\n\x00\xfe\xcd\xfe\xfe\xfe").expect("written");
    folder
}

fn load_path(path: &Path) -> Result<MapFile, MapError> {
    load(path.to_str().expect("a UTF-8 path"), &LoadOptions::default())
}

/// Loads a sound map whose YAML file was replaced by `yaml`.
fn load_yaml(yaml: &[u8]) -> Result<MapFile, MapError> {
    let folder = sound_map();
    fs::write(folder.path().join("map.yaml"), yaml).expect("written");
    load_path(&folder.path().join("map.yaml"))
}

/// Loads a sound map whose image was replaced by `pgm`.
fn load_image(pgm: &[u8]) -> Result<MapFile, MapError> {
    let folder = sound_map();
    fs::write(folder.path().join("map.pgm"), pgm).expect("written");
    load_path(&folder.path().join("map.yaml"))
}

#[track_caller]
fn check_refused(label: &str, result: Result<MapFile, MapError>, code: &str, needles: &[&str]) {
    let error = match result {
        Ok(map) => panic!("{label} was accepted as a map of {:?}", map.grid.frame()),
        Err(error) => error,
    };
    let message = error.to_string();
    assert_eq!(error.code(), code, "{label}: {message}");
    assert!(!message.contains('\n') && message.len() < 1000, "{label} has an unwieldy message: {message}");
    for needle in needles {
        assert!(message.contains(needle), "{label} does not say {needle:?}: {message}");
    }
}

/// The sound YAML with the line of `key` replaced.
fn with_line(key: &str, line: &str) -> Vec<u8> {
    let lines = SOUND_YAML.lines().map(|old| if old.starts_with(key) { line } else { old });
    lines.collect::<Vec<_>>().join("\n").into_bytes()
}

#[test]
#[expect(
    clippy::disallowed_methods,
    reason = "real maps lie outside the repository, and the caller says where"
)]
fn real_maps_have_their_published_sizes() {
    let Some(folder) = std::env::var_os("SHARP_REAL_MAPS").map(PathBuf::from) else {
        println!("skipped: SHARP_REAL_MAPS names no folder of real maps");
        return;
    };
    for (file, width, height, resolution_m) in [
        ("nav2/smoothers_world.yaml", 300, 300, 0.05),
        ("nav2/testmap.yaml", 10, 10, 0.1),
        ("nav2/TenByTen.yaml", 10, 10, 1.0),
        ("turtlebot3/map.yaml", 384, 384, 0.05),
        ("aws_small_house/map.yaml", 500, 500, 0.05),
        ("utexas_bwi/gdc_3.yaml", 1857, 1255, 0.05),
        ("movingai/room-32-32-4.map", 32, 32, 1.0),
    ] {
        let map = load_path(&folder.join(file)).unwrap_or_else(|e| panic!("{e}"));
        let frame = map.grid.frame();
        assert_eq!((frame.width, frame.height), (width, height), "{file}");
        assert_eq!(frame.resolution_m, resolution_m, "{file}");
        assert_eq!(map.grid.free_count(), free_count(&folder.join(file)), "free cells of {file}");
    }
    let testmap = load_path(&folder.join("nav2/testmap.yaml")).expect("sound");
    assert_eq!(testmap.grid.frame().origin, Pose::new(2.0, 3.0, 1.0), "origin with a yaw");
    check_refused(
        "a missing image",
        load_path(&folder.join("nav2/invalid_image.yaml")),
        "MAP_UNREADABLE",
        &["invalid_image.yaml", "image is \"invalid.png\""],
    );
    let plain = |file: &str| {
        let options = LoadOptions { resolution_m: Some(0.1), ..LoadOptions::default() };
        load(folder.join(file).to_str().expect("a UTF-8 path"), &options).expect("sound").grid
    };
    assert_eq!(plain("nav2/testmap.png"), plain("nav2/testmap.pgm"), "PNG equals PGM");
    assert_eq!(testmap.grid.cells(), plain("nav2/testmap.pgm").cells(), "YAML equals plain image");
    assert_eq!(plain("barn/map_pgm_0.pgm").frame().height, 66, "rows of a BARN world");
}

/// Counts free cells without the code under test: bytes above 204 in a PGM, `.` in a drawn map.
fn free_count(file: &Path) -> usize {
    if file.extension().is_some_and(|ending| ending == "map") {
        let text = fs::read_to_string(file).expect("readable");
        return text.lines().skip(4).flat_map(str::chars).filter(|&c| c == '.').count();
    }
    let yaml = fs::read_to_string(file).expect("readable");
    let image = yaml.lines().find_map(|line| line.strip_prefix("image:")).expect("an image");
    let image = file.with_file_name(image.trim().trim_matches('"')).with_extension("pgm");
    let frame = *load_path(file).expect("sound").grid.frame();
    let bytes = fs::read(image).expect("readable");
    bytes[bytes.len() - frame.len()..].iter().filter(|&&grey| grey > 205).count()
}

#[test]
fn grey_values_become_what_nav2_makes_of_them() {
    use Occupancy::{Free, Occupied, Unknown};
    // By hand: 1 - 89/255 = 0.651, 1 - 90/255 = 0.647; 1 - 205/255 = 0.19608, 1 - 206/255 = 0.192.
    let trinary = [(0, Occupied), (89, Occupied), (90, Unknown), (205, Unknown), (206, Free), (255, Free)];
    let negated = [(0, Free), (49, Free), (50, Unknown), (165, Unknown), (166, Occupied), (255, Occupied)];
    // Scale rounds to 100 above 0.6477 and to 0 below 0.1983, which lets the grey 205 through.
    let scale = [(89, Occupied), (90, Unknown), (91, Unknown), (204, Unknown), (205, Free), (255, Free)];
    let raw = [(0, Free), (1, Unknown), (99, Unknown), (100, Occupied), (101, Unknown), (255, Unknown)];
    for (mode, negate, table) in
        [("trinary", "0", trinary), ("trinary", "true", negated), ("scale", "0", scale), ("raw", "0", raw)]
    {
        let folder = sound_map();
        let yaml = SOUND_YAML.replace("negate: 0", &format!("negate: {negate}\nmode: {mode}"));
        fs::write(folder.path().join("map.yaml"), yaml).expect("written");
        let mut pgm = b"P5 6 1 255\n".to_vec();
        pgm.extend(table.map(|(grey, _)| grey));
        fs::write(folder.path().join("map.pgm"), pgm).expect("written");
        let map = load_path(&folder.path().join("map.yaml")).expect("sound");
        assert_eq!(map.grid.cells(), table.map(|(_, cell)| cell), "{mode}, negate {negate}");
    }
}

#[test]
fn the_image_s_top_row_is_the_grid_s_last() {
    let map = load_path(&sound_map().path().join("map.yaml")).expect("sound");
    assert_eq!(map.grid.to_string(), "#.?\n...\n", "as the image looks");
    assert_eq!(map.grid.get(Cell::new(0, 1)), Occupancy::Occupied, "the upper-left pixel");
    assert_eq!(map.grid.frame().origin, Pose::new(1.0, 2.0, 0.0), "pose of the lower-left corner");
    assert_eq!(map.name, "map");
}

#[test]
fn unknown_cells_are_free_on_request() {
    let folder = sound_map();
    let path = folder.path().join("map.yaml");
    let options = LoadOptions { unknown_free: true, ..LoadOptions::default() };
    let map = load(path.to_str().expect("a UTF-8 path"), &options).expect("sound");
    assert_eq!(map.grid.free_count(), 5, "all but the black pixel");
}

#[test]
fn harmless_spellings_are_read() {
    for (label, yaml) in [
        ("CR LF", SOUND_YAML.replace('\n', "\r\n")),
        ("a byte order mark", format!("\u{feff}{SOUND_YAML}")),
        ("comments", format!("# a map\n{SOUND_YAML}# the end\n")),
        ("negate as a word", SOUND_YAML.replace("negate: 0", "negate: false")),
        ("a quoted number", SOUND_YAML.replace("0.5", "\"0.5\"")),
        ("an integer origin", SOUND_YAML.replace("[1.0, 2.0, 0.0]", "[1, 2, 0]")),
        ("a block list", SOUND_YAML.replace("[1.0, 2.0, 0.0]", "\n  - 1.0\n  - 2.0\n  - 0.0")),
    ] {
        let map = load_yaml(yaml.as_bytes()).unwrap_or_else(|e| panic!("{label}: {e}"));
        assert_eq!(map.grid.frame().resolution_m, 0.5, "{label}");
        assert_eq!(map.warnings, Vec::<String>::new(), "{label}");
    }
    let other = format!("{SOUND_YAML}cost_translation_table: none\nmodee: raw\n");
    let map = load_yaml(other.as_bytes()).expect("other keys are no error");
    let [warning] = &map.warnings[..] else { panic!("{:?}", map.warnings) };
    assert!(warning.contains("\"cost_translation_table\" and 1 more are ignored"), "{warning}");
}

#[test]
fn crossed_thresholds_are_read_as_nav2_reads_them_and_warned_about() {
    let yaml = SOUND_YAML.replace("0.65", "0.1").replace("0.196", "0.9");
    let map = load_yaml(yaml.as_bytes()).expect("Nav2 reads it");
    assert_eq!(map.grid.to_string(), "#..\n...\n", "free is applied last");
    assert!(map.warnings[0].contains("free_thresh 0.9 is above occupied_thresh 0.1"), "{:?}", map.warnings);
}

#[test]
fn saved_maps_load_as_they_were() {
    arbtest::arbtest(|u| {
        let (width, height) = (u.int_in_range(1..=12)?, u.int_in_range(1..=12)?);
        let resolution_m = f64::from(u.int_in_range(1..=1_000_000_u32)?) / 997_001.0;
        let mut number = || Ok::<_, arbtest::arbitrary::Error>(f64::from(u.arbitrary::<i32>()?) / 7e6);
        let origin = Pose::new(number()?, number()?, number()?);
        let mut cells = Vec::new();
        for _ in 0..width * height {
            cells.push(*u.choose(&[Occupancy::Free, Occupancy::Occupied, Occupancy::Unknown])?);
        }
        let frame = GridFrame { origin, resolution_m, width, height };
        let grid = OccupancyGrid::new(frame, cells).expect("sound");
        let folder = tempfile::tempdir().expect("a temporary folder");
        let path = folder.path().join("it's: a #map.yaml");
        save_ros(&grid, &path).expect("saved");
        assert_eq!(load_path(&path).expect("loads").grid, grid);
        let left = fs::read_dir(folder.path()).expect("readable").count();
        assert_eq!(left, 2, "files after saving");
        Ok(())
    })
    .budget_ms(500);
}

#[test]
fn saving_writes_the_map_saver_s_numbers() {
    let folder = tempfile::tempdir().expect("a temporary folder");
    let frame = GridFrame { origin: Pose::new(-1.5, 0.0, PI), resolution_m: 0.05, width: 3, height: 1 };
    let cells = vec![Occupancy::Free, Occupancy::Occupied, Occupancy::Unknown];
    let grid = OccupancyGrid::new(frame, cells).expect("sound");
    save_ros(&grid, &folder.path().join("m.yaml")).expect("saved");
    assert_eq!(fs::read(folder.path().join("m.pgm")).expect("written"), b"P5\n3 1\n255\n\xfe\x00\xcd");
    let yaml = fs::read_to_string(folder.path().join("m.yaml")).expect("written");
    let expected = "image: 'm.pgm'\nmode: trinary\nresolution: 0.05\norigin: [-1.5, 0, 3.141592653589793]\n\
                    negate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n";
    assert_eq!(yaml, expected);
}

#[test]
fn a_folder_that_cannot_be_written_is_named() {
    let grid = OccupancyGrid::from_ascii(1.0, ".#").expect("sound");
    let folder = tempfile::tempdir().expect("a temporary folder");
    let error = save_ros(&grid, &folder.path().join("missing/m.yaml")).expect_err("no such folder");
    assert_eq!(error.code(), "MAP_WRITE", "{error}");
    assert!(error.to_string().contains("missing/m.pgm: cannot be written"), "{error}");
    for (name, found) in [("m.pgm", "\"pgm\""), ("m", "missing"), ("m.map", "\"map\"")] {
        let error = save_ros(&grid, &folder.path().join(name)).expect_err("nothing would read it");
        assert!(error.to_string().contains(&format!("ending is {found}, must be .yaml or .yml")), "{error}");
    }
}

#[test]
fn broken_fields_are_named_with_their_value() {
    for (key, line, says) in [
        ("image", "", "image is missing, must be the path of an image file"),
        ("image", "image:", "image is empty"),
        ("image", "image: \"\"", "image is \"\""),
        ("image", "image: [a.pgm]", "image is [\"a.pgm\"]"),
        ("image", "image: \"a\\0b\"", "image is \"a\\0b\""),
        ("resolution", "", "resolution is missing, must be metres a pixel, from 1e-6 to 1000"),
        ("resolution", "resolution: .nan", "resolution is NaN"),
        ("resolution", "resolution: nan", "resolution is NaN"),
        ("resolution", "resolution: .inf", "resolution is inf"),
        ("resolution", "resolution: 0", "resolution is 0,"),
        ("resolution", "resolution: -0.05", "resolution is -0.05"),
        ("resolution", "resolution: 1e-10", "resolution is 0.0000000001"),
        ("resolution", "resolution: 1e9", "resolution is 1000000000"),
        ("resolution", "resolution: 1e300", "resolution is 1e300,"),
        ("resolution", "resolution: 5 cm", "resolution is \"5 cm\""),
        ("resolution", "resolution: {a: 1}", "resolution is a mapping"),
        ("resolution", "resolution: true", "resolution is true"),
        ("origin", "", "origin is missing, must be three finite numbers [x, y, yaw]"),
        ("origin", "origin: [1, 2]", "origin is [1, 2]"),
        ("origin", "origin: [1, 2, 3, 4]", "origin is [1, 2, 3, 4]"),
        ("origin", "origin: [1, x, 3]", "origin is [1, \"x\", 3]"),
        ("origin", "origin: [1, .nan, 3]", "origin is [1, NaN, 3]"),
        ("origin", "origin: [1, 2, -.inf]", "origin is [1, 2, -inf]"),
        ("origin", "origin: [1e300, 2, 3]", "origin is [1"),
        ("origin", "origin: 0", "origin is 0,"),
        ("negate", "", "negate is missing, must be 0, 1, true or false"),
        ("negate", "negate: maybe", "negate is \"maybe\""),
        ("negate", "negate: 0.5", "negate is 0.5"),
        ("negate", "negate: [0]", "negate is [0]"),
        ("occupied", "", "occupied_thresh is missing, must be a number from 0 to 1"),
        ("occupied", "occupied_thresh: 65", "occupied_thresh is 65"),
        ("occupied", "occupied_thresh: -0.1", "occupied_thresh is -0.1"),
        ("occupied", "occupied_thresh: .nan", "occupied_thresh is NaN"),
        ("free", "", "free_thresh is missing"),
        ("free", "free_thresh: 1.5", "free_thresh is 1.5"),
        ("free", "free_thresh: much", "free_thresh is \"much\""),
        ("negate", "negate: 0\nmode: tri", "mode is \"tri\", must be trinary, scale or raw"),
        ("negate", "negate: 0\nmode: 1", "mode is 1"),
    ] {
        check_refused(line, load_yaml(&with_line(key, line)), "MAP_FIELD", &["map.yaml: ", says]);
    }
}

#[test]
fn broken_yaml_names_the_file_and_the_reason() {
    let laughs = (1..40).fold("a0: &a0 [1,1]\n".to_owned(), |text, n| {
        format!("{text}a{n}: &a{n} [*a{p},*a{p},*a{p},*a{p}]\n", p = n - 1)
    });
    let nested = "[".repeat(10_000);
    let twice = format!("{SOUND_YAML}resolution: 0.1\n");
    let cases: [(&str, &[u8], &str); 10] = [
        ("an empty file", b"", "map.yaml"),
        ("a scalar", b"map", "is no list of `key: value` lines"),
        ("a list", b"- 1\n- 2\n", "is no list of `key: value` lines"),
        ("a repeated key", twice.as_bytes(), "resolution"),
        ("a tab", b"image: map.pgm\n\tresolution: 0.5\n", "is no valid YAML"),
        ("bytes that are no text", b"image: \xff\xfe", "byte 7 is not UTF-8"),
        ("a bomb of aliases", laughs.as_bytes(), "is no valid YAML"),
        ("deep nesting", nested.as_bytes(), "is no valid YAML"),
        ("two documents", b"a: 1\n---\nb: 2\n", "holds several YAML documents"),
        ("an open quote", b"image: \"map.pgm\n", "is no valid YAML"),
    ];
    for (label, yaml, says) in cases {
        check_refused(label, load_yaml(yaml), "MAP_SYNTAX", &["map.yaml: ", says]);
    }
    let large = vec![b'#'; 10_000_000];
    check_refused("10 MB of comment", load_yaml(&large), "MAP_TOO_LARGE", &["map.yaml", "262144 bytes"]);
}

#[test]
fn cut_yaml_is_refused_or_complete() {
    for length in 0..SOUND_YAML.len() {
        if let Ok(map) = load_yaml(&SOUND_YAML.as_bytes()[..length]) {
            assert!(length > SOUND_YAML.find("free_thresh").expect("there"), "cut at {length}: {map:?}");
        }
    }
}

#[cfg(unix)]
#[test]
fn images_outside_the_folder_need_permission() {
    let outer = sound_map();
    let folder = outer.path().join("maps");
    fs::create_dir(&folder).expect("created");
    fs::create_dir(folder.join("deep")).expect("created");
    fs::copy(outer.path().join("map.pgm"), folder.join("deep/inside.pgm")).expect("copied");
    std::os::unix::fs::symlink(outer.path().join("map.pgm"), folder.join("link.pgm")).expect("linked");
    let absolute = outer.path().join("map.pgm").display().to_string();
    let within = folder.join("deep/inside.pgm").display().to_string();
    let yaml = folder.join("map.yaml");
    let with_image = |image: &str, allow_outside: bool| {
        fs::write(&yaml, SOUND_YAML.replace("map.pgm", image)).expect("written");
        load(yaml.to_str().expect("UTF-8"), &LoadOptions { allow_outside, ..LoadOptions::default() })
    };
    for image in [absolute.as_str(), "../map.pgm", "deep/../../map.pgm"] {
        let says = ["map.yaml: image is", image, "--allow-outside"];
        check_refused(image, with_image(image, false), "MAP_IMAGE_OUTSIDE", &says);
        assert!(with_image(image, true).is_ok(), "{image} with permission");
    }
    for image in ["deep/inside.pgm", "./deep/../deep/inside.pgm", within.as_str(), "link.pgm"] {
        assert!(with_image(image, false).is_ok(), "{image} lies inside");
    }
}

#[cfg(unix)]
#[test]
fn images_that_are_no_files_are_refused_at_once() {
    let folder = sound_map();
    let status = std::process::Command::new("mkfifo").arg(folder.path().join("pipe")).status();
    assert!(status.is_ok_and(|status| status.success()), "mkfifo");
    fs::create_dir(folder.path().join("folder")).expect("created");
    let yaml = folder.path().join("map.yaml");
    for (image, code, says) in [
        ("folder", "MAP_NOT_A_FILE", "is a folder, must be a regular file"),
        (".", "MAP_NOT_A_FILE", "is a folder"),
        ("pipe", "MAP_NOT_A_FILE", "is a pipe, socket or device"),
        ("/dev/zero", "MAP_NOT_A_FILE", "is a pipe, socket or device"),
        ("missing.png", "MAP_UNREADABLE", "cannot be read"),
        ("http://localhost/map.pgm", "MAP_UNREADABLE", "cannot be read"),
        ("map.yaml", "MAP_IMAGE", "is no PNG, PGM or BMP image"),
    ] {
        fs::write(&yaml, SOUND_YAML.replace("map.pgm", image)).expect("written");
        let options = LoadOptions { allow_outside: true, ..LoadOptions::default() };
        let result = load(yaml.to_str().expect("UTF-8"), &options);
        check_refused(image, result, code, &["map.yaml: image is", image, says]);
    }
}

#[test]
fn broken_images_are_refused() {
    let short = "ends before its last pixel";
    for (label, code, pgm, says) in [
        ("an empty file", "MAP_IMAGE", &b""[..], "is no PNG, PGM or BMP image"),
        ("0 x 0", "MAP_FIELD", b"P5\n0 0\n255\n", "size is 0 x 0"),
        ("0 wide", "MAP_FIELD", b"P5\n0 4\n255\n", "size is 0 x 4"),
        ("65535 x 65537", "MAP_FIELD", b"P5\n65535 65537\n255\n\0", "size is 65535 x 65537"),
        ("32767 x 32767", "MAP_FIELD", b"P5\n32767 32767\n255\n\0", "size is 32767 x 32767"),
        ("40000 x 40000", "MAP_FIELD", b"P5\n40000 40000\n255\n\0", "size is 40000 x 40000"),
        ("a huge number", "MAP_IMAGE", b"P5\n99999999999 1\n255\n\0", "cannot be decoded"),
        ("a negative size", "MAP_IMAGE", b"P5\n-3 2\n255\n......", "cannot be decoded"),
        ("maxval 0", "MAP_IMAGE", b"P5\n3 2\n0\n......", ""),
        ("maxval 65536", "MAP_IMAGE", b"P5\n3 2\n65536\n......", "cannot be decoded"),
        ("8192 x 8192 without pixels", "MAP_IMAGE", b"P5\n8192 8192\n255\n\0", short),
        ("a missing pixel", "MAP_IMAGE", b"P5\n3 2\n255\n.....", short),
        ("CR LF", "MAP_IMAGE", b"P5\r\n3 2\r\n255\r\n......", "its header ends in CR LF"),
        ("P7", "MAP_IMAGE", b"P7\nWIDTH 1\nHEIGHT 1\n", "is no PNG, PGM or BMP image"),
        ("a broken P2", "MAP_IMAGE", b"P2\n2 1\n255\n1 x\n", "cannot be decoded"),
        ("a PNG head", "MAP_IMAGE", b"\x89PNG\r\n\x1a\n", ""),
        ("a BMP head", "MAP_IMAGE", b"BM......", ""),
    ] {
        check_refused(label, load_image(pgm), code, &["map.yaml: image is \"map.pgm\"", "map.pgm: ", says]);
    }
}

#[test]
fn bytes_after_the_last_pixel_are_warned_about() {
    for pgm in [&b"P5\n3 2\n255\n......\n"[..], b"P2\n2 1\n255\n1 2 3\n"] {
        let map = load_image(pgm).expect("whole");
        assert!(map.warnings.iter().any(|warning| warning.contains("after the last pixel")), "{map:?}");
    }
}

#[test]
fn a_threshold_that_takes_unknown_cells_for_free_is_warned_about() {
    let load = |threshold: &str| {
        let folder = sound_map();
        let yaml = folder.path().join("map.yaml");
        fs::write(&yaml, SOUND_YAML.replace("free_thresh: 0.196", &format!("free_thresh: {threshold}")))
            .expect("written");
        fs::write(folder.path().join("map.pgm"), b"P5\n3 2\n255\n\xcd\xfe\xfe\xfe\xfe\xfe").expect("written");
        load(yaml.to_str().expect("UTF-8"), &LoadOptions::default()).expect("sound").warnings
    };
    assert!(load("0.25").iter().any(|warning| warning.contains("free_thresh 0.25")), "205 is 0.196 of black");
    assert!(load("0.195").is_empty(), "205 stays unknown");
}

#[test]
fn the_values_of_a_mask_are_those_that_nav2_publishes() {
    let values = |row: [u8; 3], mode: &str| {
        let folder = sound_map();
        let yaml = folder.path().join("map.yaml");
        let text = SOUND_YAML.replace("0.65", "1.0").replace("0.196", "0.0") + &format!("mode: {mode}\n");
        fs::write(&yaml, text).expect("written");
        let pgm = [&b"P5\n3 2\n255\n"[..], &row, &[255, 255, 0]].concat();
        fs::write(folder.path().join("map.pgm"), pgm).expect("written");
        let mask = load_values(&yaml, &LoadOptions::default()).expect("a mask");
        assert_eq!((mask.frame.width, mask.frame.height, mask.frame.resolution_m), (3, 2, 0.5));
        assert_eq!(mask.frame.origin, Pose::new(1.0, 2.0, 0.0));
        // The lower row comes first.
        mask.values[3..].to_vec()
    };
    assert_eq!(values([178, 127, 0], "scale"), [30, 50, 100]);
    assert_eq!(values([30, 100, 101], "raw"), [30, 100, -1]);
    assert_eq!(values([255, 127, 0], "trinary"), [0, -1, 100]);
}

#[test]
fn cut_images_are_refused_at_every_byte() {
    let pgm = b"P5\n# a comment\n3 2\n255\n\x00\xfe\xcd\xfe\xfe\xfe";
    assert!(load_image(pgm).is_ok(), "the whole image");
    for length in 0..pgm.len() {
        assert!(load_image(&pgm[..length]).is_err(), "cut to {length} bytes");
    }
}

#[test]
fn kinds_of_pnm_agree() {
    let expected = load_image(b"P5\n3 1\n255\n\x00\xff\x64").expect("P5").grid;
    for (label, pgm) in [
        ("P2", &b"P2\n3 1\n255\n0 255 100\n"[..]),
        ("P2 with a comment", b"P2 # grey\n3 1 255\n0 255 100"),
        ("P3", b"P3 3 1 255  0 0 0  255 255 255  100 100 100"),
        ("P6", b"P6 3 1 255\n\x00\x00\x00\xff\xff\xff\x64\x64\x64"),
        ("16 bits", b"P5 3 1 65535\n\x00\x00\xff\xff\x64\x64"),
        ("maxval 100", b"P5 3 1 100\n\x00\x64\x27"),
    ] {
        assert_eq!(load_image(pgm).unwrap_or_else(|e| panic!("{label}: {e}")).grid, expected, "{label}");
    }
    let bits = load_image(b"P4\n3 1\n\x80").expect("P4").grid;
    assert_eq!(bits.to_string(), "#..\n", "1 is black in a bitmap");
    assert_eq!(load_image(b"P1\n3 1\n1 0 0\n").expect("P1").grid, bits, "P1");
}

#[test]
fn random_bytes_never_panic() {
    arbtest::arbtest(|u| {
        let mut bytes =
            u.choose(&[&b"P5 4 4 255\n"[..], b"P6 2 2 255\n", b"P2 3 3 9\n", b"BM", b""])?.to_vec();
        bytes.extend(u.bytes(u.len().min(64))?);
        let _ = load_image(&bytes);
        let mut yaml = SOUND_YAML.as_bytes().to_vec();
        let at = u.choose_index(yaml.len())?;
        yaml[at] = u.arbitrary()?;
        let _ = load_yaml(&yaml);
        Ok(())
    })
    .budget_ms(500);
}

#[test]
fn what_is_no_map_is_refused_with_what_would_be_one() {
    let folder = sound_map();
    let path = |name: &str| folder.path().join(name);
    fs::write(path("text.txt"), "hello").expect("written");
    fs::write(path("fake.png"), "hello").expect("written");
    fs::write(path("broken.map"), "type octile\nheight 1\n").expect("written");
    fs::write(path("broken.ron"), "(size_m: 3)").expect("written");
    // Unlike map.pgm it has no description beside it.
    fs::copy(path("map.pgm"), path("lone.pgm")).expect("copied");
    for (file, code, says) in [
        ("text.txt", "MAP_FORMAT", "expected a ROS map (.yaml)"),
        ("fake.png", "MAP_IMAGE", "is no PNG, PGM or BMP image"),
        ("broken.map", "MAP_FIELD", "line 3 is \"\", must be `width`"),
        ("broken.ron", "MAP_SYNTAX", "is no floor plan"),
        ("lone.pgm", "MAP_FIELD", "resolution is missing"),
        ("nothing.yaml", "MAP_UNREADABLE", "cannot be read"),
    ] {
        check_refused(file, load_path(&path(file)), code, &[file, says]);
    }
    check_refused("a folder", load_path(folder.path()), "MAP_NOT_A_FILE", &["is a folder"]);
    check_refused(
        "an unknown name",
        load("q", &LoadOptions::default()),
        "MAP_UNKNOWN",
        &["map \"q\" is neither a file nor a named map", "a"],
    );
}
