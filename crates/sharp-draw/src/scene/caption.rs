//! The strip below the map: a scale in metres and a legend of the layers that are drawn.

use sharp_space::Occupancy;

use super::heat::HeatBlocks;
use super::layers::star;
use super::{FAILURE, FOOTPRINT_SPACING_M, FREE, GOAL, GUIDE, INK, REACHED, REGION, START, Scene, UNKNOWN};
use crate::axis::round_step;
use crate::color::{Color, STATES, ramp};
use crate::numbers::plain;
use crate::svg::{PathData, Svg, number};
use crate::text::TextStyle;

const STYLE: TextStyle = TextStyle::new(14.0);
/// Height of a row, pixels.
const ROW: f64 = 26.0;
/// Free space around the strip, pixels.
const PAD: f64 = 10.0;
/// Room for a sample, and between it and its name, pixels.
const SAMPLE: [f64; 2] = [30.0, 8.0];
/// Between two items, pixels.
const BETWEEN: f64 = 24.0;
/// The strip of a narrow map is at least this wide, pixels.
const LEAST_WIDTH: f64 = 480.0;
/// The map's width is so many of the rounded scales, at least.
const SCALE_SHARE: f64 = 0.5;
/// Steps of the sample of a ramp.
const RAMP_STEPS: usize = 30;

/// What is drawn before a name.
#[derive(Clone, Debug, PartialEq)]
enum LegendSample {
    /// A bar as long as so many pixels.
    Scale(f64),
    /// The colours of a field from 0 to its largest value.
    Ramp,
    States,
    Area(Color),
    Outline {
        rim: Color,
        is_filled: bool,
    },
    Arrow,
    Circle {
        fill: Color,
        radius: f64,
    },
    Line {
        color: Color,
        is_dashed: bool,
    },
    Cross,
    Star,
    Footprint,
}

/// An item of the legend.
#[derive(Clone, Debug, PartialEq)]
struct CaptionItem {
    sample: LegendSample,
    name: String,
}

impl CaptionItem {
    fn sample_width(&self) -> f64 {
        match self.sample {
            LegendSample::Scale(length) => length,
            LegendSample::Ramp => 90.0,
            _ => SAMPLE[0],
        }
    }

    fn width(&self) -> f64 {
        self.sample_width() + SAMPLE[1] + STYLE.width(&self.name)
    }
}

/// The strip, laid out.
#[derive(Debug)]
pub(super) struct Caption {
    /// Width and height, pixels.
    pub(super) size_px: [f64; 2],
    /// Items with their left ends and the middles of their rows, from the strip's top left corner.
    items: Vec<(CaptionItem, [f64; 2])>,
}

impl Scene<'_> {
    /// The strip for the layers that this picture has.
    pub(super) fn caption(&self) -> Caption {
        let width = self.view.size_px()[0].max(LEAST_WIDTH);
        let (mut left, mut middle) = (PAD, PAD + ROW / 2.0);
        let mut items = Vec::new();
        for item in self.caption_items() {
            if left > PAD && left + item.width() + PAD > width {
                (left, middle) = (PAD, middle + ROW);
            }
            let next = left + item.width() + BETWEEN;
            items.push((item, [left, middle]));
            left = next;
        }
        Caption { size_px: [width, middle + ROW / 2.0 + PAD], items }
    }

    fn caption_items(&self) -> Vec<CaptionItem> {
        let mut items = vec![self.scale()];
        let mut add = |is_there: bool, sample: LegendSample, name: &str| {
            if is_there {
                items.push(CaptionItem { sample, name: name.to_owned() });
            }
        };
        if let Some((field, name)) = self.heat {
            let top = HeatBlocks::average(self.grid, field).top();
            add(true, LegendSample::Ramp, &format!("{name}, 0 to {top:.2}"));
        }
        add(self.problem.is_some(), LegendSample::Circle { fill: START, radius: 7.0 }, "start");
        add(self.problem.is_some(), LegendSample::Star, "goal");
        add(!self.guides.is_empty(), LegendSample::Line { color: GUIDE, is_dashed: true }, "guide path");
        let count = |failed| self.trajectories.iter().filter(|it| it.failed == failed).count();
        let (reached, failed) = (count(false), count(true));
        let line = |color| LegendSample::Line { color, is_dashed: false };
        add(reached > 0, line(REACHED), &format!("reached the goal ({reached})"));
        add(failed > 0, LegendSample::Cross, &format!("failed ({failed})"));
        let has_footprints = self.footprint.is_some() && !self.trajectories.is_empty();
        add(
            has_footprints,
            LegendSample::Footprint,
            &format!("robot, every {} m", plain(FOOTPRINT_SPACING_M)),
        );
        let states = if self.labels.is_empty() { "abstract states" } else { "abstract states, numbered" };
        add(self.states.is_some(), LegendSample::States, states);
        let is_free = |index: usize| self.grid.cells()[index] == Occupancy::Free;
        let is_left_out = |(index, state): (usize, &Option<u32>)| state.is_none() && is_free(index);
        let has_left_out = self.states.as_ref().is_some_and(|all| all.iter().enumerate().any(is_left_out));
        add(has_left_out, LegendSample::Area(FREE), "free, in no state");
        let (rim, is_filled) = if self.heat.is_some() { (REGION, false) } else { (INK, true) };
        add(!self.regions.is_empty(), LegendSample::Outline { rim, is_filled }, "critical regions");
        let circle = LegendSample::Circle { fill: Color::WHITE, radius: 8.0 };
        add(!self.endpoints.is_empty(), circle, "endpoints of options");
        add(!self.options.is_empty(), LegendSample::Arrow, "options");
        let has_unknown = self.grid.cells().contains(&Occupancy::Unknown);
        add(has_unknown, LegendSample::Area(UNKNOWN), "unknown");
        items
    }

    /// A bar of a round length.
    fn scale(&self) -> CaptionItem {
        let px_per_m = self.view.px_per_m();
        let length_m = round_step(SCALE_SHARE * self.view.size_px()[0] / px_per_m);
        CaptionItem {
            sample: LegendSample::Scale(length_m * px_per_m),
            name: format!("{} m", plain(length_m)),
        }
    }
}

impl Caption {
    /// Draws the strip below `top`.
    pub(super) fn draw(&self, svg: &mut Svg, top: f64) {
        for (item, [left, middle]) in &self.items {
            let y = top + middle;
            item.sample.draw(svg, *left, y);
            STYLE.write(svg, [left + item.sample_width() + SAMPLE[1], y + 5.0], &item.name, 0.0);
        }
    }
}

impl LegendSample {
    /// Draws the sample from `left` on, centred at the height `y`.
    fn draw(&self, svg: &mut Svg, left: f64, y: f64) {
        let (right, center) = (left + SAMPLE[0], left + SAMPLE[0] / 2.0);
        match *self {
            Self::Scale(length) => {
                let end = left + length;
                let bar = PathData::polyline([[left, y - 5.0], [left, y + 5.0]]).move_to([left, y]);
                let bar = bar.line_to([end, y]).move_to([end, y - 5.0]).line_to([end, y + 5.0]);
                stroke(svg, bar, INK, 1.8, None);
            }
            Self::Ramp => {
                let step = 90.0 / RAMP_STEPS as f64;
                for i in 0..RAMP_STEPS {
                    let color = ramp(i as f64 / (RAMP_STEPS - 1) as f64);
                    // Overlapping by half a pixel leaves no seams.
                    area(svg, [left + step * i as f64, y - 7.0], [step + 0.5, 14.0], color);
                }
                frame(svg, [left, y - 7.0], [90.0, 14.0]);
            }
            Self::States => {
                for (i, color) in STATES.iter().take(3).enumerate() {
                    area(svg, [left + 10.0 * i as f64, y - 7.0], [10.0, 14.0], *color);
                }
            }
            Self::Area(color) => {
                area(svg, [left, y - 7.0], [SAMPLE[0], 14.0], color);
                frame(svg, [left, y - 7.0], [SAMPLE[0], 14.0]);
            }
            Self::Outline { rim, is_filled } => {
                if is_filled {
                    area(svg, [left, y - 7.0], [SAMPLE[0], 14.0], STATES[0]);
                }
                let corners = [[left + 5.0, y - 4.0], [right - 5.0, y - 4.0], [right - 5.0, y + 4.0]];
                let path = PathData::polyline(corners).line_to([left + 5.0, y + 4.0]).close();
                let fill = if is_filled { ("#ffffff", "0.45") } else { ("none", "1") };
                svg.element(
                    "path",
                    &[
                        ("d", path.finish()),
                        ("fill", fill.0.into()),
                        ("fill-opacity", fill.1.into()),
                        ("stroke", rim.into()),
                        ("stroke-width", "1.6".into()),
                    ],
                );
            }
            Self::Arrow => {
                stroke(svg, PathData::polyline([[left, y], [right - 7.0, y]]), INK, 1.2, None);
                let head = [[right, y], [right - 8.0, y - 3.5], [right - 8.0, y + 3.5]];
                let d = PathData::polyline(head).close().finish();
                svg.element("path", &[("d", d), ("fill", INK.into())]);
            }
            Self::Circle { fill, radius } => svg.element(
                "circle",
                &[
                    ("cx", number(center)),
                    ("cy", number(y)),
                    ("r", number(radius)),
                    ("fill", fill.into()),
                    ("stroke", INK.into()),
                    ("stroke-width", "1.2".into()),
                ],
            ),
            Self::Line { color, is_dashed } => {
                let (width, dashes) = if is_dashed { (2.4, Some("9 5")) } else { (2.0, None) };
                stroke(svg, PathData::polyline([[left, y], [right, y]]), color, width, dashes);
            }
            Self::Cross => {
                stroke(svg, PathData::polyline([[left, y], [right - 6.0, y]]), FAILURE, 2.0, None);
                let (x, r) = (right - 6.0, 5.0);
                let cross = PathData::polyline([[x - r, y - r], [x + r, y + r]]);
                stroke(svg, cross.move_to([x - r, y + r]).line_to([x + r, y - r]), FAILURE, 3.0, None);
            }
            Self::Star => {
                let d = star([center, y], 10.0).finish();
                let style =
                    [("d", d), ("fill", GOAL.into()), ("stroke", INK.into()), ("stroke-width", "1.2".into())];
                svg.element("path", &style);
            }
            Self::Footprint => {
                frame(svg, [left + 3.0, y - 6.0], [24.0, 12.0]);
                stroke(svg, PathData::polyline([[center, y], [left + 27.0, y]]), INK, 1.0, None);
            }
        }
    }
}

fn area(svg: &mut Svg, [x, y]: [f64; 2], [width, height]: [f64; 2], color: Color) {
    let corners = [[x, y], [x + width, y], [x + width, y + height], [x, y + height]];
    let d = PathData::polyline(corners).close().finish();
    svg.element("path", &[("d", d), ("fill", color.into())]);
}

fn frame(svg: &mut Svg, [x, y]: [f64; 2], [width, height]: [f64; 2]) {
    let corners = [[x, y], [x + width, y], [x + width, y + height], [x, y + height]];
    stroke(svg, PathData::polyline(corners).close(), INK, 1.0, None);
}

fn stroke(svg: &mut Svg, path: PathData, color: Color, width: f64, dashes: Option<&str>) {
    let mut style = vec![
        ("d", path.finish()),
        ("fill", "none".into()),
        ("stroke", color.into()),
        ("stroke-width", number(width)),
    ];
    style.extend(dashes.map(|dashes| ("stroke-dasharray", dashes.to_owned())));
    svg.element("path", &style);
}
