//! Trains the network of one robot and scores it: `train_regions husky|limo FOLDER [STEPS]`.
//!
//! Labels and checkpoints go to FOLDER, the network to FOLDER/regions-ROBOT.safetensors; the scores
//! on kinds of maps that training did not see go to stdout.

#![allow(
    clippy::disallowed_methods,
    reason = "an example is a command: it reads its arguments and the clock"
)]

use std::path::PathBuf;
use std::time::Instant;

use sharp_motion::Steering;
use sharp_regions::{
    HELD_OUT_KINDS, LabelRobot, RegionScore, RegionSettings, TrainProgress, TrainSettings, detect_geometric,
    predict_regions, random_regions, score_regions, scoring_maps, train_regions,
};
use sharp_space::{DistanceField, Footprint, Seed};

fn main() {
    let usage = "usage: train_regions husky|limo FOLDER [STEPS]";
    let mut arguments = std::env::args().skip(1);
    let name = arguments.next().expect(usage);
    let folder = PathBuf::from(arguments.next().expect(usage));
    let mut settings = TrainSettings::default();
    if let Some(steps) = arguments.next() {
        settings.steps = steps.parse().expect("STEPS is a number");
    }
    let robot = robot(&name).expect(usage);
    let started = Instant::now();
    let mut observer = |progress: &TrainProgress| {
        let seconds = started.elapsed().as_secs_f64();
        match progress {
            TrainProgress::Labelled { map, of, solved } => {
                eprintln!("{seconds:6.1} s  map {map} of {of}: {solved} plans");
            }
            TrainProgress::Step { step, of, loss } if step % 20 == 0 => {
                eprintln!("{seconds:6.1} s  step {step} of {of}: loss {loss:.4}");
            }
            _ => (),
        }
    };
    let predictor =
        train_regions(&robot, &settings, Some(&folder), &mut observer).expect("training succeeds");
    let path = folder.join(format!("regions-{name}.safetensors"));
    std::fs::write(&path, predictor.to_bytes()).expect("the network is written");
    println!("{name}: trained in {:.0} s", started.elapsed().as_secs_f64());

    let kinds: Vec<_> = HELD_OUT_KINDS.iter().copied().cycle().take(15).collect();
    let maps = scoring_maps(&kinds, &robot, settings.labels, Seed(2));
    let reach = robot.footprint.inscribed_radius_m();
    let region_settings = RegionSettings::default();
    let mut scores: [Vec<RegionScore>; 3] = [Vec::new(), Vec::new(), Vec::new()];
    for (index, (grid, labels)) in maps.iter().enumerate() {
        let clearance = DistanceField::new(grid);
        let network = predict_regions(grid, &robot.footprint, &predictor, &region_settings);
        let geometric = detect_geometric(&clearance, &robot.footprint, &region_settings.geometric);
        let mut rng = Seed(2).stream("random regions", index as u64);
        let random = random_regions(&clearance, reach, network.regions.len(), 0.5, &mut rng);
        for (scores, regions) in scores.iter_mut().zip([&network.regions, &geometric, &random]) {
            scores.push(score_regions(regions, grid.frame(), labels));
        }
        println!("{:?}: {:?}, {} regions", kinds[index], network.source, network.regions.len());
    }
    println!("| regions from | number | mu | density | precision | recall | IoU |");
    println!("|---|---|---|---|---|---|---|");
    for (name, scores) in ["network", "geometry", "random discs"].iter().zip(&scores) {
        let RegionScore { regions, mu, density, precision, recall, iou } = RegionScore::mean(scores);
        println!(
            "| {name} | {regions:.1} | {mu:.2} | {density:.2} | {precision:.2} | {recall:.2} | {iou:.2} |"
        );
    }
}

fn robot(name: &str) -> Option<LabelRobot> {
    let (half_length_m, half_width_m, steering) = match name {
        "husky" => (0.5, 0.335, Steering::RotateTranslate),
        "limo" => (0.161, 0.11, Steering::Dubins { radius_m: 0.4 }),
        _ => return None,
    };
    let footprint = Footprint::rectangle(half_length_m, half_width_m).ok()?;
    Some(LabelRobot { footprint, steering })
}
