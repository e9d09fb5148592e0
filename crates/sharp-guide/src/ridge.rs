//! A* over open cells that prefers clearance: the guide's first attempt.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use sharp_space::{Cell, GridFrame};

use crate::traversable::TraversableMask;

/// What is known of a cell during the search.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Mark {
    Unseen,
    Blocked,
    Open,
    Closed,
}

/// Columns and rows of the eight neighbours, sides first; the opposite of `i` is at `i ^ 1`.
const STEPS: [(isize, isize); 8] = [(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, -1), (1, -1), (-1, 1)];

/// The cheapest 8-connected way from `start` to `goal`, both ends included, without cutting corners.
///
/// A metre costs 1 + `weight` · s², where s runs from 0 with comfortable room to 1 with the least.
/// Ties go to the lower cell.
pub(crate) fn ridge(mask: &TraversableMask<'_>, start: Cell, goal: Cell, weight: f64) -> Option<Vec<Cell>> {
    let mut search = RidgeSearch::new(mask, goal, weight);
    search.push(start, 1.0, 0);
    while let Some(cell) = search.pop() {
        if cell == goal {
            return Some(search.trace(start, goal));
        }
        search.expand(cell);
    }
    None
}

struct RidgeSearch<'a> {
    mask: &'a TraversableMask<'a>,
    frame: &'a GridFrame,
    goal: Cell,
    weight: f64,
    marks: Vec<u8>,
    /// Cost so far in cells plus 1, so that the zeroed pages of an untouched map mean unseen.
    costs: Vec<f32>,
    /// The step that led here.
    steps: Vec<u8>,
    /// Estimated total cost (bits of a positive float, which sort like it) and cell.
    open: BinaryHeap<Reverse<(u32, u32)>>,
}

impl<'a> RidgeSearch<'a> {
    fn new(mask: &'a TraversableMask<'a>, goal: Cell, weight: f64) -> Self {
        let frame = mask.frame();
        Self {
            mask,
            frame,
            goal,
            weight,
            marks: vec![0; frame.len()],
            costs: vec![0.0; frame.len()],
            steps: vec![0; frame.len()],
            open: BinaryHeap::new(),
        }
    }

    fn mark(&mut self, cell: Cell) -> Mark {
        let index = self.frame.index(cell);
        match self.marks[index] {
            0 => {
                let open = self.mask.is_open(cell);
                self.marks[index] = if open { 1 } else { 2 };
                if open { Mark::Unseen } else { Mark::Blocked }
            }
            1 if self.costs[index] > 0.0 => Mark::Open,
            1 => Mark::Unseen,
            2 => Mark::Blocked,
            _ => Mark::Closed,
        }
    }

    fn push(&mut self, cell: Cell, cost: f32, step: usize) {
        let index = self.frame.index(cell);
        self.costs[index] = cost;
        self.steps[index] = step as u8;
        let (dc, dr) = (cell.col.abs_diff(self.goal.col) as f32, cell.row.abs_diff(self.goal.row) as f32);
        let octile = dc.max(dr) + (std::f32::consts::SQRT_2 - 1.0) * dc.min(dr);
        self.open.push(Reverse(((cost + octile).to_bits(), index as u32)));
    }

    fn pop(&mut self) -> Option<Cell> {
        while let Some(Reverse((_, index))) = self.open.pop() {
            let index = index as usize;
            if self.marks[index] != 3 {
                self.marks[index] = 3;
                return Some(self.frame.cell(index));
            }
        }
        None
    }

    fn expand(&mut self, cell: Cell) {
        let so_far = self.costs[self.frame.index(cell)];
        let mut side_open = [false; 4];
        for (number, &step) in STEPS.iter().enumerate() {
            let Some(next) = offset(self.frame, cell, step) else { continue };
            let mark = self.mark(next);
            if number < 4 {
                side_open[number] = mark != Mark::Blocked;
            } else if !diagonal_is_clear(step, side_open) {
                continue;
            }
            if mark == Mark::Blocked || mark == Mark::Closed {
                continue;
            }
            let length = if number < 4 { 1.0 } else { std::f32::consts::SQRT_2 };
            let cost = so_far + length * self.price(next);
            if mark == Mark::Unseen || cost < self.costs[self.frame.index(next)] {
                self.push(next, cost, number);
            }
        }
    }

    fn price(&self, cell: Cell) -> f32 {
        let (least, comfort) = (self.mask.least_m, self.mask.comfort_m);
        let lack = ((comfort - self.mask.clearance_m(cell)) / (comfort - least)).clamp(0.0, 1.0);
        (1.0 + self.weight * lack * lack) as f32
    }

    fn trace(&self, start: Cell, goal: Cell) -> Vec<Cell> {
        let mut cells = vec![goal];
        let mut cell = goal;
        while cell != start {
            let back = STEPS[usize::from(self.steps[self.frame.index(cell)]) ^ 1];
            cell = offset(self.frame, cell, back).expect("the search came from inside the grid");
            cells.push(cell);
        }
        cells.reverse();
        cells
    }
}

/// Both cells beside a diagonal step must be open; `side_open` is right, left, up, down.
const fn diagonal_is_clear(step: (isize, isize), side_open: [bool; 4]) -> bool {
    let across = if step.0 > 0 { side_open[0] } else { side_open[1] };
    let along = if step.1 > 0 { side_open[2] } else { side_open[3] };
    across && along
}

fn offset(frame: &GridFrame, cell: Cell, (dc, dr): (isize, isize)) -> Option<Cell> {
    let col = cell.col.checked_add_signed(dc).filter(|&c| c < frame.width)?;
    let row = cell.row.checked_add_signed(dr).filter(|&r| r < frame.height)?;
    Some(Cell::new(col, row))
}

#[cfg(test)]
mod tests {
    use sharp_space::{DistanceField, OccupancyGrid};

    use super::*;

    fn check(drawing: &str, start: (usize, usize), goal: (usize, usize), expected: &str) {
        let grid = OccupancyGrid::from_ascii(1.0, drawing).unwrap();
        let field = DistanceField::new(&grid);
        let mask = TraversableMask { field: &field, allowed: &|_| true, least_m: 0.3, comfort_m: 2.5 };
        let way = ridge(&mask, Cell::new(start.0, start.1), Cell::new(goal.0, goal.1), 8.0).unwrap();
        let mut rows: Vec<Vec<char>> = grid.to_string().lines().map(|row| row.chars().collect()).collect();
        let height = rows.len();
        way.iter().for_each(|cell| rows[height - 1 - cell.row][cell.col] = 'o');
        let drawn: Vec<String> = rows.into_iter().map(|row| row.into_iter().collect()).collect();
        assert_eq!(drawn, expected.split_whitespace().collect::<Vec<_>>());
    }

    #[test]
    fn the_way_keeps_to_the_middle_of_a_door() {
        check(
            "
            ###########
            #....#....#
            #.........#
            #.........#
            #.........#
            #....#....#
            ###########",
            (1, 1),
            (9, 1),
            "
            ###########
            #....#....#
            #.........#
            #..ooooo..#
            #.o.....o.#
            #o...#...o#
            ###########",
        );
    }

    #[test]
    fn walls_and_forbidden_cells_have_no_way_through() {
        let grid = OccupancyGrid::from_ascii(1.0, "#####\n#.#.#\n#...#\n#####").unwrap();
        let field = DistanceField::new(&grid);
        let mask = TraversableMask {
            field: &field,
            allowed: &|cell| cell != Cell::new(2, 1),
            least_m: 0.3,
            comfort_m: 1.0,
        };
        assert_eq!(ridge(&mask, Cell::new(1, 1), Cell::new(3, 1), 1.0), None);
    }

    /// The number in column `index` of a line of a MovingAI scenario.
    fn number<T: std::str::FromStr>(line: &str, index: usize) -> T {
        line.split('\t').nth(index).and_then(|word| word.trim().parse().ok()).expect("a sound scenario")
    }

    #[test]
    #[allow(
        clippy::disallowed_methods,
        reason = "real maps lie outside the repository, and the caller says where"
    )]
    fn lengths_are_optimal_where_clearance_is_free_and_bounded_where_it_is_not() {
        let Some(folder) = std::env::var_os("SHARP_REAL_MAPS").map(std::path::PathBuf::from) else {
            println!("skipped: SHARP_REAL_MAPS names no folder of real maps");
            return;
        };
        let text = |name: &str| std::fs::read_to_string(folder.join("movingai").join(name)).expect("a file");
        let (map, scenario) = (text("room-32-32-4.map"), text("room-32-32-4-even-1.scen"));
        let drawing: Vec<String> = map.lines().skip(4).map(|row| row.replace(['@', 'T'], "#")).collect();
        let grid = OccupancyGrid::from_ascii(1.0, &drawing.join("\n")).expect("a sound map");
        let height = grid.frame().height;
        let field = DistanceField::new(&grid);
        let mask = TraversableMask { field: &field, allowed: &|_| true, least_m: 0.3, comfort_m: 2.5 };
        let length_m = |line: &str, weight: f64| {
            let cell = |at: usize| Cell::new(number(line, at), height - 1 - number::<usize>(line, at + 1));
            let way = ridge(&mask, cell(4), cell(6), weight).expect("every problem has a way");
            let step = |pair: &[Cell]| {
                if pair[0].col == pair[1].col || pair[0].row == pair[1].row { 1.0 } else { 2.0_f64.sqrt() }
            };
            way.windows(2).map(step).sum::<f64>()
        };
        let problems: Vec<&str> = scenario.lines().skip(1).filter(|line| !line.trim().is_empty()).collect();
        assert!(problems.len() > 100, "{} problems", problems.len());
        for line in problems {
            let optimal_m: f64 = number(line, 8);
            assert!((length_m(line, 0.0) - optimal_m).abs() < 1e-4, "{line}: {}", length_m(line, 0.0));
            // A metre costs 1 to 1 + weight, so that no way is longer than that many times the shortest.
            let (weight, preferring_m) = (1.5, length_m(line, 1.5));
            assert!(
                (optimal_m - 1e-4..=(1.0 + weight) * optimal_m + 1e-4).contains(&preferring_m),
                "{line}: {preferring_m} m with clearance preferred"
            );
        }
    }
}
