//! Where critical regions come from: the trait behind a network, a geometric rule or a list.
//!
//! Line 5 of Algorithm 1 predicts the critical regions Φ of an environment. Everything above takes them as
//! data, so they may come from any [`RegionDetector`].

use std::sync::Arc;

use crate::footprint::Footprint;
use crate::grid::OccupancyGrid;
use crate::region::Region;

/// Finds the critical regions Φ of a map for a robot. Implement [`detect`](Self::detect).
///
/// A critical region is a connected set of free cells that many solutions pass and few uniform samples hit.
/// [`conformance::check_region_detector`](crate::conformance::check_region_detector) tests an implementation.
pub trait RegionDetector: Send + Sync {
    /// The critical regions of `grid` for a robot with the outline `footprint`.
    ///
    /// The regions carry the ids 0, 1, 2, … in order. Each has at least one cell, and all its cells are free.
    /// The answer depends on nothing but the arguments and the detector: asked twice, it is equal. A map
    /// without critical regions, or without any free cell, gives an empty list; that is no error.
    fn detect(&self, grid: &OccupancyGrid, footprint: &Footprint) -> Detection;
}

/// What a [`RegionDetector`] found.
#[derive(Clone, Debug, PartialEq)]
pub struct Detection {
    /// The regions; the id of each is its position in the list.
    pub regions: Vec<Region>,
    /// What found them, as a short word for results and files: `net`, `geometric`, `list`, …
    pub source: String,
    /// How critical each cell is, from 0 to 1, row by row from the lowest row, for pictures. `None` if the
    /// detector does not know.
    pub criticality: Option<Vec<f32>>,
}

impl Detection {
    /// Regions found by `source`, without the criticality of single cells.
    #[must_use]
    pub fn new(regions: Vec<Region>, source: impl Into<String>) -> Self {
        Self { regions, source: source.into(), criticality: None }
    }

    /// The same, with one value from 0 to 1 per cell of the grid, row by row from the lowest row.
    #[must_use]
    pub fn with_criticality(self, criticality: Vec<f32>) -> Self {
        Self { criticality: Some(criticality), ..self }
    }
}

impl<D: RegionDetector + ?Sized> RegionDetector for &D {
    fn detect(&self, grid: &OccupancyGrid, footprint: &Footprint) -> Detection {
        (**self).detect(grid, footprint)
    }
}

impl<D: RegionDetector + ?Sized> RegionDetector for Box<D> {
    fn detect(&self, grid: &OccupancyGrid, footprint: &Footprint) -> Detection {
        (**self).detect(grid, footprint)
    }
}

impl<D: RegionDetector + ?Sized> RegionDetector for Arc<D> {
    fn detect(&self, grid: &OccupancyGrid, footprint: &Footprint) -> Detection {
        (**self).detect(grid, footprint)
    }
}
