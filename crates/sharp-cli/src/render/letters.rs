//! Letters as strokes on the lattice of [`digits`](super::digits), for pictures that need no font.

use super::digits::GLYPHS;
use super::svg::PathData;

/// Size of a lattice step over the size of the text, across and down: capitals are 0.72 of it high.
const STEP: [f64; 2] = [0.086, 0.12];
/// Lattice steps from one letter to the next.
const ADVANCE: f64 = 5.8;
/// The row of the lattice on which letters stand.
const BASELINE: f64 = 6.0;

/// Width of `text` at `size`; a usual sans-serif font is about as wide.
pub(super) fn width(text: &str, size: f64) -> f64 {
    text.chars().count() as f64 * ADVANCE * STEP[0] * size
}

/// `text` as strokes that begin at `start`, the left end of the line it stands on (y downwards).
pub(super) fn strokes(text: &str, start: [f64; 2], size: f64) -> PathData {
    let mut path = PathData::default();
    for (i, letter) in text.chars().enumerate() {
        for stroke in glyph(letter) {
            for (k, [x, y]) in stroke.into_iter().enumerate() {
                let point = [
                    start[0] + (i as f64 * ADVANCE + x) * STEP[0] * size,
                    start[1] + (y - BASELINE) * STEP[1] * size,
                ];
                path = if k == 0 { path.move_to(point) } else { path.line_to(point) };
            }
        }
    }
    path
}

/// The strokes of a letter on a lattice 4 wide and 6 high, with two rows more below the line.
fn glyph(letter: char) -> Vec<Vec<[f64; 2]>> {
    if let Some(digit) = letter.to_digit(10) {
        return GLYPHS[digit as usize].iter().map(|stroke| stroke.to_vec()).collect();
    }
    let text = LETTERS.iter().find(|(known, _)| *known == letter).map_or(UNKNOWN, |(_, text)| text);
    text.split_whitespace()
        .map(|stroke| {
            let lattice = |byte: u8| f64::from(byte - b'0');
            stroke.as_bytes().chunks_exact(2).map(|pair| [lattice(pair[0]), lattice(pair[1])]).collect()
        })
        .collect()
}

/// What stands for a letter that is not in [`LETTERS`]: a box.
const UNKNOWN: &str = "0040460600";

/// Strokes are separated by spaces, points are two digits: column from the left, row from the top.
const LETTERS: [(char, &str); 66] = [
    (' ', ""),
    ('A', "062046 1333"),
    ('B', "06003041423344453606 0333"),
    ('C', "4130100105163645"),
    ('D', "06002042442606"),
    ('E', "40000646 0333"),
    ('F', "400006 0333"),
    ('G', "41301001051636454323"),
    ('H', "0006 4046 0343"),
    ('I', "1030 2026 1636"),
    ('J', "4045361605"),
    ('K', "0006 400346"),
    ('L', "000646"),
    ('M', "0600234046"),
    ('N', "06004640"),
    ('O', "103041453616050110"),
    ('P', "06003041423303"),
    ('Q', "103041453616050110 2446"),
    ('R', "06003041423303 2346"),
    ('S', "413010010213334445361605"),
    ('T', "0040 2026"),
    ('U', "000516364540"),
    ('V', "002640"),
    ('W', "0016233640"),
    ('X', "0046 4006"),
    ('Y', "0023 402326"),
    ('Z', "00400646"),
    ('a', "12324346 441405163645"),
    ('b', "0006 0312324345361605"),
    ('c', "4332120305163645"),
    ('d', "4046 4332120305163645"),
    ('e', "04444332120305163645"),
    ('f', "40302126 1232"),
    ('g', "4332120305163645 4247381807"),
    ('h', "0006 0312324346"),
    ('i', "2226 2021"),
    ('j', "32372808 3031"),
    ('k', "0006 420446"),
    ('l', "2026"),
    ('m', "0206 03122326 23324346"),
    ('n', "0206 0312324346"),
    ('o', "123243453616050312"),
    ('p', "0208 0312324345361605"),
    ('q', "4248 4332120305163645"),
    ('r', "0206 03123243"),
    ('s', "43321203143445361605"),
    ('t', "20253646 1232"),
    ('u', "0205163645 4246"),
    ('v', "022642"),
    ('w', "0216243642"),
    ('x', "0246 4206"),
    ('y', "0226 4218"),
    ('z', "02420646"),
    ('.', "2526"),
    (',', "2517"),
    (':', "2223 2526"),
    (';', "2223 2517"),
    ('%', "4006 0010110100 3545463635"),
    ('/', "4006"),
    ('-', "1333"),
    ('+', "0444 2226"),
    ('=', "0343 0545"),
    ('(', "30212536"),
    (')', "10212516"),
    ('_', "0646"),
    ('\'', "2021"),
];

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strokes_stay_on_the_lattice() {
        for (letter, text) in LETTERS {
            for stroke in text.split(' ').filter(|stroke| !stroke.is_empty()) {
                assert_eq!(stroke.len() % 2, 0, "{letter:?}: a point is two digits: {stroke}");
                assert!(stroke.len() >= 4, "{letter:?}: a stroke has two points: {stroke}");
            }
            for [x, y] in glyph(letter).into_iter().flatten() {
                assert!(x <= 4.0 && y <= 8.0, "{letter:?} leaves the lattice at {x}, {y}");
            }
        }
    }

    #[test]
    fn text_runs_to_the_right_on_its_line() {
        let path = strokes("L-", [10.0, 50.0], 100.0).finish();
        assert_eq!(path, "M10 -22L10 50L44.4 50M68.48 14L85.68 14");
        assert!(width("abc", 10.0) > 2.0 * width("a", 10.0), "longer text is wider");
    }

    #[test]
    fn unknown_letters_are_boxes() {
        assert_eq!(glyph('é'), [vec![[0.0, 0.0], [4.0, 0.0], [4.0, 6.0], [0.0, 6.0], [0.0, 0.0]]]);
    }
}
