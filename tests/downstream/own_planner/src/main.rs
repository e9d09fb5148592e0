//! Algorithm 1 with a simulator and a guide planner from outside: the robot crosses two rooms with a gap between.

use std::error::Error;
use std::sync::Arc;

use sharp_drive::World;
use sharp_guide::conformance::check_guide_planner;
use sharp_guide::{GuidePath, GuidePlanner, GuideRequest, GuideRobot, NoGuide, Steering};
use sharp_plan::{Answer, Method, Query, RunSettings, Sharp, run, success};
use sharp_sim::conformance::check_simulator;
use sharp_sim::{NoiseModel, ObstacleMap, RobotModel, RobotState, Simulator, StepInfo, WheelCommand};
use sharp_space::{
    Cell, Detection, DistanceField, Footprint, Heading, OccupancyGrid, Point, Pose, Region, RegionDetector,
    RegionId, Seed, Stream, Vector, trig,
};

const ROOMS: &str = "
    #############################
    #.............#.............#
    #.............#.............#
    #.............#.............#
    #...........................#
    #...........................#
    #...........................#
    #...........................#
    #.............#.............#
    #.............#.............#
    #.............#.............#
    #############################";

/// Largest gap between two poses of a guide, metres.
const SPACING_M: f64 = 0.2;

/// A robot without inertia: it drives exactly as it is told.
#[derive(Clone, Debug)]
struct Unicycle {
    map: Arc<ObstacleMap>,
    state: RobotState,
}

impl Unicycle {
    fn new(map: Arc<ObstacleMap>, _: &RobotModel) -> Self {
        Self { state: RobotState::at_rest(map.frame().origin), map }
    }
}

impl Simulator for Unicycle {
    fn reset(&mut self, state: RobotState) {
        self.state = state;
    }

    fn step(&mut self, command: WheelCommand, dt_s: f64) -> StepInfo {
        let (speed_mps, turn_radps) = match command {
            WheelCommand::Twist { speed_mps, yaw_rate_radps } => (speed_mps, yaw_rate_radps),
            WheelCommand::Steer { speed_mps, steer_rad } => (speed_mps, steer_rad * speed_mps),
        };
        let pose = self.state.pose;
        let heading = Heading::new(pose.heading.radians() + turn_radps * dt_s);
        let next = Pose::at(pose.to_world(Vector::new(speed_mps * dt_s, 0.0)), heading);
        let is_free = self.map.checker().is_free(next);
        self.state = match is_free {
            true => RobotState::rolling(next, speed_mps),
            false => RobotState::at_rest(pose),
        };
        StepInfo { in_contact: !is_free }
    }

    fn state(&self) -> &RobotState {
        &self.state
    }
}

/// Drives straight, or around one corner: by way of the cell that makes the shortest detour.
#[derive(Debug)]
struct OneCorner;

impl GuidePlanner for OneCorner {
    fn plan(
        &self,
        request: &GuideRequest<'_>,
        robot: &GuideRobot<'_>,
        _: &mut Stream,
    ) -> Result<GuidePath, NoGuide> {
        let (from, to) = (request.start.position, request.goal.position);
        if robot.steering != Steering::RotateTranslate {
            return Err(NoGuide::Bend(from));
        }
        if let Some(poses) = straight(from, to, request, robot) {
            return GuidePath::new(poses, SPACING_M).map_err(|_| NoGuide::NoLength(from));
        }
        let frame = robot.geometry.clearance().frame();
        let cells = (0..frame.len()).map(|index| frame.cell(index)).filter(|&cell| (request.allowed)(cell));
        let mut corners: Vec<Point> = cells.map(|cell| frame.center(cell)).collect();
        let length_m = |corner: &Point| (corner - from).norm() + (to - corner).norm();
        corners.sort_by(|a, b| length_m(a).total_cmp(&length_m(b)));
        let around = |&corner: &Point| {
            let mut poses = straight(from, corner, request, robot)?;
            poses.extend(straight(corner, to, request, robot)?.into_iter().skip(1));
            GuidePath::new(poses, SPACING_M).ok()
        };
        corners.iter().find_map(around).ok_or(NoGuide::Unreachable)
    }
}

/// Poses along the straight line, where it is free and allowed.
fn straight(from: Point, to: Point, request: &GuideRequest<'_>, robot: &GuideRobot<'_>) -> Option<Vec<Pose>> {
    let way = to - from;
    let heading = Heading::new(trig::atan2(way.y, way.x));
    let steps = (way.norm() / (0.9 * SPACING_M)).ceil().max(1.0) as u32;
    let pose = |i: u32| Pose::at(from + way * (f64::from(i) / f64::from(steps)), heading);
    let frame = robot.geometry.clearance().frame();
    let is_good = |pose: &Pose| {
        robot.geometry.is_free(*pose) && frame.cell_at(pose.position).is_some_and(request.allowed)
    };
    let poses: Vec<Pose> = (0..=steps).map(pose).collect();
    (way.norm() > 0.0 && poses.iter().all(is_good)).then_some(poses)
}

/// Knows its regions: one in the middle of each room and one in the gap.
#[derive(Debug)]
struct ThreePlaces;

impl RegionDetector for ThreePlaces {
    fn detect(&self, grid: &OccupancyGrid, _: &Footprint) -> Detection {
        let field = DistanceField::new(grid);
        let columns = [7, 14, 21].into_iter().zip(0..);
        let region = |(col, id)| Region::new(RegionId(id), vec![Cell::new(col, 5)], &field);
        Detection::new(columns.filter_map(region).collect(), "list")
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let robot = RobotModel::husky();
    check_simulator(Unicycle::new, &robot)?;
    check_guide_planner(&OneCorner)?;

    let world = World::new(OccupancyGrid::from_ascii(0.4, ROOMS)?, robot);
    let simulator = Unicycle::new(Arc::clone(&world.obstacles), &world.robot);
    let method = Method::fast().with_guide_planner(Arc::new(OneCorner)).with_episodes(100, 100, 100);
    let mut sharp = Sharp::new(world, ThreePlaces)
        .with_simulator(Box::new(simulator.clone()))
        .with_method(method)
        .with_noise(NoiseModel::nominal());
    let query = Query { start: Pose::new(2.0, 1.2, 0.0), goal: Pose::new(9.5, 3.6, 0.0) };
    let plan = match sharp.solve(query, &())? {
        Answer::Solved(plan) => Arc::new(*plan),
        Answer::NoPlan(reason) => return Err(reason.into()),
        Answer::Stopped => return Err("nobody stopped it".into()),
    };
    let mut settings = RunSettings::new(&plan, 50, Seed(2));
    settings.simulator = Box::new(simulator);
    let driven = success(&run(&plan, &settings, &|| 0.0));
    println!("predicted {:?}, driven {driven:?}", plan.solution.predicted);
    assert!(plan.solution.predicted.rate() > 0.9 && driven.rate() > 0.9, "two rooms and a wide gap");
    Ok(())
}
