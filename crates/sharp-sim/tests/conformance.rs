//! Our simulators keep the promises of the trait, and the suite notices broken ones.

use std::sync::Arc;

use sharp_sim::conformance::{SimulatorViolation, check_simulator};
use sharp_sim::{
    KinematicSim, ObstacleMap, PlanarSim, RobotModel, RobotState, Simulator, SimulatorKind, StepInfo,
    WheelCommand,
};
use sharp_space::Heading;

/// Skid-steered, a car, round, and turning around its stern.
fn robots() -> [RobotModel; 4] {
    let tractor = "(footprint: \"[[-0.1,0.25],[-0.1,-0.25],[0.4,-0.25],[0.6,0.0],[0.4,0.25]]\", \
                   drive: Differential(), max_speed_mps: 1.0)";
    let tractor = RobotModel::from_ron_named(tractor, "tractor").expect("a robot");
    let round = RobotModel::built_in("turtlebot3").expect("built in");
    [RobotModel::husky(), RobotModel::limo(), round, tractor]
}

#[test]
fn the_kinematic_simulator_conforms() {
    for robot in robots() {
        assert_eq!(check_simulator(KinematicSim::new, &robot), Ok(()), "{}", robot.name);
    }
}

#[test]
fn the_planar_simulator_conforms() {
    for robot in robots() {
        assert_eq!(check_simulator(PlanarSim::new, &robot), Ok(()), "{}", robot.name);
    }
}

#[cfg(feature = "rigid3d")]
#[test]
fn the_rigid_simulator_conforms() {
    for robot in robots() {
        assert_eq!(check_simulator(sharp_sim::RigidSim::new, &robot), Ok(()), "{}", robot.name);
    }
}

#[test]
fn simulators_chosen_at_run_time_conform() {
    for kind in [SimulatorKind::Kinematic, SimulatorKind::Planar] {
        for robot in robots() {
            let build = |map, robot: &RobotModel| kind.build(map, robot);
            assert_eq!(check_simulator(build, &robot), Ok(()), "{kind} {}", robot.name);
        }
    }
}

/// What is wrong with a simulator.
#[derive(Clone, Copy, Debug)]
enum Fault {
    Offset,
    Memory,
    Fork,
    Creep,
    Stuck,
    Blind,
    Ghost,
    Jumpy,
}

/// A kinematic simulator with a fault.
#[derive(Debug)]
struct Faulty {
    sim: KinematicSim,
    fault: Fault,
    resets: u32,
    state: RobotState,
}

impl Faulty {
    fn new(fault: Fault, map: Arc<ObstacleMap>, robot: &RobotModel) -> Self {
        let sim = KinematicSim::new(map, robot);
        Self { state: *sim.state(), sim, fault, resets: 0 }
    }
}

impl Clone for Faulty {
    fn clone(&self) -> Self {
        let mut state = self.state;
        if matches!(self.fault, Fault::Fork) {
            state.wheel_speed_mps = 0.0;
        }
        let mut sim = self.sim.clone();
        sim.reset(state);
        Self { sim, state, ..*self }
    }
}

impl Simulator for Faulty {
    fn reset(&mut self, state: RobotState) {
        self.resets += 1;
        self.sim.reset(state);
        self.state = state;
        if matches!(self.fault, Fault::Offset) {
            self.state.pose.position.x += 1e-9;
        }
    }

    fn step(&mut self, command: WheelCommand, dt_s: f64) -> StepInfo {
        let command = match (self.fault, command) {
            (Fault::Stuck, WheelCommand::Twist { yaw_rate_radps, .. }) => {
                WheelCommand::Twist { speed_mps: 0.0, yaw_rate_radps }
            }
            (Fault::Creep, WheelCommand::Twist { speed_mps, yaw_rate_radps }) => {
                WheelCommand::Twist { speed_mps: speed_mps + 0.1, yaw_rate_radps }
            }
            (Fault::Memory, WheelCommand::Twist { speed_mps, yaw_rate_radps }) => {
                WheelCommand::Twist { speed_mps: speed_mps + 1e-9 * f64::from(self.resets), yaw_rate_radps }
            }
            _ => command,
        };
        let before = self.state.pose;
        let mut info = self.sim.step(command, dt_s);
        self.state = *self.sim.state();
        match self.fault {
            Fault::Blind => info.in_contact = false,
            Fault::Jumpy => info.in_contact = true,
            Fault::Ghost if info.in_contact => {
                self.state = RobotState::at_rest(before);
                self.state.pose.position += Heading::new(0.0).unit() * 0.1;
                self.sim.reset(self.state);
            }
            _ => {}
        }
        info
    }

    fn state(&self) -> &RobotState {
        &self.state
    }
}

#[test]
fn broken_simulators_are_noticed() {
    let husky = RobotModel::husky();
    let violation = |fault| {
        let result = check_simulator(|map, robot| Faulty::new(fault, map, robot), &husky);
        result.expect_err("the fault is there")
    };
    for (fault, expected) in [
        (Fault::Offset, "after a reset to"),
        (Fault::Memory, "step 12 after a reset differs"),
        (Fault::Fork, "in step 0 a fork differs"),
        (Fault::Creep, "told to stand still"),
        (Fault::Stuck, "told to drive ahead"),
        (Fault::Blind, "the robot drove into a wall"),
        (Fault::Ghost, "at Pose"),
        (Fault::Jumpy, "contact is reported at"),
    ] {
        let message = violation(fault).to_string();
        assert!(message.starts_with(expected), "{fault:?}: {message}");
    }
    assert!(matches!(violation(Fault::Ghost), SimulatorViolation::Inside(_)));
}
