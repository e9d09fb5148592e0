//! Draws one floor plan of each kind with its regions: `draw_regions OUT.png [MODEL.safetensors]`.
//!
//! With a network, blue is its heat; without, the geometric detector works alone. Black is blocked,
//! red a region, white its representative; the kinds that training does not see come last.

#![allow(clippy::disallowed_methods, reason = "an example is a command: it reads its arguments")]

use image::{Rgb, RgbImage};
use sharp_maps::{FloorplanKind, generate};
use sharp_regions::{
    ComputeDevice, HELD_OUT_KINDS, Prediction, RegionPredictor, RegionSettings, geometric_regions,
    predict_regions,
};
use sharp_space::{Cell, Footprint, OccupancyGrid, Seed};

const SIDE: u32 = 230;

fn main() {
    let mut arguments = std::env::args().skip(1);
    let path = arguments.next().expect("usage: draw_regions OUT.png [MODEL.safetensors]");
    let predictor = arguments.next().map(|path| {
        let bytes = std::fs::read(path).expect("the network can be read");
        RegionPredictor::from_bytes(&bytes, ComputeDevice::Flex).expect("the network is sound")
    });
    let card = predictor.as_ref().map(|p| p.card());
    let (half_length_m, half_width_m) = card.map_or((0.5, 0.335), |c| (c.half_length_m, c.half_width_m));
    let footprint = Footprint::rectangle(half_length_m, half_width_m).expect("a sound footprint");
    let settings = RegionSettings::default();
    let mut kinds = FloorplanKind::ALL.to_vec();
    kinds.sort_by_key(|kind| HELD_OUT_KINDS.contains(kind));
    let mut sheet = RgbImage::new(6 * SIDE, 4 * SIDE);
    for (i, kind) in kinds.into_iter().enumerate() {
        let grid = generate(kind, 15.0, 15.0 / 220.0, &mut Seed(77).stream("draw", i as u64));
        let found = match &predictor {
            Some(predictor) => predict_regions(&grid, &footprint, predictor, &settings),
            None => geometric_regions(&grid, &footprint, &settings.geometric),
        };
        println!("{kind:?}: {} regions from {:?}", found.regions.len(), found.source);
        draw(&mut sheet, (i as u32 % 6 * SIDE, i as u32 / 6 * SIDE), &grid, &found);
    }
    sheet.save(&path).expect("the picture is written");
}

fn draw(sheet: &mut RgbImage, (x, y): (u32, u32), grid: &OccupancyGrid, found: &Prediction) {
    let frame = grid.frame();
    let mut put = |cell: Cell, color| {
        sheet.put_pixel(x + cell.col as u32, y + (frame.height - 1 - cell.row) as u32, Rgb(color));
    };
    for index in 0..frame.len() {
        let cell = frame.cell(index);
        let cool = 255 - (found.heatmap.at(cell) * 230.0) as u8;
        put(cell, if grid.is_free(cell) { [cool, cool, 255] } else { [0; 3] });
    }
    for region in &found.regions {
        let edge =
            |cell: &Cell| frame.neighbors4(*cell).any(|next| region.cells.binary_search(&next).is_err());
        region.cells.iter().filter(|cell| edge(cell)).for_each(|&cell| put(cell, [220, 60, 40]));
        frame.neighbors8(region.representative).for_each(|cell| put(cell, [255, 200, 0]));
    }
}
