//! Smoothing of a path as an elastic band (Quinlan and Khatib 1993) with bending stiffness.
//!
//! The band minimises tension, bending and the lack of clearance, from coarse to fine: on a coarse band
//! far ends feel each other within few rounds, and each finer level only adds detail.

use sharp_space::Vector;

use crate::traversable::TraversableMask;

/// The spacing of the coarsest band, metres; also the length of a straight end.
pub(crate) const COARSE_M: f64 = 0.4;
/// Rounds on each level; every level halves the spacing.
const ROUNDS: [usize; 3] = [200, 60, 30];
/// A point that moved by less than this, metres, rests until a neighbour moves further.
const REST_M: f64 = 0.000_3;
/// Each move goes this much beyond its balance: over-relaxation, which settles several times sooner.
const OVER_RELAXATION: f64 = 1.6;

/// How the band behaves.
#[derive(Clone, Copy, Debug)]
pub(crate) struct BandSettings<'a> {
    pub(crate) pull_per_m2: f64,
    pub(crate) stiffness_m: f64,
    /// Directions (in the grid) in which the band leaves its first and arrives at its last point.
    pub(crate) ends: [Option<Vector>; 2],
    /// Discs that the band has to meet: centre and radius, in cells.
    pub(crate) discs: &'a [(Vector, f64)],
}

/// Smooths the polyline `attempt` (units of cells); both ends stay.
pub(crate) fn smooth(
    mask: &TraversableMask<'_>,
    attempt: &[Vector],
    settings: &BandSettings<'_>,
) -> Vec<Vector> {
    let resolution = mask.frame().resolution_m;
    let mut points = resample(attempt, COARSE_M / resolution, 4);
    let coarse = step_length(&points);
    let last = points.len() - 1;
    let mut fixed = [1, 1];
    if let Some(direction) = settings.ends[0] {
        points[1] = points[0] + direction * coarse;
        fixed[0] = 2;
    }
    if let Some(direction) = settings.ends[1] {
        points[last - 1] = points[last] - direction * coarse;
        fixed[1] = 2;
    }
    let mut spacing = coarse;
    for (level, &rounds) in ROUNDS.iter().enumerate() {
        if level > 0 {
            points = refine(&points);
            spacing /= 2.0;
            fixed = fixed.map(|count| 2 * count - 1);
            straighten_ends(&mut points, fixed);
        }
        let force = Force::new(settings, spacing, resolution);
        let tethers = tethers(&points, settings.discs);
        let mut rests = vec![false; points.len()];
        for _ in 0..rounds {
            if relax(mask, &mut points, &mut rests, fixed, &force) {
                break;
            }
            for &(index, (center, radius)) in &tethers {
                let off = points[index] - center;
                points[index] = center + off.cap_magnitude(radius);
            }
        }
    }
    points
}

/// For each disc the point that has to stay in it: the one nearest to its centre.
fn tethers(points: &[Vector], discs: &[(Vector, f64)]) -> Vec<(usize, (Vector, f64))> {
    let off = |index: usize, center: Vector| (points[index] - center).norm_squared();
    let nearest =
        |center: Vector| (1..points.len() - 1).min_by(|&a, &b| off(a, center).total_cmp(&off(b, center)));
    discs.iter().filter_map(|&disc| nearest(disc.0).map(|index| (index, disc))).collect()
}

/// The weights of one level; lengths in cells.
struct Force {
    bending: f64,
    pull: f64,
    per_resolution: f64,
    per_inertia: f64,
    rest: f64,
}

impl Force {
    /// For unit tension: bending weighs (stiffness / spacing)², and a curvature of `pull` times the
    /// lack of clearance is in balance.
    fn new(settings: &BandSettings<'_>, spacing: f64, resolution_m: f64) -> Self {
        let spacing_m = spacing * resolution_m;
        let bending = (settings.stiffness_m / spacing_m).powi(2);
        let pull = settings.pull_per_m2 * spacing_m * spacing_m;
        Self {
            bending,
            pull,
            per_resolution: resolution_m.recip(),
            per_inertia: (2.0 + 6.0 * bending + pull).recip(),
            rest: REST_M / resolution_m,
        }
    }
}

/// One round over the free points that do not rest, in place. Returns true if all of them rest.
fn relax(
    mask: &TraversableMask<'_>,
    points: &mut [Vector],
    rests: &mut [bool],
    fixed: [usize; 2],
    force: &Force,
) -> bool {
    let last = points.len() - 1;
    let mut all_rest = true;
    for i in fixed[0]..=last - fixed[1] {
        if rests[i] {
            continue;
        }
        all_rest = false;
        let (before, here, after) = (points[i - 1], points[i], points[i + 1]);
        let tension = before - here * 2.0 + after;
        // Beyond a free end the band goes on straight.
        let second = |a: Vector, b: Vector, c: Vector| a - b * 2.0 + c;
        let left = if i >= 2 { second(points[i - 2], before, here) } else { Vector::zeros() };
        let right = if i + 2 <= last { second(here, after, points[i + 2]) } else { Vector::zeros() };
        let bending = tension * 2.0 - left - right;
        let (clearance_m, gradient) = mask.clearance_and_gradient(here);
        let lack = (mask.comfort_m - clearance_m).max(0.0) * force.per_resolution;
        let step = (tension + bending * force.bending + gradient * (lack * force.pull)) * force.per_inertia;
        let moved = here + step * OVER_RELAXATION;
        // A point that lies in a closed cell must be able to leave it.
        let may_move = is_same_cell(here, moved) || mask.is_open_at(moved) || !mask.is_open_at(here);
        if may_move {
            points[i] = moved;
        }
        if may_move && (moved - here).norm_squared() >= force.rest * force.rest {
            rests[i.saturating_sub(2)..=(i + 2).min(last)].fill(false);
        } else {
            rests[i] = true;
        }
    }
    all_rest
}

/// Whether both points lie in one cell; most moves are short, and looking a cell up takes long.
fn is_same_cell(a: Vector, b: Vector) -> bool {
    let is_inside = b.x >= 0.0 && b.y >= 0.0;
    is_inside && a.x as i64 == b.x as i64 && a.y as i64 == b.y as i64
}

/// Puts the fixed points of either end back onto a straight, off which a new point may lie.
fn straighten_ends(points: &mut [Vector], fixed: [usize; 2]) {
    let last = points.len() - 1;
    let (first_end, second_end) = (fixed[0] - 1, last + 1 - fixed[1]);
    for i in 1..first_end {
        points[i] = points[0].lerp(&points[first_end], i as f64 / first_end as f64);
    }
    for i in second_end + 1..last {
        let share = (i - second_end) as f64 / (last - second_end) as f64;
        points[i] = points[second_end].lerp(&points[last], share);
    }
}

/// Doubles the number of segments by the four-point rule, which keeps the old points and bends smoothly.
fn refine(points: &[Vector]) -> Vec<Vector> {
    let last = points.len() - 1;
    let mut fine = Vec::with_capacity(2 * last + 1);
    for i in 0..last {
        let (a, b) = (points[i], points[i + 1]);
        let before = if i > 0 { points[i - 1] } else { a * 2.0 - b };
        let after = if i + 2 <= last { points[i + 2] } else { b * 2.0 - a };
        fine.push(a);
        fine.push((a + b) * (9.0 / 16.0) - (before + after) / 16.0);
    }
    fine.push(points[last]);
    fine
}

/// The polyline at equal arc lengths near `spacing`, in at least `least` segments; both ends stay.
pub(crate) fn resample(points: &[Vector], spacing: f64, least: usize) -> Vec<Vector> {
    let length: f64 = points.windows(2).map(|pair| (pair[1] - pair[0]).norm()).sum();
    let count = ((length / spacing).round() as usize).max(least);
    let mut resampled = Vec::with_capacity(count + 1);
    let (mut segment, mut before) = (0, 0.0);
    for i in 0..count {
        let arc = length * i as f64 / count as f64;
        let mut step = (points[segment + 1] - points[segment]).norm();
        while before + step < arc && segment + 2 < points.len() {
            before += step;
            segment += 1;
            step = (points[segment + 1] - points[segment]).norm();
        }
        let share = if step > 0.0 { ((arc - before) / step).min(1.0) } else { 0.0 };
        resampled.push(points[segment] + (points[segment + 1] - points[segment]) * share);
    }
    resampled.push(points[points.len() - 1]);
    resampled
}

fn step_length(points: &[Vector]) -> f64 {
    points.windows(2).map(|pair| (pair[1] - pair[0]).norm()).sum::<f64>() / (points.len() - 1) as f64
}

#[cfg(test)]
mod tests {
    use sharp_space::{DistanceField, OccupancyGrid};

    use super::*;

    #[test]
    fn in_the_open_a_band_becomes_straight() {
        let row = ".".repeat(80);
        let grid = OccupancyGrid::from_ascii(0.1, &[row.as_str(); 60].join("\n")).unwrap();
        let field = DistanceField::new(&grid);
        let mask = TraversableMask { field: &field, allowed: &|_| true, least_m: 0.1, comfort_m: 0.5 };
        let attempt = [(20.0, 30.0), (40.0, 40.0), (60.0, 30.0)].map(|(x, y)| Vector::new(x, y));
        let settings = BandSettings { pull_per_m2: 12.0, stiffness_m: 0.6, ends: [None, None], discs: &[] };
        let points = smooth(&mask, &attempt, &settings);
        let off = points.iter().map(|p| (p.y - 30.0).abs()).fold(0.0, f64::max);
        assert!(off < 0.5, "still {off} cells off the straight");
    }

    #[test]
    fn ends_keep_the_wanted_direction() {
        let row = ".".repeat(80);
        let grid = OccupancyGrid::from_ascii(0.1, &[row.as_str(); 60].join("\n")).unwrap();
        let field = DistanceField::new(&grid);
        let mask = TraversableMask { field: &field, allowed: &|_| true, least_m: 0.1, comfort_m: 0.5 };
        let attempt = [(20.0, 30.0), (60.0, 30.0)].map(|(x, y)| Vector::new(x, y));
        let up = Some(Vector::new(1.0, 1.0).normalize());
        let settings = BandSettings { pull_per_m2: 12.0, stiffness_m: 0.6, ends: [up, up], discs: &[] };
        let points = smooth(&mask, &attempt, &settings);
        let turn = |a: Vector, b: Vector| a.angle(&b);
        for pair in points.windows(3) {
            let bend = turn(pair[1] - pair[0], pair[2] - pair[1]);
            assert!(bend < 0.3, "a kink of {bend} rad at {}", pair[1]);
        }
        let leaves = points[1] - points[0];
        assert!((leaves.x - leaves.y).abs() < 1e-9, "leaves diagonally: {leaves}");
    }
}
