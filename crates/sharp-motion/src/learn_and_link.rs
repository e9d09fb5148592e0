//! Learn and Link (Molina, Kumar and Srivastava, ICRA 2020): the planner behind the paper's guide paths.
//!
//! One tree grows from each critical seed, from the start and from the goal. Round-robin, a tree is extended
//! by one step and every other tree is connected to the new pose. The published planner keeps undirected
//! edges; a forward-only robot cannot drive them back, so here each pose belongs to a *group*: reached from
//! the start, leading to the goal, or a patch around some seeds. A link from the start's group into a patch
//! moves everything that the linked pose leads to; a link into the goal's group everything that leads to it.
//! The query is solved when the two groups meet. Without patches the algorithm is RRT-Connect, so it is
//! probabilistically complete.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use sharp_space::{CollisionChecker, Pose, Stream};

use crate::maneuver::Maneuver;
use crate::path::Path;
use crate::query::{MotionQuery, PathOutcome, RrtSettings};
use crate::sampler::Sampler;
use crate::steering::Steering;
use crate::tree::{Direction, Extender, Extension, poses_along};

/// Grows a tree from the start, the goal and each free seed and links them; seeds in collision are skipped.
///
/// Returns the cheapest path in the roadmap that was grown. It gives up after the budget's samples, or when the roadmap has
/// grown three times as many poses as the budget has samples.
pub fn learn_and_link(
    query: &MotionQuery,
    seeds: &[Pose],
    checker: &(impl CollisionChecker + ?Sized),
    steering: &Steering,
    sampler: &mut (impl Sampler + ?Sized),
    settings: &RrtSettings,
    rng: &mut Stream,
) -> PathOutcome {
    if let Some(outcome) = query.blocked_end(checker) {
        return outcome;
    }
    let extender = Extender { checker, steering, settings };
    let free_seeds = seeds.iter().copied().filter(|&seed| checker.is_free(seed));
    let mut roadmap = Roadmap::new(query, free_seeds);
    let seeded = roadmap.poses.len();
    let mut turn = START;
    for iteration in 0..settings.budget.iterations {
        let direction = roadmap.growth(turn, iteration);
        let target = if iteration == 0 { query.goal } else { sampler.sample(rng) };
        if let Some(new) = roadmap.extend(&extender, turn, direction, target) {
            roadmap.link_all(&extender, new);
        }
        if roadmap.solved {
            let edges = roadmap.cheapest();
            let poses = poses_along(query.start, &edges, settings.check_step_m);
            return PathOutcome::Solved(Path::new(poses).expect("it holds the start"));
        }
        turn = roadmap.next_group(turn);
        // Every pose is compared with all others.
        if roadmap.poses.len() - seeded > POSES_A_SAMPLE.saturating_mul(settings.budget.iterations) {
            return PathOutcome::Exhausted { iterations: iteration + 1 };
        }
    }
    PathOutcome::Exhausted { iterations: settings.budget.iterations }
}

/// Poses that a roadmap may grow for each sample of the budget.
const POSES_A_SAMPLE: usize = 3;
/// The group of poses that the start leads to.
const START: usize = 0;
/// The group of poses that lead to the goal.
const GOAL: usize = 1;

struct RoadmapLink {
    from: usize,
    to: usize,
    maneuver: Maneuver,
}

struct Roadmap {
    poses: Vec<Pose>,
    group: Vec<usize>,
    links: Vec<RoadmapLink>,
    /// Numbers of the links that leave and enter each pose.
    leaving: Vec<Vec<usize>>,
    entering: Vec<Vec<usize>>,
    /// Poses in each group. An empty group no longer exists.
    sizes: Vec<usize>,
    solved: bool,
}

impl Roadmap {
    fn new(query: &MotionQuery, seeds: impl Iterator<Item = Pose>) -> Self {
        let mut roadmap = Self {
            poses: Vec::new(),
            group: Vec::new(),
            links: Vec::new(),
            leaving: Vec::new(),
            entering: Vec::new(),
            sizes: Vec::new(),
            solved: false,
        };
        for (group, pose) in [query.start, query.goal].into_iter().chain(seeds).enumerate() {
            roadmap.sizes.push(0);
            roadmap.push(pose, group);
        }
        roadmap
    }

    fn push(&mut self, pose: Pose, group: usize) -> usize {
        self.poses.push(pose);
        self.group.push(group);
        self.leaving.push(Vec::new());
        self.entering.push(Vec::new());
        self.sizes[group] += 1;
        self.poses.len() - 1
    }

    /// The start's group can only grow forward and the goal's backward; patches take turns.
    const fn growth(&self, group: usize, iteration: usize) -> Direction {
        match group {
            START => Direction::Forward,
            GOAL => Direction::Backward,
            _ if iteration.is_multiple_of(2) => Direction::Forward,
            _ => Direction::Backward,
        }
    }

    fn next_group(&self, group: usize) -> usize {
        let count = self.sizes.len();
        (1..=count).map(|i| (group + i) % count).find(|&g| self.sizes[g] > 0).unwrap_or(START)
    }

    /// One step of `group` towards `target`: the new pose, if no obstacle is in the way.
    fn extend<C: CollisionChecker + ?Sized>(
        &mut self,
        extender: &Extender<'_, C>,
        group: usize,
        direction: Direction,
        target: Pose,
    ) -> Option<usize> {
        let near = self.nearest_per_group(extender, target, |_| direction)[group]?.node;
        let step = extender.step(direction, self.poses[near], target)?;
        Some(self.grow(near, direction, &step))
    }

    /// Connects every other group to `new`, as far as each gets.
    fn link_all<C: CollisionChecker + ?Sized>(&mut self, extender: &Extender<'_, C>, new: usize) {
        let home = self.group[new];
        let direction = |group| match (home, group) {
            (START, _) | (_, GOAL) => Direction::Backward,
            (GOAL, _) | (_, START) => Direction::Forward,
            // Between patches either direction is allowed. The parity of the new pose's number picks one.
            _ if new.is_multiple_of(2) => Direction::Forward,
            _ => Direction::Backward,
        };
        let nearest = self.nearest_per_group(extender, self.poses[new], direction);
        for (group, near) in nearest.into_iter().enumerate() {
            // An earlier link may have merged this group with the new pose's.
            let Some(near) = near.filter(|near| self.group[near.node] != self.group[new]) else { continue };
            self.connect(extender, near.node, direction(group), new);
            if self.solved {
                return;
            }
        }
    }

    /// Steps from `node` towards the pose `goal` until it is linked or an obstacle is in the way.
    fn connect<C: CollisionChecker + ?Sized>(
        &mut self,
        extender: &Extender<'_, C>,
        mut node: usize,
        direction: Direction,
        goal: usize,
    ) {
        while let Some(step) = extender.step(direction, self.poses[node], self.poses[goal]) {
            if step.reached {
                self.link(node, goal, direction, step.edge);
                return;
            }
            node = self.grow(node, direction, &step);
        }
    }

    fn grow(&mut self, node: usize, direction: Direction, step: &Extension) -> usize {
        let new = self.push(step.pose, self.group[node]);
        self.link(node, new, direction, step.edge);
        new
    }

    fn link(&mut self, node: usize, other: usize, direction: Direction, maneuver: Maneuver) {
        let (from, to) = if direction == Direction::Forward { (node, other) } else { (other, node) };
        self.leaving[from].push(self.links.len());
        self.entering[to].push(self.links.len());
        self.links.push(RoadmapLink { from, to, maneuver });
        match (self.group[from], self.group[to]) {
            (a, b) if a == b => {}
            (START, GOAL) => self.solved = true,
            (START, _) => self.flood(to, START),
            (_, GOAL) => self.flood(from, GOAL),
            // A link into the start's group or out of the goal's group brings nothing.
            (_, START) | (GOAL, _) => {}
            (a, b) => self.merge(a.max(b), a.min(b)),
        }
    }

    /// Moves `node` and all it leads to (or, for the goal's group, all that leads to it) into `group`.
    fn flood(&mut self, node: usize, group: usize) {
        let mut open = vec![node];
        while let Some(node) = open.pop() {
            let old = self.group[node];
            if old == group {
                continue;
            }
            if old == START || old == GOAL {
                self.solved = true;
                continue;
            }
            self.sizes[old] -= 1;
            self.sizes[group] += 1;
            self.group[node] = group;
            if group == START {
                open.extend(self.leaving[node].iter().map(|&link| self.links[link].to));
            } else {
                open.extend(self.entering[node].iter().map(|&link| self.links[link].from));
            }
        }
    }

    fn merge(&mut self, gone: usize, kept: usize) {
        for group in &mut self.group {
            if *group == gone {
                *group = kept;
            }
        }
        self.sizes[kept] += self.sizes[gone];
        self.sizes[gone] = 0;
    }

    /// For each group the pose that is cheapest to connect with `target`.
    fn nearest_per_group<C: CollisionChecker + ?Sized>(
        &self,
        extender: &Extender<'_, C>,
        target: Pose,
        direction: impl Fn(usize) -> Direction,
    ) -> Vec<Option<NearestPose>> {
        let mut nearest: Vec<Option<NearestPose>> = vec![None; self.sizes.len()];
        for (node, (&pose, &group)) in self.poses.iter().zip(&self.group).enumerate() {
            // Driving is never shorter than the straight, so most poses need no maneuver.
            let best_m = nearest[group].map_or(f64::INFINITY, |near| near.cost_m);
            if pose.distance_m(&target) >= best_m {
                continue;
            }
            let cost_m = extender.maneuver(direction(group), pose, target).cost_m();
            if cost_m < best_m {
                nearest[group] = Some(NearestPose { node, cost_m });
            }
        }
        nearest
    }

    /// The edges of the cheapest path from the start to the goal, by Dijkstra's algorithm.
    fn cheapest(&self) -> Vec<Maneuver> {
        let mut cost = vec![f64::INFINITY; self.poses.len()];
        let mut via = vec![usize::MAX; self.poses.len()];
        let mut open = BinaryHeap::from([Reverse((OrderedCost(0.0), START))]);
        cost[START] = 0.0;
        while let Some(Reverse((OrderedCost(so_far), node))) = open.pop() {
            if so_far > cost[node] {
                continue;
            }
            for &number in &self.leaving[node] {
                let link = &self.links[number];
                let total = so_far + link.maneuver.cost_m();
                if total < cost[link.to] {
                    cost[link.to] = total;
                    via[link.to] = number;
                    open.push(Reverse((OrderedCost(total), link.to)));
                }
            }
        }
        let mut edges = Vec::new();
        let mut node = GOAL;
        while node != START {
            let link = &self.links[via[node]];
            edges.push(link.maneuver);
            node = link.from;
        }
        edges.reverse();
        edges
    }
}

#[derive(Clone, Copy)]
struct NearestPose {
    node: usize,
    cost_m: f64,
}

/// A finite cost with the total order that a heap needs.
#[derive(Clone, Copy, PartialEq)]
struct OrderedCost(f64);

impl Eq for OrderedCost {}

impl PartialOrd for OrderedCost {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for OrderedCost {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0)
    }
}
