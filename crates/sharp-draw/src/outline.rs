//! The outline of a set of cells as one SVG path: a large map becomes kilobytes, not megabytes.
//!
//! Every side between a cell inside and one outside becomes a directed edge with the inside on its
//! right; edges are joined into closed loops and straight runs into single commands.

use std::fmt::Write;

/// Directions on the screen, clockwise: right, down, left, up.
const STEPS: [(isize, isize); 4] = [(1, 0), (0, 1), (-1, 0), (0, -1)];

/// The outline of the cells for which `inside(column, line)` holds, line 0 at the top.
///
/// The path is to be filled by the even-odd or the non-zero rule; it is empty if no cell is inside.
pub(crate) fn outline(width: usize, height: usize, inside: impl Fn(usize, usize) -> bool) -> String {
    let stride = width + 1;
    let mut edges = directed_edges(width, height, inside);
    let mut path = String::new();
    for start in 0..edges.len() {
        // A loop is met first at the left end of its topmost rightward run, hence at a corner.
        while edges[start] & 1 != 0 {
            let _ = write!(path, "M{} {}", start % stride, start / stride);
            trace_loop(&mut edges, stride, start, &mut path);
        }
    }
    path
}

/// For each corner of the lattice a bit per direction in which an edge leaves it.
fn directed_edges(width: usize, height: usize, inside: impl Fn(usize, usize) -> bool) -> Vec<u8> {
    let stride = width + 1;
    let mut edges = vec![0; stride * (height + 1)];
    for line in 0..height {
        for col in (0..width).filter(|&col| inside(col, line)) {
            let corner = line * stride + col;
            if line == 0 || !inside(col, line - 1) {
                edges[corner] |= 1;
            }
            if col + 1 == width || !inside(col + 1, line) {
                edges[corner + 1] |= 2;
            }
            if line + 1 == height || !inside(col, line + 1) {
                edges[corner + stride + 1] |= 4;
            }
            if col == 0 || !inside(col - 1, line) {
                edges[corner + stride] |= 8;
            }
        }
    }
    edges
}

/// Follows one loop from `start`, rightwards first, and removes its edges.
fn trace_loop(edges: &mut [u8], stride: usize, start: usize, path: &mut String) {
    let (mut at, mut direction, mut run) = (start, 0, 0_usize);
    loop {
        edges[at] &= !(1 << direction);
        let (dx, dy) = STEPS[direction];
        at = at.wrapping_add_signed(dy * stride as isize + dx);
        run += 1;
        // Turning right first keeps cells that share only a corner apart.
        let next =
            [1, 0, 3].map(|turn| (direction + turn) % 4).into_iter().find(|d| edges[at] & (1 << d) != 0);
        let Some(next) = next else { break };
        if next != direction {
            let signed = if dx + dy > 0 { "" } else { "-" };
            let _ = write!(path, "{}{signed}{run}", if dx == 0 { 'v' } else { 'h' });
            (direction, run) = (next, 0);
        }
    }
    path.push('z');
}

#[cfg(test)]
mod tests {
    use super::*;

    fn outline_of(lines: &[&str]) -> String {
        outline(lines[0].len(), lines.len(), |col, line| lines[line].as_bytes()[col] == b'#')
    }

    #[test]
    fn runs_are_joined() {
        assert_eq!(outline_of(&["....", ".##.", ".##."]), "M1 1h2v2h-2z");
        assert_eq!(outline_of(&["...", "..."]), "", "nothing inside");
    }

    #[test]
    fn a_hole_is_a_loop_of_its_own() {
        assert_eq!(outline_of(&["###", "#.#", "###"]), "M0 0h3v3h-3zM1 2h1v-1h-1z");
    }

    #[test]
    fn outlines_enclose_exactly_the_cells_inside() {
        arbtest::arbtest(|u| {
            let (width, height) = (u.int_in_range(1..=7)?, u.int_in_range(1..=7)?);
            let cells: Vec<bool> = (0..width * height).map(|_| u.arbitrary()).collect::<Result<_, _>>()?;
            let inside = |col: usize, line: usize| cells[line * width + col];
            let path = outline(width, height, inside);
            for line in 0..height {
                for col in 0..width {
                    let crossings = vertical_edges_left_of(&path, col, line);
                    assert_eq!(crossings % 2 == 1, inside(col, line), "cell {col} {line} of {path}");
                }
            }
            Ok(())
        });
    }

    /// Counts the vertical edges of `path` that a ray from cell (col, line) to the left crosses.
    fn vertical_edges_left_of(path: &str, col: usize, line: usize) -> usize {
        let mut count = 0;
        for stroke in path.split('z').filter(|s| !s.is_empty()) {
            let (start, rest) = stroke.split_at(stroke.find(['h', 'v']).unwrap());
            let (x, y) = start[1..].split_once(' ').unwrap();
            let (x0, y0): (i64, i64) = (x.parse().unwrap(), y.parse().unwrap());
            let (mut x, mut y) = (x0, y0);
            let mut edge = |x: i64, from: i64, to: i64| {
                let (low, high) = (from.min(to), from.max(to));
                count += usize::from(x <= col as i64 && low <= line as i64 && (line as i64) < high);
            };
            let letters = rest.char_indices().filter(|(_, c)| c.is_alphabetic());
            let ends = rest.char_indices().skip(1).filter(|(_, c)| c.is_alphabetic()).map(|(i, _)| i);
            for ((at, letter), end) in letters.zip(ends.chain([rest.len()])) {
                let length: i64 = rest[at + 1..end].parse().unwrap();
                if letter == 'h' {
                    x += length;
                } else {
                    edge(x, y, y + length);
                    y += length;
                }
            }
            edge(x, y, y0);
        }
        count
    }
}
