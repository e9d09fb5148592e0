//! One action of the stochastic path planning problem: the unit that policies, learning and execution share.
//!
//! A policy picks a waypoint; the vehicle's controller drives at it for a fixed time under noise, and a
//! report says what happened.

use std::collections::VecDeque;
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use sharp_space::{Point, Seed};

use crate::controller::WaypointController;
use crate::noise::{ActionNoise, EpisodeBias, EpisodeNoise, NoiseModel};
use crate::robot::{Drive, RobotModel};
use crate::simulator::Simulator;
use crate::state::{RobotState, WheelCommand};

/// Speed of backing off, metres per second: slow, because an obstacle is near.
pub const BACK_OFF_MPS: f64 = 0.3;

/// How an action is timed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ActionSettings {
    /// Time step of the simulator, seconds.
    pub dt_s: f64,
    /// Rate of the controller, hertz; a whole number of steps lies between two of its ticks.
    pub control_hz: f64,
    /// How long a waypoint is held, seconds; a whole number of control periods.
    pub action_s: f64,
    /// True if an action ends at the first contact.
    pub stop_at_contact: bool,
}

impl Default for ActionSettings {
    fn default() -> Self {
        Self { dt_s: 1.0 / 60.0, control_hz: 20.0, action_s: 0.5, stop_at_contact: true }
    }
}

impl ActionSettings {
    fn steps_per_control(&self) -> u32 {
        (1.0 / (self.control_hz * self.dt_s)).round().max(1.0) as u32
    }

    fn controls_per_action(&self) -> u32 {
        (self.action_s * self.control_hz).round().max(1.0) as u32
    }
}

/// A robot with its controller and its noise in a simulator; a clone is a fork.
#[derive(Clone, Debug)]
pub struct Vehicle<S> {
    sim: S,
    robot: Arc<RobotModel>,
    controller: WaypointController,
    settings: ActionSettings,
    model: NoiseModel,
    noise: EpisodeNoise,
    seed: Seed,
    episode: u64,
    /// Number of the next action; keys its noise.
    action: u64,
    /// Commands under way to the wheels, oldest first.
    delayed: VecDeque<WheelCommand>,
}

/// The result of an action.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ActionReport {
    /// The state at its beginning.
    pub before: RobotState,
    /// The state at its end.
    pub after: RobotState,
    /// True if the robot was in contact at any step. After backing off: if it still was in contact at the
    /// end.
    pub contact: bool,
    /// How long it took, seconds.
    pub time_s: f64,
    /// Length of the path driven, metres.
    pub path_m: f64,
}

/// Everything that changes in a [`Vehicle`], the simulator's contacts included. A vehicle that is restored
/// from it continues bit for bit.
#[derive(Clone, Debug)]
pub struct VehicleSnapshot<S> {
    sim: S,
    noise: EpisodeNoise,
    seed: Seed,
    episode: u64,
    action: u64,
    delayed: VecDeque<WheelCommand>,
}

impl<S: Simulator> Vehicle<S> {
    /// A robot where `sim` has it, in episode 0 of seed 0.
    #[must_use]
    pub fn new(sim: S, robot: Arc<RobotModel>, noise: NoiseModel, settings: ActionSettings) -> Self {
        let state = *sim.state();
        let mut vehicle = Self {
            sim,
            controller: WaypointController::new(&robot, settings.action_s),
            robot,
            settings,
            noise: EpisodeNoise::new(&noise, Seed(0), 0),
            model: noise,
            seed: Seed(0),
            episode: 0,
            action: 0,
            delayed: VecDeque::new(),
        };
        vehicle.reset(state, Seed(0), 0);
        vehicle
    }

    /// Begins episode number `episode` under `seed` in `state`.
    pub fn reset(&mut self, state: RobotState, seed: Seed, episode: u64) {
        self.sim.reset(state);
        self.noise = EpisodeNoise::new(&self.model, seed, episode);
        (self.seed, self.episode, self.action) = (seed, episode, 0);
        let periods = (self.model.delay_s * self.settings.control_hz).round() as usize;
        let current = match self.robot.drive {
            Drive::Differential { .. } => WheelCommand::Twist {
                speed_mps: state.wheel_speed_mps,
                yaw_rate_radps: state.wheel_yaw_rate_radps,
            },
            Drive::Ackermann { .. } => {
                WheelCommand::Steer { speed_mps: state.wheel_speed_mps, steer_rad: state.steer_rad }
            }
        };
        self.delayed.clear();
        self.delayed.extend(std::iter::repeat_n(current, periods));
    }

    /// Sets slip and pull of the episode that runs, in place of those that were drawn for it.
    pub fn set_bias(&mut self, bias: EpisodeBias) {
        self.noise = self.noise.clone().with_bias(bias);
    }

    /// Drives towards `waypoint` for one action, as fast as its distance asks for.
    pub fn act(&mut self, waypoint: Point) -> ActionReport {
        self.act_at(waypoint, self.robot.max_speed_mps)
    }

    /// Drives towards `waypoint` for one action, not faster than `speed_max_mps`. Noise changes the direction
    /// to a far waypoint less than that to a near one, so a far waypoint and a low speed keep the direction
    /// better. A waypoint that is not finite asks for a stop.
    pub fn act_at(&mut self, waypoint: Point, speed_max_mps: f64) -> ActionReport {
        let noise = self.begin_action();
        let aim = self.controller.aim(&self.state().pose, waypoint + noise.waypoint_shift, speed_max_mps);
        let mut report = self.blank_report();
        for _ in 0..self.settings.controls_per_action() {
            let command = self.controller.command(self.sim.state(), &aim);
            self.hold(command, &noise, &mut report);
            if report.contact && self.settings.stop_at_contact {
                break;
            }
        }
        self.finish(report)
    }

    /// Reverses straight by `distance_m`; gives up after twice the time it should take. A robot whose
    /// [`recovery_reverse_m`](RobotModel::recovery_reverse_m) is 0 never reverses and stays where it is.
    pub fn back_off(&mut self, distance_m: f64) -> ActionReport {
        let noise = self.begin_action();
        let distance_m = if self.robot.recovery_reverse_m > 0.0 { distance_m } else { 0.0 };
        let speed_mps = self.robot.back_off_mps();
        let command = match self.robot.drive {
            Drive::Differential { .. } => WheelCommand::Twist { speed_mps: -speed_mps, yaw_rate_radps: 0.0 },
            Drive::Ackermann { .. } => WheelCommand::Steer { speed_mps: -speed_mps, steer_rad: 0.0 },
        };
        let time_max_s = 1.0 + 2.0 * distance_m / speed_mps;
        let mut report = self.blank_report();
        let start = report.before.pose;
        // It may begin at a wall; once it is free of it, it must not touch another.
        let mut is_free = false;
        while start.distance_m(&self.state().pose) < distance_m && report.time_s < time_max_s {
            report.contact = false;
            self.hold(command, &noise, &mut report);
            if report.contact && is_free && self.settings.stop_at_contact {
                break;
            }
            is_free |= !report.contact;
        }
        self.finish(report)
    }

    /// The state of the robot.
    pub fn state(&self) -> &RobotState {
        self.sim.state()
    }

    /// The robot.
    pub fn robot(&self) -> &RobotModel {
        &self.robot
    }

    /// The noise that episodes are drawn from.
    pub fn noise(&self) -> &NoiseModel {
        &self.model
    }

    /// Slip and pull of the episode that runs: what a critic may know and a robot may not.
    pub fn bias(&self) -> EpisodeBias {
        self.noise.bias()
    }

    /// How actions are timed.
    pub fn settings(&self) -> &ActionSettings {
        &self.settings
    }

    /// Everything that changes.
    pub fn snapshot(&self) -> VehicleSnapshot<S>
    where
        S: Clone,
    {
        VehicleSnapshot {
            sim: self.sim.clone(),
            noise: self.noise.clone(),
            seed: self.seed,
            episode: self.episode,
            action: self.action,
            delayed: self.delayed.clone(),
        }
    }

    /// Continues from `snapshot`, which was taken from a vehicle of the same robot in the same world.
    pub fn restore(&mut self, snapshot: &VehicleSnapshot<S>)
    where
        S: Clone,
    {
        self.sim = snapshot.sim.clone();
        self.noise = snapshot.noise.clone();
        (self.seed, self.episode, self.action) = (snapshot.seed, snapshot.episode, snapshot.action);
        self.delayed.clone_from(&snapshot.delayed);
    }

    fn begin_action(&mut self) -> ActionNoise {
        let noise = self.noise.action(self.action);
        self.action += 1;
        noise
    }

    fn blank_report(&self) -> ActionReport {
        let state = *self.state();
        ActionReport { before: state, after: state, contact: false, time_s: 0.0, path_m: 0.0 }
    }

    fn finish(&self, report: ActionReport) -> ActionReport {
        ActionReport { after: *self.state(), ..report }
    }

    /// Sends `command` for one control period and adds what happens to `report`.
    fn hold(&mut self, command: WheelCommand, noise: &ActionNoise, report: &mut ActionReport) {
        self.delayed.push_back(command);
        let command = self.delayed.pop_front().expect("one was just pushed");
        let command = self.noise.distort(command, noise, &self.robot, self.state().pose.position);
        for _ in 0..self.settings.steps_per_control() {
            let before = self.state().pose;
            report.contact |= self.sim.step(command, self.settings.dt_s).in_contact;
            report.path_m += before.distance_m(&self.state().pose);
            report.time_s += self.settings.dt_s;
            if report.contact && self.settings.stop_at_contact {
                break;
            }
        }
    }
}
