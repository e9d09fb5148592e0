//! Group 18: no network, no temporary file left, and no write outside the output folder, as the system sees it.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::small::{Small, temporary_files};

/// Calls that open, make, move or remove files, and all that begins a connection.
const CALLS: &str = "trace=open,openat,creat,mkdir,mkdirat,rename,renameat,renameat2,unlink,unlinkat,rmdir,link,\
                     linkat,symlink,symlinkat,truncate,socket,connect,bind";

/// The files that the calls in `trace` wrote, made, moved or removed, and the sockets that they opened.
fn touched(trace: &str, folder: &Path) -> (BTreeSet<PathBuf>, Vec<String>) {
    let (mut paths, mut sockets) = (BTreeSet::new(), Vec::new());
    for line in trace.lines().filter(|line| !line.contains(") = -1 ")) {
        let Some((call, args)) = line.split_once('(') else { continue };
        let call = call.rsplit(' ').next().unwrap_or_default();
        if matches!(call, "socket" | "connect" | "bind") {
            sockets.push(line.to_owned());
            continue;
        }
        // A file without a name, to see whether one could be made, is gone when it is closed.
        let is_written = ["O_WRONLY", "O_RDWR", "O_CREAT"].iter().any(|flag| args.contains(flag));
        let is_kept = is_written && !args.contains("O_TMPFILE");
        if matches!(call, "open" | "openat") && !is_kept {
            continue;
        }
        // Of each file the folder that it is named from, as `5</tmp/x>, ` or `AT_FDCWD</tmp/x>, `, and the name.
        let parts: Vec<&str> = args.split('"').collect();
        for pair in parts.chunks_exact(2) {
            let base = pair[0].rsplit_once('<').and_then(|(_, rest)| rest.split('>').next());
            paths.insert(base.map_or(folder, Path::new).join(pair[1]));
        }
    }
    (paths, sockets)
}

#[test]
fn commands_write_below_their_output_folders_and_open_no_socket() {
    if !Command::new("strace").arg("--version").output().is_ok_and(|output| output.status.success()) {
        eprintln!("SKIPPED: strace watches what a command does");
        return;
    }
    let place = Small::new();
    let folder = place.path();
    let solve = &Small::SOLVE[..];
    let commands: [(&[&str], &[&str]); 12] = [
        (solve, &["lib", "plan"]),
        (&["abstract", "rooms.yaml", "--out", "abstract"], &["abstract"]),
        (
            &["learn", "rooms.yaml", "--options", "centroid", "--regions", "places.ron", "--library", "all"],
            &["all"],
        ),
        (&["run", "plan", "--episodes", "2", "--record", "drive.mcap"], &["drive.mcap", "plan"]),
        (&["run", "plan", "--episodes", "2", "--show", "page.html"], &["page.html", "plan"]),
        (&["export", "plan", "--format", "csv", "--out", "path.csv"], &["path.csv"]),
        (&["export", "plan", "--format", "geojson", "--out", "path.geojson"], &["path.geojson"]),
        (&["map", "save", "rooms.yaml", "--out", "saved.yaml"], &["saved.yaml", "saved.pgm"]),
        (&["map", "info", "rooms.yaml"], &[]),
        (&["library", "check", "lib"], &[]),
        (&["jobs", "plan", "smoke", "--out", "jobs"], &["jobs"]),
        (
            &["baseline", "track", "rooms.yaml", "--start", "2,3,0", "--goal", "10,3.5", "--episodes", "1"],
            &[],
        ),
    ];
    for (args, outputs) in commands {
        let log = folder.join("trace.log");
        let mut command = Command::new("strace");
        command.args(["-f", "-y", "-qq", "-s", "4096", "-e", CALLS, "-o"]).arg(&log);
        command.arg(env!("CARGO_BIN_EXE_sharp")).args(args).current_dir(folder);
        command.env("XDG_CACHE_HOME", folder.join("cache")).env("TMPDIR", folder.join("tmp"));
        let output = command.output().expect("strace runs");
        if !log.exists() || fs::metadata(&log).is_ok_and(|log| log.len() == 0) {
            eprintln!("SKIPPED: nothing may be traced here: {output:?}");
            return;
        }
        assert_eq!(output.status.code(), Some(0), "{args:?}: {output:?}");
        let (paths, sockets) = touched(&fs::read_to_string(&log).expect("a log"), folder);
        assert!(sockets.is_empty(), "{args:?}: {sockets:?}");
        let is_allowed = |path: &PathBuf| {
            path.starts_with("/dev") || outputs.iter().any(|output| path.starts_with(folder.join(output)))
                // The file of a single output is written beside it and renamed.
                || path.parent() == Some(folder) && path.extension().is_some_and(|end| end == "tmp")
        };
        let foreign: Vec<_> = paths.iter().filter(|path| !is_allowed(path)).collect();
        assert!(foreign.is_empty(), "{args:?} touched {foreign:?}");
        assert_eq!(temporary_files(folder), Vec::<String>::new(), "{args:?} leaves temporary files");
    }
}

#[test]
fn a_default_library_lies_in_the_cache_folder_and_a_default_plan_here() {
    let place = Small::new();
    let args = ["solve", "rooms.yaml", "--start", "2,3,0", "--goal", "10,3.5", "--regions", "geometric"];
    assert_eq!(place.sharp(&args).status.code(), Some(0));
    let mut names: Vec<_> = fs::read_dir(place.path())
        .expect("a folder")
        .map(|entry| entry.expect("an entry").file_name().to_string_lossy().into_owned())
        .collect();
    names.sort();
    assert_eq!(names, ["cache", "places.ron", "rooms.pgm", "rooms.yaml", "sharp-plans"]);
}
