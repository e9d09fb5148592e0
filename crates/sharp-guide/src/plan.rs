//! Planning of guide paths: draft, smooth, lead in, certify; sample where that fails.

use sharp_motion::Steering;
use sharp_space::{Cell, FootprintChecker, Heading, Point, Stream, Vector};
use thiserror::Error;

use crate::path::GuidePath;
use crate::sampled::sampled_guide;
use crate::settings::{GuidePlanner, GuideSettings};
use crate::workbench::{Draft, Workbench};

/// One end of a guide.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GuideEnd {
    /// The centre of the endpoint.
    pub position: Point,
    /// At the start, how the robot stands; at the goal, the direction in which it should arrive:
    /// kept where there is room for it.
    pub heading: Option<Heading>,
}

/// What a guide is wanted for.
#[derive(Clone, Copy)]
pub struct GuideRequest<'a> {
    /// The centre of the initiation set.
    pub start: GuideEnd,
    /// The centre of the termination set.
    pub goal: GuideEnd,
    /// The cells of the states that the option may use.
    pub allowed: &'a dyn Fn(Cell) -> bool,
}

impl std::fmt::Debug for GuideRequest<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("GuideRequest")
            .field("start", &self.start)
            .field("goal", &self.goal)
            .finish_non_exhaustive()
    }
}

/// Why there is no guide.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum NoGuide {
    /// No allowed cell near the start has room for the robot.
    #[error("start ({:.2}, {:.2}) has no allowed cell with room for the robot near it", .0.x, .0.y)]
    Start(Point),
    /// No allowed cell near the goal has room for the robot.
    #[error("goal ({:.2}, {:.2}) has no allowed cell with room for the robot near it", .0.x, .0.y)]
    Goal(Point),
    /// Start and goal are the same place.
    #[error("start and goal are both at ({:.2}, {:.2})", .0.x, .0.y)]
    NoLength(Point),
    /// The allowed cells do not join start and goal.
    #[error("no way through the allowed cells is wide enough for the robot")]
    Unreachable,
    /// The best path found has a place where the outline touches an obstacle.
    #[error("the robot's outline does not fit at ({:.2}, {:.2})", .0.x, .0.y)]
    Footprint(Point),
    /// The best path found has a bend that the robot cannot drive.
    #[error("the bend at ({:.2}, {:.2}) is too sharp for the robot", .0.x, .0.y)]
    Bend(Point),
    /// The best path found leaves the allowed cells.
    #[error("the path leaves the allowed cells at ({:.2}, {:.2})", .0.x, .0.y)]
    Astray(Point),
    /// The robot cannot get from its heading at the start onto the path.
    #[error("the robot cannot turn onto the path at ({:.2}, {:.2})", .0.x, .0.y)]
    LeadIn(Point),
    /// The sampling planner found nothing within its budget.
    #[error("the sampling planner found no path in {iterations} samples")]
    Exhausted {
        /// Samples drawn.
        iterations: usize,
    },
}

/// Plans the guide path of an option and certifies it (Definition 8).
///
/// The result starts and ends at the request's positions, keeps gaps under the spacing, stays in
/// allowed cells, and the robot's outline is free all along it. For a robot with a turning radius no
/// bend is tighter.
///
/// # Errors
/// Says what the last attempt failed of.
pub fn plan_guide(
    request: &GuideRequest<'_>,
    checker: &FootprintChecker,
    steering: &Steering,
    settings: &GuideSettings,
    rng: &mut Stream,
) -> Result<GuidePath, NoGuide> {
    let bench = Workbench::new(request, checker, steering, settings);
    bench.has_length()?;
    if settings.planner == GuidePlanner::Ridge {
        for attempt in attempts(settings, checker.field().frame().resolution_m) {
            if let Ok(guide) = bench.ridge_guide(&attempt) {
                return Ok(guide);
            }
        }
    }
    let way = bench.least_way()?;
    sampled_guide(&bench, &way, rng)
}

/// Smooths `way`, a polyline from the request's start to its goal, into a guide path and certifies it, as
/// [`plan_guide`] does with a way of its own. It passes through all `discs` (centre and radius, metres).
///
/// # Errors
/// Says what the last attempt failed of.
pub fn smooth_guide(
    (way, discs): (&[Point], &[(Point, f64)]),
    request: &GuideRequest<'_>,
    checker: &FootprintChecker,
    steering: &Steering,
    settings: &GuideSettings,
) -> Result<GuidePath, NoGuide> {
    let bench = Workbench::new(request, checker, steering, settings);
    bench.has_length()?;
    let frame = checker.field().frame();
    let points: Vec<Vector> = way.iter().map(|&point| frame.to_grid(point)).collect();
    let mut last = Err(NoGuide::NoLength(request.start.position));
    for attempt in attempts(settings, frame.resolution_m) {
        last = bench.smooth_guide(&bench.floor(attempt.margin_m), (&points, discs), &attempt);
        if last.is_ok() {
            break;
        }
    }
    last
}

/// What is tried in turn: as set; more respect for walls; less, for a rounder path;
/// every cell. The last two let the goal's heading go.
fn attempts(settings: &GuideSettings, resolution_m: f64) -> [Draft; 4] {
    let (weight, pull_per_m2, margin_m) =
        (settings.clearance_weight, settings.pull_per_m2, settings.margin_m);
    let base = Draft { weight, pull_per_m2, margin_m, aim_goal: true };
    [
        base,
        Draft { weight: 3.0 * weight, pull_per_m2: 3.0 * pull_per_m2, ..base },
        Draft { weight: 3.0 * weight, pull_per_m2: pull_per_m2 / 3.0, aim_goal: false, ..base },
        Draft {
            weight: 3.0 * weight,
            pull_per_m2: 3.0 * pull_per_m2,
            margin_m: -0.5 * resolution_m,
            aim_goal: false,
        },
    ]
}
