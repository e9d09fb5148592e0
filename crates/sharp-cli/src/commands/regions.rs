//! `sharp regions train|predict|score`: the predictor of critical regions.

use serde::Serialize;
use sharp_bench::{named, pictures};
use sharp_drive::World;
use sharp_motion::Steering;
use sharp_plan::write_atomic;
use sharp_regions::LabelRobot;
use sharp_sim::RobotModel;
use sharp_space::Region;

use crate::args::{Abstract, Regions};
use crate::commands::{regions_score, regions_train};
use crate::input;
use crate::outcome::{Exit, Failure, say, to_json};

#[derive(Serialize)]
struct PredictReport {
    schema: &'static str,
    robot: String,
    source: String,
    regions: Vec<RegionReport>,
}

#[derive(Serialize)]
struct RegionReport {
    id: u32,
    x: f64,
    y: f64,
    area_m2: f64,
}

pub(crate) fn run(command: &Regions, seed: u64, json: bool) -> Result<Exit, Failure> {
    match command {
        Regions::Train(args) => regions_train::run(args, seed, json),
        Regions::Predict(args) => predict(args, json),
        Regions::Score(args) => regions_score::run(args, seed, json),
    }
}

/// The robot as labels know it.
pub(crate) fn label_robot(robot: &RobotModel) -> LabelRobot {
    LabelRobot { footprint: robot.footprint, steering: Steering::of(robot.min_turning_radius_m()) }
}

fn predict(args: &Abstract, json: bool) -> Result<Exit, Failure> {
    let map = input::map(&args.map)?;
    let world = named::world(&map, named::robot(&args.abstraction.robot)?);
    let detector = named::detector(&world, &args.abstraction.regions)?;
    let found = detector.detect(&world.grid, &world.robot.footprint);
    // A list of places has no picture of its own.
    pictures::forget(&args.out.join("regions"));
    if let Some(criticality) = &found.criticality {
        let picture = pictures::regions(&world.grid, criticality, &found.regions);
        pictures::write(&args.out, "regions", &picture)?;
    }
    let report = PredictReport {
        schema: "sharp.regions.predict/1",
        robot: world.robot.name.clone(),
        source: found.source,
        regions: found.regions.iter().map(|region| region_report(&world, region)).collect(),
    };
    write_atomic(&args.out.join("regions.json"), (to_json(&report) + "\n").as_bytes())?;
    if json {
        say!("{}", to_json(&report));
    } else {
        say!("{} regions by {}, files in {}", report.regions.len(), report.source, args.out.display());
    }
    Ok(Exit::Done)
}

fn region_report(world: &World, region: &Region) -> RegionReport {
    let frame = world.grid.frame();
    let center = region.center(frame);
    RegionReport { id: region.id.0, x: center.x, y: center.y, area_m2: region.area_m2(frame) }
}
