//! The outline of a robot on the floor.

use serde::{Deserialize, Serialize};
use thiserror::Error;

use crate::pose::{Point, Pose, Vector};
use crate::trig;

/// Why an outline was refused.
#[derive(Debug, Error, PartialEq)]
#[error("footprint {field} is {value} m, must be finite, above 0 and at most 20")]
pub struct FootprintError {
    /// The name of the field.
    pub field: &'static str,
    /// Its value.
    pub value: f64,
}

/// A rectangle around the robot's reference point. Its length lies along the heading.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Footprint {
    half_length_m: f64,
    half_width_m: f64,
}

impl Footprint {
    /// A rectangle that reaches `half_length_m` ahead and behind and `half_width_m` to either side.
    ///
    /// # Errors
    /// Returns an error that names a value that is not finite, not positive or above 20 m.
    pub fn rectangle(half_length_m: f64, half_width_m: f64) -> Result<Self, FootprintError> {
        for (field, value) in [("half_length_m", half_length_m), ("half_width_m", half_width_m)] {
            if !(value > 0.0 && value <= 20.0) {
                return Err(FootprintError { field, value });
            }
        }
        Ok(Self { half_length_m, half_width_m })
    }

    /// Reach ahead and behind, metres.
    #[must_use]
    pub const fn half_length_m(&self) -> f64 {
        self.half_length_m
    }

    /// Reach to either side, metres.
    #[must_use]
    pub const fn half_width_m(&self) -> f64 {
        self.half_width_m
    }

    /// Radius of the largest disc inside: no pose with less clearance is free.
    #[must_use]
    pub fn inscribed_radius_m(&self) -> f64 {
        self.half_length_m.min(self.half_width_m)
    }

    /// Radius of the smallest disc around it: every pose with more clearance is free.
    #[must_use]
    pub fn circumscribed_radius_m(&self) -> f64 {
        trig::hypot(self.half_length_m, self.half_width_m)
    }

    /// The corners at `pose`, counter-clockwise from the front left.
    #[must_use]
    pub fn corners(&self, pose: &Pose) -> [Point; 4] {
        let (l, w) = (self.half_length_m, self.half_width_m);
        [(l, w), (-l, w), (-l, -w), (l, -w)].map(|(x, y)| pose.to_world(Vector::new(x, y)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn broken_outlines_are_refused() {
        for value in [0.0, -1.0, f64::NAN, f64::INFINITY, 320.0] {
            assert!(Footprint::rectangle(value, 0.1).is_err(), "{value} was accepted");
        }
    }

    #[test]
    fn radii_of_the_husky() {
        let husky = Footprint::rectangle(0.5, 0.335).unwrap();
        assert_eq!(husky.inscribed_radius_m(), 0.335, "inscribed");
        assert!((husky.circumscribed_radius_m() - 0.6018).abs() < 1e-4, "circumscribed");
    }
}
