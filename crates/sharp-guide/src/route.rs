//! Routes: guides over the whole free space, from any start to a goal, without options.
//!
//! The clearance search plans a route and checks outline and bends; where it cannot, hybrid A* searches. Both try the
//! robot with the largest safety margin first.

use std::cell::OnceCell;

use sharp_motion::{Budget, HybridSettings, MotionQuery, Path, Steering, hybrid_astar};
use sharp_space::{Heading, Point, Pose};

use crate::context::{GuideContext, first_touch, tight_bend};
use crate::inflate::GuideRobot;
use crate::join::JOINT_TURN_MAX_RAD;
use crate::path::GuidePath;
use crate::plan::{Drafts, searched_guide};
use crate::planner::largest_margin;
use crate::request::{GuideEnd, GuideRequest, NoGuide};
use crate::settings::GuideSettings;

/// Shares of the usual spacing at which the path of a car is tried as a guide.
const SPACING_SHARES: [f64; 3] = [0.99, 0.5, 0.2];
/// How far from its start a route begins that robots join which leave the start in different ways, metres.
const BEYOND_M: f64 = 3.0;
/// So far along it they have joined it, metres.
const JOINT_M: f64 = 2.0;

/// A route from `start` to within `goal_radius_m` of `goal` for each safety margin for which there is one, the largest
/// margin first. Each is planned when it is asked for; a search gives up after so many `expansions`.
pub fn routes<'a>(
    robot: &GuideRobot<'a>,
    start: Pose,
    (goal, goal_radius_m): (Point, f64),
    expansions: usize,
) -> impl Iterator<Item = GuidePath> + use<'a> {
    let budget = Budget { iterations: expansions };
    let settings = HybridSettings { budget, goal_radius_m, ..HybridSettings::default() };
    let without_margin = GuideRobot::new(robot.geometry, robot.steering);
    // Where the robot itself finds no way, one with a margin need not search.
    let (has_way, mut drafts) = (OnceCell::new(), Drafts::default());
    robot.inflated_at(Some(start)).filter_map(move |robot| {
        ridge(&robot, start, (goal, None), &mut drafts).ok().or_else(|| {
            let has_way = has_way.get_or_init(|| searched(&without_margin, start, goal, &settings).is_some());
            has_way.then(|| searched(&robot, start, goal, &settings)).flatten()
        })
    })
}

/// The same without the search by hybrid A*, arriving in the direction of `heading` where there is room: quick, and blind in places where a way must be found by manoeuvring.
/// Where there is none for a margin that was tried it says why.
pub fn ridge_routes<'a>(
    robot: &GuideRobot<'a>,
    start: Pose,
    (goal, heading): (Point, Option<Heading>),
) -> impl Iterator<Item = Result<GuidePath, NoGuide>> + use<'a> {
    let without_margin = GuideRobot::new(robot.geometry, robot.steering);
    let (is_hopeless, mut drafts) = (OnceCell::new(), Drafts::default());
    robot.inflated_at(Some(start)).filter_map(move |robot| {
        if is_hopeless.get() == Some(&true) {
            return None;
        }
        let found = ridge(&robot, start, (goal, heading), &mut drafts);
        if found.as_ref().is_err_and(NoGuide::is_hopeless) {
            is_hopeless.get_or_init(|| {
                let bare = ridge(&without_margin, start, (goal, heading), &mut drafts);
                bare.is_err_and(|reason| reason.is_hopeless())
            });
        }
        Some(found)
    })
}

/// The rest of a route from `start`, without its first metres, for the largest safety margin for which there is one: robots
/// that leave `start` in different ways can join it ([`joining`]).
///
/// # Errors
/// Says why there is none.
pub fn route_beyond(
    robot: &GuideRobot<'_>,
    start: Point,
    (goal, heading): (Point, Option<Heading>),
) -> Result<GuidePath, NoGuide> {
    let settings = GuideSettings::default();
    let way = least_way(robot, start, goal, settings.clearance_weight)?;
    let begin = way.into_iter().find(|point| (point - start).norm() >= BEYOND_M).unwrap_or(goal);
    let end = |position, heading| GuideEnd { position, heading };
    let request = GuideRequest { start: end(begin, None), goal: end(goal, heading), allowed: &|_| true };
    let without_margin = GuideRobot::new(robot.geometry, robot.steering);
    let mut robots = robot.inflated_at(None);
    let widest = robots.next().unwrap_or(without_margin);
    largest_margin(&request, widest, &robots.collect::<Vec<_>>(), &settings)
}

/// The length of the shortest way from cell to cell that the robot may fit through, metres: up to 8 % more than that of a smooth
/// way.
///
/// # Errors
/// Says why there is none.
pub fn shortest_way_m(robot: &GuideRobot<'_>, start: Point, goal: Point) -> Result<f64, NoGuide> {
    let way = least_way(robot, start, goal, 0.0)?;
    Ok(way.windows(2).map(|pair| (pair[1] - pair[0]).norm()).sum())
}

/// A way through all cells in which the robot could possibly stand; clearance has this `weight`.
fn least_way(robot: &GuideRobot<'_>, start: Point, goal: Point, weight: f64) -> Result<Vec<Point>, NoGuide> {
    let end = |position| GuideEnd { position, heading: None };
    let request = GuideRequest { start: end(start), goal: end(goal), allowed: &|_| true };
    let settings = GuideSettings { clearance_weight: weight, ..GuideSettings::default() };
    let way = GuideContext::new(&request, robot, &settings).least_way()?;
    let frame = robot.geometry.clearance().frame();
    Ok(way.into_iter().map(|point| frame.from_grid(point)).collect())
}

/// A route that begins at `start` and goes on along `route`, which begins nearby; for the largest safety margin for which there
/// is one.
#[must_use]
pub fn joining(robot: &GuideRobot<'_>, start: Pose, route: &GuidePath) -> Option<GuidePath> {
    let rest = (0..route.poses().len()).find(|&index| route.arc_m(index) >= JOINT_M)?;
    let (joint, rest) = (route.poses()[rest], &route.poses()[rest + 1..]);
    let mut drafts = Drafts::default();
    robot.inflated_at(Some(start)).find_map(|robot| {
        let first = ridge(&robot, start, (joint.position, Some(joint.heading)), &mut drafts).ok()?;
        let poses = [first.poses(), rest].concat();
        let joined = GuidePath::new(poses, route.spacing_m()).ok()?;
        let is_sound = tight_bend(&joined, robot.steering.radius_m()).is_none()
            && first.end().heading.turn_to(joint.heading).abs() <= JOINT_TURN_MAX_RAD
            && first_touch(&joined, robot.geometry).is_none();
        is_sound.then_some(joined)
    })
}

/// Along the ridge of clearance; `drafts` belong to this start and goal.
fn ridge<'a>(
    robot: &GuideRobot<'a>,
    start: Pose,
    (goal, heading): (Point, Option<Heading>),
    drafts: &mut Drafts<'a>,
) -> Result<GuidePath, NoGuide> {
    let request = GuideRequest {
        start: GuideEnd { position: start.position, heading: Some(start.heading) },
        goal: GuideEnd { position: goal, heading },
        allowed: &|_| true,
    };
    // No sampling: hybrid A* finds shorter paths, and finds them always.
    searched_guide(&request, robot, &GuideSettings::default(), drafts)
}

/// By hybrid A*.
fn searched(
    robot: &GuideRobot<'_>,
    start: Pose,
    goal: Point,
    settings: &HybridSettings,
) -> Option<GuidePath> {
    let query = MotionQuery { start, goal: Pose::at(goal, start.heading) };
    let path = hybrid_astar(&query, robot.geometry, &robot.steering, settings).path()?;
    // A car's path by way of few poses cuts its corners, so smaller spacings are tried too. For other robots the spacing changes
    // nothing.
    let shares = if matches!(robot.steering, Steering::Dubins { .. }) { &SPACING_SHARES[..] } else { &[1.0] };
    let mut guides = shares.iter().filter_map(|&share| as_guide(&path, &robot.steering, share));
    guides.find(|guide| first_touch(guide, robot.geometry).is_none())
}

/// The path as a guide: a car's with its headings, a pose each `share` of the usual spacing; otherwise the corners at which the
/// robot turns in place stay sharp, and headings follow the direction of travel.
fn as_guide(path: &Path, steering: &Steering, share: f64) -> Option<GuidePath> {
    let spacing_m = GuideSettings::default().spacing_m;
    if matches!(steering, Steering::Dubins { .. }) {
        return GuidePath::new(path.resample(share * spacing_m).poses().to_vec(), spacing_m).ok();
    }
    let mut positions: Vec<Point> = path.poses().iter().map(|pose| pose.position).collect();
    positions.dedup_by(|a, b| (*a - *b).norm() < 1e-9);
    let last = positions.len() - 1;
    let tangent = |i: usize| Heading::of(positions[(i + 1).min(last)] - positions[i.min(last.max(1) - 1)]);
    let poses = (0..=last).map(|i| Pose::at(positions[i], tangent(i))).collect();
    GuidePath::new(poses, spacing_m).ok()
}
