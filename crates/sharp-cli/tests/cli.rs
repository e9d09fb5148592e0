//! The command as a user meets it: exit codes, messages, files, and equal bytes for equal seeds.

use std::collections::BTreeMap;
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};
use std::thread::sleep;
use std::time::Instant;

use serde_json::Value;

fn sharp(folder: &Path, args: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_sharp"))
        .args(args)
        .current_dir(folder)
        .env("XDG_CACHE_HOME", folder.join("cache"))
        .output()
        .expect("the binary runs")
}

fn json(output: &Output) -> Value {
    let text = String::from_utf8_lossy(&output.stdout);
    serde_json::from_str(&text).unwrap_or_else(|error| {
        panic!("{error} in {text:?}, stderr {:?}", String::from_utf8_lossy(&output.stderr))
    })
}

/// Two rooms of 6 x 6 m and a door of 1.4 m, at 0.1 m a cell, as a plain PGM.
fn write_rooms(folder: &Path, door: bool) {
    let (width, height) = (122, 62);
    let mut pixels = format!("P5\n{width} {height}\n255\n").into_bytes();
    for row in 0..height {
        for col in 0..width {
            let border = row == 0 || col == 0 || row == height - 1 || col == width - 1;
            let wall = (60..62).contains(&col) && !(door && (24..38).contains(&row));
            pixels.push(if border || wall { 0 } else { 254 });
        }
    }
    fs::write(folder.join("rooms.pgm"), pixels).unwrap();
    fs::write(
        folder.join("rooms.yaml"),
        "image: rooms.pgm\nresolution: 0.1\norigin: [0.0, 0.0, 0.0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n",
    )
    .unwrap();
}

const ACROSS: [&str; 6] = ["--start", "2.0,3.0,0.0", "--goal", "10.0,3.5,0.0", "--regions", "geometric"];

fn solve_rooms(folder: &Path, extra: &[&str]) -> Output {
    let args = [&["--json", "solve", "rooms.yaml"], &ACROSS[..], extra].concat();
    sharp(folder, &args)
}

const LOUD: &str = "(gain_sd: -1, slip_max: 0, drift_sd_radps: 0, drift_bias_radps: 0, waypoint_sd_m: 0, \
                    slippery_patches: None, delay_s: 0)";
const AJAR: &str = "(size_m: (2, 2), resolution_m: 0.1, wall_thickness_m: 0.2, \
                    walls: [Across(y: 1, x: (0, 2), doors: [(at: 1, width: 3)])])";

#[test]
fn broken_input_gives_exit_2_and_names_what_is_wrong() {
    let folder = tempfile::tempdir().unwrap();
    write_rooms(folder.path(), true);
    fs::write(folder.path().join("lost.yaml"), "image: gone.pgm\nresolution: 0.1\norigin: [0, 0, 0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n").unwrap();
    fs::write(folder.path().join("full.pgm"), [&b"P5\n50 50\n255\n"[..], &[0; 2500]].concat()).unwrap();
    for (file, text) in
        [("robot.ron", "(name: \"x\")"), ("empty.ron", ""), ("loud.ron", LOUD), ("ajar.ron", AJAR)]
    {
        fs::write(folder.path().join(file), text).unwrap();
    }
    fs::write(folder.path().join("bytes.ron"), b"\xff\xfe").unwrap();
    let cases: [(&[&str], &str, &str); 26] = [
        (&["solve", "rooms.yaml", "--start", "2,3,0", "--goal", "6.05,1,0"], "GOAL_OCCUPIED", "goal"),
        (&["solve", "rooms.yaml", "--start", "-2,3,0", "--goal", "10,3,0"], "START_OUTSIDE_MAP", "start"),
        (&["solve", "rooms.yaml", "--start", "2,NaN,0", "--goal", "10,3,0"], "POSE_INVALID", "--start"),
        (&["solve", "rooms.yaml", "--start", "0.3,3,1.57", "--goal", "10,3,0"], "START_OCCUPIED", "nearest"),
        (&["solve", "lost.yaml", "--start", "1,1,0", "--goal", "2,2,0"], "", "gone.pgm"),
        (&["solve", "nowhere.yaml", "--start", "1,1,0", "--goal", "2,2,0"], "", "nowhere.yaml"),
        (
            &["solve", "full.pgm", "--resolution", "0.1", "--start", "1,1,0", "--goal", "2,2,0"],
            "START_OCCUPIED",
            "start",
        ),
        (&["solve", "a", "--problem", "9"], "PROBLEM_UNKNOWN", "1..5"),
        (&["solve", "a", "--problem", "1", "--failure-cost", "NaN"], "USAGE", "--failure-cost is NaN"),
        (&["map", "check", "rooms.yaml", "--robot", "robot.ron"], "ROBOT_INVALID", "robot.ron"),
        (
            &["solve", "rooms.yaml", "--start", "2,3,1e6", "--goal", "10,3"],
            "POSE_INVALID",
            "the yaw is beyond",
        ),
        (
            &["solve", "rooms.yaml", "--start", "2,3,0", "--via", "6.05,1", "--goal", "10,3"],
            "GOAL_OCCUPIED",
            "via (6.05",
        ),
        (&["run", "missing"], "FILE_INVALID", "missing is no folder"),
        (&["run", "."], "FILE_INVALID", "holds no plan"),
        (&["serve", "missing"], "FILE_INVALID", "missing is no folder"),
        (&["serve", "rooms.yaml"], "USAGE", "--library"),
        (&["run", "missing", "--simulator", "bullet"], "USAGE", "must be rapier2d"),
        (&["map", "check", "a", "--robot", "tank"], "FILE_UNREADABLE", "car or a robot file"),
        (&["map", "check", "a", "--robot", "."], "FILE_UNREADABLE", "is a folder"),
        (&["map", "check", "a", "--robot", "full.pgm"], "ROBOT_INVALID", "full.pgm"),
        (&["map", "check", "a", "--robot", "bytes.ron"], "FILE_UNREADABLE", "is not UTF-8 text"),
        (
            &["map", "check", "a", "--robot", "empty.ron"],
            "ROBOT_INVALID",
            "empty.ron: robot description: line 1",
        ),
        (
            &["solve", "a", "--problem", "1", "--noise", "loud.ron"],
            "NOISE_INVALID",
            "loud.ron: noise: gain_sd is -1",
        ),
        (
            &["solve", "a", "--problem", "1", "--noise", "harsh*-1"],
            "NOISE_INVALID",
            "noise \"harsh*-1\": the factor is \"-1\", must be a number from 0 to 10",
        ),
        (&["map", "info", "ajar.ron"], "MAP_FIELD", "ajar.ron: walls[0].doors[0] is 3 m wide"),
        (&["map", "info", "empty.ron"], "MAP_SYNTAX", "empty.ron"),
    ];
    for (args, code, named) in cases {
        let output = sharp(folder.path(), &[&["--json"], args].concat());
        assert_eq!(output.status.code(), Some(2), "{args:?}: {output:?}");
        let error = &json(&output)["error"];
        let message = error["message"].as_str().unwrap_or_default();
        assert!(message.contains(named), "{args:?}: {message}");
        assert!(code.is_empty() || error["code"] == code, "{args:?}: {error}");
        assert!(!String::from_utf8_lossy(&output.stderr).contains("panicked"), "{args:?} panicked");
    }
}

#[test]
fn a_wrong_call_is_told_as_json_too() {
    let folder = tempfile::tempdir().unwrap();
    for (args, named) in [
        (&["--json", "solve"][..], "<MAP>"),
        (&["solve", "a", "--colour", "red", "--json"], "--colour"),
        (&["--json", "map"], "command"),
        (&["--json", "--threads", "0", "map", "info", "a"], "1..=4096"),
    ] {
        let output = sharp(folder.path(), args);
        assert_eq!(output.status.code(), Some(2), "{args:?}: {output:?}");
        let error = &json(&output)["error"];
        let message = error["message"].as_str().unwrap_or_default();
        assert!(error["code"] == "USAGE" && message.contains(named), "{args:?}: {error}");
        assert!(!message.contains('\n') && !message.contains("Usage"), "one line: {message}");
        assert!(!output.stderr.is_empty(), "{args:?}: a terminal has it as before");
    }
    let help = sharp(folder.path(), &["--json", "--help"]);
    assert!(help.status.success() && String::from_utf8_lossy(&help.stdout).contains("Usage:"), "{help:?}");
}

#[test]
fn a_negative_number_is_named_with_its_flag() {
    let folder = tempfile::tempdir().unwrap();
    write_rooms(folder.path(), true);
    for (flag, value, says) in [
        ("--failure-cost", "-1", "--failure-cost is -1, expected"),
        ("--time-limit", "-1", "--time-limit is -1, expected"),
        ("--min-success", "-0.5", "--min-success is -0.5, expected"),
        ("--resolution", "-1", "--resolution is -1.0, expected"),
        ("--verify", "-1", "--verify is \"-1\", expected"),
        ("--seed", "-1", "'-1' for '--seed"),
        ("--start-pixel", "-1,20", "--start-pixel is \"-1,20\", expected"),
    ] {
        let start = if flag == "--start-pixel" { &[][..] } else { &["--start", "2,3,0"] };
        let args = ["solve", "rooms.yaml", flag, value, "--goal", "10,3", "--out", "plan"];
        let output = sharp(folder.path(), &[&args[..], start].concat());
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{flag}: {said}");
        assert!(said.contains(says), "{flag}: {said}");
    }
}

// It said that 4 of 4 executions had arrived, where 200 were asked for.
#[test]
fn a_baseline_out_of_time_says_so() {
    let folder = tempfile::tempdir().unwrap();
    write_rooms(folder.path(), true);
    let args = ["--json", "baseline", "track", "rooms.yaml", "--time-limit", "0"];
    let output = sharp(folder.path(), &[&args[..], &ACROSS[..4]].concat());
    let report = json(&output);
    assert_eq!(output.status.code(), Some(1), "{report}");
    assert_eq!((&report["status"], &report["episodes"]), (&"timeout".into(), &0.into()), "{report}");
    let said = String::from_utf8_lossy(&output.stderr);
    assert!(said.contains("time was up after 0 of 20 executions"), "{said}");
}

#[test]
fn a_goal_behind_a_wall_is_a_no_with_a_reason() {
    let folder = tempfile::tempdir().unwrap();
    write_rooms(folder.path(), false);
    let output = solve_rooms(folder.path(), &["--library", "none"]);
    let report = json(&output);
    assert_eq!(output.status.code(), Some(1), "{report}");
    assert_eq!(report["status"], "no_plan");
    assert!(report["reason"].as_str().is_some_and(|reason| !reason.is_empty()), "{report}");
}

#[test]
fn a_solved_plan_runs_serves_and_repeats_byte_for_byte() {
    let folder = tempfile::tempdir().unwrap();
    write_rooms(folder.path(), true);
    for (threads, out) in [("1", "one"), ("2", "two")] {
        let output = solve_rooms(folder.path(), &["--library", "none", "--threads", threads, "--out", out]);
        assert_eq!(output.status.code(), Some(0), "{:?}", String::from_utf8_lossy(&output.stderr));
        assert_eq!(json(&output)["status"], "solved");
    }
    let files = |name: &str| {
        let mut files: Vec<_> = fs::read_dir(folder.path().join(name))
            .unwrap()
            .map(|entry| entry.unwrap().path())
            .filter(|path| !path.ends_with("solve.json"))
            .map(|path| (path.file_name().unwrap().to_owned(), fs::read(&path).unwrap()))
            .collect();
        files.sort();
        files
    };
    let (one, two) = (files("one"), files("two"));
    assert_eq!(one.len(), two.len(), "the same files");
    for (a, b) in one.iter().zip(&two) {
        assert!(a == b, "{:?} differs between 1 and 2 threads", a.0);
    }

    let run = json(&sharp(folder.path(), &["--json", "run", "one", "--episodes", "20"]));
    assert!(run["successes"].as_u64() >= Some(18), "{run}");
    let again = json(&sharp(folder.path(), &["--json", "--threads", "1", "run", "two", "--episodes", "20"]));
    assert_eq!(untimed(run), untimed(again), "two processes, 1 and 2 threads");
    // Here the engine has contacts to remember.
    let bump = ["--json", "run", "one", "--noise", "harsh", "--collisions", "contact", "--recovery", "off"];
    let [first, second] = [(); 2].map(|()| untimed(json(&sharp(folder.path(), &bump))));
    assert_eq!(first, second, "two processes that bump into walls");
}

#[test]
fn a_page_to_look_at_is_written_where_it_is_wanted() {
    let folder = tempfile::tempdir().unwrap();
    write_rooms(folder.path(), true);
    let data = |file: &str| -> Value {
        let page = fs::read_to_string(folder.path().join(file)).unwrap_or_else(|e| panic!("{file}: {e}"));
        let data = page.split("id=\"data\">").nth(1).unwrap().split("</script>").next().unwrap();
        serde_json::from_str(data).unwrap()
    };
    let report = json(&solve_rooms(folder.path(), &["--library", "none", "--out", "one", "--show"]));
    let shown = data("one/show.html");
    assert_eq!((&shown["map"]["name"], &shown["runs"]["episodes"]), (&"rooms".into(), &200.into()));
    let legs = |value: &Value| -> Vec<Value> {
        value.as_array().unwrap().iter().map(|leg| leg["option"].clone()).collect()
    };
    assert_eq!(legs(&shown["legs"]), legs(&report["plan"]), "the plan that was found");
    assert_eq!(shown["predicted"]["success"], report["predicted"]["success"]);
    let run = sharp(folder.path(), &["--json", "run", "one", "--episodes", "3", "--show", "three.html"]);
    let (run, shown) = (json(&run), data("three.html"));
    assert_eq!((&shown["runs"]["episodes"], &shown["runs"]["reached"]), (&3.into(), &run["successes"]));
    assert_eq!(shown["map"]["name"], "rooms");
    // The page and the runs of an earlier plan would be taken for those of the new one.
    let drives =
        ["run.json", "run.png", "run.svg", "show.html"].map(|file| folder.path().join("one").join(file));
    assert!(drives.iter().all(|file| file.exists()), "of the first plan");
    let again = solve_rooms(folder.path(), &["--library", "none", "--out", "one"]);
    assert!(again.status.success() && drives.iter().all(|file| !file.exists()), "of no plan any more");
    for args in [&["run", "--show", "one"][..], &["run", "one", "--show", "page.txt"]] {
        let output = sharp(folder.path(), args);
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{args:?}: {said}");
        assert!(said.contains("--show") && said.contains("ends in .html"), "{args:?}: {said}");
    }
}

#[test]
fn completions_and_manual_pages_know_every_command() {
    let folder = tempfile::tempdir().unwrap();
    let text = |args: &[&str]| {
        let output = sharp(folder.path(), args);
        assert_eq!(output.status.code(), Some(0), "{args:?}: {output:?}");
        String::from_utf8(output.stdout).unwrap()
    };
    let help = text(&["--help"]);
    let listed = help.split("Commands:").nth(1).unwrap().split("Options:").next().unwrap();
    let names: Vec<&str> = listed
        .lines()
        .filter(|line| line.starts_with("  ") && !line.starts_with("   "))
        .filter_map(|line| line.split_whitespace().next())
        .filter(|&name| name != "help")
        .collect();
    assert!(names.len() >= 15 && names.contains(&"solve") && names.contains(&"man"), "{names:?}");
    for shell in ["bash", "zsh", "fish", "elvish", "powershell"] {
        let script = text(&["completions", shell]);
        let missing: Vec<_> = names.iter().filter(|name| !script.contains(**name)).collect();
        assert!(missing.is_empty(), "{shell} does not know {missing:?}");
    }
    let pages: Value = serde_json::from_str(&text(&["--json", "man", "--out", "man"])).unwrap();
    let pages: Vec<&str> = pages["pages"].as_array().unwrap().iter().map(|it| it.as_str().unwrap()).collect();
    for name in names {
        assert!(pages.contains(&&*format!("sharp-{name}.1")), "{name} has no page among {pages:?}");
    }
    assert!(pages.contains(&"sharp-map-save.1"), "commands below commands have pages: {pages:?}");
    let page = fs::read_to_string(folder.path().join("man/sharp-solve.1")).unwrap();
    assert!(page.contains(".TH sharp-solve 1") && page.contains("speed\\-mask"), "{page}");
    assert!(text(&["man"]).contains(".TH sharp 1"), "the first page, on standard output");
}

/// A report of `sharp run` without its wall times.
fn untimed(mut report: Value) -> Value {
    report.as_object_mut().unwrap().remove("decision_us").expect("wall times are reported");
    report
}

#[test]
fn a_library_is_reused_and_a_damaged_one_is_named() {
    let folder = tempfile::tempdir().unwrap();
    write_rooms(folder.path(), true);
    let first = json(&solve_rooms(folder.path(), &["--library", "lib", "--options", "centroid"]));
    let second = json(&solve_rooms(folder.path(), &["--library", "lib", "--options", "centroid"]));
    assert_eq!(first["reuse"]["reused"], 0, "{first}");
    assert_eq!(second["reuse"]["reused"], second["reuse"]["uses"], "{second}");
    assert!(sharp(folder.path(), &["library", "check", "lib"]).status.success(), "a sound library");

    let world = fs::read_dir(folder.path().join("lib")).unwrap().next().unwrap().unwrap().path();
    let option = fs::read_dir(&world).unwrap().map(|entry| entry.unwrap().path());
    let Some(option) =
        option.into_iter().find(|path| path.file_name().unwrap().to_string_lossy().starts_with("c_"))
    else {
        assert_eq!(second["reuse"]["uses"], 0, "a plan with options leaves them in the library");
        return;
    };
    let mut bytes = fs::read(&option).unwrap();
    let middle = bytes.len() / 2;
    bytes[middle] ^= 1;
    fs::write(&option, bytes).unwrap();
    let output = sharp(folder.path(), &["--json", "library", "check", "lib"]);
    assert_eq!(output.status.code(), Some(2), "{output:?}");
    let message = json(&output)["error"]["message"].to_string();
    assert!(message.contains(option.file_name().unwrap().to_str().unwrap()), "{message}");
}

// A folder of plans was a library without options, and a wrong folder an empty list.
#[test]
fn what_is_no_library_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    write_rooms(folder.path(), true);
    let solved =
        solve_rooms(folder.path(), &["--library", "lib", "--options", "centroid", "--out", "plans/one"]);
    assert!(solved.status.success(), "{solved:?}");
    for (command, place) in [("check", "plans"), ("list", "plans"), ("list", "plans/one"), ("check", ".")] {
        let output = sharp(folder.path(), &["--json", "library", command, place]);
        assert_eq!(output.status.code(), Some(2), "{command} {place}: {output:?}");
        let message = json(&output)["error"]["message"].to_string();
        assert!(message.contains("is no library: no folder in it holds options"), "{place}: {message}");
    }
    let list = sharp(folder.path(), &["library", "list", "lib"]);
    assert!(list.status.success(), "{list:?}");
    let listed = String::from_utf8_lossy(&list.stdout).into_owned();
    assert!(listed.lines().all(|line| line.contains(", cost ")), "{listed}");
}

/// What lies in `folder` and below, by path, but for wall times.
fn files_in(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut files = BTreeMap::new();
    let mut folders = vec![folder.to_owned()];
    while let Some(next) = folders.pop() {
        for path in fs::read_dir(next).unwrap().map(|entry| entry.unwrap().path()) {
            match path.file_name().unwrap().to_str().unwrap() {
                "solve.json" => {}
                _ if path.is_dir() => folders.push(path),
                _ => {
                    let name = path.strip_prefix(folder).unwrap().to_owned();
                    files.insert(name, fs::read(&path).unwrap());
                }
            }
        }
    }
    files
}

#[test]
#[allow(clippy::disallowed_methods, reason = "when to kill is a matter of time")]
fn a_solve_that_was_killed_begins_anew_and_comes_to_the_same_bytes() {
    let solve = |folder: &Path| {
        let args = "--json solve a --problem 5 --options centroid --library lib --out plan".split(' ');
        let mut command = Command::new(env!("CARGO_BIN_EXE_sharp"));
        command.current_dir(folder).args(args).stdout(Stdio::null()).stderr(Stdio::null());
        command
    };
    let [undisturbed, killed] = [(); 2].map(|()| tempfile::tempdir().unwrap());
    let begun = Instant::now();
    assert!(solve(undisturbed.path()).status().unwrap().success());
    let takes = begun.elapsed();
    let mut struck = 0;
    for moment in [0.2, 0.4, 0.6] {
        let mut child = solve(killed.path()).spawn().unwrap();
        sleep(takes.mul_f64(moment));
        struck += usize::from(child.try_wait().unwrap().is_none());
        child.kill().unwrap();
        if child.wait().unwrap().success() {
            break;
        }
    }
    assert!(struck > 0, "it was over before the first kill");
    if !killed.path().join("plan/solve.json").exists() {
        assert!(solve(killed.path()).status().unwrap().success());
    }
    let [expected, mut found] = [&undisturbed, &killed].map(|folder| files_in(folder.path()));
    // Who is killed while it writes leaves the temporary file that nothing reads.
    found.retain(|path, _| path.extension().is_none_or(|ending| ending != "tmp"));
    assert_eq!(found.keys().collect::<Vec<_>>(), expected.keys().collect::<Vec<_>>());
    assert!(expected.keys().any(|path| path.to_string_lossy().contains("/c_")), "options are kept");
    let other: Vec<_> = found.iter().filter(|(path, bytes)| expected[*path] != **bytes).collect();
    assert!(other.is_empty(), "{:?} differ", other.iter().map(|(path, _)| path).collect::<Vec<_>>());
}

#[test]
fn what_was_switched_off_is_named_in_report_and_plan() {
    let folder = tempfile::tempdir().unwrap();
    write_rooms(folder.path(), true);
    let switches = "--learning prior --cost-update off --noise nominal*0.5 --failure-cost 50"
        .split(' ')
        .collect::<Vec<_>>();
    let output =
        solve_rooms(folder.path(), &[&switches[..], &["--library", "none", "--out", "plan"]].concat());
    let report = json(&output);
    assert_eq!(report["status"], "solved", "{report}");
    for (key, value) in [("learning", "prior"), ("cost_update", "off"), ("noise", "nominal*0.5")] {
        assert_eq!(report[key], value, "{key}");
    }
    for leg in report["plan"].as_array().expect("legs") {
        assert_eq!((&leg["policy"], &leg["gradient_steps"]), (&"learnt".into(), &0.into()), "{leg}");
    }
    let plan = fs::read_to_string(folder.path().join("plan/plan.ron")).unwrap();
    for line in ["method: \"prior\"", "cost_update: false", "gain_sd: 0.1", "failure_cost_s: 50"] {
        assert!(plan.contains(line), "no {line} in {plan}");
    }
}

#[test]
fn learning_curves_are_written_where_they_are_asked_for() {
    let folder = tempfile::tempdir().unwrap();
    write_rooms(folder.path(), true);
    let learn = |extra: &[&str]| {
        let args = ["--json", "baseline", "sac", "rooms.yaml", "--episodes", "1", "--max-env-steps", "150"];
        json(&sharp(folder.path(), &[&args[..], &ACROSS[..4], extra].concat()))
    };
    let report = learn(&["--tensorboard", "curves"]);
    assert_eq!(report["env_steps"], 150, "{report}");
    assert_eq!(fs::read_dir(folder.path().join("curves/sac")).unwrap().count(), 1, "one event file");
    let again = learn(&[]);
    assert_eq!(again["successes"], report["successes"], "watching changes nothing");
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 3, "map, image and curves: {again}");
}

#[test]
fn serve_answers_every_line() {
    let folder = tempfile::tempdir().unwrap();
    write_rooms(folder.path(), true);
    assert!(solve_rooms(folder.path(), &["--library", "none", "--out", "plan"]).status.success(), "solved");
    let mut child = Command::new(env!("CARGO_BIN_EXE_sharp"))
        .args(["serve", "plan"])
        .current_dir(folder.path())
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let lines = "{\"pose\":[2.0,3.0,0.0]}\nnonsense\n{\"pose\":[2.2,3.0,0.0]}\n{\"pose\":[10.0,3.5,0.0]}\n";
    child.stdin.take().unwrap().write_all(lines.as_bytes()).unwrap();
    let output = child.wait_with_output().unwrap();
    let replies: Vec<Value> = String::from_utf8_lossy(&output.stdout)
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    assert_eq!(replies.len(), 4, "{replies:?}");
    assert_eq!(replies[0]["status"], "running");
    assert!(replies[0]["waypoint"][0].as_f64() > Some(2.0), "ahead: {}", replies[0]);
    assert_eq!(replies[1]["schema"], "sharp.error/1");
    assert_eq!(replies[2]["status"], "running");
    assert_eq!(replies[3]["status"], "reached", "carried to the goal: {}", replies[3]);
}

#[test]
fn a_solve_without_a_plan_leaves_an_earlier_one_and_says_so() {
    let folder = tempfile::tempdir().unwrap();
    write_rooms(folder.path(), true);
    assert!(solve_rooms(folder.path(), &["--library", "none", "--out", "plan"]).status.success(), "solved");
    let before = files_in(&folder.path().join("plan"));
    write_rooms(folder.path(), false);
    let refused = solve_rooms(folder.path(), &["--library", "none", "--out", "plan"]);
    assert_eq!(refused.status.code(), Some(1), "the door is closed: {refused:?}");
    let said = String::from_utf8_lossy(&refused.stderr);
    assert!(said.contains("warning: plan still holds the plan of an earlier solve"), "{said}");
    assert_eq!(files_in(&folder.path().join("plan")), before, "nothing is lost");
}

#[test]
fn a_learnt_building_answers_solves_and_serves() {
    let folder = tempfile::tempdir().unwrap();
    write_rooms(folder.path(), true);
    fs::write(folder.path().join("places.ron"), "[(2.0, 3.0), (6.1, 3.1), (10.0, 3.0)]").unwrap();
    let kind = ["--options", "centroid", "--regions", "places.ron", "--library", "lib"];
    let learn = [&["--json", "learn", "rooms.yaml", "--out", "pictures"], &kind[..]].concat();
    let output = sharp(folder.path(), &learn);
    let report = json(&output);
    assert_eq!((output.status.code(), &report["status"]), (Some(0), &"whole".into()), "{report}");
    assert_eq!(report["learnt"], report["options"], "{report}");
    assert!(report["pairs"].as_u64() > Some(0) && report["success"]["mean"].as_f64() > Some(0.8), "{report}");
    assert!(
        ["success.png", "speed.png"].iter().all(|name| folder.path().join("pictures").join(name).exists())
    );
    let again = json(&sharp(folder.path(), &learn));
    assert_eq!((again["new"].as_array().map(Vec::len), &again["new_pairs"]), (Some(0), &0.into()), "{again}");

    let problem = ["--start", "2.0,3.0,0.0", "--goal", "10.0,3.5,0.0", "--verify", "0", "--out", "plan"];
    let solved =
        json(&sharp(folder.path(), &[&["--json", "solve", "rooms.yaml"], &problem[..], &kind[..]].concat()));
    assert_eq!(solved["predicted"]["basis"], "composed", "{solved}");
    assert_eq!(solved["reuse"]["uses"], solved["reuse"]["reused"], "{solved}");
    assert!(solved["predicted"]["success"].as_f64() > Some(0.8), "{solved}");

    let mut child = Command::new(env!("CARGO_BIN_EXE_sharp"))
        .args(["serve", "rooms.yaml"])
        .args(kind)
        .current_dir(folder.path())
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let lines = concat!(
        "{\"goal\":[10.0,3.5]}\n{\"pose\":[2.0,3.0,0.0]}\nnonsense\n{\"pose\":[2.3,3.0,0.0],\"speed\":0.6}\n",
        "{\"goal\":[6.1,0.5]}\n{\"pose\":[2.5,3.0,0.0]}\n{\"route\":[[4.0,5.0],[10.0,5.0]]}\n{\"pose\":[-3.0,0.0,0.0]}\n",
        "{\"cancel\":true}\n{\"pose\":[2.5,3.0,0.0]}\n"
    );
    // A robot that does not move is given up, and goes on once somebody has moved it.
    let stuck = "{\"pose\":[2.5,3.0,0.0],\"speed\":0,\"yaw_rate\":0}\n".repeat(200);
    let lines = format!("{lines}{{\"goal\":[10.0,3.5]}}\n{stuck}{{\"pose\":[3.0,3.0,0.0]}}\n");
    let mut stdin = child.stdin.take().unwrap();
    let writer = std::thread::spawn(move || stdin.write_all(lines.as_bytes()).unwrap());
    let output = child.wait_with_output().unwrap();
    writer.join().unwrap();
    let said: Vec<Value> = String::from_utf8_lossy(&output.stdout)
        .lines()
        .map(|line| serde_json::from_str(line).unwrap())
        .collect();
    let words: Vec<&str> = said
        .iter()
        .map(|line| {
            line["plan"]["status"].as_str().or(line["status"].as_str()).or(line["schema"].as_str()).unwrap()
        })
        .collect();
    let expected = [
        "waiting_for_pose",
        "solved",
        "running",
        "sharp.error/1",
        "running",
        "no_plan",
        "no_plan",
        "solved",
        "solved",
        "lost",
        "cancelled",
        "no_plan",
    ];
    assert_eq!(words[..expected.len()], expected, "{said:?}");
    assert_eq!(words[words.len() - 2..], ["lost", "running"], "{:?}", &said[said.len() - 2..]);
    assert!(words.iter().filter(|word| **word == "recovering").count() <= 10, "{words:?}");
    assert!(said[5]["plan"]["reason"].as_str().unwrap().contains("goal"), "{}", said[5]);
    assert!(said[2]["odds"]["success"].as_f64() > Some(0.8), "{}", said[2]);
    let left = |line: usize| said[line]["odds"]["time_s"].as_f64().unwrap();
    assert!(left(4) <= left(2), "less is left later: {} and {}", said[2], said[4]);
}

#[test]
fn regions_are_scored_at_the_doors_of_a_map() {
    let folder = tempfile::tempdir().unwrap();
    write_rooms(folder.path(), true);
    let door = "- name: d1\n  door_corner_pt_1: [6.1, 2.4]\n  door_corner_pt_2: [6.1, 3.8]\n";
    fs::write(folder.path().join("doors.yaml"), door).unwrap();
    fs::write(folder.path().join("bad.yaml"), "name: d1\n").unwrap();
    let score = |doors, regions| {
        let args = ["--json", "regions", "score", "rooms.yaml", "--doors", doors, "--regions", regions];
        sharp(folder.path(), &args)
    };
    for regions in ["net", "geometric"] {
        let report = json(&score("doors.yaml", regions));
        assert_eq!(report["schema"], "sharp.regions.doors/1", "{report}");
        assert_eq!((&report["doors"], &report["found"]), (&1.into(), &1.into()), "{regions}: {report}");
        assert_eq!(report["door_recall"], 1.0, "{regions}: {report}");
    }
    let refused = score("bad.yaml", "net");
    assert_eq!(refused.status.code(), Some(2), "{refused:?}");
    let message = json(&refused)["error"]["message"].to_string();
    assert!(message.contains("bad.yaml: is no list of doors"), "{message}");
}

#[test]
fn regions_training_is_stopped_by_nothing_but_broken_files() {
    let folder = tempfile::tempdir().unwrap();
    let train = |extra: &[&str]| {
        let small = ["--maps", "2", "--goals", "2", "--starts", "3", "--steps", "3"];
        let args = ["--json", "regions", "train", "--preset", "tiny", "--out", "net.safetensors"];
        sharp(folder.path(), &[&args[..], &small, extra].concat())
    };
    let report = json(&train(&[]));
    assert_eq!((&report["maps"], &report["steps"]), (&2.into(), &3.into()), "{report}");
    let network = fs::read(folder.path().join("net.safetensors")).unwrap();
    let work = folder.path().join("net.work");
    assert!(work.join("samples/step-000003.png").exists(), "a sample picture");
    assert_eq!(fs::read_dir(work.join("events")).unwrap().count(), 1, "one event file");

    json(&train(&["--resume"]));
    assert_eq!(fs::read(folder.path().join("net.safetensors")).unwrap(), network, "nothing was left to do");

    fs::write(work.join("checkpoint.safetensors"), b"rubble").unwrap();
    let refused = train(&["--resume"]);
    assert_eq!(refused.status.code(), Some(2), "{refused:?}");
    let message = json(&refused)["error"]["message"].to_string();
    assert!(message.contains("checkpoint.safetensors is damaged"), "{message}");
}
