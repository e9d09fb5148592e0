//! Digits as strokes, so that pictures need no font.

use super::svg::PathData;

/// Height of a digit over its width.
const ASPECT: f64 = 1.6;
/// Gap between two digits in widths of a digit.
const GAP: f64 = 0.45;

/// `value` as strokes, centred at `center` (y downwards) and `height` high.
pub(super) fn strokes(value: u32, center: [f64; 2], height: f64) -> PathData {
    let text = value.to_string();
    let width = height / ASPECT;
    let total = width * (text.len() as f64 + GAP * (text.len() as f64 - 1.0));
    let top = center[1] - height / 2.0;
    let mut path = PathData::default();
    for (i, digit) in text.bytes().enumerate() {
        let left = center[0] - total / 2.0 + width * (1.0 + GAP) * i as f64;
        for stroke in GLYPHS[usize::from(digit - b'0')] {
            for (k, [x, y]) in stroke.iter().enumerate() {
                let point = [left + x / 4.0 * width, top + y / 6.0 * height];
                path = if k == 0 { path.move_to(point) } else { path.line_to(point) };
            }
        }
    }
    path
}

/// The strokes of 0 to 9 on a lattice 4 wide and 6 high, y downwards.
pub(super) const GLYPHS: [&[&[[f64; 2]]]; 10] = [
    &[&[[1., 0.], [3., 0.], [4., 1.], [4., 5.], [3., 6.], [1., 6.], [0., 5.], [0., 1.], [1., 0.], [3., 0.]]],
    &[&[[0.8, 1.3], [2.4, 0.], [2.4, 6.]]],
    &[&[[0., 1.], [1., 0.], [3., 0.], [4., 1.], [4., 2.2], [0., 6.], [4., 6.]]],
    &[&[[0., 0.], [4., 0.], [2., 2.5], [3., 2.5], [4., 3.5], [4., 5.], [3., 6.], [1., 6.], [0., 5.]]],
    &[&[[3., 6.], [3., 0.], [0., 4.3], [4., 4.3]]],
    &[&[[4., 0.], [0.4, 0.], [0., 2.8], [3., 2.4], [4., 3.3], [4., 5.], [3., 6.], [1., 6.], [0., 5.2]]],
    &[&[
        [3.6, 0.2],
        [1.6, 0.],
        [0., 2.],
        [0., 5.],
        [1., 6.],
        [3., 6.],
        [4., 5.],
        [4., 3.8],
        [3., 2.8],
        [1., 2.8],
        [0., 3.8],
    ]],
    &[&[[0., 0.], [4., 0.], [1.4, 6.]]],
    &[&[
        [1., 2.8],
        [0.2, 2.],
        [0.2, 0.9],
        [1., 0.],
        [3., 0.],
        [3.8, 0.9],
        [3.8, 2.],
        [3., 2.8],
        [1., 2.8],
        [0., 3.7],
        [0., 5.1],
        [1., 6.],
        [3., 6.],
        [4., 5.1],
        [4., 3.7],
        [3., 2.8],
    ]],
    &[&[
        [0.4, 5.8],
        [2.4, 6.],
        [4., 4.],
        [4., 1.],
        [3., 0.],
        [1., 0.],
        [0., 1.],
        [0., 2.2],
        [1., 3.2],
        [3., 3.2],
        [4., 2.2],
    ]],
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_centred() {
        assert_eq!(strokes(7, [0.0, 0.0], 16.0).finish(), "M-5 -8L5 -8L-1.5 8", "one digit, ten wide");
        let two = strokes(17, [0.0, 0.0], 16.0).finish();
        assert_eq!(two.matches('M').count(), 2, "a stroke a digit: {two}");
        assert!(two.ends_with("L5.75 8"), "the pair is 24.5 wide: {two}");
    }
}
