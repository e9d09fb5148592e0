//! A simulator of one's own, a point mass that turns at once, checked and driven by a `Vehicle`.
//!
//! `cargo run --release -p sharp-sim --example point_mass`

use std::sync::Arc;

use sharp_sim::conformance::check_simulator;
use sharp_sim::{ActionSettings, NoiseModel, ObstacleMap, RobotModel, RobotState, Simulator};
use sharp_sim::{StepInfo, Vehicle, WheelCommand};
use sharp_space::{OccupancyGrid, Point, Pose, Seed, Vector};

/// A body without inertia in its map.
#[derive(Clone, Debug)]
struct PointRobot {
    map: Arc<ObstacleMap>,
    state: RobotState,
}

impl PointRobot {
    fn new(map: Arc<ObstacleMap>, _: &RobotModel) -> Self {
        Self { state: RobotState::at_rest(map.frame().origin), map }
    }
}

impl Simulator for PointRobot {
    fn reset(&mut self, state: RobotState) {
        self.state = state;
    }

    fn step(&mut self, command: WheelCommand, dt_s: f64) -> StepInfo {
        let (speed_mps, turn_radps) = match command {
            WheelCommand::Twist { speed_mps, yaw_rate_radps } => (speed_mps, yaw_rate_radps),
            WheelCommand::Steer { speed_mps, steer_rad } => (speed_mps, steer_rad * speed_mps),
        };
        let pose = self.state.pose;
        let heading = (pose.heading.radians() + turn_radps * dt_s).into();
        let next = Pose::at(pose.to_world(Vector::new(speed_mps * dt_s, 0.0)), heading);
        let is_free = self.map.checker().is_free(next);
        self.state =
            RobotState::rolling(if is_free { next } else { pose }, if is_free { speed_mps } else { 0.0 });
        StepInfo { in_contact: !is_free }
    }

    fn state(&self) -> &RobotState {
        &self.state
    }
}

fn main() {
    let robot = RobotModel::husky();
    assert_eq!(check_simulator(PointRobot::new, &robot), Ok(()));
    let grid = OccupancyGrid::from_ascii(1.0, "......\n......\n......").expect("the drawing is sound");
    let sim = PointRobot::new(Arc::new(ObstacleMap::new(&grid, robot.footprint)), &robot);
    let mut vehicle = Vehicle::new(sim, Arc::new(robot), NoiseModel::nominal(), ActionSettings::default());
    vehicle.reset(RobotState::at_rest(Pose::new(1.0, 1.5, 0.0)), Seed(1), 0);
    let reached =
        (0..30).any(|_| (vehicle.act(Point::new(4.5, 1.5)).after.pose.position.x - 4.5).abs() < 0.2);
    assert!(reached, "{:?}", vehicle.state());
}
