//! The rigid-body simulator: a box with four wheels on rapier's planar engine.
//!
//! The map is one static shape made of merged rectangles: a clone shares it, so a fork costs the same on any
//! map. Wheels push by the same law as in [`KinematicSim`](crate::KinematicSim); the engine does contacts and
//! friction at walls. The engine exists only while a wall is near. Where nothing can be touched, it would
//! only integrate, and [`PlanarMotion::glide`] does the same, bit for bit, in a tenth of the time.

use std::fmt;
use std::sync::Arc;

use rapier2d::dynamics::{
    CCDSolver, ImpulseJointSet, IntegrationParameters, IslandManager, MassProperties, MultibodyJointSet,
    RigidBodyBuilder, RigidBodyHandle, RigidBodySet, SoftBodySet,
};
use rapier2d::geometry::{BroadPhaseBvh, ColliderBuilder, ColliderHandle, ColliderSet, NarrowPhase};
use rapier2d::math::{Pose as EnginePose, Rot2, Vector as EngineVector};
use rapier2d::pipeline::PhysicsPipeline;
use sharp_space::{Footprint, FootprintShape};

use crate::contact::ContactGuard;
use crate::convert::{engine_vector, our_vector};
use crate::obstacle_map::ObstacleMap;
use crate::robot::RobotModel;
use crate::simulator::{Simulator, StepInfo};
use crate::state::{RobotState, WheelCommand};
use crate::wheels::{WheelPush, Wheels};

/// Friction of the body against walls: a bumper that slides rather than grips.
const WALL_FRICTION: f32 = 0.3;
/// Iterations of the contact solver. With two instead of the engine's four, a body sinks no deeper into fixed
/// walls, and a step costs a sixth less.
const SOLVER_ITERATIONS: usize = 2;
/// A wall further away than this has no effect: the engine predicts contacts within 2 cm, from poses up to 2
/// cm old.
const FELT_WITHIN_M: f64 = 0.05;
/// The engine limits turns to an eighth of a circle per step; this is well below.
const TURN_MAX_RAD: f64 = 0.5;

/// A robot that pushes against obstacles and grazes them.
#[derive(Clone)]
pub struct PlanarSim {
    map: Arc<ObstacleMap>,
    wheels: Wheels,
    body: PlanarBody,
    motion: PlanarMotion,
    /// Present while a wall is near.
    engine: Option<Box<PlanarEngine>>,
    guard: ContactGuard,
    state: RobotState,
    felt_within_m: f64,
}

impl PlanarSim {
    /// A robot at rest at the grid's origin.
    #[must_use]
    pub fn new(map: Arc<ObstacleMap>, robot: &RobotModel) -> Self {
        let body = PlanarBody {
            footprint: *map.checker().footprint(),
            mass_kg: robot.mass_kg,
            yaw_inertia_kgm2: robot.yaw_inertia_kgm2,
        };
        let state = RobotState::at_rest(map.frame().origin);
        Self {
            wheels: Wheels::new(robot),
            body,
            motion: PlanarMotion::new(&map, &state),
            engine: None,
            guard: ContactGuard::default(),
            state,
            map,
            felt_within_m: FELT_WITHIN_M,
        }
    }

    /// Lets the engine move the robot and returns true if it was pushed back.
    fn move_among_walls(&mut self, dt_s: f64) -> bool {
        let engine = self
            .engine
            .get_or_insert_with(|| Box::new(PlanarEngine::new(&self.map, &self.body, &self.motion)));
        engine.step(&mut self.motion, dt_s)
    }

    fn read_state(&mut self) {
        let motion = &self.motion;
        self.state.pose = self.map.obstacles().in_world(&motion.pose);
        self.state.velocity = our_vector(motion.pose.rotation.inverse_transform_vector(motion.linvel));
        self.state.yaw_rate_radps = f64::from(motion.angvel);
    }
}

impl fmt::Debug for PlanarSim {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("PlanarSim").field("state", &self.state).finish_non_exhaustive()
    }
}

impl Simulator for PlanarSim {
    fn reset(&mut self, state: RobotState) {
        self.state = state;
        self.motion = PlanarMotion::new(&self.map, &state);
        self.engine = None;
        self.guard.forget();
    }

    fn step(&mut self, command: WheelCommand, dt_s: f64) -> StepInfo {
        self.wheels.follow(&mut self.state, command, dt_s);
        let before = self.state.pose;
        self.motion.add(&self.wheels.push(&self.state, dt_s));
        let turn_rad = f64::from(self.motion.angvel.abs()) * dt_s;
        let way_m = f64::from(self.motion.linvel.length()) * dt_s + turn_rad * self.map.cover_reach_m();
        let room_m = way_m + self.felt_within_m;
        if turn_rad < TURN_MAX_RAD && self.guard.has_room(&self.map, &before, room_m) {
            self.engine = None;
            self.motion.glide(dt_s);
            self.read_state();
            self.guard.spend(way_m);
            return StepInfo { in_contact: false };
        }
        let touched = self.move_among_walls(dt_s);
        self.read_state();
        let after = self.state.pose;
        let turned_rad = before.heading.turn_to(after.heading).abs();
        let moved_m = before.distance_m(&after) + turned_rad * self.map.cover_reach_m();
        let is_free = self.guard.is_free(&self.map, &after, moved_m);
        StepInfo { in_contact: touched || !is_free }
    }

    fn state(&self) -> &RobotState {
        &self.state
    }
}

/// How the body moves, in the engine's frame and precision.
#[derive(Clone, Copy)]
struct PlanarMotion {
    pose: EnginePose,
    linvel: EngineVector,
    angvel: f32,
}

impl PlanarMotion {
    fn new(map: &ObstacleMap, state: &RobotState) -> Self {
        let pose = map.obstacles().to_engine(&state.pose);
        Self {
            pose,
            linvel: pose.rotation.transform_vector(engine_vector(state.velocity)),
            angvel: state.yaw_rate_radps as f32,
        }
    }

    fn add(&mut self, push: &WheelPush) {
        self.linvel += self.pose.rotation.transform_vector(engine_vector(push.velocity));
        self.angvel += push.yaw_rate_radps as f32;
    }

    /// Moves as the engine does where nothing is touched: the same operations in the same order.
    fn glide(&mut self, dt_s: f64) {
        let dt_s = dt_s as f32 / SOLVER_ITERATIONS as f32;
        for _ in 0..SOLVER_ITERATIONS {
            let turn = self.angvel * dt_s;
            let Rot2 { re, im } = self.pose.rotation;
            self.pose.rotation = Rot2::from_cos_sin_unchecked(re - turn * im, im + turn * re).normalize();
            self.pose.translation += self.linvel * dt_s;
        }
    }
}

/// What the engine needs to know of the robot.
#[derive(Clone, Copy)]
struct PlanarBody {
    footprint: Footprint,
    mass_kg: f64,
    yaw_inertia_kgm2: f64,
}

/// The engine with the robot among the walls; cloning it forks the simulation.
#[derive(Clone)]
struct PlanarEngine {
    buffers: PlanarBuffers,
    parameters: IntegrationParameters,
    islands: IslandManager,
    broad_phase: BroadPhaseBvh,
    narrow_phase: NarrowPhase,
    bodies: RigidBodySet,
    colliders: ColliderSet,
    impulse_joints: ImpulseJointSet,
    multibody_joints: MultibodyJointSet,
    soft_bodies: SoftBodySet,
    robot: RigidBodyHandle,
    robot_shape: ColliderHandle,
}

impl PlanarEngine {
    fn new(map: &ObstacleMap, body: &PlanarBody, motion: &PlanarMotion) -> Self {
        let mut bodies = RigidBodySet::new();
        let mut colliders = ColliderSet::new();
        // Without a parent: a fixed body each would cost time at every step.
        colliders.insert(ColliderBuilder::new(map.obstacles().shape()).friction(WALL_FRICTION));
        let inertia = body.yaw_inertia_kgm2 as f32;
        let mass = MassProperties::new(EngineVector::ZERO, body.mass_kg as f32, inertia);
        let robot = bodies.insert(
            RigidBodyBuilder::dynamic().pose(motion.pose).additional_mass_properties(mass).can_sleep(false),
        );
        let shape = outline(&body.footprint);
        let robot_shape =
            colliders.insert_with_parent(shape.density(0.0).friction(WALL_FRICTION), robot, &mut bodies);
        Self {
            buffers: PlanarBuffers::default(),
            parameters: IntegrationParameters {
                num_solver_iterations: SOLVER_ITERATIONS,
                ..IntegrationParameters::default()
            },
            islands: IslandManager::new(),
            broad_phase: BroadPhaseBvh::new(),
            narrow_phase: NarrowPhase::new(),
            bodies,
            colliders,
            impulse_joints: ImpulseJointSet::new(),
            multibody_joints: MultibodyJointSet::new(),
            soft_bodies: SoftBodySet::new(),
            robot,
            robot_shape,
        }
    }

    /// Moves everything on by `dt_s`, the robot from `motion`; returns true if it was pushed back.
    fn step(&mut self, motion: &mut PlanarMotion, dt_s: f64) -> bool {
        let body = &mut self.bodies[self.robot];
        body.set_linvel(motion.linvel, true);
        body.set_angvel(motion.angvel, true);
        self.parameters.dt = dt_s as f32;
        self.buffers.pipeline.step(
            EngineVector::ZERO,
            &self.parameters,
            &mut self.islands,
            &mut self.broad_phase,
            &mut self.narrow_phase,
            &mut self.bodies,
            &mut self.colliders,
            &mut self.impulse_joints,
            &mut self.multibody_joints,
            &mut self.soft_bodies,
            &mut self.buffers.ccd_solver,
            &(),
            &(),
        );
        let body = &self.bodies[self.robot];
        *motion = PlanarMotion { pose: *body.position(), linvel: body.linvel(), angvel: body.angvel() };
        self.narrow_phase
            .contact_pairs_with(self.robot_shape)
            .any(|pair| pair.total_impulse_magnitude() > 0.0)
    }
}

/// The outline as the engine knows it.
fn outline(footprint: &Footprint) -> ColliderBuilder {
    match footprint.shape() {
        FootprintShape::Disc { radius_m } => ColliderBuilder::ball(radius_m as f32),
        FootprintShape::Polygon { corners } => {
            let corners = corners.iter().map(|&corner| engine_vector(corner)).collect();
            // Convex and counter-clockwise already: the engine computes no hull.
            ColliderBuilder::convex_polyline(corners).unwrap_or_else(|| cover(footprint))
        }
        _ => cover(footprint),
    }
}

fn cover(footprint: &Footprint) -> ColliderBuilder {
    ColliderBuilder::cuboid(footprint.half_length_m() as f32, footprint.half_width_m() as f32)
}

/// Buffers that the engine reuses; no state of the simulation.
#[derive(Default)]
struct PlanarBuffers {
    pipeline: PhysicsPipeline,
    ccd_solver: CCDSolver,
}

impl Clone for PlanarBuffers {
    fn clone(&self) -> Self {
        Self::default()
    }
}

#[cfg(test)]
mod tests {
    use rand::{Rng, RngExt};
    use sharp_space::{GridFrame, Heading, Occupancy, OccupancyGrid, Pose, Seed, Vector};

    use super::*;

    /// A square of 40 m with pillars of half a metre every five, turned and far from the origin.
    fn pillars() -> OccupancyGrid {
        let origin = Pose::new(100.0, -50.0, 1.0);
        let frame = GridFrame { origin, resolution_m: 0.1, width: 400, height: 400 };
        let is_pillar = |index| index % 50 < 5;
        let cells = (0..frame.len()).map(|index| match frame.cell(index) {
            cell if is_pillar(cell.col) && is_pillar(cell.row) => Occupancy::Occupied,
            _ => Occupancy::Free,
        });
        OccupancyGrid::new(frame, cells.collect()).expect("a sound grid")
    }

    fn random_command(stream: &mut impl Rng) -> WheelCommand {
        WheelCommand::Twist {
            speed_mps: stream.random_range(0.0..1.0),
            yaw_rate_radps: stream.random_range(-2.0..2.0),
        }
    }

    #[test]
    fn gliding_and_the_engine_agree_bit_for_bit_until_a_wall_is_met() {
        for (robot, dt_s) in [
            (RobotModel::husky(), 1.0 / 60.0),
            (RobotModel::husky(), 1.0 / 240.0),
            (RobotModel::limo(), 1.0 / 60.0),
            (RobotModel::limo(), 1.0 / 20.0),
        ] {
            let map = Arc::new(ObstacleMap::new(&pillars(), robot.footprint));
            let mut sim = PlanarSim::new(map.clone(), &robot);
            let mut always = PlanarSim { felt_within_m: f64::INFINITY, ..PlanarSim::new(map, &robot) };
            let stream = &mut Seed(3).stream("commands", 0);
            let (mut glided, mut near) = (0, 0);
            for _ in 0..50 {
                let start = sim.map.frame().from_grid(Vector::new(225.0, 225.0));
                let start = RobotState::rolling(Pose::at(start, Heading::new(0.3)), 0.3);
                sim.reset(start);
                always.reset(start);
                let mut command = random_command(stream);
                for step in 0..1500 {
                    if step % 40 == 0 {
                        command = random_command(stream);
                    }
                    let (ours, theirs) = (sim.step(command, dt_s), always.step(command, dt_s));
                    assert_eq!(ours, theirs, "{} at {dt_s} s, step {step}", robot.name);
                    assert_eq!(sim.state(), always.state(), "{} at {dt_s} s, step {step}", robot.name);
                    if ours.in_contact {
                        break;
                    }
                    if sim.engine.is_some() { near += 1 } else { glided += 1 }
                }
            }
            assert!(glided > 1000 && near > 100, "{}: {glided} steps glided, {near} not", robot.name);
        }
    }
}
