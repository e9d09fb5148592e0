//! Configurations of a planar robot: elements of SE(2).

use std::f64::consts::{PI, TAU};

use serde::{Deserialize, Serialize};

use crate::trig;

/// A position in the world frame, metres.
pub type Point = nalgebra::Point2<f64>;
/// A displacement in the world frame, metres.
pub type Vector = nalgebra::Vector2<f64>;

/// Returns `angle_rad` wrapped to (−π, π].
#[inline]
#[must_use]
pub fn wrap_angle(angle_rad: f64) -> f64 {
    if angle_rad > -PI && angle_rad <= PI {
        return angle_rad;
    }
    let wrapped = angle_rad - TAU * ((angle_rad + PI) / TAU).floor();
    // The formula gives [−π, π); the half-open side moves so that π stays π.
    if wrapped <= -PI { PI } else { wrapped }
}

/// A direction in the plane, radians counter-clockwise from the x axis, kept in (−π, π].
#[derive(Clone, Copy, Debug, PartialEq, PartialOrd, Default, Serialize, Deserialize)]
#[serde(from = "f64", into = "f64")]
pub struct Heading(f64);

impl Heading {
    /// Wraps `angle_rad` to (−π, π].
    #[inline]
    #[must_use]
    pub fn new(angle_rad: f64) -> Self {
        Self(wrap_angle(angle_rad))
    }

    /// The direction of `vector`; zero for the null vector.
    #[must_use]
    pub fn of(vector: Vector) -> Self {
        Self::new(trig::atan2(vector.y, vector.x))
    }

    /// The angle in (−π, π].
    #[inline]
    #[must_use]
    pub const fn radians(self) -> f64 {
        self.0
    }

    /// The signed shortest turn from `self` to `other`, in (−π, π].
    #[inline]
    #[must_use]
    pub fn turn_to(self, other: Self) -> f64 {
        wrap_angle(other.0 - self.0)
    }

    /// The unit vector that points this way.
    #[inline]
    #[must_use]
    pub fn unit(self) -> Vector {
        let (sin, cos) = self.sin_cos();
        Vector::new(cos, sin)
    }

    /// Its sine and cosine. Grids that are not turned ask for those of zero all the time.
    #[inline]
    #[must_use]
    pub fn sin_cos(self) -> (f64, f64) {
        if self.0 == 0.0 { (0.0, 1.0) } else { trig::sin_cos(self.0) }
    }
}

impl From<f64> for Heading {
    fn from(angle_rad: f64) -> Self {
        Self::new(angle_rad)
    }
}

impl From<Heading> for f64 {
    fn from(heading: Heading) -> Self {
        heading.0
    }
}

/// A configuration x ∈ X: where the robot's reference point is and where it looks.
///
/// Serialises as `[x, y, heading]`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(from = "[f64; 3]", into = "[f64; 3]")]
pub struct Pose {
    /// The centre of the footprint, metres in the world frame.
    pub position: Point,
    /// The direction in which the robot drives forward.
    pub heading: Heading,
}

impl From<[f64; 3]> for Pose {
    fn from([x_m, y_m, heading_rad]: [f64; 3]) -> Self {
        Self::new(x_m, y_m, heading_rad)
    }
}

impl From<Pose> for [f64; 3] {
    fn from(pose: Pose) -> Self {
        [pose.position.x, pose.position.y, pose.heading.radians()]
    }
}

impl Pose {
    /// A pose from metres and radians; the angle is wrapped.
    #[must_use]
    pub fn new(x_m: f64, y_m: f64, heading_rad: f64) -> Self {
        Self { position: Point::new(x_m, y_m), heading: Heading::new(heading_rad) }
    }

    /// A pose at `position` that looks along `heading`.
    #[must_use]
    pub const fn at(position: Point, heading: Heading) -> Self {
        Self { position, heading }
    }

    /// Returns true if no coordinate is NaN or infinite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        self.position.x.is_finite() && self.position.y.is_finite() && self.heading.0.is_finite()
    }

    /// Expresses the world point `point` in this pose's frame (x ahead, y to the left).
    #[inline]
    #[must_use]
    pub fn to_local(&self, point: Point) -> Vector {
        self.frame().to_local(point)
    }

    /// Expresses `local` (x ahead, y to the left) in the world frame.
    #[inline]
    #[must_use]
    pub fn to_world(&self, local: Vector) -> Point {
        self.frame().to_world(local)
    }

    /// The pose's frame, for transforming many points.
    #[inline]
    #[must_use]
    pub fn frame(&self) -> PoseFrame {
        let (sin, cos) = self.heading.sin_cos();
        PoseFrame { position: self.position, sin, cos }
    }

    /// Euclidean distance of the positions, metres; headings do not count.
    #[inline]
    #[must_use]
    pub fn distance_m(&self, other: &Self) -> f64 {
        (self.position - other.position).norm()
    }

    /// The pose a share `t` of the way to `other`: straight in position, the short way in heading.
    #[must_use]
    pub fn interpolate(&self, other: &Self, t: f64) -> Self {
        Self {
            position: self.position + (other.position - self.position) * t,
            heading: Heading::new(self.heading.0 + t * self.heading.turn_to(other.heading)),
        }
    }
}

/// The frame of a [`Pose`], with its trigonometry done: the same results, faster for many points.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PoseFrame {
    position: Point,
    sin: f64,
    cos: f64,
}

impl PoseFrame {
    /// [`Pose::to_local`].
    #[inline]
    #[must_use]
    pub fn to_local(&self, point: Point) -> Vector {
        self.turn_back(point - self.position)
    }

    /// [`Pose::to_world`].
    #[inline]
    #[must_use]
    pub fn to_world(&self, local: Vector) -> Point {
        self.position + self.turn(local)
    }

    /// A direction of this frame (x ahead, y to the left) in the world.
    #[inline]
    #[must_use]
    pub fn turn(&self, local: Vector) -> Vector {
        let Self { sin, cos, .. } = *self;
        Vector::new(cos * local.x - sin * local.y, sin * local.x + cos * local.y)
    }

    /// A direction of the world in this frame.
    #[inline]
    #[must_use]
    pub fn turn_back(&self, world: Vector) -> Vector {
        let Self { sin, cos, .. } = *self;
        Vector::new(cos * world.x + sin * world.y, -sin * world.x + cos * world.y)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn angles_wrap_to_the_half_open_interval() {
        for (angle, expected) in
            [(PI, PI), (-PI, PI), (3.0 * PI, PI), (0.5, 0.5), (TAU, 0.0), (-3.5, TAU - 3.5)]
        {
            assert!((wrap_angle(angle) - expected).abs() < 1e-12, "{angle} became {}", wrap_angle(angle));
        }
    }

    #[test]
    fn local_and_world_frames_are_inverse() {
        let pose = Pose::new(1.0, -2.0, 0.7);
        let point = Point::new(3.0, 4.0);
        assert!((pose.to_world(pose.to_local(point)) - point).norm() < 1e-12, "round trip moved the point");
        assert!(
            (Pose::new(0.0, 0.0, PI / 2.0).to_local(Point::new(0.0, 2.0)) - Vector::new(2.0, 0.0)).norm()
                < 1e-12,
            "ahead is x"
        );
    }

    #[test]
    fn interpolation_turns_the_short_way() {
        let middle = Pose::new(0.0, 0.0, 3.0).interpolate(&Pose::new(1.0, 0.0, -3.0), 0.5);
        assert!((middle.heading.radians().abs() - PI).abs() < 1e-12, "went through zero: {middle:?}");
    }
}
