//! `sharp regions score`: how good regions are, by plans on maps never seen and by the doors of a map.

use std::path::Path;

use serde::Serialize;
use sharp_bench::named;
use sharp_drive::World;
use sharp_maps::FloorplanKind;
use sharp_maps::load_doors;
use sharp_regions::{
    BLIND_RADIUS_M, ComputeDevice, DoorScore, HELD_OUT_KINDS, LabelRobot, Labels, RegionPredictor,
    RegionScore, RegionSettings, RegionTrainSettings, VALIDATION_KINDS, find_regions, geometric_regions,
    grid_regions, predict_regions, random_regions, score_doors, score_regions, scoring_maps,
};
use sharp_sim::RobotModel;
use sharp_space::{Detection, DistanceField, OccupancyGrid, Point, Region, Seed};

use crate::args::{ReadingArgs, RegionsScore, Unknown};
use crate::commands::regions::label_robot;
use crate::outcome::{Exit, Failure, say, to_json};
use crate::{input, progress};

/// Thresholds that calibration tries.
const THRESHOLDS: [f64; 7] = [0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9];
/// Thresholds at doorways that calibration tries; with the last no doorway counts as such.
const DOORWAY_THRESHOLDS: [f64; 6] = [0.02, 0.05, 0.1, 0.15, 0.25, 1.1];

#[derive(Serialize)]
struct RegionScoreReport {
    schema: &'static str,
    robot: String,
    maps: usize,
    net: RegionScore,
    geometric: RegionScore,
    random: RegionScore,
    grid: RegionScore,
}

#[derive(Serialize)]
struct DoorReport {
    schema: &'static str,
    robot: String,
    map: String,
    source: String,
    #[serde(flatten)]
    score: DoorScore,
}

#[derive(Serialize)]
struct CalibrateReport {
    schema: &'static str,
    robot: String,
    maps: usize,
    thresholds: Vec<ThresholdReport>,
    /// Threshold, and threshold at doorways.
    best: [f64; 2],
}

#[derive(Serialize)]
struct ThresholdReport {
    threshold: f64,
    doorway_threshold: f64,
    #[serde(flatten)]
    score: RegionScore,
}

pub(crate) fn run(args: &RegionsScore, seed: u64, json: bool) -> Result<Exit, Failure> {
    let robot = named::robot(&args.robot)?;
    if let (Some(map), Some(doors)) = (&args.map, &args.doors) {
        return at_doors(args, robot, map, doors, json);
    }
    let predictor = match &args.model {
        Some(file) => model(file)?,
        None => RegionPredictor::shipped_for(&robot.footprint),
    };
    if args.calibrate {
        return calibrate(args, &robot, &predictor, seed, json);
    }
    score(args, &robot, &predictor, seed, json)
}

fn model(file: &Path) -> Result<RegionPredictor, Failure> {
    let bytes = std::fs::read(file)
        .map_err(|error| Failure::new("FILE_UNREADABLE", format!("{}: {error}", file.display())))?;
    RegionPredictor::from_bytes(&bytes, ComputeDevice::default())
        .map_err(|error| Failure::new("FILE_INVALID", format!("{}: {error}", file.display())))
}

/// As many labelled maps of each of `kinds` as `args` ask for.
fn labelled(
    kinds: &[FloorplanKind],
    args: &RegionsScore,
    robot: &LabelRobot,
    seed: u64,
) -> Vec<(OccupancyGrid, Labels)> {
    let kinds: Vec<_> = kinds.iter().copied().cycle().take(kinds.len() * args.maps as usize).collect();
    let defaults = RegionTrainSettings::default().labels;
    let or = |asked: Option<u32>, default: usize| asked.map_or(default, |number| number as usize);
    let mut labels = defaults;
    labels.goals = or(args.goals, defaults.goals);
    labels.starts = or(args.starts, defaults.starts);
    let spinner = progress::spinner("solving problems on maps of other kinds than training's");
    let maps = scoring_maps(&kinds, robot, labels, Seed(seed));
    spinner.finish_and_clear();
    maps
}

fn score(
    args: &RegionsScore,
    robot: &RobotModel,
    predictor: &RegionPredictor,
    seed: u64,
    json: bool,
) -> Result<Exit, Failure> {
    let maps = labelled(&HELD_OUT_KINDS, args, &label_robot(robot), seed);
    let settings = RegionSettings::default();
    let reach_m = robot.footprint.inscribed_radius_m();
    let mut scores: [Vec<RegionScore>; 4] = Default::default();
    for (index, (grid, labels)) in maps.iter().enumerate() {
        let clearance = DistanceField::new(grid);
        let net = predict_regions(grid, &robot.footprint, predictor, &settings).regions;
        let geometric = geometric_regions(grid, &robot.footprint, &settings.geometric).regions;
        let mut rng = Seed(seed).stream("random regions", index as u64);
        let random = random_regions(&clearance, reach_m, net.len(), BLIND_RADIUS_M, &mut rng);
        let lattice = grid_regions(&clearance, reach_m, net.len(), BLIND_RADIUS_M);
        for (scores, regions) in scores.iter_mut().zip([net, geometric, random, lattice]) {
            scores.push(score_regions(&regions, grid.frame(), labels));
        }
    }
    let [net, geometric, random, grid] = scores.map(|scores| RegionScore::mean(&scores));
    let (robot, maps) = (robot.name.clone(), maps.len());
    let report =
        RegionScoreReport { schema: "sharp.regions.score/1", robot, maps, net, geometric, random, grid };
    if json {
        say!("{}", to_json(&report));
        return Ok(Exit::Done);
    }
    table_head("regions from");
    for (name, score) in [("net", net), ("geometric", geometric), ("random", random), ("grid", grid)] {
        table_row(name, &score);
    }
    Ok(Exit::Done)
}

fn table_head(first: &str) {
    say!("| {first} | number | mu | density | precision | recall | IoU |\n|---|---|---|---|---|---|---|");
}

fn table_row(name: &str, score: &RegionScore) {
    let RegionScore { regions, mu, density, precision, recall, iou } = score;
    say!("| {name} | {regions:.1} | {mu:.2} | {density:.2} | {precision:.2} | {recall:.2} | {iou:.2} |");
}

/// Scores pairs of thresholds on the validation maps; the best has the highest product of mu and
/// overlap: the one alone likes many small regions, the other large ones.
fn calibrate(
    args: &RegionsScore,
    robot: &RobotModel,
    predictor: &RegionPredictor,
    seed: u64,
    json: bool,
) -> Result<Exit, Failure> {
    let maps = labelled(&VALIDATION_KINDS, args, &label_robot(robot), seed);
    let seen: Vec<_> = maps
        .iter()
        .map(|(grid, labels)| {
            let clearance = DistanceField::new(grid);
            (predictor.heatmap(grid, &clearance), clearance, labels)
        })
        .collect();
    let at = |threshold: f64, doorway_threshold: f64| {
        let mut settings = RegionSettings::default();
        settings.extract.threshold = threshold;
        settings.extract.doorway_threshold = doorway_threshold;
        let scores: Vec<RegionScore> = seen
            .iter()
            .map(|(heatmap, clearance, labels)| {
                let regions = find_regions(heatmap, clearance, &robot.footprint, &settings);
                score_regions(&regions, heatmap.frame(), labels)
            })
            .collect();
        ThresholdReport { threshold, doorway_threshold, score: RegionScore::mean(&scores) }
    };
    let thresholds: Vec<_> = THRESHOLDS
        .iter()
        .flat_map(|&threshold| DOORWAY_THRESHOLDS.iter().map(move |&doorway| (threshold, doorway)))
        .map(|(threshold, doorway)| at(threshold, doorway))
        .collect();
    let worth = |report: &ThresholdReport| report.score.mu * report.score.iou;
    let best = thresholds.iter().max_by(|a, b| worth(a).total_cmp(&worth(b)));
    let best = best.expect("there are thresholds");
    let best = [best.threshold, best.doorway_threshold];
    if json {
        let (schema, robot, maps) = ("sharp.regions.calibrate/1", robot.name.clone(), maps.len());
        say!("{}", to_json(&CalibrateReport { schema, robot, maps, thresholds, best }));
        return Ok(Exit::Done);
    }
    table_head("thresholds");
    for ThresholdReport { threshold, doorway_threshold, score } in &thresholds {
        table_row(&format!("{threshold:.2}, {doorway_threshold:.2}"), score);
    }
    say!("best: {:.2}, at doorways {:.2}", best[0], best[1]);
    Ok(Exit::Done)
}

fn at_doors(
    args: &RegionsScore,
    robot: RobotModel,
    map: &str,
    doors: &Path,
    json: bool,
) -> Result<Exit, Failure> {
    let reading = ReadingArgs {
        resolution: None,
        unknown: Unknown::Blocked,
        allow_outside: false,
        keepout: vec![],
        downsample: 1,
    };
    let loaded = input::map_called(map, &reading)?;
    let world = World::new(loaded.grid, robot);
    let (regions, source) = match &args.model {
        Some(file) => (with_model(&world, &model(file)?), file.display().to_string()),
        None => {
            let Detection { regions, source, .. } =
                named::detector(&world, &args.regions)?.detect(&world.grid, &world.robot.footprint);
            (regions, source)
        }
    };
    let doors: Vec<Point> = load_doors(doors)?.iter().map(sharp_maps::Door::middle).collect();
    let score = score_doors(&regions, world.geometry.clearance(), &world.robot.footprint, &doors);
    let (robot, map) = (world.robot.name.clone(), loaded.name);
    let report = DoorReport { schema: "sharp.regions.doors/1", robot, map, source, score };
    if json {
        say!("{}", to_json(&report));
    } else {
        let DoorScore { doors, found, found_by_centers, regions, false_regions, false_per_door, .. } = score;
        let share = if found > 0 { format!(", {false_per_door:.2} a door found") } else { String::new() };
        say!(
            "{found} of {doors} doors have a region within a metre ({found_by_centers} its centre); of {regions} regions \
             {false_regions} are at no door, junction or narrowing{share}"
        );
    }
    Ok(Exit::Done)
}

fn with_model(world: &World, predictor: &RegionPredictor) -> Vec<Region> {
    let footprint = &world.robot.footprint;
    predict_regions(&world.grid, footprint, predictor, &RegionSettings::default()).regions
}
