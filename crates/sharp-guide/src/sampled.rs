//! Guides by Learn and Link inside the option's cells: the paper's planner, and the last resort.

use rand::RngExt;
use sharp_motion::{
    FromCells, MotionQuery, Path, PathOutcome, ShortcutSettings, Steering, learn_and_link, shortcut,
};
use sharp_space::{Cell, Heading, Point, Pose, Stream, Vector};

use crate::context::{Attempt, CHECK_STEP_M, GuideContext};
use crate::path::GuidePath;
use crate::request::NoGuide;
use crate::traversable::TraversableMask;

/// The least distance of two seeds, metres: about the width of a door.
const SEED_SPACING_M: f64 = 0.8;

/// Plans with the robot's kinematics inside the allowed cells, then smooths as far as that stays sound.
///
/// `way` is a attempt whose directions are used at ends that leave theirs open.
pub(crate) fn sampled_guide(
    context: &GuideContext<'_>,
    way: &[Vector],
    rng: &mut Stream,
) -> Result<GuidePath, NoGuide> {
    let attempt = Attempt {
        weight: context.settings.clearance_weight,
        pull_per_m2: context.settings.pull_per_m2,
        margin_m: -0.5 * context.robot.geometry.clearance().frame().resolution_m,
        aim_goal: false,
    };
    let mask = context.mask(attempt.margin_m);
    let path = sampled_path(context, &mask, way, rng)?;
    let frame = mask.frame();
    let points: Vec<Vector> =
        path.resample(0.2).poses().iter().map(|pose| frame.to_grid(pose.position)).collect();
    if points.len() > 1
        && let Ok(guide) = context.finish(&context.draft((&points, &[]), &attempt))
    {
        return Ok(guide);
    }
    let guide = as_driven(context, &path)?;
    context.check(&guide)?;
    Ok(guide)
}

fn sampled_path(
    context: &GuideContext<'_>,
    mask: &TraversableMask<'_>,
    way: &[Vector],
    rng: &mut Stream,
) -> Result<Path, NoGuide> {
    let cells = reachable(mask, context.request.start.position);
    let seeds = seeds(mask, &cells, context.settings.seeds, rng);
    let mut sampler =
        FromCells::new(*mask.frame(), &cells).ok_or(NoGuide::Start(context.request.start.position))?;
    let query = query(context, mask, way);
    let (steering, settings) = (&context.robot.steering, &context.settings.sampling);
    let outcome = learn_and_link(&query, &seeds, context, steering, &mut sampler, settings, rng);
    match outcome {
        PathOutcome::Solved(path) => {
            let effort = ShortcutSettings { check_step_m: CHECK_STEP_M, ..ShortcutSettings::default() };
            Ok(shortcut(&path, context, steering, &effort, rng))
        }
        PathOutcome::InvalidStart => Err(NoGuide::Footprint(query.start.position)),
        PathOutcome::InvalidGoal => Err(NoGuide::Footprint(query.goal.position)),
        PathOutcome::Exhausted { iterations } => Err(NoGuide::Exhausted { iterations }),
    }
}

/// The ends with headings: the given ones, or along the attempt.
fn query(context: &GuideContext<'_>, mask: &TraversableMask<'_>, way: &[Vector]) -> MotionQuery {
    let frame = mask.frame();
    let along = |a: Vector, b: Vector| Heading::of(frame.from_grid(b) - frame.from_grid(a));
    let (start, goal) = (context.request.start, context.request.goal);
    let near = way.len().min(8) - 1;
    let last = way.len() - 1;
    let leaving =
        start.heading.unwrap_or_else(|| context.fitting_or(start.position, along(way[0], way[near])));
    let arriving =
        goal.heading.unwrap_or_else(|| context.fitting_or(goal.position, along(way[last - near], way[last])));
    MotionQuery { start: Pose::at(start.position, leaving), goal: Pose::at(goal.position, arriving) }
}

/// The open cells that can be reached from `start`, in the order of a breadth-first search.
fn reachable(mask: &TraversableMask<'_>, start: Point) -> Vec<Cell> {
    let frame = mask.frame();
    let mut seen = vec![false; frame.len()];
    let mut cells: Vec<Cell> = mask.nearest_open(start, 1.0).into_iter().collect();
    for cell in &cells {
        seen[frame.index(*cell)] = true;
    }
    let mut next = 0;
    while next < cells.len() {
        for neighbor in frame.neighbors4(cells[next]) {
            let index = frame.index(neighbor);
            if !std::mem::replace(&mut seen[index], true) && mask.is_open(neighbor) {
                cells.push(neighbor);
            }
        }
        next += 1;
    }
    cells
}

/// At most `count` of `cells`, roomiest first, at some distance from each other, with random headings.
fn seeds(mask: &TraversableMask<'_>, cells: &[Cell], count: usize, rng: &mut Stream) -> Vec<Pose> {
    let mut ranked = cells.to_vec();
    ranked.sort_by(|a, b| mask.clearance_m(*b).total_cmp(&mask.clearance_m(*a)).then(a.cmp(b)));
    let mut seeds: Vec<Pose> = Vec::new();
    for cell in ranked {
        if seeds.len() == count {
            break;
        }
        let position = mask.frame().center(cell);
        if seeds.iter().all(|seed| (seed.position - position).norm() >= SEED_SPACING_M) {
            let heading = Heading::new(std::f64::consts::TAU * rng.random::<f64>());
            seeds.push(Pose::at(position, heading));
        }
    }
    seeds
}

/// The path itself as a guide: a car's with its headings; otherwise the corners at which the robot
/// turns in place stay sharp, and headings follow the direction of travel.
fn as_driven(context: &GuideContext<'_>, path: &Path) -> Result<GuidePath, NoGuide> {
    let spacing_m = context.settings.spacing_m;
    let no_length = |_| NoGuide::NoLength(path.start().position);
    if matches!(context.robot.steering, Steering::Dubins { .. }) {
        return GuidePath::new(path.resample(0.99 * spacing_m).poses().to_vec(), spacing_m)
            .map_err(no_length);
    }
    let mut positions: Vec<Point> = path.poses().iter().map(|pose| pose.position).collect();
    positions.dedup_by(|a, b| (*a - *b).norm() < 1e-9);
    let last = positions.len() - 1;
    let tangent = |i: usize| Heading::of(positions[(i + 1).min(last)] - positions[i.min(last.max(1) - 1)]);
    let poses = (0..=last).map(|i| Pose::at(positions[i], tangent(i))).collect();
    GuidePath::new(poses, spacing_m).map_err(no_length)
}
