//! Regions of a real building: the shipped networks were trained and tuned on generated maps only.

use std::path::PathBuf;

use sharp_maps::{Door, LoadOptions, load, load_doors};
use sharp_rbvd::{Rbvd, RbvdSettings};
use sharp_regions::{RegionPredictor, RegionSettings, predict_regions, score_doors};
use sharp_sim::RobotModel;
use sharp_space::{Cell, DistanceField, Point};

/// The largest connected part of the cells where the robot's centre has room.
fn largest_part(clearance: &DistanceField, room_m: f64) -> Vec<Cell> {
    let frame = clearance.frame();
    let mut waiting: Vec<bool> =
        (0..frame.len()).map(|index| clearance.at(frame.cell(index)) >= room_m).collect();
    let mut largest = Vec::new();
    for seed in 0..frame.len() {
        if !std::mem::take(&mut waiting[seed]) {
            continue;
        }
        let mut part = vec![frame.cell(seed)];
        let mut next = 0;
        while next < part.len() {
            for cell in frame.neighbors4(part[next]) {
                if std::mem::take(&mut waiting[frame.index(cell)]) {
                    part.push(cell);
                }
            }
            next += 1;
        }
        if part.len() > largest.len() {
            largest = part;
        }
    }
    largest
}

#[test]
#[expect(
    clippy::disallowed_methods,
    reason = "real maps lie outside the repository, and the caller says where"
)]
fn regions_lie_at_the_doors_of_a_real_office_and_states_cover_it() {
    let Some(folder) = std::env::var_os("SHARP_REAL_MAPS").map(PathBuf::from) else {
        println!("skipped: SHARP_REAL_MAPS names no folder of real maps");
        return;
    };
    let folder = folder.join("utexas_bwi");
    let map = folder.join("gdc_3.yaml");
    let grid = load(map.to_str().expect("a UTF-8 path"), &LoadOptions::default()).expect("a sound map").grid;
    let doors = load_doors(&folder.join("gdc_3_doors.yaml")).expect("a sound list");
    let doors: Vec<Point> = doors.iter().map(Door::middle).collect();
    assert_eq!(doors.len(), 35, "the surveyor's doors");
    let clearance = DistanceField::new(&grid);
    for robot in [RobotModel::husky(), RobotModel::limo()] {
        let predictor = RegionPredictor::shipped_for(&robot.footprint);
        let regions =
            predict_regions(&grid, &robot.footprint, &predictor, &RegionSettings::default()).regions;
        let score = score_doors(&regions, &clearance, &robot.footprint, &doors);
        assert!(score.door_recall >= 0.9, "{}: {score:?}", robot.name);
        assert!(score.false_per_door <= 1.0, "{}: {score:?}", robot.name);

        let resolution_m = grid.frame().resolution_m;
        let settings = RbvdSettings::for_footprint(&robot.footprint, 0.5 * resolution_m, resolution_m);
        let rbvd = Rbvd::build(&clearance, &regions, &settings).expect("an office has room");
        let part = largest_part(&clearance, settings.min_clearance_m);
        let covered = part.iter().filter(|&&cell| rbvd.state_of(cell).is_some()).count();
        let share = covered as f64 / part.len() as f64;
        assert!(share >= 0.99, "{}: {share} of the largest part has a state", robot.name);
    }
}
