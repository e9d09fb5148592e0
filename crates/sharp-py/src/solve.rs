//! Solving a problem.

use std::fmt::Display;
use std::fs;
use std::path::PathBuf;
use std::sync::{Arc, Mutex};
use std::time::Duration;

use pyo3::prelude::*;
use sharp_bench::{
    AbstractionRequest, NamedProblem, SolveSettings, Solved, SpeedRule, Stopwatch, TimedMonitor, named,
    solve as solve_problem, speed_limits, to_json,
};
use sharp_drive::{Prior, World};
use sharp_maps::{LoadOptions, load_values};
use sharp_options::OptionKind;
use sharp_plan::{Method, Query};
use sharp_rbvd::CellMetric;
use sharp_sim::SimulatorKind;

use crate::error::Raised;
use crate::map::{PyMap, PyRobot, Triple, pose};
use crate::monitor::PyMonitor;
use crate::plan::PyPlan;

/// What a problem is solved with, by name.
#[derive(FromPyObject)]
pub(crate) struct Settings {
    options: String,
    learning: String,
    noise: String,
    regions: String,
    simulator: Option<String>,
    library: Option<PathBuf>,
    seed: u64,
    time_limit: Option<f64>,
    failure_cost: Option<f64>,
    goal_heading_tolerance: Option<f64>,
    speed_mask: Option<PathBuf>,
    speed_rule: (f64, f64, bool),
    prior: Option<PathBuf>,
}

/// Solves a problem; returns the report as JSON, and the plan if there is one.
#[pyfunction]
pub(crate) fn solve(
    py: Python<'_>,
    map: &PyMap,
    robot: &PyRobot,
    start: Triple,
    goal: Triple,
    settings: Settings,
    progress: Option<Py<PyAny>>,
) -> PyResult<(String, Option<PyPlan>)> {
    let problem = NamedProblem {
        map: map.file.name.clone(),
        world: settings.world(map, robot)?,
        query: Query { start: pose(start), goal: pose(goal) },
        noise: settings.noise.clone(),
        noise_model: named::noise(&settings.noise).map_err(Raised::from)?,
    };
    let limit = settings.time_limit.map(limit).transpose()?;
    let wanted = settings.wanted()?;
    let monitor = PyMonitor::new(progress);
    let solved = py.detach(|| -> Result<Solved, Raised> {
        let timed = TimedMonitor::new(Stopwatch::start("load"), limit, &monitor);
        let mut solved = solve_problem(&problem, &wanted, settings.library.as_deref().into(), &timed)?;
        solved.save_library()?;
        Ok(solved)
    });
    if let Some(raised) = monitor.into_raised() {
        return Err(raised);
    }
    let solved = solved?;
    let report = to_json(&solved.report);
    let plan = solved.plan.clone().map(Arc::new);
    Ok((report, plan.map(|plan| PyPlan { plan, solved: Some(Mutex::new(solved)) })))
}

fn limit(seconds: f64) -> Result<Duration, Raised> {
    let duration = Duration::try_from_secs_f64(seconds).ok().filter(|duration| !duration.is_zero());
    duration.ok_or_else(|| {
        Raised::new("USAGE", format!("time_limit is {seconds}, expected a positive number of seconds"))
    })
}

impl Settings {
    /// The robot in its map, with the speed limits and the prior that are asked for.
    fn world(&self, map: &PyMap, robot: &PyRobot) -> Result<World, Raised> {
        let mut world = named::world(&map.file, robot.model.clone());
        if let Some(file) = &self.speed_mask {
            let (base, multiplier, is_absolute) = self.speed_rule;
            let mask = load_values(file, &LoadOptions::default())?;
            let rule = SpeedRule { base, multiplier, is_absolute };
            let limits = speed_limits(&mask, rule, robot.model.max_speed_mps).map_err(|error| {
                Raised::new("MAP_FIELD", format!("speed_mask {}: {error}", file.display()))
            })?;
            world = world.with_speed_limits(limits);
        }
        if let Some(file) = &self.prior {
            let broken =
                |error: &dyn Display| Raised::new("FILE_INVALID", format!("{}: {error}", file.display()));
            let bytes = fs::read(file).map_err(|error| broken(&error))?;
            world = world.with_prior(Prior::from_bytes(&bytes).map_err(|error| broken(&error))?);
        }
        Ok(world)
    }

    fn wanted(&self) -> Result<SolveSettings, Raised> {
        let options = match self.options.as_str() {
            "centroid" => OptionKind::Centroid,
            "interface" => OptionKind::Interface,
            other => {
                return Err(Raised::new(
                    "USAGE",
                    format!("options is {other:?}, expected centroid or interface"),
                ));
            }
        };
        let mut method = Method::by_name(&self.learning).ok_or_else(|| {
            Raised::new(
                "USAGE",
                format!("learning is {:?}, expected fast, prior, paper or paper-tuned", self.learning),
            )
        })?;
        if let Some(seconds) = self.failure_cost {
            if !(seconds.is_finite() && seconds >= 0.0) {
                return Err(Raised::new(
                    "USAGE",
                    format!("failure_cost is {seconds}, expected seconds, 0 or more"),
                ));
            }
            method.failure_cost_s = seconds;
        }
        if let Some(tolerance_rad) = self.goal_heading_tolerance {
            if !(0.05..=std::f64::consts::PI).contains(&tolerance_rad) {
                let expected = "expected radians from 0.05 to 3.14";
                let message = format!("goal_heading_tolerance is {tolerance_rad}, {expected}");
                return Err(Raised::new("USAGE", message));
            }
            method.search.goal_heading_tolerance_rad = Some(tolerance_rad);
        }
        Ok(SolveSettings {
            abstraction: AbstractionRequest {
                options,
                regions: self.regions.clone(),
                metric: CellMetric::default(),
            },
            simulator: self.simulator.as_deref().map_or(Ok(method.simulator), simulator)?,
            method,
            seed: self.seed,
        })
    }
}

/// The simulator called `name`.
pub(crate) fn simulator(name: &str) -> Result<SimulatorKind, Raised> {
    name.parse()
        .map_err(|error: sharp_sim::UnknownSimulator| Raised::new("USAGE", format!("simulator: {error}")))
}
