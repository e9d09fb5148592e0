//! Everything one guide is made with: request, robot, settings and the steps of its making.

use sharp_motion::{Maneuver, Steering};
use sharp_space::{CollisionChecker, FootprintChecker, Heading, Point, Pose, Vector};

use crate::band::{self, BandSettings, COARSE_M};
use crate::floor::Floor;
use crate::path::GuidePath;
use crate::plan::{GuideEnd, GuideRequest, NoGuide};
use crate::ridge::ridge;
use crate::settings::GuideSettings;

/// The distance between two looks at the outline, metres: under a cell of any indoor map.
pub(crate) const CHECK_STEP_M: f64 = 0.05;
/// A guide's bends may be this much tighter than the robot's: chords of 0.25 m overstate curvature.
const CURVATURE_SLACK: f64 = 1.1;
/// Radius of the curve that leads a robot onto its path when it cannot turn where it stands, metres.
const LEAD_IN_RADIUS_M: f64 = 0.4;
/// How far along the path the lead-in may join it, metres.
const LEAD_IN_MAX_M: f64 = 5.0;
/// An end's direction is kept if the draft is not further off than this, radians.
const END_TURN_MAX_RAD: f64 = 1.3;

/// The knobs that differ between attempts.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Draft {
    pub(crate) weight: f64,
    pub(crate) pull_per_m2: f64,
    /// Room beyond the inscribed radius.
    pub(crate) margin_m: f64,
    /// Whether to arrive along the goal's heading.
    pub(crate) aim_goal: bool,
}

pub(crate) struct Workbench<'a> {
    pub(crate) request: &'a GuideRequest<'a>,
    pub(crate) checker: &'a FootprintChecker,
    pub(crate) steering: &'a Steering,
    pub(crate) settings: &'a GuideSettings,
}

/// The robot may stand where the outline is free and the cell is allowed.
impl CollisionChecker for Workbench<'_> {
    fn is_free(&self, pose: Pose) -> bool {
        self.is_allowed(pose.position) && self.checker.is_free(pose)
    }
}

impl<'a> Workbench<'a> {
    pub(crate) const fn new(
        request: &'a GuideRequest<'a>,
        checker: &'a FootprintChecker,
        steering: &'a Steering,
        settings: &'a GuideSettings,
    ) -> Self {
        Self { request, checker, steering, settings }
    }

    /// The floor whose cells have `margin_m` more room than the inscribed radius.
    pub(crate) fn floor(&self, margin_m: f64) -> Floor<'a> {
        let footprint = self.checker.footprint();
        let least_m = footprint.inscribed_radius_m() + margin_m;
        // The price divides by the difference.
        let comfort_m = (footprint.circumscribed_radius_m() + self.settings.comfort_m).max(least_m + 0.01);
        Floor { field: self.checker.field(), allowed: self.request.allowed, least_m, comfort_m }
    }

    /// Refuses a request whose ends are the same place.
    pub(crate) fn has_length(&self) -> Result<(), NoGuide> {
        let (start, goal) = (self.request.start.position, self.request.goal.position);
        if (start - goal).norm() < 1e-6 { Err(NoGuide::NoLength(start)) } else { Ok(()) }
    }

    /// A way through all cells in which the robot could possibly stand, as points in the grid.
    pub(crate) fn least_way(&self) -> Result<Vec<Vector>, NoGuide> {
        // Centre to centre distances and the half cell taken off them hide up to 1.21 cells.
        let margin_m = -1.21 * self.checker.field().frame().resolution_m;
        self.draft(&self.floor(margin_m), self.settings.clearance_weight)
    }

    /// A guide along the ridge of clearance.
    pub(crate) fn ridge_guide(&self, draft: &Draft) -> Result<GuidePath, NoGuide> {
        let floor = self.floor(draft.margin_m);
        let points = self.draft(&floor, draft.weight)?;
        self.smooth_guide(&floor, (&points, &[]), draft)
    }

    /// Smooths `points` into a path that meets all `discs` (centre and radius, metres), leads the robot onto
    /// it and certifies the result.
    pub(crate) fn smooth_guide(
        &self,
        floor: &Floor<'_>,
        (points, discs): (&[Vector], &[(Point, f64)]),
        draft: &Draft,
    ) -> Result<GuidePath, NoGuide> {
        let (start, mut goal) = (self.request.start, self.request.goal);
        goal.heading = goal.heading.filter(|_| draft.aim_goal);
        let back: Vec<Vector> = points.iter().rev().copied().collect();
        let ends = [self.end(floor, &start, points, 1.0), self.end(floor, &goal, &back, -1.0)];
        let frame = floor.frame();
        let disc =
            |&(center, radius_m): &(Point, f64)| (frame.to_grid(center), radius_m / frame.resolution_m);
        let discs: Vec<(Vector, f64)> = discs.iter().map(disc).collect();
        let (pull_per_m2, stiffness_m) = (draft.pull_per_m2, self.settings.stiffness_m);
        let band = BandSettings { pull_per_m2, stiffness_m, ends, discs: &discs };
        let smooth: Vec<Point> =
            band::smooth(floor, points, &band).into_iter().map(|point| frame.from_grid(point)).collect();
        let guide = self.lead_in(self.through(smooth)?)?;
        self.certify(&guide)?;
        Ok(guide)
    }

    /// The draft of the path on `floor`, from one exact end to the other.
    fn draft(&self, floor: &Floor<'_>, weight: f64) -> Result<Vec<Vector>, NoGuide> {
        let frame = floor.frame();
        let (start, goal) = (self.request.start.position, self.request.goal.position);
        // Beyond its own half width an end and its cell could lie on two sides of a thin wall.
        let reach_m = self.checker.footprint().inscribed_radius_m() + 2.0 * frame.resolution_m;
        let first = floor.nearest_open(start, reach_m).ok_or(NoGuide::Start(start))?;
        let last = floor.nearest_open(goal, reach_m).ok_or(NoGuide::Goal(goal))?;
        let cells = ridge(floor, first, last, weight).ok_or(NoGuide::Unreachable)?;
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
    fn end(&self, floor: &Floor<'_>, end: &GuideEnd, points: &[Vector], sign: f64) -> Option<Vector> {
        let frame = floor.frame();
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
        floor.is_open_at(points[0] + direction * (sign * coarse)).then_some(direction)
    }

    /// The heading nearest to `preferred` at which the outline is free, unless `preferred` itself is.
    fn fitting(&self, position: Point, preferred: Heading) -> Option<Heading> {
        let is_free = |heading: &Heading| self.checker.is_free(Pose::at(position, *heading));
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
    pub(crate) fn through(&self, points: Vec<Point>) -> Result<GuidePath, NoGuide> {
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
    fn lead_in(&self, guide: GuidePath) -> Result<GuidePath, NoGuide> {
        let Some(heading) = self.request.start.heading else { return Ok(guide) };
        let start = Pose::at(guide.start().position, heading);
        let off = heading.turn_to(guide.start().heading).abs();
        if off <= self.settings.start_turn_rad || self.can_turn(start, guide.start().heading) {
            return Ok(guide);
        }
        let radius_m = (1.1 * self.steering.radius_m()).max(LEAD_IN_RADIUS_M);
        let curve = Steering::Dubins { radius_m };
        let length_m = guide.length_m();
        let joins = (2..=(4.0 * LEAD_IN_MAX_M) as usize).map(|i| i as f64 * 0.25);
        let (_, arc_m, maneuver) = joins
            .take_while(|&arc_m| arc_m < length_m)
            .chain([length_m])
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
        self.through(points)
    }

    /// Returns true if the robot can turn in place from `start` to `heading`.
    fn can_turn(&self, start: Pose, heading: Heading) -> bool {
        let turned = Pose::at(start.position, heading);
        *self.steering == Steering::RotateTranslate
            && self.checker.is_segment_free(start, turned, CHECK_STEP_M)
    }

    /// Checks outline, bends and cells along `guide`.
    pub(crate) fn certify(&self, guide: &GuidePath) -> Result<(), NoGuide> {
        let steps = (guide.length_m() / CHECK_STEP_M).ceil();
        for i in 0..=steps as usize {
            let pose = guide.pose_at(guide.length_m() * i as f64 / steps);
            if !self.checker.is_free(pose) {
                return Err(NoGuide::Footprint(pose.position));
            }
        }
        let poses = guide.poses();
        let radius_m = self.steering.radius_m();
        for pair in poses.windows(2) {
            let turn = pair[0].heading.turn_to(pair[1].heading).abs();
            if turn * radius_m > CURVATURE_SLACK * pair[0].distance_m(&pair[1]) {
                return Err(NoGuide::Bend(pair[0].position));
            }
        }
        // The ends are given, not chosen.
        match poses[1..poses.len() - 1].iter().find(|pose| !self.is_allowed(pose.position)) {
            Some(pose) => Err(NoGuide::Astray(pose.position)),
            None => Ok(()),
        }
    }

    fn is_allowed(&self, point: Point) -> bool {
        self.checker.field().frame().cell_at(point).is_some_and(|cell| (self.request.allowed)(cell))
    }
}
