//! Equal rooms in columns and rows, and the walls between them.

use rand::RngExt;
use sharp_space::Stream;

use super::blueprint::{Blueprint, Rect};

/// Equal rooms in columns and rows.
pub(super) struct RoomLattice {
    pub(super) area: Rect,
    pub(super) columns: usize,
    pub(super) rows: usize,
    pub(super) wall: f64,
}

impl RoomLattice {
    /// Draws the inner walls; `opening` gives where along each wall the door starts and its width.
    pub(super) fn draw(&self, plan: &mut Blueprint, mut opening: impl FnMut(InnerWall) -> (f64, f64)) {
        let (w, h) = (self.area.width() / self.columns as f64, self.area.height() / self.rows as f64);
        let half = self.wall / 2.0;
        let mut doors = Vec::new();
        for edge in edges(self.columns, self.rows) {
            let x = self.area.x0 + w * edge.column as f64;
            let y = self.area.y0 + h * edge.row as f64;
            let wall = if edge.right {
                Rect { x0: x + w - half, x1: x + w + half, y0: y - half, y1: y + h + half }
            } else {
                Rect { x0: x - half, x1: x + w + half, y0: y + h - half, y1: y + h + half }
            };
            plan.fill(wall);
            let (start, width) = opening(edge);
            if width > 0.0 {
                doors.push(wall.door(edge.right, self.wall + start, width));
            }
        }
        doors.into_iter().for_each(|door| plan.clear(door));
    }
}

/// A wall between the rooms (column, row) and its right or upper neighbour.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct InnerWall {
    column: usize,
    row: usize,
    /// True for the wall on the right, false for the one above.
    right: bool,
}

fn edges(columns: usize, rows: usize) -> impl Iterator<Item = InnerWall> {
    (0..rows).flat_map(move |row| {
        (0..columns).flat_map(move |column| {
            let right = (column + 1 < columns).then_some(InnerWall { column, row, right: true });
            let above = (row + 1 < rows).then_some(InnerWall { column, row, right: false });
            right.into_iter().chain(above)
        })
    })
}

/// A random spanning tree of the rooms of a lattice, as its open walls.
pub(super) fn spanning_tree(columns: usize, rows: usize, rng: &mut Stream) -> Vec<InnerWall> {
    let mut waiting: Vec<InnerWall> = edges(columns, rows).collect();
    let mut part: Vec<usize> = (0..columns * rows).collect();
    let mut open = Vec::new();
    while !waiting.is_empty() {
        let edge = waiting.swap_remove(rng.random_range(0..waiting.len()));
        let a = edge.row * columns + edge.column;
        let b = if edge.right { a + 1 } else { a + columns };
        let (from, to) = (part[a], part[b]);
        if from != to {
            part.iter_mut().filter(|p| **p == from).for_each(|p| *p = to);
            open.push(edge);
        }
    }
    open
}
