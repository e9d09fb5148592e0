//! Turning what was typed into maps, robots, noises and poses, or into one clear message.

use std::fs;
use std::io::ErrorKind;
use std::path::Path;

use sharp_drive::World;
use sharp_maps::{LoadOptions, MapFile, load};
use sharp_plan::Query;
use sharp_sim::{NoiseError, NoiseModel, RobotModel, SimulatorKind, UnknownSimulator};
use sharp_space::Pose;

use crate::args::{MapArgs, Unknown};
use crate::outcome::Failure;

/// Larger than any description of a robot, a noise or regions.
const TEXT_MAX_BYTES: u64 = 1 << 20;

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

/// The robot called `name`, or described by the file of that name.
pub(crate) fn robot(name: &str) -> Result<RobotModel, Failure> {
    match name {
        "husky" => Ok(RobotModel::husky()),
        "limo" => Ok(RobotModel::limo()),
        file => {
            let text = read_text(file, "robot", "husky, limo or a robot file")?;
            RobotModel::from_ron(&text)
                .map_err(|error| Failure::new("ROBOT_INVALID", format!("{file}: {error}")))
        }
    }
}

/// The noise called `name`, or described by the file of that name.
pub(crate) fn noise(name: &str) -> Result<NoiseModel, Failure> {
    match NoiseModel::by_name(name) {
        Ok(noise) => return Ok(noise),
        Err(NoiseError::Name(_)) => {}
        Err(error) => return Err(Failure::new("NOISE_INVALID", error.to_string())),
    }
    let text =
        read_text(name, "noise", "none, nominal, harsh, biased, one of them as nominal*2, or a noise file")?;
    NoiseModel::from_ron(&text).map_err(|error| Failure::new("NOISE_INVALID", format!("{name}: {error}")))
}

/// The simulator called `name`.
pub(crate) fn simulator(name: &str) -> Result<SimulatorKind, Failure> {
    name.parse().map_err(|error: UnknownSimulator| Failure::new("USAGE", format!("--simulator: {error}")))
}

/// The content of a small text file.
pub(crate) fn read_text(file: &str, what: &str, expected: &str) -> Result<String, Failure> {
    let refuse =
        |why: &str| Failure::new("FILE_UNREADABLE", format!("{what} {file:?} {why}, expected {expected}"));
    let metadata = fs::metadata(file).map_err(|error| match error.kind() {
        ErrorKind::NotFound => refuse("is no known name and no file"),
        _ => refuse(&format!("cannot be read: {error}")),
    })?;
    if !metadata.is_file() {
        return Err(refuse(if metadata.is_dir() { "is a folder" } else { "is no regular file" }));
    }
    if metadata.len() > TEXT_MAX_BYTES {
        return Err(refuse("is larger than 1 MiB"));
    }
    fs::read_to_string(file).map_err(|error| match error.kind() {
        ErrorKind::InvalidData => refuse("is not UTF-8 text"),
        _ => refuse(&format!("cannot be read: {error}")),
    })
}

/// A pose typed as `X,Y,YAW`.
pub(crate) fn pose(flag: &str, text: &str) -> Result<Pose, Failure> {
    let broken =
        || Failure::new("POSE_INVALID", format!("{flag} is {text:?}, expected three finite numbers X,Y,YAW"));
    let numbers: Vec<f64> =
        text.split(',').map(|part| part.trim().parse()).collect::<Result<_, _>>().map_err(|_| broken())?;
    let [x, y, yaw] = <[f64; 3]>::try_from(numbers).map_err(|_| broken())?;
    let is_sane = |value: f64, limit: f64| value.is_finite() && value.abs() <= limit;
    // Beyond 1000 rad an angle is a mistake in its unit, and its wrapped value has lost digits.
    if !(is_sane(x, 1e9) && is_sane(y, 1e9) && is_sane(yaw, 1000.0)) {
        return Err(broken());
    }
    Ok(Pose::new(x, y, yaw))
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

/// Verifies that both ends of `query` can be stood on.
pub(crate) fn check_query(world: &World, query: &Query) -> Result<(), Failure> {
    check_end(world, &query.start, "start", ["START_OUTSIDE_MAP", "START_OCCUPIED"], true)?;
    check_end(world, &query.goal, "goal", ["GOAL_OUTSIDE_MAP", "GOAL_OCCUPIED"], false)
}

/// The goal's heading is free: there it is enough that the robot fits in some direction.
fn check_end(
    world: &World,
    pose: &Pose,
    name: &str,
    [outside, occupied]: [&'static str; 2],
    heading_counts: bool,
) -> Result<(), Failure> {
    let frame = world.grid.frame();
    let at =
        format!("{name} ({:.2}, {:.2}, {:.2})", pose.position.x, pose.position.y, pose.heading.radians());
    let Some(cell) = frame.cell_at(pose.position) else {
        let bounds = frame.bounds();
        return Err(Failure::new(
            outside,
            format!(
                "{at} lies outside the map, which reaches from ({:.2}, {:.2}) to ({:.2}, {:.2})",
                bounds.min.x, bounds.min.y, bounds.max.x, bounds.max.y
            ),
        ));
    };
    let turned = |step: u32| Pose::at(pose.position, (pose.heading.radians() + f64::from(step) * 0.1).into());
    let fits = if heading_counts {
        world.geometry.is_free(*pose)
    } else {
        (0..63).any(|step| world.geometry.is_free(turned(step)))
    };
    if fits {
        return Ok(());
    }
    let what = match world.grid.get(cell) {
        sharp_space::Occupancy::Occupied => "lies in an obstacle".to_owned(),
        sharp_space::Occupancy::Unknown => {
            "lies in unknown space (--unknown free takes it as free)".to_owned()
        }
        sharp_space::Occupancy::Free => {
            format!("is too near to an obstacle for the {}: its footprint overlaps", world.robot.name)
        }
    };
    Err(Failure::new(occupied, format!("{at} {what}; {}", nearest_hint(world, pose))))
}

/// Where the robot would fit.
fn nearest_hint(world: &World, pose: &Pose) -> String {
    let frame = world.grid.frame();
    let room_m = world.robot.footprint.circumscribed_radius_m() + 1.5 * frame.resolution_m;
    let field = world.geometry.clearance();
    let fits = (0..frame.len()).map(|index| frame.cell(index)).filter(|&cell| field.at(cell) > room_m);
    let distance = |cell| (frame.center(cell) - pose.position).norm();
    match fits.min_by(|&a, &b| distance(a).total_cmp(&distance(b))) {
        Some(cell) => {
            let point = frame.center(cell);
            format!(
                "the nearest place with room is ({:.2}, {:.2}), {:.2} m away",
                point.x,
                point.y,
                distance(cell)
            )
        }
        None => "the map has no place with room for it".to_owned(),
    }
}

/// The query that the flags of `solve` ask for.
pub(crate) fn query(
    map: &MapFile,
    start: Option<&str>,
    goal: Option<&str>,
    problem: Option<usize>,
) -> Result<Query, Failure> {
    if let (Some(start), Some(goal)) = (start, goal) {
        return Ok(Query { start: pose("--start", start)?, goal: pose("--goal", goal)? });
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
    use super::*;

    #[test]
    fn broken_poses_name_flag_and_value() {
        for text in ["", "1,2", "1,2,3,4", "1,NaN,0", "inf,0,0", "1,2,x", "0,0,1e9"] {
            let message = pose("--start", text).unwrap_err().to_string();
            assert!(message.contains("--start") && message.contains(&format!("{text:?}")), "{message}");
        }
        assert_eq!(pose("--goal", "-1.5, 2,3").unwrap(), Pose::new(-1.5, 2.0, 3.0));
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
