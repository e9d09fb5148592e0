//! What a predictor says about every cell of a map: how critical it is and in which direction plans
//! pass it.

use sharp_space::{Cell, GridFrame, Heading, Region};

/// Number of heading classes: ten equal sectors of [−π, π), as in HARP's labels.
pub const HEADING_BINS: usize = 10;

/// Stands for "no heading known" in [`Heatmap`]'s heading plane.
pub(crate) const NO_HEADING: u8 = u8::MAX;

/// The middle of heading class `bin`.
pub(crate) fn bin_heading(bin: u8) -> Heading {
    let share = (f64::from(bin) + 0.5) / HEADING_BINS as f64;
    Heading::new(share * std::f64::consts::TAU - std::f64::consts::PI)
}

/// Predicted criticality of each cell of a map, from 0 to 1, and the usual heading there.
#[derive(Clone, Debug, PartialEq)]
pub struct Heatmap {
    frame: GridFrame,
    /// Row-major, 0 to 1.
    criticality: Vec<f32>,
    /// Row-major heading classes.
    headings: Vec<u8>,
}

impl Heatmap {
    /// A heat map that is 0 everywhere.
    #[must_use]
    pub fn cold(frame: GridFrame) -> Self {
        Self { frame, criticality: vec![0.0; frame.len()], headings: vec![NO_HEADING; frame.len()] }
    }

    /// The heat map of `criticality`, row-major; values are clamped to 0..1 and NaN becomes 0.
    ///
    /// # Panics
    /// If there is not one value a cell.
    #[must_use]
    pub fn from_values(frame: GridFrame, mut criticality: Vec<f32>) -> Self {
        assert_eq!(criticality.len(), frame.len(), "one criticality per cell");
        for value in &mut criticality {
            *value = if value.is_nan() { 0.0 } else { value.clamp(0.0, 1.0) };
        }
        Self { frame, headings: vec![NO_HEADING; criticality.len()], criticality }
    }

    /// The heat map that is 1 inside `regions` and 0 elsewhere.
    #[must_use]
    pub fn from_regions(frame: GridFrame, regions: &[Region]) -> Self {
        let mut heatmap = Self::cold(frame);
        for &cell in regions.iter().flat_map(|region| &region.cells) {
            heatmap.criticality[frame.index(cell)] = 1.0;
        }
        heatmap
    }

    #[cfg(feature = "network")]
    pub(crate) fn with_headings(mut self, headings: Vec<u8>) -> Self {
        assert_eq!(headings.len(), self.frame.len(), "one heading class per cell");
        self.headings = headings;
        self
    }

    /// The frame of the map it was made for.
    #[must_use]
    pub const fn frame(&self) -> &GridFrame {
        &self.frame
    }

    /// The criticality of `cell`, 0 to 1.
    ///
    /// # Panics
    /// If `cell` lies outside the map.
    #[must_use]
    pub fn at(&self, cell: Cell) -> f64 {
        f64::from(self.criticality[self.frame.index(cell)])
    }

    /// The criticality of all cells, row-major from the lower-left one.
    #[must_use]
    pub fn values(&self) -> &[f32] {
        &self.criticality
    }

    /// The same values, taken out of the heat map.
    #[must_use]
    pub fn into_values(self) -> Vec<f32> {
        self.criticality
    }

    /// The heading most plans have at `cell`, or `None` where none was predicted.
    ///
    /// # Panics
    /// If `cell` lies outside the map.
    #[must_use]
    pub fn heading(&self, cell: Cell) -> Option<Heading> {
        let bin = self.headings[self.frame.index(cell)];
        (bin != NO_HEADING).then(|| bin_heading(bin))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn heading_classes_start_at_minus_pi() {
        let tenth = std::f64::consts::PI / 10.0;
        for (bin, expected) in [(0, 11.0 * tenth), (5, tenth), (9, 9.0 * tenth)] {
            let turn = bin_heading(bin).turn_to(Heading::new(expected));
            assert!(turn.abs() < 1e-12, "middle of class {bin} is off by {turn}");
        }
    }

    #[test]
    fn values_outside_0_to_1_are_clamped() {
        let frame = GridFrame {
            origin: sharp_space::Pose::new(0.0, 0.0, 0.0),
            resolution_m: 1.0,
            width: 3,
            height: 1,
        };
        let heatmap = Heatmap::from_values(frame, vec![f32::NAN, -1.0, 7.0]);
        assert_eq!(heatmap.values(), [0.0, 0.0, 1.0]);
    }
}
