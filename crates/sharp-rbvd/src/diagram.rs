//! Region-based Voronoi diagram of the configuration space (Definition 2) and the abstraction α.
//!
//! Every free cell belongs to the state whose region is nearest along free space, so states are
//! connected by construction, which the straight distance of the paper's letter cannot give. Ties
//! go to the lower [`RegionId`]: the diagram depends on nothing but its input.

use petgraph::unionfind::UnionFind;
use serde::{Deserialize, Serialize};
use sharp_space::{Cell, DistanceField, Footprint, GridFrame, Point, Region, RegionId};
use thiserror::Error;

use crate::grow::grow;
use crate::nearest::nearest_in_straight_line;
use crate::portal::{Crossing, Portal, PortalId, crossings, find_portals};
use crate::regions::Draft;
use crate::space::{DIAGONAL, FreeSpace, NONE};

/// Names an abstract state s ∈ S and its cell ψ; equal to its region's [`RegionId`].
///
/// The given regions come first, in their order; regions made up for parts of the map without any
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
    /// The one nearest in straight line, through walls: the paper's letter. A piece cut off from
    /// its region becomes a state of its own or, if too small, goes to the states around it.
    Euclidean,
}

/// How to cut the configuration space. The default suits a robot that is a point.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct RbvdSettings {
    /// Which region counts as nearest.
    pub metric: CellMetric,
    /// Clearance that the robot's centre needs to travel, metres: states grow among cells that
    /// have it, so no state leaks through a gap that the robot cannot pass.
    pub min_clearance_m: f64,
    /// Clearance below which the robot's centre cannot be at all, metres. Cells between the two
    /// join the nearest state once all have grown, so that α also holds where the robot may stand
    /// but should not drive.
    pub fringe_clearance_m: f64,
    /// Borders with less room than this join no states, metres.
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
    /// α is then defined at every collision-free pose in a part of the map large enough for a
    /// state: half a cell's diagonal is what a pose can gain over its cell's centre.
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

    /// The paper's letter: straight distances, a robot without size, every common border counts.
    #[must_use]
    pub fn paper() -> Self {
        Self { metric: CellMetric::Euclidean, ..Self::default() }
    }
}

/// A region-based Voronoi diagram Ψ with its abstract states S.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(try_from = "crate::store::StoredRbvd", into = "crate::store::StoredRbvd")]
pub struct Rbvd {
    pub(crate) frame: GridFrame,
    pub(crate) settings: RbvdSettings,
    /// For each cell its state or [`NONE`].
    pub(crate) states: Vec<u32>,
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
    /// position or a cell of it lies outside the grid, if the grid has more than 43 million cells,
    /// or if no cell gets a state.
    pub fn build(
        clearance: &DistanceField,
        regions: &[Region],
        settings: &RbvdSettings,
    ) -> Result<Self, RbvdError> {
        let frame = *clearance.frame();
        validate(&frame, regions, settings)?;
        let space = FreeSpace::new(clearance, settings.min_clearance_m);
        let states = vec![NONE; frame.len()];
        let mut draft = Draft { clearance, space: &space, settings, regions: Vec::new(), states };
        draft.place(regions);
        if settings.metric == CellMetric::Euclidean {
            let nearest = nearest_in_straight_line(&space, &draft.states);
            draft.split(&nearest);
        }
        grow(&space, &mut draft.states);
        draft.claim_parts_without_region();

        let Draft { regions: all, mut states, .. } = draft;
        let crossings = crossings(&space, &states);
        let component_count = count_components(&states, &crossings, all.len());
        if component_count == 0 {
            return Err(RbvdError::NoRoom { min_clearance_m: settings.min_clearance_m });
        }
        let widths = (settings.min_clearance_m, settings.portal_min_width_m);
        let portals = find_portals(&space, clearance, &crossings, widths);
        let fringe = FreeSpace::new(clearance, settings.fringe_clearance_m.min(settings.min_clearance_m));
        grow(&fringe, &mut states);
        Ok(Self {
            frame,
            settings: settings.clone(),
            neighbors: neighbors(&portals, all.len()),
            given_count: regions.len(),
            free_count: (0..frame.len()).filter(|&i| fringe.is_free(i)).count(),
            regions: all,
            states,
            component_count,
            portals,
        })
    }

    /// α: the state whose cell holds `point`, if any.
    #[must_use]
    pub fn state_at(&self, point: Point) -> Option<StateId> {
        self.frame.cell_at(point).and_then(|cell| self.state_of(cell))
    }

    /// α: the state of `cell`, if it has one.
    ///
    /// # Panics
    /// If `cell` lies outside the grid.
    #[must_use]
    pub fn state_of(&self, cell: Cell) -> Option<StateId> {
        Some(self.states[self.frame.index(cell)]).filter(|&state| state != NONE).map(StateId)
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
        let between = (a.min(b), a.max(b));
        let first = self.portals.partition_point(|portal| portal.between < between);
        let count = self.portals[first..].partition_point(|portal| portal.between == between);
        self.portals[first..first + count].iter()
    }

    /// The share of the cells where the robot may stand that have a state, from 0 to 1.
    #[must_use]
    pub fn covered_share(&self) -> f64 {
        let covered = self.states.iter().filter(|&&state| state != NONE).count();
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
        &self.frame
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
    /// There is no room for a state.
    #[error("no part of the map with {min_clearance_m} m of clearance has a region or the size of a state")]
    NoRoom {
        /// The clearance asked for, metres.
        min_clearance_m: f64,
    },
}

/// More cells could overflow the length of a way that visits all of them.
const CELLS_MAX: usize = (NONE / DIAGONAL) as usize;

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

/// States that touch at all lie in one part of free space: moves reach every cell of a state.
fn count_components(states: &[u32], crossings: &[Crossing], count: usize) -> usize {
    let mut parts = UnionFind::new(count);
    for crossing in crossings {
        parts.union(crossing.between.0 as usize, crossing.between.1 as usize);
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
