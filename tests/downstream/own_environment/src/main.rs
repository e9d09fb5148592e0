//! A policy for a task of one's own, learnt in the simulator in some seconds: park the robot in front of a wall.

use std::error::Error;
use std::ops::ControlFlow;
use std::sync::Arc;

use rand::{RngExt, SeedableRng};
use sharp_rl::conformance::check_environment;
use sharp_rl::{
    Actor, Environment, EnvironmentSpec, Learner, SacLearner, Step, StopRule, Stream, TrainSettings, evaluate,
};
use sharp_sim::{ActionSettings, KinematicSim, NoiseModel, ObstacleMap, RobotModel, RobotState, Vehicle};
use sharp_space::{OccupancyGrid, Point, Pose, Seed, Vector};

/// The robot must come within 0.3 m of a place; the wall behind it is to be left alone.
#[derive(Clone, Debug)]
struct Parking {
    vehicle: Vehicle<KinematicSim>,
    place: Point,
    actions: u32,
}

impl Parking {
    const ACTIONS_MAX: u32 = 25;

    fn new() -> Result<Self, Box<dyn Error>> {
        let grid = OccupancyGrid::from_ascii(0.5, &["............"; 12].join("\n"))?;
        let robot = Arc::new(RobotModel::husky());
        let map = Arc::new(ObstacleMap::new(&grid, robot.footprint));
        let simulator = KinematicSim::new(map, &robot);
        let vehicle = Vehicle::new(simulator, robot, NoiseModel::nominal(), ActionSettings::default());
        Ok(Self { vehicle, place: Point::new(5.0, 3.0), actions: 0 })
    }

    /// Where the place is, as the robot sees it, metres.
    fn offset(&self) -> Vector {
        self.vehicle.state().pose.to_local(self.place)
    }

    fn look(&self, observation: &mut [f32]) {
        let offset = self.offset();
        observation.copy_from_slice(&[offset.x as f32, offset.y as f32]);
    }
}

impl Environment for Parking {
    fn spec(&self) -> EnvironmentSpec {
        EnvironmentSpec { observation_len: 2, action_len: 2 }
    }

    fn reset(&mut self, rng: &mut Stream, observation: &mut [f32]) {
        let (y, heading) = (rng.random_range(1.5..4.5), rng.random_range(-1.5..1.5));
        let state = RobotState::at_rest(Pose::new(1.2, y, heading));
        self.vehicle.reset(state, Seed(rng.random()), 0);
        self.actions = 0;
        self.look(observation);
    }

    /// The action is a waypoint in the robot's own frame, in units of its reach.
    fn step(&mut self, action: &[f32], observation: &mut [f32]) -> Step {
        let before_m = self.offset().norm();
        let reach_m = self.vehicle.robot().waypoint_reach_m;
        let aim = Vector::new(f64::from(action[0]), f64::from(action[1])) * reach_m;
        let waypoint = self.vehicle.state().pose.to_world(aim);
        let report = self.vehicle.act(waypoint);
        self.actions += 1;
        self.look(observation);
        let success = self.offset().norm() < 0.3 && !report.contact;
        let terminated = success || report.contact;
        let truncated = !terminated && self.actions == Self::ACTIONS_MAX;
        let event = if success { 2.0 } else { f64::from(report.contact) * -2.0 };
        let reward = (before_m - self.offset().norm() - 0.02 + event) as f32;
        Step { reward, terminated, truncated, success }
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut rng = Stream::seed_from_u64(1);
    let parking = Parking::new()?;
    check_environment(&mut parking.clone(), &mut rng)?;

    let settings = TrainSettings::fast().with(|train| {
        train.sac = train.sac.clone().with(|sac| sac.hidden = vec![32, 32]);
        train.max_env_steps = 20_000;
        train.stop = StopRule::Success { rate: 0.9, episodes: 100 };
    });
    let untrained = Actor::new(parking.spec(), &settings.sac.hidden, &mut rng);
    let before = evaluate(&mut [parking.clone()], &untrained, 100, &mut rng)?.success_rate();
    let mut environments: Vec<Box<dyn Environment>> = vec![Box::new(parking.clone())];
    let trained =
        SacLearner::new(settings).learn(&mut environments, &mut rng, &mut |_| ControlFlow::Continue(()))?;
    let after = evaluate(&mut [parking], &trained.actor, 100, &mut rng)?.success_rate();
    println!("success {before} before and {after} after {} actions", trained.env_steps);
    assert!(before < 0.5 && after > 0.8, "training did not help");
    Ok(())
}
