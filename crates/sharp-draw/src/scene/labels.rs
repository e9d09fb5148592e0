//! Numbers of states, placed where they hide nothing and nothing hides them.

use std::f64::consts::TAU;

use sharp_space::{Cell, trig};

use super::{INK, Scene};
use crate::svg::Svg;
use crate::text::TextStyle;

const STYLE: TextStyle = TextStyle::new(15.0).bold().color(INK).middle();
/// Height of a digit, pixels.
const DIGIT_PX: f64 = 11.0;
/// Free space around a number, pixels.
const MARGIN_PX: f64 = 3.0;
/// Width of the white rim of a number, pixels.
const HALO_PX: f64 = 3.5;
/// Distances from the wanted place that are tried, pixels. Farther away a number says nothing.
const RINGS_PX: [f64; 9] = [0.0, 12.0, 20.0, 28.0, 38.0, 50.0, 64.0, 80.0, 100.0];
/// Directions that are tried at each distance.
const DIRECTIONS: usize = 16;

/// A rectangle around a number: its middle and half its sides, pixels.
#[derive(Clone, Copy, Debug, PartialEq)]
struct LabelBox {
    middle: [f64; 2],
    half: [f64; 2],
}

impl LabelBox {
    fn overlaps(&self, other: &Self) -> bool {
        (0..2).all(|axis| (self.middle[axis] - other.middle[axis]).abs() < self.half[axis] + other.half[axis])
    }

    /// Returns true if the disc around `center` reaches into the box.
    fn touches(&self, center: [f64; 2], radius: f64) -> bool {
        let gap = |axis: usize| ((self.middle[axis] - center[axis]).abs() - self.half[axis]).max(0.0);
        trig::hypot(gap(0), gap(1)) < radius
    }

    fn corners_and_middle(&self) -> [[f64; 2]; 5] {
        let ([x, y], [w, h]) = (self.middle, self.half);
        [[x, y], [x - w, y - h], [x + w, y - h], [x - w, y + h], [x + w, y + h]]
    }
}

impl Scene<'_> {
    pub(super) fn draw_labels(&self, svg: &mut Svg) {
        for (number, place) in self.place_labels() {
            let line = [place.middle[0], place.middle[1] + DIGIT_PX / 2.0];
            STYLE.write(svg, line, &number.to_string(), HALO_PX);
        }
    }

    /// Every label in a place of its own, in the order in which they were given.
    fn place_labels(&self) -> Vec<(u32, LabelBox)> {
        let mut placed: Vec<(u32, LabelBox)> = Vec::new();
        for &(number, point) in self.labels {
            let half = [STYLE.width(&number.to_string()) / 2.0 + MARGIN_PX, DIGIT_PX / 2.0 + MARGIN_PX];
            let [x, y] = self.view.pixels(point);
            let candidates: Vec<LabelBox> =
                around().map(|[dx, dy]| LabelBox { middle: [x + dx, y + dy], half }).collect();
            let is_apart = |candidate: &&LabelBox| placed.iter().all(|(_, other)| !candidate.overlaps(other));
            // Best is a place inside the state and off all circles; next one that is only off other numbers.
            let best = candidates
                .iter()
                .find(|it| is_apart(it) && self.is_inside(it, number) && !self.is_on_a_circle(it))
                .or_else(|| candidates.iter().find(|it| is_apart(it) && self.is_inside(it, number)))
                .or_else(|| candidates.iter().find(is_apart));
            placed.push((number, *best.unwrap_or(&candidates[0])));
        }
        placed
    }

    /// Returns true if the whole box lies on the colour of the state; without colours, on free land.
    fn is_inside(&self, label: &LabelBox, number: u32) -> bool {
        let is_of_state = |cell: Cell| match &self.states {
            Some(states) => states[self.grid.frame().index(cell)] == Some(number),
            None => self.grid.is_free(cell),
        };
        label.corners_and_middle().iter().all(|&place| self.view.cell_at(place).is_some_and(is_of_state))
    }

    fn is_on_a_circle(&self, label: &LabelBox) -> bool {
        let radius_px = self.endpoint_radius() / self.view.pixel();
        self.endpoints.iter().any(|&center| label.touches(self.view.pixels(center), radius_px))
    }
}

/// Offsets on growing rings, pixels.
fn around() -> impl Iterator<Item = [f64; 2]> {
    RINGS_PX.into_iter().flat_map(|radius| {
        let count = if radius == 0.0 { 1 } else { DIRECTIONS };
        (0..count).map(move |i| {
            let angle = TAU * i as f64 / DIRECTIONS as f64;
            [radius * trig::cos(angle), radius * trig::sin(angle)]
        })
    })
}

#[cfg(test)]
mod tests {
    use sharp_space::{OccupancyGrid, Point};

    use super::*;

    /// One row of twenty free cells.
    const FLOOR: &str = "....................";

    #[test]
    fn numbers_at_one_place_stand_apart_and_off_circles() {
        let map = OccupancyGrid::from_ascii(1.0, &[FLOOR; 20].join("\n")).unwrap();
        let labels = [0, 7, 12, 345].map(|number| (number, Point::new(10.0, 10.0)));
        let circle = [Point::new(10.0, 10.0)];
        let scene = Scene::new(&map).endpoints(&circle, 0.5).labels(&labels);
        let placed = scene.place_labels();
        for (i, (number, label)) in placed.iter().enumerate() {
            assert!(!scene.is_on_a_circle(label), "{number} at {label:?}");
            assert!(placed[..i].iter().all(|(_, other)| !label.overlaps(other)), "{placed:?}");
        }
    }

    #[test]
    fn a_number_stays_in_its_state() {
        let map = OccupancyGrid::from_ascii(1.0, &[FLOOR; 20].join("\n")).unwrap();
        let labels = [(0, Point::new(10.4, 10.0)), (1, Point::new(9.6, 10.0))];
        let state_of = |cell: Cell| Some(u32::from(cell.col >= 10));
        let scene = Scene::new(&map).states(&state_of).labels(&labels);
        for (number, label) in scene.place_labels() {
            assert!(scene.is_inside(&label, number), "{number} at {label:?}");
        }
    }
}
