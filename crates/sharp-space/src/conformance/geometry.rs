//! What every [`RobotGeometry`] promises.

use thiserror::Error;

use super::{CheckerViolation, check_collision_checker, poses};
use crate::collision::CollisionChecker;
use crate::geometry::RobotGeometry;
use crate::pose::Pose;

/// The margins that are tried, metres.
const MARGINS_M: [f64; 2] = [0.05, 0.2];

/// A promise of [`RobotGeometry`] that an implementation does not keep.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum GeometryViolation {
    /// It breaks a promise of [`CollisionChecker`].
    #[error(transparent)]
    Checker(#[from] CheckerViolation),
    /// The reference point lies in a blocked cell, but the pose was called free.
    #[error("the pose {0:?} has its reference point in a blocked cell but counts as free")]
    InObstacle(Pose),
    /// There is more clearance than the outline needs at any heading, but the pose was called blocked.
    #[error("the pose {0:?} has clearance for every heading but counts as blocked")]
    ClearanceIgnored(Pose),
    /// A larger outline fits where the robot's own does not.
    #[error(
        "inflated by {margin_m} m, the outline is free at {pose:?}, where it is blocked without a margin"
    )]
    InflatedFitsBetter {
        /// The margin, metres.
        margin_m: f64,
        /// The pose.
        pose: Pose,
    },
    /// Without a margin, the inflated geometry answers differently.
    #[error("inflated by 0 m, the outline has another answer at {0:?}")]
    InflatedByNothing(Pose),
    /// The inflated footprint is smaller than the robot's own.
    #[error("inflated by {margin_m} m, the footprint is smaller than without a margin")]
    InflatedFootprint {
        /// The margin, metres.
        margin_m: f64,
    },
    /// The inflated geometry belongs to another grid.
    #[error("inflated by {margin_m} m, the geometry belongs to another grid")]
    InflatedGrid {
        /// The margin, metres.
        margin_m: f64,
    },
}

/// Asks `geometry` about poses all over its map, with and without a margin.
///
/// # Errors
/// Returns the first promise of [`RobotGeometry`] or [`CollisionChecker`] that `geometry` does not keep.
pub fn check_geometry(geometry: &dyn RobotGeometry) -> Result<(), GeometryViolation> {
    let bounds = geometry.clearance().frame().bounds();
    check_collision_checker(&geometry, bounds)?;
    poses(bounds).try_for_each(|pose| check_clearance(geometry, pose))?;
    let same = geometry.inflated(0.0);
    if let Some(pose) = poses(bounds).find(|&pose| same.is_free(pose) != geometry.is_free(pose)) {
        return Err(GeometryViolation::InflatedByNothing(pose));
    }
    MARGINS_M.into_iter().try_for_each(|margin_m| check_inflated(geometry, margin_m))
}

fn check_clearance(geometry: &dyn RobotGeometry, pose: Pose) -> Result<(), GeometryViolation> {
    let field = geometry.clearance();
    let Some(cell) = field.frame().cell_at(pose.position) else { return Ok(()) };
    let is_free = geometry.is_free(pose);
    if is_free && field.at(cell) <= 0.0 {
        return Err(GeometryViolation::InObstacle(pose));
    }
    let enough_m = geometry.footprint().circumscribed_radius_m();
    if !is_free && field.clearance_lower_bound(pose.position) > enough_m {
        return Err(GeometryViolation::ClearanceIgnored(pose));
    }
    Ok(())
}

fn check_inflated(geometry: &dyn RobotGeometry, margin_m: f64) -> Result<(), GeometryViolation> {
    let larger = geometry.inflated(margin_m);
    let (own, other) = (geometry.footprint(), larger.footprint());
    if other.half_length_m() < own.half_length_m() || other.half_width_m() < own.half_width_m() {
        return Err(GeometryViolation::InflatedFootprint { margin_m });
    }
    let frame = geometry.clearance().frame();
    if larger.clearance().frame() != frame {
        return Err(GeometryViolation::InflatedGrid { margin_m });
    }
    match poses(frame.bounds()).find(|&pose| larger.is_free(pose) && !geometry.is_free(pose)) {
        Some(pose) => Err(GeometryViolation::InflatedFitsBetter { margin_m, pose }),
        None => Ok(()),
    }
}
