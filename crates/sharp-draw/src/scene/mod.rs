//! What a picture of a map shows, layer by layer.
//!
//! The map stands in a window of its own whose unit is the cell, y downwards. Row 0 of the grid is
//! at the bottom; the heading of the grid's origin is ignored. Numbers and the legend lie over and
//! below it in pixels, and widths of lines are given in pixels too, so that a small room and an
//! office floor look alike.

mod caption;
mod heat;
mod labels;
mod layers;
mod viewport;

use sharp_space::{Cell, Footprint, OccupancyGrid, Point, Pose, Region};

pub(crate) use self::viewport::Viewport;
use crate::color::Color;
use crate::svg::Svg;

const FREE: Color = Color::hex(0xfcfcfb);
const UNKNOWN: Color = Color::hex(0xc3c6cb);
const WALL: Color = Color::hex(0x2b2f36);
const INK: Color = Color::hex(0x30343b);
const GUIDE: Color = Color::hex(0x2f74d0);
const REACHED: Color = Color::hex(0x0b7a4b);
const FAILURE: Color = Color::hex(0xd0202a);
const START: Color = Color::hex(0x12a150);
const GOAL: Color = Color::hex(0xffc21a);
/// Outlines of regions on a field.
const REGION: Color = Color::hex(0xd9480f);

/// Distance between two drawn footprints along a trajectory, metres.
const FOOTPRINT_SPACING_M: f64 = 1.0;

/// One driven trajectory.
#[derive(Clone, Debug)]
pub struct Trajectory {
    /// Poses in the world frame, in order.
    pub poses: Vec<Pose>,
    /// True if it did not reach its goal: it is drawn in red with a cross at its end.
    pub failed: bool,
}

/// A picture of a map and of what was found on it. Layers that are not given are not drawn.
#[derive(Debug)]
pub struct Scene<'a> {
    grid: &'a OccupancyGrid,
    view: Viewport,
    heat: Option<(&'a [f32], &'a str)>,
    states: Option<Vec<Option<u32>>>,
    is_faded: bool,
    regions: &'a [Region],
    options: &'a [(Point, Point)],
    endpoints: &'a [Point],
    endpoint_radius_m: f64,
    labels: &'a [(u32, Point)],
    guides: &'a [Vec<Point>],
    trajectories: &'a [Trajectory],
    footprint: Option<Footprint>,
    problem: Option<(Pose, Pose)>,
    has_legend: bool,
}

impl<'a> Scene<'a> {
    /// The map alone with a scale, cut to what is known of it.
    #[must_use]
    pub fn new(grid: &'a OccupancyGrid) -> Self {
        Self {
            grid,
            view: Viewport::of_known(grid),
            heat: None,
            states: None,
            is_faded: false,
            regions: &[],
            options: &[],
            endpoints: &[],
            endpoint_radius_m: 0.0,
            labels: &[],
            guides: &[],
            trajectories: &[],
            footprint: None,
            problem: None,
            has_legend: true,
        }
    }

    /// Adds a field over the free cells, row-major from the lower-left cell, light where low; the
    /// legend calls it `name`.
    ///
    /// The colours end at the field's largest value. Values that are not finite count as the lowest.
    ///
    /// # Panics
    /// If the field has another number of cells than the map.
    #[must_use]
    pub fn heat_map(mut self, field: &'a [f32], name: &'a str) -> Self {
        assert_eq!(field.len(), self.grid.frame().len(), "a heat map has one value for each cell");
        self.heat = Some((field, name));
        self
    }

    /// Colours every cell by its abstract state, neighbours apart.
    #[must_use]
    pub fn states(mut self, state_of: &dyn Fn(Cell) -> Option<u32>) -> Self {
        let frame = self.grid.frame();
        self.states = Some((0..frame.len()).map(|index| state_of(frame.cell(index))).collect());
        self
    }

    /// Lets states, regions and options step back behind guides and trajectories.
    #[must_use]
    pub const fn faded(mut self) -> Self {
        self.is_faded = true;
        self
    }

    /// Outlines critical regions.
    #[must_use]
    pub const fn regions(mut self, regions: &'a [Region]) -> Self {
        self.regions = regions;
        self
    }

    /// Draws each option as a thin arrow from where it begins to where it ends, world frame.
    #[must_use]
    pub const fn options(mut self, options: &'a [(Point, Point)]) -> Self {
        self.options = options;
        self
    }

    /// Draws the endpoints of options, world frame: white circles of `radius_m`, but never too
    /// small to see.
    #[must_use]
    pub const fn endpoints(mut self, centers: &'a [Point], radius_m: f64) -> Self {
        self.endpoints = centers;
        self.endpoint_radius_m = radius_m;
        self
    }

    /// Writes the number of each state near a place of it, clear of circles and other numbers.
    #[must_use]
    pub const fn labels(mut self, labels: &'a [(u32, Point)]) -> Self {
        self.labels = labels;
        self
    }

    /// Draws guide paths, world frame.
    #[must_use]
    pub const fn guides(mut self, guides: &'a [Vec<Point>]) -> Self {
        self.guides = guides;
        self
    }

    /// Draws driven trajectories, and `footprint` every metre along the first of them.
    #[must_use]
    pub const fn trajectories(mut self, trajectories: &'a [Trajectory], footprint: Footprint) -> Self {
        self.trajectories = trajectories;
        self.footprint = Some(footprint);
        self
    }

    /// Marks where a problem starts, with its heading, and where it ends.
    #[must_use]
    pub const fn problem(mut self, start: Pose, goal: Pose) -> Self {
        self.problem = Some((start, goal));
        self
    }

    /// Leaves out the scale and the legend: nothing but the map.
    #[must_use]
    pub const fn bare(mut self) -> Self {
        self.has_legend = false;
        self
    }

    /// The picture as an SVG document, 1000 pixels along the longer side of the map. Equal scenes
    /// give equal bytes.
    #[must_use]
    pub fn to_svg(&self) -> String {
        let [map_width, map_height] = self.view.size_px();
        let caption = self.has_legend.then(|| self.caption());
        let caption_size = caption.as_ref().map_or([0.0, 0.0], |caption| caption.size_px);
        let mut svg = Svg::new([map_width.max(caption_size[0]), map_height + caption_size[1]]);
        svg.background(Color::WHITE);
        svg.open_window(self.view.in_cells(), [map_width, map_height]);
        self.draw_layers(&mut svg);
        svg.close();
        self.draw_labels(&mut svg);
        if let Some(caption) = caption {
            caption.draw(&mut svg, map_height);
        }
        svg.finish()
    }
}

#[cfg(test)]
mod tests;
