//! A trained network as a predictor: from a map to how critical each cell is.
//!
//! The network was trained at one physical scale, so maps are resampled to it. Large maps are read
//! in overlapping tiles whose answers are blended, so that there are no seams and memory is needed
//! for one tile only.

use std::collections::BTreeMap;

use burn::tensor::activation::sigmoid;
use burn::tensor::{Tensor, TensorData, s};
use sharp_space::{Cell, DistanceField, GridFrame, OccupancyGrid, Vector};

use crate::heatmap::{Heatmap, NO_HEADING};
use crate::network::device::ComputeDevice;
use crate::network::image::{Image, sample_plane};
use crate::network::store::{ModelCard, ModelError, from_bytes, to_bytes};
use crate::network::unet::{INPUT_PLANES, UNet};
use crate::pixel::PIXEL_M;

/// Side of a tile, pixels: 48 m.
const TILE: usize = 384;
/// Pixels that neighbouring tiles share.
const OVERLAP: usize = 96;
/// The outermost pixels of a tile, whose answers suffer from its edge: they hardly count where tiles
/// overlap.
const RIM: usize = 32;

/// A trained network, ready to predict.
#[derive(Clone, Debug)]
pub struct RegionPredictor {
    network: UNet,
    card: ModelCard,
    device: ComputeDevice,
}

impl RegionPredictor {
    pub(crate) const fn new(network: UNet, card: ModelCard, device: ComputeDevice) -> Self {
        Self { network, card, device }
    }

    /// The network in the safetensors file `bytes`.
    ///
    /// # Errors
    /// Returns an error that says what is wrong with the file.
    pub fn from_bytes(bytes: &[u8], device: ComputeDevice) -> Result<Self, ModelError> {
        let (network, card) = from_bytes(bytes, &device.device())?;
        Ok(Self { network, card, device })
    }

    /// The safetensors file of this network.
    #[must_use]
    pub fn to_bytes(&self) -> Vec<u8> {
        to_bytes(&self.network, &self.card, &BTreeMap::new())
    }

    /// What the network is and how it was made.
    #[must_use]
    pub const fn card(&self) -> &ModelCard {
        &self.card
    }

    /// The criticality of every free cell of `grid`, whose distance field is `clearance`.
    ///
    /// # Panics
    /// If the two are of different sizes.
    #[must_use]
    pub fn heatmap(&self, grid: &OccupancyGrid, clearance: &DistanceField) -> Heatmap {
        let frame = *grid.frame();
        assert_eq!(frame.len(), clearance.frame().len(), "clearance is of the same map");
        let answer = self.answer(&Image::new(grid, clearance));
        let mut criticality = vec![0.0; frame.len()];
        let mut headings = vec![NO_HEADING; frame.len()];
        let scale = frame.resolution_m / PIXEL_M;
        for index in (0..frame.len()).filter(|&index| grid.is_free(frame.cell(index))) {
            let cell = frame.cell(index);
            let pixel = Vector::new((cell.col as f64 + 0.5) * scale, (cell.row as f64 + 0.5) * scale);
            criticality[index] = sample_plane(&answer.criticality, &answer.frame, pixel);
            let nearest = Cell::new(
                (pixel.x as usize).min(answer.frame.width - 1),
                (pixel.y as usize).min(answer.frame.height - 1),
            );
            headings[index] = answer.headings[answer.frame.index(nearest)];
        }
        Heatmap::from_values(frame, criticality).with_headings(headings)
    }

    /// The network's answer for every pixel.
    fn answer(&self, image: &Image) -> NetworkOutput {
        let mut answer = NetworkOutput::new(image.frame);
        for &row in &tile_starts(image.frame.height) {
            for &col in &tile_starts(image.frame.width) {
                self.answer_tile(image, Cell::new(col, row), &mut answer);
            }
        }
        answer.finish();
        answer
    }

    fn answer_tile(&self, image: &Image, corner: Cell, answer: &mut NetworkOutput) {
        let frame = &image.frame;
        let stride = self.network.config().stride();
        let size = |start: usize, side: usize| (side - start).min(TILE);
        let (width, height) = (size(corner.col, frame.width), size(corner.row, frame.height));
        let (wide, high) = (width.next_multiple_of(stride), height.next_multiple_of(stride));
        let mut values = Vec::with_capacity(INPUT_PLANES * wide * high);
        for (plane, outside) in [(&image.blocked, 1.0), (&image.clearance, 0.0)] {
            for row in 0..high {
                let inside = if row < height { width } else { 0 };
                let from = frame.index(Cell::new(corner.col, (corner.row + row).min(frame.height - 1)));
                values.extend_from_slice(&plane[from..from + inside]);
                values.resize(values.len() + wide - inside, outside);
            }
        }
        let data = TensorData::new(values, [1, INPUT_PLANES, high, wide]);
        let logits = self.network.forward(Tensor::from_data(data, &self.device.device()));
        let critical = sigmoid(logits.clone().slice(s![.., 0..1, .., ..]));
        let best = logits.slice(s![.., 1.., .., ..]).argmax(1);
        let critical = critical.try_to_vec_as::<f32>().expect("a CPU tensor can be read");
        let best = best.try_to_vec_as::<i64>().expect("a CPU tensor can be read");
        for row in 0..height {
            for col in 0..width {
                let from = row * wide + col;
                let weight = fade(col, width) * fade(row, height);
                let to = frame.index(Cell::new(corner.col + col, corner.row + row));
                answer.add(to, weight, critical[from], best[from] as u8);
            }
        }
    }
}

/// The network's answers, summed over tiles.
struct NetworkOutput {
    frame: GridFrame,
    criticality: Vec<f32>,
    headings: Vec<u8>,
    weights: Vec<f32>,
    heading_weights: Vec<f32>,
}

impl NetworkOutput {
    fn new(frame: GridFrame) -> Self {
        let zeros = vec![0.0; frame.len()];
        Self {
            frame,
            criticality: zeros.clone(),
            headings: vec![NO_HEADING; frame.len()],
            weights: zeros.clone(),
            heading_weights: zeros,
        }
    }

    /// Criticalities are averaged; the heading is that of the tile in which the pixel has most weight.
    fn add(&mut self, pixel: usize, weight: f32, critical: f32, heading: u8) {
        self.criticality[pixel] += weight * critical;
        self.weights[pixel] += weight;
        if weight > self.heading_weights[pixel] {
            self.heading_weights[pixel] = weight;
            self.headings[pixel] = heading;
        }
    }

    fn finish(&mut self) {
        for (value, weight) in self.criticality.iter_mut().zip(&self.weights) {
            *value /= weight;
        }
    }
}

/// Where tiles begin along an axis of `side` pixels, so that neighbours overlap and the last one
/// ends at the edge.
fn tile_starts(side: usize) -> Vec<usize> {
    if side <= TILE {
        return vec![0];
    }
    let last = side - TILE;
    let mut starts: Vec<usize> = (0..last).step_by(TILE - OVERLAP).collect();
    starts.push(last);
    starts
}

/// The weight of a tile's answer `position` pixels in: hardly any in the rim, then rising to 1.
fn fade(position: usize, length: usize) -> f32 {
    let to_edge = position.min(length - 1 - position) as f32 + 0.5;
    // Not zero: at the map's own edge there is no other tile.
    ((to_edge - RIM as f32) / (OVERLAP - 2 * RIM) as f32).clamp(1e-4, 1.0)
}

#[cfg(test)]
pub(crate) mod tests {
    use sharp_space::Seed;

    use super::*;
    use crate::network::unet::{Activation, UNetConfig};

    /// A predictor whose weights are random.
    pub(crate) fn untrained() -> RegionPredictor {
        let network = UNetConfig { width: 2, levels: 2, patch: 2, activation: Activation::Relu };
        let card = ModelCard {
            format: ModelCard::format(),
            network,
            half_length_m: 0.5,
            half_width_m: 0.3,
            radius_m: 0.0,
            steps: 0,
            maps: 0,
            seed: Seed(0),
        };
        let device = ComputeDevice::Flex;
        let network = UNet::init(network, &device.device(), &mut Seed(4).stream("weights", 0));
        RegionPredictor::new(network, card, device)
    }

    #[test]
    fn tiles_cover_every_pixel_and_end_at_the_edge() {
        for side in [1, TILE, TILE + 1, 600, 1200] {
            let starts = tile_starts(side);
            assert_eq!(starts.last().unwrap() + TILE.min(side), side, "the last tile of {side}");
            assert!(starts.windows(2).all(|w| w[1] - w[0] <= TILE - OVERLAP), "{side}: {starts:?}");
        }
    }

    #[test]
    fn tiles_leave_no_seams() {
        // A uniform pattern far from the map's edges must get one answer, tile border or not.
        let row = "#.....".repeat(110);
        let drawing = [row.as_str(); 12].join("\n");
        let grid = OccupancyGrid::from_ascii(PIXEL_M, &drawing).unwrap();
        let heatmap = untrained().heatmap(&grid, &DistanceField::new(&grid));
        let at = |col: usize| heatmap.at(Cell::new(col, 6));
        for col in 30..600 {
            assert!((at(col) - at(col + 12)).abs() < 1e-4, "column {col}: {} and {}", at(col), at(col + 12));
        }
    }
}
