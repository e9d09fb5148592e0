//! Region-based Voronoi diagram of the configuration space (Definition 2) and the abstraction α.
//!
//! Every free cell belongs to the state whose region is nearest along free space. So states are
//! connected by construction; with the straight distance of the paper's text they need not be. Ties
//! go to the lower [`RegionId`]: the diagram depends on nothing but its input.

use petgraph::unionfind::UnionFind;
use serde::{Deserialize, Serialize};
use sharp_space::{Cell, DistanceField, Footprint, GridFrame, Point, Region, RegionId};
use thiserror::Error;

use crate::abstraction::{StateAbstraction, portals_between};
use crate::grow::grow;
use crate::nearest::nearest_in_straight_line;
use crate::portal::{Portal, PortalId, PortalSettings, crossings, portals_at};
use crate::regions::CellAssignment;
use crate::space::{DIAGONAL, FreeSpace, NONE};
use crate::state_grid::{StateGrid, StateGridError};

/// Names an abstract state s ∈ S and its cell ψ; equal to its region's [`RegionId`].
///
/// The given regions come first, in their order. Regions made up for parts of the map that have none
/// follow.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(transparent)]
pub struct StateId(pub u32);

/// Which region counts as nearest.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub enum CellMetric {
    /// The one with the shortest way through free space, in moves to the eight surrounding cells.
    #[default]
    Geodesic,
    /// The one nearest in a straight line, through walls, as the paper's text says. A piece cut off
    /// from its region becomes a state of its own or, if too small, goes to the states around it.
    Euclidean,
}

/// How to cut the configuration space. The default suits a robot that is a point.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[non_exhaustive]
pub struct RbvdSettings {
    /// Which region counts as nearest.
    pub metric: CellMetric,
    /// Clearance that the robot's centre needs to travel, metres: states grow among cells that
    /// have it, so no state leaks through a gap that the robot cannot pass.
    pub min_clearance_m: f64,
    /// Clearance below which the robot's centre cannot be at all, metres. Cells with a clearance
    /// between the two join the nearest state once all states have grown. So α is also defined where
    /// the robot may stand but should not drive.
    pub fringe_clearance_m: f64,
    /// Borders narrower than this join no states, metres.
    pub portal_min_width_m: f64,
    /// Parts without a region that are smaller than this stay without a state, square metres.
    pub state_min_area_m2: f64,
    /// Largest radius of a region made up for a part without any, metres.
    pub synthetic_radius_m: f64,
}

impl Default for RbvdSettings {
    fn default() -> Self {
        Self {
            metric: CellMetric::Geodesic,
            min_clearance_m: 0.0,
            fringe_clearance_m: 0.0,
            portal_min_width_m: 0.0,
            // MHARP drops pieces below 234 pixels of 0.067 m.
            state_min_area_m2: 1.0,
            synthetic_radius_m: 0.5,
        }
    }
}

impl RbvdSettings {
    /// Settings for a robot that keeps `margin_m` to either side, on a grid of `resolution_m`.
    ///
    /// α is then defined at every collision-free pose in a part of the map large enough for a state.
    /// The fringe reaches half a cell's diagonal further, because a pose may have that much more
    /// clearance than the centre of its cell.
    #[must_use]
    pub fn for_footprint(footprint: &Footprint, margin_m: f64, resolution_m: f64) -> Self {
        let inscribed_m = footprint.inscribed_radius_m();
        let half_diagonal_m = std::f64::consts::FRAC_1_SQRT_2 * resolution_m;
        Self {
            min_clearance_m: inscribed_m + margin_m,
            fringe_clearance_m: (inscribed_m - half_diagonal_m).max(0.0),
            portal_min_width_m: 2.0 * (inscribed_m + margin_m),
            ..Self::default()
        }
    }

    /// As the paper's text says: straight distances, a robot without size, every common border counts.
    #[must_use]
    pub fn paper() -> Self {
        Self { metric: CellMetric::Euclidean, ..Self::default() }
    }
}

/// A region-based Voronoi diagram Ψ with its abstract states S.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "crate::store::StoredRbvd", into = "crate::store::StoredRbvd")]
pub struct Rbvd {
    pub(crate) cells: StateGrid,
    pub(crate) settings: RbvdSettings,
    pub(crate) regions: Vec<Region>,
    pub(crate) given_count: usize,
    pub(crate) component_count: usize,
    pub(crate) free_count: usize,
    pub(crate) portals: Vec<Portal>,
    /// For each state its neighbours, sorted: what `portals` say, ready to be borrowed.
    pub(crate) neighbors: Vec<Vec<StateId>>,
}

impl Rbvd {
    /// Cuts the space that `clearance` describes into one state for each of `regions`.
    ///
    /// A region is first cut down to its piece in free space with the most clearance; cells in
    /// several regions count for the first. A region without any free cell keeps its state, but
    /// the state has no cells and no neighbours.
    ///
    /// # Errors
    /// Returns an error if a setting is negative or not finite, if a region's id is not its
    /// position or a cell of it lies outside the grid, if the grid has more than 43 million cells or
    /// no sound frame, or if no cell gets a state.
    pub fn build(
        clearance: &DistanceField,
        regions: &[Region],
        settings: &RbvdSettings,
    ) -> Result<Self, RbvdError> {
        let frame = *clearance.frame();
        validate(&frame, regions, settings)?;
        let space = FreeSpace::new(clearance, settings.min_clearance_m);
        let states = vec![NONE; frame.len()];
        let mut assignment =
            CellAssignment { clearance, space: &space, settings, regions: Vec::new(), states };
        assignment.place(regions);
        if settings.metric == CellMetric::Euclidean {
            let nearest = nearest_in_straight_line(&space, &assignment.states);
            assignment.split(&nearest);
        }
        grow(&space, &mut assignment.states);
        assignment.claim_parts_without_region();

        let CellAssignment { regions: all, mut states, .. } = assignment;
        let crossings = crossings(&space, &states);
        let touching = crossings.iter().map(|crossing| crossing.between);
        let component_count = count_components(&states, touching, all.len());
        if component_count == 0 {
            return Err(RbvdError::NoRoom { min_clearance_m: settings.min_clearance_m });
        }
        let portals = portals_at(&crossings, &space, clearance, &PortalSettings::of(settings));
        let fringe = FreeSpace::new(clearance, settings.fringe_clearance_m.min(settings.min_clearance_m));
        grow(&fringe, &mut states);
        Ok(Self {
            cells: StateGrid::from_names(frame, states, settings.fringe_clearance_m)?,
            settings: settings.clone(),
            neighbors: neighbors(&portals, all.len()),
            given_count: regions.len(),
            free_count: (0..frame.len()).filter(|&i| fringe.is_free(i)).count(),
            regions: all,
            component_count,
            portals,
        })
    }

    /// Any abstraction as a diagram, so that it can be stored in the file format of diagrams. A
    /// diagram gives an equal diagram.
    ///
    /// What other abstractions do not say is filled in: every region counts as given, the parts of the
    /// map are those that portals join, every cell where the robot may stand counts as covered, and
    /// the settings hold the fringe clearance and the width of the narrowest portal.
    #[must_use]
    pub fn from_abstraction(states: &dyn StateAbstraction) -> Self {
        if let Some(rbvd) = states.as_rbvd() {
            return rbvd.clone();
        }
        let (cells, portals, count) = (states.cells().clone(), states.portals().to_vec(), states.len());
        let joined = portals.iter().map(|portal| (portal.between.0.0, portal.between.1.0));
        let settings = RbvdSettings {
            min_clearance_m: cells.fringe_clearance_m(),
            fringe_clearance_m: cells.fringe_clearance_m(),
            portal_min_width_m: portals.iter().map(|p| p.width_m).reduce(f64::min).unwrap_or(0.0),
            ..RbvdSettings::default()
        };
        Self {
            settings,
            neighbors: neighbors(&portals, count),
            given_count: count,
            free_count: cells.names().iter().filter(|&&state| state != NONE).count(),
            component_count: count_components(cells.names(), joined, count),
            regions: states.regions().to_vec(),
            cells,
            portals,
        }
    }

    /// α: the state whose cell holds `point`, if any.
    #[must_use]
    pub fn state_at(&self, point: Point) -> Option<StateId> {
        self.cells.state_at(point)
    }

    /// α: the state of `cell`, if it has one.
    ///
    /// # Panics
    /// If `cell` lies outside the grid.
    #[must_use]
    pub fn state_of(&self, cell: Cell) -> Option<StateId> {
        self.cells.state_of(cell)
    }

    /// All states, in order.
    pub fn states(&self) -> impl ExactSizeIterator<Item = StateId> + use<> {
        (0..self.regions.len() as u32).map(StateId)
    }

    /// The number of states.
    #[must_use]
    pub const fn len(&self) -> usize {
        self.regions.len()
    }

    /// Returns true if there is no state.
    #[must_use]
    pub const fn is_empty(&self) -> bool {
        self.regions.is_empty()
    }

    /// The region of `state`, as it lies in free space.
    ///
    /// # Panics
    /// If there is no such state.
    #[must_use]
    pub fn region(&self, state: StateId) -> &Region {
        &self.regions[state.0 as usize]
    }

    /// Returns true if the region of `state` was made up, because its part of the map had none.
    #[must_use]
    pub const fn is_synthetic(&self, state: StateId) -> bool {
        state.0 as usize >= self.given_count
    }

    /// The states that share a portal with `state`, sorted: V of the paper.
    ///
    /// # Panics
    /// If there is no such state.
    #[must_use]
    pub fn neighbors(&self, state: StateId) -> &[StateId] {
        &self.neighbors[state.0 as usize]
    }

    /// All portals, sorted by the states they join.
    #[must_use]
    pub fn portals(&self) -> &[Portal] {
        &self.portals
    }

    /// The portal called `id`.
    ///
    /// # Panics
    /// If there is no such portal.
    #[must_use]
    pub fn portal(&self, id: PortalId) -> &Portal {
        &self.portals[id.0 as usize]
    }

    /// The portals between two states, in whichever order they are named.
    pub fn portals_between(&self, a: StateId, b: StateId) -> impl ExactSizeIterator<Item = &Portal> {
        portals_between(&self.portals, a, b).iter()
    }

    /// The share of the cells where the robot may stand that have a state, from 0 to 1.
    #[must_use]
    pub fn covered_share(&self) -> f64 {
        let covered = self.cells.names().iter().filter(|&&state| state != NONE).count();
        covered as f64 / self.free_count as f64
    }

    /// The number of parts of the map, with a state, between which the robot cannot travel.
    #[must_use]
    pub const fn component_count(&self) -> usize {
        self.component_count
    }

    /// Where the grid lies in the world.
    #[must_use]
    pub const fn frame(&self) -> &GridFrame {
        self.cells.frame()
    }

    /// The settings it was built with.
    #[must_use]
    pub const fn settings(&self) -> &RbvdSettings {
        &self.settings
    }
}

/// Why no diagram could be built.
#[derive(Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum RbvdError {
    /// A setting is out of range.
    #[error("{field} is {value}, must be finite and at least 0")]
    Setting {
        /// The name of the field.
        field: &'static str,
        /// Its value.
        value: f64,
    },
    /// A region is called other than its position.
    #[error("region at position {position} is called {id:?}, must be called by its position")]
    RegionId {
        /// Position in the list, from 0.
        position: usize,
        /// The name found.
        id: RegionId,
    },
    /// A region reaches out of the grid.
    #[error("region {} has a cell in column {}, row {}, outside the grid", id.0, cell.col, cell.row)]
    RegionCell {
        /// The region.
        id: RegionId,
        /// Its first cell outside.
        cell: Cell,
    },
    /// The grid is too large for distances in 32 bits.
    #[error("grid has {cells} cells, must be at most {}", CELLS_MAX)]
    TooLarge {
        /// Number of cells.
        cells: usize,
    },
    /// The grid cannot hold a diagram.
    #[error(transparent)]
    Cells(#[from] StateGridError),
    /// There is no room for a state.
    #[error(
        "no part of the map with {min_clearance_m:.3} m of clearance has a region or the size of a state"
    )]
    NoRoom {
        /// The clearance asked for, metres.
        min_clearance_m: f64,
    },
}

/// More cells could overflow the length of a way that visits all of them.
pub(crate) const CELLS_MAX: usize = (NONE / DIAGONAL) as usize;

fn validate(frame: &GridFrame, regions: &[Region], settings: &RbvdSettings) -> Result<(), RbvdError> {
    let fields = [
        ("min_clearance_m", settings.min_clearance_m),
        ("fringe_clearance_m", settings.fringe_clearance_m),
        ("portal_min_width_m", settings.portal_min_width_m),
        ("state_min_area_m2", settings.state_min_area_m2),
        ("synthetic_radius_m", settings.synthetic_radius_m),
    ];
    if let Some((field, value)) = fields.into_iter().find(|(_, v)| !(v.is_finite() && *v >= 0.0)) {
        return Err(RbvdError::Setting { field, value });
    }
    if frame.len() > CELLS_MAX {
        return Err(RbvdError::TooLarge { cells: frame.len() });
    }
    for (position, region) in regions.iter().enumerate() {
        if region.id.0 as usize != position {
            return Err(RbvdError::RegionId { position, id: region.id });
        }
        let outside = |cell: &&Cell| cell.col >= frame.width || cell.row >= frame.height;
        if let Some(&cell) = region.cells.iter().chain([&region.representative]).find(outside) {
            return Err(RbvdError::RegionCell { id: region.id, cell });
        }
    }
    Ok(())
}

/// The number of parts that the states with cells form, if the pairs of states in `joined` belong to
/// one part each. States that touch do: moves reach every cell of a state.
fn count_components(states: &[u32], joined: impl Iterator<Item = (u32, u32)>, count: usize) -> usize {
    let mut parts = UnionFind::new(count);
    for (a, b) in joined {
        parts.union(a as usize, b as usize);
    }
    let mut inhabited = vec![false; count];
    for &state in states.iter().filter(|&&state| state != NONE) {
        inhabited[state as usize] = true;
    }
    let mut roots: Vec<usize> = (0..count).filter(|&s| inhabited[s]).map(|s| parts.find(s)).collect();
    roots.sort_unstable();
    roots.dedup();
    roots.len()
}

/// For each of `count` states the states it shares a portal with, sorted.
pub(crate) fn neighbors(portals: &[Portal], count: usize) -> Vec<Vec<StateId>> {
    let mut neighbors = vec![Vec::new(); count];
    for Portal { between: (a, b), .. } in portals {
        neighbors[a.0 as usize].push(*b);
        neighbors[b.0 as usize].push(*a);
    }
    for list in &mut neighbors {
        list.sort_unstable();
        list.dedup();
    }
    neighbors
}
