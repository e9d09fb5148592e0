//! Colours: the type, a ramp for fields, and a map colouring for states.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt;

use sharp_space::GridFrame;

/// An opaque sRGB colour. Its `Display` is the notation of CSS, `#rrggbb`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Color([u8; 3]);

impl Color {
    /// White.
    pub const WHITE: Self = Self::hex(0xffffff);
    /// Dark grey, for text and thin lines.
    pub const INK: Self = Self::hex(0x1a1a1a);
    /// Medium grey, for text that stands back; its contrast on white is 7 to 1.
    pub const SOFT: Self = Self::hex(0x595959);
    /// Light grey, for the rules of a chart.
    pub const RULE: Self = Self::hex(0xdcdcdc);

    /// The colour `0xrrggbb`; the highest byte is ignored.
    #[must_use]
    pub const fn hex(rgb: u32) -> Self {
        let [_, red, green, blue] = rgb.to_be_bytes();
        Self([red, green, blue])
    }

    /// Red, green and blue.
    pub(crate) const fn rgb(self) -> [u8; 3] {
        self.0
    }
}

impl fmt::Display for Color {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let [red, green, blue] = self.0;
        write!(f, "#{red:02x}{green:02x}{blue:02x}")
    }
}

impl From<Color> for String {
    fn from(color: Color) -> Self {
        color.to_string()
    }
}

/// Fills of states: light enough for dark numbers and lines.
pub(crate) const STATES: [Color; 12] = [
    Color::hex(0x8fc1e3),
    Color::hex(0xf6b880),
    Color::hex(0x9fd8a4),
    Color::hex(0xf29e9e),
    Color::hex(0xc7b3e5),
    Color::hex(0xf3dc82),
    Color::hex(0x86d0c9),
    Color::hex(0xeeb0d2),
    Color::hex(0xb7c98a),
    Color::hex(0xd9b99b),
    Color::hex(0xa9b6f0),
    Color::hex(0xd6e38d),
];

/// Stops of the ramp: from the colour of free land over green to dark blue, always darker.
///
/// It begins with the colour of free land so that a map with a field on it still reads as a map,
/// with dark walls on a light floor.
const RAMP: [Color; 7] = [
    Color::hex(0xfcfcfb),
    Color::hex(0xd9f0d3),
    Color::hex(0xa1dab4),
    Color::hex(0x59bfc0),
    Color::hex(0x2c95c0),
    Color::hex(0x2263a8),
    Color::hex(0x172f72),
];

/// The colour at `share` (0 to 1) of the ramp.
pub(crate) fn ramp(share: f64) -> Color {
    let position = share.clamp(0.0, 1.0) * (RAMP.len() - 1) as f64;
    let low = (position as usize).min(RAMP.len() - 2);
    let mix = |channel: usize| {
        let (a, b) = (f64::from(RAMP[low].0[channel]), f64::from(RAMP[low + 1].0[channel]));
        (a + (b - a) * (position - low as f64)).round() as u8
    };
    Color([mix(0), mix(1), mix(2)])
}

/// An index into [`STATES`] for every state, neighbours apart as long as the colours last.
///
/// States with many neighbours choose first; each takes the colour used least so far among those
/// that its neighbours leave, so that colours spread over the picture.
pub(crate) fn color_states(frame: &GridFrame, states: &[Option<u32>]) -> BTreeMap<u32, usize> {
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
    fn colours_are_written_as_css() {
        assert_eq!(Color::hex(0x0072b2).to_string(), "#0072b2");
    }

    #[test]
    fn the_ramp_grows_darker_all_the_way() {
        assert_eq!((ramp(-1.0), ramp(1.0)), (RAMP[0], RAMP[6]));
        let light = |color: Color| color.0.iter().map(|&channel| u32::from(channel)).sum::<u32>();
        let steps: Vec<u32> = (0..=24).map(|step| light(ramp(f64::from(step) / 24.0))).collect();
        assert!(steps.windows(2).all(|pair| pair[1] < pair[0]), "{steps:?}");
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
