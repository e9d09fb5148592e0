//! Turning what was typed into maps, poses and folders, or into one clear message.

use std::path::{Path, PathBuf};

use sharp_maps::{LoadOptions, MapFile, load};
use sharp_plan::Query;
use sharp_sim::{SimulatorKind, UnknownSimulator};
use sharp_space::Pose;

use crate::args::{MapArgs, Unknown};
use crate::outcome::Failure;

/// Reads the map that `args` name.
pub(crate) fn map(args: &MapArgs) -> Result<MapFile, Failure> {
    let options = LoadOptions {
        resolution_m: args.resolution,
        unknown_free: args.unknown == Unknown::Free,
        allow_outside: args.allow_outside,
    };
    let map = load(&args.map, &options)?;
    for warning in &map.warnings {
        eprintln!("warning: {warning}");
    }
    Ok(map)
}

/// The simulator called `name`.
pub(crate) fn simulator(name: &str) -> Result<SimulatorKind, Failure> {
    name.parse().map_err(|error: UnknownSimulator| Failure::new("USAGE", format!("--simulator: {error}")))
}

/// Whether a pose needs a heading.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum HeadingRule {
    /// It does.
    Needed,
    /// Any will do: without one it is 0.
    Free,
}

/// A pose typed as `X,Y,YAW` or `X Y YAW`; the yaw may be left out where it is free.
pub(crate) fn pose(flag: &str, text: &str, heading: HeadingRule) -> Result<Pose, Failure> {
    let expected = match heading {
        HeadingRule::Needed => "three finite numbers X,Y,YAW",
        HeadingRule::Free => "finite numbers X,Y or X,Y,YAW",
    };
    let broken = || Failure::new("POSE_INVALID", format!("{flag} is {text:?}, expected {expected}"));
    let parts: Vec<&str> =
        if text.contains(',') { text.split(',').collect() } else { text.split_whitespace().collect() };
    let numbers: Vec<f64> =
        parts.iter().map(|part| part.trim().parse()).collect::<Result<_, _>>().map_err(|_| broken())?;
    let (x, y, yaw) = match (&numbers[..], heading) {
        (&[x, y, yaw], _) => (x, y, yaw),
        (&[x, y], HeadingRule::Free) => (x, y, 0.0),
        _ => return Err(broken()),
    };
    let is_sane = |value: f64, limit: f64| value.is_finite() && value.abs() <= limit;
    // Beyond 1000 rad an angle is a mistake in its unit, and its wrapped value has lost digits.
    if !(is_sane(x, 1e9) && is_sane(y, 1e9) && is_sane(yaw, 1000.0)) {
        return Err(broken());
    }
    if yaw.abs() > std::f64::consts::TAU + 1e-6 {
        eprintln!("warning: {flag} has a yaw of {yaw}, more than a full turn: angles are radians");
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

/// Refuses a `folder` that could not be made or written, before the work for it is done; leaves nothing behind.
pub(crate) fn check_out(folder: &Path) -> Result<(), Failure> {
    let mut there = folder;
    while !there.exists() {
        match there.parent().filter(|parent| !parent.as_os_str().is_empty()) {
            Some(parent) => there = parent,
            None => there = Path::new("."),
        }
    }
    tempfile::tempfile_in(there).map(drop).map_err(|error| {
        let message =
            format!("--out is {}, but in {} no file can be made: {error}", folder.display(), there.display());
        Failure::new("FILE_INVALID", message)
    })
}

/// The query that the flags of `solve` ask for.
pub(crate) fn query(
    map: &MapFile,
    start: Option<&str>,
    goal: Option<&str>,
    problem: Option<usize>,
) -> Result<Query, Failure> {
    if let (Some(start), Some(goal)) = (start, goal) {
        return Ok(Query {
            start: pose("--start", start, HeadingRule::Needed)?,
            goal: pose("--goal", goal, HeadingRule::Free)?,
        });
    }
    let Some(number) = problem else {
        return Err(Failure::new("USAGE", "either --start and --goal or --problem is needed"));
    };
    let count = map.problems.len();
    let problem = number.checked_sub(1).and_then(|index| map.problems.get(index)).ok_or_else(|| {
        let expected = if count == 0 {
            "this map has no problems of its own".to_owned()
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
    }

    #[test]
    fn a_folder_that_cannot_be_made_is_refused_at_once_and_others_are_not_made() {
        let folder = tempfile::tempdir().expect("a folder");
        let file = folder.path().join("file");
        fs::write(&file, "").expect("a file");
        let message = check_out(&file.join("plan")).unwrap_err().to_string();
        assert!(message.contains("--out") && message.contains("file/plan"), "{message}");
        let new = folder.path().join("some/where");
        check_out(&new).expect("can be made");
        assert!(!folder.path().join("some").exists(), "asking makes nothing");
    }
}
