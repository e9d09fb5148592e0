//! Hybrid A* (Dolgov, Thrun, Montemerlo and Diebel 2010): search over driven arcs on a lattice.
//!
//! Poses stay exact, but only the cheapest pose in each bin of position and heading is expanded. The outline
//! is tested along every arc, and a metre near a wall costs more than one with clearance. The heuristic is
//! the cheapest path over the cells with enough clearance. The paper has no such planner. The baselines that
//! follow a planned path use it.

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::f64::consts::TAU;

use sharp_space::{Cell, Point, Pose, RobotGeometry};

use crate::maneuver::Primitive;
use crate::path::Path;
use crate::query::{Budget, MotionQuery, PathOutcome};
use crate::steering::Steering;

/// Cost of a metre in a bend, as a multiple of a straight metre: it keeps the path from swaying.
const BEND_PRICE: f64 = 1.1;
/// Heading bins that an arc of the tightest bend passes, at least.
const BINS_PER_ARC: f64 = 1.3;
/// The longest arc in units of the usual one.
const LONGEST_STEPS: f64 = 2.0;
/// Stands for no node.
const NONE: u32 = u32::MAX;

/// The settings of [`hybrid_astar`].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HybridSettings {
    /// When to give up; an iteration expands one pose.
    pub budget: Budget,
    /// Length of an arc, metres; longer than the diagonal of a bin, or an arc could end where it began.
    pub step_m: f64,
    /// Side of a bin, metres.
    pub bin_m: f64,
    /// Number of headings told apart.
    pub headings: usize,
    /// The tightest bend, metres; a robot that cannot drive it gets its own radius.
    pub bend_m: f64,
    /// How much more a metre without clearance costs than one with comfortable clearance.
    pub clearance_weight: f64,
    /// Clearance beyond the inscribed radius that is comfortable, metres.
    pub comfort_m: f64,
    /// The goal counts as reached within this distance; its heading is free.
    pub goal_radius_m: f64,
    /// The distance between two collision checks along an arc, metres.
    pub check_step_m: f64,
}

impl Default for HybridSettings {
    fn default() -> Self {
        Self {
            budget: Budget { iterations: 2_000_000 },
            step_m: 0.2,
            bin_m: 0.1,
            headings: 48,
            bend_m: 0.5,
            clearance_weight: 4.0,
            comfort_m: 0.5,
            goal_radius_m: 0.15,
            check_step_m: 0.05,
        }
    }
}

/// The cheapest path on the lattice from the query's start to the goal's position.
#[must_use]
pub fn hybrid_astar(
    query: &MotionQuery,
    checker: &dyn RobotGeometry,
    steering: &Steering,
    settings: &HybridSettings,
) -> PathOutcome {
    if !checker.is_free(query.start) {
        return PathOutcome::InvalidStart;
    }
    let Some(rest_m) = cost_to_go_m(checker, query.goal.position, settings) else {
        return PathOutcome::InvalidGoal;
    };
    let settings = &settings.fitted(steering);
    let mut search = LatticeSearch::new(checker, &rest_m, settings);
    let moves = moves(steering, settings);
    search.push(query.start, 0.0, (NONE, Primitive::default()));
    for iterations in 0..settings.budget.iterations {
        let Some(node) = search.pop() else { return PathOutcome::Exhausted { iterations } };
        let pose = search.nodes[node as usize].pose;
        if (pose.position - query.goal.position).norm() <= settings.goal_radius_m {
            return PathOutcome::Solved(search.trace(node));
        }
        moves.iter().for_each(|&primitive| search.expand(node, primitive));
    }
    PathOutcome::Exhausted { iterations: settings.budget.iterations }
}

impl HybridSettings {
    /// The same with arcs so long, and headings told apart so finely, that the tightest bend leaves its bin with every arc.
    /// Else the cheapest pose of a bin, which has turned least, would hide those that have turned more, and a robot with
    /// wide bends would never get round a corner.
    fn fitted(&self, steering: &Steering) -> Self {
        let tightest_m = self.tightest_m(steering);
        let bin_rad = TAU / self.headings as f64;
        let step_m = (BINS_PER_ARC * bin_rad * tightest_m).clamp(self.step_m, LONGEST_STEPS * self.step_m);
        let headings = (BINS_PER_ARC * TAU * tightest_m / step_m - 1e-9).ceil() as usize;
        Self { step_m, headings: headings.max(self.headings), ..*self }
    }

    /// The radius of the tightest bend, metres. A robot in its own tightest bend cannot turn more to correct itself: a
    /// margin of a tenth.
    fn tightest_m(&self, steering: &Steering) -> f64 {
        self.bend_m.max(1.1 * steering.radius_m())
    }
}

/// Straight on, two bends to either side, and for a robot that can: turns in place by one bin.
fn moves(steering: &Steering, settings: &HybridSettings) -> Vec<Primitive> {
    let tightest_m = settings.tightest_m(steering);
    let bends = [0.0, 1.0, -1.0, 0.4, -0.4];
    let travel_m = settings.step_m;
    let mut moves = bends.map(|bend| Primitive { travel_m, turn_rad: bend * travel_m / tightest_m }).to_vec();
    if *steering == Steering::RotateTranslate {
        let turn_rad = TAU / settings.headings as f64;
        moves.extend([turn_rad, -turn_rad].map(|turn_rad| Primitive { travel_m: 0.0, turn_rad }));
    }
    moves
}

struct LatticeNode {
    pose: Pose,
    /// Cost of the path from the start, metres.
    cost_m: f64,
    parent: u32,
    primitive: Primitive,
}

struct LatticeSearch<'a> {
    checker: &'a dyn RobotGeometry,
    settings: &'a HybridSettings,
    /// Estimated cost of the rest for each cell, metres; infinite where there is no path.
    rest_m: &'a [f32],
    nodes: Vec<LatticeNode>,
    /// The best node of each bin plus one. Zero means none, so that pages of the map that no search touches
    /// are never written.
    best: Vec<u32>,
    bins: [usize; 2],
    /// Estimated total (bits of a positive float, which sort like it) and node.
    open: BinaryHeap<Reverse<(u64, u32)>>,
}

impl<'a> LatticeSearch<'a> {
    fn new(checker: &'a dyn RobotGeometry, rest_m: &'a [f32], settings: &'a HybridSettings) -> Self {
        let frame = checker.clearance().frame();
        let bins = [frame.width, frame.height]
            .map(|cells| (cells as f64 * frame.resolution_m / settings.bin_m) as usize + 1);
        let best = vec![0; bins[0] * bins[1] * settings.headings];
        Self { checker, settings, rest_m, nodes: Vec::new(), best, bins, open: BinaryHeap::new() }
    }

    fn bin(&self, pose: &Pose) -> usize {
        let frame = self.checker.clearance().frame();
        let at = frame.to_grid(pose.position) * (frame.resolution_m / self.settings.bin_m);
        let (col, row) = ((at.x as usize).min(self.bins[0] - 1), (at.y as usize).min(self.bins[1] - 1));
        let headings = self.settings.headings as i64;
        let heading = (pose.heading.radians() / TAU * headings as f64).round() as i64;
        (row * self.bins[0] + col) * self.settings.headings + heading.rem_euclid(headings) as usize
    }

    fn push(&mut self, pose: Pose, cost_m: f64, (parent, primitive): (u32, Primitive)) {
        let frame = self.checker.clearance().frame();
        let Some(cell) = frame.cell_at(pose.position) else { return };
        let rest_m = f64::from(self.rest_m[frame.index(cell)]);
        let bin = self.bin(&pose);
        let is_better = match self.best[bin] {
            0 => true,
            known => cost_m < self.nodes[known as usize - 1].cost_m,
        };
        // The start may lie too near to a wall for an estimate. No other pose may.
        if !is_better || (rest_m.is_infinite() && parent != NONE) {
            return;
        }
        self.nodes.push(LatticeNode { pose, cost_m, parent, primitive });
        let node = self.nodes.len() as u32;
        self.best[bin] = node;
        self.open.push(Reverse(((cost_m + rest_m).to_bits(), node - 1)));
    }

    /// The open node with the lowest estimate that is still the best of its bin.
    fn pop(&mut self) -> Option<u32> {
        loop {
            let Reverse((_, node)) = self.open.pop()?;
            if self.best[self.bin(&self.nodes[node as usize].pose)] == node + 1 {
                return Some(node);
            }
        }
    }

    fn expand(&mut self, node: u32, primitive: Primitive) {
        let LatticeNode { pose, cost_m, .. } = self.nodes[node as usize];
        let end = primitive.advance(pose, 1.0);
        if !self.checker.is_free(end) || !self.is_free_along(pose, primitive) {
            return;
        }
        let bend = if primitive.turn_rad == 0.0 { 1.0 } else { BEND_PRICE };
        let driven_m = bend * primitive.cost_m();
        let price = price(self.checker, self.checker.clearance().sample(end.position), self.settings);
        self.push(end, cost_m + driven_m * price, (node, primitive));
    }

    fn is_free_along(&self, from: Pose, primitive: Primitive) -> bool {
        let steps = (primitive.travel_m.max(primitive.turn_rad.abs()) / self.settings.check_step_m).ceil();
        (1..steps as usize).all(|i| self.checker.is_free(primitive.advance(from, i as f64 / steps)))
    }

    fn trace(&self, goal: u32) -> Path {
        let mut way = Vec::new();
        let mut node = &self.nodes[goal as usize];
        while node.parent != NONE {
            let from = &self.nodes[node.parent as usize];
            let extent = node.primitive.travel_m.max(node.primitive.turn_rad.abs());
            let steps = (extent / self.settings.check_step_m).ceil();
            let along = (1..=steps as usize).rev();
            way.extend(along.map(|i| node.primitive.advance(from.pose, i as f64 / steps)));
            node = from;
        }
        way.push(node.pose);
        way.reverse();
        Path::new(way).expect("it holds the start")
    }
}

/// What a metre costs where the nearest blocked cell is `clearance_m` away.
fn price(checker: &dyn RobotGeometry, clearance_m: f64, settings: &HybridSettings) -> f64 {
    let room_m = clearance_m - checker.footprint().inscribed_radius_m();
    let lack = (1.0 - room_m / settings.comfort_m).clamp(0.0, 1.0);
    1.0 + settings.clearance_weight * lack * lack
}

/// For each cell the cost of the cheapest path to `goal` over cells with clearance for the robot's width.
/// `None` if the goal itself lacks that clearance.
fn cost_to_go_m(checker: &dyn RobotGeometry, goal: Point, settings: &HybridSettings) -> Option<Vec<f32>> {
    let (field, frame) = (checker.clearance(), checker.clearance().frame());
    // Distances between centres are wrong by up to 1.21 cells. The heuristic must not close a passage that is
    // open.
    let least_m =
        (checker.footprint().inscribed_radius_m() - 1.21 * frame.resolution_m).max(f64::MIN_POSITIVE);
    let mut costs = vec![f32::INFINITY; frame.len()];
    let goal = frame.cell_at(goal).filter(|&cell| field.at(cell) >= least_m)?;
    costs[frame.index(goal)] = 0.0;
    let mut open = BinaryHeap::from([Reverse((0_u32, frame.index(goal)))]);
    while let Some(Reverse((cost, index))) = open.pop() {
        let so_far = f32::from_bits(cost);
        if so_far > costs[index] {
            continue;
        }
        let cell = frame.cell(index);
        for next in frame.neighbors8(cell).filter(|&next| field.at(next) >= least_m) {
            let cost = so_far
                + (length_m(cell, next, frame.resolution_m) * price(checker, field.at(next), settings))
                    as f32;
            let known = &mut costs[frame.index(next)];
            if cost < *known {
                *known = cost;
                open.push(Reverse((cost.to_bits(), frame.index(next))));
            }
        }
    }
    Some(costs)
}

fn length_m(a: Cell, b: Cell, resolution_m: f64) -> f64 {
    if a.col == b.col || a.row == b.row { resolution_m } else { std::f64::consts::SQRT_2 * resolution_m }
}

#[cfg(test)]
mod tests {
    use sharp_space::{CollisionChecker, Footprint, FootprintChecker, OccupancyGrid};

    use super::*;

    const CAR: Steering = Steering::Dubins { radius_m: 0.4 };

    fn rooms() -> FootprintChecker {
        let grid = OccupancyGrid::from_ascii(
            0.5,
            "
            ################
            #.......#......#
            #.......#......#
            #..............#
            #..............#
            #.......#......#
            #.......#......#
            ################",
        )
        .unwrap();
        FootprintChecker::new(&grid, Footprint::rectangle(0.5, 0.3).unwrap())
    }

    fn solve(steering: &Steering, start: Pose, goal: Pose) -> Path {
        let outcome =
            hybrid_astar(&MotionQuery { start, goal }, &rooms(), steering, &HybridSettings::default());
        outcome.path().unwrap_or_else(|| panic!("{steering:?} found no path"))
    }

    #[test]
    fn paths_are_free_end_at_the_goal_and_are_drivable() {
        let (start, goal) = (Pose::new(2.0, 1.3, 1.6), Pose::new(6.5, 2.9, 0.0));
        for steering in [Steering::RotateTranslate, CAR] {
            let path = solve(&steering, start, goal);
            assert_eq!(path.start(), start, "{steering:?}");
            assert!(path.end().distance_m(&goal) <= 0.15, "{steering:?} ends at {:?}", path.end());
            let checker = rooms();
            assert!(path.poses().iter().all(|&pose| checker.is_free(pose)), "{steering:?}");
            for pair in path.poses().windows(2) {
                let turn = pair[0].heading.turn_to(pair[1].heading).abs();
                assert!(
                    turn * steering.radius_m() <= pair[0].distance_m(&pair[1]) + 1e-9,
                    "{steering:?}: {pair:?}"
                );
                assert!(pair[0].distance_m(&pair[1]) < 0.051 && turn < 0.14, "{steering:?}: {pair:?}");
            }
        }
    }

    #[test]
    fn a_car_with_wide_bends_gets_round_a_corner() {
        let drawing: Vec<String> = (0..90).map(|_| ".".repeat(50)).collect();
        let grid = OccupancyGrid::from_ascii(0.1, &drawing.join("\n")).unwrap();
        let checker = FootprintChecker::new(&grid, Footprint::rectangle(1.0, 0.5).unwrap());
        let (start, goal) = (Pose::new(2.0, 2.0, 1.57), Pose::new(3.5, 5.0, 0.0));
        for radius_m in [1.9, 2.4] {
            let steering = Steering::Dubins { radius_m };
            let query = MotionQuery { start, goal };
            let outcome = hybrid_astar(&query, &checker, &steering, &HybridSettings::default());
            let path = outcome.path().unwrap_or_else(|| panic!("{radius_m}: no path"));
            assert!(path.poses().iter().all(|&pose| checker.is_free(pose)), "{radius_m}: overlaps");
        }
    }

    #[test]
    fn a_path_through_the_middle_of_the_door_is_cheaper() {
        let path = solve(&CAR, Pose::new(1.5, 2.0, 0.0), Pose::new(6.5, 2.0, 0.0));
        let in_door = path.poses().iter().filter(|pose| (pose.position.x - 4.25).abs() < 0.3);
        let off_m = in_door.map(|pose| (pose.position.y - 2.0).abs()).fold(0.0, f64::max);
        assert!(off_m < 0.15, "{off_m} m off the middle");
    }

    #[test]
    fn failures_are_told_apart() {
        let ask = |start, goal, iterations| {
            let settings = HybridSettings { budget: Budget { iterations }, ..HybridSettings::default() };
            hybrid_astar(&MotionQuery { start, goal }, &rooms(), &CAR, &settings)
        };
        let (inside, wall) = (Pose::new(1.5, 2.0, 0.0), Pose::new(4.2, 0.8, 0.0));
        assert_eq!(ask(wall, inside, 10), PathOutcome::InvalidStart);
        assert_eq!(ask(inside, wall, 10), PathOutcome::InvalidGoal);
        assert_eq!(ask(inside, Pose::new(6.5, 2.0, 0.0), 3), PathOutcome::Exhausted { iterations: 3 });
    }
}
