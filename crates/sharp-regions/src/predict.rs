//! From a map to its critical regions: network, tiles, and the geometric detector as fallback.
//!
//! The network was trained at one physical scale, so maps are resampled to it. Large maps are read
//! in overlapping tiles whose answers fade into one another: no seams, and memory for one tile.

use std::collections::BTreeMap;

use burn::tensor::activation::sigmoid;
use burn::tensor::{Tensor, TensorData, s};
use serde::{Deserialize, Serialize};
use sharp_space::{Cell, DistanceField, Footprint, GridFrame, OccupancyGrid, Region, Vector};

use crate::device::ComputeDevice;
use crate::doorways::find_regions;
use crate::extract::ExtractSettings;
use crate::geometric::{GeometricSettings, detect_geometric};
use crate::heatmap::{Heatmap, NO_HEADING};
use crate::image::{Image, PIXEL_M, sample_plane};
use crate::store::{ModelCard, ModelError, from_bytes, to_bytes};
use crate::unet::{INPUT_PLANES, UNet};

/// Side of a tile, pixels: 48 m.
const TILE: usize = 384;
/// Pixels that neighbouring tiles share.
const OVERLAP: usize = 96;
/// The outermost pixels of a tile, which see its edge and hardly count where tiles overlap.
const RIM: usize = 32;

/// How regions are found.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
pub struct RegionSettings {
    /// From the heat map to regions.
    pub extract: ExtractSettings,
    /// The fallback.
    pub geometric: GeometricSettings,
    /// A place is in reach of a region if the way there is at most this long, metres.
    pub reach_m: f64,
    /// The network's regions are used unless they leave this share more of the robot's free space
    /// out of reach than those of the fallback.
    pub unreached_max: f64,
    /// Maps with more pixels of 0.125 m than this are left to the fallback; 16 million take the
    /// network about half a minute.
    pub pixels_max: usize,
}

impl Default for RegionSettings {
    fn default() -> Self {
        Self {
            extract: ExtractSettings::default(),
            geometric: GeometricSettings::default(),
            reach_m: 6.0,
            unreached_max: 0.2,
            pixels_max: 16_000_000,
        }
    }
}

/// Who found the regions.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Source {
    /// The network.
    Network,
    /// The geometric detector: there was no network, or it found nothing usable.
    Geometric,
}

/// The critical regions of a map.
#[derive(Clone, Debug)]
pub struct Prediction {
    /// How critical each cell is; what the network says even where the fallback was used.
    pub heatmap: Heatmap,
    /// The regions Φ, numbered from 0.
    pub regions: Vec<Region>,
    /// Who found them.
    pub source: Source,
}

/// The critical regions of `grid` for a robot with `footprint`.
///
/// Falls back to the geometric detector if the network's regions leave much of the robot's free
/// space out of reach that the detector's would not, or if the map is too large. A map without free
/// space, or an open hall, has no regions.
#[must_use]
pub fn predict_regions(
    grid: &OccupancyGrid,
    footprint: &Footprint,
    predictor: &RegionPredictor,
    settings: &RegionSettings,
) -> Prediction {
    let pixels = grid.frame().width_m() / PIXEL_M * (grid.frame().height_m() / PIXEL_M);
    if pixels > settings.pixels_max as f64 {
        return geometric_regions(grid, footprint, &settings.geometric);
    }
    let clearance = DistanceField::new(grid);
    let heatmap = predictor.heatmap(grid, &clearance);
    let min_clearance_m = footprint.inscribed_radius_m();
    let regions = find_regions(&heatmap, &clearance, footprint, settings);
    let reached = |regions: &[Region]| reached_share(regions, &clearance, min_clearance_m, settings.reach_m);
    let enough = reached(&regions) + settings.unreached_max;
    if enough < 1.0 {
        let geometric = detect_geometric(&clearance, footprint, &settings.geometric);
        if reached(&geometric) > enough {
            return Prediction { heatmap, regions: geometric, source: Source::Geometric };
        }
    }
    Prediction { heatmap, regions, source: Source::Network }
}

/// The critical regions of `grid` by geometry alone.
#[must_use]
pub fn geometric_regions(
    grid: &OccupancyGrid,
    footprint: &Footprint,
    settings: &GeometricSettings,
) -> Prediction {
    let regions = detect_geometric(&DistanceField::new(grid), footprint, settings);
    Prediction { heatmap: Heatmap::from_regions(*grid.frame(), &regions), regions, source: Source::Geometric }
}

/// The share of the robot's free space from which a region is at most `reach_m` away, along the grid.
fn reached_share(regions: &[Region], clearance: &DistanceField, min_clearance_m: f64, reach_m: f64) -> f64 {
    let frame = clearance.frame();
    let open = |cell: Cell| clearance.at(cell) >= min_clearance_m;
    let mut seen = vec![false; frame.len()];
    let mut wave: Vec<Cell> = Vec::new();
    for &cell in regions.iter().flat_map(|region| &region.cells) {
        if !std::mem::replace(&mut seen[frame.index(cell)], true) {
            wave.push(cell);
        }
    }
    let mut reached = wave.len();
    for _ in 0..(reach_m / frame.resolution_m) as usize {
        let mut next = Vec::new();
        for cell in wave.iter().flat_map(|&cell| frame.neighbors8(cell)) {
            if !seen[frame.index(cell)] && open(cell) {
                seen[frame.index(cell)] = true;
                next.push(cell);
            }
        }
        reached += next.len();
        wave = next;
    }
    let all = (0..frame.len()).filter(|&index| open(frame.cell(index))).count();
    reached as f64 / all.max(1) as f64
}

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

    /// What it is and where it comes from.
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
    fn answer(&self, image: &Image) -> Answer {
        let mut answer = Answer::new(image.frame);
        for &row in &tile_starts(image.frame.height) {
            for &col in &tile_starts(image.frame.width) {
                self.answer_tile(image, Cell::new(col, row), &mut answer);
            }
        }
        answer.finish();
        answer
    }

    fn answer_tile(&self, image: &Image, corner: Cell, answer: &mut Answer) {
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
struct Answer {
    frame: GridFrame,
    criticality: Vec<f32>,
    headings: Vec<u8>,
    weights: Vec<f32>,
    heading_weights: Vec<f32>,
}

impl Answer {
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

    /// Criticalities are averaged; the heading is that of the tile that sees the pixel best.
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
mod tests {
    use sharp_space::Seed;

    use super::*;
    use crate::unet::{Activation, UNetConfig};

    fn untrained() -> RegionPredictor {
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

    fn robot() -> Footprint {
        Footprint::rectangle(0.3, 0.2).unwrap()
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

    #[test]
    fn degenerate_maps_get_an_answer() {
        let specks = ["#..".repeat(100), "...".repeat(100), "...".repeat(100)].join("\n");
        let maps = ["#", ".", "?", "....\n....", "####\n####", ".........", &vec![specks; 100].join("\n")];
        for drawing in maps {
            let grid = OccupancyGrid::from_ascii(0.1, drawing).unwrap();
            let found = predict_regions(&grid, &robot(), &untrained(), &RegionSettings::default());
            let free = |region: &Region| region.cells.iter().all(|&cell| grid.is_free(cell));
            assert!(
                found.regions.iter().all(free),
                "a region in a wall of {}",
                &drawing[..drawing.len().min(9)]
            );
        }
    }

    #[test]
    fn reach_is_measured_along_free_space() {
        let drawing = "#########\n#...#...#\n#...#...#\n#...#...#\n#########";
        let grid = OccupancyGrid::from_ascii(1.0, drawing).unwrap();
        let clearance = DistanceField::new(&grid);
        let region = Region::new(sharp_space::RegionId(0), vec![Cell::new(1, 1)], &clearance).unwrap();
        let reached = |reach_m| reached_share(std::slice::from_ref(&region), &clearance, 0.5, reach_m);
        assert_eq!(reached(0.0), 1.0 / 18.0, "the region itself");
        assert_eq!(reached(1.0), 4.0 / 18.0, "its neighbours too");
        assert_eq!(reached(100.0), 0.5, "never the room behind the wall");
    }

    #[test]
    fn a_map_that_is_too_large_is_left_to_geometry() {
        let drawing = "#########\n#...#...#\n#.......#\n#...#...#\n#########";
        let grid = OccupancyGrid::from_ascii(0.5, drawing).unwrap();
        let settings = RegionSettings { pixels_max: 10, ..RegionSettings::default() };
        let found = predict_regions(&grid, &robot(), &untrained(), &settings);
        assert_eq!((found.source, found.regions.len()), (Source::Geometric, 1));
    }
}
