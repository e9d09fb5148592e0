//! Growth of all states at once: Dijkstra's algorithm from every region, with buckets as the queue.

use crate::space::{DIAGONAL, FreeSpace, NONE};

/// Gives every reachable cell without a state the state nearest to it along moves.
///
/// Ties go to the lowest state. Each cell that gets a state has a neighbour of the same state one
/// move nearer to the source, so whatever was connected stays connected. Time and memory are
/// linear in the number of cells: lengths of moves are small whole numbers, so a ring of
/// `DIAGONAL + 1` buckets replaces the heap.
pub(crate) fn grow(space: &FreeSpace, states: &mut [u32]) {
    let mut distances = vec![NONE; states.len()];
    let mut buckets = vec![Vec::new(); DIAGONAL as usize + 1];
    for (index, distance) in distances.iter_mut().enumerate().filter(|(i, _)| states[*i] != NONE) {
        *distance = 0;
        // A cell in the middle of a source has no neighbour to improve.
        if space.moves(index).any(|(other, _)| states[other] == NONE) {
            buckets[0].push(index as u32);
        }
    }
    let mut pending = buckets[0].len();
    let mut now = 0;
    while pending > 0 {
        let slot = now as usize % buckets.len();
        let mut wave = std::mem::take(&mut buckets[slot]);
        pending -= wave.len();
        for index in wave.drain(..).map(|index| index as usize) {
            if distances[index] != now {
                continue; // A shorter way was found after this entry was made.
            }
            for (other, length) in space.moves(index) {
                let distance = now + length;
                if distance < distances[other] {
                    distances[other] = distance;
                    states[other] = states[index];
                    buckets[distance as usize % (DIAGONAL as usize + 1)].push(other as u32);
                    pending += 1;
                } else if distance == distances[other] {
                    states[other] = states[other].min(states[index]);
                }
            }
        }
        buckets[slot] = wave; // Keeps the allocation.
        now += 1;
    }
}

#[cfg(test)]
mod tests {
    use sharp_space::{DistanceField, OccupancyGrid};

    use super::*;

    #[test]
    fn ties_go_to_the_lowest_state_whichever_comes_first() {
        let grid = OccupancyGrid::from_ascii(1.0, ".....").unwrap();
        let space = FreeSpace::new(&DistanceField::new(&grid), 0.0);
        for (first, last, expected) in [(3, 7, [3, 3, 3, 7, 7]), (7, 3, [7, 7, 3, 3, 3])] {
            let mut states = [first, NONE, NONE, NONE, last];
            grow(&space, &mut states);
            assert_eq!(states, expected, "{first} on the left, {last} on the right");
        }
    }
}
