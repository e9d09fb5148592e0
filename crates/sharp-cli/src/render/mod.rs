//! Pictures of maps, abstractions, plans and drives: pure functions from data to SVG and PNG.
//!
//! A [`Scene`] collects what to draw and writes it in the frame of the grid, row 0 at the bottom;
//! the heading of the grid's origin is ignored. A [`Chart`] does the same for figures of numbers.
//! Equal data give equal bytes.

mod chart;
mod colors;
mod digits;
mod letters;
mod outline;
mod png;
mod scene;
mod svg;

pub(crate) use chart::{Anchor, Chart, Lettering, Shape};
pub(crate) use png::svg_to_png;
pub(crate) use scene::{Drive, Scene};
pub(crate) use svg::escape;
