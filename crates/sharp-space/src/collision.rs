//! The collision function f : X → {0, 1} of the paper. Here true means free.

use std::sync::Arc;

use crate::distance_field::DistanceField;
use crate::footprint::{Footprint, FootprintShape, rectangle_corners};
use crate::grid::{GridFrame, OccupancyGrid};
use crate::pose::{Pose, Vector};

/// Decides which poses are free of collision. Implement [`is_free`](Self::is_free); the test of segments is
/// provided. [`conformance::check_collision_checker`](crate::conformance::check_collision_checker) tests an
/// implementation.
pub trait CollisionChecker {
    /// Returns true if the footprint at `pose` lies inside the map and touches no blocked cell.
    fn is_free(&self, pose: Pose) -> bool;

    /// Returns true if poses at most `step_m` metres apart from `from` to `to` are free, ends included.
    ///
    /// Headings turn the short way in step with the position. A turn in place is sampled every `step_m`
    /// radians, so that a corner a metre away moves by `step_m`.
    fn is_segment_free(&self, from: Pose, to: Pose, step_m: f64) -> bool {
        let length = from.distance_m(&to).max(from.heading.turn_to(to.heading).abs());
        let steps = (length / step_m).ceil().max(1.0) as usize;
        (0..=steps).all(|i| self.is_free(from.interpolate(&to, i as f64 / steps as f64)))
    }
}

macro_rules! forward {
    ($($pointer:ty),*) => {$(
        impl<C: CollisionChecker + ?Sized> CollisionChecker for $pointer {
            fn is_free(&self, pose: Pose) -> bool {
                (**self).is_free(pose)
            }

            fn is_segment_free(&self, from: Pose, to: Pose, step_m: f64) -> bool {
                (**self).is_segment_free(from, to, step_m)
            }
        }
    )*};
}

forward!(&C, Box<C>, Arc<C>);

/// Exact test of an outline against the blocked cells of a grid.
///
/// A distance field decides the clear cases. Between the inscribed and the circumscribed radius, the
/// outline is cut into grid rows, and prefix counts of blocked cells answer each row in constant time. An
/// outline that only touches a cell's side counts as free.
#[derive(Clone, Debug)]
pub struct FootprintChecker {
    footprint: Footprint,
    field: Arc<DistanceField>,
    /// `width + 1` counts a row: blocked cells left of each column border.
    blocked_before: Arc<[u32]>,
}

impl FootprintChecker {
    /// A checker for `footprint` among everything in `grid` that is not free.
    #[must_use]
    pub fn new(grid: &OccupancyGrid, footprint: Footprint) -> Self {
        let frame = grid.frame();
        let mut blocked_before = Vec::with_capacity((frame.width + 1) * frame.height);
        for row in grid.cells().chunks_exact(frame.width) {
            let mut count = 0;
            blocked_before.push(count);
            for &cell in row {
                count += u32::from(cell != crate::Occupancy::Free);
                blocked_before.push(count);
            }
        }
        let field = Arc::new(DistanceField::new(grid));
        Self { footprint, field, blocked_before: blocked_before.into() }
    }

    /// A checker for another outline in the same map. Both share the distance field and the counts.
    #[must_use]
    pub fn with_footprint(&self, footprint: Footprint) -> Self {
        Self { footprint, field: Arc::clone(&self.field), blocked_before: Arc::clone(&self.blocked_before) }
    }

    /// The outline it tests.
    #[must_use]
    pub const fn footprint(&self) -> &Footprint {
        &self.footprint
    }

    /// The distance field of the grid it tests against.
    #[must_use]
    pub fn field(&self) -> &DistanceField {
        &self.field
    }

    /// The exact test alone, without the distance field's short cuts.
    #[must_use]
    pub fn is_free_exact(&self, pose: Pose) -> bool {
        let frame = self.field.frame();
        let place = |corner: Vector| frame.to_grid(pose.to_world(corner));
        match self.footprint.shape() {
            FootprintShape::Rectangle { half_length_m, half_width_m } => {
                self.is_polygon_free(&rectangle_corners(half_length_m, half_width_m).map(place))
            }
            FootprintShape::Disc { radius_m } => {
                self.is_disc_free(frame.to_grid(pose.position), radius_m / frame.resolution_m)
            }
            FootprintShape::Polygon { corners } => {
                self.is_polygon_free(&corners.iter().map(|&corner| place(corner)).collect::<Vec<_>>())
            }
        }
    }

    /// Tests a convex polygon, in units of cells.
    fn is_polygon_free(&self, corners: &[Vector]) -> bool {
        let frame = self.field.frame();
        let (width, height) = (frame.width as f64, frame.height as f64);
        let inside = |c: &Vector| c.x >= 0.0 && c.y >= 0.0 && c.x <= width && c.y <= height;
        if !corners.iter().all(inside) {
            return false;
        }
        let low = corners.iter().map(|c| c.y).fold(f64::INFINITY, f64::min);
        let high = corners.iter().map(|c| c.y).fold(f64::NEG_INFINITY, f64::max);
        let (first, last) = (low as usize, (high.ceil() as usize).min(frame.height));
        (first..last).all(|row| {
            let (left, right) = span_in_strip(corners, row as f64, row as f64 + 1.0);
            self.is_span_free(frame, row, left, right)
        })
    }

    /// Tests a disc, in units of cells. In a strip it is widest where it is nearest to its centre.
    fn is_disc_free(&self, center: Vector, radius: f64) -> bool {
        let frame = self.field.frame();
        let (width, height) = (frame.width as f64, frame.height as f64);
        let inside = center.x >= radius
            && center.y >= radius
            && center.x + radius <= width
            && center.y + radius <= height;
        if !inside {
            return false;
        }
        let (first, last) =
            ((center.y - radius) as usize, ((center.y + radius).ceil() as usize).min(frame.height));
        (first..last).all(|row| {
            let nearest = center.y.clamp(row as f64, row as f64 + 1.0) - center.y;
            let half = (radius * radius - nearest * nearest).max(0.0).sqrt();
            self.is_span_free(frame, row, center.x - half, center.x + half)
        })
    }

    fn is_span_free(&self, frame: &GridFrame, row: usize, left: f64, right: f64) -> bool {
        if left >= right {
            return true;
        }
        let (from, to) = (left.max(0.0) as usize, (right.ceil() as usize).min(frame.width));
        let counts = &self.blocked_before[row * (frame.width + 1)..(row + 1) * (frame.width + 1)];
        counts[to] == counts[from]
    }
}

impl CollisionChecker for FootprintChecker {
    fn is_free(&self, pose: Pose) -> bool {
        let frame = self.field.frame();
        let Some(cell) = frame.cell_at(pose.position) else { return false };
        let distance = self.field.at(cell);
        // The pose is at most half a diagonal from the cell's centre, the blocked cell's nearest
        // point at most half a diagonal from its centre.
        let half_diagonal = std::f64::consts::FRAC_1_SQRT_2 * frame.resolution_m;
        if distance - 2.0 * half_diagonal > self.footprint.circumscribed_radius_m() {
            return true;
        }
        if distance + half_diagonal < self.footprint.inner_radius_m() {
            return false;
        }
        self.is_free_exact(pose)
    }
}

/// The x extent of a convex polygon inside the strip `y0..y1`; empty as `(∞, −∞)`.
fn span_in_strip(corners: &[Vector], y0: f64, y1: f64) -> (f64, f64) {
    let (mut left, mut right) = (f64::INFINITY, f64::NEG_INFINITY);
    let mut include = |x: f64| {
        left = left.min(x);
        right = right.max(x);
    };
    for (i, a) in corners.iter().enumerate() {
        let b = &corners[(i + 1) % corners.len()];
        if (y0..=y1).contains(&a.y) {
            include(a.x);
        }
        for y in [y0, y1] {
            if (a.y - y) * (b.y - y) < 0.0 {
                include(a.x + (b.x - a.x) * (y - a.y) / (b.y - a.y));
            }
        }
    }
    (left, right)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn room() -> FootprintChecker {
        let grid = OccupancyGrid::from_ascii(
            0.5,
            "
            ##########
            #........#
            #........#
            ####.#####
            #........#
            ##########",
        )
        .unwrap();
        FootprintChecker::new(&grid, Footprint::rectangle(0.6, 0.2).unwrap())
    }

    #[test]
    fn a_long_robot_passes_a_door_only_straight() {
        let checker = room();
        let door = |heading| checker.is_free(Pose::new(2.25, 1.25, heading));
        assert!(door(std::f64::consts::FRAC_PI_2), "straight through");
        assert!(!door(0.0), "sideways");
        assert!(!door(1.1), "at an angle");
    }

    #[test]
    fn short_cuts_agree_with_the_exact_test() {
        let checker = room();
        arbtest::arbtest(|u| {
            let mut coordinate =
                |max: f64| u.int_in_range(0..=100_000_u32).map(|i| f64::from(i) / 100_000.0 * max);
            let pose = Pose::new(coordinate(6.0)? - 0.5, coordinate(4.0)? - 0.5, coordinate(6.3)?);
            assert_eq!(checker.is_free(pose), checker.is_free_exact(pose), "{pose:?}");
            Ok(())
        });
    }

    #[test]
    fn the_exact_test_agrees_with_dense_sampling() {
        let checker = room();
        let grid_free = |pose: Pose| {
            // A lattice of points 1 cm apart over the rectangle, border shrunk by a hair.
            (-59..=59).all(|i| {
                (-19..=19).all(|j| {
                    let point = pose.to_world(Vector::new(f64::from(i) * 0.01, f64::from(j) * 0.01));
                    checker.field.frame().cell_at(point).is_some_and(|cell| checker.field.at(cell) > 0.0)
                })
            })
        };
        for i in 0..400 {
            let t = f64::from(i);
            let pose = Pose::new(0.5 + (t * 0.618).fract() * 4.0, 0.5 + (t * 0.414).fract() * 2.0, t * 0.37);
            if checker.is_free(pose) {
                assert!(grid_free(pose), "{pose:?} was called free");
            }
        }
    }

    /// Outlines that are no rectangle around the reference point.
    fn other_outlines() -> [Footprint; 3] {
        [
            Footprint::disc(0.35).unwrap(),
            Footprint::from_nav2("[[0.7, 0.0], [0.4, 0.25], [-0.15, 0.25], [-0.15, -0.25], [0.4, -0.25]]")
                .unwrap(),
            Footprint::from_nav2("[[0.2, 0.1], [0.2, -0.4], [-0.2, -0.4], [-0.2, 0.1]]").unwrap(),
        ]
    }

    #[test]
    fn discs_and_polygons_agree_with_an_exact_test_of_every_cell() {
        for outline in other_outlines() {
            let checker = room().with_footprint(outline);
            let frame = checker.field.frame();
            let blocked: Vec<Vector> = (0..frame.len())
                .map(|index| frame.cell(index))
                .filter(|&cell| checker.field.at(cell) <= 0.0)
                .map(|cell| frame.center(cell).coords)
                .collect();
            let (mut free, mut near) = (0, 0);
            arbtest::arbtest(|u| {
                let mut coordinate =
                    |max: f64| u.int_in_range(0..=100_000_u32).map(|i| f64::from(i) / 100_000.0 * max);
                let pose = Pose::new(coordinate(6.0)? - 0.5, coordinate(4.0)? - 0.5, coordinate(6.3)?);
                let answer = checker.is_free(pose);
                assert_eq!(answer, checker.is_free_exact(pose), "{outline:?} at {pose:?}");
                // Separating axes of a polygon and a square; the disc's polygon is inside the disc.
                let corners: Vec<Vector> =
                    outline.outline(&pose).iter().map(|corner| corner.coords).collect();
                let gap_m = blocked
                    .iter()
                    .map(|center| gap_to_cell_m(&corners, center, frame.resolution_m))
                    .fold(f64::INFINITY, f64::min);
                let edge_m = corners
                    .iter()
                    .map(|c| c.x.min(c.y).min(frame.width_m() - c.x).min(frame.height_m() - c.y))
                    .fold(gap_m, f64::min);
                near += usize::from(edge_m.abs() < 0.2);
                free += usize::from(answer);
                assert!(
                    !answer || edge_m > -1e-9,
                    "{outline:?} at {pose:?} was called free, overlap {edge_m}"
                );
                // A hair more than a 48-gon lies inside its disc.
                assert!(answer || edge_m < 1e-3, "{outline:?} at {pose:?} was called blocked, gap {edge_m}");
                Ok(())
            });
            assert!(free > 0 && near > 0, "{outline:?}: {free} free, {near} near");
        }
    }

    /// Width of the widest gap between a convex polygon and a cell along any of their normals; negative if they overlap.
    fn gap_to_cell_m(corners: &[Vector], center: &Vector, side_m: f64) -> f64 {
        let half = 0.5 * side_m;
        let cell = [(half, half), (-half, half), (-half, -half), (half, -half)]
            .map(|(x, y)| center + Vector::new(x, y));
        let sides = corners.iter().zip(corners.iter().cycle().skip(1));
        let axes = sides.map(|(a, b)| (b - a).normalize()).map(|along| Vector::new(along.y, -along.x));
        let axes = axes.chain([Vector::new(1.0, 0.0), Vector::new(0.0, 1.0)]);
        let extent = |points: &[Vector], axis: &Vector| {
            let along = points.iter().map(|point| point.dot(axis));
            along.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), at| (low.min(at), high.max(at)))
        };
        axes.map(|axis| {
            let ((a, b), (c, d)) = (extent(corners, &axis), extent(&cell, &axis));
            (c - b).max(a - d)
        })
        .fold(f64::NEG_INFINITY, f64::max)
    }

    #[test]
    fn leaving_the_map_is_a_collision() {
        assert!(!room().is_free(Pose::new(-1.0, 1.0, 0.0)), "outside");
        assert!(!room().is_free(Pose::new(f64::NAN, 1.0, 0.0)), "NaN");
    }
}
