//! Turning what was typed into maps, poses and folders, or into one clear message.

use std::path::{Path, PathBuf};

use sharp_bench::SpeedRule;
use sharp_drive::SpeedLimits;
use sharp_maps::{LoadOptions, MapFile, load, load_scenario, load_values};
use sharp_plan::{Method, Query};
use sharp_sim::{SimulatorKind, UnknownSimulator};
use sharp_space::{Occupancy, Point, Pose, trig};

use crate::args::{MapArgs, ProblemArgs, ReadingArgs, SpeedArgs, Unknown};
use crate::outcome::Failure;

/// Maps of more cells are warned about: 4000 x 4000.
const LARGE_CELLS: usize = 16_000_000;

/// Reads the map that `args` name, as they want it.
pub(crate) fn map(MapArgs { map, reading }: &MapArgs) -> Result<MapFile, Failure> {
    map_called(map, reading)
}

/// Reads the map called `name` as `args` want it.
pub(crate) fn map_called(name: &str, args: &ReadingArgs) -> Result<MapFile, Failure> {
    if let Some(resolution_m) = args.resolution.filter(|side_m| !(1e-6..=1000.0).contains(side_m)) {
        let message = format!("--resolution is {resolution_m:?}, expected metres a cell, from 1e-6 to 1000");
        return Err(Failure::new("USAGE", message));
    }
    let options = LoadOptions {
        resolution_m: args.resolution,
        unknown_free: args.unknown == Unknown::Free,
        allow_outside: args.allow_outside,
    };
    let mut map = load(name, &options)?;
    for mask in &args.keepout {
        // Unknown cells of a mask mean nothing, whatever they mean in the map.
        let keepout = load(mask, &LoadOptions { unknown_free: false, ..options })?;
        map.warnings.extend(keepout.warnings.iter().map(|warning| format!("--keepout {mask}: {warning}")));
        if map.keep_out(&keepout.grid)? == 0 {
            map.warnings.push(format!("--keepout {mask}: covers no free cell of the map"));
        }
    }
    if args.downsample > 1 {
        map.downsample(args.downsample as usize)?;
        let frame = map.grid.frame();
        map.warnings.push(format!(
            "cells are {} x {} of the map's now, {:.3} m: passages of less than two cells may be gone",
            args.downsample, args.downsample, frame.resolution_m
        ));
    }
    let frame = map.grid.frame();
    if frame.len() > LARGE_CELLS {
        map.warnings.push(format!(
            "the map has {} x {} cells, which takes much memory and time; --downsample 2 makes it a quarter",
            frame.width, frame.height
        ));
    }
    for warning in &map.warnings {
        eprintln!("warning: {warning}");
    }
    Ok(map)
}

/// The speed limits in `map` that `args` ask for, for a robot with a top speed of `max_speed_mps`.
pub(crate) fn speed_limits(
    args: &SpeedArgs,
    reading: &ReadingArgs,
    map: &MapFile,
    max_speed_mps: f64,
) -> Result<Option<SpeedLimits>, Failure> {
    let Some(path) = &args.speed_mask else { return Ok(None) };
    let options = LoadOptions { allow_outside: reading.allow_outside, ..LoadOptions::default() };
    let mask = load_values(path, &options)?;
    for warning in &mask.warnings {
        eprintln!("warning: {warning}");
    }
    let (base, multiplier) = (args.speed_base, args.speed_multiplier);
    let rule = SpeedRule { base, multiplier, is_absolute: args.speed_absolute };
    let refused = |error| Failure::new("MAP_FIELD", format!("--speed-mask {}: {error}", path.display()));
    let limits = sharp_bench::speed_limits(&mask, rule, max_speed_mps).map_err(refused)?;
    let (frame, cells) = (map.grid.frame(), map.grid.cells().iter().enumerate());
    let mut free = cells.filter(|(_, cell)| **cell == Occupancy::Free).map(|(index, _)| frame.cell(index));
    if !free.any(|cell| limits.at(frame.center(cell)).is_finite()) {
        eprintln!("warning: --speed-mask {}: limits no free cell of the map", path.display());
    }
    Ok(Some(limits))
}

/// The simulator called `name`.
pub(crate) fn simulator(name: &str) -> Result<SimulatorKind, Failure> {
    name.parse().map_err(|error: UnknownSimulator| Failure::new("USAGE", format!("--simulator: {error}")))
}

/// The simulator called `name`; without a name the one of `method`.
pub(crate) fn training_simulator(name: Option<&str>, method: &Method) -> Result<SimulatorKind, Failure> {
    name.map_or(Ok(method.simulator), simulator)
}

/// Whether a pose needs a heading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum HeadingRule {
    /// It does.
    Needed,
    /// Any will do: without one it is 0.
    Free,
}

/// A pose typed as `X,Y,YAW` or `X Y YAW`; the yaw may be left out where it is free, and is in degrees with `deg` behind it.
pub(crate) fn pose(flag: &str, text: &str, heading: HeadingRule) -> Result<Pose, Failure> {
    let expected = match heading {
        HeadingRule::Needed => "three finite numbers X,Y,YAW",
        HeadingRule::Free => "finite numbers X,Y or X,Y,YAW",
    };
    let broken = || Failure::new("POSE_INVALID", format!("{flag} is {text:?}, expected {expected}"));
    let number = |text: &str| text.parse::<f64>().map_err(|_| broken());
    let angle = |text: &str| match text.strip_suffix("deg") {
        Some(degrees) => number(degrees.trim()).map(f64::to_radians),
        None => number(text),
    };
    let (x, y, yaw) = match (&parts(text)[..], heading) {
        (&[x, y, yaw], _) => (number(x)?, number(y)?, angle(yaw)?),
        (&[x, y], HeadingRule::Free) => (number(x)?, number(y)?, 0.0),
        _ => return Err(broken()),
    };
    let is_sane = |value: f64, limit: f64| value.is_finite() && value.abs() <= limit;
    let too_large = |what: &str, limit: &str| {
        let message = format!("{flag} is {text:?}: {what} is beyond {limit}");
        Err(Failure::new("POSE_INVALID", message))
    };
    if ![x, y, yaw].into_iter().all(f64::is_finite) {
        return Err(broken());
    }
    if !(is_sane(x, 1e9) && is_sane(y, 1e9)) {
        return too_large("a coordinate", "1e9 m");
    }
    // Beyond 1000 rad an angle is a mistake in its unit, and its wrapped value has lost digits.
    if !is_sane(yaw, 1000.0) {
        return too_large("the yaw", "1000 rad");
    }
    if yaw.abs() > std::f64::consts::TAU + 1e-6 {
        eprintln!(
            "warning: {flag} has a yaw of {yaw}, more than a full turn: angles are radians, or degrees as in 90deg"
        );
    }
    Ok(Pose::new(x, y, yaw))
}

/// The folder of the library for `choice`: a folder, `none` for no library, by default a cache folder.
pub(crate) fn library(choice: Option<&str>) -> Option<PathBuf> {
    match choice {
        Some("none") => None,
        Some(folder) => Some(folder.into()),
        None => Some(cache_folder()),
    }
}

fn cache_folder() -> PathBuf {
    let set = |name| std::env::var_os(name).filter(|value| !value.is_empty()).map(PathBuf::from);
    set("XDG_CACHE_HOME")
        .or_else(|| set("HOME").map(|home| home.join(".cache")))
        .unwrap_or_else(std::env::temp_dir)
        .join("sharp")
}

/// Refuses a `folder` of `flag` that could not be made or written, before the work for it is done; leaves nothing behind.
pub(crate) fn check_out(flag: &str, folder: &Path) -> Result<(), Failure> {
    check_parent(flag, folder, folder)
}

/// The same for a `file`; what is there already and no plain file, as a pipe, is written into.
pub(crate) fn check_out_file(flag: &str, file: &Path) -> Result<(), Failure> {
    let real = std::fs::canonicalize(file).unwrap_or_else(|_| file.to_owned());
    if real.is_dir() {
        let message = format!("{flag} is {}, which is a folder, expected a file", file.display());
        return Err(Failure::new("FILE_INVALID", message));
    }
    if real.exists() && !real.is_file() {
        return Ok(());
    }
    check_parent(flag, file, real.parent().unwrap_or(Path::new("")))
}

/// Refuses `out` of `flag` if in `folder`, or where it would be made, no file can be made.
fn check_parent(flag: &str, out: &Path, folder: &Path) -> Result<(), Failure> {
    let mut there = folder;
    while !there.exists() {
        match there.parent().filter(|parent| !parent.as_os_str().is_empty()) {
            Some(parent) => there = parent,
            None => there = Path::new("."),
        }
    }
    tempfile::tempfile_in(there).map(drop).map_err(|error| {
        let message =
            format!("{flag} is {}, but in {} no file can be made: {error}", out.display(), there.display());
        Failure::new("FILE_INVALID", message)
    })
}

/// Refuses an `out` of `--out` that is one of `inputs`: what the user gave would be lost.
pub(crate) fn check_not_input<'a>(
    out: &Path,
    inputs: impl IntoIterator<Item = &'a Path>,
) -> Result<(), Failure> {
    let Ok(real) = std::fs::canonicalize(out) else { return Ok(()) };
    let is_out = |input: &&Path| std::fs::canonicalize(input).is_ok_and(|input| input == real);
    match inputs.into_iter().find(is_out) {
        Some(input) => {
            let message =
                format!("--out would overwrite {}, which is read: choose another name", input.display());
            Err(Failure::new("USAGE", message))
        }
        None => Ok(()),
    }
}

/// The query that the flags ask for.
pub(crate) fn query(map: &MapFile, args: &ProblemArgs) -> Result<Query, Failure> {
    if let Some(number) = args.problem {
        return match &args.scen {
            Some(file) => scenario(map, file, number),
            None => own_problem(map, number),
        };
    }
    let goal = match (&args.goal, &args.goal_pixel) {
        (Some(goal), _) => Some(pose("--goal", goal, HeadingRule::Free)?),
        (None, Some(pixel)) => Some(at_pixel(map, "--goal-pixel", pixel)?.0),
        (None, None) => None,
    };
    let start = match (&args.start, &args.start_pixel) {
        (Some(start), _) => Some((pose("--start", start, HeadingRule::Needed)?, true)),
        (None, Some(pixel)) => Some(at_pixel(map, "--start-pixel", pixel)?),
        (None, None) => None,
    };
    match (start, goal) {
        (Some((start, true)), Some(goal)) => Ok(Query { start, goal }),
        (Some((start, false)), Some(goal)) => Ok(towards(start.position, goal.position)),
        _ => {
            let bounds = map.grid.frame().bounds();
            let [low, high] = [bounds.min, bounds.max].map(|at| format!("({:.1}, {:.1})", at.x, at.y));
            let message = format!(
                "either --start X,Y,YAW and --goal X,Y or --problem is needed; the map reaches from {low} to {high}"
            );
            Err(Failure::new("USAGE", message))
        }
    }
}

/// Returns true if the goal that `args` ask for comes with a heading of its own.
pub(crate) fn goal_has_heading(args: &ProblemArgs) -> bool {
    match &args.goal {
        Some(goal) => parts(goal).len() == 3,
        None => args.problem.is_some() && args.scen.is_none(),
    }
}

/// The numbers of a pose, still as text.
fn parts(text: &str) -> Vec<&str> {
    let parts: Vec<&str> =
        if text.contains(',') { text.split(',').collect() } else { text.split_whitespace().collect() };
    parts.into_iter().map(str::trim).collect()
}

/// A query that begins with the heading towards its goal.
fn towards(start: Point, goal: Point) -> Query {
    let way = goal - start;
    let heading = trig::atan2(way.y, way.x);
    Query { start: Pose::new(start.x, start.y, heading), goal: Pose::new(goal.x, goal.y, heading) }
}

/// The middle of a pixel typed as `C,R` or `C,R,YAW`, and whether there was a yaw.
fn at_pixel(map: &MapFile, flag: &str, text: &str) -> Result<(Pose, bool), Failure> {
    let (width, height) = (map.picture.width, map.picture.height);
    let broken = || {
        let expected =
            format!("a column below {width} and a row below {height}, counted from the upper left: C,R");
        Failure::new("POSE_INVALID", format!("{flag} is {text:?}, expected {expected}"))
    };
    let parts: Vec<&str> = text.split(',').map(str::trim).collect();
    let (col, row, yaw) = match parts[..] {
        [col, row] => (col, row, None),
        [col, row, yaw] if flag == "--start-pixel" => (col, row, Some(yaw)),
        _ => return Err(broken()),
    };
    let (Ok(col), Ok(row)) = (col.parse(), row.parse()) else { return Err(broken()) };
    let point = map.pixel(col, row).ok_or_else(broken)?;
    let typed = format!("{},{},{}", point.x, point.y, yaw.unwrap_or("0"));
    let pose = pose(flag, &typed, HeadingRule::Needed).map_err(|_| {
        let expected = "a column, a row and a heading: C,R,YAW";
        Failure::new("POSE_INVALID", format!("{flag} is {text:?}, expected {expected}"))
    })?;
    Ok((pose, yaw.is_some()))
}

/// Problem `number` of the scenarios in `file`.
fn scenario(map: &MapFile, file: &Path, number: usize) -> Result<Query, Failure> {
    let scenario = load_scenario(file, number)?;
    let named = Path::new(&scenario.map).file_stem().map(|stem| stem.to_string_lossy().into_owned());
    if named.as_ref() != Some(&map.name) {
        eprintln!("warning: {} has problems of {:?}, the map is {}", file.display(), scenario.map, map.name);
    }
    let [start, goal] = scenario.places(&map.picture);
    let outside = |point: &Point| map.picture.cell_at(*point).is_none();
    if outside(&start) || outside(&goal) {
        let message = format!("problem {number} of {} lies outside the map", file.display());
        return Err(Failure::new("PROBLEM_UNKNOWN", message));
    }
    Ok(towards(start, goal))
}

/// Problem `number` of a named map.
fn own_problem(map: &MapFile, number: usize) -> Result<Query, Failure> {
    let count = map.problems.len();
    let problem = number.checked_sub(1).and_then(|index| map.problems.get(index)).ok_or_else(|| {
        let expected = if count == 0 {
            "this map has no problems of its own; --scen FILE names some".to_owned()
        } else {
            format!("expected 1..{count}")
        };
        Failure::new("PROBLEM_UNKNOWN", format!("--problem is {number}, {expected}"))
    })?;
    Ok(Query { start: problem.start, goal: problem.goal })
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn broken_poses_name_flag_and_value() {
        for text in ["", "1,2", "1,2,3,4", "1,NaN,0", "inf,0,0", "1,2,x", "0,0,1e9"] {
            let message = pose("--start", text, HeadingRule::Needed).unwrap_err().to_string();
            assert!(message.contains("--start") && message.contains(&format!("{text:?}")), "{message}");
        }
        for text in ["-1.5, 2,3", "-1.5 2 3", " -1.5  2 3 "] {
            assert_eq!(
                pose("--start", text, HeadingRule::Needed).unwrap(),
                Pose::new(-1.5, 2.0, 3.0),
                "{text:?}"
            );
        }
        assert_eq!(pose("--goal", "1,2", HeadingRule::Free).unwrap(), Pose::new(1.0, 2.0, 0.0));
        let degrees = pose("--goal", "1, 2, 90deg", HeadingRule::Free).unwrap();
        assert!((degrees.heading.radians() - std::f64::consts::FRAC_PI_2).abs() < 1e-12, "{degrees:?}");
    }

    #[test]
    fn a_folder_that_cannot_be_made_is_refused_at_once_and_others_are_not_made() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("file");
        fs::write(&file, "").expect("a file");
        let message = check_out("--out", &file.join("plan")).unwrap_err().to_string();
        assert!(message.contains("--out") && message.contains("file/plan"), "{message}");
        let message = check_out_file("--record", &file.join("a.mcap")).unwrap_err().to_string();
        assert!(message.contains("--record") && message.contains("file/a.mcap"), "{message}");
        assert!(check_out_file("--record", folder.path()).is_err(), "a folder is no file");
        let new = folder.path().join("some/where");
        check_out("--out", &new).expect("can be made");
        check_out_file("--record", &new.join("a.mcap")).expect("can be made");
        check_out_file("--record", &file).expect("can be replaced");
        assert!(!folder.path().join("some").exists(), "asking makes nothing");
    }

    #[test]
    fn an_input_is_no_output_however_it_is_written() {
        let folder = tempfile::tempdir().expect("a folder");
        let [input, other] = ["input", "other"].map(|name| folder.path().join(name));
        fs::write(&input, "").expect("a file");
        let same = folder.path().join("./input");
        let message = check_not_input(&same, [&*other, &*input]).unwrap_err().to_string();
        assert!(message.contains("--out would overwrite") && message.contains("input"), "{message}");
        check_not_input(&other, [&*other, &*input]).expect("there is no such file yet");
    }
}
