//! Conformance suite: what every [`Simulator`] must keep.

use std::sync::Arc;

use sharp_space::{
    CollisionChecker, Footprint, FootprintChecker, FootprintShape, GridFrame, Occupancy, OccupancyGrid, Pose,
};
use thiserror::Error;

use crate::obstacle_map::ObstacleMap;
use crate::robot::RobotModel;
use crate::simulator::{Simulator, StepInfo};
use crate::state::{RobotState, WheelCommand};

/// Time step of the suite, seconds: that of [`ActionSettings`](crate::ActionSettings).
const DT_S: f64 = 1.0 / 60.0;
/// How deep an engine may let the outline sink into a wall, metres.
const SINK_MAX_M: f64 = 0.04;
/// How far a robot at rest may creep within a second, metres and radians: engines with gravity settle.
const CREEP_MAX: f64 = 5e-3;
/// Where the wall of the suite's map begins, metres to the right of the world's origin.
const WALL_M: f64 = 2.0;

/// A promise of [`Simulator`] that an implementation does not keep.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum SimulatorViolation {
    /// After a reset the state is another one.
    #[error("after a reset to {expected:?} the state is {found:?}")]
    Reset {
        /// The state asked for.
        expected: Box<RobotState>,
        /// The state found.
        found: Box<RobotState>,
    },
    /// A drive after a reset differs from the same drive before it.
    #[error("step {step} after a reset differs from the same step before: the past was not forgotten")]
    Memory {
        /// Number of the step, from 0.
        step: usize,
    },
    /// A fork and its original went apart.
    #[error("in step {step} a fork differs from its original")]
    Fork {
        /// Number of the step after the fork, from 0.
        step: usize,
    },
    /// Told to stand still, the robot moved.
    #[error("told to stand still, the robot moved to {0:?} within a second")]
    Creep(Pose),
    /// Told to drive ahead in the open, the robot got nowhere or somewhere else.
    #[error("told to drive ahead at {speed_mps} m/s for {time_s} s, the robot moved {ahead_m} m ahead")]
    Drive {
        /// The speed asked for, metres per second.
        speed_mps: f64,
        /// For how long, seconds.
        time_s: f64,
        /// How far it got, metres.
        ahead_m: f64,
    },
    /// Contact was reported where nothing is near.
    #[error("contact is reported at {0:?}, where nothing is near")]
    FalseContact(Pose),
    /// The robot was driven into a wall, and no contact was reported.
    #[error("the robot drove into a wall up to {0:?}, and no step reported contact")]
    NoContact(Pose),
    /// The robot stands inside of a wall.
    #[error("at {0:?} the outline lies in a wall")]
    Inside(Pose),
    /// A number of the state is NaN or infinite.
    #[error("the state is not finite: {0:?}")]
    NotFinite(RobotState),
}

/// Builds simulators of `robot` with `build` and drives them through a map of the suite.
///
/// `build` must put the robot into the map that it gets.
///
/// # Errors
/// Returns the first promise of [`Simulator`] that the simulator does not keep.
pub fn check_simulator<S: Simulator>(
    build: impl Fn(Arc<ObstacleMap>, &RobotModel) -> S,
    robot: &RobotModel,
) -> Result<(), SimulatorViolation> {
    let grid = walled_square();
    let map = Arc::new(ObstacleMap::new(&grid, robot.footprint));
    let mut sim = build(map, robot);
    check_reset(&mut sim)?;
    check_rest(&mut sim)?;
    check_drive(&mut sim, robot)?;
    check_wall(&mut sim, &sunk_checker(&grid, robot))?;
    check_memory(&mut sim)?;
    check_forks(&mut sim)
}

/// A square of 10 m around the world's origin with a wall on its right.
fn walled_square() -> OccupancyGrid {
    let frame = GridFrame { origin: Pose::new(-5.0, -5.0, 0.0), resolution_m: 0.1, width: 100, height: 100 };
    let cells = (0..frame.len()).map(|index| match frame.center(frame.cell(index)).x {
        x if x > WALL_M => Occupancy::Occupied,
        _ => Occupancy::Free,
    });
    OccupancyGrid::new(frame, cells.collect()).expect("the frame is sound")
}

/// Tests an outline that is smaller by what an engine may sink in.
fn sunk_checker(grid: &OccupancyGrid, robot: &RobotModel) -> FootprintChecker {
    let own = &robot.footprint;
    let outline = match own.shape() {
        FootprintShape::Rectangle { half_length_m, half_width_m } => {
            let sunk = |half_m: f64| (half_m - SINK_MAX_M).max(0.5 * half_m);
            Footprint::rectangle(sunk(half_length_m), sunk(half_width_m))
        }
        _ => own.grown(-SINK_MAX_M.min(0.5 * own.inscribed_radius_m())),
    };
    FootprintChecker::new(grid, outline.expect("less of a footprint is one"))
}

fn ahead(speed_mps: f64) -> WheelCommand {
    WheelCommand::Twist { speed_mps, yaw_rate_radps: 0.0 }
}

/// A changing command, number `step` of a drive in bends that meets the wall.
fn bends(step: usize) -> WheelCommand {
    let turn = if (step / 40).is_multiple_of(2) { 0.6 } else { -0.8 };
    WheelCommand::Twist { speed_mps: 0.8, yaw_rate_radps: turn }
}

/// One step, after which the state must be finite.
fn step(
    sim: &mut impl Simulator,
    command: WheelCommand,
) -> Result<(StepInfo, RobotState), SimulatorViolation> {
    let info = sim.step(command, DT_S);
    let state = *sim.state();
    let RobotState { pose, velocity, yaw_rate_radps, steer_rad, wheel_speed_mps, wheel_yaw_rate_radps } =
        state;
    let rates = [velocity.x, velocity.y, yaw_rate_radps, steer_rad, wheel_speed_mps, wheel_yaw_rate_radps];
    if pose.is_finite() && rates.iter().all(|rate| rate.is_finite()) {
        Ok((info, state))
    } else {
        Err(SimulatorViolation::NotFinite(state))
    }
}

fn reset(sim: &mut impl Simulator, expected: RobotState) -> Result<(), SimulatorViolation> {
    sim.reset(expected);
    let found = *sim.state();
    if found == expected {
        return Ok(());
    }
    Err(SimulatorViolation::Reset { expected: Box::new(expected), found: Box::new(found) })
}

fn check_reset(sim: &mut impl Simulator) -> Result<(), SimulatorViolation> {
    let turning = RobotState { yaw_rate_radps: 0.3, ..RobotState::rolling(Pose::new(-3.1, 2.7, 2.0), 0.4) };
    reset(sim, turning)?;
    step(sim, ahead(0.5))?;
    reset(sim, turning)?;
    reset(sim, RobotState::at_rest(Pose::new(0.1, -0.2, -3.0)))
}

fn check_rest(sim: &mut impl Simulator) -> Result<(), SimulatorViolation> {
    let start = Pose::new(-1.0, 0.5, 1.2);
    reset(sim, RobotState::at_rest(start))?;
    for _ in 0..60 {
        step(sim, ahead(0.0))?;
    }
    let end = sim.state().pose;
    let creeps = end.distance_m(&start) > CREEP_MAX || start.heading.turn_to(end.heading).abs() > CREEP_MAX;
    if creeps { Err(SimulatorViolation::Creep(end)) } else { Ok(()) }
}

fn check_drive(sim: &mut impl Simulator, robot: &RobotModel) -> Result<(), SimulatorViolation> {
    let (start, steps) = (Pose::new(-3.5, 0.0, 0.0), 120);
    let speed_mps = (0.5 * robot.max_speed_mps).min(1.0);
    reset(sim, RobotState::at_rest(start))?;
    for _ in 0..steps {
        let (info, state) = step(sim, ahead(speed_mps))?;
        if info.in_contact {
            return Err(SimulatorViolation::FalseContact(state.pose));
        }
    }
    let (time_s, ahead_m) = (f64::from(steps) * DT_S, start.to_local(sim.state().pose.position).x);
    // Speeding up costs time, and an engine's wheels may roll a little short or long.
    if (0.2 * speed_mps * time_s..1.1 * speed_mps * time_s).contains(&ahead_m) {
        return Ok(());
    }
    Err(SimulatorViolation::Drive { speed_mps, time_s, ahead_m })
}

/// Drives into the wall straight and at an angle.
fn check_wall(sim: &mut impl Simulator, sunk: &FootprintChecker) -> Result<(), SimulatorViolation> {
    for heading_rad in [0.0, 0.4, -0.9] {
        reset(sim, RobotState::at_rest(Pose::new(0.5, 0.0, heading_rad)))?;
        let mut touched = false;
        for _ in 0..300 {
            let (info, state) = step(sim, ahead(0.8))?;
            touched |= info.in_contact;
            if !sunk.is_free(state.pose) {
                return Err(SimulatorViolation::Inside(state.pose));
            }
        }
        if !touched {
            return Err(SimulatorViolation::NoContact(sim.state().pose));
        }
    }
    Ok(())
}

fn check_memory(sim: &mut impl Simulator) -> Result<(), SimulatorViolation> {
    let start = RobotState::rolling(Pose::new(0.0, 0.3, 0.2), 0.2);
    let mut drive = || {
        reset(sim, start)?;
        (0..240).map(|number| step(sim, bends(number))).collect::<Result<Vec<_>, _>>()
    };
    let (first, second) = (drive()?, drive()?);
    match (0..first.len()).find(|&step| first[step] != second[step]) {
        Some(step) => Err(SimulatorViolation::Memory { step }),
        None => Ok(()),
    }
}

/// Forks in the open, beside the wall and in contact, and drives the original and all forks on.
fn check_forks(sim: &mut impl Simulator) -> Result<(), SimulatorViolation> {
    reset(sim, RobotState::at_rest(Pose::new(0.0, 0.3, 0.2)))?;
    let mut forks: Vec<(usize, Box<dyn Simulator>)> = Vec::new();
    for number in 0..240 {
        if number % 30 == 0 {
            forks.push((number, sim.fork()));
        }
        let expected = step(sim, bends(number))?;
        for (forked_at, fork) in &mut forks {
            if step(fork, bends(number))? != expected {
                return Err(SimulatorViolation::Fork { step: number - *forked_at });
            }
        }
    }
    Ok(())
}
