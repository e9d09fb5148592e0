//! The medial axis of free space as a graph: where passages run and how wide they are.
//!
//! Distance-ordered homotopic thinning: cells are removed in the order of their clearance if that
//! does not change the topology of the rest. The anchors, which are the prominent peaks of the
//! clearance, are never removed. What is left are ridges one cell wide that join all peaks and
//! surround every obstacle. Ties are broken by the cells' order: equal maps give equal graphs.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use sharp_space::{Cell, DistanceField, GridFrame};

/// A place where ridges meet or end, or where the clearance has a peak.
#[derive(Clone, Debug)]
pub(crate) struct SkeletonNode {
    /// Its cell with the most clearance.
    pub cell: Cell,
    /// Number of ridges that reach it.
    pub degree: usize,
}

/// A ridge between two nodes.
#[derive(Clone, Debug)]
pub(crate) struct Ridge {
    /// The nodes at the first and at the last cell, as indices.
    pub ends: [Option<usize>; 2],
    /// Its cells in order, without the nodes'.
    pub cells: Vec<Cell>,
}

/// The medial axis of the cells with a least clearance.
#[derive(Clone, Debug)]
pub(crate) struct Skeleton {
    pub nodes: Vec<SkeletonNode>,
    pub ridges: Vec<Ridge>,
}

impl Skeleton {
    /// The skeleton of the cells with at least `min_clearance_m`; a clearance peak becomes a node
    /// if it exceeds the pass to every higher peak by the factor `peak_ratio`.
    pub(crate) fn new(clearance: &DistanceField, min_clearance_m: f64, peak_ratio: f64) -> Self {
        let frame = *clearance.frame();
        let heights: Vec<f32> = (0..frame.len()).map(|i| clearance.at(frame.cell(i)) as f32).collect();
        let inside: Vec<bool> = heights.iter().map(|&h| h > 0.0 && f64::from(h) >= min_clearance_m).collect();
        let anchors = peaks(&frame, &heights, &inside, peak_ratio as f32);
        let mut thin = inside;
        thin_out(&frame, &heights, &mut thin, &anchors);
        Self::from_thin(&frame, &heights, &thin, &anchors)
    }

    fn from_thin(frame: &GridFrame, heights: &[f32], thin: &[bool], anchors: &[bool]) -> Self {
        const NONE: u32 = u32::MAX;
        let count =
            |index: usize| frame.neighbors8(frame.cell(index)).filter(|&c| thin[frame.index(c)]).count();
        let is_node = |index: usize| thin[index] && (anchors[index] || count(index) != 2);
        let mut node_of = vec![NONE; frame.len()];
        let mut nodes = Vec::new();
        for seed in 0..frame.len() {
            if !is_node(seed) || node_of[seed] != NONE {
                continue;
            }
            let id = nodes.len() as u32;
            let mut best = seed;
            let mut stack = vec![seed];
            node_of[seed] = id;
            while let Some(index) = stack.pop() {
                let by_height = heights[index].total_cmp(&heights[best]);
                if by_height.then(best.cmp(&index)).is_gt() {
                    best = index;
                }
                for next in frame.neighbors8(frame.cell(index)).map(|c| frame.index(c)) {
                    if is_node(next) && node_of[next] == NONE {
                        node_of[next] = id;
                        stack.push(next);
                    }
                }
            }
            nodes.push(SkeletonNode { cell: frame.cell(best), degree: 0 });
        }
        let ridges = trace_ridges(frame, thin, &node_of);
        for end in ridges.iter().flat_map(|ridge: &Ridge| ridge.ends).flatten() {
            nodes[end].degree += 1;
        }
        Self { nodes, ridges }
    }
}

/// Follows the thin cells that belong to no node.
fn trace_ridges(frame: &GridFrame, thin: &[bool], node_of: &[u32]) -> Vec<Ridge> {
    let node_at = |index: usize| (node_of[index] != u32::MAX).then_some(node_of[index] as usize);
    let around =
        |index: usize| frame.neighbors8(frame.cell(index)).map(|c| frame.index(c)).filter(|&i| thin[i]);
    let mut seen = vec![false; frame.len()];
    let mut ridges = Vec::new();
    for seed in 0..frame.len() {
        if !thin[seed] || seen[seed] || node_at(seed).is_some() {
            continue;
        }
        seen[seed] = true;
        let arms: Vec<usize> = around(seed).collect();
        let mut halves = [Vec::new(), Vec::new()];
        let mut ends = [None, None];
        for (side, &arm) in arms.iter().enumerate().take(2) {
            let mut current = arm;
            while node_at(current).is_none() && !seen[current] {
                seen[current] = true;
                halves[side].push(frame.cell(current));
                match around(current).find(|&next| !seen[next]) {
                    Some(next) => current = next,
                    None => break,
                }
            }
            ends[side] = node_at(current);
        }
        let [mut cells, after] = halves;
        cells.reverse();
        cells.push(frame.cell(seed));
        cells.extend(after);
        ridges.push(Ridge { ends, cells });
    }
    ridges
}

/// Marks the clearance peaks that exceed their pass to a higher peak by the factor `ratio`.
///
/// Cells join in the order of falling clearance; where two hills meet, the lower one ends.
fn peaks(frame: &GridFrame, heights: &[f32], inside: &[bool], ratio: f32) -> Vec<bool> {
    const NONE: u32 = u32::MAX;
    let mut order = by_height(heights, inside);
    // Highest first; equal heights keep the cells' order.
    order.reverse();
    order.chunk_by_mut(|&a, &b| heights[a as usize] == heights[b as usize]).for_each(<[u32]>::reverse);
    // Union-find over hills; a hill is named after its peak.
    let mut hill = vec![NONE; frame.len()];
    let mut is_peak = vec![false; frame.len()];
    for &index in &order {
        let index = index as usize;
        hill[index] = index as u32;
        is_peak[index] = true;
        for neighbor in frame.neighbors8(frame.cell(index)).map(|c| frame.index(c)) {
            if hill[neighbor] == NONE {
                continue;
            }
            let (a, b) = (root(&mut hill, index as u32), root(&mut hill, neighbor as u32));
            if a == b {
                continue;
            }
            // The hill that started later is the lower one.
            let rank = |peak: u32| (Reverse(heights[peak as usize].to_bits()), peak);
            let (high, low) = if rank(a) < rank(b) { (a, b) } else { (b, a) };
            let (peak, pass) = (heights[low as usize], heights[index]);
            // Less than a cell is noise: a slanted wall alone causes that much.
            let noise = 0.9 * frame.resolution_m as f32;
            is_peak[low as usize] = peak >= ratio * pass && peak - pass >= noise;
            hill[low as usize] = high;
        }
    }
    is_peak
}

fn root(parent: &mut [u32], start: u32) -> u32 {
    let mut index = start;
    while parent[index as usize] != index {
        let grand = parent[parent[index as usize] as usize];
        parent[index as usize] = grand;
        index = grand;
    }
    index
}

/// The cells of `set` in the order of their heights, which must not be negative; equal heights in
/// the cells' order.
///
/// Sorts by the bits of the numbers, half a word at a time: linear in the number of cells.
fn by_height(heights: &[f32], set: &[bool]) -> Vec<u32> {
    const DIGITS: usize = 1 << 16;
    let mut order: Vec<u32> = (0..heights.len() as u32).filter(|&i| set[i as usize]).collect();
    let mut sorted = vec![0; order.len()];
    for shift in [0, 16] {
        let digit = |index: u32| (heights[index as usize].to_bits() >> shift) as usize % DIGITS;
        let mut next = vec![0_usize; DIGITS + 1];
        order.iter().for_each(|&index| next[digit(index) + 1] += 1);
        (0..DIGITS).for_each(|d| next[d + 1] += next[d]);
        for &index in &order {
            let place = &mut next[digit(index)];
            sorted[*place] = index;
            *place += 1;
        }
        std::mem::swap(&mut order, &mut sorted);
    }
    order
}

/// Removes cells from `thin`, least clearance first, as long as its topology stays.
///
/// The order of the first visits is known in advance. Only the few cells that must be visited again
/// are kept in a heap.
fn thin_out(frame: &GridFrame, heights: &[f32], thin: &mut [bool], anchors: &[bool]) {
    let key = |index: usize| (heights[index].to_bits(), index as u32);
    let mut queued: Vec<bool> = (0..frame.len()).map(|i| thin[i] && !anchors[i]).collect();
    let mut first = by_height(heights, &queued).into_iter().map(|index| key(index as usize)).peekable();
    let mut again: BinaryHeap<Reverse<(u32, u32)>> = BinaryHeap::new();
    loop {
        let next = match (first.peek(), again.peek()) {
            (Some(a), Some(Reverse(b))) if b < a => again.pop().map(|Reverse(b)| b),
            (None, _) => again.pop().map(|Reverse(b)| b),
            _ => first.next(),
        };
        let Some((_, index)) = next else { return };
        let index = index as usize;
        queued[index] = false;
        if !is_simple(frame, thin, index) {
            continue;
        }
        thin[index] = false;
        for next in frame.neighbors8(frame.cell(index)).map(|c| frame.index(c)) {
            if thin[next] && !queued[next] && !anchors[next] {
                queued[next] = true;
                again.push(Reverse(key(next)));
            }
        }
    }
}

/// Returns true if removing the cell changes neither the pieces of the set (8-connected) nor the
/// pieces of its complement (4-connected).
fn is_simple(frame: &GridFrame, set: &[bool], index: usize) -> bool {
    const RING: [(isize, isize); 8] = [(1, 0), (1, 1), (0, 1), (-1, 1), (-1, 0), (-1, -1), (0, -1), (1, -1)];
    let cell = frame.cell(index);
    let ring = RING.map(|(dc, dr)| {
        let col = cell.col.checked_add_signed(dc).filter(|&c| c < frame.width);
        let row = cell.row.checked_add_signed(dr).filter(|&r| r < frame.height);
        col.zip(row).is_some_and(|(col, row)| set[row * frame.width + col])
    });
    // Yokoi's connectivity number for 8-connected sets: one means simple.
    let outside = ring.map(|inside| u8::from(!inside));
    let number: u8 =
        [0, 2, 4, 6].iter().map(|&k| outside[k] - outside[k] * outside[k + 1] * outside[(k + 2) % 8]).sum();
    number == 1
}

#[cfg(test)]
mod tests {
    use sharp_space::OccupancyGrid;

    use super::*;

    fn skeleton(drawing: &str) -> Skeleton {
        let grid = OccupancyGrid::from_ascii(0.5, drawing).unwrap();
        Skeleton::new(&DistanceField::new(&grid), 0.3, 1.12)
    }

    #[test]
    fn two_rooms_are_two_nodes_and_a_ridge() {
        let skeleton = skeleton(
            "
            ###############
            #......#......#
            #......#......#
            #.............#
            #......#......#
            #......#......#
            ###############",
        );
        let ends = skeleton.ridges.iter().map(|r| r.ends).collect::<Vec<_>>();
        assert_eq!(skeleton.nodes.len(), 2, "{skeleton:?}");
        assert_eq!(ends, [[Some(1), Some(0)]], "{skeleton:?}");
    }

    #[test]
    fn a_ring_stays_a_ring() {
        let skeleton = skeleton(
            "
            #########
            #.......#
            #.#####.#
            #.#####.#
            #.......#
            #########",
        );
        let cells: usize = skeleton.ridges.iter().map(|r| r.cells.len()).sum();
        assert!(cells >= 10, "the ring has about 16 cells, the ridges {cells}");
    }
}
