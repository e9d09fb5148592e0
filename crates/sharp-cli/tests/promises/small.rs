//! A small building in a folder of its own, and the command in it.

use std::collections::BTreeMap;
use std::fs;
use std::io::Write;
use std::path::Path;
use std::process::{Command, Output, Stdio};
use std::time::Instant;

/// A folder with a map of two rooms.
pub(crate) struct Small(tempfile::TempDir);

impl Small {
    /// A solve that keeps what it learns.
    pub(crate) const SOLVE: [&str; 12] = [
        "solve",
        "rooms.yaml",
        "--start",
        "2,3,0",
        "--goal",
        "10,3.5",
        "--regions",
        "geometric",
        "--library",
        "lib",
        "--out",
        "plan",
    ];
    /// All options of the building, and their hand-overs.
    pub(crate) const LEARN: [&str; 8] =
        ["learn", "rooms.yaml", "--options", "centroid", "--regions", "places.ron", "--library", "lib"];

    /// Two rooms of 6 x 6 m and a door of 1.4 m between them, cells of 0.1 m.
    pub(crate) fn new() -> Self {
        let folder = tempfile::tempdir().expect("a folder");
        let (width, height) = (122, 62);
        let mut pixels = format!("P5\n{width} {height}\n255\n").into_bytes();
        for row in 0..height {
            for col in 0..width {
                let is_border = row == 0 || col == 0 || row == height - 1 || col == width - 1;
                let is_wall = (60..62).contains(&col) && !(24..38).contains(&row);
                pixels.push(if is_border || is_wall { 0 } else { 254 });
            }
        }
        let place = Self(folder);
        place.write("rooms.pgm", &pixels);
        place.write("rooms.yaml", b"image: rooms.pgm\nresolution: 0.1\norigin: [0.0, 0.0, 0.0]\nnegate: 0\noccupied_thresh: 0.65\nfree_thresh: 0.196\n");
        place.write("places.ron", b"[(2.0, 3.0), (6.1, 3.1), (10.0, 3.0)]");
        place
    }

    /// The same with a plan and a library.
    pub(crate) fn solved() -> Self {
        let place = Self::new();
        let output = place.sharp(&Self::SOLVE);
        assert_eq!(output.status.code(), Some(0), "{output:?}");
        place
    }

    pub(crate) fn path(&self) -> &Path {
        self.0.path()
    }

    pub(crate) fn write(&self, name: &str, bytes: &[u8]) {
        fs::write(self.path().join(name), bytes).expect("a file");
    }

    /// The command, about to be run here.
    pub(crate) fn command(&self, args: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_sharp"));
        command.args(args).current_dir(self.path()).env("XDG_CACHE_HOME", self.path().join("cache"));
        command
    }

    pub(crate) fn sharp(&self, args: &[&str]) -> Output {
        self.command(args).output().expect("the binary runs")
    }

    /// What the service answers to `lines`.
    pub(crate) fn serve(&self, lines: &str) -> String {
        let mut child = self
            .command(&["serve", "plan"])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .expect("the binary runs");
        child.stdin.take().expect("piped").write_all(lines.as_bytes()).expect("it listens");
        let output = child.wait_with_output().expect("a child");
        String::from_utf8(output.stdout).expect("text")
    }
}

/// How many cases to try: `few`, or the share of `many` that the variable `SHARP_SOAK` says, as in 1 or 0.1.
pub(crate) fn cases(few: u64, many: u64) -> u64 {
    let share = std::env::var("SHARP_SOAK").ok().and_then(|share| share.parse::<f64>().ok());
    share.map_or(few, |share| few.max((many as f64 * share) as u64))
}

/// Says what a promise was held against; `cargo xtask soak` shows it.
pub(crate) fn say(promise: &str, count: u64, found: &str, since: Instant) {
    println!("soak: {promise}: {count} cases, {found}, {:.0} s", since.elapsed().as_secs_f64());
}

/// Numbers in 0..1 that look like chance and are the same every time.
pub(crate) fn moments() -> impl Iterator<Item = f64> {
    (1_u32..).map(|number| (f64::from(number) * 0.618_034).fract())
}

/// All files below `folder` by their path in it, but for reports with wall times, caches and learning curves.
pub(crate) fn files_below(folder: &Path) -> BTreeMap<String, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut open = vec![folder.to_owned()];
    while let Some(next) = open.pop() {
        for entry in fs::read_dir(&next).into_iter().flatten() {
            let path = entry.expect("an entry").path();
            let name = path.strip_prefix(folder).expect("below").to_string_lossy().into_owned();
            if path.is_dir() && name != "cache" {
                open.push(path);
            } else if path.is_file() && !path.ends_with("solve.json") {
                found.insert(name, fs::read(&path).expect("readable"));
            }
        }
    }
    found
}

/// The names of what an interrupted write would leave below `folder`.
pub(crate) fn temporary_files(folder: &Path) -> Vec<String> {
    files_below(folder).into_keys().filter(|name| name.ends_with(".tmp")).collect()
}

/// Returns true if the command ended with a panic.
pub(crate) fn panicked(output: &Output) -> bool {
    String::from_utf8_lossy(&output.stderr).contains("panicked")
}
