//! The nearest region by straight distance, through walls, as the paper's text defines the diagram.

use crate::space::{FreeSpace, NONE};

/// The nearest seed of one column, as seen from one cell of it.
#[derive(Clone, Copy)]
struct InColumn {
    rows: u32,
    state: u32,
}

/// Gives every free cell the state whose seed is nearest in a straight line; ties go to the lowest.
///
/// `seeds` holds a state or [`NONE`] for each cell. Each cell looks along its row, outwards, until
/// no farther column can win, so the time grows with the distance to the nearest seed.
pub(crate) fn nearest_in_straight_line(space: &FreeSpace, seeds: &[u32]) -> Vec<u32> {
    let width = space.frame.width;
    let columns = nearest_in_columns(seeds, width);
    let nearest = |index: usize| {
        if !space.is_free(index) {
            return NONE;
        }
        let col = index % width;
        let row = &columns[index - col..index - col + width];
        let mut best = (u64::MAX, NONE);
        for offset in 0..width {
            let aside = (offset * offset) as u64;
            if aside > best.0 {
                break;
            }
            let sides = [col.checked_sub(offset), Some(col + offset).filter(|&c| c < width)];
            for seed in sides.into_iter().flatten().map(|c| row[c]).filter(|s| s.state != NONE) {
                best = best.min((aside + u64::from(seed.rows).pow(2), seed.state));
            }
        }
        best.1
    };
    (0..seeds.len()).map(nearest).collect()
}

/// For each cell the nearest seed in its own column, by a sweep up and a sweep down.
fn nearest_in_columns(seeds: &[u32], width: usize) -> Vec<InColumn> {
    let seed = |&state: &u32| InColumn { rows: if state == NONE { NONE } else { 0 }, state };
    let mut columns: Vec<InColumn> = seeds.iter().map(seed).collect();
    let mut carry = |from: usize, to: usize| {
        let InColumn { rows, state } = columns[from];
        if state != NONE && (rows + 1, state) < (columns[to].rows, columns[to].state) {
            columns[to] = InColumn { rows: rows + 1, state };
        }
    };
    (width..seeds.len()).for_each(|index| carry(index - width, index));
    (width..seeds.len()).rev().for_each(|index| carry(index, index - width));
    columns
}

#[cfg(test)]
mod tests {
    use sharp_space::{DistanceField, GridFrame, Pose};

    use super::*;

    #[test]
    fn agrees_with_brute_force() {
        arbtest::arbtest(|u| {
            let (width, height) = (u.int_in_range(1..=12)?, u.int_in_range(1..=12)?);
            let frame = GridFrame { origin: Pose::new(0.0, 0.0, 0.0), resolution_m: 1.0, width, height };
            let space = FreeSpace::new(&DistanceField::from_mask(frame, |_| false), 0.0);
            let draw = |_| Ok(if u.ratio(1, 20)? { u.int_in_range(0..=5)? } else { NONE });
            let seeds = (0..frame.len()).map(draw).collect::<Result<Vec<u32>, _>>()?;
            for (index, &found) in nearest_in_straight_line(&space, &seeds).iter().enumerate() {
                let here = frame.cell(index);
                let squared = |other| {
                    let there = frame.cell(other);
                    here.col.abs_diff(there.col).pow(2) + here.row.abs_diff(there.row).pow(2)
                };
                let sources = (0..seeds.len()).filter(|&i| seeds[i] != NONE);
                let expected = sources.map(|i| (squared(i), seeds[i])).min().map_or(NONE, |best| best.1);
                assert_eq!(found, expected, "{here:?} among {seeds:?}, {width} columns");
            }
            Ok(())
        });
    }
}
