//! The widest path problem on a distance field: how wide is the widest way between two places?
//!
//! Cells are added in the order of falling distance, and sets of joined cells are united under the larger of their roots
//! (Kruskal's algorithm for a maximum spanning tree). The trees stay as they grow, each link with the cell that made it:
//! the first link that two cells share a tree by is the narrowest place of the widest way (Camerini 1978). A question
//! climbs at most the logarithm of the number of cells.

use std::cmp::Reverse;
use std::collections::{BTreeMap, BinaryHeap};

use crate::distance_field::DistanceField;
use crate::grid::{Cell, GridFrame};

/// For any two cells of a distance field the narrowest place of the widest way between them.
///
/// A way goes from cell to cell over their sides. Made in some 0.1 s for each million cells.
#[derive(Clone, Debug)]
pub struct WidestPaths {
    frame: GridFrame,
    /// Up the tree; roots are their own parents.
    parents: Vec<u32>,
    /// The link to the parent: the number of the added cell that made it, and its place in the order.
    links: Vec<TreeLink>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
struct TreeLink {
    /// Cells that were added before; no link has all of them.
    order: u32,
    cell: u32,
}

impl WidestPaths {
    /// The widest ways of `field`.
    #[must_use]
    pub fn new(field: &DistanceField) -> Self {
        let frame = *field.frame();
        let (width, count) = (frame.width, frame.len() as u32);
        // The bits of positive floats sort as they do. Equal distances go by number.
        let mut order: Vec<Reverse<(u32, u32)>> = (0..count)
            .map(|index| ((field.at(frame.cell(index as usize)) as f32).to_bits(), index))
            .filter(|&(bits, _)| bits > 0)
            .map(Reverse)
            .collect();
        order.sort_unstable();
        let mut this = Self {
            frame,
            parents: (0..count).collect(),
            links: vec![TreeLink { order: u32::MAX, cell: u32::MAX }; count as usize],
        };
        let (mut sizes, mut is_there) = (vec![1_u32; count as usize], vec![false; count as usize]);
        for (place, &Reverse((_, cell))) in order.iter().enumerate() {
            let index = cell as usize;
            is_there[index] = true;
            let (col, row) = (index % width, index / width);
            let link = TreeLink { order: place as u32, cell };
            let sides = [
                (col > 0).then(|| index - 1),
                (col + 1 < width).then(|| index + 1),
                (row > 0).then(|| index - width),
                (row + 1 < frame.height).then(|| index + width),
            ];
            for side in sides.into_iter().flatten().filter(|&side| is_there[side]) {
                this.unite((index, side), link, &mut sizes);
            }
        }
        this
    }

    fn unite(&mut self, (a, b): (usize, usize), link: TreeLink, sizes: &mut [u32]) {
        let (a, b) = (self.root(a), self.root(b));
        if a != b {
            let (small, large) = if sizes[a] < sizes[b] { (a, b) } else { (b, a) };
            self.parents[small] = large as u32;
            self.links[small] = link;
            sizes[large] += sizes[small];
        }
    }

    fn root(&self, mut at: usize) -> usize {
        while self.parents[at] as usize != at {
            at = self.parents[at] as usize;
        }
        at
    }

    /// A cell with the least distance on the way from `a` to `b` whose least distance is largest; `None` if no way joins
    /// them. The distances of `a` and `b` count.
    ///
    /// # Panics
    /// If a cell lies outside the field.
    #[must_use]
    pub fn narrowest(&self, a: Cell, b: Cell) -> Option<Cell> {
        let (mut a, mut b) = (self.frame.index(a), self.frame.index(b));
        // A cell by itself is its own narrowest place.
        let mut narrowest = a;
        while a != b {
            let lower = if self.links[a] <= self.links[b] { &mut a } else { &mut b };
            let TreeLink { order, cell } = self.links[*lower];
            if order == u32::MAX {
                return None;
            }
            (narrowest, *lower) = (cell as usize, self.parents[*lower] as usize);
        }
        Some(self.frame.cell(narrowest))
    }

    /// The same between two places of several cells: a cell with the least distance on the way from any of `from` to any of
    /// `to` whose least distance is largest; `None` if no way joins them. Where they share cells it is one of those.
    ///
    /// # Panics
    /// If a cell lies outside the field.
    #[must_use]
    pub fn narrowest_between(&self, from: &[Cell], to: &[Cell]) -> Option<Cell> {
        // All cells climb at once, always along the earliest link, until a cell of each side meets one of the other.
        let mut sides: BTreeMap<u32, usize> = BTreeMap::new();
        let mut open = BinaryHeap::new();
        for (side, cells) in [from, to].into_iter().enumerate() {
            for &cell in cells {
                let node = self.frame.index(cell) as u32;
                match sides.insert(node, side) {
                    Some(before) if before != side => return Some(cell),
                    Some(_) => {}
                    None => open.push(Reverse((self.links[node as usize], node))),
                }
            }
        }
        while let Some(Reverse((TreeLink { order, cell }, node))) = open.pop() {
            if order == u32::MAX {
                break;
            }
            let (side, parent) = (sides[&node], self.parents[node as usize]);
            match sides.insert(parent, side) {
                Some(before) if before != side => return Some(self.frame.cell(cell as usize)),
                Some(_) => {}
                None => open.push(Reverse((self.links[parent as usize], parent))),
            }
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use rand::RngExt;

    use super::*;
    use crate::{OccupancyGrid, Seed};

    /// The largest least distance of a way from `a` to `b`, by trying every threshold.
    fn by_floods(field: &DistanceField, a: Cell, b: Cell) -> f64 {
        let frame = field.frame();
        let cells: Vec<Cell> = (0..frame.len()).map(|index| frame.cell(index)).collect();
        let joined = |least: f64| {
            let mut seen = vec![false; frame.len()];
            let mut open = vec![a];
            while let Some(cell) = open.pop() {
                if field.at(cell) < least || std::mem::replace(&mut seen[frame.index(cell)], true) {
                    continue;
                }
                let beside = |other: &&Cell| other.col.abs_diff(cell.col) + other.row.abs_diff(cell.row) == 1;
                open.extend(cells.iter().filter(beside));
            }
            seen[frame.index(b)]
        };
        let thresholds = cells.iter().map(|&cell| field.at(cell)).filter(|&least| least > 0.0);
        thresholds.filter(|&least| joined(least)).fold(0.0, f64::max)
    }

    #[test]
    fn the_narrowest_place_is_as_wide_as_floods_say() {
        let mut rng = Seed(3).stream("grids", 0);
        let (mut joined, mut apart) = (0, 0);
        for _ in 0..60 {
            let row = |_| (0..9).map(|_| if rng.random_range(0..4) == 0 { '#' } else { '.' }).collect();
            let drawing: Vec<String> = (0..8).map(row).collect();
            let field = DistanceField::new(&OccupancyGrid::from_ascii(0.5, &drawing.join("\n")).unwrap());
            let paths = WidestPaths::new(&field);
            for _ in 0..20 {
                let mut cell = || Cell::new(rng.random_range(0..9), rng.random_range(0..8));
                let (a, b) = (cell(), cell());
                let found = paths.narrowest(a, b).map_or(0.0, |cell| field.at(cell));
                assert_eq!(found, by_floods(&field, a, b), "{a:?} to {b:?} in\n{}", drawing.join("\n"));
                if found > 0.0 {
                    joined += 1;
                } else {
                    apart += 1;
                }
                assert_eq!(paths.narrowest_between(&[a], &[b]), paths.narrowest(a, b));
                let (c, d) = (cell(), cell());
                if a != b && a != d && c != b && c != d {
                    let found = paths.narrowest_between(&[a, c], &[b, d]).map_or(0.0, |cell| field.at(cell));
                    let pairs = [(a, b), (a, d), (c, b), (c, d)];
                    let widest = pairs.map(|(one, other)| by_floods(&field, one, other));
                    assert_eq!(found, widest.into_iter().fold(0.0, f64::max), "{pairs:?}");
                }
            }
        }
        assert!(joined > 100 && apart > 100, "{joined} pairs joined, {apart} apart");
    }
}
