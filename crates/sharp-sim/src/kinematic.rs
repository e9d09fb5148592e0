//! The fast simulator: the wheel law and exact collision tests, no engine.
//!
//! For training, certification and rollouts. In free space it moves as [`PlanarSim`](crate::PlanarSim)
//! does; an obstacle stops it, where the engine would let it push and graze.

use std::sync::Arc;

use sharp_space::{Heading, Pose, Vector, trig};

use crate::contact::ContactGuard;
use crate::robot::RobotModel;
use crate::simulator::{Simulator, StepInfo};
use crate::state::{Command, RobotState};
use crate::wheels::Wheels;
use crate::world::World;

/// A robot whose way ends at obstacles: a step that would collide leaves it where it was, at rest,
/// its wheels turning. Put inside an obstacle, it stays there.
#[derive(Clone, Debug)]
pub struct KinematicSim {
    world: Arc<World>,
    wheels: Wheels,
    guard: ContactGuard,
    state: RobotState,
}

impl KinematicSim {
    /// A robot at rest at the grid's origin.
    #[must_use]
    pub fn new(world: Arc<World>, robot: &RobotModel) -> Self {
        let state = RobotState::at_rest(world.frame().origin);
        Self { wheels: Wheels::new(robot), guard: ContactGuard::default(), state, world }
    }
}

impl Simulator for KinematicSim {
    fn reset(&mut self, state: RobotState) {
        self.state = state;
        self.guard.forget();
    }

    fn step(&mut self, command: Command, dt_s: f64) -> StepInfo {
        self.wheels.follow(&mut self.state, command, dt_s);
        let push = self.wheels.push(&self.state, dt_s);
        let velocity = self.state.velocity + push.velocity;
        let yaw_rate_radps = self.state.yaw_rate_radps + push.yaw_rate_radps;
        let turn = yaw_rate_radps * dt_s;
        let pose = Pose::at(
            self.state.pose.to_world(velocity * dt_s),
            Heading::new(self.state.pose.heading.radians() + turn),
        );
        let moved_m = velocity.norm() * dt_s + turn.abs() * self.world.cover_reach_m();
        let is_free = self.guard.is_free(&self.world, &pose, moved_m);
        if is_free {
            self.state.pose = pose;
            // The velocity stays in the world while the body turns under it.
            let (sin, cos) = trig::sin_cos(turn);
            self.state.velocity =
                Vector::new(cos * velocity.x + sin * velocity.y, cos * velocity.y - sin * velocity.x);
            self.state.yaw_rate_radps = yaw_rate_radps;
        } else {
            self.state.velocity = Vector::zeros();
            self.state.yaw_rate_radps = 0.0;
        }
        StepInfo { in_contact: !is_free }
    }

    fn state(&self) -> &RobotState {
        &self.state
    }
}
