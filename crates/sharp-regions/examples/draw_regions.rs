//! Draws one floor plan of each kind with the regions found in it: `draw_regions OUT.png [SEED]`.
//!
//! Grey is free, black blocked, red a region, white its representative.

#![allow(clippy::disallowed_methods, reason = "an example is a command: it reads its arguments")]

use image::{Rgb, RgbImage};
use sharp_regions::{GeometricSettings, detect_geometric};
use sharp_space::floorplan::{FloorplanKind, generate};
use sharp_space::{DistanceField, Footprint, OccupancyGrid, Region, Seed};

fn main() {
    let mut arguments = std::env::args().skip(1);
    let path = arguments.next().expect("usage: draw_regions OUT.png [SEED]");
    let seed = Seed(arguments.next().map_or(1, |text| text.parse().expect("SEED is a number")));
    let footprint = Footprint::rectangle(0.5, 0.335).expect("a sound footprint");
    let side = 225;
    let mut sheet = RgbImage::new(6 * side, 4 * side);
    for (i, kind) in FloorplanKind::ALL.into_iter().enumerate() {
        let grid = generate(kind, 15.0, 15.0 / 220.0, &mut seed.stream("draw", i as u64));
        let regions = detect_geometric(&DistanceField::new(&grid), &footprint, &GeometricSettings::default());
        println!("{kind:?}: {} regions", regions.len());
        let (x, y) = (i as u32 % 6 * side, i as u32 / 6 * side);
        draw(&mut sheet, (x, y), &grid, &regions);
    }
    sheet.save(&path).expect("the picture is written");
}

fn draw(sheet: &mut RgbImage, (x, y): (u32, u32), grid: &OccupancyGrid, regions: &[Region]) {
    let frame = grid.frame();
    let mut put = |cell: sharp_space::Cell, color| {
        sheet.put_pixel(x + cell.col as u32, y + (frame.height - 1 - cell.row) as u32, Rgb(color));
    };
    for index in 0..frame.len() {
        let cell = frame.cell(index);
        put(cell, if grid.is_free(cell) { [210; 3] } else { [0; 3] });
    }
    for region in regions {
        region.cells.iter().for_each(|&cell| put(cell, [220, 60, 40]));
        frame.neighbors8(region.representative).for_each(|cell| put(cell, [255; 3]));
    }
}
