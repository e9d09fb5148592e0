//! Planning of guide paths: search, smooth, lead in, check; sample where that fails.

use sharp_space::{Point, Stream, Vector};

use crate::context::{Attempt, GuideContext};
use crate::inflate::GuideRobot;
use crate::path::GuidePath;
use crate::request::{GuideRequest, NoGuide};
use crate::sampled::sampled_guide;
use crate::settings::{GuideSettings, PlannerKind};

/// Plans the guide path of an option and checks it (definition 8).
///
/// The result starts and ends at the request's positions, keeps gaps under the spacing, stays in
/// allowed cells, and the robot's outline is free all along it. For a robot with a turning radius no
/// bend is tighter.
///
/// # Errors
/// Says what the last attempt failed of.
pub(crate) fn plan_guide(
    request: &GuideRequest<'_>,
    robot: &GuideRobot<'_>,
    settings: &GuideSettings,
    rng: &mut Stream,
) -> Result<GuidePath, NoGuide> {
    let context = GuideContext::new(request, robot, settings);
    context.has_length()?;
    if settings.planner == PlannerKind::ClearanceSearch {
        for attempt in attempts(settings, robot.geometry.clearance().frame().resolution_m) {
            if let Ok(guide) = context.ridge_guide(&attempt) {
                return Ok(guide);
            }
        }
    }
    let way = context.least_way()?;
    sampled_guide(&context, &way, rng)
}

/// Smooths `way`, a polyline from the request's start to its goal, into a guide path and checks it, as
/// [`plan_guide`] does with a way of its own. It passes through all `discs` (centre and radius, metres).
///
/// # Errors
/// Says what the last attempt failed of.
pub(crate) fn smooth_guide(
    (way, discs): (&[Point], &[(Point, f64)]),
    request: &GuideRequest<'_>,
    robot: &GuideRobot<'_>,
    settings: &GuideSettings,
) -> Result<GuidePath, NoGuide> {
    let context = GuideContext::new(request, robot, settings);
    context.has_length()?;
    let frame = robot.geometry.clearance().frame();
    let points: Vec<Vector> = way.iter().map(|&point| frame.to_grid(point)).collect();
    let mut last = Err(NoGuide::NoLength(request.start.position));
    for attempt in attempts(settings, frame.resolution_m) {
        last = context.smooth_guide(&context.mask(attempt.margin_m), (&points, discs), &attempt);
        if last.is_ok() {
            break;
        }
    }
    last
}

/// What is tried in turn: as set; more respect for walls; less, for a rounder path;
/// every cell. The last two let the goal's heading go.
fn attempts(settings: &GuideSettings, resolution_m: f64) -> [Attempt; 4] {
    let (weight, pull_per_m2, margin_m) =
        (settings.clearance_weight, settings.pull_per_m2, settings.margin_m);
    let base = Attempt { weight, pull_per_m2, margin_m, aim_goal: true };
    [
        base,
        Attempt { weight: 3.0 * weight, pull_per_m2: 3.0 * pull_per_m2, ..base },
        Attempt { weight: 3.0 * weight, pull_per_m2: pull_per_m2 / 3.0, aim_goal: false, ..base },
        Attempt {
            weight: 3.0 * weight,
            pull_per_m2: 3.0 * pull_per_m2,
            margin_m: -0.5 * resolution_m,
            aim_goal: false,
        },
    ]
}
