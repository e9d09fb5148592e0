//! The rigid-body simulator: a box with four wheels on rapier's planar engine.
//!
//! The map is one static shape made of merged rectangles: a clone shares it, so a fork costs the
//! same on any map. Wheels push by the same law as in [`KinematicSim`](crate::KinematicSim); the
//! engine does contacts, friction at walls and integration.

use std::fmt;
use std::sync::Arc;

use rapier2d::dynamics::{
    CCDSolver, ImpulseJointSet, IntegrationParameters, IslandManager, MassProperties, MultibodyJointSet,
    RigidBodyBuilder, RigidBodyHandle, RigidBodySet, SoftBodySet,
};
use rapier2d::geometry::{BroadPhaseBvh, ColliderBuilder, ColliderHandle, ColliderSet, NarrowPhase};
use rapier2d::math::Vector as EngineVector;
use rapier2d::pipeline::PhysicsPipeline;
use sharp_space::{Footprint, Vector};

use crate::contact::ContactGuard;
use crate::convert::{engine_vector, our_vector};
use crate::robot::RobotModel;
use crate::simulator::{Simulator, StepInfo};
use crate::state::{Command, RobotState};
use crate::wheels::Wheels;
use crate::world::World;

/// Friction of the body against walls: a bumper that slides rather than grips.
const WALL_FRICTION: f32 = 0.3;
/// One body against fixed walls sinks as deep with two as with the engine's four, and a step costs a
/// sixth less.
const SOLVER_ITERATIONS: usize = 2;

/// A robot that pushes against obstacles and grazes them.
pub struct PlanarSim {
    world: Arc<World>,
    wheels: Wheels,
    body: Body,
    engine: Engine,
    workspace: Workspace,
    guard: ContactGuard,
    state: RobotState,
}

impl PlanarSim {
    /// A robot at rest at the grid's origin.
    #[must_use]
    pub fn new(world: Arc<World>, robot: &RobotModel) -> Self {
        let body = Body {
            footprint: robot.footprint,
            mass_kg: robot.mass_kg,
            yaw_inertia_kgm2: robot.yaw_inertia_kgm2,
        };
        let state = RobotState::at_rest(world.frame().origin);
        Self {
            wheels: Wheels::new(robot),
            engine: Engine::new(&world, &body, &state),
            workspace: Workspace::default(),
            guard: ContactGuard::default(),
            body,
            state,
            world,
        }
    }

    fn read_state(&mut self) {
        let body = &self.engine.bodies[self.engine.robot];
        self.state.pose = self.world.obstacles().in_world(body.position());
        self.state.velocity = our_vector(body.rotation().inverse_transform_vector(body.linvel()));
        self.state.yaw_rate_radps = f64::from(body.angvel());
    }
}

impl Clone for PlanarSim {
    fn clone(&self) -> Self {
        Self {
            world: self.world.clone(),
            wheels: self.wheels,
            body: self.body,
            engine: self.engine.clone(),
            workspace: Workspace::default(),
            guard: self.guard,
            state: self.state,
        }
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
        self.engine = Engine::new(&self.world, &self.body, &state);
        self.workspace = Workspace::default();
        self.guard.forget();
    }

    fn step(&mut self, command: Command, dt_s: f64) -> StepInfo {
        self.wheels.follow(&mut self.state, command, dt_s);
        let push = self.wheels.push(&self.state, dt_s);
        let before = self.state.pose;
        let touched = self.engine.step(&mut self.workspace, push.velocity, push.yaw_rate_radps, dt_s);
        self.read_state();
        let after = self.state.pose;
        let turned_rad = before.heading.turn_to(after.heading).abs();
        let moved_m = before.distance_m(&after) + turned_rad * self.world.cover_reach_m();
        let is_free = self.guard.is_free(&self.world, &after, moved_m);
        StepInfo { in_contact: touched || !is_free }
    }

    fn state(&self) -> &RobotState {
        &self.state
    }
}

/// What the engine needs to know of the robot.
#[derive(Clone, Copy)]
struct Body {
    footprint: Footprint,
    mass_kg: f64,
    yaw_inertia_kgm2: f64,
}

/// Buffers that the engine reuses; no state of the simulation.
#[derive(Default)]
struct Workspace {
    pipeline: PhysicsPipeline,
    ccd_solver: CCDSolver,
}

/// Everything in the engine that changes; cloning it forks the simulation.
#[derive(Clone)]
struct Engine {
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

impl Engine {
    fn new(world: &World, body: &Body, state: &RobotState) -> Self {
        let mut bodies = RigidBodySet::new();
        let mut colliders = ColliderSet::new();
        // Without a parent: a fixed body each would cost time at every step.
        colliders.insert(ColliderBuilder::new(world.obstacles().shape()).friction(WALL_FRICTION));
        let pose = world.obstacles().to_engine(&state.pose);
        let inertia = body.yaw_inertia_kgm2 as f32;
        let mass = MassProperties::new(EngineVector::ZERO, body.mass_kg as f32, inertia);
        let robot = bodies.insert(
            RigidBodyBuilder::dynamic()
                .pose(pose)
                .linvel(pose.rotation.transform_vector(engine_vector(state.velocity)))
                .angvel(state.yaw_rate_radps as f32)
                .additional_mass_properties(mass)
                .can_sleep(false),
        );
        let (half_length, half_width) = (body.footprint.half_length_m(), body.footprint.half_width_m());
        let shape = ColliderBuilder::cuboid(half_length as f32, half_width as f32);
        let robot_shape =
            colliders.insert_with_parent(shape.density(0.0).friction(WALL_FRICTION), robot, &mut bodies);
        Self {
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

    /// Pushes the body, moves everything on and returns true if the body was pushed back.
    fn step(&mut self, workspace: &mut Workspace, velocity: Vector, yaw: f64, dt_s: f64) -> bool {
        let body = &mut self.bodies[self.robot];
        let change = body.rotation().transform_vector(engine_vector(velocity));
        body.set_linvel(body.linvel() + change, true);
        body.set_angvel(body.angvel() + yaw as f32, true);
        self.parameters.dt = dt_s as f32;
        workspace.pipeline.step(
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
            &mut workspace.ccd_solver,
            &(),
            &(),
        );
        self.narrow_phase
            .contact_pairs_with(self.robot_shape)
            .any(|pair| pair.total_impulse_magnitude() > 0.0)
    }
}
