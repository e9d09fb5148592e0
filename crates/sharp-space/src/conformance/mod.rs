//! Conformance suites: what an implementation of a trait of this crate must keep.
//!
//! Each function takes any implementation, asks it questions and returns the first promise that it does not
//! keep. Call them from the tests of a crate that implements one of the traits.

mod collision;
mod detector;
mod geometry;

pub use collision::{CheckerViolation, check_collision_checker};
pub use detector::{DetectorViolation, check_region_detector};
pub use geometry::{GeometryViolation, check_geometry};

use crate::bounds::Bounds;
use crate::pose::Pose;

/// Poses that a suite asks about.
const POSES: u32 = 800;

/// Poses spread evenly over `bounds` and all headings, the same at each call.
fn poses(bounds: Bounds) -> impl Iterator<Item = Pose> {
    // The R2 sequence (Roberts 2018) fills a rectangle evenly with any number of points.
    const STEP: [f64; 3] = [0.754_877_666_246_693, 0.569_840_290_998_053, 0.618_033_988_749_895];
    (0..POSES).map(move |i| {
        let [x, y, turn] = STEP.map(|step| (f64::from(i) * step).fract());
        Pose::new(
            bounds.min.x + x * bounds.width_m(),
            bounds.min.y + y * bounds.height_m(),
            turn * std::f64::consts::TAU,
        )
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pose::Point;

    #[test]
    fn poses_are_spread_over_places_and_headings() {
        let bounds = Bounds { min: Point::new(-1.0, 2.0), max: Point::new(3.0, 10.0) };
        let mut counts = [0; 64];
        for pose in poses(bounds) {
            let turn = pose.heading.radians().rem_euclid(std::f64::consts::TAU) / std::f64::consts::TAU;
            let shares = [(pose.position.x + 1.0) / 4.0, (pose.position.y - 2.0) / 8.0, turn];
            let [x, y, turn] = shares.map(|share| (4.0 * share) as usize);
            counts[16 * x + 4 * y + turn] += 1;
        }
        // 800 poses in 64 boxes: 12.5 in each.
        assert!(counts.iter().all(|count| (6..=19).contains(count)), "{counts:?}");
    }
}
