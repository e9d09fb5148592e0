//! Our side of `cargo xtask bench peers regions`: `peer_regions flex|ndarray SECONDS` prints, as one
//! JSON object, training steps and predictions per second on one thread.

#![allow(
    clippy::disallowed_methods,
    reason = "an example is a command: it reads its arguments and the clock"
)]

use std::ops::ControlFlow;
use std::time::{Duration, Instant};

use serde_json::{Value, json};
use sharp_maps::{FloorplanKind, generate};
use sharp_motion::Steering;
use sharp_regions::{
    Activation, ComputeDevice, LabelRobot, RegionPredictor, RegionTrainSettings, TrainProgress, UNetConfig,
    train_regions,
};
use sharp_space::{DistanceField, Footprint, OccupancyGrid, Seed};

/// The shipped network, and one of the plain kind that reads single pixels.
const NETWORKS: [(&str, UNetConfig); 2] = [
    ("compact", UNetConfig::compact()),
    ("plain", UNetConfig { width: 16, levels: 4, patch: 1, activation: Activation::Relu }),
];

fn main() {
    let usage = "usage: peer_regions flex|ndarray SECONDS";
    let mut arguments = std::env::args().skip(1);
    let name = arguments.next().expect(usage);
    let device = device(&name).expect(usage);
    let seconds: f64 = arguments.next().and_then(|text| text.parse().ok()).expect(usage);
    let mut report = json!({ "name": format!("burn {name}") });
    for (network, config) in NETWORKS {
        let (predictor, rate) = train(config, device, Duration::from_secs_f64(seconds));
        report[format!("train.{network}")] = json!(rate);
        for size_m in [15.0, 48.0] {
            let rate = predict(&predictor, size_m, Duration::from_secs_f64(seconds));
            report[format!("predict.{network}.{size_m}m")] = json!(rate);
        }
    }
    println!("{}", Value::to_string(&report));
}

fn device(name: &str) -> Option<ComputeDevice> {
    match name {
        "flex" => Some(ComputeDevice::Flex),
        #[cfg(feature = "ndarray")]
        "ndarray" => Some(ComputeDevice::Ndarray),
        _ => None,
    }
}

/// Steps per second of batches of eight maps of 120 x 120 pixels, the first step left out.
fn train(network: UNetConfig, device: ComputeDevice, time: Duration) -> (RegionPredictor, f64) {
    let footprint = Footprint::rectangle(0.5, 0.335).expect("a sound footprint");
    let robot = LabelRobot { footprint, steering: Steering::RotateTranslate };
    let mut settings = RegionTrainSettings::default();
    (settings.labels.goals, settings.labels.starts) = (1, 1);
    (settings.network, settings.device, settings.maps) = (network, device, 2);
    let run = |steps| {
        let mut times = Vec::new();
        let mut observer = |progress: &TrainProgress<'_>| {
            if matches!(progress, TrainProgress::Step { .. }) {
                times.push(Instant::now());
            }
            ControlFlow::Continue(())
        };
        let mut settings = settings.clone();
        settings.steps = steps;
        let predictor = train_regions(&robot, &settings, None, &mut observer).expect("training succeeds");
        let (first, last) = (times[0], times[times.len() - 1]);
        (predictor, (last - first).as_secs_f64() / (times.len() - 1) as f64)
    };
    let (_, step_s) = run(3);
    let (predictor, step_s) = run(((time.as_secs_f64() / step_s) as usize).clamp(3, 1000));
    (predictor, 1.0 / step_s)
}

/// Heat maps per second of a square map.
fn predict(predictor: &RegionPredictor, size_m: f64, time: Duration) -> f64 {
    let grid: OccupancyGrid = generate(FloorplanKind::Rooms, size_m, 0.125, &mut Seed(1).stream("peer", 0));
    let clearance = DistanceField::new(&grid);
    let _ = predictor.heatmap(&grid, &clearance);
    let begun = Instant::now();
    let mut count = 0;
    while count == 0 || begun.elapsed() < time {
        let _ = predictor.heatmap(&grid, &clearance);
        count += 1;
    }
    f64::from(count) / begun.elapsed().as_secs_f64()
}
