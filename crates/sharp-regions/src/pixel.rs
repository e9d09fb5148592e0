//! Pixels: squares of one physical size, whatever the resolution of the map.
//!
//! Labels are counted in pixels and the network sees pixels, so that both mean the same on every map.

use sharp_space::GridFrame;

/// Side of a pixel, metres: four to fifteen pixels across the doors and corridors that matter.
pub(crate) const PIXEL_M: f64 = 0.125;

/// The pixels that cover a grid: same origin, the last row and column may stick out.
pub(crate) fn pixel_frame(grid: &GridFrame) -> GridFrame {
    // A hair less, so that 15 m of cells that do not add up exactly are still 120 pixels.
    let pixels = |length_m: f64| ((length_m / PIXEL_M - 1e-6).ceil() as usize).max(1);
    GridFrame {
        origin: grid.origin,
        resolution_m: PIXEL_M,
        width: pixels(grid.width_m()),
        height: pixels(grid.height_m()),
    }
}
