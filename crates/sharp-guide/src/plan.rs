//! Planning of guide paths: search, smooth, lead in, check; sample where that fails.

use sharp_space::{Point, RobotGeometry, Stream, Vector};

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
    match settings.planner {
        PlannerKind::ClearanceSearch => {
            let searched = searched_guide(request, robot, settings, &mut Drafts::default());
            or_sampled(searched, request, robot, settings, rng)
        }
        PlannerKind::LearnAndLink => sample_guide(request, robot, settings, rng),
    }
}

/// What was `searched`, or a guide by samples where there is none and samples are allowed.
///
/// # Errors
/// Says what the search or else the sampling failed of.
pub(crate) fn or_sampled(
    searched: Result<GuidePath, NoGuide>,
    request: &GuideRequest<'_>,
    robot: &GuideRobot<'_>,
    settings: &GuideSettings,
    rng: &mut Stream,
) -> Result<GuidePath, NoGuide> {
    let may_sample = settings.sampling.budget.iterations > 0;
    if searched.is_ok() || !may_sample { searched } else { sample_guide(request, robot, settings, rng) }
}

/// How many ways of smoothing are tried in turn.
pub(crate) const ATTEMPTS: usize = 4;

/// Smoothed ways of one request, by outline and attempt: robots that differ in how they steer share them.
#[derive(Default)]
pub(crate) struct Drafts<'a>(Vec<Draft<'a>>);

struct Draft<'a> {
    geometry: &'a dyn RobotGeometry,
    /// The number of the attempt.
    attempt: usize,
    way: Result<Vec<Point>, NoGuide>,
}

impl<'a> Drafts<'a> {
    /// The smoothed way of `attempt` for the outline `geometry`, which `make` makes the first time.
    pub(crate) fn of(
        &mut self,
        geometry: &'a dyn RobotGeometry,
        attempt: usize,
        make: impl FnOnce() -> Result<Vec<Point>, NoGuide>,
    ) -> Result<&[Point], NoGuide> {
        let is_it =
            |draft: &Draft<'_>| std::ptr::addr_eq(draft.geometry, geometry) && draft.attempt == attempt;
        let index = self.0.iter().position(is_it).unwrap_or_else(|| {
            self.0.push(Draft { geometry, attempt, way: make() });
            self.0.len() - 1
        });
        self.0[index].way.as_deref().map_err(Clone::clone)
    }
}

/// The first part of [`plan_guide`]: along the ridge of clearance, without samples. `drafts` belong to this request.
///
/// # Errors
/// Says what the last attempt failed of.
pub(crate) fn searched_guide<'a>(
    request: &GuideRequest<'_>,
    robot: &GuideRobot<'a>,
    settings: &GuideSettings,
    drafts: &mut Drafts<'a>,
) -> Result<GuidePath, NoGuide> {
    let context = GuideContext::new(request, robot, settings);
    context.has_length()?;
    let mut last = NoGuide::Unreachable;
    // Attempts that differ in the smoothing only share their way, and where one finds none, none does.
    let mut found: Option<(Attempt, Result<Vec<Vector>, NoGuide>)> = None;
    let attempts = attempts(settings, robot.geometry.clearance().frame().resolution_m);
    for (number, attempt) in attempts.into_iter().enumerate() {
        let draft = drafts.of(robot.geometry, number, || {
            let is_same = |(before, way): &(Attempt, Result<_, _>)| {
                before.margin_m == attempt.margin_m && (before.weight == attempt.weight || way.is_err())
            };
            let (_, way) = match found.take().filter(is_same) {
                Some(known) => found.insert(known),
                None => found.insert((attempt, context.ridge_way(&attempt))),
            };
            way.as_ref().map(|way| context.draft((way, &[]), &attempt)).map_err(Clone::clone)
        });
        match draft.and_then(|draft| context.finish(draft)) {
            Ok(guide) => return Ok(guide),
            Err(reason) => last = reason,
        }
    }
    Err(last)
}

/// The second part of [`plan_guide`]: by samples.
///
/// # Errors
/// If the sampling planner finds nothing within its budget, which may be none.
fn sample_guide(
    request: &GuideRequest<'_>,
    robot: &GuideRobot<'_>,
    settings: &GuideSettings,
    rng: &mut Stream,
) -> Result<GuidePath, NoGuide> {
    let context = GuideContext::new(request, robot, settings);
    context.has_length()?;
    if settings.sampling.budget.iterations == 0 {
        return Err(NoGuide::Exhausted { iterations: 0 });
    }
    let way = context.least_way()?;
    sampled_guide(&context, &way, rng)
}

/// What is tried in turn: as set; more respect for walls; less, for a rounder path;
/// every cell. The last two let the goal's heading go.
pub(crate) fn attempts(settings: &GuideSettings, resolution_m: f64) -> [Attempt; ATTEMPTS] {
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

#[cfg(test)]
mod tests {
    use sharp_motion::Steering;
    use sharp_space::{Footprint, FootprintChecker, OccupancyGrid};

    use super::*;
    use crate::request::GuideEnd;

    /// Two rooms, one door of 1.2 m whose middle is at (4.1, 1.9); cells of 0.2 m.
    fn rooms(is_open: bool) -> FootprintChecker {
        let row = |row: usize| match row {
            0 | 18 => "#".repeat(41),
            7..=12 if is_open => format!("#{}#", ".".repeat(39)),
            _ => format!("#{0}#{0}#", ".".repeat(19)),
        };
        let drawing: Vec<String> = (0..19).rev().map(row).collect();
        let grid = OccupancyGrid::from_ascii(0.2, &drawing.join("\n")).expect("a sound drawing");
        FootprintChecker::new(&grid, Footprint::rectangle(0.5, 0.335).expect("a sound outline"))
    }

    fn smooth(
        checker: &FootprintChecker,
        way: &[Point],
        discs: &[(Point, f64)],
    ) -> Result<GuidePath, NoGuide> {
        let end = |position| GuideEnd { position, heading: None };
        let request = GuideRequest { start: end(way[0]), goal: end(way[way.len() - 1]), allowed: &|_| true };
        let robot = GuideRobot::new(checker, Steering::RotateTranslate);
        let settings = GuideSettings::default();
        let context = GuideContext::new(&request, &robot, &settings);
        let frame = checker.clearance().frame();
        let points: Vec<Vector> = way.iter().map(|&point| frame.to_grid(point)).collect();
        context.finish(&context.draft((&points, discs), &attempts(&settings, frame.resolution_m)[0]))
    }

    #[test]
    fn a_way_of_ones_own_becomes_smooth_and_keeps_to_its_discs() {
        let way = [(1.2, 1.0), (2.6, 3.0), (4.1, 1.9), (7.0, 1.9)].map(|(x, y)| Point::new(x, y));
        let off_m = |guide: &GuidePath| {
            guide.poses().iter().map(|pose| (pose.position - way[1]).norm()).fold(f64::INFINITY, f64::min)
        };
        let open = rooms(true);
        let free = smooth(&open, &way, &[]).expect("a room");
        let held = smooth(&open, &way, &[(way[1], 0.2)]).expect("a room");
        assert!(off_m(&free) > 0.4, "the corner is cut: {} m", off_m(&free));
        assert!(off_m(&held) < 0.35, "the disc is missed by {} m", off_m(&held) - 0.2);
        for guide in [&free, &held] {
            let bends = guide.poses().windows(2).map(|pair| pair[0].heading.turn_to(pair[1].heading).abs());
            let worst_rad = bends.fold(0.0, f64::max);
            assert!(worst_rad < 0.8, "a kink of {worst_rad} rad");
        }
        let refused = smooth(&rooms(false), &[way[0], way[3]], &[]);
        assert!(matches!(refused, Err(NoGuide::Footprint(_))), "{refused:?}");
    }
}
