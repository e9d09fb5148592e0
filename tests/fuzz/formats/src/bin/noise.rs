//! Noise in RON. A robot under whatever is accepted drives, and all that it does is finite.
#![no_main]

use std::sync::Arc;

use libfuzzer_sys::fuzz_target;
use sharp_sim::{ActionSettings, KinematicSim, NoiseModel, ObstacleMap, RobotModel, RobotState, Vehicle};
use sharp_space::{OccupancyGrid, Point, Pose, Seed};

fuzz_target!(|text: &str| {
    let Ok(noise) = NoiseModel::from_ron(text) else { return };
    let grid = OccupancyGrid::from_ascii(0.5, "........\n........\n........\n........").expect("drawn");
    let robot = Arc::new(RobotModel::husky());
    let sim = KinematicSim::new(Arc::new(ObstacleMap::new(&grid, robot.footprint)), &robot);
    let mut vehicle = Vehicle::new(sim, robot, noise, ActionSettings::default());
    vehicle.reset(RobotState::at_rest(Pose::new(2.0, 1.0, 0.0)), Seed(1), 0);
    for _ in 0..4 {
        let report = vehicle.act(Point::new(3.0, 1.2));
        let pose = report.after.pose;
        let numbers =
            [pose.position.x, pose.position.y, pose.heading.radians(), report.path_m, report.time_s];
        assert!(numbers.iter().all(|number| number.is_finite()), "{report:?}");
    }
});
