//! Pictures of maps, plans and drives, and charts of results, as SVG and PNG.
//!
//! Three nouns. A [`Scene`] is a map with everything that was found on it: critical regions,
//! abstract states, options, guide paths, driven trajectories. A [`Chart`] is a figure of numbers,
//! put together from marks, [`Axis`] and [`Panel`]. [`svg_to_png`] turns either into pixels, with
//! the same font as a browser that has it.
//!
//! Everything is a pure function of plain data: points, poses, numbers, labels. Equal data give
//! equal bytes. The crate knows no planner and reads no file.
//!
//! ```
//! use sharp_draw::{Scene, svg_to_png};
//! use sharp_space::{OccupancyGrid, Point, Pose};
//!
//! let map = OccupancyGrid::from_ascii(0.5, "########\n#......#\n#......#\n########").unwrap();
//! let guide = [vec![Point::new(0.75, 0.75), Point::new(3.25, 1.25)]];
//! let scene = Scene::new(&map)
//!     .guides(&guide)
//!     .problem(Pose::new(0.75, 0.75, 0.0), Pose::new(3.25, 1.25, 0.0));
//! let svg = scene.to_svg();
//! assert!(svg.contains(">guide path</text>"), "the legend names what is drawn");
//! assert!(svg_to_png(&svg, 400).unwrap().starts_with(b"\x89PNG"));
//! ```

mod axis;
mod chart;
mod color;
mod font;
mod outline;
mod overlay;
mod panel;
mod png;
mod scene;
mod svg;
mod text;

pub mod numbers;

pub use axis::Axis;
pub use chart::{Chart, Marker};
pub use color::Color;
pub use overlay::{cells_per_pixel, known_cells, regions_outline, states_png, walls_png};
pub use panel::{LegendItem, Panel, legend, sheet};
pub use png::{PngError, svg_to_png};
pub use scene::{Scene, Trajectory};
pub use svg::escape;
pub use text::TextStyle;
