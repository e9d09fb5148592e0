//! The fast simulator: the wheel law and exact collision tests, no engine.
//!
//! For training and for estimates of success. In free space it moves as [`PlanarSim`](crate::PlanarSim) does;
//! an obstacle stops it, while the engine lets it push and graze.

use std::sync::Arc;

use sharp_space::{Heading, Pose, Vector, trig};

use crate::contact::ContactGuard;
use crate::obstacle_map::ObstacleMap;
use crate::robot::RobotModel;
use crate::simulator::{Simulator, StepInfo};
use crate::state::{RobotState, WheelCommand};
use crate::wheels::Wheels;

/// A robot that obstacles stop. A step that would collide leaves it where it was, at rest, with its wheels
/// still turning. A robot that starts inside an obstacle cannot move.
#[derive(Clone, Debug)]
pub struct KinematicSim {
    map: Arc<ObstacleMap>,
    wheels: Wheels,
    guard: ContactGuard,
    state: RobotState,
}

impl KinematicSim {
    /// A robot at rest at the grid's origin.
    #[must_use]
    pub fn new(map: Arc<ObstacleMap>, robot: &RobotModel) -> Self {
        let state = RobotState::at_rest(map.frame().origin);
        Self { wheels: Wheels::new(robot), guard: ContactGuard::default(), state, map }
    }
}

impl Simulator for KinematicSim {
    fn reset(&mut self, state: RobotState) {
        self.state = state;
        self.guard.forget();
    }

    fn step(&mut self, command: WheelCommand, dt_s: f64) -> StepInfo {
        self.wheels.follow(&mut self.state, command, dt_s);
        let push = self.wheels.push(&self.state, dt_s);
        let velocity = self.state.velocity + push.velocity;
        let yaw_rate_radps = self.state.yaw_rate_radps + push.yaw_rate_radps;
        let turn = yaw_rate_radps * dt_s;
        let pose = Pose::at(
            self.state.pose.to_world(velocity * dt_s),
            Heading::new(self.state.pose.heading.radians() + turn),
        );
        let moved_m = velocity.norm() * dt_s + turn.abs() * self.map.cover_reach_m();
        let is_free = self.guard.is_free(&self.map, &pose, moved_m);
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
