//! Walls across a hall: gaps, screens, offset, slanted and funnel-shaped walls, and the channel.

use rand::RngExt;
use sharp_space::{Point, Stream, Vector};

use super::blueprint::{Blueprint, Rect};
use super::sizes::{door_m, wall_m};

/// `count` walls across the map, top to bottom, with doors at random heights.
pub(super) fn walls_with_doors(
    plan: &mut Blueprint,
    rng: &mut Stream,
    count: usize,
    doors: std::ops::RangeInclusive<usize>,
) {
    let area = plan.inside();
    let pitch = area.width() / (count + 1) as f64;
    for i in 1..=count {
        let x = area.x0 + pitch * (i as f64 + rng.random_range(-0.25..=0.25));
        let wall = wall_m(rng);
        plan.fill(Rect { x0: x, x1: x + wall, ..area });
        for _ in 0..rng.random_range(doors.clone()) {
            let door = door_m(rng);
            let y = rng.random_range(area.y0 + 0.3..=area.y1 - door - 0.3);
            plan.clear(Rect { x0: x - 0.1, x1: x + wall + 0.1, y0: y, y1: y + door });
        }
    }
}

/// Parallel walls, attached to one side and the other in turn.
pub(super) fn offset_walls(plan: &mut Blueprint, rng: &mut Stream) {
    let area = plan.inside();
    let count = rng.random_range(3..=6);
    let pitch = area.width() / (count + 1) as f64;
    for i in 1..=count {
        let x = area.x0 + pitch * i as f64;
        let gap = rng.random_range(1.2..=3.0);
        let (y0, y1) = if i % 2 == 0 { (area.y0, area.y1 - gap) } else { (area.y0 + gap, area.y1) };
        plan.fill(Rect { x0: x, x1: x + wall_m(rng), y0, y1 });
    }
}

/// Slanted walls with one door each.
pub(super) fn slanted(plan: &mut Blueprint, rng: &mut Stream) {
    let area = plan.inside();
    let count = rng.random_range(2..=3);
    for i in 1..=count {
        let middle = area.x0 + area.width() * i as f64 / (count + 1) as f64;
        let lean = rng.random_range(-0.12..=0.12) * area.width();
        let from = Point::new(middle - lean, area.y0);
        let to = Point::new(middle + lean, area.y1);
        let length = (to - from).norm();
        let (wall, door) = (wall_m(rng), door_m(rng));
        let start = rng.random_range(0.5..=length - door - 0.5);
        let along = (to - from) / length;
        let across = Vector::new(-along.y, along.x);
        plan.fill_where(|point| {
            let s = (point - from).dot(&along);
            let beside = (point - from).dot(&across).abs() <= wall / 2.0;
            beside && !(start..=start + door).contains(&s)
        });
    }
}

/// A thick block with one or two narrow channels through it.
pub(super) fn channel(plan: &mut Blueprint, rng: &mut Stream) {
    let area = plan.inside();
    let length = rng.random_range(2.5..=6.0);
    let x0 = rng.random_range(area.x0 + 3.0..=area.x1 - 3.0 - length);
    let block = Rect { x0, x1: x0 + length, ..area };
    plan.fill(block);
    for _ in 0..rng.random_range(1..=2) {
        let width = rng.random_range(1.1..=1.6);
        let y0 = rng.random_range(area.y0 + 0.2..=area.y1 - width - 0.2);
        plan.clear(Rect { y0, y1: y0 + width, ..block });
    }
}

/// A thick wall whose openings narrow towards the middle.
pub(super) fn funnels(plan: &mut Blueprint, rng: &mut Stream) {
    let area = plan.inside();
    let middle = (area.x0 + area.x1) / 2.0 + rng.random_range(-1.5..=1.5);
    let depth = rng.random_range(1.0..=2.5);
    let count = rng.random_range(1..=2);
    let pitch = area.height() / f64::from(count);
    let throats: Vec<(f64, f64)> = (0..count)
        .map(|i| {
            let center = area.y0 + pitch * (f64::from(i) + rng.random_range(0.3..=0.7));
            (center, door_m(rng) / 2.0)
        })
        .collect();
    plan.fill_where(|point| {
        let off = (point.x - middle).abs();
        off <= depth && throats.iter().all(|(y, half)| (point.y - y).abs() > half + off * 0.8)
    });
}
