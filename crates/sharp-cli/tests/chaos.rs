//! What happens to the user's files when a command is killed, the disk is full, or the processor is another one.

#![allow(clippy::disallowed_methods, reason = "variables say how much to try")]

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// A solve that keeps what it learns.
const SOLVE: [&str; 11] = [
    "solve",
    "a",
    "--problem",
    "4",
    "--robot",
    "limo",
    "--library",
    "library",
    "--out",
    "plan",
    "--threads=1",
];

fn sharp(folder: &Path, args: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_sharp"));
    command.args(args).current_dir(folder).env("XDG_CACHE_HOME", folder.join("cache"));
    command.stdout(Stdio::null()).stderr(Stdio::null());
    command
}

fn output(folder: &Path, args: &[&str]) -> Output {
    sharp(folder, args).stdout(Stdio::piped()).stderr(Stdio::piped()).output().expect("the binary runs")
}

/// All files below `folder` but the report with its wall times.
fn files(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut open = vec![folder.to_owned()];
    while let Some(folder) = open.pop() {
        for entry in fs::read_dir(&folder).into_iter().flatten() {
            let path = entry.expect("an entry").path();
            if path.is_dir() {
                open.push(path);
            } else if !path.ends_with("solve.json") {
                found.insert(path.to_string_lossy().into_owned(), fs::read(&path).expect("readable"));
            }
        }
    }
    found
}

/// The same with names below `folder`.
fn named(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let root = folder.to_string_lossy().into_owned();
    files(folder)
        .into_iter()
        .map(|(name, bytes)| (name.trim_start_matches(&root).to_owned(), bytes))
        .collect()
}

#[test]
fn a_solve_killed_at_any_moment_leaves_no_half_file_and_ends_with_the_same_bytes() {
    let kills: u32 = std::env::var("SHARP_KILLS").ok().and_then(|kills| kills.parse().ok()).unwrap_or(4);
    let (calm, stormy) = (tempfile::tempdir().expect("a folder"), tempfile::tempdir().expect("a folder"));
    assert_eq!(output(calm.path(), &SOLVE).status.code(), Some(0), "undisturbed");
    // The first start of a program takes longer than the others.
    let begun = Instant::now();
    assert_eq!(output(stormy.path(), &SOLVE).status.code(), Some(0), "undisturbed, once more");
    let takes = begun.elapsed();
    let mut struck = 0;
    let forget = || {
        for folder in ["library", "plan"] {
            let _ = fs::remove_dir_all(stormy.path().join(folder));
        }
    };
    forget();
    for number in 1..=kills {
        // As if by chance, and the same every time.
        let moment = (f64::from(number) * 0.618_034).fract();
        let mut child = sharp(stormy.path(), &SOLVE).spawn().expect("the binary runs");
        sleep(takes.mul_f64(moment));
        struck += u32::from(child.try_wait().expect("a child").is_none());
        child.kill().expect("a child");
        child.wait().expect("a child");
        if stormy.path().join("library").exists() {
            let check = output(stormy.path(), &["library", "check", "library"]);
            assert_eq!(check.status.code(), Some(0), "after kill {number}: {check:?}");
        }
        // Each kill meets a solve that has all to do.
        forget();
    }
    assert!(struck > 0, "it was over before every one of {kills} kills");
    let mut child = sharp(stormy.path(), &SOLVE).spawn().expect("the binary runs");
    sleep(takes / 2);
    child.kill().expect("a child");
    child.wait().expect("a child");
    assert_eq!(output(stormy.path(), &SOLVE).status.code(), Some(0), "after a kill");
    for folder in ["library", "plan"] {
        let (calm, mut stormy) = (named(&calm.path().join(folder)), named(&stormy.path().join(folder)));
        // Who is killed while it writes leaves the temporary file that nothing reads.
        stormy.retain(|name, _| !name.ends_with(".tmp"));
        assert!(!calm.is_empty(), "{folder} holds files");
        assert_eq!(calm.keys().collect::<Vec<_>>(), stormy.keys().collect::<Vec<_>>(), "{folder}");
        assert!(calm == stormy, "{folder} holds other bytes after a kill");
    }
    println!("soak: killed solves come to the same bytes: {} cases, {struck} were struck", kills + 1);
}

#[test]
fn on_a_full_disk_the_reason_is_said_and_what_was_there_stays() {
    let folder = tempfile::tempdir().expect("a folder");
    let disk = folder.path().join("disk");
    fs::create_dir(&disk).expect("a folder");
    let mount = Command::new("mount").args(["-t", "tmpfs", "-o", "size=48k", "tmpfs"]).arg(&disk).output();
    if !mount.is_ok_and(|mount| mount.status.success()) {
        eprintln!("SKIPPED: a small disk cannot be mounted here");
        return;
    }
    fs::write(disk.join("before"), b"mine").expect("there is room");
    let args = ["solve", "a", "--problem", "4", "--robot", "limo", "--library", "none", "--out", "disk/plan"];
    let full = output(folder.path(), &args);
    let (left, kept) = (named(&disk), fs::read(disk.join("before")));
    let unmount = Command::new("umount").arg(&disk).status();
    assert!(unmount.is_ok_and(|status| status.success()), "the disk is unmounted");
    assert_eq!(full.status.code(), Some(2), "{full:?}");
    let said = String::from_utf8_lossy(&full.stderr);
    assert!(said.contains("disk/plan") && said.contains("No space left"), "{said}");
    assert!(!left.contains_key("/plan/plan.ron"), "no plan whose parts are missing: {:?}", left.keys());
    assert_eq!(kept.expect("still there"), b"mine");
}

#[test]
fn processors_with_other_instructions_come_to_the_same_bytes() {
    let has_emulator = Command::new("qemu-x86_64").arg("--version").output().is_ok();
    if std::env::var_os("SHARP_SOAK").is_none() || !has_emulator {
        eprintln!("SKIPPED: it takes minutes, SHARP_SOAK=1 and qemu-x86_64 (Debian's qemu-user)");
        return;
    }
    let here = tempfile::tempdir().expect("a folder");
    assert_eq!(output(here.path(), &SOLVE).status.code(), Some(0), "this processor");
    let mut took: Vec<(&str, Duration)> = Vec::new();
    // Without AVX, with AVX2 and fused multiplication, and with all that the emulator knows.
    for processor in ["Nehalem", "Haswell", "max"] {
        let folder = tempfile::tempdir().expect("a folder");
        let begun = Instant::now();
        let mut command = Command::new("qemu-x86_64");
        command.args(["-cpu", processor, env!("CARGO_BIN_EXE_sharp")]).args(SOLVE).current_dir(folder.path());
        let output = command.output().expect("the emulator runs");
        assert_eq!(output.status.code(), Some(0), "{processor}: {output:?}");
        took.push((processor, begun.elapsed()));
        for part in ["library", "plan"] {
            let (a, b) = (named(&here.path().join(part)), named(&folder.path().join(part)));
            assert!(a == b, "{processor}: {part} holds other bytes");
        }
    }
    println!("soak: emulated processors come to the same bytes: {} cases, {took:.0?}", took.len());
}
