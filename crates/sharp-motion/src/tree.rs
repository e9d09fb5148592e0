//! Directed trees of poses: grown forward from a start or backward from a goal.

use sharp_space::{CollisionChecker, Pose};

use crate::maneuver::Maneuver;
use crate::nearest::Nearest;
use crate::query::RrtSettings;
use crate::steering::Steering;

/// Extends trees: what every extension needs, and the steps themselves.
pub(crate) struct Extender<'a, C: ?Sized> {
    pub(crate) checker: &'a C,
    pub(crate) steering: &'a Steering,
    pub(crate) settings: &'a RrtSettings,
}

/// The direction in which a tree's edges are driven.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Direction {
    /// From the root outwards.
    Forward,
    /// Towards the root.
    Backward,
}

/// One step from a node towards a pose.
pub(crate) struct Extension {
    /// Driven away from the node, or towards it in a backward tree.
    pub(crate) edge: Maneuver,
    /// The far end.
    pub(crate) pose: Pose,
    /// Whether the far end is the pose aimed at.
    pub(crate) reached: bool,
}

impl<C: CollisionChecker + ?Sized> Extender<'_, C> {
    /// The connection between `node` and `target`, driven in `direction` as seen from the node.
    pub(crate) fn maneuver(&self, direction: Direction, node: Pose, target: Pose) -> Maneuver {
        match direction {
            Direction::Forward => self.steering.maneuver(node, target),
            Direction::Backward => self.steering.maneuver(target, node),
        }
    }

    /// Goes from `node` towards `target` by at most the range. `None` if an obstacle is in the way.
    pub(crate) fn step(&self, direction: Direction, node: Pose, target: Pose) -> Option<Extension> {
        let whole = self.maneuver(direction, node, target);
        let range_m = self.settings.range_m;
        let reached = whole.travel_m() <= range_m;
        let (edge, pose) = match direction {
            Direction::Forward => {
                let edge = whole.prefix(range_m);
                (edge, edge.to())
            }
            Direction::Backward => {
                let edge = whole.suffix(range_m);
                (edge, edge.from())
            }
        };
        let is_free = |pose| self.checker.is_free(pose);
        (is_free(pose) && edge.all(self.settings.check_step_m, is_free)).then_some(Extension {
            edge,
            pose,
            reached,
        })
    }
}

struct TreeNode {
    pose: Pose,
    parent: usize,
    /// Connects parent and node; at the root, a stay.
    edge: Maneuver,
}

/// A tree of poses. Node 0 is the root.
pub(crate) struct PoseTree {
    nodes: Vec<TreeNode>,
    index: Nearest,
    direction: Direction,
}

/// How an extension ended.
pub(crate) enum ExtensionEnd {
    Trapped,
    Advanced(usize),
    Reached(usize),
}

impl PoseTree {
    pub(crate) fn new(root: Pose, direction: Direction, settings: &RrtSettings) -> Self {
        let mut tree = Self { nodes: Vec::new(), index: Nearest::new(settings.range_m), direction };
        let stay = Maneuver::new(root, root, [crate::Primitive::default(); 3]);
        tree.push(TreeNode { pose: root, parent: 0, edge: stay });
        tree
    }

    pub(crate) fn pose(&self, node: usize) -> Pose {
        self.nodes[node].pose
    }

    /// The node from which `target` is cheapest to connect.
    pub(crate) fn nearest<C: CollisionChecker + ?Sized>(
        &self,
        extender: &Extender<'_, C>,
        target: Pose,
    ) -> usize {
        let cost = |i: usize| extender.maneuver(self.direction, self.nodes[i].pose, target).cost_m();
        self.index.nearest(target.position, cost).expect("a tree has a root")
    }

    /// One step from `node` towards `target`.
    pub(crate) fn extend<C: CollisionChecker + ?Sized>(
        &mut self,
        extender: &Extender<'_, C>,
        node: usize,
        target: Pose,
    ) -> ExtensionEnd {
        let Some(Extension { edge, pose, reached }) =
            extender.step(self.direction, self.nodes[node].pose, target)
        else {
            return ExtensionEnd::Trapped;
        };
        self.push(TreeNode { pose, parent: node, edge });
        let new = self.nodes.len() - 1;
        if reached { ExtensionEnd::Reached(new) } else { ExtensionEnd::Advanced(new) }
    }

    /// Steps from the nearest node towards `target` until it is reached or an obstacle is in the way.
    pub(crate) fn connect<C: CollisionChecker + ?Sized>(
        &mut self,
        extender: &Extender<'_, C>,
        target: Pose,
    ) -> Option<usize> {
        let mut node = self.nearest(extender, target);
        loop {
            match self.extend(extender, node, target) {
                ExtensionEnd::Trapped => return None,
                ExtensionEnd::Advanced(new) => node = new,
                ExtensionEnd::Reached(new) => return Some(new),
            }
        }
    }

    /// The edges between the root and `node` in the order in which they are driven.
    pub(crate) fn edges(&self, mut node: usize) -> Vec<Maneuver> {
        let mut edges = Vec::new();
        while node != 0 {
            edges.push(self.nodes[node].edge);
            node = self.nodes[node].parent;
        }
        if self.direction == Direction::Forward {
            edges.reverse();
        }
        edges
    }

    fn push(&mut self, node: TreeNode) {
        self.index.insert(node.pose.position);
        self.nodes.push(node);
    }
}

/// The poses along `edges`, which follow each other, at most `step_m` apart; `start` if there is none.
pub(crate) fn poses_along(start: Pose, edges: &[Maneuver], step_m: f64) -> Vec<Pose> {
    let mut poses = vec![start];
    for edge in edges {
        poses.extend(edge.poses(step_m).into_iter().skip(1));
    }
    poses
}
