//! Group 16: files that are sound but for a few changed bytes. Whatever reads them answers, and does not panic.

use std::fmt::Write as _;
use std::fs;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::time::Instant;

use rand::RngExt;
use sharp_bench::{ImportWishes, Manifest, Suite, SuiteSelection, import_robot};
use sharp_drive::World;
use sharp_maps::{LoadOptions, load, load_doors, load_scenario};
use sharp_plan::{Answer, Method, OptionLibrary, Plan, Query, Sharp};
use sharp_regions::GeometricDetector;
use sharp_rl::Actor;
use sharp_sim::{NoiseModel, RobotModel};
use sharp_space::{Pose, Seed, Stream};

use crate::worlds::Drawing;
use crate::{cases, told};

/// Numbers and words that files get wrong.
const PIECES: [&str; 24] = [
    "0",
    "-1",
    "1e308",
    "-1e308",
    "NaN",
    "inf",
    "-inf",
    "18446744073709551616",
    "9999999999",
    "1e-320",
    "\0",
    "\u{feff}",
    "[",
    "]",
    "(",
    ")",
    "{",
    "}",
    ":",
    ",",
    "\n",
    "\r\n",
    "\"",
    "../",
];

/// `bytes` with one to six changes.
fn mutated(bytes: &[u8], rng: &mut Stream) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    for _ in 0..rng.random_range(1..=6) {
        let at = rng.random_range(0..=bytes.len());
        let end = (at + rng.random_range(0..16)).min(bytes.len());
        match rng.random_range(0..6) {
            0 if at < bytes.len() => bytes[at] = rng.random(),
            1 if at < bytes.len() => bytes[at] ^= 1 << rng.random_range(0..8),
            2 => drop(bytes.drain(at..end)),
            3 => bytes.truncate(at),
            4 => {
                let piece = PIECES[rng.random_range(0..PIECES.len())];
                drop(bytes.splice(at..end, piece.bytes()));
            }
            _ => {
                let copy = bytes[at..end].to_vec();
                let to = rng.random_range(0..=bytes.len());
                drop(bytes.splice(to..to, copy));
            }
        }
    }
    bytes
}

/// Changes the files in `folder` one at a time, and lets `read` read what came of it.
fn try_files(what: &str, folder: &Path, files: &[PathBuf], count: u64, read: impl Fn()) {
    assert!(!files.is_empty(), "{what}: there are files in {}", folder.display());
    let since = Instant::now();
    let mut faults = String::new();
    for number in 0..count {
        let mut rng = Seed(16).stream(what, number);
        let file = &files[rng.random_range(0..files.len())];
        let sound = fs::read(file).expect("readable");
        let broken = mutated(&sound, &mut rng);
        fs::write(file, &broken).expect("writable");
        if catch_unwind(AssertUnwindSafe(&read)).is_err() {
            _ = writeln!(faults, "{what} number {number}, {}: {}", file.display(), broken.escape_ascii());
        }
        fs::write(file, &sound).expect("writable");
    }
    told(
        &format!("changed bytes never panic, {what}"),
        count,
        &format!("{} panics", faults.lines().count()),
        since,
    );
    assert!(faults.is_empty(), "{faults}");
}

fn files_below(folder: &Path) -> Vec<PathBuf> {
    let entries = fs::read_dir(folder).expect("a folder").map(|entry| entry.expect("an entry").path());
    let mut files: Vec<PathBuf> =
        entries.flat_map(|path| if path.is_dir() { files_below(&path) } else { vec![path] }).collect();
    files.sort();
    files
}

/// A folder with these files.
fn folder_of(files: &[(&str, &[u8])]) -> (tempfile::TempDir, Vec<PathBuf>) {
    let folder = tempfile::tempdir().expect("a folder");
    let write = |(name, bytes): &(&str, &[u8])| {
        let path = folder.path().join(name);
        fs::write(&path, bytes).expect("written");
        path
    };
    let paths = files.iter().map(write).collect();
    (folder, paths)
}

#[test]
fn maps_and_what_lies_beside_them() {
    let yaml = b"image: m.pgm\nmode: trinary\nresolution: 0.05\norigin: [-1.5, 2.0, 0.3]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n";
    let mut pgm = b"P5\n# map saver\n12 10\n255\n".to_vec();
    pgm.extend((0..120_u8).map(|i| if i % 7 == 0 { 0 } else { 254 }));
    let text_map = b"type octile\nheight 4\nwidth 6\nmap\n@@@@@@\n@....@\n@..T.@\n@@@@@@\n";
    let scenario =
        b"version 1\n0\tm.map\t6\t4\t1\t1\t4\t2\t3.41421356\n1\tm.map\t6\t4\t2\t1\t1\t2\t1.41421356\n";
    let plan = include_bytes!("../../crates/sharp-maps/assets/a.ron");
    let doors = b"doors:\n- {name: d1, p1: [1.0, 2.0], p2: [1.5, 2.0]}\n- {name: d2, p1: [3.0, 2.0], p2: [3.5, 2.0]}\n";
    let files: [(&str, &[u8]); 6] = [
        ("m.yaml", yaml),
        ("m.pgm", &pgm),
        ("m.map", text_map),
        ("m.scen", scenario),
        ("plan.ron", plan),
        ("doors.yaml", doors),
    ];
    let (folder, paths) = folder_of(&files);
    let at = |name: &str| folder.path().join(name);
    try_files("maps", folder.path(), &paths, cases(500, 1_000_000), || {
        for name in ["m.yaml", "m.map", "plan.ron"] {
            let _ = load(at(name).to_str().expect("UTF-8"), &LoadOptions::default());
        }
        let _ = load_scenario(&at("m.scen"), 1);
        let _ = load_doors(&at("doors.yaml"));
    });
}

#[test]
fn robots_noise_and_what_they_are_imported_from() {
    let nav2 = b"controller_server:\n  ros__parameters:\n    FollowPath:\n      max_vel_x: 0.26\n      min_vel_x: 0.0\n      acc_lim_x: 2.5\nlocal_costmap:\n  local_costmap:\n    ros__parameters:\n      footprint: \"[[0.2, 0.1], [0.2, -0.1], [-0.2, -0.1], [-0.2, 0.1]]\"\n";
    let urdf = b"<?xml version=\"1.0\"?>\n<robot name=\"box\"><link name=\"base_link\"><collision><geometry><box size=\"0.4 0.3 0.2\"/></geometry></collision><inertial><mass value=\"5\"/></inertial></link></robot>\n";
    let husky = include_bytes!("../../crates/sharp-sim/assets/robots/husky.ron");
    let short = b"(footprint: \"[[0.2, 0.1], [0.2, -0.1], [-0.2, -0.1], [-0.2, 0.1]]\", drive: Differential(), max_speed_mps: 0.8)";
    let nominal = include_bytes!("../../crates/sharp-sim/assets/noise/nominal.ron");
    let files: [(&str, &[u8]); 5] = [
        ("p.yaml", nav2),
        ("r.urdf", urdf),
        ("husky.ron", husky),
        ("short.ron", short),
        ("noise.ron", nominal),
    ];
    let (folder, paths) = folder_of(&files);
    let at = |name: &str| folder.path().join(name);
    let wishes = ImportWishes { max_speed_mps: Some(0.5), ..ImportWishes::default() };
    try_files("robots and noise", folder.path(), &paths, cases(500, 1_000_000), || {
        for name in ["husky.ron", "short.ron"] {
            if let Ok(text) = fs::read_to_string(at(name)) {
                let _ = RobotModel::from_ron_named(&text, "changed");
            }
        }
        if let Ok(text) = fs::read_to_string(at("noise.ron")) {
            let _ = NoiseModel::from_ron(&text);
        }
        let _ = import_robot(&[at("p.yaml"), at("r.urdf")], &wishes);
    });
}

#[test]
fn plans_of_jobs() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut experiments = SuiteSelection::new(Suite::Smoke, 1).experiments().expect("a suite");
    experiments.truncate(3);
    Manifest::extend(folder.path(), experiments, "by hand").expect("written");
    let files = files_below(folder.path());
    try_files("plans of jobs", folder.path(), &files, cases(200, 100_000), || {
        if let Err(error) = Manifest::open(folder.path()) {
            assert!(error.to_string().contains("manifest.jsonl"), "a message names the file: {error}");
        }
    });
}

#[test]
fn libraries_plans_and_networks() {
    let folder = tempfile::tempdir().expect("a folder");
    let mut drawing = Drawing::room(160, 40);
    for (col, door) in [(40, 4..18), (80, 22..36), (120, 4..18)] {
        drawing.paint(col..col + 2, 0..40, true);
        drawing.paint(col..col + 2, door, false);
    }
    let world = World::new(drawing.grid(0.1), RobotModel::limo());
    let mut method = Method::fast().with_episodes(20, 20, 20);
    method.search.direct = false;
    let library = OptionLibrary::open(&folder.path().join("library"), "key-map").expect("empty");
    let mut sharp =
        Sharp::new(world.clone(), GeometricDetector::default()).with_method(method).with_library(library);
    let query = Query { start: Pose::new(1.0, 1.0, 0.0), goal: Pose::new(15.0, 1.0, 0.0) };
    let Answer::Solved(plan) = sharp.solve(query, &()).expect("there is room") else { panic!("no plan") };
    sharp.library_mut().save().expect("written");
    let abstraction = sharp.abstraction_file(&()).expect("there is room");
    plan.save(&folder.path().join("plan"), &abstraction).expect("written");
    let files = files_below(folder.path());
    assert!(files.len() > 4, "a library and a plan: {files:?}");
    let weights: Vec<PathBuf> = files
        .iter()
        .filter(|file| file.extension().is_some_and(|end| end == "safetensors"))
        .cloned()
        .collect();
    try_files("libraries, plans and networks", folder.path(), &files, cases(300, 50_000), || {
        let _ = OptionLibrary::open(&folder.path().join("library"), "key-map");
        let _ = Plan::load(&folder.path().join("plan"), (*world.grid).clone());
    });
    try_files("weights without a checksum", folder.path(), &weights, cases(300, 200_000), || {
        for file in &weights {
            let _ = Actor::from_bytes(&fs::read(file).expect("readable"));
        }
    });
}
