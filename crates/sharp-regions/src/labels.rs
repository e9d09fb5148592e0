//! Training labels: where the solutions of random problems pass (paper, "Learning Critical Regions").
//!
//! As in the paper, goals are drawn at random, starts for each goal, and RRT-Connect solves the
//! problems with the robot's outline and kinematics. A pixel counts every plan that visits it once.
//! Three things differ from the published recipe, so that the labels depend on the map alone. Plans
//! are summed over all goals, so the network needs no goal as input. The parts of a plan near its
//! ends are left out, which replaces the removal of outliers. Visits are smoothed at a physical scale
//! instead of by five pixels.

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use sharp_motion::{
    Budget, FromCells, MotionQuery, Path, PathOutcome, RrtSettings, Sampler, Steering, rrt_connect,
};
use sharp_space::{
    Cell, CollisionChecker, DistanceField, Footprint, FootprintChecker, GridFrame, OccupancyGrid, Pose, Seed,
    Stream,
};

use crate::extract::components;
use crate::heatmap::HEADING_BINS;
use crate::pixel::{PIXEL_M, pixel_frame};

/// Heading sectors counted in labels: twice as many as predicted, so that a map turned by a right
/// angle (five sectors) has exact labels.
pub(crate) const FINE_BINS: usize = 2 * HEADING_BINS;

/// Standard deviation of the surround that a pixel's visits are compared with, metres.
const SURROUND_M: f64 = 1.0;

/// How much of a pixel that the robot cannot reach counts as reference area. With 1 a corridor is
/// critical from end to end; with 0 not even its mouths are.
const WALL_WEIGHT: f32 = 0.3;

/// Visits below this share of the average are noise.
const QUIET_SHARE: f32 = 0.15;

/// Criticality from which a pixel is critical.
pub(crate) const CRITICAL_MIN: f32 = 1.6;

/// The robot whose plans make the labels.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LabelRobot {
    /// Its outline.
    pub footprint: Footprint,
    /// How it can steer.
    pub steering: Steering,
}

/// How many problems are solved on a map, and what counts as critical.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default)]
#[non_exhaustive]
pub struct LabelSettings {
    /// Goals drawn on each map.
    pub goals: usize,
    /// Starts drawn for each goal.
    pub starts: usize,
    /// Least distance of a start from its goal, metres.
    pub distance_min_m: f64,
    /// Parts of a plan closer than this to its start or goal do not count, metres.
    pub endpoint_radius_m: f64,
    /// Standard deviation of the smoothing, metres.
    pub smoothing_m: f64,
    /// Samples after which a problem counts as unsolved.
    pub iterations: usize,
}

impl Default for LabelSettings {
    fn default() -> Self {
        // The paper's numbers.
        Self {
            goals: 100,
            starts: 50,
            distance_min_m: 3.0,
            endpoint_radius_m: 1.0,
            smoothing_m: 0.2,
            iterations: 3_000,
        }
    }
}

/// How often the plans of one map visit each pixel.
#[derive(Clone, Debug, PartialEq)]
pub struct Labels {
    /// The pixels' frame.
    pub frame: GridFrame,
    /// Smoothed share of plans that visit each pixel, row-major; 0 where the robot cannot be.
    pub visits: Vec<f32>,
    /// Shares of the plans' headings in each pixel, [`FINE_BINS`] of 0 to 255 a pixel.
    pub(crate) headings: Vec<u8>,
    /// Number of problems solved.
    pub solved: usize,
}

/// Solves random problems on `grid` and counts which pixels the plans visit.
///
/// Every problem has a random stream of its own: the labels do not depend on the number of threads.
/// A map without room for two poses gets labels without visits.
#[must_use]
pub fn label_map(grid: &OccupancyGrid, robot: &LabelRobot, settings: &LabelSettings, seed: Seed) -> Labels {
    let checker = FootprintChecker::new(grid, robot.footprint);
    let frame = pixel_frame(grid.frame());
    let cells = largest_part(checker.field(), robot.footprint.inscribed_radius_m());
    let Some(everywhere) = FromCells::new(*grid.frame(), &cells) else { return Labels::empty(frame) };
    let problems = Problems { checker: &checker, robot, settings, everywhere };
    let all_counts: Vec<VisitCounts> = (0..settings.goals)
        .into_par_iter()
        .map(|goal| problems.solve_goal(&frame, seed.child("goal", goal as u64)))
        .collect();
    let mut total = VisitCounts::new(&frame);
    all_counts.iter().for_each(|counts| total.add(counts));
    total.into_labels(frame, checker.field(), robot, settings.smoothing_m)
}

struct Problems<'a> {
    checker: &'a FootprintChecker,
    robot: &'a LabelRobot,
    settings: &'a LabelSettings,
    everywhere: FromCells<'a>,
}

impl Problems<'_> {
    fn solve_goal(&self, frame: &GridFrame, seed: Seed) -> VisitCounts {
        let mut counts = VisitCounts::new(frame);
        let Some(goal) = self.free_pose(&mut seed.stream("pose", 0), |_| true) else { return counts };
        for start in 0..self.settings.starts as u64 {
            let mut rng = seed.stream("start", start);
            let far = |pose: &Pose| pose.distance_m(&goal) >= self.settings.distance_min_m;
            let Some(start) = self.free_pose(&mut rng, far) else { continue };
            if let Some(path) = self.solve(MotionQuery { start, goal }, &mut rng) {
                counts.count(frame, &path, self.settings.endpoint_radius_m);
            }
        }
        counts
    }

    fn solve(&self, query: MotionQuery, rng: &mut Stream) -> Option<Path> {
        let settings =
            RrtSettings { budget: Budget { iterations: self.settings.iterations }, ..RrtSettings::default() };
        let mut sampler = self.everywhere;
        match rrt_connect(&query, self.checker, &self.robot.steering, &mut sampler, &settings, rng) {
            PathOutcome::Solved(path) => Some(path),
            _ => None,
        }
    }

    /// A collision-free pose for which `fits` is true, or `None` if a thousand draws gave none.
    fn free_pose(&self, rng: &mut Stream, fits: impl Fn(&Pose) -> bool) -> Option<Pose> {
        let mut sampler = self.everywhere;
        (0..1000).map(|_| sampler.sample(rng)).find(|&pose| self.checker.is_free(pose) && fits(&pose))
    }
}

/// The largest connected part of the cells with at least `min_clearance_m`.
fn largest_part(clearance: &DistanceField, min_clearance_m: f64) -> Vec<Cell> {
    let frame = clearance.frame();
    let open: Vec<Cell> =
        (0..frame.len()).map(|i| frame.cell(i)).filter(|&c| clearance.at(c) >= min_clearance_m).collect();
    let parts = components(frame, &open, &mut vec![false; frame.len()]);
    parts.into_iter().reduce(|a, b| if b.len() > a.len() { b } else { a }).unwrap_or_default()
}

/// How often plans visit each pixel. The counts are whole numbers, so the order of adding does not
/// matter.
struct VisitCounts {
    visits: Vec<u32>,
    headings: Vec<u32>,
    solved: usize,
}

impl VisitCounts {
    fn new(frame: &GridFrame) -> Self {
        Self { visits: vec![0; frame.len()], headings: vec![0; frame.len() * FINE_BINS], solved: 0 }
    }

    fn count(&mut self, frame: &GridFrame, path: &Path, endpoint_radius_m: f64) {
        self.solved += 1;
        let ends = [path.start(), path.end()];
        let middle = path
            .poses()
            .iter()
            .filter(|pose| ends.iter().all(|end| end.distance_m(pose) >= endpoint_radius_m));
        let mut seen: Vec<(usize, usize)> = middle
            .filter_map(|pose| {
                let pixel = frame.index(frame.cell_at(pose.position)?);
                Some((pixel, fine_bin(pose.heading.radians())))
            })
            .collect();
        seen.sort_unstable();
        seen.dedup();
        for &(pixel, bin) in &seen {
            self.headings[pixel * FINE_BINS + bin] += 1;
        }
        seen.dedup_by_key(|(pixel, _)| *pixel);
        seen.iter().for_each(|&(pixel, _)| self.visits[pixel] += 1);
    }

    fn add(&mut self, other: &Self) {
        self.solved += other.solved;
        self.visits.iter_mut().zip(&other.visits).for_each(|(a, b)| *a += b);
        self.headings.iter_mut().zip(&other.headings).for_each(|(a, b)| *a += b);
    }

    fn into_labels(
        self,
        frame: GridFrame,
        clearance: &DistanceField,
        robot: &LabelRobot,
        smoothing_m: f64,
    ) -> Labels {
        let reach = robot.footprint.inscribed_radius_m();
        let open: Vec<f32> = (0..frame.len())
            .map(|i| f32::from(u8::from(clearance.sample(frame.center(frame.cell(i))) >= reach)))
            .collect();
        let raw: Vec<f32> = self.visits.iter().zip(&open).map(|(&v, &o)| v as f32 * o).collect();
        let sums = smooth(&frame, &raw, smoothing_m);
        let weights = smooth(&frame, &open, smoothing_m);
        let plans = self.solved.max(1) as f32;
        let visits = (0..frame.len())
            .map(|i| if open[i] > 0.0 { sums[i] / weights[i].max(1e-6) / plans } else { 0.0 })
            .collect();
        let share = |counts: &[u32]| {
            let sum: u32 = counts.iter().sum();
            counts.iter().map(|&c| (255 * c).checked_div(sum).unwrap_or(0) as u8).collect::<Vec<u8>>()
        };
        let headings = self.headings.chunks_exact(FINE_BINS).flat_map(share).collect();
        Labels { frame, visits, headings, solved: self.solved }
    }
}

impl Labels {
    fn empty(frame: GridFrame) -> Self {
        Self { frame, visits: vec![0.0; frame.len()], headings: vec![0; frame.len() * FINE_BINS], solved: 0 }
    }

    /// Criticality of every pixel: its visits against those around it; 0 where the robot cannot be.
    ///
    /// This is the paper's μ with the reference density taken locally: a share of plans through a
    /// place, against what a uniform density within `SURROUND_M` would give. With one reference
    /// for the whole map only the busiest doors are critical, and a quiet room has no region.
    #[must_use]
    pub fn criticality(&self) -> Vec<f32> {
        let open: Vec<f32> = self.visits.iter().map(|&v| f32::from(u8::from(v > 0.0))).collect();
        let count = open.iter().sum::<f32>().max(1.0);
        let mean = self.visits.iter().sum::<f32>() / count;
        let sums = smooth(&self.frame, &self.visits, SURROUND_M);
        let area: Vec<f32> = open.iter().map(|o| o + WALL_WEIGHT * (1.0 - o)).collect();
        let weights = smooth(&self.frame, &area, SURROUND_M);
        let noise = (QUIET_SHARE * mean).max(f32::MIN_POSITIVE);
        let ratio = |i: usize| self.visits[i] / (sums[i] / weights[i].max(1e-6) + noise);
        (0..self.visits.len()).map(|i| if open[i] > 0.0 { ratio(i) } else { 0.0 }).collect()
    }
}

/// The heading sector of an angle, counted from −π.
pub(crate) fn fine_bin(heading_rad: f64) -> usize {
    let share = (heading_rad + std::f64::consts::PI) / std::f64::consts::TAU;
    ((share * FINE_BINS as f64) as usize).min(FINE_BINS - 1)
}

/// Convolution with a Gaussian of standard deviation `sigma_m`, cut at three of them.
fn smooth(frame: &GridFrame, plane: &[f32], sigma_m: f64) -> Vec<f32> {
    let sigma = (sigma_m / PIXEL_M).max(1e-3);
    let reach = (3.0 * sigma).ceil() as isize;
    let kernel: Vec<f32> =
        (-reach..=reach).map(|d| (-0.5 * (d as f64 / sigma).powi(2)).exp() as f32).collect();
    let pass = |from: &[f32], along: usize, stride: usize, length: usize| {
        let mut to = vec![0.0; from.len()];
        for (index, value) in to.iter_mut().enumerate() {
            let position = (index / stride % length) as isize;
            for (d, weight) in (-reach..=reach).zip(&kernel) {
                if (0..length as isize).contains(&(position + d)) {
                    *value += weight * from[index.wrapping_add_signed(d * along as isize)];
                }
            }
        }
        to
    };
    let rows = pass(plane, 1, 1, frame.width);
    pass(&rows, frame.width, frame.width, frame.height)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn two_rooms() -> OccupancyGrid {
        let row = format!("#{}#{}#", ".".repeat(30), ".".repeat(30));
        let door = format!("#{}#", ".".repeat(61));
        let (wall, middle) = ("#".repeat(63), [row.as_str(); 14].join("\n"));
        let doors = [door.as_str(); 10].join("\n");
        OccupancyGrid::from_ascii(0.1, &format!("{wall}\n{middle}\n{doors}\n{middle}\n{wall}")).unwrap()
    }

    fn labels(threads: usize) -> Labels {
        let robot = LabelRobot {
            footprint: Footprint::rectangle(0.3, 0.2).unwrap(),
            steering: Steering::RotateTranslate,
        };
        let settings = LabelSettings { goals: 8, starts: 8, ..LabelSettings::default() };
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| label_map(&two_rooms(), &robot, &settings, Seed(3)))
    }

    #[test]
    fn the_door_is_more_critical_than_the_rooms() {
        let labels = labels(1);
        let criticality = labels.criticality();
        let at = |x: f64, y: f64| {
            criticality[labels.frame.index(labels.frame.cell_at(sharp_space::Point::new(x, y)).unwrap())]
        };
        assert!(labels.solved >= 50, "{} of 64 problems solved", labels.solved);
        assert!(at(3.15, 2.0) > CRITICAL_MIN, "door {}", at(3.15, 2.0));
        assert!(at(0.6, 0.6) < CRITICAL_MIN, "corner {}", at(0.6, 0.6));
        assert_eq!(at(3.15, 0.5), 0.0, "wall");
    }

    #[test]
    fn labels_do_not_depend_on_the_number_of_threads() {
        assert_eq!(labels(1), labels(2));
    }
}
