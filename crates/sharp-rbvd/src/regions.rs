//! Regions as they lie in the configuration space, and regions for the parts that have none.

use sharp_space::{DistanceField, Region, RegionId, trig};

use crate::diagram::RbvdSettings;
use crate::space::{FreeSpace, NONE};

/// A diagram under construction: the regions so far and, for each cell, its state or [`NONE`].
pub(crate) struct CellAssignment<'a> {
    pub(crate) clearance: &'a DistanceField,
    pub(crate) space: &'a FreeSpace,
    pub(crate) settings: &'a RbvdSettings,
    pub(crate) regions: Vec<Region>,
    pub(crate) states: Vec<u32>,
}

impl CellAssignment<'_> {
    /// Places the `given` regions. Each is cut down to one connected piece of free cells that no
    /// earlier region holds: the piece with the most clearance. A region without free cells stays
    /// as it is and gets no cell.
    pub(crate) fn place(&mut self, given: &[Region]) {
        let frame = self.space.frame;
        let mut closed = vec![true; self.states.len()];
        for region in given {
            let indices = region.cells.iter().map(|&cell| frame.index(cell));
            let open: Vec<usize> =
                indices.filter(|&i| self.space.is_free(i) && self.states[i] == NONE).collect();
            let Some(whole) = self.region(region.id, &open) else {
                self.regions.push(region.clone());
                continue;
            };
            open.iter().for_each(|&i| closed[i] = false);
            let piece = self.space.flood(frame.index(whole.representative), &mut closed, |_| true);
            open.iter().for_each(|&i| closed[i] = true);
            self.settle(region.id, &piece, &piece);
        }
    }

    /// Makes a state, with a region of its own, of every part without state that is large enough.
    pub(crate) fn claim_parts_without_region(&mut self) {
        let mut seen = vec![false; self.states.len()];
        for start in 0..self.states.len() {
            if !seen[start] && self.states[start] == NONE && self.space.is_free(start) {
                let part = self.space.flood(start, &mut seen, |i| self.states[i] == NONE);
                self.claim(&part);
            }
        }
    }

    /// Takes over `labels`, in which a state may have several pieces. The piece around the region
    /// keeps the state; another becomes a state of its own if it is large enough.
    pub(crate) fn split(&mut self, labels: &[u32]) {
        let mut seen = vec![false; labels.len()];
        for (id, region) in self.regions.iter().enumerate() {
            let start = self.space.frame.index(region.representative);
            if labels[start] == id as u32 {
                let piece = self.space.flood(start, &mut seen, |i| labels[i] == id as u32);
                piece.into_iter().for_each(|i| self.states[i] = id as u32);
            }
        }
        for start in 0..labels.len() {
            if !seen[start] && labels[start] != NONE {
                let piece = self.space.flood(start, &mut seen, |i| labels[i] == labels[start]);
                self.claim(&piece);
            }
        }
    }

    /// Gives `part` to a new state if it is large enough. Its region is a disc around the cell with
    /// the most clearance, small enough to lie in free space.
    fn claim(&mut self, part: &[usize]) {
        let frame = self.space.frame;
        let area_m2 = part.len() as f64 * frame.resolution_m * frame.resolution_m;
        let id = RegionId(self.regions.len() as u32);
        let Some(whole) = self.region(id, part).filter(|_| area_m2 >= self.settings.state_min_area_m2) else {
            return;
        };
        let center = whole.representative;
        // Clearance falls by at most one metre a metre, so every cell of such a disc has enough of it.
        let margin_m = self.clearance.at(center) - self.settings.min_clearance_m;
        let radius_cells = margin_m.min(self.settings.synthetic_radius_m) / frame.resolution_m;
        let in_disc = |index: usize| {
            let cell = frame.cell(index);
            let (dx, dy) = (cell.col.abs_diff(center.col) as f64, cell.row.abs_diff(center.row) as f64);
            trig::hypot(dx, dy) <= radius_cells
        };
        let disc: Vec<usize> = part.iter().copied().filter(|&i| in_disc(i)).collect();
        self.settle(id, &disc, part);
    }

    /// Adds the region `id` of cells `region` and gives `cells` to its state.
    fn settle(&mut self, id: RegionId, region: &[usize], cells: &[usize]) {
        self.regions.extend(self.region(id, region));
        cells.iter().for_each(|&i| self.states[i] = id.0);
    }

    fn region(&self, id: RegionId, indices: &[usize]) -> Option<Region> {
        let cells = indices.iter().map(|&i| self.space.frame.cell(i)).collect();
        Region::new(id, cells, self.clearance)
    }
}
