//! Groups 5, 6 and 7: settings that mean nothing, starts and goals of every kind, and maps that hardly are any.

use std::time::{Duration, Instant};

use serde_json::Value;

use crate::small::{Small, cases, panicked};

fn json(output: &std::process::Output) -> Value {
    let text = String::from_utf8_lossy(&output.stdout);
    serde_json::from_str(&text).unwrap_or_else(|error| panic!("{error} in {text:?}: {output:?}"))
}

/// Exit code, Nav2's number and the message of a solve in the two rooms.
fn solve(place: &Small, start: &str, goal: &str) -> (Option<i32>, Value) {
    let args = ["--json", "solve", "rooms.yaml", "--start", start, "--goal", goal, "--regions", "geometric"];
    let output = place.sharp(&[&args[..], &["--library", "none", "--out", "plan"]].concat());
    assert!(!panicked(&output), "{start} to {goal}: {output:?}");
    (output.status.code(), json(&output))
}

#[test]
fn starts_and_goals_of_every_kind_are_answered_with_nav2_s_codes() {
    let place = Small::new();
    let fine = "2,3,0";
    for (start, goal, code, nav2, words) in [
        ("-1,3,0", fine, "START_OUTSIDE_MAP", 203, "reaches from (0.00, 0.00) to (12.20, 6.20)"),
        (fine, "13,3", "GOAL_OUTSIDE_MAP", 204, "reaches from"),
        // The upper edge is no part of the map, the lower one is the wall.
        (fine, "12.2,6.2", "GOAL_OUTSIDE_MAP", 204, "reaches from"),
        ("0,0,0", fine, "START_OCCUPIED", 205, "lies in an obstacle; the nearest place with room is"),
        ("6.05,1,0", fine, "START_OCCUPIED", 205, "lies in an obstacle; the nearest place with room is"),
        ("0.3,3,1.57", fine, "START_OCCUPIED", 205, "is too near to an obstacle for the husky"),
        (fine, "6.05,1", "GOAL_OCCUPIED", 206, "m away"),
        (fine, "0.15,0.15", "GOAL_OCCUPIED", 206, "too near to an obstacle"),
    ] {
        let (exit, report) = solve(&place, start, goal);
        let error = &report["error"];
        assert_eq!(exit, Some(2), "{start} to {goal}: {report}");
        assert_eq!(
            (&error["code"], &error["nav2"]),
            (&code.into(), &nav2.into()),
            "{start} to {goal}: {report}"
        );
        let message = error["message"].as_str().unwrap_or_default();
        assert!(message.contains(words), "{start} to {goal}: {message}");
    }
    for pose in ["2,3,NaN", "2,3,1e9", "2,inf,0", "2,3,1e400", "2", "2,3,0,0", "", "x,y", "2;3"] {
        let (exit, report) = solve(&place, pose, "10,3.5");
        assert_eq!((exit, &report["error"]["code"]), (Some(2), &"POSE_INVALID".into()), "{pose:?}: {report}");
    }
    // On the border of cells, turned by many turns, and where it stands already.
    for (start, goal) in
        [("2.0,3.0,0", "10.0,3.0"), ("2.05,3.05,999", "10,3.5"), (fine, fine), (fine, "2.0001,3")]
    {
        let (exit, report) = solve(&place, start, goal);
        assert_eq!((exit, &report["status"]), (Some(0), &"solved".into()), "{start} to {goal}: {report}");
    }
}

/// Says of a column and a row whether the cell is free.
type Drawn = Box<dyn Fn(usize, usize) -> bool>;

#[test]
fn maps_that_hardly_are_any_are_answered_in_bounded_time() {
    let place = Small::new();
    let noise = |index: usize| index.wrapping_mul(2_654_435_761) % 1000;
    // 30 m of specks take minutes.
    let side = cases(120, 300) as usize;
    // Specks of one cell, one for every metre, and what a checkerboard leaves: nothing.
    let maps: [(&str, usize, usize, Drawn); 9] = [
        ("all free", 120, 120, Box::new(|_, _| true)),
        ("all occupied", 120, 120, Box::new(|_, _| false)),
        ("one free cell", 1, 1, Box::new(|_, _| true)),
        ("one occupied cell", 1, 1, Box::new(|_, _| false)),
        ("a corridor of one cell", 200, 1, Box::new(|_, _| true)),
        ("a narrow corridor", 200, 12, Box::new(|_, row| (1..11).contains(&row))),
        ("a checkerboard", 120, 120, Box::new(|col, row| (col + row) % 2 == 0)),
        ("specks", side, side, Box::new(move |col, row| noise(col * 300 + row) >= 9)),
        ("rooms with doors too narrow", 120, 120, Box::new(|col, row| col % 40 != 0 || row % 40 == 20)),
    ];
    for (name, width, height, is_free) in &maps {
        let mut pixels = format!("P5\n{width} {height}\n255\n").into_bytes();
        for index in 0..width * height {
            pixels.push(if is_free(index % width, index / width) { 254 } else { 0 });
        }
        place.write("odd.pgm", &pixels);
        let (x, y) = (*width as f64 * 0.1, *height as f64 * 0.1);
        let (start, goal) = (format!("{},{},0", 0.25 * x, 0.4 * y), format!("{},{}", 0.8 * x, 0.6 * y));
        for regions in ["net", "geometric"] {
            let ends = ["--start", &start, "--goal", &goal, "--regions", regions, "--library", "none"];
            let solve =
                [&["solve", "odd.pgm", "--resolution", "0.1", "--json", "--robot", "limo"], &ends[..]]
                    .concat();
            let abstraction =
                ["abstract", "odd.pgm", "--resolution", "0.1", "--json", "--robot", "limo", "--out", "out"];
            let abstraction = [&abstraction[..], &["--regions", regions]].concat();
            // The abstraction guides every option that there is, and between specks there are very many.
            let abstraction = (*name != "specks").then_some(abstraction);
            for args in [Some([&solve[..], &["--out", "plan"]].concat()), abstraction].into_iter().flatten() {
                let begun = Instant::now();
                let output = place.sharp(&args);
                let report = json(&output);
                assert!(!panicked(&output), "{name}, {args:?}: {output:?}");
                assert!(matches!(output.status.code(), Some(0..=2)), "{name}, {args:?}: {output:?}");
                let is_no =
                    report["status"] == "no_plan" && report["reason"].as_str().is_some_and(|r| !r.is_empty());
                let is_error = report["error"]["message"].as_str().is_some_and(|message| !message.is_empty());
                let is_yes = output.status.code() == Some(0);
                assert!(is_yes || is_no || is_error, "{name}, {args:?} says why: {report}");
                assert!(
                    begun.elapsed() < Duration::from_secs(180),
                    "{name}, {args:?}: {:?}",
                    begun.elapsed()
                );
            }
        }
    }
}

#[test]
fn settings_that_mean_nothing_are_named() {
    let place = Small::new();
    let deep = "(".repeat(200_000);
    place.write("deep.ron", deep.as_bytes());
    place.write("long.ron", &vec![b' '; 3 << 20]);
    place.write("robot.ron", b"(robot_radius: 320, drive: Differential(), max_speed_mps: 0.8)");
    place.write("fast.ron", b"(robot_radius: 0.3, drive: Differential(), max_speed_mps: 1e18)");
    place.write("more.ron", b"(robot_radius: 0.3, drive: Differential(), max_speed_mps: 1.0, colour: 3)");
    place.write("zero.ron", b"(robot_radius: -0.0, drive: Differential(), max_speed_mps: 1.0)");
    place.write("places.bad.ron", b"[(1e400, 2.0)]");
    let ends = ["--start", "2,3,0", "--goal", "10,3.5", "--library", "none", "--out", "plan"];
    for (setting, named) in [
        ("--robot=deep.ron", "deep.ron"),
        ("--robot=long.ron", "larger than 1 MiB"),
        ("--robot=robot.ron", "320"),
        ("--robot=fast.ron", "max_speed_mps"),
        ("--robot=more.ron", "colour"),
        ("--robot=zero.ron", "0"),
        ("--noise=deep.ron", "deep.ron"),
        ("--noise=nominal*1e18", "from 0 to 10"),
        ("--regions=deep.ron", "deep.ron"),
        ("--regions=places.bad.ron", "places.bad.ron"),
        ("--downsample=1000000000000000000", "--downsample"),
        ("--downsample=-1", "--downsample"),
        ("--verify=1e18", "--verify"),
        ("--verify=-1", "--verify"),
        ("--time-limit=NaN", "--time-limit"),
        ("--time-limit=-1", "--time-limit"),
        ("--failure-cost=inf", "--failure-cost"),
        ("--min-success=2", "--min-success"),
        ("--goal-heading-tolerance=NaN", "--goal-heading-tolerance"),
        ("--seed=-1", "--seed"),
        ("--threads=1000000000000000000000", "--threads"),
        ("--threads=0", "--threads"),
    ] {
        let output = place.sharp(&[&["solve", "rooms.yaml", setting], &ends[..]].concat());
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(2), "{setting}: {output:?}");
        assert!(said.contains(named) && !panicked(&output), "{setting}: {said}");
        assert!(said.len() < 2000, "{setting}: a message of {} bytes", said.len());
    }
}
