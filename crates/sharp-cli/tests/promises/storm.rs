//! Groups 9 and 10: training, learning and serving that are killed, two writers of one library, folders that cannot be
//! written, that vanish, and clocks that are wrong.

use std::fs;
use std::io::Write;
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant, SystemTime};

use crate::small::{Small, cases, files_below, moments, panicked, say, temporary_files};

/// Kills `args` as often as `kills` says, and lets it end; what it leaves must be what an undisturbed run leaves.
/// After each kill `check` looks at the folder. Returns how many kills came before the end.
fn killed(place: &Small, args: &[&str], kills: u32, check: impl Fn(&Small)) -> u32 {
    let begun = Instant::now();
    let calm = Small::new();
    let output = calm.sharp(args);
    assert_eq!(output.status.code(), Some(0), "undisturbed: {output:?}");
    let takes = begun.elapsed();
    let mut struck = 0;
    for moment in moments().take(kills as usize) {
        let mut child =
            place.command(args).stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("runs");
        sleep(takes.mul_f64(moment));
        struck += u32::from(child.try_wait().expect("a child").is_none());
        child.kill().expect("a child");
        child.wait().expect("a child");
        check(place);
    }
    assert!(struck > 0, "it was over before every one of {kills} kills");
    let output = place.sharp(args);
    assert_eq!(output.status.code(), Some(0), "after {struck} kills: {output:?}");
    // An interrupted write leaves its temporary file; nothing reads it.
    let same = |place: &Small| {
        let mut files = files_below(place.path());
        files.retain(|name, _| !name.ends_with(".tmp"));
        files
    };
    let (expected, found) = (same(&calm), same(place));
    assert_eq!(found.keys().collect::<Vec<_>>(), expected.keys().collect::<Vec<_>>(), "the same files");
    let other: Vec<_> = found.iter().filter(|(name, bytes)| expected[*name] != **bytes).collect();
    assert!(other.is_empty(), "other bytes: {:?}", other.iter().map(|(name, _)| name).collect::<Vec<_>>());
    struck
}

#[test]
fn learning_a_building_that_is_killed_ends_with_the_same_library() {
    let kills = cases(2, 20) as u32;
    let since = Instant::now();
    let struck = killed(&Small::new(), &Small::LEARN, kills, |place| {
        if place.path().join("lib").exists() {
            let check = place.sharp(&["library", "check", "lib"]);
            assert_eq!(check.status.code(), Some(0), "nothing half is read: {check:?}");
        }
    });
    say("killed sharp learn comes to the same bytes", u64::from(kills), &format!("{struck} struck"), since);
}

#[test]
fn training_the_region_network_that_is_killed_ends_with_the_same_weights() {
    let kills = cases(2, 20) as u32;
    let since = Instant::now();
    let train = [
        "regions",
        "train",
        "--preset",
        "tiny",
        "--maps",
        "2",
        "--goals",
        "2",
        "--starts",
        "3",
        "--steps",
        "10",
        "--out",
        "net.safetensors",
        "--resume",
    ];
    let begun = Instant::now();
    let calm = Small::new();
    assert_eq!(calm.sharp(&train).status.code(), Some(0), "undisturbed");
    let takes = begun.elapsed();
    let place = Small::new();
    let mut struck = 0;
    for moment in moments().take(kills as usize) {
        let mut child =
            place.command(&train).stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("runs");
        sleep(takes.mul_f64(moment));
        struck += u32::from(child.try_wait().expect("a child").is_none());
        child.kill().expect("a child");
        child.wait().expect("a child");
    }
    let output = place.sharp(&train);
    assert_eq!(output.status.code(), Some(0), "after {struck} kills: {output:?}");
    let weights = |place: &Small| fs::read(place.path().join("net.safetensors")).expect("weights");
    assert!(weights(&calm) == weights(&place), "other weights after {struck} kills");
    say(
        "killed regions train comes to the same weights",
        u64::from(kills),
        &format!("{struck} struck"),
        since,
    );
}

#[test]
fn training_a_prior_that_is_killed_ends_with_the_same_weights() {
    if std::env::var_os("SHARP_SOAK").is_none() {
        eprintln!("SKIPPED: it takes minutes, SHARP_SOAK=1");
        return;
    }
    let since = Instant::now();
    let train = ["prior", "train", "--robot", "limo", "--preset", "tiny", "--out", "prior.safetensors"];
    let kills = 4;
    let struck = killed(&Small::new(), &train, kills, |place| {
        assert!(!place.path().join("prior.safetensors").exists(), "no prior before it is trained");
    });
    say("killed prior train comes to the same weights", u64::from(kills), &format!("{struck} struck"), since);
}

#[test]
fn a_service_that_is_killed_leaves_its_plan_as_it_was() {
    let (place, since) = (Small::solved(), Instant::now());
    let before = files_below(place.path());
    let kills = cases(5, 50);
    for (number, moment) in moments().take(kills as usize).enumerate() {
        let mut child = place
            .command(&["serve", "plan"])
            .stdin(Stdio::piped())
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("runs");
        let mut input = child.stdin.take().expect("piped");
        for _ in 0..200 {
            // It may be gone already.
            let _ = input.write_all(b"{\"pose\":[2.0,3.0,0.0]}\n");
        }
        sleep(Duration::from_millis(60).mul_f64(moment));
        child.kill().expect("a child");
        child.wait().expect("a child");
        assert!(files_below(place.path()) == before, "kill {number} changed a file");
    }
    let answered = place.serve("{\"pose\":[2.0,3.0,0.0]}\n");
    assert!(answered.contains("\"running\""), "{answered}");
    say("a killed service leaves its plan", kills, "every file as it was", since);
}

#[test]
fn two_writers_of_one_library_never_mix() {
    let since = Instant::now();
    let rounds = cases(1, 20);
    for round in 0..rounds {
        let place = Small::new();
        let solve = |goal: &'static str, out: &'static str| {
            let args = ["solve", "rooms.yaml", "--start", "2,3,0", "--goal", goal, "--regions", "geometric"];
            let keep = ["--options", "centroid", "--library", "lib", "--out", out, "--json"];
            place
                .command(&[&args[..], &keep].concat())
                .stdout(Stdio::piped())
                .stderr(Stdio::piped())
                .spawn()
                .expect("runs")
        };
        let writers =
            [("10,5", "one"), ("10,1", "two"), ("10,5", "three")].map(|(goal, out)| solve(goal, out));
        let outputs = writers.map(|child| child.wait_with_output().expect("a child"));
        for output in &outputs {
            assert_eq!(output.status.code(), Some(0), "round {round}: {output:?}");
        }
        let check = place.sharp(&["library", "check", "lib"]);
        assert_eq!(check.status.code(), Some(0), "round {round}: {check:?}");
        assert_eq!(temporary_files(place.path()), Vec::<String>::new(), "round {round}");
        let plan = |name: &str| fs::read(place.path().join(name).join("plan.ron")).expect("a plan");
        assert!(plan("one") == plan("three"), "round {round}: the same question at the same time");
    }
    say("writers of one library at once", rounds * 3, "every library is sound", since);
}

#[test]
fn a_folder_that_cannot_be_written_is_named_and_read_all_the_same() {
    let place = Small::solved();
    let disk = place.path().join("disk");
    fs::create_dir(&disk).expect("a folder");
    let mount = |args: &[&str]| {
        let done = Command::new("mount").args(args).arg(&disk).output();
        done.is_ok_and(|done| done.status.success())
    };
    if !mount(&["-t", "tmpfs", "tmpfs"]) {
        eprintln!("SKIPPED: nothing can be mounted here");
        return;
    }
    let copy = Command::new("cp").args(["-r", "plan", "lib", "disk/"]).current_dir(place.path()).status();
    let is_read_only = copy.is_ok_and(|status| status.success()) && mount(&["-o", "remount,ro"]);
    let solve = ["solve", "rooms.yaml", "--start", "2,3,0", "--goal", "10,3.5", "--regions", "geometric"];
    let outputs = [
        ("a plan", [&solve[..], &["--library", "none", "--out", "disk/new"]].concat(), 2, "disk/new"),
        ("an old plan", [&solve[..], &["--library", "none", "--out", "disk/plan"]].concat(), 2, "disk/plan"),
        (
            "a new library",
            [&solve[..], &["--library", "disk/other", "--out", "out"]].concat(),
            2,
            "disk/other",
        ),
        ("pictures", vec!["abstract", "rooms.yaml", "--out", "disk/abstract"], 2, "disk/abstract"),
        ("a map", vec!["map", "save", "rooms.yaml", "--out", "disk/map.yaml"], 2, "disk/map"),
        ("a recording", vec!["run", "plan", "--episodes", "1", "--record", "disk/a.mcap"], 2, "disk/a.mcap"),
        ("an export", vec!["export", "plan", "--format", "csv", "--out", "disk/a.csv"], 2, "disk/a.csv"),
        ("jobs", vec!["jobs", "plan", "smoke", "--out", "disk/jobs"], 2, "disk/jobs"),
        ("a plan that is run", vec!["run", "disk/plan", "--episodes", "1"], 0, ""),
        ("a library that is checked", vec!["library", "check", "disk/lib"], 0, ""),
    ]
    .map(|(what, args, code, named)| (what, code, named, place.sharp(&args)));
    let unmount = Command::new("umount").arg(&disk).status();
    assert!(unmount.is_ok_and(|status| status.success()), "the disk is unmounted");
    assert!(is_read_only, "the disk was prepared");
    for (what, code, named, output) in outputs {
        let said = String::from_utf8_lossy(&output.stderr).into_owned();
        assert_eq!(output.status.code(), Some(code), "{what}: {output:?}");
        assert!(said.contains(named) && !panicked(&output), "{what}: {said}");
        assert!(code == 0 || said.contains("Read-only"), "{what}: the reason is said: {said}");
    }
}

#[test]
fn folders_that_vanish_while_they_are_used_are_told_or_made_again() {
    let since = Instant::now();
    let rounds = cases(3, 40);
    let (mut made, mut told) = (0, 0);
    let calm = Small::new();
    let begun = Instant::now();
    assert_eq!(calm.sharp(&Small::SOLVE).status.code(), Some(0), "undisturbed");
    let takes = begun.elapsed();
    for moment in moments().take(rounds as usize) {
        let place = Small::new();
        let child = place.command(&Small::SOLVE).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn();
        sleep(takes.mul_f64(moment));
        for folder in ["lib", "plan", "cache"] {
            let _ = fs::remove_dir_all(place.path().join(folder));
        }
        let output = child.expect("runs").wait_with_output().expect("a child");
        assert!(!panicked(&output), "at {moment}: {output:?}");
        match output.status.code() {
            Some(0) => made += 1,
            Some(2) => {
                let said = String::from_utf8_lossy(&output.stderr).into_owned();
                assert!(said.contains("lib") || said.contains("plan"), "at {moment}: {said}");
                told += 1;
            }
            other => panic!("at {moment}: {other:?} {output:?}"),
        }
        let again = place.sharp(&Small::SOLVE);
        assert_eq!(again.status.code(), Some(0), "after {moment}: {again:?}");
    }
    say("a folder vanishes", rounds, &format!("{made} made it again, {told} named it"), since);
}

#[test]
fn clocks_that_are_wrong_change_nothing() {
    let place = Small::solved();
    let expected = files_below(&place.path().join("plan"));
    // Files of tomorrow, and of 1970.
    let day = Duration::from_secs(86_400);
    for time in [SystemTime::now() + 400 * day, SystemTime::UNIX_EPOCH] {
        for name in files_below(place.path()).keys() {
            let file = fs::File::options().append(true).open(place.path().join(name)).expect("a file");
            file.set_modified(time).expect("its time");
        }
        let output = place.sharp(&[&Small::SOLVE[..10], &["--out", "again"]].concat());
        assert_eq!(output.status.code(), Some(0), "{output:?}");
        let check = place.sharp(&["library", "check", "lib"]);
        assert_eq!(check.status.code(), Some(0), "{check:?}");
        let again = files_below(&place.path().join("again"));
        assert!(again.keys().eq(expected.keys()), "{:?}", again.keys());
        fs::remove_dir_all(place.path().join("again")).expect("it was there");
    }
    // A clock that jumps while the command runs, where a program that lies about it is installed.
    let has_faketime = Command::new("faketime").arg("--version").output().is_ok();
    if !has_faketime {
        eprintln!("SKIPPED: the clock jumps with Debian's faketime only");
        return;
    }
    for lie in ["+400d", "@1970-01-02 00:00:00", "+0 x1000"] {
        let jumpy = Small::new();
        let mut command = Command::new("faketime");
        command.args(["-f", lie, env!("CARGO_BIN_EXE_sharp")]).args(Small::SOLVE).current_dir(jumpy.path());
        let output = command.output().expect("runs");
        assert_eq!(output.status.code(), Some(0), "{lie}: {output:?}");
        assert!(files_below(&jumpy.path().join("plan")) == expected, "{lie}: other bytes");
    }
}

#[test]
fn asked_twice_it_stops_at_once() {
    let place = Small::new();
    let train = ["prior", "train", "--robot", "limo", "--preset", "default", "--out", "prior.safetensors"];
    let mut child = place.command(&train).stdout(Stdio::null()).stderr(Stdio::null()).spawn().expect("runs");
    sleep(Duration::from_millis(700));
    let ask = |child: &Child| {
        let asked = Command::new("kill").args(["-INT", &child.id().to_string()]).status();
        asked.expect("kill runs").success()
    };
    assert!(ask(&child), "it was over too soon");
    sleep(Duration::from_millis(100));
    if child.try_wait().expect("a child").is_none() {
        ask(&child);
    }
    let begun = Instant::now();
    let status = child.wait().expect("a child");
    assert_eq!(status.code(), Some(130), "{status:?}");
    assert!(begun.elapsed() < Duration::from_secs(5), "at once, not after {:?}", begun.elapsed());
}
