//! What the program does, frozen: rows of the smoke suite, plans with their weights, abstractions, priors, and what
//! each stage leaves on the way from a map to a drive, the same for one thread and two.
//!
//! A change that is meant to change nothing leaves `golden.txt` alone. A part of it is checked with every test
//! run; `SHARP_GOLDEN=all` checks all of it, which takes four minutes of one core. After a wanted change
//! `UPDATE_GOLDEN=1 cargo test --release -p sharp-cli --test golden` writes it anew; commit it alone, with
//! the list of what moved and why.
//!
//! Matrix products and logarithms round differently on different processors, and a policy that turns by one
//! more bit drives another way. The first line names the arithmetic that the file was made with. With another
//! one, hashes are not compared, and numbers of successes may differ by what chance allows.

#![allow(clippy::disallowed_methods, reason = "whether to rewrite the file is told by the environment")]

use std::collections::BTreeMap;
use std::fmt::Write as _;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};

use rand::RngExt;
use rand_distr::StandardNormal;
use serde_json::Value;
use sharp_drive::Prior;
use sharp_rl::ActorScratch;
use sharp_sim::RobotModel;
use sharp_space::Seed;

const GOLDEN: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/golden.txt");
const ROBOTS: [&str; 2] = ["husky", "limo"];
const KINDS: [&str; 2] = ["centroid", "interface"];

/// FNV-1a, 64 bits: any change of a byte shows.
fn hash(bytes: &[u8]) -> String {
    let step = |hash: u64, &byte: &u8| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
    format!("{:016x}", bytes.iter().fold(0xcbf2_9ce4_8422_2325, step))
}

/// Runs the command in `folder`; it must end well.
fn sharp(folder: &Path, args: &[&str]) -> String {
    let output = Command::new(env!("CARGO_BIN_EXE_sharp"))
        .args(args)
        .current_dir(folder)
        .env("XDG_CACHE_HOME", folder.join("cache"))
        .stderr(Stdio::inherit())
        .output()
        .expect("the binary runs");
    assert!(output.status.success(), "sharp {} ended with {}", args.join(" "), output.status);
    String::from_utf8(output.stdout).expect("text")
}

/// How this processor rounds: network outputs and normal draws.
fn arithmetic() -> String {
    let mut bytes = Vec::new();
    let mut rng = Seed(1).stream("arithmetic", 0);
    for robot in [RobotModel::husky(), RobotModel::limo()] {
        let actor = Prior::shipped(&robot).actor();
        let (mut scratch, mut action) = (ActorScratch::default(), [0.0; 2]);
        for _ in 0..500 {
            let length = actor.spec().observation_len;
            let seen: Vec<f32> = (0..length).map(|_| rng.sample(StandardNormal)).collect();
            actor.act_mean(&seen, &mut scratch, &mut action);
            bytes.extend(action.iter().flat_map(|entry| entry.to_le_bytes()));
        }
    }
    for _ in 0..20_000 {
        let draw: f64 = rng.sample(StandardNormal);
        bytes.extend(draw.to_le_bytes());
    }
    hash(&bytes)
}

/// The hash of all weights in `folder`, in order of their names.
fn weights(folder: &Path) -> String {
    let entries = fs::read_dir(folder).expect("a folder");
    let mut paths: Vec<_> = entries.map(|entry| entry.expect("an entry").path()).collect();
    paths.retain(|path| path.extension().is_some_and(|ending| ending == "safetensors"));
    paths.sort();
    hash(&paths.iter().flat_map(|path| fs::read(path).expect("weights")).collect::<Vec<u8>>())
}

/// Which part is checked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Part {
    /// One robot and kind for each problem, no suite.
    Quick,
    All,
}

/// Both robots with both kinds of option.
fn cases() -> impl Iterator<Item = (&'static str, &'static str)> {
    ROBOTS.into_iter().flat_map(|robot| KINDS.map(|kind| (robot, kind)))
}

fn priors(golden: &mut BTreeMap<String, String>) {
    for robot in [RobotModel::husky(), RobotModel::limo()] {
        golden.insert(format!("prior {}", robot.name), hash(&Prior::shipped(&robot).to_bytes()));
    }
}

fn abstractions(folder: &Path, part: Part, golden: &mut BTreeMap<String, String>) {
    let maps: &[&str] = if part == Part::All { &["a", "e"] } else { &["a"] };
    for (map, (robot, kind)) in maps.iter().flat_map(|map| cases().map(move |case| (*map, case))) {
        let out = format!("abstraction-{map}-{robot}-{kind}");
        let told =
            sharp(folder, &["abstract", map, "--robot", robot, "--options", kind, "--out", &out, "--json"]);
        let told: Value = serde_json::from_str(&told).expect("JSON");
        let file = fs::read(folder.join(&out).join("abstraction.ron")).expect("an abstraction");
        let value = format!(
            "states {} options {} {} {}",
            told["states"],
            told["options_centroid"],
            told["options_interface"],
            hash(&file)
        );
        golden.insert(format!("abstraction {map} {robot} {kind}"), value);
    }
}

/// Problems 1 to 5 of `a`, each from nothing.
fn plans(folder: &Path, part: Part, golden: &mut BTreeMap<String, String>) {
    let all = (1..=5).flat_map(|problem| cases().enumerate().map(move |case| (problem, case)));
    for (problem, (index, (robot, kind))) in all {
        if part == Part::Quick && index != problem % 4 {
            continue;
        }
        let (out, number) = (format!("plan-{problem}-{robot}-{kind}"), problem.to_string());
        let args = ["solve", "a", "--robot", robot, "--options", kind, "--problem", &number];
        let told = sharp(folder, &[&args[..], &["--library", "none", "--out", &out, "--json"]].concat());
        let told: Value = serde_json::from_str(&told).expect("JSON");
        let legs = told["plan"].as_array().expect("a plan");
        let names: Vec<&str> = legs.iter().filter_map(|leg| leg["option"].as_str()).collect();
        let plan = fs::read(folder.join(&out).join("plan.ron")).expect("a plan");
        let value = format!(
            "success {} {} plan {} weights {}",
            told["predicted"]["success"],
            names.join(" "),
            hash(&plan),
            weights(&folder.join(&out))
        );
        golden.insert(format!("plan a {problem} {robot} {kind}"), value);
    }
}

/// The hash of what each stage leaves, on the way from a map to a drive, with `threads` threads.
fn stages(folder: &Path, threads: &str) -> BTreeMap<String, String> {
    let place = folder.join(format!("stages-{threads}"));
    fs::create_dir(&place).expect("a folder");
    for command in [
        "map save a --out map.yaml",
        "regions predict a --robot limo --out regions",
        "abstract a --robot limo --out abstract",
        "solve a --problem 5 --robot limo --library library --out plan",
        "run plan --episodes 10",
    ] {
        let args: Vec<&str> = command.split(' ').chain(["--threads", threads]).collect();
        sharp(&place, &args);
    }
    let library = fs::read_dir(place.join("library")).expect("a library").next();
    let library = library.expect("one world").expect("an entry").path();
    let mut options: Vec<_> =
        fs::read_dir(library).expect("options").map(|entry| entry.expect("an entry").path()).collect();
    // Pictures lie beside them.
    options.retain(|path| path.extension().is_none_or(|extension| extension != "svg" && extension != "png"));
    options.sort();
    let options: Vec<u8> = options.iter().flat_map(|path| fs::read(path).expect("an option")).collect();
    let mut drive: Value =
        serde_json::from_slice(&fs::read(place.join("plan/run.json")).expect("a report")).expect("JSON");
    drive.as_object_mut().expect("an object").remove("decision_us").expect("decisions are timed");
    let read = |name: &str| hash(&fs::read(place.join(name)).expect(name));
    [
        ("1 map", read("map.pgm")),
        ("2 regions", read("regions/regions.json")),
        ("3 abstraction", read("abstract/abstraction.ron")),
        ("4 guides", read("abstract/route.geojson")),
        ("5 library", hash(&options)),
        ("6 plan", read("plan/plan.ron")),
        ("7 drive", hash(drive.to_string().as_bytes())),
        ("8 picture", read("plan/run.svg")),
    ]
    .map(|(stage, hash)| (format!("stage {stage}"), hash))
    .into()
}

/// The rows of `sharp eval smoke`, without what depends on time, machine or build.
fn suite(folder: &Path, golden: &mut BTreeMap<String, String>) {
    sharp(folder, &["eval", "smoke", "--out", "eval"]);
    let text = fs::read_to_string(folder.join("eval/results.jsonl")).expect("results");
    for line in text.lines() {
        let mut row: Value = serde_json::from_str(line).expect("JSON");
        let entries = row.as_object_mut().expect("an object");
        for key in ["time_s", "decision_us", "machine", "version", "job"] {
            entries.remove(key).unwrap_or_else(|| panic!("results name {key}"));
        }
        let word = |key: &str| row[key].to_string().replace('"', "");
        let name = ["method", "env", "robot", "options", "problem"].map(word).join(" ");
        golden.insert(format!("row {name}"), row.to_string());
    }
}

/// The number behind `word` in `text`.
fn number_after(text: &str, word: &str) -> Option<f64> {
    let rest = &text[text.find(word)? + word.len()..];
    let end = rest.find([' ', ',', '}']).unwrap_or(rest.len());
    rest[..end].parse().ok()
}

/// Returns true if `found` is `expected` up to the luck of other rounding.
fn is_alike(found: &str, expected: &str) -> bool {
    let near = |word: &str, by: f64| match (number_after(found, word), number_after(expected, word)) {
        (Some(found), Some(expected)) => (found - expected).abs() <= by,
        (found, expected) => found.is_some() == expected.is_some(),
    };
    near("success ", 0.03) && near("\"successes\":", 2.0) && near("\"predicted_success\":", 0.03)
}

#[test]
fn the_program_does_what_it_did() {
    let folder = tempfile::tempdir().expect("a folder");
    let is_update = std::env::var_os("UPDATE_GOLDEN").is_some();
    let wants_all = is_update || std::env::var_os("SHARP_GOLDEN").is_some_and(|part| part == "all");
    let part = if wants_all { Part::All } else { Part::Quick };
    let mut golden = BTreeMap::from([("arithmetic".to_owned(), arithmetic())]);
    priors(&mut golden);
    abstractions(folder.path(), part, &mut golden);
    plans(folder.path(), part, &mut golden);
    let [one, two] = ["1", "2"].map(|threads| stages(folder.path(), threads));
    assert_eq!(one, two, "one thread and two leave the same at every stage");
    golden.extend(one);
    if part == Part::All {
        suite(folder.path(), &mut golden);
    }
    if is_update {
        let text = golden.iter().fold(String::new(), |mut text, (key, value)| {
            _ = writeln!(text, "{key}: {value}");
            text
        });
        fs::write(GOLDEN, text).expect("the file can be written");
        return;
    }
    let text = fs::read_to_string(GOLDEN).expect("the golden file");
    let expected: BTreeMap<&str, &str> =
        text.lines().map(|line| line.split_once(": ").expect("a key and a value")).collect();
    let is_same_arithmetic = expected["arithmetic"] == golden["arithmetic"];
    if !is_same_arithmetic {
        eprintln!("golden.txt was made with other arithmetic: hashes are not compared");
    }
    let missing = expected.keys().copied().filter(|&key| part == Part::All && !golden.contains_key(key));
    let mut moved = Vec::new();
    for key in golden.keys().map(String::as_str).chain(missing) {
        let (found, wanted) = (golden.get(key).map(String::as_str), expected.get(key).copied());
        let holds = match (found, wanted) {
            (Some(found), Some(wanted)) => {
                found == wanted || (!is_same_arithmetic && is_alike(found, wanted))
            }
            _ => false,
        };
        if !holds {
            moved.push(format!("{key}:\n  found    {found:?}\n  expected {wanted:?}"));
        }
    }
    assert!(moved.is_empty(), "{} entries moved\n{}", moved.len(), moved.join("\n"));
}
