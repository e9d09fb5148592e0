//! The planning context of one guide: request, robot, settings, and the steps of its planning.

use sharp_motion::{Maneuver, Steering};
use sharp_space::{CollisionChecker, Heading, Point, Pose, RobotGeometry, Vector, WidestPaths};

use crate::band::{self, BandSettings, COARSE_M};
use crate::inflate::GuideRobot;
use crate::path::GuidePath;
use crate::request::{GuideEnd, GuideRequest, NoGuide};
use crate::ridge::ridge;
use crate::settings::GuideSettings;
use crate::traversable::TraversableMask;

/// The distance between two looks at the outline, metres: under a cell of any indoor map.
pub(crate) const CHECK_STEP_M: f64 = 0.05;
/// A guide's bends may be this much tighter than the robot's: chords of 0.25 m overstate curvature.
const CURVATURE_SLACK: f64 = 1.1;
/// Radius of the curve that leads a robot onto its path when it cannot turn where it stands, metres.
const LEAD_IN_RADIUS_M: f64 = 0.4;
/// How far along the path the lead-in may join it, metres.
const LEAD_IN_MAX_M: f64 = 5.0;
/// An end's direction is kept if the unsmoothed path is not further off than this, radians.
const END_TURN_MAX_RAD: f64 = 1.3;

/// What differs between the attempts to plan a guide.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Attempt {
    pub(crate) weight: f64,
    pub(crate) pull_per_m2: f64,
    /// Clearance beyond the inscribed radius, metres.
    pub(crate) margin_m: f64,
    /// Whether to arrive along the goal's heading.
    pub(crate) aim_goal: bool,
}

/// Everything that one guide is planned with.
#[derive(Debug)]
pub(crate) struct GuideContext<'a> {
    pub(crate) request: &'a GuideRequest<'a>,
    pub(crate) robot: &'a GuideRobot<'a>,
    pub(crate) settings: &'a GuideSettings,
}

/// The robot may stand where the outline is free and the cell is allowed.
impl CollisionChecker for GuideContext<'_> {
    fn is_free(&self, pose: Pose) -> bool {
        self.is_allowed(pose.position) && self.robot.geometry.is_free(pose)
    }
}

impl<'a> GuideContext<'a> {
    pub(crate) const fn new(
        request: &'a GuideRequest<'a>,
        robot: &'a GuideRobot<'a>,
        settings: &'a GuideSettings,
    ) -> Self {
        Self { request, robot, settings }
    }

    /// The cells that have `margin_m` more clearance than the inscribed radius.
    pub(crate) fn mask(&self, margin_m: f64) -> TraversableMask<'a> {
        let footprint = self.robot.geometry.footprint();
        let least_m = footprint.inscribed_radius_m() + margin_m;
        // The price of a cell divides by the difference.
        let comfort_m = (footprint.circumscribed_radius_m() + self.settings.comfort_m).max(least_m + 0.01);
        TraversableMask {
            field: self.robot.geometry.clearance(),
            allowed: self.request.allowed,
            least_m,
            comfort_m,
        }
    }

    /// Refuses a request whose ends are the same place.
    pub(crate) fn has_length(&self) -> Result<(), NoGuide> {
        let (start, goal) = (self.request.start.position, self.request.goal.position);
        if (start - goal).norm() < 1e-6 { Err(NoGuide::NoLength(start)) } else { Ok(()) }
    }

    /// A way through all cells in which the robot could possibly stand, as points in the grid.
    pub(crate) fn least_way(&self) -> Result<Vec<Vector>, NoGuide> {
        // Centre to centre distances and the half cell taken off them hide up to 1.21 cells.
        let margin_m = -1.21 * self.robot.geometry.clearance().frame().resolution_m;
        self.first_path(&self.mask(margin_m), self.settings.clearance_weight)
    }

    /// The way along the ridge of clearance, as points in the grid.
    pub(crate) fn ridge_way(&self, attempt: &Attempt) -> Result<Vec<Vector>, NoGuide> {
        self.first_path(&self.mask(attempt.margin_m), attempt.weight)
    }

    /// `points` smoothed into a path that meets all `discs` (centre and radius, metres). How the robot steers does not matter.
    pub(crate) fn draft(
        &self,
        (points, discs): (&[Vector], &[(Point, f64)]),
        attempt: &Attempt,
    ) -> Vec<Point> {
        let mask = self.mask(attempt.margin_m);
        let (start, mut goal) = (self.request.start, self.request.goal);
        goal.heading = goal.heading.filter(|_| attempt.aim_goal);
        let back: Vec<Vector> = points.iter().rev().copied().collect();
        let ends = [self.end(&mask, &start, points, 1.0), self.end(&mask, &goal, &back, -1.0)];
        let frame = mask.frame();
        let disc =
            |&(center, radius_m): &(Point, f64)| (frame.to_grid(center), radius_m / frame.resolution_m);
        let discs: Vec<(Vector, f64)> = discs.iter().map(disc).collect();
        let (pull_per_m2, stiffness_m) = (attempt.pull_per_m2, self.settings.stiffness_m);
        let band = BandSettings { pull_per_m2, stiffness_m, ends, discs: &discs };
        band::smooth(&mask, points, &band).into_iter().map(|point| frame.from_grid(point)).collect()
    }

    /// Leads the robot onto `draft` and checks the result.
    pub(crate) fn finish(&self, draft: &[Point]) -> Result<GuidePath, NoGuide> {
        let guide = self.lead_in(self.through(draft)?)?;
        self.check(&guide)?;
        Ok(guide)
    }

    /// The unsmoothed path through `mask`, from one exact end to the other.
    fn first_path(&self, mask: &TraversableMask<'_>, weight: f64) -> Result<Vec<Vector>, NoGuide> {
        let frame = mask.frame();
        let (start, goal) = (self.request.start.position, self.request.goal.position);
        // Beyond its own half width an end and its cell could lie on two sides of a thin wall.
        let reach_m = self.robot.geometry.footprint().inscribed_radius_m() + 2.0 * frame.resolution_m;
        let first = mask.nearest_open(start, reach_m).ok_or(NoGuide::Start(start))?;
        let last = mask.nearest_open(goal, reach_m).ok_or(NoGuide::Goal(goal))?;
        let is_shut = |paths: &WidestPaths| {
            paths.narrowest(first, last).is_none_or(|place| mask.clearance_m(place) < mask.least_m)
        };
        if mask.field.made_widest_paths().is_some_and(is_shut) {
            return Err(NoGuide::Unreachable);
        }
        let cells = ridge(mask, first, last, weight).ok_or(NoGuide::Unreachable)?;
        let mut points: Vec<Vector> =
            cells.iter().map(|cell| Vector::new(cell.col as f64 + 0.5, cell.row as f64 + 0.5)).collect();
        let count = points.len();
        if count == 1 {
            return Ok(vec![frame.to_grid(start), frame.to_grid(goal)]);
        }
        points[0] = frame.to_grid(start);
        points[count - 1] = frame.to_grid(goal);
        Ok(points)
    }

    /// The direction in the grid in which the path shall leave or reach an end, if one is wanted
    /// or only one fits. `points` run from the end inwards, `sign` is −1 at the goal.
    fn end(
        &self,
        mask: &TraversableMask<'_>,
        end: &GuideEnd,
        points: &[Vector],
        sign: f64,
    ) -> Option<Vector> {
        let frame = mask.frame();
        let coarse = COARSE_M / frame.resolution_m;
        let inward = points.iter().find(|&point| (point - points[0]).norm() >= 1.5 * coarse);
        let inward = inward.unwrap_or(&points[points.len() - 1]) - points[0];
        let drafted = Heading::of(frame.from_grid(inward * sign) - frame.from_grid(Vector::zeros()));
        let wanted = end.heading.or_else(|| self.fitting(end.position, drafted))?;
        if drafted.turn_to(wanted).abs() > END_TURN_MAX_RAD {
            return None;
        }
        let ahead = Pose::at(end.position, wanted).to_world(Vector::new(1.0, 0.0));
        let direction = (frame.to_grid(ahead) - points[0]) * frame.resolution_m;
        mask.is_open_at(points[0] + direction * (sign * coarse)).then_some(direction)
    }

    /// The heading nearest to `preferred` at which the outline is free, unless `preferred` itself is.
    fn fitting(&self, position: Point, preferred: Heading) -> Option<Heading> {
        let is_free = |heading: &Heading| self.robot.geometry.is_free(Pose::at(position, *heading));
        if is_free(&preferred) {
            return None;
        }
        let offsets = (1..=15).flat_map(|i| [f64::from(i) * 0.1, f64::from(i) * -0.1]);
        offsets.map(|offset| Heading::new(preferred.radians() + offset)).find(is_free)
    }

    /// The heading nearest to `preferred` at which the outline is free; `preferred` if none is.
    pub(crate) fn fitting_or(&self, position: Point, preferred: Heading) -> Heading {
        self.fitting(position, preferred).unwrap_or(preferred)
    }

    /// The guide through `points`, evenly spaced, headings along the direction of travel.
    pub(crate) fn through(&self, points: &[Point]) -> Result<GuidePath, NoGuide> {
        let fine: Vec<Vector> = points.iter().map(|point| point.coords).collect();
        let length_m: f64 = fine.windows(2).map(|pair| (pair[1] - pair[0]).norm()).sum();
        // One segment more than fits, so that every gap stays under the threshold.
        let count = (length_m / self.settings.spacing_m).floor() + 1.0;
        let spaced = band::resample(&fine, length_m / count, 1);
        let last = spaced.len() - 1;
        let tangent = |i: usize| match i {
            0 => fine[1] - fine[0],
            i if i == last => fine[fine.len() - 1] - fine[fine.len() - 2],
            i => spaced[i + 1] - spaced[i - 1],
        };
        let poses = (0..=last).map(|i| Pose::at(Point::from(spaced[i]), Heading::of(tangent(i)))).collect();
        GuidePath::new(poses, self.settings.spacing_m).map_err(|_| NoGuide::NoLength(points[0]))
    }

    /// Puts a curve before `guide` that leads the robot from its heading at the start onto the path,
    /// unless it looks along the path already or can turn there.
    pub(crate) fn lead_in(&self, guide: GuidePath) -> Result<GuidePath, NoGuide> {
        let Some(heading) = self.request.start.heading else { return Ok(guide) };
        let start = Pose::at(guide.start().position, heading);
        let off = heading.turn_to(guide.start().heading).abs();
        if off <= self.settings.start_turn_rad || self.can_turn(start, guide.start().heading) {
            return Ok(guide);
        }
        let radius_m = (1.1 * self.robot.steering.radius_m()).max(LEAD_IN_RADIUS_M);
        let curve = Steering::Dubins { radius_m };
        let length_m = guide.length_m();
        let joins = (2..=(4.0 * LEAD_IN_MAX_M) as usize).map(|i| i as f64 * 0.25);
        let (_, arc_m, maneuver) = joins
            .take_while(|&arc_m| arc_m < length_m)
            .chain((length_m <= LEAD_IN_MAX_M).then_some(length_m))
            .map(|arc_m| (arc_m, curve.maneuver(start, guide.pose_at(arc_m))))
            .filter(|(_, maneuver)| maneuver.all(CHECK_STEP_M, |pose| self.is_free(pose)))
            .map(|(arc_m, maneuver)| (maneuver.travel_m() + length_m - arc_m, arc_m, maneuver))
            .min_by(|a, b| a.0.total_cmp(&b.0))
            .ok_or(NoGuide::LeadIn(start.position))?;
        self.spliced(&maneuver, &guide, arc_m)
    }

    fn spliced(&self, maneuver: &Maneuver, guide: &GuidePath, arc_m: f64) -> Result<GuidePath, NoGuide> {
        let mut points: Vec<Point> =
            maneuver.poses(CHECK_STEP_M).into_iter().map(|pose| pose.position).collect();
        let rest = (0..guide.poses().len()).filter(|&i| guide.arc_m(i) > arc_m + CHECK_STEP_M);
        points.extend(rest.map(|i| guide.poses()[i].position));
        self.through(&points)
    }

    /// Returns true if the robot can turn in place from `start` to `heading`.
    fn can_turn(&self, start: Pose, heading: Heading) -> bool {
        let turned = Pose::at(start.position, heading);
        self.robot.steering == Steering::RotateTranslate
            && self.robot.geometry.is_segment_free(start, turned, CHECK_STEP_M)
    }

    /// Checks outline, bends and cells along `guide`.
    pub(crate) fn check(&self, guide: &GuidePath) -> Result<(), NoGuide> {
        if let Some(place) = first_touch(guide, self.robot.geometry) {
            return Err(NoGuide::Footprint(place));
        }
        if let Some(place) = tight_bend(guide, self.robot.steering.radius_m()) {
            return Err(NoGuide::Bend(place));
        }
        let poses = guide.poses();
        // The ends are given, not chosen.
        match poses[1..poses.len() - 1].iter().find(|pose| !self.is_allowed(pose.position)) {
            Some(pose) => Err(NoGuide::Astray(pose.position)),
            None => Ok(()),
        }
    }

    /// Where [`check`](Self::check) finds something wrong with `guide`, metres along it.
    pub(crate) fn faults_m(&self, guide: &GuidePath) -> Vec<f64> {
        let poses = guide.poses();
        let astray = (1..poses.len() - 1).filter(|&index| !self.is_allowed(poses[index].position));
        let bends = tight_bends(guide, self.robot.steering.radius_m());
        touches(guide, self.robot.geometry)
            .chain(bends)
            .chain(astray)
            .map(|index| guide.arc_m(index))
            .collect()
    }

    fn is_allowed(&self, point: Point) -> bool {
        self.robot
            .geometry
            .clearance()
            .frame()
            .cell_at(point)
            .is_some_and(|cell| (self.request.allowed)(cell))
    }
}

/// The last pose of `guide` before its outline first touches an obstacle, in a turn as well as on the way.
pub(crate) fn first_touch(guide: &GuidePath, geometry: &dyn RobotGeometry) -> Option<Point> {
    touches(guide, geometry).next().map(|index| guide.poses()[index].position)
}

/// The poses of `guide` between which and the next one its outline touches an obstacle.
pub(crate) fn touches(guide: &GuidePath, geometry: &dyn RobotGeometry) -> impl Iterator<Item = usize> {
    let poses = guide.poses();
    let is_free = |index: usize| geometry.is_segment_free(poses[index], poses[index + 1], CHECK_STEP_M);
    (0..poses.len() - 1).filter(move |&index| !is_free(index))
}

/// The first place where `guide` is too tight a bend for a robot that turns on `radius_m`.
pub(crate) fn tight_bend(guide: &GuidePath, radius_m: f64) -> Option<Point> {
    tight_bends(guide, radius_m).next().map(|index| guide.poses()[index].position)
}

/// The poses of `guide` from which to the next one it is too tight a bend for a robot that turns on `radius_m`.
pub(crate) fn tight_bends(guide: &GuidePath, radius_m: f64) -> impl Iterator<Item = usize> {
    let poses = guide.poses();
    let is_tight = move |index: usize| {
        let (from, to) = (poses[index], poses[index + 1]);
        from.heading.turn_to(to.heading).abs() * radius_m > CURVATURE_SLACK * from.distance_m(&to)
    };
    (0..poses.len() - 1).filter(move |&index| is_tight(index))
}
