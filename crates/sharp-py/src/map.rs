//! Maps and robots.

use pyo3::prelude::*;
use pyo3::types::PyBytes;
use sharp_bench::named;
use sharp_maps::{LoadOptions, MapFile, load};
use sharp_sim::{Drive, RobotModel};
use sharp_space::{GridFrame, Occupancy, OccupancyGrid, Pose};

use crate::error::Raised;

/// A pose as Python has it: x and y in metres, yaw in radians.
pub(crate) type Triple = (f64, f64, f64);

/// The pose of a triple.
pub(crate) fn pose((x, y, yaw): Triple) -> Pose {
    Pose::new(x, y, yaw)
}

/// The triple of a pose.
pub(crate) fn triple(pose: &Pose) -> Triple {
    (pose.position.x, pose.position.y, pose.heading.radians())
}

/// An occupancy map with its place in the world.
#[pyclass(frozen, name = "Map", module = "sharp._core")]
pub(crate) struct PyMap {
    pub(crate) file: MapFile,
}

#[pymethods]
impl PyMap {
    /// Reads the map that `spec` names: a file, or one of the project's own environments.
    #[staticmethod]
    fn load(
        spec: &str,
        resolution: Option<f64>,
        unknown_free: bool,
        allow_outside: bool,
    ) -> Result<Self, Raised> {
        let options = LoadOptions { resolution_m: resolution, unknown_free, allow_outside };
        Ok(Self { file: load(spec, &options)? })
    }

    /// A map of cells, row 0 at the bottom: 0 free, 100 occupied, -1 unknown, as signed bytes.
    #[staticmethod]
    fn from_cells(
        cells: &[u8],
        size: (usize, usize),
        resolution: f64,
        origin: Triple,
        name: &str,
    ) -> Result<Self, Raised> {
        let (width, height) = size;
        let frame = GridFrame { origin: pose(origin), resolution_m: resolution, width, height };
        let occupancy = |&cell: &u8| match cell {
            0 => Occupancy::Free,
            100 => Occupancy::Occupied,
            _ => Occupancy::Unknown,
        };
        let grid = OccupancyGrid::new(frame, cells.iter().map(occupancy).collect())
            .map_err(|error| Raised::new("MAP_INVALID", error))?;
        let picture = *grid.frame();
        let file =
            MapFile { name: name.to_owned(), grid, problems: Vec::new(), warnings: Vec::new(), picture };
        Ok(Self { file })
    }

    #[getter]
    fn name(&self) -> &str {
        &self.file.name
    }

    /// Width and height in cells.
    #[getter]
    fn size(&self) -> (usize, usize) {
        let frame = self.file.grid.frame();
        (frame.width, frame.height)
    }

    #[getter]
    fn resolution(&self) -> f64 {
        self.file.grid.frame().resolution_m
    }

    #[getter]
    fn origin(&self) -> Triple {
        triple(&self.file.grid.frame().origin)
    }

    #[getter]
    fn warnings(&self) -> Vec<String> {
        self.file.warnings.clone()
    }

    /// Starts and goals that belong to one of the project's own environments.
    #[getter]
    fn problems(&self) -> Vec<(Triple, Triple)> {
        self.file.problems.iter().map(|problem| (triple(&problem.start), triple(&problem.goal))).collect()
    }

    /// The cells as `from_cells` takes them.
    fn cells<'py>(&self, py: Python<'py>) -> Bound<'py, PyBytes> {
        let byte = |cell: &Occupancy| match cell {
            Occupancy::Free => 0,
            Occupancy::Occupied => 100,
            Occupancy::Unknown => u8::MAX,
        };
        PyBytes::new(py, &self.file.grid.cells().iter().map(byte).collect::<Vec<u8>>())
    }
}

/// A robot: its outline, its drive and its limits.
#[pyclass(frozen, name = "Robot", module = "sharp._core")]
pub(crate) struct PyRobot {
    pub(crate) model: RobotModel,
}

#[pymethods]
impl PyRobot {
    /// The robot called `name`, or described by the file of that name.
    #[staticmethod]
    fn load(name: &str) -> Result<Self, Raised> {
        Ok(Self { model: named::robot(name)? })
    }

    /// The robot that the text of a robot file describes.
    #[staticmethod]
    fn from_ron(text: &str) -> Result<Self, Raised> {
        let model = RobotModel::from_ron(text).map_err(|error| Raised::new("ROBOT_INVALID", error))?;
        Ok(Self { model })
    }

    #[getter]
    fn name(&self) -> &str {
        &self.model.name
    }

    /// Whole length and width of the outline, metres.
    #[getter]
    fn outline(&self) -> (f64, f64) {
        let footprint = &self.model.footprint;
        (2.0 * footprint.half_length_m(), 2.0 * footprint.half_width_m())
    }

    #[getter]
    fn max_speed(&self) -> f64 {
        self.model.max_speed_mps
    }

    #[getter]
    fn goal_tolerance(&self) -> f64 {
        self.model.goal_tolerance_m
    }

    /// Radius of the tightest bend, metres; 0 for a robot that turns in place.
    #[getter]
    fn turning_radius(&self) -> f64 {
        match self.model.drive {
            Drive::Ackermann { .. } => self.model.min_turning_radius_m(),
            Drive::Differential { .. } => 0.0,
        }
    }
}
