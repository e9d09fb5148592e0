//! Maps and the places on them as a user gives them: saved, masked, coarser, by pixel, by scenario; goals in a row.

#![allow(clippy::disallowed_methods, reason = "a variable says where real maps lie")]

use std::fs;
use std::path::Path;
use std::process::{Command, Output};

use serde_json::Value;

fn sharp(folder: &Path, args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_sharp"))
        .args(args)
        .current_dir(folder)
        .output()
        .expect("the binary runs")
}

fn json(output: &Output) -> Value {
    let text = String::from_utf8_lossy(&output.stdout);
    serde_json::from_str(&text)
        .unwrap_or_else(|e| panic!("{e} in {text:?}, {}", String::from_utf8_lossy(&output.stderr)))
}

fn said(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// A hall of 12 m x 6 m with a border, 0.1 m a cell; `wall` says which columns are a wall.
fn write_hall(folder: &Path, name: &str, wall: std::ops::Range<usize>) {
    let (width, height) = (120, 60);
    let mut pixels = format!("P5\n{width} {height}\n255\n").into_bytes();
    for row in 0..height {
        for col in 0..width {
            let border = row == 0 || col == 0 || row == height - 1 || col == width - 1;
            pixels.push(if border || wall.contains(&col) { 0 } else { 254 });
        }
    }
    fs::write(folder.join(format!("{name}.pgm")), pixels).expect("a file");
    let yaml = format!(
        "image: {name}.pgm\nresolution: 0.1\norigin: [-1.0, 2.0, 0.0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n"
    );
    fs::write(folder.join(format!("{name}.yaml")), yaml).expect("a file");
}

const QUICK: [&str; 6] = ["--regions", "geometric", "--library", "none", "--learning", "prior"];

#[test]
fn a_saved_map_is_the_same_map_and_an_image_finds_its_description() {
    let folder = tempfile::tempdir().expect("a folder");
    write_hall(folder.path(), "hall", 0..0);
    let hash =
        |map: &str| json(&sharp(folder.path(), &["map", "info", map, "--json"]))["map"]["hash"].clone();
    for map in ["a", "hall.yaml"] {
        let saved = sharp(folder.path(), &["map", "save", map, "--out", "copy.yaml", "--json"]);
        assert_eq!(json(&saved)["schema"], "sharp.map.save/1", "{}", said(&saved));
        assert_eq!(hash("copy.yaml"), hash(map), "{map}");
    }
    let output = sharp(folder.path(), &["map", "info", "hall.pgm", "--json"]);
    assert_eq!(json(&output)["map"]["hash"], hash("hall.yaml"));
    assert!(said(&output).contains("hall.yaml beside it"), "{}", said(&output));
}

// A coarse copy took the place of the user's map, and without an ending it was one that nothing read.
#[test]
fn a_map_is_not_saved_over_what_is_read_nor_without_an_ending() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = |name: &str| folder.path().join(name);
    write_hall(folder.path(), "hall", 0..0);
    write_hall(folder.path(), "mask", 55..60);
    fs::create_dir(path("images")).expect("a folder");
    fs::rename(path("hall.pgm"), path("images/floor.pgm")).expect("moved");
    let yaml = fs::read_to_string(path("hall.yaml")).expect("just written");
    fs::write(path("hall.yaml"), yaml.replace("hall.pgm", "images/floor.pgm")).expect("a file");
    fs::write(path("images/floor.yaml"), "mine").expect("a file");
    let files = ["hall.yaml", "images/floor.pgm", "mask.yaml", "mask.pgm"];
    let before = files.map(|name| fs::read(path(name)).expect("a file"));
    for (out, says) in [
        ("hall.yaml", "would overwrite hall.yaml"),
        ("./images/../hall.yaml", "would overwrite hall.yaml"),
        ("images/floor.yaml", "would overwrite images/floor.pgm"),
        ("mask.yaml", "would overwrite mask.yaml"),
        ("copy", "ends in .yaml"),
    ] {
        let args = ["map", "save", "hall.yaml", "--keepout", "mask.yaml", "--downsample", "10", "--out", out];
        let refused = sharp(folder.path(), &args);
        assert_eq!(refused.status.code(), Some(2), "{out}: {}", said(&refused));
        assert!(said(&refused).contains(says), "{out}: {}", said(&refused));
    }
    assert_eq!(files.map(|name| fs::read(path(name)).expect("a file")), before, "nothing is lost");
    let saved = sharp(folder.path(), &["map", "save", "hall.yaml", "--out", "new/folder/copy.yaml"]);
    assert!(saved.status.success() && path("new/folder/copy.pgm").exists(), "{}", said(&saved));
}

#[test]
fn a_misspelt_key_of_a_map_is_told() {
    let folder = tempfile::tempdir().expect("a folder");
    write_hall(folder.path(), "hall", 0..0);
    let mut yaml = fs::read_to_string(folder.path().join("hall.yaml")).expect("just written");
    yaml.push_str("modee: raw\n");
    fs::write(folder.path().join("odd.yaml"), yaml).expect("a file");
    let odd = sharp(folder.path(), &["map", "info", "odd.yaml"]);
    assert!(
        odd.status.success() && said(&odd).contains("odd.yaml: unknown key \"modee\" is ignored"),
        "{}",
        said(&odd)
    );
    let sound = sharp(folder.path(), &["map", "info", "hall.yaml"]);
    assert!(!said(&sound).contains("unknown key"), "{}", said(&sound));
}

#[test]
fn maps_are_read_as_an_independent_program_reads_them() {
    if Command::new("python3").arg("--version").output().is_err() {
        eprintln!("SKIPPED: there is no python3");
        return;
    }
    let folder = tempfile::tempdir().expect("a folder");
    assert!(sharp(folder.path(), &["map", "save", "a", "--out", "a.yaml"]).status.success());
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/read_maps.py");
    let mut python = Command::new("python3");
    python.arg(script).arg(env!("CARGO_BIN_EXE_sharp")).arg(folder.path());
    match std::env::var_os("SHARP_REAL_MAPS") {
        Some(real) => drop(python.arg(real)),
        None => eprintln!(
            "SKIPPED: SHARP_REAL_MAPS names no folder of real maps, so the project's own is read alone"
        ),
    }
    let output = python.output().expect("python3 runs");
    let printed = String::from_utf8_lossy(&output.stdout);
    assert!(output.status.success() && printed.contains("readings agree"), "{printed}{}", said(&output));
}

#[test]
fn a_keepout_mask_is_a_wall_and_coarse_cells_are_told() {
    let folder = tempfile::tempdir().expect("a folder");
    write_hall(folder.path(), "hall", 0..0);
    write_hall(folder.path(), "mask", 55..60);
    let args = ["solve", "hall.yaml", "--start", "1,5,0", "--goal", "9,5", "--out", "p", "--json"];
    let with_mask = sharp(folder.path(), &[&args[..], &QUICK, &["--keepout", "mask.yaml"]].concat());
    assert_eq!(with_mask.status.code(), Some(1), "{}", said(&with_mask));
    assert!(
        json(&with_mask)["reason"].as_str().is_some_and(|r| r.contains("separate parts")),
        "no way across"
    );
    let coarse = sharp(folder.path(), &["map", "info", "hall.yaml", "--downsample", "7", "--json"]);
    assert_eq!((&json(&coarse)["width"], &json(&coarse)["height"]), (&18.into(), &9.into()));
    assert!(said(&coarse).contains("passages"), "{}", said(&coarse));
}

#[test]
fn places_are_told_by_pixel_and_by_scenario() {
    let folder = tempfile::tempdir().expect("a folder");
    write_hall(folder.path(), "hall", 0..0);
    // The middle of pixel (20, 29) from the upper left, in a map whose lower left corner is (-1, 2).
    let args =
        ["solve", "hall.yaml", "--start-pixel", "20,29", "--goal-pixel", "90,29", "--out", "p", "--json"];
    let solved = json(&sharp(folder.path(), &[&args[..], &QUICK].concat()));
    let length_m: f64 =
        solved["plan"].as_array().expect("a plan").iter().filter_map(|leg| leg["length_m"].as_f64()).sum();
    assert!((6.4..7.6).contains(&length_m), "from (1.05, 5.05) to (8.05, 5.05): {length_m} m");
    for (pixel, word) in [("120,5", "below 120"), ("5", "C,R"), ("5,5,1", "C,R"), ("-1,2", "below")] {
        let args = ["solve", "hall.yaml", "--start", "1,5,0", "--goal-pixel"];
        let flag = format!("{}={pixel}", args[4]);
        let refused = sharp(folder.path(), &[&args[..4], &[flag.as_str()]].concat());
        assert!(
            refused.status.code() == Some(2) && said(&refused).contains(word),
            "{pixel}: {}",
            said(&refused)
        );
    }
    let map: String = std::iter::repeat_n(".".repeat(12), 6).map(|row| row + "\n").collect();
    fs::write(folder.path().join("open.map"), format!("type octile\nheight 6\nwidth 12\nmap\n{map}"))
        .expect("a file");
    let scenarios = "version 1\n0\topen.map\t12\t6\t1\t1\t2\t1\t1\n2\topen.map\t12\t6\t2\t3\t9\t3\t7\n";
    fs::write(folder.path().join("open.scen"), scenarios).expect("a file");
    let args = ["solve", "open.map", "--scen", "open.scen", "--out", "q", "--json", "--problem"];
    let solved = json(&sharp(folder.path(), &[&args[..], &["2"], &QUICK].concat()));
    assert_eq!(solved["status"], "solved", "{solved}");
    let refused = sharp(folder.path(), &[&args[..], &["3"]].concat());
    assert!(refused.status.code() == Some(2) && said(&refused).contains("1 to 2"), "{}", said(&refused));
}

#[test]
fn cells_of_a_metre_do_not_hide_a_door_of_one_cell() {
    let folder = tempfile::tempdir().expect("a folder");
    let row = |row: usize| if row == 2 { ".........\n" } else { "....@....\n" };
    let map: String = (0..5).map(row).collect();
    fs::write(folder.path().join("rooms.map"), format!("type octile\nheight 5\nwidth 9\nmap\n{map}"))
        .expect("a file");
    let ends = ["--start", "1.5,3.5,0", "--goal", "7.5,1.5"];
    let args = [&["solve", "rooms.map", "--robot", "turtlebot3", "--out", "p", "--json"], &ends[..], &QUICK];
    let solved = json(&sharp(folder.path(), &args.concat()));
    assert_eq!(solved["status"], "solved", "{solved}");
    let run = json(&sharp(folder.path(), &["run", "p", "--episodes", "10", "--json"]));
    assert!(run["successes"].as_u64().is_some_and(|count| count >= 9), "{run}");
}

#[test]
fn goals_in_a_row_are_solved_run_and_served_as_one() {
    let folder = tempfile::tempdir().expect("a folder");
    write_hall(folder.path(), "hall", 0..0);
    let args =
        ["solve", "hall.yaml", "--start", "1,4,0", "--via", "9,4", "--goal", "2,6.5", "--out", "p", "--json"];
    let solved = json(&sharp(folder.path(), &[&args[..], &QUICK].concat()));
    assert_eq!(solved["status"], "solved", "{solved}");
    let goals = solved["goals"].as_array().expect("goals");
    assert_eq!((goals.len(), &goals[1]["goal"]), (2, &serde_json::json!([2.0, 6.5])));
    let predicted = solved["predicted"]["success"].as_f64().expect("a prediction");
    assert!(predicted > 0.9, "an open hall: {predicted}");
    let run = json(&sharp(folder.path(), &["run", "p", "--episodes", "20", "--json"]));
    assert!(run["successes"].as_u64().is_some_and(|count| count >= 17), "{run}");
    assert!(run["mean_path_m"].as_f64().is_some_and(|m| m > 14.0), "both goals: {run}");
    // A single goal in the same folder takes the place of the tour.
    let single = ["solve", "hall.yaml", "--start", "1,4,0", "--goal", "9,4", "--out", "p", "--json"];
    assert!(sharp(folder.path(), &[&single[..], &QUICK].concat()).status.success(), "solved");
    let left =
        ["goal-1", "goal-2", "run.json", "tour.ron"].map(|name| folder.path().join("p").join(name).exists());
    assert_eq!(left, [false; 4], "nothing of the tour is left");
    let run = json(&sharp(folder.path(), &["run", "p", "--episodes", "5", "--json"]));
    assert!(run["mean_path_m"].as_f64().is_some_and(|m| m < 12.0), "one goal: {run}");
    let wanted = [&args[..9], &["q", "--min-success", "1", "--noise", "harsh", "--json"], &QUICK].concat();
    let output = sharp(folder.path(), &wanted);
    if json(&output)["predicted"]["success"].as_f64().is_some_and(|success| success < 1.0) {
        assert_eq!((output.status.code(), &json(&output)["status"]), (Some(1), &"below_min_success".into()));
        assert!(folder.path().join("q/tour.ron").exists(), "the plan is written all the same");
    }
}

/// A speed mask for the hall: all of it has the value 75.
fn write_speed_mask(folder: &Path) {
    let header = b"P5\n12 6\n255\n".to_vec();
    fs::write(folder.join("slow.pgm"), [header, vec![75; 72]].concat()).expect("a file");
    let yaml = "image: slow.pgm\nresolution: 1.0\norigin: [-1.0, 2.0, 0.0]\nnegate: 0\noccupied_thresh: 0.65\n\
                free_thresh: 0.196\nmode: raw\n";
    fs::write(folder.join("slow.yaml"), yaml).expect("a file");
}

#[test]
fn a_speed_mask_holds_in_the_prediction_and_in_the_drives() {
    let folder = tempfile::tempdir().expect("a folder");
    write_hall(folder.path(), "hall", 0..0);
    write_speed_mask(folder.path());
    let args = ["--json", "solve", "hall.yaml", "--start", "1,5,0", "--goal", "9,5", "--noise", "none"];
    let solve = |extra: &[&str]| json(&sharp(folder.path(), &[&args[..], &QUICK, extra].concat()));
    let free = solve(&["--out", "free"]);
    let slow = solve(&["--out", "slow", "--speed-mask", "slow.yaml"]);
    let time_s = |report: &Value| report["predicted"]["sim_time_s"].as_f64().expect("a time");
    // A quarter of the Husky's top speed of 1 m/s along 8 m, less the tolerance at the goal.
    assert!(time_s(&free) < 16.0 && (29.0..36.0).contains(&time_s(&slow)), "{free}\n{slow}");
    assert!(slow["plan"][0]["price_s"].as_f64() > Some(25.0), "the search knows: {slow}");
    let run = json(&sharp(folder.path(), &["--json", "run", "slow", "--episodes", "3"]));
    assert_eq!(run["successes"], 3, "{run}");
    let driven_s = run["mean_sim_time_s"].as_f64().expect("a time");
    assert!((driven_s - time_s(&slow)).abs() < 2.0, "the plan keeps the mask: {run}");
    // A mask elsewhere, and one of a mode that has no numbers, are told: they limit nothing.
    let yaml = fs::read_to_string(folder.path().join("slow.yaml")).expect("just written");
    let elsewhere = yaml.replace("[-1.0, 2.0, 0.0]", "[100.0, 2.0, 0.0]");
    fs::write(folder.path().join("elsewhere.yaml"), elsewhere).expect("a file");
    let trinary = yaml.replace("raw", "trinary").replace("0.65", "1.0");
    fs::write(folder.path().join("trinary.yaml"), trinary).expect("a file");
    for (mask, says) in [("elsewhere.yaml", "limits no free cell"), ("trinary.yaml", "is of mode trinary")] {
        let output =
            sharp(folder.path(), &[&args[..], &QUICK, &["--out", "x", "--speed-mask", mask]].concat());
        assert!(output.status.success() && said(&output).contains(says), "{mask}: {}", said(&output));
    }
    let half = ["--out", "half", "--speed-mask", "slow.yaml", "--speed-absolute"];
    let half = solve(&[&half[..], &["--speed-base", "0", "--speed-multiplier", "0.0066667"]].concat());
    assert!((14.0..19.0).contains(&time_s(&half)), "half a metre per second: {half}");
    let refused = ["--speed-mask", "slow.yaml", "--speed-multiplier", "-2", "--out", "x"];
    let refused = solve(&refused)["error"]["message"].to_string();
    assert!(
        refused.contains("--speed-mask slow.yaml: the value 75 at") && refused.contains("means -50 %"),
        "{refused}"
    );
}
