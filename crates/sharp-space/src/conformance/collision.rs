//! What every [`CollisionChecker`] promises.

use thiserror::Error;

use super::poses;
use crate::bounds::Bounds;
use crate::collision::CollisionChecker;
use crate::pose::Pose;

/// How far outside the map the robot is put, metres: further than any robot is long.
const FAR_OUTSIDE_M: f64 = 50.0;
/// Distance between two tests along a segment, metres.
const STEP_M: f64 = 0.05;

/// A promise of [`CollisionChecker`] that an implementation does not keep.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum CheckerViolation {
    /// A pose with a coordinate that is not a number was called free.
    #[error("the pose {0:?} is not finite but counts as free")]
    NotFinite(Pose),
    /// A pose far outside the map was called free.
    #[error("the pose {0:?} lies outside the map but counts as free")]
    Outside(Pose),
    /// Two questions about one pose had different answers.
    #[error("the pose {0:?} is free in one answer and blocked in another")]
    NotDeterministic(Pose),
    /// A segment was called free although a pose on it is blocked.
    #[error("the segment from {from:?} to {to:?} counts as free, but a pose on it is blocked")]
    Segment {
        /// Where the segment begins.
        from: Pose,
        /// Where it ends.
        to: Pose,
    },
    /// A segment of no length does not have the answer of its pose.
    #[error("standing still at {0:?} does not have the same answer as the pose itself")]
    Stay(Pose),
}

/// Asks `checker` about poses inside and outside of `bounds`, the rectangle around its map.
///
/// # Errors
/// Returns the first promise of [`CollisionChecker`] that `checker` does not keep.
pub fn check_collision_checker(
    checker: &dyn CollisionChecker,
    bounds: Bounds,
) -> Result<(), CheckerViolation> {
    check_nowhere(checker, bounds)?;
    let mut from = Pose::at(bounds.min, 0.0.into());
    for to in poses(bounds) {
        check_pose(checker, to)?;
        check_segment(checker, from, to)?;
        // Near enough that some segments are free.
        check_segment(checker, to, to.interpolate(&from, 0.1))?;
        from = to;
    }
    Ok(())
}

/// Poses that are nowhere, or far from the map.
fn check_nowhere(checker: &dyn CollisionChecker, bounds: Bounds) -> Result<(), CheckerViolation> {
    let (x, y) = (bounds.min.x, bounds.min.y);
    for value in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
        for pose in [Pose::new(value, y, 0.0), Pose::new(x, value, 0.0)] {
            if checker.is_free(pose) {
                return Err(CheckerViolation::NotFinite(pose));
            }
        }
    }
    let (right, top) = (bounds.max.x + FAR_OUTSIDE_M, bounds.max.y + FAR_OUTSIDE_M);
    for (x, y) in [(x - FAR_OUTSIDE_M, y), (right, y), (x, y - FAR_OUTSIDE_M), (x, top), (right, top)] {
        let pose = Pose::new(x, y, 0.5);
        if checker.is_free(pose) {
            return Err(CheckerViolation::Outside(pose));
        }
    }
    Ok(())
}

fn check_pose(checker: &dyn CollisionChecker, pose: Pose) -> Result<(), CheckerViolation> {
    let is_free = checker.is_free(pose);
    if checker.is_free(pose) != is_free {
        return Err(CheckerViolation::NotDeterministic(pose));
    }
    if checker.is_segment_free(pose, pose, STEP_M) != is_free {
        return Err(CheckerViolation::Stay(pose));
    }
    Ok(())
}

/// A checker of its own may test segments more finely than the provided method, never less.
fn check_segment(checker: &dyn CollisionChecker, from: Pose, to: Pose) -> Result<(), CheckerViolation> {
    if checker.is_segment_free(from, to, STEP_M) && !Sampled(checker).is_segment_free(from, to, STEP_M) {
        return Err(CheckerViolation::Segment { from, to });
    }
    Ok(())
}

/// The same poses, with the provided test of segments.
struct Sampled<'a>(&'a dyn CollisionChecker);

impl CollisionChecker for Sampled<'_> {
    fn is_free(&self, pose: Pose) -> bool {
        self.0.is_free(pose)
    }
}
