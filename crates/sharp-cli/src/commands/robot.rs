//! `sharp robot list|show|import`.

use std::path::PathBuf;

use serde::Serialize;
use sharp_bench::{ImportWishes, ImportedField, import_robot, named};
use sharp_plan::write_atomic;
use sharp_sim::{RobotError, RobotModel};
use sharp_space::FootprintShape;

use crate::args::{DriveName, Robots};
use crate::input;
use crate::outcome::{Exit, Failure, say, to_json};

#[derive(Serialize)]
struct List {
    schema: &'static str,
    robots: Vec<Summary>,
}

/// What tells robots apart.
#[derive(Serialize)]
struct Summary {
    name: String,
    drive: &'static str,
    footprint: String,
    max_speed_mps: f64,
    min_turning_radius_m: f64,
}

#[derive(Serialize)]
struct ShownRobot<'a> {
    schema: &'static str,
    robot: &'a RobotModel,
    min_turning_radius_m: f64,
    yaw_gain: f64,
}

#[derive(Serialize)]
struct Imported<'a> {
    schema: &'static str,
    name: &'a str,
    file: String,
    drive: &'static str,
    footprint: String,
    found: &'a [ImportedField],
    assumed: &'a [ImportedField],
    warnings: &'a [String],
}

pub(crate) fn run(command: &Robots, json: bool) -> Result<Exit, Failure> {
    match command {
        Robots::List => list(json),
        Robots::Show { robot } => show(robot, json)?,
        Robots::Import { files, out, name, max_speed, drive } => {
            let wishes = ImportWishes {
                name: name.clone(),
                max_speed_mps: *max_speed,
                is_car: drive.map(|drive| drive == DriveName::Ackermann),
            };
            import(files, out.clone(), &wishes, json)?;
        }
    }
    Ok(Exit::Done)
}

fn list(json: bool) {
    let robots: Vec<Summary> =
        RobotModel::names().filter_map(RobotModel::built_in).map(|robot| summary(&robot)).collect();
    if json {
        say!("{}", to_json(&List { schema: "sharp.robot.list/1", robots }));
        return;
    }
    for robot in robots {
        let turns = if robot.min_turning_radius_m > 0.0 {
            format!("turns within {:.2} m", robot.min_turning_radius_m)
        } else {
            "turns in place".to_owned()
        };
        say!(
            "{:<11} {:<12} {:<22} {:>5.2} m/s  {turns}",
            robot.name,
            robot.drive,
            robot.footprint,
            robot.max_speed_mps
        );
    }
}

fn summary(robot: &RobotModel) -> Summary {
    Summary {
        name: robot.name.clone(),
        drive: robot.drive.name(),
        footprint: outline(robot),
        max_speed_mps: robot.max_speed_mps,
        min_turning_radius_m: robot.min_turning_radius_m(),
    }
}

fn outline(robot: &RobotModel) -> String {
    match robot.footprint.shape() {
        FootprintShape::Disc { radius_m } => format!("disc of radius {radius_m:.3} m"),
        FootprintShape::Polygon { corners } => format!("{} corners", corners.len()),
        _ => {
            let (length_m, width_m) = (robot.footprint.half_length_m(), robot.footprint.half_width_m());
            format!("{:.3} m x {:.3} m", 2.0 * length_m, 2.0 * width_m)
        }
    }
}

fn show(name: &str, json: bool) -> Result<(), Failure> {
    let robot = named::robot(name)?;
    if json {
        let (min_turning_radius_m, yaw_gain) = (robot.min_turning_radius_m(), robot.yaw_gain());
        say!(
            "{}",
            to_json(&ShownRobot { schema: "sharp.robot/1", robot: &robot, min_turning_radius_m, yaw_gain })
        );
        return Ok(());
    }
    let text = ron::ser::to_string_pretty(&robot, ron::ser::PrettyConfig::default().struct_names(true));
    say!("{}", text.map_err(anyhow::Error::from)?);
    Ok(())
}

/// Refuses a flag that no robot could have, before the files are blamed for it.
fn check(wishes: &ImportWishes) -> Result<(), Failure> {
    let name = wishes.name.as_deref().unwrap_or("robot");
    let speed_mps = wishes.max_speed_mps.unwrap_or(1.0);
    let text =
        format!("(name: {name:?}, robot_radius: 0.3, drive: Differential(), max_speed_mps: {speed_mps:?})");
    match RobotModel::from_ron(&text) {
        Ok(_) => Ok(()),
        Err(RobotError::Value { value, expected, .. }) => {
            Err(Failure::new("USAGE", format!("--max-speed is {value:?}, must be {expected}")))
        }
        Err(error) => Err(Failure::new("USAGE", format!("--name: {error}"))),
    }
}

fn import(files: &[PathBuf], out: Option<PathBuf>, wishes: &ImportWishes, json: bool) -> Result<(), Failure> {
    check(wishes)?;
    if let Some(out) = &out {
        input::check_not_input(out, files.iter().map(PathBuf::as_path))?;
    }
    let imported = import_robot(files, wishes)?;
    let robot = &imported.robot;
    let out = out.map_or_else(|| fresh_file(&robot.name), Ok)?;
    write_atomic(&out, imported.text.as_bytes())?;
    for warning in &imported.warnings {
        eprintln!("warning: {warning}");
    }
    let file = out.display().to_string();
    if json {
        let report = Imported {
            schema: "sharp.robot.import/1",
            name: &robot.name,
            file,
            drive: robot.drive.name(),
            footprint: outline(robot),
            found: &imported.found,
            assumed: &imported.assumed,
            warnings: &imported.warnings,
        };
        say!("{}", to_json(&report));
        return Ok(());
    }
    say!("{}: {}, {}, {} m/s", robot.name, robot.drive.name(), outline(robot), robot.max_speed_mps);
    say!("found:");
    imported.found.iter().for_each(print_finding);
    say!("assumed, change in the file what you know better:");
    imported.assumed.iter().for_each(print_finding);
    say!("written to {file}; next: sharp solve MAP --robot {file} --start X,Y,YAW --goal X,Y");
    Ok(())
}

fn print_finding(finding: &ImportedField) {
    say!("  {:<21} {:<40} {}", finding.field, finding.value, finding.source);
}

/// A file of that name which does not exist yet.
fn fresh_file(name: &str) -> Result<PathBuf, Failure> {
    let stem: String =
        name.chars().map(|c| if c.is_alphanumeric() || matches!(c, '-' | '_') { c } else { '_' }).collect();
    let file = PathBuf::from(format!("{stem}.ron"));
    if file.exists() {
        let message = format!("{} exists already, name another file with --out", file.display());
        return Err(Failure::new("FILE_INVALID", message));
    }
    Ok(file)
}
