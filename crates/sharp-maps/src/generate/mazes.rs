//! Winding ways: the maze and the spiral.

use rand::RngExt;
use sharp_space::Stream;

use super::blueprint::{Blueprint, Rect};
use super::lattice::{RoomLattice, spanning_tree};
use super::sizes::wall_m;

/// A maze of wide passages with a few loops.
pub(super) fn maze(plan: &mut Blueprint, rng: &mut Stream) {
    let area = plan.inside();
    let side = (area.width() / rng.random_range(2.0..=2.9)) as usize;
    let (pitch, wall) = (area.width() / side as f64, wall_m(rng));
    let grid = RoomLattice { area, columns: side, rows: side, wall };
    let open = spanning_tree(side, side, rng);
    grid.draw(plan, |edge| {
        let width = if open.contains(&edge) || rng.random_bool(0.06) { pitch - wall } else { 0.0 };
        (0.0, width)
    });
}

/// A corridor that winds inwards.
pub(super) fn spiral(plan: &mut Blueprint, rng: &mut Stream) {
    let (wall, pitch) = (wall_m(rng), rng.random_range(1.5..=2.3));
    let mut ring = plan.inside().shrunk(pitch);
    let mut corner = rng.random_range(0..2);
    while ring.width() > 2.0 * pitch {
        plan.outline(ring, wall);
        // One opening per ring, at opposite corners in turn, so that the way in follows the ring.
        let x0 = if corner == 0 { ring.x0 + wall } else { ring.x1 - wall - pitch };
        let y0 = if corner == 0 { ring.y0 - 0.05 } else { ring.y1 - wall - 0.05 };
        plan.clear(Rect { x0, x1: x0 + pitch, y0, y1: y0 + wall + 0.1 });
        ring = ring.shrunk(pitch + wall);
        corner = 1 - corner;
    }
}
