//! Stochastic simulator of wheeled robots.
//!
//! A [`RobotModel`] is data, an [`ObstacleMap`] is the map ready for queries, a [`Simulator`] moves the
//! robot a time step at a time, and a [`Vehicle`] adds controller and [`NoiseModel`]: its
//! [`act`](Vehicle::act) is one action of the paper's stochastic path planning problem, "drive at
//! this waypoint for half a second".
//!
//! ```
//! use std::sync::Arc;
//! use sharp_sim::{ActionSettings, KinematicSim, NoiseModel, ObstacleMap, RobotModel, RobotState, Vehicle};
//! use sharp_space::{OccupancyGrid, Point, Pose, Seed};
//!
//! let grid = OccupancyGrid::from_ascii(1.0, "......\n......\n......").unwrap();
//! let robot = Arc::new(RobotModel::husky());
//! let map = Arc::new(ObstacleMap::new(&grid, robot.footprint));
//! let sim = KinematicSim::new(map, &robot);
//! let mut vehicle = Vehicle::new(sim, robot, NoiseModel::nominal(), ActionSettings::default());
//! vehicle.reset(RobotState::at_rest(Pose::new(1.0, 1.5, 0.0)), Seed(1), 0);
//! let report = vehicle.act(Point::new(1.5, 1.5));
//! assert!(!report.contact && report.path_m > 0.1, "{report:?}");
//! ```
//!
//! The feature `rigid3d` adds `RigidSim`, a body with four driven wheels on rapier3d, to check the others
//! against; it is off by default, because it compiles a second engine.
//!
//! Everything random is keyed by (seed, episode, action), so a clone of a vehicle is a fork that continues
//! bit for bit as the original would. Implement [`Simulator`] to bring another simulator; [`conformance`]
//! tests it.

mod contact;
mod controller;
mod convert;
mod description;
mod kinematic;
mod noise;
mod obstacle_map;
mod planar;
mod rectangles;
#[cfg(feature = "rigid3d")]
mod rigid;
mod robot;
mod robot_file;
mod simulator;
mod state;
mod vehicle;
mod wheels;

pub mod conformance;

pub use controller::{Aim, WaypointController};
pub use description::SyntaxError;
pub use kinematic::KinematicSim;
pub use noise::{
    ActionNoise, EpisodeBias, EpisodeNoise, NoiseError, NoiseModel, STEER_PER_DRIFT_S, SlipperyPatches,
};
pub use obstacle_map::{ObstacleMap, Wall};
pub use planar::PlanarSim;
#[cfg(feature = "rigid3d")]
pub use rigid::RigidSim;
pub use robot::{Drive, RobotError, RobotModel};
pub use simulator::{ForkSimulator, Simulator, SimulatorKind, StepInfo, UnknownSimulator};
pub use state::{RobotState, WheelCommand};
pub use vehicle::{ActionReport, ActionSettings, BACK_OFF_MPS, Vehicle, VehicleSnapshot};
pub use wheels::approach;
