//! Distributions over poses that planners draw from.

use std::f64::consts::PI;

use rand::RngExt;
use sharp_space::{Bounds, Cell, GridFrame, Heading, Pose, Stream, Vector};

/// Draws poses. Implement [`sample`](Self::sample).
pub trait Sampler {
    /// The next pose; it need not be free.
    fn sample(&mut self, rng: &mut Stream) -> Pose;
}

/// Uniform over a rectangle and all headings.
#[derive(Clone, Copy, Debug)]
pub struct Uniform {
    /// The rectangle.
    pub bounds: Bounds,
}

impl Sampler for Uniform {
    fn sample(&mut self, rng: &mut Stream) -> Pose {
        let (min, max) = (self.bounds.min, self.bounds.max);
        let mut between = |low: f64, high: f64| low + (high - low) * rng.random::<f64>();
        Pose::new(between(min.x, max.x), between(min.y, max.y), between(-PI, PI))
    }
}

/// Uniform over the area of some cells and all headings: a critical region, or the states of an option.
#[derive(Clone, Copy, Debug)]
pub struct FromCells<'a> {
    frame: GridFrame,
    cells: &'a [Cell],
}

impl<'a> FromCells<'a> {
    /// Draws from `cells` of the grid at `frame`; `None` if there are none.
    #[must_use]
    pub const fn new(frame: GridFrame, cells: &'a [Cell]) -> Option<Self> {
        if cells.is_empty() { None } else { Some(Self { frame, cells }) }
    }
}

impl Sampler for FromCells<'_> {
    fn sample(&mut self, rng: &mut Stream) -> Pose {
        let cell = self.cells[rng.random_range(0..self.cells.len())];
        let inside = Vector::new(rng.random::<f64>(), rng.random::<f64>());
        let grid = Vector::new(cell.col as f64, cell.row as f64) + inside;
        Pose::at(self.frame.from_grid(grid), Heading::new(PI * (2.0 * rng.random::<f64>() - 1.0)))
    }
}

/// A share of samples from one distribution, the rest from another: the paper's planner mixes critical
/// regions with uniform samples.
#[derive(Clone, Copy, Debug)]
pub struct Mixture<A, B> {
    /// Drawn with probability [`share`](Self::share).
    pub first: A,
    /// Drawn otherwise.
    pub second: B,
    /// In [0, 1].
    pub share: f64,
}

impl<A: Sampler, B: Sampler> Sampler for Mixture<A, B> {
    fn sample(&mut self, rng: &mut Stream) -> Pose {
        if rng.random::<f64>() < self.share { self.first.sample(rng) } else { self.second.sample(rng) }
    }
}

impl<S: Sampler + ?Sized> Sampler for &mut S {
    fn sample(&mut self, rng: &mut Stream) -> Pose {
        (**self).sample(rng)
    }
}

#[cfg(test)]
mod tests {
    use sharp_space::{Point, Seed};

    use super::*;

    #[test]
    fn samples_lie_in_their_areas() {
        let frame = GridFrame { origin: Pose::new(-1.0, 2.0, 0.4), resolution_m: 0.5, width: 9, height: 7 };
        let cells = [Cell::new(2, 3), Cell::new(8, 6)];
        let bounds = Bounds { min: Point::new(50.0, 50.0), max: Point::new(51.0, 52.0) };
        let from_cells = FromCells::new(frame, &cells).unwrap();
        let mut sampler = Mixture { first: from_cells, second: Uniform { bounds }, share: 0.25 };
        let mut rng = Seed(3).stream("sampler", 0);
        let mut in_cells = 0;
        for _ in 0..1000 {
            let pose = sampler.sample(&mut rng);
            let cell = frame.cell_at(pose.position);
            assert!(bounds.contains(pose.position) || cell.is_some_and(|c| cells.contains(&c)), "{pose:?}");
            in_cells += usize::from(cell.is_some());
        }
        assert!((200..300).contains(&in_cells), "a quarter from the cells, not {in_cells} of 1000");
    }
}
