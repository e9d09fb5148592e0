//! What a picture shows, layer by layer, and how it becomes SVG.
//!
//! User units of the SVG are cells with y downwards; line widths are thousandths of the longer
//! side, so that a small room and an office floor look alike.

use sharp_space::{
    Cell, Footprint, GridFrame, Heading, Occupancy, OccupancyGrid, Point, Pose, Region, Vector,
};

use super::colors::{STATES, color_states, ramp};
use super::digits;
use super::outline::outline;
use super::svg::{PathData, Svg, number};

/// Width or height of the SVG as shown, pixels, whichever is longer.
const SIDE_PX: f64 = 1000.0;
/// Margin of unknown land kept around the known cells, as a share of their longer side.
const MARGIN: f64 = 0.02;
/// Blocks along the longer side of a heat map: finer detail than two pixels is not worth bytes.
const HEAT_BLOCKS: usize = 500;
/// Steps of the heat map's ramp.
const HEAT_LEVELS: usize = 24;
/// Distance between two drawn footprints along a drive, metres.
const FOOTPRINT_SPACING_M: f64 = 1.0;

const FREE: &str = "#fcfcfb";
const UNKNOWN: &str = "#c3c6cb";
const WALL: &str = "#2b2f36";
const INK: &str = "#30343b";
const GUIDE: &str = "#2f74d0";
const DRIVE: &str = "#0b7a4b";
const FAILURE: &str = "#d0202a";
const START: &str = "#12a150";
const GOAL: &str = "#ffc21a";

/// One driven trajectory.
#[derive(Clone, Debug)]
pub(crate) struct Drive {
    /// Poses in the world frame, in order.
    pub(crate) poses: Vec<Pose>,
    /// Drawn in red with a cross at its end.
    pub(crate) failed: bool,
}

/// A picture of a map and of what was found on it; layers not given are not drawn.
#[derive(Debug)]
pub(crate) struct Scene<'a> {
    grid: &'a OccupancyGrid,
    view: View,
    heat: Option<&'a [f32]>,
    states: Option<Vec<Option<u32>>>,
    is_faded: bool,
    regions: &'a [Region],
    options: &'a [(Point, Point)],
    endpoints: &'a [Point],
    endpoint_radius_m: f64,
    labels: &'a [(u32, Point)],
    guides: &'a [Vec<Point>],
    drives: &'a [Drive],
    footprint: Option<Footprint>,
    problem: Option<(Pose, Pose)>,
}

impl<'a> Scene<'a> {
    /// The bare map, cut to what is known of it.
    pub(crate) fn new(grid: &'a OccupancyGrid) -> Self {
        Self {
            grid,
            view: View::of_known(grid),
            heat: None,
            states: None,
            is_faded: false,
            regions: &[],
            options: &[],
            endpoints: &[],
            endpoint_radius_m: 0.0,
            labels: &[],
            guides: &[],
            drives: &[],
            footprint: None,
            problem: None,
        }
    }

    /// Adds a field over the free cells, row-major from the lower-left cell, dark where low.
    ///
    /// The ramp ends at the field's largest value.
    ///
    /// # Panics
    /// If the field has another number of cells than the map.
    pub(crate) fn heat_map(mut self, field: &'a [f32]) -> Self {
        assert_eq!(field.len(), self.grid.frame().len(), "a heat map has one value for each cell");
        self.heat = Some(field);
        self
    }

    /// Colours every cell by its abstract state, neighbours apart.
    pub(crate) fn states(mut self, state_of: &dyn Fn(Cell) -> Option<u32>) -> Self {
        let frame = self.grid.frame();
        self.states = Some((0..frame.len()).map(|index| state_of(frame.cell(index))).collect());
        self
    }

    /// Lets states and options step back behind guides and drives.
    pub(crate) const fn faded(mut self) -> Self {
        self.is_faded = true;
        self
    }

    /// Outlines critical regions.
    pub(crate) const fn regions(mut self, regions: &'a [Region]) -> Self {
        self.regions = regions;
        self
    }

    /// Draws each option as a thin arrow from where it begins to where it ends.
    pub(crate) const fn options(mut self, options: &'a [(Point, Point)]) -> Self {
        self.options = options;
        self
    }

    /// Draws white circles: centroid or interface regions, to scale but never too small to see.
    pub(crate) const fn endpoints(mut self, centers: &'a [Point], radius_m: f64) -> Self {
        self.endpoints = centers;
        self.endpoint_radius_m = radius_m;
        self
    }

    /// Writes the number of a state at a place.
    pub(crate) const fn labels(mut self, labels: &'a [(u32, Point)]) -> Self {
        self.labels = labels;
        self
    }

    /// Draws guide paths.
    pub(crate) const fn guides(mut self, guides: &'a [Vec<Point>]) -> Self {
        self.guides = guides;
        self
    }

    /// Draws driven trajectories and `footprint` along the first of them.
    pub(crate) const fn drives(mut self, drives: &'a [Drive], footprint: Footprint) -> Self {
        self.drives = drives;
        self.footprint = Some(footprint);
        self
    }

    /// Marks where a problem starts and ends.
    pub(crate) const fn problem(mut self, start: Pose, goal: Pose) -> Self {
        self.problem = Some((start, goal));
        self
    }

    /// The picture as an SVG document; equal scenes give equal bytes.
    pub(crate) fn to_svg(&self) -> String {
        let View { left, top, width, height } = self.view;
        let mut svg = Svg::new([left, top, width, height].map(|n| n as f64), SIDE_PX);
        svg.element(
            "path",
            &[("d", format!("M{left} {top}h{width}v{height}h-{width}z")), ("fill", FREE.into())],
        );
        self.draw_heat(&mut svg);
        self.draw_states(&mut svg);
        self.draw_regions(&mut svg);
        self.draw_blocked(&mut svg);
        self.draw_options(&mut svg);
        self.draw_endpoints(&mut svg);
        self.draw_labels(&mut svg);
        self.draw_guides(&mut svg);
        self.draw_drives(&mut svg);
        self.draw_problem(&mut svg);
        svg.finish()
    }

    /// Levels lie on top of each other like sheets, so no seam can show between them.
    fn draw_heat(&self, svg: &mut Svg) {
        let Some(field) = self.heat else { return };
        let blocks = Blocks::average(self.grid, field);
        let top = blocks.values.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        svg.open("g", &[("transform", format!("scale({})", blocks.side))]);
        for level in 0..HEAT_LEVELS {
            let share = level as f64 / HEAT_LEVELS as f64;
            let reaches = |col: usize, line: usize| blocks.values[line * blocks.width + col] >= share * top;
            let d = outline(blocks.width, blocks.height, reaches);
            if !d.is_empty() {
                svg.element("path", &[("d", d), ("fill", ramp(level as f64 / (HEAT_LEVELS - 1) as f64))]);
            }
        }
        svg.close();
    }

    fn draw_states(&self, svg: &mut Svg) {
        let Some(states) = &self.states else { return };
        let frame = self.grid.frame();
        let color_of = color_states(frame, states);
        let colors: Vec<Option<usize>> =
            states.iter().map(|state| state.map(|state| color_of[&state])).collect();
        svg.open("g", &[("opacity", if self.is_faded { "0.4" } else { "1" }.into())]);
        for (color, fill) in STATES.iter().enumerate() {
            let d = outline_of(frame, |index| colors[index] == Some(color));
            if !d.is_empty() {
                // A rim of the same colour closes the hairline that antialiasing leaves between neighbours.
                svg.element(
                    "path",
                    &[
                        ("d", d),
                        ("fill", (*fill).into()),
                        ("stroke", (*fill).into()),
                        ("stroke-width", "0.7".into()),
                    ],
                );
            }
        }
        svg.close();
    }

    fn draw_regions(&self, svg: &mut Svg) {
        if self.regions.is_empty() {
            return;
        }
        let frame = self.grid.frame();
        let mut is_member = vec![false; frame.len()];
        for cell in self.regions.iter().flat_map(|region| &region.cells) {
            is_member[frame.index(*cell)] = true;
        }
        svg.element(
            "path",
            &[
                ("d", outline_of(frame, |index| is_member[index])),
                ("fill", "#ffffff".into()),
                ("fill-opacity", if self.heat.is_some() { "0" } else { "0.45" }.into()),
                ("stroke", if self.heat.is_some() { "#ffffff" } else { INK }.into()),
                ("stroke-width", self.px(1.2)),
                ("stroke-linejoin", "round".into()),
                ("stroke-opacity", if self.is_faded { "0.4" } else { "1" }.into()),
            ],
        );
    }

    fn draw_blocked(&self, svg: &mut Svg) {
        for (kind, fill) in [(Occupancy::Unknown, UNKNOWN), (Occupancy::Occupied, WALL)] {
            let d = outline_of(self.grid.frame(), |index| self.grid.cells()[index] == kind);
            if !d.is_empty() {
                svg.element("path", &[("d", d), ("fill", fill.into())]);
            }
        }
    }

    fn draw_options(&self, svg: &mut Svg) {
        if self.options.is_empty() {
            return;
        }
        let (mut shafts, mut heads) = (PathData::default(), PathData::default());
        for (from, to) in self.options {
            let (a, b) = (self.vector(*from), self.vector(*to));
            let chord = b - a;
            let length = chord.norm();
            // The arrow stops at the rim of the circle and bends to its right, so that the way
            // there and the way back stay apart.
            let rim = self.endpoint_radius().min(length / 3.0);
            if length < f64::EPSILON {
                continue;
            }
            let along = chord / length;
            let control = (a + b) / 2.0 + Vector::new(-along.y, along.x) * (0.12 * length);
            let arrive = (b - control).normalize();
            let (tail, tip) = (a + (control - a).normalize() * rim, b - arrive * rim);
            let size = self.unit() * 7.0;
            let neck = tip - arrive * size;
            let side = Vector::new(-arrive.y, arrive.x) * (0.35 * size);
            shafts = shafts.move_to(xy(tail)).curve_to(xy(control), xy(neck));
            heads = heads.move_to(xy(tip)).line_to(xy(neck + side)).line_to(xy(neck - side)).close();
        }
        let opacity = if self.is_faded { "0.25" } else { "0.75" };
        svg.open("g", &[("opacity", opacity.into())]);
        self.line(svg, shafts, INK, 1.0);
        svg.element("path", &[("d", heads.finish()), ("fill", INK.into())]);
        svg.close();
    }

    fn draw_endpoints(&self, svg: &mut Svg) {
        if self.endpoints.is_empty() {
            return;
        }
        svg.open(
            "g",
            &[
                ("fill", "#ffffff".into()),
                ("stroke", INK.into()),
                ("stroke-width", self.px(1.2)),
                ("opacity", if self.is_faded { "0.6" } else { "0.95" }.into()),
            ],
        );
        for center in self.endpoints {
            self.circle(svg, *center, self.endpoint_radius());
        }
        svg.close();
    }

    fn draw_labels(&self, svg: &mut Svg) {
        let mut path = String::new();
        for (number, place) in self.labels {
            path += &digits::strokes(*number, self.xy(*place), self.unit() * 11.0).finish();
        }
        if path.is_empty() {
            return;
        }
        for (color, width) in [("#ffffff", 5.0), (INK, 1.6)] {
            svg.element("path", &self.line_style(path.clone(), color, width));
        }
    }

    fn draw_guides(&self, svg: &mut Svg) {
        for guide in self.guides {
            let path = PathData::polyline(guide.iter().map(|point| self.xy(*point)));
            self.line(svg, path, GUIDE, 3.0);
        }
    }

    fn draw_drives(&self, svg: &mut Svg) {
        let (failed, reached): (Vec<&Drive>, Vec<&Drive>) =
            self.drives.iter().partition(|drive| drive.failed);
        let opacity = |count: usize| number((4.0 / count.max(1) as f64).clamp(0.4, 0.9));
        for (drives, color) in [(&reached, DRIVE), (&failed, FAILURE)] {
            svg.open("g", &[("opacity", opacity(drives.len()))]);
            for drive in drives {
                let points = drive.poses.iter().map(|pose| pose.position);
                self.line(svg, PathData::polyline(points.map(|point| self.xy(point))), color, 1.3);
            }
            svg.close();
        }
        self.draw_footprints(svg);
        for end in failed.iter().filter_map(|drive| drive.poses.last()) {
            let ([x, y], r) = (self.xy(end.position), self.unit() * 6.0);
            let cross = PathData::polyline([[x - r, y - r], [x + r, y + r]]);
            self.line(svg, cross.move_to([x - r, y + r]).line_to([x + r, y - r]), FAILURE, 3.0);
        }
    }

    fn draw_footprints(&self, svg: &mut Svg) {
        let (Some(drive), Some(footprint)) = (self.drives.first(), self.footprint) else { return };
        let mut path = String::new();
        for pose in spaced(&drive.poses, FOOTPRINT_SPACING_M) {
            let corners = footprint.corners(pose).map(|corner| self.xy(corner));
            path += &PathData::polyline(corners).close().finish();
            let ahead = pose.to_world(Vector::new(footprint.half_length_m(), 0.0));
            path += &PathData::polyline([self.xy(pose.position), self.xy(ahead)]).finish();
        }
        let mut style = self.line_style(path, INK, 0.8);
        style.push(("stroke-opacity", "0.7".into()));
        svg.element("path", &style);
    }

    /// A disc with a pointer where the robot starts, a star where it should end.
    fn draw_problem(&self, svg: &mut Svg) {
        let Some((start, goal)) = self.problem else { return };
        let unit = self.unit();
        let tip = self.ahead(&start, 17.0 * unit);
        for (color, width) in [(INK, 5.0), ("#ffffff", 2.0)] {
            self.line(svg, PathData::polyline([self.xy(start.position), tip]), color, width);
        }
        svg.open(
            "g",
            &[("stroke", INK.into()), ("stroke-width", self.px(1.5)), ("stroke-linejoin", "round".into())],
        );
        svg.open("g", &[("fill", START.into())]);
        self.circle(svg, start.position, 8.0 * unit);
        svg.close();
        let [x, y] = self.xy(goal.position);
        let star = (0..10).map(|i| {
            let radius = unit * if i % 2 == 0 { 13.0 } else { 5.5 };
            let angle = std::f64::consts::PI * f64::from(i) / 5.0;
            [x + radius * angle.sin(), y - radius * angle.cos()]
        });
        svg.element("path", &[("d", PathData::polyline(star).close().finish()), ("fill", GOAL.into())]);
        svg.close();
    }

    fn line(&self, svg: &mut Svg, path: PathData, color: &str, width_px: f64) {
        svg.element("path", &self.line_style(path.finish(), color, width_px));
    }

    fn line_style(&self, d: String, color: &str, width_px: f64) -> Vec<(&'static str, String)> {
        vec![
            ("d", d),
            ("fill", "none".into()),
            ("stroke", color.into()),
            ("stroke-width", self.px(width_px)),
            ("stroke-linecap", "round".into()),
            ("stroke-linejoin", "round".into()),
        ]
    }

    fn circle(&self, svg: &mut Svg, center: Point, radius: f64) {
        let [x, y] = self.xy(center);
        svg.element("circle", &[("cx", number(x)), ("cy", number(y)), ("r", number(radius))]);
    }

    /// The length of one pixel of the shown picture in cells.
    fn unit(&self) -> f64 {
        self.view.width.max(self.view.height) as f64 / SIDE_PX
    }

    fn px(&self, length_px: f64) -> String {
        number(length_px * self.unit())
    }

    /// Radius of an endpoint's circle in cells, at least four pixels.
    fn endpoint_radius(&self) -> f64 {
        (self.endpoint_radius_m / self.grid.frame().resolution_m).max(4.0 * self.unit())
    }

    /// `point` in cells with y downwards.
    fn xy(&self, point: Point) -> [f64; 2] {
        xy(self.vector(point))
    }

    fn vector(&self, point: Point) -> Vector {
        let frame = self.grid.frame();
        let on_grid = frame.to_grid(point);
        Vector::new(on_grid.x, frame.height as f64 - on_grid.y)
    }

    /// The end of a pointer `length` cells long from `pose` along its heading.
    fn ahead(&self, pose: &Pose, length: f64) -> [f64; 2] {
        let frame = self.grid.frame();
        let heading = Heading::new(pose.heading.radians()).unit() * (length * frame.resolution_m);
        self.xy(pose.position + heading)
    }
}

/// The part of the map that the picture shows, in cells with line 0 at the top.
#[derive(Clone, Copy, Debug, PartialEq)]
struct View {
    left: usize,
    top: usize,
    width: usize,
    height: usize,
}

impl View {
    /// The rectangle around all known cells with a margin; everything if nothing is known.
    fn of_known(grid: &OccupancyGrid) -> Self {
        let frame = grid.frame();
        let known = (0..frame.len()).filter(|&index| grid.cells()[index] != Occupancy::Unknown);
        let (mut low, mut high) = ((frame.width, frame.height), (0, 0));
        for Cell { col, row } in known.map(|index| frame.cell(index)) {
            low = (low.0.min(col), low.1.min(row));
            high = (high.0.max(col + 1), high.1.max(row + 1));
        }
        if high == (0, 0) {
            return Self { left: 0, top: 0, width: frame.width, height: frame.height };
        }
        let margin = ((high.0 - low.0).max(high.1 - low.1) as f64 * MARGIN).ceil() as usize;
        let (left, bottom) = (low.0.saturating_sub(margin), low.1.saturating_sub(margin));
        let (right, top) = ((high.0 + margin).min(frame.width), (high.1 + margin).min(frame.height));
        Self { left, top: frame.height - top, width: right - left, height: top - bottom }
    }
}

/// A field averaged over square blocks of free cells, line 0 at the top.
struct Blocks {
    side: usize,
    width: usize,
    height: usize,
    values: Vec<f64>,
}

impl Blocks {
    /// Blocks without a free cell and values that are not finite count as the lowest.
    fn average(grid: &OccupancyGrid, field: &[f32]) -> Self {
        let frame = grid.frame();
        let side = frame.width.max(frame.height).div_ceil(HEAT_BLOCKS);
        let (width, height) = (frame.width.div_ceil(side), frame.height.div_ceil(side));
        let mut sums = vec![(0.0, 0_u32); width * height];
        for (index, &value) in field.iter().enumerate() {
            if grid.cells()[index] == Occupancy::Free && value.is_finite() {
                let cell = frame.cell(index);
                let (sum, count) = &mut sums[(frame.height - 1 - cell.row) / side * width + cell.col / side];
                *sum += f64::from(value);
                *count += 1;
            }
        }
        let values = sums.iter().map(|(sum, count)| sum / f64::from((*count).max(1))).collect();
        Self { side, width, height, values }
    }
}

/// The outline of the cells whose row-major index satisfies `inside`.
fn outline_of(frame: &GridFrame, inside: impl Fn(usize) -> bool) -> String {
    outline(frame.width, frame.height, |col, line| {
        inside(frame.index(Cell::new(col, frame.height - 1 - line)))
    })
}

/// The first pose, the last, and between them every one at least `spacing_m` after the one before.
fn spaced(poses: &[Pose], spacing_m: f64) -> Vec<&Pose> {
    let mut kept: Vec<&Pose> = Vec::new();
    for (i, pose) in poses.iter().enumerate() {
        let is_end = i + 1 == poses.len();
        if is_end || kept.last().is_none_or(|last| last.distance_m(pose) >= spacing_m) {
            kept.push(pose);
        }
    }
    kept
}

const fn xy(vector: Vector) -> [f64; 2] {
    let [[x, y]] = vector.data.0;
    [x, y]
}

#[cfg(test)]
mod tests {
    use sharp_space::{DistanceField, RegionId};

    use super::*;
    use crate::render::svg_to_png;

    fn rooms() -> OccupancyGrid {
        OccupancyGrid::from_ascii(
            0.5,
            "
            ###########
            #....#....#
            #.........#
            #....#....#
            #....#.####
            ###########",
        )
        .unwrap()
    }

    /// A picture with every layer of an abstraction or of a drive.
    fn picture(is_drive: bool) -> String {
        let grid = rooms();
        let field = DistanceField::new(&grid);
        let region = Region::new(RegionId(0), vec![Cell::new(5, 3), Cell::new(6, 3)], &field).unwrap();
        let regions = [region];
        let (left, right) = (Point::new(1.5, 1.5), Point::new(4.0, 2.0));
        let pose = |point| Pose::at(point, Heading::new(0.4));
        let drives = [false, true].map(|failed| Drive { poses: vec![pose(left), pose(right)], failed });
        let (endpoints, labels, options) = ([left, right], [(0, left), (17, right)], [(left, right)]);
        let guides = [vec![left, right]];
        let scene = Scene::new(&grid).states(&|cell| Some(u32::from(cell.col > 5))).regions(&regions);
        if is_drive {
            let footprint = Footprint::rectangle(0.4, 0.3).unwrap();
            scene.faded().guides(&guides).drives(&drives, footprint).problem(pose(left), pose(right)).to_svg()
        } else {
            scene.options(&options).endpoints(&endpoints, 0.4).labels(&labels).to_svg()
        }
    }

    /// The colour of the middle of the cell in column `col` and line `line` from the top.
    fn pixel(svg: &str, grid: &OccupancyGrid, col: u32, line: u32) -> String {
        let scale = 20;
        let side = grid.frame().width.max(grid.frame().height) as u32 * scale;
        let image = image::load_from_memory(&svg_to_png(svg, side).unwrap()).unwrap().to_rgb8();
        let [r, g, b] = image.get_pixel(col * scale + scale / 2, line * scale + scale / 2).0;
        format!("#{r:02x}{g:02x}{b:02x}")
    }

    #[test]
    fn row_zero_is_at_the_bottom() {
        let grid = OccupancyGrid::from_ascii(1.0, "#..\n..?").unwrap();
        let svg = Scene::new(&grid).to_svg();
        for (col, line, color) in [(0, 0, WALL), (1, 0, FREE), (0, 1, FREE), (2, 1, UNKNOWN)] {
            assert_eq!(pixel(&svg, &grid, col, line), color, "column {col}, line {line}");
        }
    }

    #[test]
    fn world_points_follow_the_frame() {
        let frame = GridFrame {
            origin: Pose::new(10.0, -4.0, std::f64::consts::FRAC_PI_2),
            resolution_m: 0.5,
            width: 4,
            height: 2,
        };
        let grid = OccupancyGrid::new(frame, vec![Occupancy::Free; 8]).unwrap();
        let svg = Scene::new(&grid).endpoints(&[frame.center(Cell::new(3, 0))], 0.2).to_svg();
        assert!(svg.contains(r#"<circle cx="3.5" cy="1.5" r="0.4"/>"#), "lower right cell: {svg}");
    }

    #[test]
    fn states_keep_apart_and_walls_cover_them() {
        let (grid, svg) = (rooms(), picture(false));
        let (left, right) = (pixel(&svg, &grid, 1, 4), pixel(&svg, &grid, 9, 1));
        assert!(STATES.contains(&left.as_str()), "left room is {left}");
        assert!(STATES.contains(&right.as_str()), "right room is {right}");
        assert_ne!(left, right, "two states");
        assert_eq!(pixel(&svg, &grid, 8, 4), WALL, "wall in the right room");
    }

    #[test]
    fn heat_grows_brighter() {
        let grid = rooms();
        let field: Vec<f32> = (0..grid.frame().len()).map(|i| grid.frame().cell(i).col as f32).collect();
        let svg = Scene::new(&grid).heat_map(&field).to_svg();
        assert_eq!(pixel(&svg, &grid, 9, 1), ramp(1.0), "the largest value");
        assert_eq!(pixel(&svg, &grid, 0, 3), WALL, "walls stay");
        let broken = vec![f32::NAN; field.len()];
        let svg = Scene::new(&grid).heat_map(&broken).to_svg();
        assert_eq!(pixel(&svg, &grid, 9, 1), ramp(0.0), "a field of NaN is dark");
    }

    #[test]
    fn pictures_are_readable_and_equal_each_time() {
        for is_drive in [false, true] {
            let svg = picture(is_drive);
            assert_eq!(svg, picture(is_drive), "bytes differ");
            assert!(!svg.contains("NaN") && !svg.contains("inf"), "not a number: {svg}");
            let png = svg_to_png(&svg, 300).unwrap();
            let size = image::load_from_memory(&png).map(|image| (image.width(), image.height()));
            assert_eq!(size.unwrap(), (300, 164), "longer side as asked");
        }
    }

    #[test]
    fn the_picture_is_cut_to_what_is_known() {
        let unknown_margin = OccupancyGrid::from_ascii(1.0, "?????\n??.#?\n?????\n?????").unwrap();
        assert_eq!(View::of_known(&unknown_margin), View { left: 1, top: 0, width: 4, height: 3 });
        let nothing = OccupancyGrid::from_ascii(1.0, "??\n??").unwrap();
        assert_eq!(View::of_known(&nothing), View { left: 0, top: 0, width: 2, height: 2 });
    }

    #[test]
    fn footprints_stand_apart_and_at_both_ends() {
        let poses: Vec<Pose> = (0..=25).map(|i| Pose::new(f64::from(i) * 0.1, 0.0, 0.0)).collect();
        let x: Vec<f64> = spaced(&poses, 1.0).iter().map(|pose| pose.position.x).collect();
        assert_eq!(x, [0.0, 1.0, 2.0, 2.5]);
        assert!(spaced(&[], 1.0).is_empty(), "no pose");
    }
}
