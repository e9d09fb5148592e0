//! A robot in RON. Whatever is accepted drives, and all that it does is finite.
#![no_main]

use std::sync::Arc;

use libfuzzer_sys::fuzz_target;
use sharp_sim::{ActionSettings, KinematicSim, NoiseModel, ObstacleMap, RobotModel, RobotState, Vehicle};
use sharp_space::{OccupancyGrid, Point, Pose, Seed};

fuzz_target!(|text: &str| {
    let Ok(robot) = RobotModel::from_ron_named(text, "fuzzed") else { return };
    let grid = OccupancyGrid::from_ascii(0.5, "........\n........\n........\n........").expect("drawn");
    let robot = Arc::new(robot);
    let sim = KinematicSim::new(Arc::new(ObstacleMap::new(&grid, robot.footprint)), &robot);
    let mut vehicle = Vehicle::new(sim, robot, NoiseModel::nominal(), ActionSettings::default());
    vehicle.reset(RobotState::at_rest(Pose::new(2.0, 1.0, 0.0)), Seed(1), 0);
    for number in 0..4 {
        let at = vehicle.state().pose.position;
        let report = vehicle.act(Point::new(at.x + 0.3, at.y + 0.1 * f64::from(number)));
        let pose = report.after.pose;
        let numbers =
            [pose.position.x, pose.position.y, pose.heading.radians(), report.path_m, report.time_s];
        assert!(numbers.iter().all(|number| number.is_finite()), "{report:?}");
    }
});
