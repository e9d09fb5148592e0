//! Whether an outline touches an obstacle, decided with geometry of this file's own: it shares no code with the planner.

use sharp_space::{Occupancy, OccupancyGrid, Pose, trig};

/// An outline in the robot's frame, metres: a disc, or corners counter-clockwise.
#[derive(Clone, Debug)]
pub(crate) enum Outline {
    Disc(f64),
    Corners(Vec<(f64, f64)>),
}

/// How deep the outline at `pose` overlaps the square cell around (x, y), metres; 0 or less if it does not.
fn overlap_m(outline: &Outline, pose: Pose, (x, y): (f64, f64), side_m: f64) -> f64 {
    let (sin, cos) = trig::sin_cos(pose.heading.radians());
    let (px, py, half) = (pose.position.x, pose.position.y, 0.5 * side_m);
    match outline {
        Outline::Disc(radius_m) => {
            let (dx, dy) = (((px - x).abs() - half).max(0.0), ((py - y).abs() - half).max(0.0));
            radius_m - (dx * dx + dy * dy).sqrt()
        }
        Outline::Corners(corners) => {
            let robot: Vec<(f64, f64)> =
                corners.iter().map(|(a, b)| (px + cos * a - sin * b, py + sin * a + cos * b)).collect();
            let cell =
                [(x - half, y - half), (x + half, y - half), (x + half, y + half), (x - half, y + half)];
            let normals = |of: &[(f64, f64)]| -> Vec<(f64, f64)> {
                let next = of.iter().cycle().skip(1);
                of.iter().zip(next).map(|(a, b)| (b.1 - a.1, a.0 - b.0)).collect()
            };
            // Two convex shapes are apart if one of their sides separates them.
            normals(&robot)
                .into_iter()
                .chain(normals(&cell))
                .map(|(nx, ny)| {
                    let length = trig::hypot(nx, ny);
                    let along = |of: &[(f64, f64)]| -> Vec<f64> {
                        of.iter().map(|(a, b)| (a * nx + b * ny) / length).collect()
                    };
                    let low = |of: &[f64]| of.iter().copied().fold(f64::INFINITY, f64::min);
                    let high = |of: &[f64]| of.iter().copied().fold(f64::NEG_INFINITY, f64::max);
                    let (a, b) = (along(&robot), along(&cell));
                    (high(&a) - low(&b)).min(high(&b) - low(&a))
                })
                .fold(f64::INFINITY, f64::min)
        }
    }
}

/// The distance of the outline's furthest point from its reference point, metres.
fn radius_m(outline: &Outline) -> f64 {
    match outline {
        Outline::Disc(radius_m) => *radius_m,
        Outline::Corners(corners) => corners.iter().map(|&(x, y)| trig::hypot(x, y)).fold(0.0, f64::max),
    }
}

/// The deepest overlap of `outline` at `pose` with any cell near it that is not free; maps here are not turned.
pub(crate) fn deepest_m(grid: &OccupancyGrid, outline: &Outline, pose: Pose) -> f64 {
    let frame = grid.frame();
    let side_m = frame.resolution_m;
    // No corner of outline and cell is further away together.
    let reach_m = side_m + radius_m(outline);
    let near = |at_m: f64, from_m: f64, count: usize| {
        let (at, reach) = ((at_m - from_m) / side_m, reach_m / side_m);
        (at - reach).max(0.0) as usize..((at + reach + 1.0).max(0.0) as usize).min(count)
    };
    let origin = frame.origin.position;
    let mut deepest_m = f64::NEG_INFINITY;
    for row in near(pose.position.y, origin.y, frame.height) {
        for col in near(pose.position.x, origin.x, frame.width) {
            if grid.get(sharp_space::Cell::new(col, row)) != Occupancy::Free {
                let (x, y) = (origin.x + (col as f64 + 0.5) * side_m, origin.y + (row as f64 + 0.5) * side_m);
                let (dx, dy) = (x - pose.position.x, y - pose.position.y);
                if dx * dx + dy * dy < reach_m * reach_m {
                    deepest_m = deepest_m.max(overlap_m(outline, pose, (x, y), side_m));
                }
            }
        }
    }
    deepest_m
}
