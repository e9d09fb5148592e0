//! A* over open cells that prefers clearance: the guide's first attempt.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use sharp_space::{Cell, GridFrame};

use crate::traversable::TraversableMask;

/// What is known of a cell during the search.
#[derive(Clone, Copy, PartialEq, Eq, Default)]
enum Mark {
    /// Nobody looked.
    #[default]
    Unseen,
    Blocked,
    Open,
    Closed,
}

/// One cell of the search.
#[derive(Clone, Copy, Default)]
struct Node {
    /// Cost so far, cells; infinite until a way leads here.
    cost: f32,
    mark: Mark,
    /// The step that led here.
    step: u8,
}

/// Nodes in squares of so many cells a side, which are made when the search comes there: most searches see little of a large map.
const TILE: usize = 64;

struct Nodes {
    tiles: Vec<Option<Box<[Node; TILE * TILE]>>>,
    tiles_in_row: usize,
}

impl Nodes {
    fn new(frame: &GridFrame) -> Self {
        let tiles_in_row = frame.width.div_ceil(TILE);
        Self { tiles: vec![None; tiles_in_row * frame.height.div_ceil(TILE)], tiles_in_row }
    }

    fn at(&mut self, cell: Cell) -> &mut Node {
        let tile = cell.row / TILE * self.tiles_in_row + cell.col / TILE;
        let nodes = self.tiles[tile].get_or_insert_with(|| Box::new([Node::default(); TILE * TILE]));
        &mut nodes[cell.row % TILE * TILE + cell.col % TILE]
    }
}

/// Columns and rows of the eight neighbours, sides first; the opposite of `i` is at `i ^ 1`.
const STEPS: [(isize, isize); 8] = [(1, 0), (-1, 0), (0, 1), (0, -1), (1, 1), (-1, -1), (1, -1), (-1, 1)];

/// A search that fails after this share of the map, one cell in so many, took as long as making its widest ways does.
const MUCH: usize = 16;

/// The cheapest 8-connected way from `start` to `goal`, both ends included, without cutting corners.
///
/// A metre costs 1 + `weight` · s², where s runs from 0 with comfortable room to 1 with the least.
/// Ties go to the lower cell.
pub(crate) fn ridge(mask: &TraversableMask<'_>, start: Cell, goal: Cell, weight: f64) -> Option<Vec<Cell>> {
    let mut search = RidgeSearch::new(mask, goal, weight);
    search.push(start, 1.0, 0);
    let mut expanded = 0;
    while let Some(cell) = search.pop() {
        if cell == goal {
            return Some(search.trace(start, goal));
        }
        search.expand(cell);
        expanded += 1;
    }
    if expanded > mask.frame().len() / MUCH {
        // The next search knows beforehand.
        mask.field.widest_paths();
    }
    None
}

struct RidgeSearch<'a> {
    mask: &'a TraversableMask<'a>,
    frame: &'a GridFrame,
    goal: Cell,
    weight: f64,
    nodes: Nodes,
    /// Estimated total cost (bits of a positive float, which sort like it) and cell.
    open: BinaryHeap<Reverse<(u32, u32)>>,
}

impl<'a> RidgeSearch<'a> {
    fn new(mask: &'a TraversableMask<'a>, goal: Cell, weight: f64) -> Self {
        let frame = mask.frame();
        Self { mask, frame, goal, weight, nodes: Nodes::new(frame), open: BinaryHeap::new() }
    }

    /// The node of `cell`, which is looked at the first time.
    fn node(&mut self, cell: Cell) -> &mut Node {
        let (mask, node) = (self.mask, self.nodes.at(cell));
        if node.mark == Mark::Unseen {
            node.mark = if mask.is_open(cell) { Mark::Open } else { Mark::Blocked };
            node.cost = f32::INFINITY;
        }
        node
    }

    fn push(&mut self, cell: Cell, cost: f32, step: usize) {
        let node = self.node(cell);
        (node.cost, node.step) = (cost, step as u8);
        let (dc, dr) = (cell.col.abs_diff(self.goal.col) as f32, cell.row.abs_diff(self.goal.row) as f32);
        let octile = dc.max(dr) + (std::f32::consts::SQRT_2 - 1.0) * dc.min(dr);
        self.open.push(Reverse(((cost + octile).to_bits(), self.frame.index(cell) as u32)));
    }

    fn pop(&mut self) -> Option<Cell> {
        while let Some(Reverse((_, index))) = self.open.pop() {
            let cell = self.frame.cell(index as usize);
            let node = self.nodes.at(cell);
            if node.mark != Mark::Closed {
                node.mark = Mark::Closed;
                return Some(cell);
            }
        }
        None
    }

    fn expand(&mut self, cell: Cell) {
        let so_far = self.nodes.at(cell).cost;
        let mut side_open = [false; 4];
        for (number, &step) in STEPS.iter().enumerate() {
            let Some(next) = offset(self.frame, cell, step) else { continue };
            let Node { mark, cost: before, .. } = *self.node(next);
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
            if cost < before {
                self.push(next, cost, number);
            }
        }
    }

    fn price(&self, cell: Cell) -> f32 {
        let (least, comfort) = (self.mask.least_m, self.mask.comfort_m);
        let lack = ((comfort - self.mask.clearance_m(cell)) / (comfort - least)).clamp(0.0, 1.0);
        (1.0 + self.weight * lack * lack) as f32
    }

    fn trace(&mut self, start: Cell, goal: Cell) -> Vec<Cell> {
        let mut cells = vec![goal];
        let mut cell = goal;
        while cell != start {
            let back = STEPS[usize::from(self.nodes.at(cell).step) ^ 1];
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
