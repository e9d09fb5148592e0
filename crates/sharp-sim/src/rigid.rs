//! The three-dimensional cross-check: a chassis on four motor-driven wheels on rapier3d.
//!
//! It shares the limits of commands with the other simulators, but not the wheel law: friction between balls
//! and floor moves the robot, and gravity holds it down. The skid ratio and the turning radius, which the
//! others compute, result from the contacts. Only with the feature `rigid3d`, and several times slower.

use std::fmt;
use std::sync::Arc;

use rapier3d::dynamics::{
    CCDSolver, ImpulseJointHandle, ImpulseJointSet, IntegrationParameters, IslandManager, JointAxis,
    MassProperties, MultibodyJointSet, RevoluteJointBuilder, RigidBodyBuilder, RigidBodyHandle, RigidBodySet,
    SoftBodySet,
};
use rapier3d::geometry::{
    BroadPhaseBvh, ColliderBuilder, ColliderHandle, ColliderSet, Group, InteractionGroups,
    InteractionTestMode, NarrowPhase, SharedShape,
};
use rapier3d::math::{Pose as EnginePose, Rotation, Vector as EngineVector};
use rapier3d::pipeline::PhysicsPipeline;
use sharp_space::{Footprint, Heading, Pose, Vector, trig};

use crate::contact::ContactGuard;
use crate::obstacle_map::ObstacleMap;
use crate::robot::{Drive, RobotModel};
use crate::simulator::{Simulator, StepInfo};
use crate::state::{RobotState, WheelCommand};
use crate::wheels::{GRAVITY_MPS2, Wheels};

/// Friction of the body against walls, as in [`PlanarSim`](crate::PlanarSim).
const WALL_FRICTION: f32 = 0.3;
/// Higher than any robot that fits through a door.
const WALL_HEIGHT_M: f32 = 2.0;
/// Share of the robot's mass in each wheel.
const WHEEL_MASS_SHARE: f64 = 0.05;
/// Radius of the wheels by the shorter of track and wheelbase. The robot files give no radius, because on a
/// flat floor it changes nothing.
const WHEEL_RADIUS_SHARE: f64 = 0.3;
/// Least distance between the axles, as a share of the track.
const WHEELBASE_MIN_SHARE: f64 = 0.2;
/// Damping of the wheels' motors, 1/s. The engine scales it by the joint's own inertia alone: a
/// motor of 200 leaves a wheel too weak to skid.
const MOTOR_GAIN_PS: f32 = 1e5;
/// Largest torque of a motor, as a multiple of what friction can need: friction limits the drive, and the
/// motor never does.
const MOTOR_RESERVE: f64 = 4.0;

const CHASSIS: Group = Group::GROUP_1;
const WHEELS: Group = Group::GROUP_2;
const WALLS: Group = Group::GROUP_3;
const FLOOR: Group = Group::GROUP_4;

/// A robot with four balls as wheels, which touch the floor only. Wheels of full width would climb the walls.
pub struct RigidSim {
    map: Arc<ObstacleMap>,
    wheels: Wheels,
    build: RigidBodies,
    walls: SharedShape,
    engine: RigidEngine,
    buffers: RigidBuffers,
    guard: ContactGuard,
    state: RobotState,
}

impl RigidSim {
    /// A robot at rest at the grid's origin.
    #[must_use]
    pub fn new(map: Arc<ObstacleMap>, robot: &RobotModel) -> Self {
        let build = RigidBodies::new(robot, map.checker().footprint());
        let state = RobotState::at_rest(map.frame().origin);
        let walls = extrude(&map);
        Self {
            wheels: Wheels::new(robot),
            engine: RigidEngine::new(&map, &build, walls.clone(), &state),
            buffers: RigidBuffers::default(),
            guard: ContactGuard::default(),
            build,
            walls,
            state,
            map,
        }
    }

    fn read_state(&mut self) {
        let body = &self.engine.bodies[self.engine.chassis];
        let ahead = *body.rotation() * EngineVector::X;
        let turn = Heading::of(Vector::new(f64::from(ahead.x), f64::from(ahead.y)));
        let origin = self.map.frame().origin;
        let place = body.translation();
        let heading = Heading::new(origin.heading.radians() + turn.radians());
        let position = origin.to_world(Vector::new(f64::from(place.x), f64::from(place.y)));
        self.state.pose = Pose::at(position, heading);
        let velocity = Vector::new(f64::from(body.linvel().x), f64::from(body.linvel().y));
        let unit = turn.unit();
        self.state.velocity = Vector::new(unit.dot(&velocity), unit.perp(&velocity));
        self.state.yaw_rate_radps = f64::from(body.angvel().z);
    }
}

impl Clone for RigidSim {
    fn clone(&self) -> Self {
        Self {
            map: self.map.clone(),
            wheels: self.wheels,
            build: self.build,
            walls: self.walls.clone(),
            engine: self.engine.clone(),
            buffers: RigidBuffers::default(),
            guard: self.guard,
            state: self.state,
        }
    }
}

impl fmt::Debug for RigidSim {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("RigidSim").field("state", &self.state).finish_non_exhaustive()
    }
}

impl Simulator for RigidSim {
    fn reset(&mut self, state: RobotState) {
        self.state = state;
        self.engine = RigidEngine::new(&self.map, &self.build, self.walls.clone(), &state);
        self.buffers = RigidBuffers::default();
        self.guard.forget();
    }

    fn step(&mut self, command: WheelCommand, dt_s: f64) -> StepInfo {
        self.wheels.follow(&mut self.state, command, dt_s);
        let before = self.state.pose;
        self.engine.drive(&self.build, &self.state);
        let touched = self.engine.step(&mut self.buffers, dt_s);
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

/// The robot as bodies: sizes, masses and where the wheels are.
#[derive(Clone, Copy)]
struct RigidBodies {
    drive: Drive,
    /// Of the chassis; as high as it is wide.
    half_extents: EngineVector,
    chassis_mass: MassProperties,
    wheel_mass: MassProperties,
    wheel_radius_m: f64,
    contacts: [Vector; 4],
    wheel_friction: f32,
    motor_torque_nm: f32,
}

impl RigidBodies {
    fn new(robot: &RobotModel, footprint: &Footprint) -> Self {
        // A second axle close by stands in for casters.
        let wheelbase_m = robot.wheelbase_m().max(WHEELBASE_MIN_SHARE * robot.track_m());
        let (x, y) = (wheelbase_m / 2.0, robot.track_m() / 2.0);
        let wheel_radius_m = WHEEL_RADIUS_SHARE * robot.track_m().min(wheelbase_m);
        let wheel_kg = WHEEL_MASS_SHARE * robot.mass_kg;
        let chassis_kg = robot.mass_kg - 4.0 * wheel_kg;
        let (half_length, half_width) = (footprint.half_length_m(), footprint.half_width_m());
        let half_height = half_width / 2.0;
        let ball = 0.4 * wheel_kg * wheel_radius_m * wheel_radius_m;
        // The wheels' share of the robot's inertia lies where the wheels are.
        let yaw = robot.yaw_inertia_kgm2 - 4.0 * (wheel_kg * (x * x + y * y) + ball);
        let tilt = |half: f64| (chassis_kg * (half * half + half_height * half_height) / 3.0) as f32;
        let chassis_inertia = EngineVector::new(tilt(half_width), tilt(half_length), yaw as f32);
        let grip_n = robot.wheel_friction * robot.mass_kg * GRAVITY_MPS2 / 4.0;
        Self {
            drive: robot.drive,
            half_extents: EngineVector::new(half_length as f32, half_width as f32, half_height as f32),
            chassis_mass: MassProperties::new(EngineVector::ZERO, chassis_kg as f32, chassis_inertia),
            wheel_mass: MassProperties::new(
                EngineVector::ZERO,
                wheel_kg as f32,
                EngineVector::splat(ball as f32),
            ),
            wheel_radius_m,
            contacts: [(x, y), (x, -y), (-x, y), (-x, -y)].map(|(x, y)| Vector::new(x, y)),
            wheel_friction: robot.wheel_friction as f32,
            motor_torque_nm: (MOTOR_RESERVE * grip_n * wheel_radius_m) as f32,
        }
    }

    /// How the wheel at `contact` rolls and where it points if nothing slips.
    fn roll(&self, contact: Vector, state: &RobotState) -> WheelRoll {
        let speed_mps = state.wheel_speed_mps;
        match self.drive {
            Drive::Differential { .. } => {
                WheelRoll { speed_mps: speed_mps - state.wheel_yaw_rate_radps * contact.y, angle_rad: 0.0 }
            }
            Drive::Ackermann { wheelbase_m, .. } => {
                // All wheels roll around one point on the line of the rear axle.
                let curvature = trig::tan(state.steer_rad) / wheelbase_m;
                let ahead = 1.0 - curvature * contact.y;
                let left = curvature * (contact.x + wheelbase_m / 2.0);
                WheelRoll {
                    speed_mps: speed_mps * trig::hypot(ahead, left),
                    angle_rad: trig::atan2(left, ahead),
                }
            }
        }
    }
}

/// How a wheel rolls.
#[derive(Clone, Copy)]
struct WheelRoll {
    speed_mps: f64,
    /// To the left of the chassis' axis.
    angle_rad: f64,
}

impl WheelRoll {
    /// The axis that it turns around, in the chassis' frame.
    fn axis(&self) -> EngineVector {
        let (sin, cos) = trig::sin_cos(self.angle_rad);
        EngineVector::new(-sin as f32, cos as f32, 0.0)
    }
}

/// Buffers that the engine reuses; no state of the simulation.
#[derive(Default)]
struct RigidBuffers {
    pipeline: PhysicsPipeline,
    ccd_solver: CCDSolver,
}

/// Everything in the engine that changes; cloning it forks the simulation.
#[derive(Clone)]
struct RigidEngine {
    parameters: IntegrationParameters,
    islands: IslandManager,
    broad_phase: BroadPhaseBvh,
    narrow_phase: NarrowPhase,
    bodies: RigidBodySet,
    colliders: ColliderSet,
    impulse_joints: ImpulseJointSet,
    multibody_joints: MultibodyJointSet,
    soft_bodies: SoftBodySet,
    chassis: RigidBodyHandle,
    chassis_shape: ColliderHandle,
    axles: [ImpulseJointHandle; 4],
}

impl RigidEngine {
    fn new(map: &ObstacleMap, build: &RigidBodies, walls: SharedShape, state: &RobotState) -> Self {
        let mut bodies = RigidBodySet::new();
        let mut colliders = ColliderSet::new();
        let mut joints = ImpulseJointSet::new();
        let wall_friction = ColliderBuilder::new(walls).friction(WALL_FRICTION);
        colliders.insert(wall_friction.collision_groups(groups(WALLS, CHASSIS)));
        let floor = ColliderBuilder::new(SharedShape::halfspace(EngineVector::Z));
        let floor = floor.friction(build.wheel_friction).collision_groups(groups(FLOOR, WHEELS | CHASSIS));
        colliders.insert(floor);

        let motion = RigidMotion::new(map, build, state);
        let chassis =
            bodies.insert(motion.body(Vector::zeros()).additional_mass_properties(build.chassis_mass));
        let EngineVector { x, y, z } = build.half_extents;
        // The floor stays clear of the chassis by half a wheel.
        let lift = z - 0.5 * build.wheel_radius_m as f32;
        let shape = ColliderBuilder::cuboid(x, y, z).density(0.0).friction(WALL_FRICTION);
        let shape = shape.translation(EngineVector::new(0.0, 0.0, lift));
        let shape = shape.collision_groups(groups(CHASSIS, WALLS | FLOOR));
        let chassis_shape = colliders.insert_with_parent(shape, chassis, &mut bodies);
        let axles = build.contacts.map(|contact| {
            let roll = build.roll(contact, state);
            let spin = roll.axis() * (roll.speed_mps / build.wheel_radius_m) as f32;
            let wheel = motion.body(contact).additional_mass_properties(build.wheel_mass);
            let wheel = bodies.insert(wheel.angvel(motion.angvel + motion.pose.rotation * spin));
            let ball = ColliderBuilder::ball(build.wheel_radius_m as f32).density(0.0);
            let ball = ball.friction(build.wheel_friction).collision_groups(groups(WHEELS, FLOOR));
            colliders.insert_with_parent(ball, wheel, &mut bodies);
            let anchor = EngineVector::new(contact.x as f32, contact.y as f32, 0.0);
            let axle = RevoluteJointBuilder::new(EngineVector::Y)
                .local_anchor1(anchor)
                .motor_max_force(build.motor_torque_nm);
            joints.insert(chassis, wheel, axle, true)
        });
        Self {
            parameters: IntegrationParameters::default(),
            islands: IslandManager::new(),
            broad_phase: BroadPhaseBvh::new(),
            narrow_phase: NarrowPhase::new(),
            bodies,
            colliders,
            impulse_joints: joints,
            multibody_joints: MultibodyJointSet::new(),
            soft_bodies: SoftBodySet::new(),
            chassis,
            chassis_shape,
            axles,
        }
    }

    /// Tells the motors how fast to turn and the front wheels where to point.
    fn drive(&mut self, build: &RigidBodies, state: &RobotState) {
        for (axle, contact) in self.axles.into_iter().zip(build.contacts) {
            let roll = build.roll(contact, state);
            let joint = self.impulse_joints.get_mut(axle, false).expect("joints are never removed");
            joint.data.set_local_axis1(roll.axis());
            let spin_radps = (roll.speed_mps / build.wheel_radius_m) as f32;
            joint.data.set_motor_velocity(JointAxis::AngX, spin_radps, MOTOR_GAIN_PS);
        }
    }

    /// Moves everything and returns true if the chassis was pushed back.
    fn step(&mut self, buffers: &mut RigidBuffers, dt_s: f64) -> bool {
        self.parameters.dt = dt_s as f32;
        buffers.pipeline.step(
            EngineVector::new(0.0, 0.0, -GRAVITY_MPS2 as f32),
            &self.parameters,
            &mut self.islands,
            &mut self.broad_phase,
            &mut self.narrow_phase,
            &mut self.bodies,
            &mut self.colliders,
            &mut self.impulse_joints,
            &mut self.multibody_joints,
            &mut self.soft_bodies,
            &mut buffers.ccd_solver,
            &(),
            &(),
        );
        self.narrow_phase
            .contact_pairs_with(self.chassis_shape)
            .any(|pair| pair.total_impulse_magnitude() > 0.0)
    }
}

/// Where the robot is and how it moves when a simulation begins.
struct RigidMotion {
    /// Of the chassis, at the height of the axles, seen from the grid's lower-left corner.
    pose: EnginePose,
    linvel: EngineVector,
    angvel: EngineVector,
}

impl RigidMotion {
    fn new(map: &ObstacleMap, build: &RigidBodies, state: &RobotState) -> Self {
        let origin = map.frame().origin;
        let place = origin.to_local(state.pose.position);
        let turn = origin.heading.turn_to(state.pose.heading) as f32;
        let height = build.wheel_radius_m as f32;
        let pose = EnginePose::from_parts(
            EngineVector::new(place.x as f32, place.y as f32, height),
            Rotation::from_rotation_z(turn),
        );
        let velocity = EngineVector::new(state.velocity.x as f32, state.velocity.y as f32, 0.0);
        Self {
            linvel: pose.rotation * velocity,
            angvel: EngineVector::new(0.0, 0.0, state.yaw_rate_radps as f32),
            pose,
        }
    }

    /// A body at `offset` from the chassis that moves along with it.
    fn body(&self, offset: Vector) -> RigidBodyBuilder {
        let arm = self.pose.rotation * EngineVector::new(offset.x as f32, offset.y as f32, 0.0);
        RigidBodyBuilder::dynamic()
            .pose(EnginePose::from_parts(self.pose.translation + arm, self.pose.rotation))
            .linvel(self.linvel + self.angvel.cross(arm))
            .angvel(self.angvel)
            .can_sleep(false)
    }
}

/// The walls of `world` as one shape: a clone of the simulation shares it.
fn extrude(map: &ObstacleMap) -> SharedShape {
    let blocks = map.walls().map(|wall| {
        let center = EngineVector::new(wall.center.x as f32, wall.center.y as f32, WALL_HEIGHT_M / 2.0);
        let (x, y) = (wall.half_extents.x as f32, wall.half_extents.y as f32);
        let block = SharedShape::cuboid(x, y, WALL_HEIGHT_M / 2.0);
        (EnginePose::from_parts(center, Rotation::IDENTITY), block)
    });
    SharedShape::compound(blocks.collect())
}

/// Member of `member`, touching members of `others`.
const fn groups(member: Group, others: Group) -> InteractionGroups {
    InteractionGroups::new(member, others, InteractionTestMode::And)
}
