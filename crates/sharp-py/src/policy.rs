//! Networks, and driving a robot outside.

use std::sync::{Arc, Mutex, PoisonError};

use pyo3::prelude::*;
use pyo3::types::PyBytes;
use sharp_drive::{NetworkPolicy, PolicyInterface};
use sharp_plan::{Instruction, Plan, Reading, RemoteDriver, RemoteStatus, is_placed};
use sharp_rl::{Actor, ActorScratch};

use crate::error::Raised;
use crate::map::{Triple, pose};

/// A network that drives an option.
#[pyclass(frozen, name = "Policy", module = "sharp._core")]
pub(crate) struct PyPolicy {
    option: String,
    actor: Arc<Actor>,
    interface: PolicyInterface,
}

impl PyPolicy {
    pub(crate) fn new(option: &str, network: &NetworkPolicy) -> Self {
        Self { option: option.to_owned(), actor: Arc::clone(&network.actor), interface: network.interface }
    }
}

#[pymethods]
impl PyPolicy {
    #[getter]
    fn option(&self) -> &str {
        &self.option
    }

    #[getter]
    fn observation_len(&self) -> usize {
        self.interface.observation_len()
    }

    #[getter]
    fn action_len(&self) -> usize {
        PolicyInterface::ACTION_LEN
    }

    /// The actions for observations laid end to end; 32-bit floats as bytes, in and out.
    fn act<'py>(&self, py: Python<'py>, observations: &[u8]) -> Result<Bound<'py, PyBytes>, Raised> {
        let len = self.observation_len();
        let seen = from_bytes(observations);
        if !seen.len().is_multiple_of(len) {
            let message = format!("{} numbers, expected a multiple of {len}", seen.len());
            return Err(Raised::new("USAGE", message));
        }
        let mut actions = Vec::with_capacity(seen.len() / len * PolicyInterface::ACTION_LEN);
        let mut scratch = ActorScratch::default();
        for observation in seen.chunks_exact(len) {
            let mut action = [0.0; PolicyInterface::ACTION_LEN];
            self.actor.act_mean(observation, &mut scratch, &mut action);
            actions.extend(action);
        }
        Ok(to_bytes(py, &actions))
    }
}

/// 32-bit floats of bytes.
pub(crate) fn from_bytes(bytes: &[u8]) -> Vec<f32> {
    let (words, _) = bytes.as_chunks::<4>();
    words.iter().map(|word| f32::from_le_bytes(*word)).collect()
}

/// 32-bit floats as bytes.
pub(crate) fn to_bytes<'py>(py: Python<'py>, numbers: &[f32]) -> Bound<'py, PyBytes> {
    PyBytes::new(py, &numbers.iter().flat_map(|number| number.to_le_bytes()).collect::<Vec<u8>>())
}

/// Drives a robot outside: poses in, waypoints out.
#[pyclass(frozen, name = "Driver", module = "sharp._core")]
pub(crate) struct PyDriver {
    plan: Arc<Plan>,
    recovery: bool,
    running: Mutex<Option<RemoteDriver>>,
}

/// Waypoint, speed, option and status.
type Answer = (Option<(f64, f64)>, f64, String, &'static str);

impl PyDriver {
    pub(crate) fn new(plan: &Arc<Plan>, recovery: bool) -> Self {
        Self { plan: Arc::clone(plan), recovery, running: Mutex::new(None) }
    }
}

#[pymethods]
impl PyDriver {
    /// What a robot at `at` does next. Speed and yaw rate that are not told come from the last two poses.
    fn act(&self, at: Triple, speed: Option<f64>, yaw_rate: Option<f64>) -> Result<Answer, Raised> {
        for (name, number) in [("speed", speed), ("yaw_rate", yaw_rate)] {
            if let Some(number) = number.filter(|number| !number.is_finite()) {
                let message = format!("{name} is {number}, expected a finite number");
                return Err(Raised::new("POSE_INVALID", message));
            }
        }
        let mut running = self.running.lock().unwrap_or_else(PoisonError::into_inner);
        let reading = Reading { pose: pose(at), speed_mps: speed, yaw_rate_radps: yaw_rate };
        // What it knew of the robot before stays, for the next pose may be a real one again.
        if !is_placed(&self.plan.world, &reading.pose) {
            return Ok((None, 0.0, String::new(), RemoteStatus::Lost.name()));
        }
        let begin = || RemoteDriver::new(vec![Arc::clone(&self.plan)], &reading, self.recovery);
        let Instruction { waypoint, speed_mps, option, status } =
            running.get_or_insert_with(begin).answer(&reading);
        let waypoint = waypoint.map(|pose| (pose.position.x, pose.position.y));
        Ok((waypoint, speed_mps, option.to_string(), status.name()))
    }
}
