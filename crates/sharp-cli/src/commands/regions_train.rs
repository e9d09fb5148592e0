//! `sharp regions train`: labels, training, and what one wants to see of it.

use std::ops::ControlFlow;
use std::path::Path;
use std::time::Instant;

use indicatif::ProgressBar;
use serde::Serialize;
use sharp_bench::{EventFile, named, pictures};
use sharp_draw::svg_to_png;
use sharp_maps::generate;
use sharp_plan::write_atomic;
use sharp_regions::{
    ComputeDevice, LabelRobot, RegionPredictor, RegionSettings, RegionTrainError, RegionTrainSettings,
    TrainFolder, TrainProgress, VALIDATION_KINDS, predict_regions, train_regions,
};
use sharp_space::{OccupancyGrid, Seed};

use crate::args::RegionsTrain;
use crate::commands::regions::label_robot;
use crate::outcome::{Exit, Failure, say, to_json};
use crate::progress;

/// Side of a sample picture, pixels.
const SAMPLE_PX: u32 = 440;

#[derive(Serialize)]
struct RegionTrainReport {
    schema: &'static str,
    robot: String,
    device: String,
    preset: String,
    seed: u64,
    maps: usize,
    goals: usize,
    starts: usize,
    steps: usize,
    file: String,
    bytes: usize,
    time_s: RegionTrainTimes,
}

#[derive(Serialize)]
struct RegionTrainTimes {
    labels: f64,
    train: f64,
    total: f64,
}

pub(crate) fn run(args: &RegionsTrain, seed: u64, json: bool) -> Result<Exit, Failure> {
    let robot = named::robot(&args.robot)?;
    let settings = settings(args, seed)?;
    let work = args.out.with_extension("work");
    let label_robot = label_robot(&robot);
    let mut watch = Watch::new(&work, &label_robot, &settings)?;
    let folder = TrainFolder { path: &work, resume: args.resume };
    let outcome = train_regions(&label_robot, &settings, Some(folder), &mut |progress| watch.see(progress));
    let (labels, total) = (watch.labelled_s, watch.begun.elapsed().as_secs_f64());
    watch.bar.finish_and_clear();
    if let Some(failure) = watch.failure {
        return Err(failure);
    }
    let predictor = match outcome {
        Err(RegionTrainError::Stopped { .. }) => {
            eprintln!("stopped; --resume goes on from the checkpoint in {}", work.display());
            return Ok(Exit::Interrupted);
        }
        outcome => outcome.map_err(|error| Failure::new("TRAINING", error))?,
    };
    let bytes = predictor.to_bytes();
    write_atomic(&args.out, &bytes)?;
    let report = RegionTrainReport {
        schema: "sharp.regions.train/1",
        robot: robot.name,
        device: args.device.clone(),
        preset: args.preset.clone(),
        seed,
        maps: settings.maps,
        goals: settings.labels.goals,
        starts: settings.labels.starts,
        steps: settings.steps,
        file: args.out.display().to_string(),
        bytes: bytes.len(),
        time_s: RegionTrainTimes { labels, train: total - labels, total },
    };
    if json {
        say!("{}", to_json(&report));
    } else {
        say!("{}: {} bytes after {total:.0} s, {labels:.0} s of it labels", report.file, report.bytes);
    }
    Ok(Exit::Done)
}

/// The preset with what else was asked for.
fn settings(args: &RegionsTrain, seed: u64) -> Result<RegionTrainSettings, Failure> {
    let mut settings = match args.preset.as_str() {
        "default" => RegionTrainSettings::default(),
        "tiny" => RegionTrainSettings::tiny(),
        "paper" => RegionTrainSettings::paper(),
        "paper-small" => RegionTrainSettings::paper_small(),
        name => {
            let message = format!("--preset is {name:?}, expected tiny, default, paper or paper-small");
            return Err(Failure::new("USAGE", message));
        }
    };
    let or = |asked: Option<u32>, preset: usize| asked.map_or(preset, |number| number as usize);
    settings.labels.goals = or(args.goals, settings.labels.goals);
    settings.labels.starts = or(args.starts, settings.labels.starts);
    settings.maps = or(args.maps, settings.maps);
    settings.steps = or(args.steps, settings.steps);
    settings.seed = Seed(seed);
    settings.device = device(&args.device)?;
    Ok(settings)
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

/// Shows training on the terminal, in event files and in pictures, and stops it on request.
struct Watch<'a> {
    begun: Instant,
    labelled_s: f64,
    bar: ProgressBar,
    events: EventFile,
    work: &'a Path,
    robot: &'a LabelRobot,
    sample: OccupancyGrid,
    /// What could not be written; training then stops.
    failure: Option<Failure>,
}

impl<'a> Watch<'a> {
    fn new(work: &'a Path, robot: &'a LabelRobot, settings: &RegionTrainSettings) -> Result<Self, Failure> {
        let events = EventFile::create(&work.join("events")).map_err(|error| unwritable(work, error))?;
        let sample =
            generate(VALIDATION_KINDS[0], 15.0, 15.0 / 220.0, &mut settings.seed.stream("sample picture", 0));
        Ok(Self {
            begun: Instant::now(),
            labelled_s: 0.0,
            bar: progress::bar(settings.maps as u64, "labelling"),
            events,
            work,
            robot,
            sample,
            failure: None,
        })
    }

    fn see(&mut self, progress: &TrainProgress<'_>) -> ControlFlow<()> {
        let shown = match *progress {
            TrainProgress::Labelled { map, .. } => {
                self.bar.set_position(map as u64);
                self.labelled_s = self.begun.elapsed().as_secs_f64();
                Ok(())
            }
            TrainProgress::Step { step, of, loss, critical_loss, heading_loss, learning_rate } => {
                self.bar.set_length(of as u64);
                self.bar.set_position(step as u64);
                self.bar.set_message(format!("loss {loss:.4} ({critical_loss:.3}, {heading_loss:.2})"));
                let values = [
                    ("train/loss", f64::from(loss)),
                    ("train/critical_loss", f64::from(critical_loss)),
                    ("train/heading_loss", f64::from(heading_loss)),
                    ("train/learning_rate", learning_rate),
                ];
                self.events.scalars(step as u64, &values).map_err(|error| unwritable(self.work, error))
            }
            TrainProgress::Checkpoint { step, predictor } => self.draw(step, predictor),
            _ => Ok(()),
        };
        self.failure = shown.err();
        if self.failure.is_some() || progress::is_interrupted() {
            return ControlFlow::Break(());
        }
        ControlFlow::Continue(())
    }

    /// A picture of what the network says of a map that it does not train on.
    fn draw(&mut self, step: usize, predictor: &RegionPredictor) -> Result<(), Failure> {
        let settings = RegionSettings::default();
        let found = predict_regions(&self.sample, &self.robot.footprint, predictor, &settings);
        let svg = pictures::regions(&self.sample, found.heatmap.values(), &found.regions);
        let png = svg_to_png(&svg, SAMPLE_PX)?;
        write_atomic(&self.work.join("samples").join(format!("step-{step:06}.png")), &png)?;
        self.events
            .picture(step as u64, "samples/regions", (SAMPLE_PX, SAMPLE_PX), &png)
            .map_err(|error| unwritable(self.work, error))
    }
}

fn unwritable(folder: &Path, error: std::io::Error) -> Failure {
    Failure::new("FILE_UNWRITABLE", format!("{}: {error}", folder.display()))
}
