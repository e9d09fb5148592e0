//! The outline of a robot on the floor.

use std::fmt;

use thiserror::Error;

use crate::pose::{Point, Pose, Vector};
use crate::trig;

/// Outlines have at most this many corners.
const CORNERS_MAX: usize = 32;
/// No robot reaches further from its reference point, metres.
const REACH_MAX_M: f64 = 20.0;
/// Corners of the polygon that is drawn for a disc.
const DISC_CORNERS: usize = 48;
/// Corners nearer to a straight side than this count as part of it, metres.
const STRAIGHT_WITHIN_M: f64 = 1e-6;
/// A sharp corner moves at most this many margins when an outline grows.
const MITRE_MAX: f64 = 2.0;

/// Why an outline was refused.
#[derive(Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum FootprintError {
    /// A length is out of range.
    #[error("footprint {field} is {value} m, must be finite, above 0 and at most 20")]
    Length {
        /// The name of the field.
        field: &'static str,
        /// Its value.
        value: f64,
    },
    /// A corner is not a place near the robot.
    #[error(
        "footprint corner {index} is ({x}, {y}), must be finite and at most 20 m from the reference point"
    )]
    Corner {
        /// Its number, from 1.
        index: usize,
        /// Its place ahead, metres.
        x: f64,
        /// Its place to the left, metres.
        y: f64,
    },
    /// The corners do not enclose an area, or too many of them do.
    #[error("footprint has {count} corners that enclose an area, must have 3 to 32")]
    Corners {
        /// How many there are without repeated ones and those on straight sides or in dents.
        count: usize,
    },
    /// The reference point lies outside.
    #[error(
        "footprint leaves the reference point (0, 0) outside or on its border, must have it inside: \
         poses of the robot are poses of that point"
    )]
    ReferenceOutside,
    /// A text that is not Nav2's list of corners.
    #[error(
        "footprint is {text:?}, must be a list of corners such as \"[[0.2, 0.1], [-0.2, 0.1], [0.0, -0.1]]\""
    )]
    Text {
        /// The text, cut where it is long.
        text: String,
    },
}

/// The outline around the robot's reference point: a rectangle, a disc, or a convex polygon.
///
/// The robot looks along x and turns around its reference point, which need not be the middle of the outline.
/// Planners that know rectangles only see the cover: the smallest rectangle around the outline whose middle is
/// the reference point.
#[derive(Clone, Copy, PartialEq)]
pub struct Footprint {
    shape: Shape,
}

/// What a [`Footprint`] looks like.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
pub enum FootprintShape<'a> {
    /// A rectangle with the reference point in its middle; its length lies along the heading.
    Rectangle {
        /// Reach ahead and behind, metres.
        half_length_m: f64,
        /// Reach to either side, metres.
        half_width_m: f64,
    },
    /// A disc around the reference point.
    Disc {
        /// Its radius, metres.
        radius_m: f64,
    },
    /// A convex polygon.
    Polygon {
        /// Its corners, counter-clockwise, metres ahead and to the left of the reference point.
        corners: &'a [Vector],
    },
}

#[derive(Clone, Copy, PartialEq)]
#[expect(clippy::large_enum_variant, reason = "robots are few, and outlines stay plain values")]
enum Shape {
    Rectangle { half_length_m: f64, half_width_m: f64 },
    Disc { radius_m: f64 },
    Polygon(Hull),
}

/// A convex polygon and the lengths that collision tests and planners ask for again and again.
#[derive(Clone, Copy, PartialEq)]
struct Hull {
    count: usize,
    corners: [Vector; CORNERS_MAX],
    half_length_m: f64,
    half_width_m: f64,
    passable_radius_m: f64,
    inner_radius_m: f64,
    outer_radius_m: f64,
}

impl Footprint {
    /// A rectangle that reaches `half_length_m` ahead and behind and `half_width_m` to either side.
    ///
    /// # Errors
    /// Returns an error that names a value that is not finite, not positive or above 20 m.
    pub fn rectangle(half_length_m: f64, half_width_m: f64) -> Result<Self, FootprintError> {
        for (field, value) in [("half_length_m", half_length_m), ("half_width_m", half_width_m)] {
            check_length(field, value)?;
        }
        Ok(Self { shape: Shape::Rectangle { half_length_m, half_width_m } })
    }

    /// A disc around the reference point.
    ///
    /// # Errors
    /// Returns an error if the radius is not finite, not positive or above 20 m.
    pub fn disc(radius_m: f64) -> Result<Self, FootprintError> {
        check_length("radius_m", radius_m)?;
        Ok(Self { shape: Shape::Disc { radius_m } })
    }

    /// The convex polygon around `corners`, in any order, metres ahead and to the left of the reference point.
    /// Dents are filled. Four corners of a rectangle around the reference point give a rectangle.
    ///
    /// # Errors
    /// Returns an error if a corner is not finite or further than 20 m away, if the corners enclose no area or
    /// more than 32 of them are needed, or if the reference point does not lie inside.
    pub fn polygon(corners: &[Vector]) -> Result<Self, FootprintError> {
        let broken = |corner: &&Vector| !corner.iter().all(|value| value.abs() <= REACH_MAX_M);
        if let Some(index) = corners.iter().position(|corner| broken(&corner)) {
            let (x, y) = (corners[index].x, corners[index].y);
            return Err(FootprintError::Corner { index: index + 1, x, y });
        }
        let hull = convex_hull(corners);
        if !(3..=CORNERS_MAX).contains(&hull.len()) {
            return Err(FootprintError::Corners { count: hull.len() });
        }
        if let Some((half_length_m, half_width_m)) = centred_rectangle(&hull) {
            return Self::rectangle(half_length_m, half_width_m);
        }
        let inner_radius_m = sides(&hull).map(|(a, b)| offset_m(a, b)).fold(f64::INFINITY, f64::min);
        if inner_radius_m <= STRAIGHT_WITHIN_M {
            return Err(FootprintError::ReferenceOutside);
        }
        Ok(Self { shape: Shape::Polygon(Hull::new(&hull, inner_radius_m)) })
    }

    /// The outline in Nav2's words: `[[x, y], [x, y], ...]`, metres.
    ///
    /// # Errors
    /// Returns an error if the text is no such list, or as [`polygon`](Self::polygon) does.
    pub fn from_nav2(text: &str) -> Result<Self, FootprintError> {
        let refuse = || FootprintError::Text { text: text.chars().take(80).collect() };
        let flat: String = text.chars().filter(|c| !c.is_whitespace()).collect();
        let inside = flat.strip_prefix("[[").and_then(|rest| rest.strip_suffix("]]")).ok_or_else(refuse)?;
        let corner = |pair: &str| -> Option<Vector> {
            let (x, y) = pair.split_once(',')?;
            Some(Vector::new(x.parse().ok()?, y.parse().ok()?))
        };
        let corners: Option<Vec<Vector>> = inside.split("],[").map(corner).collect();
        Self::polygon(&corners.ok_or_else(refuse)?)
    }

    /// What it looks like.
    #[must_use]
    pub fn shape(&self) -> FootprintShape<'_> {
        match &self.shape {
            &Shape::Rectangle { half_length_m, half_width_m } => {
                FootprintShape::Rectangle { half_length_m, half_width_m }
            }
            &Shape::Disc { radius_m } => FootprintShape::Disc { radius_m },
            Shape::Polygon(hull) => FootprintShape::Polygon { corners: &hull.corners[..hull.count] },
        }
    }

    /// Furthest reach ahead or behind, metres: half the length of the cover.
    #[must_use]
    pub const fn half_length_m(&self) -> f64 {
        match self.shape {
            Shape::Rectangle { half_length_m, .. } => half_length_m,
            Shape::Disc { radius_m } => radius_m,
            Shape::Polygon(hull) => hull.half_length_m,
        }
    }

    /// Furthest reach to either side, metres: half the width of the cover.
    #[must_use]
    pub const fn half_width_m(&self) -> f64 {
        match self.shape {
            Shape::Rectangle { half_width_m, .. } => half_width_m,
            Shape::Disc { radius_m } => radius_m,
            Shape::Polygon(hull) => hull.half_width_m,
        }
    }

    /// The least clearance with which the robot passes anything: its nearer flank, or its length if that is
    /// shorter. A rectangle or a disc never stands nearer to an obstacle. A polygon may, with an end that is
    /// nearer than its flank.
    #[must_use]
    pub fn inscribed_radius_m(&self) -> f64 {
        match &self.shape {
            Shape::Rectangle { half_length_m, half_width_m } => half_length_m.min(*half_width_m),
            Shape::Disc { radius_m } => *radius_m,
            Shape::Polygon(hull) => hull.passable_radius_m,
        }
    }

    /// Radius of the largest disc around the reference point inside: no pose with less clearance is free.
    pub(crate) fn inner_radius_m(&self) -> f64 {
        match &self.shape {
            Shape::Polygon(hull) => hull.inner_radius_m,
            Shape::Rectangle { .. } | Shape::Disc { .. } => self.inscribed_radius_m(),
        }
    }

    /// Radius of the smallest disc around it: every pose with more clearance is free.
    #[must_use]
    pub fn circumscribed_radius_m(&self) -> f64 {
        match &self.shape {
            Shape::Rectangle { half_length_m, half_width_m } => trig::hypot(*half_length_m, *half_width_m),
            Shape::Disc { radius_m } => *radius_m,
            Shape::Polygon(hull) => hull.outer_radius_m,
        }
    }

    /// The outline with every side moved out by `margin_m` metres, or in if it is negative. A very sharp corner
    /// moves by twice the margin at most.
    ///
    /// # Errors
    /// Returns an error if the result is no outline: nothing is left of it, or it is too large.
    pub fn grown(&self, margin_m: f64) -> Result<Self, FootprintError> {
        match &self.shape {
            Shape::Rectangle { half_length_m, half_width_m } => {
                Self::rectangle(half_length_m + margin_m, half_width_m + margin_m)
            }
            Shape::Disc { radius_m } => Self::disc(radius_m + margin_m),
            // Further in, the sides pass the reference point and the outline turns inside out.
            Shape::Polygon(hull) if margin_m <= -hull.inner_radius_m => Err(FootprintError::ReferenceOutside),
            Shape::Polygon(hull) => Self::polygon(&moved_out(hull.corners(), margin_m)),
        }
    }

    /// The corners at `pose`, counter-clockwise, of a rectangle from the front left. A disc gives a polygon
    /// of 48 corners, for pictures.
    #[must_use]
    pub fn outline(&self, pose: &Pose) -> Vec<Point> {
        match &self.shape {
            Shape::Rectangle { half_length_m, half_width_m } => {
                rectangle_corners(*half_length_m, *half_width_m).map(|corner| pose.to_world(corner)).into()
            }
            Shape::Disc { radius_m } => (0..DISC_CORNERS)
                .map(|index| {
                    let (sin, cos) =
                        trig::sin_cos(std::f64::consts::TAU * index as f64 / DISC_CORNERS as f64);
                    pose.to_world(Vector::new(cos, sin) * *radius_m)
                })
                .collect(),
            Shape::Polygon(hull) => hull.corners().iter().map(|&corner| pose.to_world(corner)).collect(),
        }
    }
}

impl fmt::Debug for Footprint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut shown = f.debug_struct("Footprint");
        match self.shape() {
            FootprintShape::Rectangle { half_length_m, half_width_m } => {
                shown.field("half_length_m", &half_length_m).field("half_width_m", &half_width_m)
            }
            FootprintShape::Disc { radius_m } => shown.field("radius_m", &radius_m),
            FootprintShape::Polygon { corners } => {
                let pairs: Vec<_> = corners.iter().map(|corner| (corner.x, corner.y)).collect();
                shown.field("corners", &pairs)
            }
        };
        shown.finish()
    }
}

impl Hull {
    fn new(hull: &[Vector], inner_radius_m: f64) -> Self {
        let mut corners = [Vector::zeros(); CORNERS_MAX];
        corners[..hull.len()].copy_from_slice(hull);
        let furthest = |of: fn(&Vector) -> f64| hull.iter().map(of).fold(f64::NEG_INFINITY, f64::max);
        let (left_m, right_m) = (furthest(|c| c.y), furthest(|c| -c.y));
        let half_length_m = furthest(|c| c.x.abs());
        Self {
            count: hull.len(),
            corners,
            half_length_m,
            half_width_m: left_m.max(right_m),
            passable_radius_m: left_m.min(right_m).min(half_length_m),
            inner_radius_m,
            outer_radius_m: furthest(|c| trig::hypot(c.x, c.y)),
        }
    }

    fn corners(&self) -> &[Vector] {
        &self.corners[..self.count]
    }
}

/// The corners of a rectangle around the origin, counter-clockwise from the front left.
pub(crate) fn rectangle_corners(half_length_m: f64, half_width_m: f64) -> [Vector; 4] {
    let (l, w) = (half_length_m, half_width_m);
    [(l, w), (-l, w), (-l, -w), (l, -w)].map(|(x, y)| Vector::new(x, y))
}

fn check_length(field: &'static str, value: f64) -> Result<(), FootprintError> {
    if value > 0.0 && value <= REACH_MAX_M { Ok(()) } else { Err(FootprintError::Length { field, value }) }
}

/// Twice the area of the triangle of three points, positive if they turn left.
fn turn(a: &Vector, b: &Vector, c: &Vector) -> f64 {
    (b - a).perp(&(c - a))
}

/// The sides of a polygon.
fn sides(corners: &[Vector]) -> impl Iterator<Item = (&Vector, &Vector)> {
    corners.iter().zip(corners.iter().cycle().skip(1))
}

/// How far the origin lies to the left of the side from `a` to `b`, metres.
fn offset_m(a: &Vector, b: &Vector) -> f64 {
    turn(a, b, &Vector::zeros()) / trig::hypot(b.x - a.x, b.y - a.y)
}

/// The corners of the convex hull, counter-clockwise, without those on straight sides (Andrew's monotone chain).
fn convex_hull(points: &[Vector]) -> Vec<Vector> {
    let mut sorted = points.to_vec();
    sorted.sort_by(|a, b| a.x.total_cmp(&b.x).then(a.y.total_cmp(&b.y)));
    sorted.dedup();
    let chain = |points: &mut dyn Iterator<Item = &Vector>| {
        let mut hull: Vec<Vector> = Vec::new();
        for &point in points {
            while let [.., a, b] = &hull[..] {
                let side_m = trig::hypot(point.x - a.x, point.y - a.y);
                if turn(a, b, &point) > STRAIGHT_WITHIN_M * side_m {
                    break;
                }
                hull.pop();
            }
            hull.push(point);
        }
        hull.pop();
        hull
    };
    let mut hull = chain(&mut sorted.iter());
    hull.extend(chain(&mut sorted.iter().rev()));
    hull
}

/// Half length and half width of a hull that is a rectangle around the origin with sides along the axes.
fn centred_rectangle(hull: &[Vector]) -> Option<(f64, f64)> {
    let (length, width) = (hull[0].x.abs(), hull[0].y.abs());
    let fits = |corner: &Vector| {
        (corner.x.abs() - length).abs() <= STRAIGHT_WITHIN_M
            && (corner.y.abs() - width).abs() <= STRAIGHT_WITHIN_M
    };
    (hull.len() == 4 && hull.iter().all(fits)).then_some((length, width))
}

/// The corners of a convex polygon whose sides have moved out by `margin_m`.
fn moved_out(corners: &[Vector], margin_m: f64) -> Vec<Vector> {
    let count = corners.len();
    let outward = |index: usize| {
        let side = corners[(index + 1) % count] - corners[index % count];
        Vector::new(side.y, -side.x) / trig::hypot(side.x, side.y)
    };
    let moved = |index: usize| {
        let (before, after) = (outward(index + count - 1), outward(index));
        let middle = before + after;
        // Its length is twice the cosine of half the turn; the corner moves by the margin divided by that cosine.
        let cos = (0.5 * trig::hypot(middle.x, middle.y)).max(1.0 / MITRE_MAX);
        let along = middle / trig::hypot(middle.x, middle.y).max(f64::MIN_POSITIVE);
        corners[index] + along * (margin_m / cos)
    };
    (0..count).map(moved).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A tractor: the axle at the origin, a long nose.
    const NOSE: [(f64, f64); 5] = [(-0.1, 0.25), (-0.1, -0.25), (0.4, -0.25), (0.6, 0.0), (0.4, 0.25)];

    fn polygon(corners: &[(f64, f64)]) -> Result<Footprint, FootprintError> {
        Footprint::polygon(&corners.iter().map(|&(x, y)| Vector::new(x, y)).collect::<Vec<_>>())
    }

    #[test]
    fn broken_outlines_are_refused() {
        for value in [0.0, -1.0, f64::NAN, f64::INFINITY, 320.0] {
            assert!(Footprint::rectangle(value, 0.1).is_err(), "{value} was accepted");
            assert!(Footprint::disc(value).is_err(), "{value} was accepted");
        }
        let cases: [(&[(f64, f64)], &str); 5] = [
            (&[(0.1, 0.1), (0.1, f64::NAN), (-1.0, 0.0)], "footprint corner 2 is (0.1, NaN)"),
            (&[(0.1, 0.1), (-0.1, -0.1), (0.0, 0.0)], "footprint has 2 corners that enclose an area"),
            (&[], "footprint has 0 corners"),
            (&[(0.1, 0.1), (0.5, 0.1), (0.5, -0.2), (0.1, -0.2)], "footprint leaves the reference point"),
            (&[(0.0, 0.1), (0.5, 0.1), (0.5, -0.2), (0.0, -0.2)], "footprint leaves the reference point"),
        ];
        for (corners, message) in cases {
            let error = polygon(corners).expect_err(message).to_string();
            assert!(error.starts_with(message), "{error}");
        }
        for text in ["", "[]", "[[0.1, 0.2], [0.3]]", "[[a, 0], [1, 0], [0, 1]]", "0.1, 0.2"] {
            let error = Footprint::from_nav2(text).expect_err(text).to_string();
            assert!(error.starts_with(&format!("footprint is {text:?}")), "{error}");
        }
    }

    #[test]
    fn radii_of_the_husky() {
        let husky = Footprint::rectangle(0.5, 0.335).unwrap();
        assert_eq!(husky.inscribed_radius_m(), 0.335, "inscribed");
        assert!((husky.circumscribed_radius_m() - 0.6018).abs() < 1e-4, "circumscribed");
    }

    #[test]
    fn a_polygon_keeps_its_corners_whatever_their_order_and_fills_dents() {
        let nose = polygon(&NOSE).unwrap();
        let mut shuffled = NOSE.to_vec();
        shuffled.reverse();
        shuffled.push((0.1, 0.1));
        shuffled.push((0.15, 0.25));
        assert_eq!(polygon(&shuffled).unwrap(), nose, "inner points and points on sides do not matter");
        assert_eq!((nose.half_length_m(), nose.half_width_m()), (0.6, 0.25), "the cover");
        assert_eq!(nose.inscribed_radius_m(), 0.25, "its flank");
        assert!((nose.inner_radius_m() - 0.1).abs() < 1e-9, "its stern");
        assert_eq!(nose.circumscribed_radius_m(), 0.6, "its nose");
    }

    #[test]
    fn nav2_writes_rectangles_as_four_corners() {
        let text = "[ [0.5, 0.33], [0.5, -0.33], [-0.5, -0.33], [-0.5, 0.33] ]";
        assert_eq!(Footprint::from_nav2(text), Footprint::rectangle(0.5, 0.33));
    }

    #[test]
    fn outlines_grow_by_the_margin_on_each_side() {
        let nose = polygon(&NOSE).unwrap();
        let grown = nose.grown(0.1).unwrap();
        assert!((grown.inner_radius_m() - 0.2).abs() < 1e-9, "{grown:?}");
        assert!((grown.half_width_m() - 0.35).abs() < 1e-9, "{grown:?}");
        let back = grown.grown(-0.1).unwrap();
        assert!((back.half_length_m() - 0.6).abs() < 1e-9, "{back:?}");
        assert!(nose.grown(-0.2).is_err(), "nothing is left around the reference point");
        let diamond = polygon(&[(1.0, 0.0), (0.0, 1.0), (-1.0, 0.0), (0.0, -1.0)]).unwrap();
        assert!(diamond.grown(-1.5).is_err(), "it must not turn inside out");
        assert_eq!(Footprint::disc(0.2).unwrap().grown(0.1).unwrap().half_width_m(), 0.2 + 0.1);
    }
}
