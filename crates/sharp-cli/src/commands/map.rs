//! `sharp map info|check|save`: what a map file says, whether a robot has room in it, and the same as a ROS map.

use std::path::{Path, PathBuf};

use serde::Serialize;
use sharp_bench::{MapReport, named};
use sharp_draw::numbers::plain;
use sharp_plan::AbstractionSettings;
use sharp_rbvd::Rbvd;
use sharp_space::Occupancy;

use crate::args::{Map, MapArgs};
use crate::input;
use crate::outcome::{Exit, Failure, say, to_json};

#[derive(Serialize)]
struct Info {
    schema: &'static str,
    map: MapReport,
    width: usize,
    height: usize,
    origin: [f64; 3],
    free_m2: f64,
    free: f64,
    occupied: f64,
    unknown: f64,
    problems: usize,
}

#[derive(Serialize)]
struct Check {
    schema: &'static str,
    robot: String,
    passable: bool,
    components: usize,
    /// Share of the robot's free space that lies in components large enough for an abstract state.
    covered: f64,
}

#[derive(Serialize)]
struct Saved {
    schema: &'static str,
    map: MapReport,
    file: String,
}

/// A map is a YAML file. Neither it nor its image may take the place of what is read for `map`, or of an image that no such
/// file owns.
fn check_target(map: &MapArgs, out: &Path) -> Result<(), Failure> {
    let refused = |problem: String| Failure::new("USAGE", format!("--out is {}, {problem}", out.display()));
    if out.extension().is_none_or(|ending| ending != "yaml" && ending != "yml") {
        return Err(refused("expected a name that ends in .yaml".to_owned()));
    }
    let image = out.with_extension("pgm");
    let read: Vec<PathBuf> =
        std::iter::once(&map.map).chain(&map.reading.keepout).map(PathBuf::from).collect();
    let images: Vec<PathBuf> = read.iter().filter_map(|file| sharp_maps::image_of(file)).collect();
    for target in [out, &image] {
        input::check_not_input(target, read.iter().chain(&images).map(PathBuf::as_path))?;
    }
    if image.exists() && !out.exists() {
        return Err(refused(format!("which would overwrite {}: choose another name", image.display())));
    }
    Ok(())
}

pub(crate) fn run(command: &Map, json: bool) -> Result<Exit, Failure> {
    match command {
        Map::Info(args) => {
            let map = input::map(args)?;
            let (frame, cells) = (map.grid.frame(), map.grid.cells());
            let share = |what| cells.iter().filter(|&&cell| cell == what).count() as f64 / cells.len() as f64;
            let area_m2 = frame.width_m() * frame.height_m();
            let info = Info {
                schema: "sharp.map/1",
                map: MapReport::new(&map.name, &map.grid),
                width: frame.width,
                height: frame.height,
                origin: frame.origin.into(),
                free_m2: share(Occupancy::Free) * area_m2,
                free: share(Occupancy::Free),
                occupied: share(Occupancy::Occupied),
                unknown: share(Occupancy::Unknown),
                problems: map.problems.len(),
            };
            if json {
                say!("{}", to_json(&info));
            } else {
                let bounds = map.grid.frame().bounds();
                say!(
                    "{}: {} x {} cells of {} m = {:.1} x {:.1} m, origin ({}, {}, {})\nx from {:.2} to {:.2}, y from {:.2} to {:.2}\n{:.1} m2 free ({:.1} %), {:.1} % occupied, {:.1} % unknown, {} problems",
                    info.map.name,
                    info.width,
                    info.height,
                    plain(info.map.resolution_m),
                    info.map.width_m,
                    info.map.height_m,
                    info.origin[0],
                    info.origin[1],
                    info.origin[2],
                    bounds.min.x,
                    bounds.max.x,
                    bounds.min.y,
                    bounds.max.y,
                    info.free_m2,
                    100.0 * info.free,
                    100.0 * info.occupied,
                    100.0 * info.unknown,
                    info.problems
                );
            }
            Ok(Exit::Done)
        }
        Map::Save { map, out } => {
            check_target(map, out)?;
            let map = input::map(map)?;
            let folder = out.parent().filter(|folder| !folder.as_os_str().is_empty());
            folder
                .map_or(Ok(()), std::fs::create_dir_all)
                .map_err(|source| sharp_maps::MapError::Write { file: out.display().to_string(), source })?;
            sharp_maps::save_ros(&map.grid, out)?;
            let (frame, file) = (map.grid.frame(), out.display().to_string());
            if json {
                let map = MapReport::new(&map.name, &map.grid);
                say!("{}", to_json(&Saved { schema: "sharp.map.save/1", map, file }));
            } else {
                say!(
                    "{}: {} x {} cells written to {file} and the PGM beside it",
                    map.name,
                    frame.width,
                    frame.height
                );
            }
            Ok(Exit::Done)
        }
        Map::Check { map, robot } => {
            let map = input::map(map)?;
            let world = named::world(&map, named::robot(robot)?);
            let rbvd = AbstractionSettings::new(&world).diagram(&world, &[]).ok();
            let check = Check {
                schema: "sharp.map.check/1",
                robot: world.robot.name.clone(),
                passable: rbvd.as_ref().is_some_and(|rbvd| rbvd.component_count() > 0),
                components: rbvd.as_ref().map_or(0, Rbvd::component_count),
                covered: rbvd.as_ref().map_or(0.0, Rbvd::covered_share),
            };
            if json {
                say!("{}", to_json(&check));
            } else if check.passable {
                say!("the {} has room in {}: {} separate parts", check.robot, map.name, check.components);
            } else {
                say!("the {} has no room in {}", check.robot, map.name);
            }
            Ok(if check.passable { Exit::Done } else { Exit::No })
        }
    }
}
