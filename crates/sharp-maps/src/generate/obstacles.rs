//! Free-standing obstacles: bricks, boxes, pillars and round islands.

use rand::RngExt;
use sharp_space::{Point, Stream};

use super::blueprint::{Blueprint, Rect};

/// Bricks in staggered rows.
pub(super) fn bricks(plan: &mut Blueprint, rng: &mut Stream) {
    let area = plan.inside();
    let (long, thick, gap) =
        (rng.random_range(1.5..=3.5), rng.random_range(0.6..=1.6), rng.random_range(1.2..=2.0));
    let mut y = area.y0 + gap;
    let mut shift = 0.0;
    while y + thick + gap <= area.y1 {
        let mut x = area.x0 + gap * 0.6 - shift;
        while x < area.x1 {
            plan.fill(Rect { x0: x, x1: x + long, y0: y, y1: y + thick });
            x += long + gap;
        }
        shift = if shift == 0.0 { (long + gap) / 2.0 } else { 0.0 };
        y += thick + gap;
    }
}

/// Boxes at random until `share` of `area` is covered.
pub(super) fn clutter(
    plan: &mut Blueprint,
    rng: &mut Stream,
    area: Rect,
    share: f64,
    side_m: std::ops::RangeInclusive<f64>,
) {
    let mut left = share * area.width() * area.height();
    while left > 0.0 {
        let (w, h) = (rng.random_range(side_m.clone()), rng.random_range(side_m.clone()));
        let x = rng.random_range(area.x0..=area.x1 - w);
        let y = rng.random_range(area.y0..=area.y1 - h);
        plan.fill(Rect { x0: x, x1: x + w, y0: y, y1: y + h });
        left -= w * h;
    }
}

/// Square pillars near the points of a lattice.
pub(super) fn pillars(plan: &mut Blueprint, rng: &mut Stream) {
    let area = plan.inside();
    let (pitch, side) = (rng.random_range(2.2..=3.5), rng.random_range(0.4..=0.9));
    let mut y = area.y0 + pitch / 2.0;
    while y + side < area.y1 {
        let mut x = area.x0 + pitch / 2.0;
        while x + side < area.x1 {
            let (dx, dy) = (rng.random_range(-0.3..=0.3), rng.random_range(-0.3..=0.3));
            plan.fill(Rect { x0: x + dx, x1: x + dx + side, y0: y + dy, y1: y + dy + side });
            x += pitch;
        }
        y += pitch;
    }
}

/// Round islands.
pub(super) fn islands(plan: &mut Blueprint, rng: &mut Stream) {
    let area = plan.inside();
    let mut discs: Vec<(Point, f64)> = Vec::new();
    for _ in 0..60 {
        let center = Point::new(rng.random_range(area.x0..=area.x1), rng.random_range(area.y0..=area.y1));
        let radius = rng.random_range(0.5..=2.2);
        // Islands keep a corridor's width apart, so that the hall stays connected.
        if discs.iter().all(|(other, r)| (other - center).norm() > radius + r + 1.1) {
            plan.fill_where(|point| (point - center).norm() <= radius);
            discs.push((center, radius));
        }
    }
}
