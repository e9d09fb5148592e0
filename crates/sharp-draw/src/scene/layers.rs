//! The layers of the map's window, bottom to top, in cells.

use sharp_space::{Cell, GridFrame, Heading, Occupancy, Point, Pose, Vector, trig};

use super::heat::HeatBlocks;
use super::{
    FAILURE, FOOTPRINT_SPACING_M, FREE, GOAL, GUIDE, INK, REACHED, REGION, START, Scene, Trajectory, UNKNOWN,
    WALL,
};
use crate::color::{Color, STATES, color_states};
use crate::outline::outline;
use crate::svg::{PathData, Svg, number};

/// From so many options on, arrows are drawn lighter.
const CROWD: usize = 150;

impl Scene<'_> {
    pub(super) fn draw_layers(&self, svg: &mut Svg) {
        let [left, top, width, height] = self.view.in_cells();
        let floor = format!("M{left} {top}h{width}v{height}h-{width}z");
        svg.element("path", &[("d", floor), ("fill", FREE.into())]);
        if let Some((field, _)) = self.heat {
            HeatBlocks::average(self.grid, field).draw(svg);
        }
        self.draw_states(svg);
        self.draw_regions(svg);
        self.draw_blocked(svg);
        self.draw_options(svg);
        self.draw_endpoints(svg);
        // Failures lie on top: they are few, and what one looks for.
        self.draw_trajectories(svg, false);
        self.draw_guides(svg);
        self.draw_footprints(svg);
        self.draw_trajectories(svg, true);
        self.draw_crosses(svg);
        self.draw_problem(svg);
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
        let d = outline_of(frame, |index| is_member[index]);
        if self.heat.is_some() {
            // A white line under the coloured one parts it from the dark end of the ramp.
            for (color, width) in [(Color::WHITE, 3.4), (REGION, 1.8)] {
                svg.element("path", &self.line_style(d.clone(), color, width));
            }
            return;
        }
        let mut style = self.line_style(d, INK, 1.2);
        style.retain(|(name, _)| *name != "fill");
        style.extend([
            ("fill", Color::WHITE.into()),
            ("fill-opacity", "0.45".into()),
            ("opacity", if self.is_faded { "0.4" } else { "1" }.into()),
        ]);
        svg.element("path", &style);
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
            let (a, b) = (self.view.cells(*from), self.view.cells(*to));
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
            let size = self.view.pixel() * 7.0;
            let neck = tip - arrive * size;
            let side = Vector::new(-arrive.y, arrive.x) * (0.35 * size);
            shafts = shafts.move_to(xy(tail)).curve_to(xy(control), xy(neck));
            heads = heads.move_to(xy(tip)).line_to(xy(neck + side)).line_to(xy(neck - side)).close();
        }
        // Where options are many, states and numbers show through.
        let is_crowded = self.options.len() > CROWD;
        let opacity = if self.is_faded || is_crowded { "0.45" } else { "0.75" };
        svg.open("g", &[("opacity", opacity.into())]);
        self.line(svg, shafts, INK, 1.0);
        svg.element("path", &[("d", heads.finish()), ("fill", INK.into())]);
        svg.close();
    }

    /// Circles let through what lies below them, other circles included.
    fn draw_endpoints(&self, svg: &mut Svg) {
        if self.endpoints.is_empty() {
            return;
        }
        svg.open(
            "g",
            &[
                ("fill", Color::WHITE.into()),
                ("fill-opacity", "0.55".into()),
                ("stroke", INK.into()),
                ("stroke-width", self.px(1.2)),
                ("opacity", if self.is_faded { "0.7" } else { "1" }.into()),
            ],
        );
        for center in self.endpoints {
            self.circle(svg, *center, self.endpoint_radius());
        }
        svg.close();
    }

    /// A dashed line on a white one, which shows on top of many trajectories as well as alone.
    fn draw_guides(&self, svg: &mut Svg) {
        for guide in self.guides {
            let path = PathData::polyline(guide.iter().map(|point| xy(self.view.cells(*point))));
            self.line(svg, path.clone(), Color::WHITE, 3.6);
            let mut style = self.line_style(path.finish(), GUIDE, 2.4);
            style.push(("stroke-dasharray", format!("{} {}", self.px(9.0), self.px(5.0))));
            svg.element("path", &style);
        }
    }

    fn draw_trajectories(&self, svg: &mut Svg, failed: bool) {
        let drawn: Vec<&Trajectory> = self.trajectories.iter().filter(|it| it.failed == failed).collect();
        if drawn.is_empty() {
            return;
        }
        let color = if failed { FAILURE } else { REACHED };
        svg.open("g", &[("opacity", number((4.0 / drawn.len() as f64).clamp(0.4, 0.9)))]);
        for trajectory in drawn {
            let points = trajectory.poses.iter().map(|pose| xy(self.view.cells(pose.position)));
            self.line(svg, PathData::polyline(points), color, 1.4);
        }
        svg.close();
    }

    fn draw_crosses(&self, svg: &mut Svg) {
        let failed = self.trajectories.iter().filter(|it| it.failed);
        for end in failed.filter_map(|trajectory| trajectory.poses.last()) {
            let ([x, y], r) = (xy(self.view.cells(end.position)), self.view.pixel() * 6.0);
            let cross = PathData::polyline([[x - r, y - r], [x + r, y + r]]);
            let cross = cross.move_to([x - r, y + r]).line_to([x + r, y - r]);
            self.line(svg, cross.clone(), Color::WHITE, 5.0);
            self.line(svg, cross, FAILURE, 3.0);
        }
    }

    fn draw_footprints(&self, svg: &mut Svg) {
        let (Some(trajectory), Some(footprint)) = (self.trajectories.first(), self.footprint) else { return };
        let mut path = String::new();
        for pose in spaced(&trajectory.poses, FOOTPRINT_SPACING_M) {
            let corners = footprint.outline(pose).into_iter().map(|corner| xy(self.view.cells(corner)));
            path += &PathData::polyline(corners).close().finish();
            let ahead = pose.to_world(Vector::new(footprint.half_length_m(), 0.0));
            let nose = [pose.position, ahead].map(|point| xy(self.view.cells(point)));
            path += &PathData::polyline(nose).finish();
        }
        let mut style = self.line_style(path, INK, 0.9);
        style.push(("stroke-opacity", "0.7".into()));
        svg.element("path", &style);
    }

    /// A disc with a pointer where the robot starts, a star where it should end.
    fn draw_problem(&self, svg: &mut Svg) {
        let Some((start, goal)) = self.problem else { return };
        let unit = self.view.pixel();
        let tip = self.ahead(&start, 19.0 * unit);
        for (color, width) in [(INK, 6.0), (Color::WHITE, 3.0)] {
            let pointer = PathData::polyline([xy(self.view.cells(start.position)), tip]);
            self.line(svg, pointer, color, width);
        }
        svg.open(
            "g",
            &[("stroke", INK.into()), ("stroke-width", self.px(1.5)), ("stroke-linejoin", "round".into())],
        );
        svg.open("g", &[("fill", START.into())]);
        self.circle(svg, start.position, 8.0 * unit);
        svg.close();
        let star = star(xy(self.view.cells(goal.position)), 13.0 * unit);
        svg.element("path", &[("d", star.finish()), ("fill", GOAL.into())]);
        svg.close();
    }

    fn line(&self, svg: &mut Svg, path: PathData, color: Color, width_px: f64) {
        svg.element("path", &self.line_style(path.finish(), color, width_px));
    }

    fn line_style(&self, d: String, color: Color, width_px: f64) -> Vec<(&'static str, String)> {
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
        let [x, y] = xy(self.view.cells(center));
        svg.element("circle", &[("cx", number(x)), ("cy", number(y)), ("r", number(radius))]);
    }

    /// A length of the picture in cells. Four decimals: on a small map a pixel is hundredths of a cell.
    fn px(&self, length_px: f64) -> String {
        format!("{:.4}", length_px * self.view.pixel())
    }

    /// Radius of an endpoint's circle in cells, at least four pixels.
    pub(super) fn endpoint_radius(&self) -> f64 {
        (self.endpoint_radius_m / self.grid.frame().resolution_m).max(4.0 * self.view.pixel())
    }

    /// The end of a pointer `length` cells long from `pose` along its heading.
    fn ahead(&self, pose: &Pose, length: f64) -> [f64; 2] {
        let heading = Heading::new(pose.heading.radians()).unit() * (length * self.grid.frame().resolution_m);
        xy(self.view.cells(pose.position + heading))
    }
}

/// A star with five points that fits into a circle.
pub(super) fn star([x, y]: [f64; 2], radius: f64) -> PathData {
    let corners = (0..10).map(|i| {
        let radius = radius * if i % 2 == 0 { 1.0 } else { 0.42 };
        let angle = std::f64::consts::PI * f64::from(i) / 5.0;
        [x + radius * trig::sin(angle), y - radius * trig::cos(angle)]
    });
    PathData::polyline(corners).close()
}

/// The outline of the cells whose row-major index satisfies `inside`.
fn outline_of(frame: &GridFrame, inside: impl Fn(usize) -> bool) -> String {
    outline(frame.width, frame.height, |col, line| {
        inside(frame.index(Cell::new(col, frame.height - 1 - line)))
    })
}

/// The first pose, the last, and between them every one at least `spacing_m` after the one before.
pub(super) fn spaced(poses: &[Pose], spacing_m: f64) -> Vec<&Pose> {
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
