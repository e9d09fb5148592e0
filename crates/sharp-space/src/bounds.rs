//! Axis-aligned rectangles in the world frame.

use crate::pose::Point;

/// An axis-aligned rectangle, metres in the world frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// The lower-left corner.
    pub min: Point,
    /// The upper-right corner.
    pub max: Point,
}

impl Bounds {
    /// Returns true if `point` lies inside or on the border.
    #[must_use]
    pub fn contains(&self, point: Point) -> bool {
        (self.min.x..=self.max.x).contains(&point.x) && (self.min.y..=self.max.y).contains(&point.y)
    }

    /// Extent along x, metres.
    #[must_use]
    pub fn width_m(&self) -> f64 {
        self.max.x - self.min.x
    }

    /// Extent along y, metres.
    #[must_use]
    pub fn height_m(&self) -> f64 {
        self.max.y - self.min.y
    }
}
