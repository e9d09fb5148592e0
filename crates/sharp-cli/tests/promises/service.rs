//! Group 17: a service that answers for days, with flat memory and open files, whatever the lines say.

use std::fs;
use std::io::{BufRead, BufReader, Write};
use std::process::{Child, Stdio};
use std::time::Instant;

use crate::small::{Small, cases, say};

/// Resident memory of `child`, megabytes, and its open files; `None` where there is no `/proc`.
fn footprint(child: &Child) -> Option<(f64, usize)> {
    let status = fs::read_to_string(format!("/proc/{}/status", child.id())).ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmRSS:"))?;
    let kilobytes: f64 = line.split_whitespace().next()?.parse().ok()?;
    Some((kilobytes / 1024.0, fs::read_dir(format!("/proc/{}/fd", child.id())).ok()?.count()))
}

/// Line number `number` of a robot that drives, is carried about, and sometimes talks nonsense.
fn line(number: u64) -> String {
    let share = (number as f64 * 0.618_034).fract();
    match number % 50 {
        7 => "{\"pose\":[2.0,3.0]}".to_owned(),
        17 => format!("{{\"pose\":[{},3.0,0.0]}}", 1e300 * share),
        27 => "\u{fffd}\u{0}nonsense".to_owned(),
        37 => "[".repeat(300),
        47 => format!("{{\"pose\":[{:.3},-4.0,0.0]}}", 10.0 * share),
        _ => format!(
            "{{\"pose\":[{:.3},{:.3},{:.3}],\"speed\":0.4}}",
            1.0 + 9.0 * share,
            2.6 + share,
            share - 0.5
        ),
    }
}

#[test]
fn a_service_answers_very_many_lines_with_flat_memory() {
    let (place, since) = (Small::solved(), Instant::now());
    let count = cases(4_000, 100_000);
    let mut child = place
        .command(&["serve", "plan"])
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .expect("the binary runs");
    let mut input = child.stdin.take().expect("piped");
    let mut output = BufReader::new(child.stdout.take().expect("piped"));
    let (mut half, mut errors, mut lost) = (None, 0_u64, 0_u64);
    for number in 0..count {
        writeln!(input, "{}", line(number)).expect("it listens");
        let mut answer = String::new();
        output.read_line(&mut answer).expect("it answers");
        let answer: serde_json::Value = serde_json::from_str(&answer).expect("JSON");
        errors += u64::from(answer["schema"] == "sharp.error/1");
        lost += u64::from(answer["status"] == "lost");
        if number == count / 2 {
            half = footprint(&child);
        }
    }
    let end = footprint(&child);
    drop(input);
    assert_eq!(child.wait().expect("a child").code(), Some(0), "the end of the lines is no error");
    // Of fifty lines, four are no pose that a robot can tell; 1e300 is one of them.
    assert_eq!(errors, count / 50 * 4, "broken lines are answered by an error each");
    assert!(lost >= count / 50, "{lost} poses off the map of {count} are answered lost");
    let (Some((half_mb, half_files)), Some((mb, files))) = (half, end) else { return };
    let found = format!("{half_mb:.0} MB after half, {mb:.0} MB after all, {files} open files");
    say("lines answered by one service", count, &found, since);
    assert!(mb < half_mb * 1.1 + 16.0, "{found}");
    assert!(files <= half_files, "{half_files} open files after half, {files} after all");
}

#[test]
fn a_line_without_end_is_refused_and_the_next_is_answered() {
    let place = Small::solved();
    let endless = format!("{{\"pose\":[{}\n", "1,".repeat(2 << 20));
    let answers = place.serve(&format!("{endless}{{\"pose\":[2.0,3.0,0.0]}}\n"));
    let answers: Vec<&str> = answers.lines().collect();
    assert_eq!(answers.len(), 2, "{answers:?}");
    assert!(answers[0].contains("line 1: has 4194313 bytes, at most 1048576 are read"), "{}", answers[0]);
    assert!(answers[1].contains("\"running\""), "{}", answers[1]);
}
