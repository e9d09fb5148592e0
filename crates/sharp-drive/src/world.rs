//! A map and a robot in it: what stays the same while problems come and go.

use std::sync::Arc;

use sharp_guide::{GuideRobot, InflatedRobot, Steering, inflated_robots};
use sharp_sim::{ActionSettings, NoiseModel, ObstacleMap, RobotModel, Simulator, SimulatorKind, Vehicle};
use sharp_space::{FootprintChecker, OccupancyGrid, Point, Pose, RobotGeometry};

use crate::command::Command;
use crate::motion_model::MotionModel;
use crate::prior::Prior;
use crate::speed_limits::{SpeedLimits, action_share};

/// A vehicle in a simulator that is chosen at run time.
pub type AnyVehicle = Vehicle<Box<dyn Simulator>>;

/// A map and a robot in it.
#[derive(Clone, Debug)]
pub struct World {
    /// The occupancy grid.
    pub grid: Arc<OccupancyGrid>,
    /// The robot.
    pub robot: Arc<RobotModel>,
    /// Where the robot's outline fits.
    pub geometry: Arc<dyn RobotGeometry>,
    /// The map as simulators see it.
    pub obstacles: Arc<ObstacleMap>,
    /// Larger robots with wider bends, for which guides are planned first; the robot itself is the last.
    pub inflated: Arc<[InflatedRobot]>,
    /// Speed limits by place, if there are any.
    pub speed_limits: Option<Arc<SpeedLimits>>,
    /// The prior of this robot in place of the shipped one of its kind.
    pub own_prior: Option<Arc<Prior>>,
    /// What the robot's actions do, as policies expect it.
    pub(crate) model: Arc<MotionModel>,
}

impl World {
    /// The world of `robot` in `grid`, with the exact test of its rectangular outline.
    #[must_use]
    pub fn new(grid: OccupancyGrid, robot: RobotModel) -> Self {
        let geometry = Arc::new(FootprintChecker::new(&grid, robot.footprint));
        Self::with_geometry(grid, robot, geometry)
    }

    /// The same with another test of where the robot fits.
    #[must_use]
    pub fn with_geometry(grid: OccupancyGrid, robot: RobotModel, geometry: Arc<dyn RobotGeometry>) -> Self {
        let obstacles = Arc::new(ObstacleMap::with_geometry(&grid, Arc::clone(&geometry)));
        let model = Arc::new(MotionModel::new(&robot));
        let inflated = inflated_robots(&geometry, robot.min_turning_radius_m()).into();
        let (grid, robot) = (Arc::new(grid), Arc::new(robot));
        Self { grid, robot, geometry, obstacles, inflated, speed_limits: None, own_prior: None, model }
    }

    /// The same with speed limits.
    #[must_use]
    pub fn with_speed_limits(self, limits: SpeedLimits) -> Self {
        Self { speed_limits: Some(Arc::new(limits)), ..self }
    }

    /// The same with a prior of its own.
    #[must_use]
    pub fn with_prior(self, prior: Prior) -> Self {
        Self { own_prior: Some(Arc::new(prior)), ..self }
    }

    /// The prior that options begin with: the robot's own, or the shipped one of its kind.
    #[must_use]
    pub fn prior(&self) -> &Prior {
        self.own_prior.as_deref().unwrap_or_else(|| Prior::shipped(&self.robot))
    }

    /// How much of an action counts against the horizon of an option for a robot at `point`, 0 to 1.
    pub(crate) fn action_share(&self, point: Point) -> f64 {
        let limit_mps = self.speed_limits.as_ref().map_or(f64::INFINITY, |limits| limits.at(point));
        action_share(limit_mps.min(self.robot.max_speed_mps))
    }

    /// `command` for a robot at `pose`, no faster than the speed limits allow.
    #[must_use]
    pub fn held(&self, pose: &Pose, command: Command) -> Command {
        self.speed_limits.as_ref().map_or(command, |limits| limits.held(pose, command))
    }

    /// How the robot steers.
    #[must_use]
    pub fn steering(&self) -> Steering {
        Steering::of(self.robot.min_turning_radius_m())
    }

    /// The robot as guides are planned for it.
    #[must_use]
    pub fn guide_robot(&self) -> GuideRobot<'_> {
        GuideRobot { geometry: &*self.geometry, steering: self.steering(), inflated: &self.inflated }
    }

    /// A simulator of the robot in the map; vehicles drive in forks of it.
    #[must_use]
    pub fn simulator(&self, kind: SimulatorKind) -> Box<dyn Simulator> {
        kind.build(Arc::clone(&self.obstacles), &self.robot)
    }

    /// A vehicle in a fork of `simulator`; its actions end at the first contact if `contact_ends`.
    #[must_use]
    pub fn vehicle(&self, simulator: &dyn Simulator, noise: &NoiseModel, contact_ends: bool) -> AnyVehicle {
        let settings = ActionSettings { stop_at_contact: contact_ends, ..ActionSettings::default() };
        Vehicle::new(simulator.fork(), Arc::clone(&self.robot), noise.clone(), settings)
    }
}
