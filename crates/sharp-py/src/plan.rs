//! Plans: what was solved, driving it, and writing it.

use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use pyo3::prelude::*;
use pyo3::types::PyBytes;
use sharp_bench::{RunReport, Solved, clock_us, named, pictures, to_json};
use sharp_drive::{EpisodeEnd, OptionPolicy};
use sharp_export::{PlanNetwork, PlannedPath, RouteGraph, driven_mcap, networks, planned_mcap};
use sharp_maps::{LoadOptions, load};
use sharp_plan::{Execution, Moment, Plan, Recording, RunSettings, Tour, record, write_atomic};
use sharp_space::Seed;

use crate::error::Raised;
use crate::map::{PyRobot, Triple, triple};
use crate::policy::{PyDriver, PyPolicy};
use crate::solve::simulator;

/// How plans are driven.
#[derive(FromPyObject)]
struct RunOptions {
    episodes: u32,
    noise: Option<String>,
    simulator: String,
    recovery: bool,
    contact_ends: bool,
    seed: u64,
    record: Option<PathBuf>,
}

/// A drive: how it ended, and its moments as rows of 64-bit floats.
type Drive<'py> = (&'static str, Bound<'py, PyBytes>);

/// A solved problem.
#[pyclass(frozen, name = "Plan", module = "sharp._core")]
pub(crate) struct PyPlan {
    pub(crate) plan: Arc<Plan>,
    /// All that belongs into its folder; a plan that was read from one has nothing to write.
    pub(crate) solved: Option<Mutex<Solved>>,
}

#[pymethods]
impl PyPlan {
    /// Reads the plan in `folder`.
    #[staticmethod]
    fn load(folder: PathBuf) -> Result<Self, Raised> {
        let map = folder.join("map.yaml");
        let spec =
            map.to_str().ok_or_else(|| Raised::new("FILE_INVALID", "the folder's name is not printable"))?;
        let grid = load(spec, &LoadOptions::default())?.grid;
        let plans = Tour::load(&folder, &grid)?.plans;
        let [plan] = &plans[..] else {
            let message = format!(
                "{} has {} goals in a row, name one of its folders goal-N",
                folder.display(),
                plans.len()
            );
            return Err(Raised::new("USAGE", message));
        };
        Ok(Self { plan: Arc::clone(plan), solved: None })
    }

    /// Writes plan, map, pictures and report into `folder`, as `sharp solve` does.
    fn save(&self, py: Python<'_>, folder: PathBuf) -> Result<(), Raised> {
        let solved = self.solved.as_ref().ok_or_else(|| {
            Raised::new("USAGE", "this plan was read from a folder; copy that folder instead")
        })?;
        py.detach(|| {
            let mut solved = solved.lock().unwrap_or_else(PoisonError::into_inner);
            Ok(solved.write(&folder, &folder)?)
        })
    }

    #[getter]
    fn robot(&self) -> PyRobot {
        PyRobot { model: (*self.plan.world.robot).clone() }
    }

    #[getter]
    fn start(&self) -> Triple {
        triple(&self.plan.solution.query.start)
    }

    #[getter]
    fn goal(&self) -> Triple {
        triple(&self.plan.solution.query.goal)
    }

    /// The path as JSON, shaped like `nav_msgs/Path`; its legs and the prediction stand in it.
    fn path_json(&self) -> String {
        PlannedPath::new(&self.plan).to_json(&self.plan)
    }

    /// The path as rows of x, y, yaw, arc length, time, speed and leg, 64-bit floats.
    fn path<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        let rows = PlannedPath::new(&self.plan).points.into_iter().flat_map(|point| {
            let (x, y, yaw) = triple(&point.pose);
            [x, y, yaw, point.arc_m, point.time_s, point.speed_mps, point.step as f64]
        });
        floats(py, rows)
    }

    /// Drives the plan; returns the report as JSON, and the drives.
    fn run<'py>(&self, py: Python<'py>, options: RunOptions) -> PyResult<(String, Vec<Drive<'py>>)> {
        let mut settings = RunSettings::new(&self.plan, options.episodes, Seed(options.seed));
        settings.simulator = self.plan.world.simulator(simulator(&options.simulator)?);
        if let Some(noise) = &options.noise {
            settings.noise = named::noise(noise).map_err(Raised::from)?;
        }
        settings.recovery = options.recovery;
        settings.contact_ends = options.contact_ends;
        let recordings = py.detach(|| record(&self.plan, &settings, &clock_us()));
        if let Some(file) = &options.record {
            self.write_recording(file, &recordings)?;
        }
        let drives = recordings.iter().map(|recording| {
            (outcome(recording.execution.end), floats(py, recording.moments.iter().flat_map(row)))
        });
        let drives = drives.collect();
        let executions: Vec<Execution> =
            recordings.into_iter().map(|recording| recording.execution).collect();
        Ok((to_json(&RunReport::new(&self.plan, &executions)), drives))
    }

    /// The plan as a picture in SVG.
    fn picture(&self) -> String {
        pictures::plan(&self.plan, &self.plan.solution.query, &[])
    }

    /// The plan in another format: one or, for networks, several files.
    fn export<'py>(&self, py: Python<'py>, format: &str) -> PyResult<Vec<Bound<'py, PyBytes>>> {
        let plan = &*self.plan;
        let each = |encode: fn(&PlanNetwork, &Plan) -> Vec<u8>| {
            networks(plan).iter().map(|network| encode(network, plan)).collect()
        };
        let files: Vec<Vec<u8>> = py.detach(|| {
            Ok::<_, Raised>(match format {
                "csv" => vec![PlannedPath::new(plan).to_csv(plan).into_bytes()],
                "json" => vec![PlannedPath::new(plan).to_json(plan).into_bytes()],
                "mcap" => vec![planned_mcap(plan).map_err(|error| Raised::new("FILE_INVALID", error))?],
                "geojson" => vec![RouteGraph::of_plan(plan).to_geojson().into_bytes()],
                "onnx" => each(PlanNetwork::to_onnx),
                "safetensors" => each(PlanNetwork::to_safetensors),
                other => {
                    let expected = "csv, json, mcap, geojson, onnx or safetensors";
                    return Err(Raised::new("USAGE", format!("format is {other:?}, expected {expected}")));
                }
            })
        })?;
        if files.is_empty() {
            return Err(
                Raised::new("NO_NETWORK", "hand-written followers drive all legs of this plan").into()
            );
        }
        Ok(files.iter().map(|bytes| PyBytes::new(py, bytes)).collect())
    }

    /// The network that drives leg `index`.
    fn policy(&self, index: usize) -> Result<PyPolicy, Raised> {
        let step = self.step(index)?;
        match &step.learnt.policy {
            OptionPolicy::Network(network) => Ok(PyPolicy::new(&step.option.id.to_string(), network)),
            other => {
                let message =
                    format!("leg {index}, {}, is driven by a {} policy", step.option.id, other.kind());
                Err(Raised::new("NO_NETWORK", message))
            }
        }
    }

    /// What drives a robot outside along the plan.
    fn driver(&self, recovery: bool) -> PyDriver {
        PyDriver::new(&self.plan, recovery)
    }
}

impl PyPlan {
    /// Leg `index` of the plan.
    pub(crate) fn step(&self, index: usize) -> Result<&sharp_plan::PlannedOption, Raised> {
        let steps = &self.plan.solution.steps;
        steps
            .get(index)
            .ok_or_else(|| Raised::new("USAGE", format!("leg is {index}, expected 0 to {}", steps.len() - 1)))
    }

    fn write_recording(&self, file: &Path, recordings: &[Recording]) -> Result<(), Raised> {
        let bytes =
            driven_mcap(&self.plan, recordings).map_err(|error| Raised::new("FILE_INVALID", error))?;
        Ok(write_atomic(file, &bytes)?)
    }
}

/// Time, x, y, yaw, speed ahead, yaw rate.
fn row(moment: &Moment) -> [f64; 6] {
    let (x, y, yaw) = triple(&moment.state.pose);
    [moment.time_s, x, y, yaw, moment.state.speed_mps(), moment.state.yaw_rate_radps]
}

const fn outcome(end: EpisodeEnd) -> &'static str {
    match end {
        EpisodeEnd::Reached => "reached",
        EpisodeEnd::Collided => "collided",
        EpisodeEnd::TimedOut => "timed out",
        EpisodeEnd::Lost => "lost",
        EpisodeEnd::Stopped => "stopped",
    }
}

/// 64-bit floats as bytes.
fn floats<'py>(py: Python<'py>, numbers: impl IntoIterator<Item = f64>) -> Bound<'py, PyBytes> {
    PyBytes::new(py, &numbers.into_iter().flat_map(f64::to_le_bytes).collect::<Vec<u8>>())
}
