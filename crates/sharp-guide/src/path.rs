//! Guide paths (Definition 8) and projections onto them.

use serde::{Deserialize, Serialize};
use sharp_space::{Heading, Point, Pose};
use thiserror::Error;

/// How far ahead of the last projection the next one may lie, metres: more than a robot drives in a step.
const WINDOW_AHEAD_M: f64 = 2.0;
/// How far back, metres: a robot that was pushed back must find itself again.
const WINDOW_BACK_M: f64 = 0.5;

/// Why poses are no guide path.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum GuidePathError {
    /// A path needs two poses.
    #[error("guide has {0} poses, needs at least 2")]
    TooShort(usize),
    /// A coordinate is NaN or infinite.
    #[error("guide pose {0} is not finite")]
    NotFinite(usize),
    /// Two neighbours are too far apart.
    #[error("guide poses {index} and {next} are {gap_m:.3} m apart, allowed are less than {spacing_m:.3} m", next = index + 1)]
    Gap {
        /// The first of the two.
        index: usize,
        /// Their distance, metres.
        gap_m: f64,
        /// The threshold t, metres.
        spacing_m: f64,
    },
    /// All poses lie in one place.
    #[error("guide has no length")]
    NoLength,
}

/// 𝒢 = [p₁, …, pₙ]: poses less than a threshold apart that look along the direction of travel.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "GuidePathData", into = "GuidePathData")]
pub struct GuidePath {
    poses: Vec<Pose>,
    spacing_m: f64,
    /// Metres from the start to each pose.
    arcs_m: Vec<f64>,
}

/// What of a guide path is stored.
#[derive(Serialize, Deserialize)]
struct GuidePathData {
    spacing_m: f64,
    poses: Vec<Pose>,
}

impl From<GuidePath> for GuidePathData {
    fn from(path: GuidePath) -> Self {
        Self { spacing_m: path.spacing_m, poses: path.poses }
    }
}

impl TryFrom<GuidePathData> for GuidePath {
    type Error = GuidePathError;

    fn try_from(data: GuidePathData) -> Result<Self, GuidePathError> {
        Self::new(data.poses, data.spacing_m)
    }
}

/// The place of a point beside a guide path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Projection {
    /// Metres along the path to the foot of the point.
    pub arc_m: f64,
    /// Distance from the path's tangent at the foot, metres, positive to the left.
    pub cross_track_m: f64,
    /// Direction of the path at the foot.
    pub tangent: Heading,
    /// Metres of path that are left from the foot.
    pub remaining_m: f64,
}

impl GuidePath {
    /// A guide path through `poses`, each less than `spacing_m` (the paper's t) from the next.
    ///
    /// # Errors
    /// Names the first pose that is not finite or the first gap that is too wide.
    pub fn new(poses: Vec<Pose>, spacing_m: f64) -> Result<Self, GuidePathError> {
        if poses.len() < 2 {
            return Err(GuidePathError::TooShort(poses.len()));
        }
        if let Some(index) = poses.iter().position(|pose| !pose.is_finite()) {
            return Err(GuidePathError::NotFinite(index));
        }
        let mut arcs_m = Vec::with_capacity(poses.len());
        let mut arc_m = 0.0;
        arcs_m.push(arc_m);
        for (index, pair) in poses.windows(2).enumerate() {
            let gap_m = pair[0].distance_m(&pair[1]);
            // A NaN spacing must not pass either.
            if gap_m.partial_cmp(&spacing_m) != Some(std::cmp::Ordering::Less) {
                return Err(GuidePathError::Gap { index, gap_m, spacing_m });
            }
            arc_m += gap_m;
            arcs_m.push(arc_m);
        }
        if arc_m <= 0.0 {
            return Err(GuidePathError::NoLength);
        }
        Ok(Self { poses, spacing_m, arcs_m })
    }

    /// The path from `arc_m` on, metres; `None` where nothing of it is left.
    #[must_use]
    pub fn from_arc(&self, arc_m: f64) -> Option<Self> {
        let rest = (0..self.poses.len()).filter(|&i| self.arcs_m[i] > arc_m);
        let poses = std::iter::once(self.pose_at(arc_m)).chain(rest.map(|i| self.poses[i])).collect();
        Self::new(poses, self.spacing_m).ok()
    }

    /// The points p₁ … pₙ.
    #[must_use]
    pub fn poses(&self) -> &[Pose] {
        &self.poses
    }

    /// The threshold that all gaps stay under, metres.
    #[must_use]
    pub const fn spacing_m(&self) -> f64 {
        self.spacing_m
    }

    /// p₁, the centre of the initiation set.
    #[must_use]
    pub fn start(&self) -> Pose {
        self.poses[0]
    }

    /// pₙ, the centre of the termination set.
    #[must_use]
    pub fn end(&self) -> Pose {
        self.poses[self.poses.len() - 1]
    }

    /// Length, metres, positive.
    #[must_use]
    pub fn length_m(&self) -> f64 {
        self.arcs_m[self.arcs_m.len() - 1]
    }

    /// Metres from the start to pose `index`.
    ///
    /// # Panics
    /// If there is no such pose.
    #[must_use]
    pub fn arc_m(&self, index: usize) -> f64 {
        self.arcs_m[index]
    }

    /// The pose `arc_m` metres from the start; the ends outside the path.
    #[must_use]
    pub fn pose_at(&self, arc_m: f64) -> Pose {
        let segment = self.segment_at(arc_m);
        let share = (arc_m - self.arcs_m[segment]) / self.segment_length_m(segment);
        // A segment without length gives no number; either end will do.
        let share = if share.is_finite() { share.clamp(0.0, 1.0) } else { 0.0 };
        self.poses[segment].interpolate(&self.poses[segment + 1], share)
    }

    /// n(x) of Definition 9: the index of the pose nearest to `point`, the first of equals.
    #[must_use]
    pub fn nearest(&self, point: Point) -> usize {
        let distance = |i: &usize| (self.poses[*i].position - point).norm_squared();
        (0..self.poses.len()).min_by(|a, b| distance(a).total_cmp(&distance(b))).expect("a path has poses")
    }

    /// The foot of `point` near `from_arc_m`, the arc of the projection before (0 at the start).
    ///
    /// The search looks 0.5 m back and 2 m ahead only, so that a robot near a wall is not thrown
    /// onto the part of the path behind it. Ties go to the smaller arc.
    #[must_use]
    pub fn project(&self, point: Point, from_arc_m: f64) -> Projection {
        let first = self.segment_at(from_arc_m - WINDOW_BACK_M);
        let last = self.segment_at(from_arc_m + WINDOW_AHEAD_M);
        let (mut best, mut best_squared) = ((first, 0.0), f64::INFINITY);
        for segment in first..=last {
            let share = self.foot_share(segment, point);
            let (a, b) = (self.poses[segment].position, self.poses[segment + 1].position);
            let squared = (a + (b - a) * share - point).norm_squared();
            if squared < best_squared {
                (best, best_squared) = ((segment, share), squared);
            }
        }
        let (segment, share) = best;
        let foot = self.poses[segment].interpolate(&self.poses[segment + 1], share);
        let arc_m = self.arcs_m[segment] + share * self.segment_length_m(segment);
        Projection {
            arc_m,
            cross_track_m: foot.to_local(point).y,
            tangent: foot.heading,
            remaining_m: self.length_m() - arc_m,
        }
    }

    /// The share of `segment` at which `point` has its foot, in [0, 1].
    fn foot_share(&self, segment: usize, point: Point) -> f64 {
        let (a, b) = (self.poses[segment].position, self.poses[segment + 1].position);
        let squared = (b - a).norm_squared();
        if squared > 0.0 { ((point - a).dot(&(b - a)) / squared).clamp(0.0, 1.0) } else { 0.0 }
    }

    /// The segment that holds `arc_m`: the last one that begins at or before it.
    fn segment_at(&self, arc_m: f64) -> usize {
        let inner = &self.arcs_m[1..self.arcs_m.len() - 1];
        inner.partition_point(|&begin| begin <= arc_m)
    }

    fn segment_length_m(&self, segment: usize) -> f64 {
        self.arcs_m[segment + 1] - self.arcs_m[segment]
    }
}

#[cfg(test)]
mod tests {
    use sharp_space::trig;

    use super::*;

    /// A hairpin: 3 m out along y = 0, around, and back along y = 0.4.
    fn hairpin() -> GuidePath {
        let out = (0..=15).map(|i| Pose::new(f64::from(i) * 0.2, 0.0, 0.0));
        let turn = [Pose::new(3.1, 0.2, std::f64::consts::FRAC_PI_2)];
        let back = (0..=15).map(|i| Pose::new(3.0 - f64::from(i) * 0.2, 0.4, std::f64::consts::PI));
        GuidePath::new(out.chain(turn).chain(back).collect(), 0.25).unwrap()
    }

    #[test]
    fn the_first_bad_gap_is_named() {
        let poses = [0.0, 0.2, 0.5, 0.9].map(|x| Pose::new(x, 0.0, 0.0)).to_vec();
        let error = GuidePath::new(poses.clone(), 0.25).unwrap_err();
        assert_eq!(error.to_string(), "guide poses 1 and 2 are 0.300 m apart, allowed are less than 0.250 m");
        assert!(GuidePath::new(poses, 0.401).is_ok(), "under the threshold");
        let at = |x| Pose::new(x, 0.0, 0.0);
        assert_eq!(GuidePath::new(vec![at(0.0)], 1.0), Err(GuidePathError::TooShort(1)));
        assert_eq!(GuidePath::new(vec![at(0.0), at(f64::NAN)], 1.0), Err(GuidePathError::NotFinite(1)));
        assert_eq!(GuidePath::new(vec![at(0.0); 3], 1.0), Err(GuidePathError::NoLength));
        assert!(GuidePath::new(vec![at(0.0), at(0.1)], f64::NAN).is_err(), "a threshold that is no number");
    }

    #[test]
    fn projections_know_side_and_rest() {
        let guide = hairpin();
        let projection = guide.project(Point::new(1.0, 0.1), 0.8);
        assert!((projection.arc_m - 1.0).abs() < 1e-12, "{projection:?}");
        assert!((projection.cross_track_m - 0.1).abs() < 1e-12, "left is positive: {projection:?}");
        assert!((projection.remaining_m - (guide.length_m() - 1.0)).abs() < 1e-12, "{projection:?}");
        assert_eq!(guide.project(Point::new(-1.0, 0.0), 0.0).arc_m, 0.0, "before the start");
    }

    #[test]
    fn projections_do_not_jump_to_the_other_leg() {
        let guide = hairpin();
        let point = Point::new(0.5, 0.39);
        assert!(guide.project(point, 0.4).arc_m < 1.0, "on the way out");
        assert!(guide.project(point, 5.5).arc_m > 5.0, "on the way back");
        assert_eq!(guide.nearest(point), 29, "the nearest pose overall lies on the way back");
    }

    #[test]
    fn driving_along_never_projects_backwards() {
        let guide = hairpin();
        let mut arc_m = 0.0;
        for i in 0..=600 {
            let pose = guide.pose_at(guide.length_m() * f64::from(i) / 600.0);
            let swerve = 0.1 * trig::sin(f64::from(i) * 0.3);
            let projection = guide.project(pose.to_world(sharp_space::Vector::new(0.0, swerve)), arc_m);
            assert!(
                projection.arc_m > arc_m - 0.06,
                "step {i} fell back from {arc_m} to {}",
                projection.arc_m
            );
            arc_m = projection.arc_m;
        }
        assert!(guide.length_m() - arc_m < 0.05, "ended at {arc_m} of {}", guide.length_m());
    }

    #[test]
    fn poses_interpolate_and_clamp() {
        let guide = hairpin();
        assert_eq!(guide.pose_at(-1.0), guide.start());
        assert_eq!(guide.pose_at(99.0), guide.end());
        assert!((guide.pose_at(0.3).position.x - 0.3).abs() < 1e-12, "between two poses");
    }
}
