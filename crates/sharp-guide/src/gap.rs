//! Gaps: how far apart walls stand around a place.

use sharp_space::{DistanceField, Heading, Point, trig};

use crate::context::CHECK_STEP_M;

/// The width of a gap is known to this, cells.
const STEP: f64 = 0.05;
/// Directions in which a way's gap is measured: straight across and so far to both sides, radians.
///
/// Further to the sides lines would cut across corners, past which a way may lead.
const ACROSS: [f64; 3] = [-0.25, 0.0, 0.25];

/// The free length of the shortest line through `place` in one of the `directions` (radians), metres.
#[must_use]
pub fn gap_m(field: &DistanceField, place: Point, directions: impl IntoIterator<Item = f64>) -> f64 {
    let frame = field.frame();
    let step_m = STEP * frame.resolution_m;
    let free_m = |angle_rad: f64| {
        let (sin, cos) = (trig::sin(angle_rad), trig::cos(angle_rad));
        let at = |step: u32| {
            let along_m = f64::from(step) * step_m;
            frame.cell_at(Point::new(place.x + along_m * cos, place.y + along_m * sin))
        };
        let mut step = 1;
        while let Some(clearance_m) = at(step).map(|cell| field.at(cell)).filter(|&free_m| free_m > 0.0) {
            // From centre to centre: what is nearer than a diagonal less is free.
            let sure_m = clearance_m - std::f64::consts::SQRT_2 * frame.resolution_m;
            step += (sure_m / step_m).max(1.0) as u32;
        }
        // The edge lies somewhere in the step after the last free one.
        (f64::from(step) - 0.5) * step_m
    };
    let line_m = |angle_rad: f64| free_m(angle_rad) + free_m(angle_rad + std::f64::consts::PI);
    directions.into_iter().map(line_m).fold(f64::INFINITY, f64::min)
}

/// The narrowest gap that `way` crosses, metres, for a robot that needs `radius_m` on both sides: a wider robot cannot take this way.
/// Infinite where it has that room everywhere.
pub(crate) fn narrowest_gap_m(field: &DistanceField, way: &[Point], radius_m: f64) -> f64 {
    let enough_m = radius_m + field.frame().resolution_m;
    let is_wide = |place: Point| field.sample(place) >= enough_m;
    let across = |pair: &[Point]| {
        let ahead = pair[1] - pair[0];
        // A wall is thinner than the way from one point to the next.
        let count = (ahead.norm() / CHECK_STEP_M).ceil();
        if (is_wide(pair[0]) && is_wide(pair[1])) || count == 0.0 {
            return f64::INFINITY;
        }
        let across_rad = Heading::of(ahead).radians() + std::f64::consts::FRAC_PI_2;
        let places = (0..count as u32).map(|i| pair[0] + ahead * (f64::from(i) / count));
        let gaps_m = places
            .filter(|&place| !is_wide(place))
            .map(|place| gap_m(field, place, ACROSS.map(|off_rad| across_rad + off_rad)));
        gaps_m.fold(f64::INFINITY, f64::min)
    };
    way.windows(2).map(across).fold(f64::INFINITY, f64::min)
}

#[cfg(test)]
mod tests {
    use sharp_space::OccupancyGrid;

    use super::*;

    #[test]
    fn a_gap_is_as_wide_as_it_was_drawn() {
        let grid = OccupancyGrid::from_ascii(
            0.25,
            "
            ########
            #..##..#
            #......#
            #......#
            #......#
            #..##..#
            #..##..#
            ########",
        );
        let field = DistanceField::new(&grid.unwrap());
        let lines =
            |count: u32| (0..count).map(move |i| std::f64::consts::PI * f64::from(i) / f64::from(count));
        let door_m = gap_m(&field, Point::new(1.0, 1.125), lines(24));
        assert!((door_m - 0.75).abs() < 0.02, "the door has 0.75 m, not {door_m}");
        let corner_m = gap_m(&field, Point::new(0.3, 0.3), lines(24));
        assert!(corner_m < 0.2, "beside a corner a line cuts across it: {corner_m}");
        let way = [Point::new(0.5, 1.1), Point::new(1.0, 1.1), Point::new(1.5, 1.1)];
        assert!((narrowest_gap_m(&field, &way, 0.4) - 0.75).abs() < 0.02, "the door is on the way");
        assert_eq!(narrowest_gap_m(&field, &way, 0.05), f64::INFINITY, "a small robot has room");
        let room = OccupancyGrid::from_ascii(0.25, &["............"; 12].join("\n"));
        let round_a_corner = [(0.4, 0.15), (0.15, 0.15), (0.15, 0.4)].map(|(x, y)| Point::new(x, y));
        let beside_m = narrowest_gap_m(&DistanceField::new(&room.unwrap()), &round_a_corner, 0.4);
        assert!(beside_m > 0.6, "a corner is no gap: {beside_m}");
    }
}
