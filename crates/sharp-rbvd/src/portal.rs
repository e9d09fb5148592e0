//! Where two cells of the diagram meet, and whether a robot passes there.
//!
//! The paper's neighbourhood V asks only for a common border. Two rooms may share two doors, and a
//! border may be too narrow for the robot. So each piece of a border that is wide enough is a
//! [`Portal`], and two states are neighbours if a portal joins them. A border may also run from a
//! corridor through a doorway into a room. Its widest point then lies in the room, and a robot that
//! follows the corridor never gets there. So a piece also ends where the border narrows and widens
//! again.

use std::collections::BTreeMap;

use petgraph::unionfind::UnionFind;
use serde::{Deserialize, Serialize};
use sharp_space::{Cell, DistanceField, Heading, Point, Vector};

use crate::diagram::{RbvdSettings, StateId};
use crate::space::{FreeSpace, NONE};
use crate::state_grid::StateGrid;

/// Names a portal; equal to its position in [`Rbvd::portals`](crate::Rbvd::portals).
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct PortalId(pub u32);

/// How much the border must narrow between two places for them to be portals of their own, metres:
/// more than the rounding of distances to cells.
const PROMINENCE_M: f64 = 0.1;

/// One piece of the border between two cells of the diagram.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Portal {
    /// Its name.
    pub id: PortalId,
    /// The states it joins, the lower one first.
    pub between: (StateId, StateId),
    /// The border point with the most clearance (ties: the one nearest to the piece's middle).
    #[serde(with = "coordinates")]
    pub point: Point,
    /// The grid cell of the lower state whose side `point` is the middle of.
    pub cell: Cell,
    /// The direction across the border at `point`, from the lower to the higher state.
    pub normal: Heading,
    /// Free width across the direction of travel, metres: twice the clearance at `point`, but at most
    /// the length of the border piece plus the clearance that the robot needs at both ends.
    pub width_m: f64,
}

impl Portal {
    /// The state on the other side of `state`; `None` if the portal does not touch `state`.
    #[must_use]
    pub fn other_side(&self, state: StateId) -> Option<StateId> {
        let (low, high) = self.between;
        if state == low { Some(high) } else { (state == high).then_some(low) }
    }
}

/// What a robot needs to pass from one state to another. The default suits a robot that is a point.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[non_exhaustive]
pub struct PortalSettings {
    /// Clearance that the robot's centre needs to travel, metres.
    pub min_clearance_m: f64,
    /// Pieces of a border narrower than this are no portals, metres.
    pub min_width_m: f64,
}

impl PortalSettings {
    /// What the diagram with these settings asks for.
    pub(crate) const fn of(settings: &RbvdSettings) -> Self {
        Self { min_clearance_m: settings.min_clearance_m, min_width_m: settings.portal_min_width_m }
    }
}

/// Two grid cells with a common side and different states.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Crossing {
    /// The states, the lower one first.
    pub(crate) between: (u32, u32),
    /// Their cells, in the same order.
    cells: (usize, usize),
}

/// All places where two states meet, sorted.
pub(crate) fn crossings(space: &FreeSpace, states: &[u32]) -> Vec<Crossing> {
    let state = |index: usize| if space.is_free(index) { states[index] } else { NONE };
    let width = space.frame.width;
    let mut found = Vec::new();
    for index in 0..states.len() {
        let right = Some(index + 1).filter(|other| other % width > 0);
        let up = Some(index + width).filter(|&other| other < states.len());
        for other in right.into_iter().chain(up) {
            let (here, there) = (state(index), state(other));
            if here != there && here != NONE && there != NONE {
                found.push(if here < there {
                    Crossing { between: (here, there), cells: (index, other) }
                } else {
                    Crossing { between: (there, here), cells: (other, index) }
                });
            }
        }
    }
    found.sort_unstable();
    found
}

/// The portals of any labelling of a grid with states, sorted by the states they join.
///
/// `clearance` is the distance field of the same grid. States meet only where both cells have the
/// clearance that the robot needs.
///
/// # Panics
/// If the two belong to grids of different sizes.
#[must_use]
pub fn find_portals(cells: &StateGrid, clearance: &DistanceField, settings: &PortalSettings) -> Vec<Portal> {
    assert_eq!(cells.frame().len(), clearance.frame().len(), "states and clearance are of one map");
    let space = FreeSpace::new(clearance, settings.min_clearance_m);
    portals_at(&crossings(&space, cells.names()), &space, clearance, settings)
}

/// The portals among `crossings` that are wide enough, sorted by their states.
pub(crate) fn portals_at(
    crossings: &[Crossing],
    space: &FreeSpace,
    clearance: &DistanceField,
    settings: &PortalSettings,
) -> Vec<Portal> {
    // 1 µm forgives the rounding of single-precision distances.
    let least_m = settings.min_width_m - 1e-6;
    let borders = crossings.chunk_by(|a, b| a.between == b.between);
    let pieces = borders.flat_map(|border| pieces(space, clearance, border));
    let portals = pieces.map(|piece| portal(space, clearance, &piece, settings.min_clearance_m));
    let wide = portals.filter(|portal| portal.width_m >= least_m);
    wide.zip(0..).map(|(portal, id)| Portal { id: PortalId(id), ..portal }).collect()
}

/// Splits the border of two states into pieces that each have one place with the most clearance.
///
/// Cells join in the order of falling clearance. Where two pools of cells meet they become one, unless
/// the lower of their two peaks exceeds the clearance at the meeting place by more than
/// [`PROMINENCE_M`].
fn pieces(space: &FreeSpace, clearance: &DistanceField, border: &[Crossing]) -> Vec<Vec<Crossing>> {
    let mut cells: Vec<usize> = border.iter().flat_map(|c| [c.cells.0, c.cells.1]).collect();
    cells.sort_unstable();
    cells.dedup();
    let clear_m = |vertex: usize| clearance.at(space.frame.cell(cells[vertex]));
    let mut order: Vec<usize> = (0..cells.len()).collect();
    order.sort_by(|&a, &b| clear_m(b).total_cmp(&clear_m(a)).then(a.cmp(&b)));

    let mut pools = UnionFind::new(cells.len());
    let mut peak: Vec<Option<f64>> = vec![None; cells.len()];
    for &vertex in &order {
        peak[vertex] = Some(clear_m(vertex));
        let next = space.moves(cells[vertex]).filter_map(|(other, _)| cells.binary_search(&other).ok());
        let flooded = next.filter(|&other| peak[other].is_some());
        let mut near: Vec<_> = flooded.map(|other| (peak[pools.find(other)].unwrap_or(0.0), other)).collect();
        // The pool with the highest peak first: it takes the cell, and the others join it.
        near.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
        for (index, &(_, other)) in near.iter().enumerate() {
            let pool = peak[pools.find(other)].expect("a flooded cell has a pool");
            let own = peak[pools.find(vertex)].expect("this cell is flooded");
            if index == 0 || pool.min(own) - clear_m(vertex) <= PROMINENCE_M {
                pools.union(vertex, other);
                peak[pools.find(vertex)] = Some(pool.max(own));
            }
        }
    }
    let mut by_pool: BTreeMap<usize, Vec<Crossing>> = BTreeMap::new();
    for &crossing in border {
        let vertex = cells.binary_search(&crossing.cells.0).expect("every border cell is listed");
        by_pool.entry(pools.find(vertex)).or_default().push(crossing);
    }
    let mut pieces: Vec<_> = by_pool.into_values().collect();
    // Sorted by first crossing, so that the order does not depend on how the sets were merged.
    pieces.sort_unstable();
    pieces
}

/// The portal of one piece of border for a robot whose centre stays `reach_m` from obstacles.
fn portal(space: &FreeSpace, clearance: &DistanceField, piece: &[Crossing], reach_m: f64) -> Portal {
    let frame = &space.frame;
    let place = |index| {
        let cell = frame.cell(index);
        Vector::new(cell.col as f64 + 0.5, cell.row as f64 + 0.5)
    };
    let middle = |crossing: &Crossing| (place(crossing.cells.0) + place(crossing.cells.1)) / 2.0;
    let clear_m = |crossing: &Crossing| {
        let at = |index| clearance.at(frame.cell(index));
        at(crossing.cells.0).min(at(crossing.cells.1))
    };
    let mean = piece.iter().map(middle).sum::<Vector>() / piece.len() as f64;
    let best = piece
        .iter()
        .min_by(|a, b| {
            let by_clearance = clear_m(b).total_cmp(&clear_m(a));
            by_clearance.then((middle(a) - mean).norm().total_cmp(&(middle(b) - mean).norm())).then(a.cmp(b))
        })
        .expect("a piece has at least one crossing");

    let across = |crossing: &Crossing| place(crossing.cells.1) - place(crossing.cells.0);
    let (center, window) = (middle(best), clear_m(best) / frame.resolution_m);
    let nearby = piece.iter().filter(|crossing| (middle(crossing) - center).norm() <= window);
    // One crossing points along a grid axis; the sum over a stretch of border points across it.
    let sum: Vector = nearby.map(across).sum();
    let normal = Heading::of(if sum.norm() > 0.5 { sum } else { across(best) });

    let (low, high) = piece.iter().map(middle).fold((center, center), |(l, h), m| (l.inf(&m), h.sup(&m)));
    let length_m = ((high - low).norm() + 1.0) * frame.resolution_m;
    Portal {
        id: PortalId(0),
        between: (StateId(best.between.0), StateId(best.between.1)),
        point: frame.from_grid(center),
        cell: frame.cell(best.cells.0),
        normal: Heading::new(normal.radians() + frame.origin.heading.radians()),
        width_m: (2.0 * clear_m(best) - frame.resolution_m).min(length_m + 2.0 * reach_m),
    }
}

/// Points as `[x, y]`: nalgebra's own serde support would add a dependency.
mod coordinates {
    use serde::{Deserialize, Deserializer, Serialize, Serializer};
    use sharp_space::Point;

    pub(super) fn serialize<S: Serializer>(point: &Point, serializer: S) -> Result<S::Ok, S::Error> {
        [point.x, point.y].serialize(serializer)
    }

    pub(super) fn deserialize<'de, D: Deserializer<'de>>(deserializer: D) -> Result<Point, D::Error> {
        <[f64; 2]>::deserialize(deserializer).map(|[x_m, y_m]| Point::new(x_m, y_m))
    }
}
