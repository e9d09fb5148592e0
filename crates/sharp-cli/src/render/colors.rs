//! Colours: a ramp for fields and a map colouring for states.

use std::collections::{BTreeMap, BTreeSet};

use sharp_space::GridFrame;

/// Fills of states: light enough for white circles with dark rims and dark digits.
pub(super) const STATES: [&str; 12] = [
    "#8fc1e3", "#f6b880", "#9fd8a4", "#f29e9e", "#c7b3e5", "#f3dc82", "#86d0c9", "#eeb0d2", "#b7c98a",
    "#d9b99b", "#a9b6f0", "#d6e38d",
];

/// Stops of the viridis ramp, dark to bright (CC0, by Smith and van der Walt).
const VIRIDIS: [[u8; 3]; 9] = [
    [68, 1, 84],
    [71, 44, 122],
    [59, 81, 139],
    [44, 113, 142],
    [33, 144, 141],
    [39, 173, 129],
    [92, 200, 99],
    [170, 220, 50],
    [253, 231, 37],
];

/// The colour at `share` (0 to 1) of the ramp.
pub(super) fn ramp(share: f64) -> String {
    let position = share.clamp(0.0, 1.0) * (VIRIDIS.len() - 1) as f64;
    let low = (position as usize).min(VIRIDIS.len() - 2);
    let mix = |channel: usize| {
        let (a, b) = (f64::from(VIRIDIS[low][channel]), f64::from(VIRIDIS[low + 1][channel]));
        (a + (b - a) * (position - low as f64)).round() as u8
    };
    format!("#{:02x}{:02x}{:02x}", mix(0), mix(1), mix(2))
}

/// An index into [`STATES`] for every state, neighbours apart as long as the colours last.
///
/// States with many neighbours choose first; each takes the colour used least so far among those
/// that its neighbours leave, so that colours spread over the picture.
pub(super) fn color_states(frame: &GridFrame, states: &[Option<u32>]) -> BTreeMap<u32, usize> {
    let neighbors = neighbors(frame, states);
    let mut order: Vec<u32> = neighbors.keys().copied().collect();
    order.sort_by_key(|state| (std::cmp::Reverse(neighbors[state].len()), *state));
    let mut colors = BTreeMap::new();
    let mut uses = [0_usize; STATES.len()];
    for state in order {
        let clashes =
            |color: usize| neighbors[&state].iter().filter(|n| colors.get(*n) == Some(&color)).count();
        let color = (0..STATES.len()).min_by_key(|&c| (clashes(c), uses[c], c)).unwrap_or(0);
        uses[color] += 1;
        colors.insert(state, color);
    }
    colors
}

/// The states of `states` (row-major) with those that share a cell's side or corner with them.
fn neighbors(frame: &GridFrame, states: &[Option<u32>]) -> BTreeMap<u32, BTreeSet<u32>> {
    let mut neighbors = BTreeMap::<u32, BTreeSet<u32>>::new();
    let mut last = None;
    for (index, &state) in states.iter().enumerate() {
        let Some(state) = state else { continue };
        if last != Some(state) {
            neighbors.entry(state).or_default();
            last = Some(state);
        }
        for near in frame.neighbors8(frame.cell(index)).filter_map(|cell| states[frame.index(cell)]) {
            if near != state {
                neighbors.entry(state).or_default().insert(near);
            }
        }
    }
    neighbors
}

#[cfg(test)]
mod tests {
    use sharp_space::Pose;

    use super::*;

    fn frame(width: usize, height: usize) -> GridFrame {
        GridFrame { origin: Pose::new(0.0, 0.0, 0.0), resolution_m: 1.0, width, height }
    }

    #[test]
    fn the_ramp_runs_from_violet_to_yellow() {
        assert_eq!(ramp(-1.0), "#440154");
        assert_eq!(ramp(0.5), "#21908d");
        assert_eq!(ramp(1.0), "#fde725");
    }

    #[test]
    fn neighbours_differ() {
        arbtest::arbtest(|u| {
            let frame = frame(6, 6);
            // At most nine states, so a state has at most eight neighbours and twelve colours do.
            let states: Vec<Option<u32>> = (0..36)
                .map(|_| Ok(u.int_in_range(0..=9)?).map(|s: u32| s.checked_sub(1)))
                .collect::<Result<_, _>>()?;
            let colors = color_states(&frame, &states);
            for (state, near) in neighbors(&frame, &states) {
                for other in near {
                    assert_ne!(colors[&state], colors[&other], "states {state} and {other}");
                }
            }
            Ok(())
        });
    }
}
