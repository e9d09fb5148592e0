//! `sharp regions train|predict|score`: the predictor of critical regions.

use std::time::Instant;

use serde::Serialize;
use sharp_motion::Steering;
use sharp_plan::{Workspace, write_atomic};
use sharp_regions::{
    ComputeDevice, HELD_OUT_KINDS, LabelRobot, RegionScore, RegionSettings, TrainProgress, TrainSettings,
    geometric_regions, predict_regions, random_regions, score_regions, scoring_maps, train_regions,
};
use sharp_sim::RobotModel;
use sharp_space::{DistanceField, Region, Seed};

use crate::args::{Abstract, Regions, RegionsScore, RegionsTrain};
use crate::outcome::{Exit, Failure, say, to_json};
use crate::{input, pictures, pipeline, progress};

/// Radius of the random discs that every predictor must beat, metres.
const RANDOM_RADIUS_M: f64 = 0.5;

#[derive(Serialize)]
struct TrainReport {
    schema: &'static str,
    robot: String,
    device: String,
    preset: String,
    seed: u64,
    file: String,
    bytes: usize,
    time_s: TrainTimes,
}

#[derive(Serialize)]
struct TrainTimes {
    labels: f64,
    train: f64,
    total: f64,
}

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

#[derive(Serialize)]
struct ScoreReport {
    schema: &'static str,
    robot: String,
    maps: usize,
    net: RegionScore,
    geometric: RegionScore,
    random: RegionScore,
}

pub(crate) fn run(command: &Regions, seed: u64, json: bool) -> Result<Exit, Failure> {
    match command {
        Regions::Train(args) => train(args, seed, json),
        Regions::Predict(args) => predict(args, json),
        Regions::Score(args) => score(args, seed, json),
    }
}

fn train(args: &RegionsTrain, seed: u64, json: bool) -> Result<Exit, Failure> {
    let robot = input::robot(&args.robot)?;
    let settings = TrainSettings { seed: Seed(seed), device: device(&args.device)?, ..preset(&args.preset)? };
    let begun = Instant::now();
    let mut labelled_s = 0.0;
    let bar = progress::bar(settings.maps as u64, "labelling");
    let mut observer = |progress: &TrainProgress| match *progress {
        TrainProgress::Labelled { map, .. } => {
            bar.set_position(map as u64);
            labelled_s = begun.elapsed().as_secs_f64();
        }
        TrainProgress::Step { step, of, loss } => {
            bar.set_length(of as u64);
            bar.set_position(step as u64);
            bar.set_message(format!("loss {loss:.4}"));
        }
        _ => {}
    };
    // Labels and checkpoints stand beside the result, so that a run that was stopped goes on.
    let work = args.out.with_extension("work");
    let predictor = train_regions(&label_robot(&robot), &settings, Some(&work), &mut observer)
        .map_err(|error| Failure::new("TRAINING", error))?;
    bar.finish_and_clear();
    let bytes = predictor.to_bytes();
    write_atomic(&args.out, &bytes)?;
    let total = begun.elapsed().as_secs_f64();
    let report = TrainReport {
        schema: "sharp.regions.train/1",
        robot: robot.name,
        device: args.device.clone(),
        preset: args.preset.clone(),
        seed,
        file: args.out.display().to_string(),
        bytes: bytes.len(),
        time_s: TrainTimes { labels: labelled_s, train: total - labelled_s, total },
    };
    if json {
        say!("{}", to_json(&report));
    } else {
        say!(
            "{}: {} bytes after {:.0} s, {:.0} s of it labels",
            report.file,
            report.bytes,
            total,
            labelled_s
        );
    }
    Ok(Exit::Done)
}

fn preset(name: &str) -> Result<TrainSettings, Failure> {
    match name {
        "default" => Ok(TrainSettings::default()),
        "tiny" => Ok(TrainSettings::tiny()),
        "paper" => Ok(TrainSettings::paper()),
        _ => Err(Failure::new("USAGE", format!("--preset is {name:?}, expected tiny, default or paper"))),
    }
}

fn device(name: &str) -> Result<ComputeDevice, Failure> {
    match name {
        "flex" => Ok(ComputeDevice::Flex),
        #[cfg(feature = "ndarray")]
        "ndarray" => Ok(ComputeDevice::Ndarray),
        #[cfg(not(feature = "ndarray"))]
        "ndarray" => Err(Failure::new(
            "USAGE",
            "--device ndarray is not compiled in; build with --features ndarray, as cargo xtask train-regions does",
        )),
        _ => Err(Failure::new("USAGE", format!("--device is {name:?}, expected flex or ndarray"))),
    }
}

fn label_robot(robot: &RobotModel) -> LabelRobot {
    LabelRobot { footprint: robot.footprint, steering: Steering::of(robot.min_turning_radius_m()) }
}

fn predict(args: &Abstract, json: bool) -> Result<Exit, Failure> {
    let map = input::map(&args.map)?;
    let workspace = Workspace::new(map.grid, input::robot(&args.abstraction.robot)?);
    let (heatmap, regions, source) = pipeline::regions(&workspace, &args.abstraction.regions)?;
    if let Some(heatmap) = &heatmap {
        pictures::write(&args.out, "regions", &pictures::regions(&workspace.grid, heatmap, &regions))?;
    }
    let report = PredictReport {
        schema: "sharp.regions.predict/1",
        robot: workspace.robot.name.clone(),
        source,
        regions: regions.iter().map(|region| region_report(&workspace, region)).collect(),
    };
    write_atomic(&args.out.join("regions.json"), (to_json(&report) + "\n").as_bytes())?;
    if json {
        say!("{}", to_json(&report));
    } else {
        say!("{} regions by {}, files in {}", report.regions.len(), report.source, args.out.display());
    }
    Ok(Exit::Done)
}

fn region_report(workspace: &Workspace, region: &Region) -> RegionReport {
    let frame = workspace.grid.frame();
    let center = region.center(frame);
    RegionReport { id: region.id.0, x: center.x, y: center.y, area_m2: region.area_m2(frame) }
}

fn score(args: &RegionsScore, seed: u64, json: bool) -> Result<Exit, Failure> {
    let robot = input::robot(&args.robot)?;
    let kinds: Vec<_> =
        HELD_OUT_KINDS.iter().copied().cycle().take(HELD_OUT_KINDS.len() * args.maps as usize).collect();
    let spinner = progress::spinner("solving problems on held-out maps");
    let maps = scoring_maps(&kinds, &label_robot(&robot), TrainSettings::default().labels, Seed(seed));
    let settings = RegionSettings::default();
    let predictor = pipeline::shipped(&robot);
    let mut scores: [Vec<RegionScore>; 3] = Default::default();
    for (index, (grid, labels)) in maps.iter().enumerate() {
        let clearance = DistanceField::new(grid);
        let net = predict_regions(grid, &robot.footprint, &predictor, &settings).regions;
        let geometric = geometric_regions(grid, &robot.footprint, &settings.geometric).regions;
        let mut rng = Seed(seed).stream("random regions", index as u64);
        let reach_m = robot.footprint.inscribed_radius_m();
        let random = random_regions(&clearance, reach_m, net.len(), RANDOM_RADIUS_M, &mut rng);
        for (scores, regions) in scores.iter_mut().zip([net, geometric, random]) {
            scores.push(score_regions(&regions, grid.frame(), labels));
        }
    }
    spinner.finish_and_clear();
    let [net, geometric, random] = scores.map(|scores| RegionScore::mean(&scores));
    let report = ScoreReport {
        schema: "sharp.regions.score/1",
        robot: robot.name,
        maps: maps.len(),
        net,
        geometric,
        random,
    };
    if json {
        say!("{}", to_json(&report));
    } else {
        say!(
            "| regions from | number | mu | density | precision | recall | IoU |\n|---|---|---|---|---|---|---|"
        );
        for (name, score) in [("net", net), ("geometric", geometric), ("random", random)] {
            let RegionScore { regions, mu, density, precision, recall, iou } = score;
            say!(
                "| {name} | {regions:.1} | {mu:.2} | {density:.2} | {precision:.2} | {recall:.2} | {iou:.2} |"
            );
        }
    }
    Ok(Exit::Done)
}
