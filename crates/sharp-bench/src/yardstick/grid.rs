//! The poses near a guide, as a grid of positions and headings: where the robot fits, and how far there is to go.

use std::f64::consts::TAU;

use sharp_drive::World;
use sharp_guide::GuidedOption;
use sharp_space::{CollisionChecker, Heading, Point, Pose};

use super::motions::intervals;

/// Headings of the grid.
pub(super) const HEADINGS: usize = 48;
/// Headings further off the guide than this are no places of a plan, radians.
const OFF_GUIDE_RAD: f64 = 2.0;
/// Side of a position's cell, as a share of the robot's width.
const CELL_WIDTHS: f64 = 0.15;
/// No cell is smaller, metres.
const CELL_MIN_M: f64 = 0.05;
/// Positions reach this far beyond the circle around the robot's outline, metres.
const BESIDE_M: f64 = 0.4;
/// Where the robot fits is known this many times as finely, in each direction and in heading.
const FINER: usize = 3;
/// How near to an obstacle a robot may touch it for all that grid and draws tell, in cells of the finer grid.
const MARGIN_CELLS: f64 = 1.0;
/// Marks a cell that is not near the guide.
const ELSEWHERE: u32 = u32::MAX;

/// How a pose stands to the obstacles.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Fit {
    /// Free, with the margin that the grid needs.
    Free,
    /// Free, but nearer to an obstacle than that.
    Close,
    /// In an obstacle, or not near the guide.
    Blocked,
}

/// A position near the guide.
#[derive(Clone, Debug)]
pub(super) struct GridPlace {
    pub(super) position: Point,
    /// Way to the end of the guide from the nearest point of it, metres.
    pub(super) remaining_m: f64,
    /// The termination set is here or next to here.
    pub(super) is_near_end: bool,
    /// The robot fits at any heading here and as far around as an action leads.
    pub(super) is_open: bool,
}

/// Poses near the guide of an option.
#[derive(Clone, Debug)]
pub(super) struct PoseGrid {
    origin: Point,
    cell_m: f64,
    columns: usize,
    rows: usize,
    /// The place of each cell.
    index: Vec<u32>,
    /// In the order of the way that is left.
    pub(super) places: Vec<GridPlace>,
    /// For each place and heading whether the robot may stand so; poses that look away from the guide are left out.
    is_state: Vec<bool>,
    /// How the robot fits at the poses of a finer grid, for poses on the way.
    fits: Vec<Fit>,
}

/// The corners of the grid around a pose.
#[derive(Clone, Copy, Debug)]
pub(super) struct PoseCorners {
    /// Number of the place, number of the heading and weight of each.
    pub(super) corners: [(u32, u32, f32); 8],
    /// Whether the pose may lie in the termination set.
    pub(super) is_near_end: bool,
}

impl PoseGrid {
    /// The poses near the guide of `option`; an action leads no farther than `reach_m`.
    pub(super) fn new(world: &World, option: &GuidedOption, reach_m: f64) -> Self {
        let footprint = world.geometry.footprint();
        let cell_m = (CELL_WIDTHS * 2.0 * footprint.half_width_m()).max(CELL_MIN_M);
        let beside_m = footprint.circumscribed_radius_m() + BESIDE_M;
        let poses = option.guide.poses();
        let least = |of: &dyn Fn(&Pose) -> f64| poses.iter().map(of).fold(f64::INFINITY, f64::min) - beside_m;
        let most =
            |of: &dyn Fn(&Pose) -> f64| poses.iter().map(of).fold(f64::NEG_INFINITY, f64::max) + beside_m;
        let (x, y) = (|pose: &Pose| pose.position.x, |pose: &Pose| pose.position.y);
        let origin = Point::new(least(&x), least(&y));
        let count = |low: f64, high: f64| ((high - low) / cell_m).ceil() as usize + 1;
        let (columns, rows) = (count(origin.x, most(&x)), count(origin.y, most(&y)));
        let mut grid = Self {
            origin,
            cell_m,
            columns,
            rows,
            index: vec![ELSEWHERE; columns * rows],
            places: Vec::new(),
            is_state: Vec::new(),
            fits: Vec::new(),
        };
        let mut found: Vec<(f64, f64, usize)> = Vec::new();
        for cell in 0..columns * rows {
            let (off_m, remaining_m, heading) = nearest(option, grid.center(cell));
            if off_m <= beside_m {
                found.push((remaining_m, heading, cell));
            }
        }
        found.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.2.cmp(&b.2)));
        let open_m = footprint.circumscribed_radius_m() + reach_m + MARGIN_CELLS * cell_m / FINER as f64;
        for (remaining_m, guide_heading, cell) in found {
            let position = grid.center(cell);
            grid.index[cell] = grid.places.len() as u32;
            let around =
                [-1.0, 0.0, 1.0].iter().flat_map(|i| [-1.0, 0.0, 1.0].map(|j| (i * cell_m, j * cell_m)));
            let is_end = |(i, j): (f64, f64)| {
                option.is_done(&Pose::new(position.x + i, position.y + j, guide_heading))
            };
            grid.places.push(GridPlace {
                position,
                remaining_m,
                is_near_end: around.into_iter().any(is_end),
                is_open: world.geometry.clearance().sample(position) > open_m,
            });
            for heading in 0..HEADINGS {
                let heading = Heading::new(angle(heading, HEADINGS));
                let is_ahead = heading.turn_to(Heading::new(guide_heading)).abs() <= OFF_GUIDE_RAD;
                grid.is_state.push(is_ahead && world.geometry.is_free(Pose::at(position, heading)));
            }
        }
        grid.fits = grid.finer_fits(world);
        grid
    }

    /// How the robot fits, on the finer grid.
    fn finer_fits(&self, world: &World) -> Vec<Fit> {
        let headings = FINER * HEADINGS;
        let (columns, rows) = (FINER * self.columns, FINER * self.rows);
        let wider = world.geometry.inflated(MARGIN_CELLS * self.cell_m / FINER as f64);
        let mut fits = vec![Fit::Blocked; columns * rows * headings];
        for (cell, fits) in fits.chunks_exact_mut(headings).enumerate() {
            let (column, row) = (cell % columns, cell / columns);
            if self.index[row / FINER * self.columns + column / FINER] == ELSEWHERE {
                continue;
            }
            let at = |i: usize| (i as f64 + 0.5) * self.cell_m / FINER as f64;
            let position = Point::new(self.origin.x + at(column), self.origin.y + at(row));
            for (heading, fits) in fits.iter_mut().enumerate() {
                let pose = Pose::at(position, Heading::new(angle(heading, headings)));
                *fits = match (world.geometry.is_free(pose), wider.is_free(pose)) {
                    (true, true) => Fit::Free,
                    (true, false) => Fit::Close,
                    (false, _) => Fit::Blocked,
                };
            }
        }
        fits
    }

    fn center(&self, cell: usize) -> Point {
        let at = |i: usize| (i as f64 + 0.5) * self.cell_m;
        Point::new(self.origin.x + at(cell % self.columns), self.origin.y + at(cell / self.columns))
    }

    /// Whether place number `place` with heading number `heading` is a state of the grid.
    pub(super) fn is_state(&self, place: u32, heading: u32) -> bool {
        self.is_state[place as usize * HEADINGS + heading as usize]
    }

    /// How the robot fits at a pose near the guide, as exactly as the finer grid says.
    pub(super) fn fit(&self, [x, y, heading_rad]: [f64; 3]) -> Fit {
        let finer = FINER as f64 / self.cell_m;
        let (column, row) = ((x - self.origin.x) * finer, (y - self.origin.y) * finer);
        let (columns, rows) = (FINER * self.columns, FINER * self.rows);
        if !(0.0..columns as f64).contains(&column) || !(0.0..rows as f64).contains(&row) {
            return Fit::Blocked;
        }
        let headings = FINER * HEADINGS;
        let heading = (intervals(heading_rad, headings) + 0.5) as usize % headings;
        self.fits[(row as usize * columns + column as usize) * headings + heading]
    }

    /// The states around a pose, with weights that add up to 1; `None` where there are none.
    pub(super) fn corners(&self, x: f64, y: f64, heading_rad: f64) -> Option<PoseCorners> {
        let (u, v) = ((x - self.origin.x) / self.cell_m - 0.5, (y - self.origin.y) / self.cell_m - 0.5);
        let (column, row) = (u.floor(), v.floor());
        let is_inside =
            column >= 0.0 && row >= 0.0 && column < (self.columns - 1) as f64 && row < (self.rows - 1) as f64;
        if !is_inside {
            return None;
        }
        let (a, b) = ((u - column) as f32, (v - row) as f32);
        let first = row as usize * self.columns + column as usize;
        let w = intervals(heading_rad, HEADINGS);
        let (low, c) = (w as u32 % HEADINGS as u32, (w - w.floor()) as f32);
        let high = (low + 1) % HEADINGS as u32;
        let cells = [
            (first, (1.0 - a) * (1.0 - b)),
            (first + 1, a * (1.0 - b)),
            (first + self.columns, (1.0 - a) * b),
            (first + self.columns + 1, a * b),
        ];
        let mut corners = [(0, 0, 0.0); 8];
        let (mut total, mut is_near_end) = (0.0, false);
        for (i, (cell, weight)) in cells.into_iter().enumerate() {
            let place = self.index[cell];
            if place == ELSEWHERE {
                continue;
            }
            is_near_end |= self.places[place as usize].is_near_end;
            for (j, (heading, share)) in [(low, 1.0 - c), (high, c)].into_iter().enumerate() {
                if self.is_state(place, heading) {
                    corners[2 * i + j] = (place, heading, weight * share);
                    total += weight * share;
                }
            }
        }
        if total <= 1e-6 {
            return None;
        }
        for corner in &mut corners {
            corner.2 /= total;
        }
        Some(PoseCorners { corners, is_near_end })
    }
}

/// The angle of heading number `index` of `count`, radians.
pub(super) fn angle(index: usize, count: usize) -> f64 {
    index as f64 * TAU / count as f64
}

/// Distance of `point` from the guide, way to its end from the nearest pose, and the direction there.
fn nearest(option: &GuidedOption, point: Point) -> (f64, f64, f64) {
    let guide = &option.guide;
    let off_m = |pose: &Pose| (pose.position - point).norm();
    let mut best = (f64::INFINITY, 0.0, 0.0);
    let mut remaining_m = guide.length_m();
    for (index, pose) in guide.poses().iter().enumerate() {
        if index > 0 {
            remaining_m -= guide.poses()[index - 1].distance_m(pose);
        }
        if off_m(pose) < best.0 {
            best = (off_m(pose), remaining_m, pose.heading.radians());
        }
    }
    best
}
