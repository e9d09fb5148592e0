//! Problems, and how solving them may be watched.

use serde::{Deserialize, Serialize};
use sharp_drive::World;
use sharp_guide::GuidedOption;
use sharp_rl::Progress;
use sharp_space::{Cell, Heading, Occupancy, Pose};
use thiserror::Error;

use crate::learn::{LearningMonitor, LearntPolicy, TrainingFile, TrainingPoint};

/// Where a plan begins and ends.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Query {
    /// The initial configuration `x_i`.
    pub start: Pose,
    /// The goal configuration `x_g`; its heading is free.
    pub goal: Pose,
}

/// Directions in which a robot is tried to fit where it has no room to turn, and the angle between two of them, radians.
const TURNS: u8 = 16;
const TURN_RAD: f64 = std::f64::consts::TAU / TURNS as f64;
/// What messages call a goal on the way.
const VIA: &str = "via";

/// Why a robot cannot stand at one end of a query.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[non_exhaustive]
pub enum QueryError {
    /// The pose lies outside the map.
    #[error("{end} {problem}")]
    Outside {
        /// Which end: `start`, `goal` or `via`.
        end: &'static str,
        /// The pose, and where the map is.
        problem: String,
    },
    /// The robot does not fit there.
    #[error("{end} {problem}")]
    Occupied {
        /// Which end: `start`, `goal` or `via`.
        end: &'static str,
        /// The pose, what is wrong with it, and the nearest place with room.
        problem: String,
    },
}

impl QueryError {
    /// A short name for programs, as in `GOAL_OCCUPIED`.
    #[must_use]
    pub fn code(&self) -> &'static str {
        match self {
            Self::Outside { end: "start", .. } => "START_OUTSIDE_MAP",
            Self::Outside { .. } => "GOAL_OUTSIDE_MAP",
            Self::Occupied { end: "start", .. } => "START_OCCUPIED",
            Self::Occupied { .. } => "GOAL_OCCUPIED",
        }
    }
}

impl Query {
    /// Verifies that the robot of `world` can stand at both ends: at the start as it is turned there, at the goal in
    /// some direction.
    ///
    /// # Errors
    /// Says which end lies outside the map or leaves no room, and where the nearest room is.
    pub fn check(&self, world: &World) -> Result<(), QueryError> {
        let start = [self.start];
        // The goal's heading is free. In steps of 0.1 rad a full turn has 63 headings.
        let turned = |step: u32| self.goal.heading.radians() + f64::from(step) * 0.1;
        let goal: Vec<Pose> = (0..63).map(|step| Pose::at(self.goal.position, turned(step).into())).collect();
        check_end(world, "start", &start)?;
        check_end(world, "goal", &goal)
    }
}

impl QueryError {
    /// The same of a goal on the way, which messages call `via`.
    #[must_use]
    pub fn on_the_way(self) -> Self {
        match self {
            Self::Outside { problem, .. } => Self::Outside { end: VIA, problem },
            Self::Occupied { problem, .. } => Self::Occupied { end: VIA, problem },
        }
    }
}

/// Verifies that the robot fits in one of `poses`, all of which are in one place.
fn check_end(world: &World, end: &'static str, poses: &[Pose]) -> Result<(), QueryError> {
    let pose = &poses[0];
    let frame = world.grid.frame();
    let at = format!("({:.2}, {:.2}, {:.2})", pose.position.x, pose.position.y, pose.heading.radians());
    let Some(cell) = frame.cell_at(pose.position) else {
        let bounds = frame.bounds();
        let problem = format!(
            "{at} lies outside the map, which reaches from ({:.2}, {:.2}) to ({:.2}, {:.2})",
            bounds.min.x, bounds.min.y, bounds.max.x, bounds.max.y
        );
        return Err(QueryError::Outside { end, problem });
    };
    if poses.iter().any(|&pose| world.geometry.is_free(pose)) {
        return Ok(());
    }
    let what = match world.grid.get(cell) {
        Occupancy::Occupied => "lies in an obstacle".to_owned(),
        Occupancy::Unknown => "lies in unknown space (--unknown free takes it as free)".to_owned(),
        Occupancy::Free => {
            format!("is too near to an obstacle for the {}: its footprint overlaps", world.robot.name)
        }
    };
    Err(QueryError::Occupied { end, problem: format!("{at} {what}; {}", nearest_room(world, pose)) })
}

/// Where the robot would fit.
fn nearest_room(world: &World, pose: &Pose) -> String {
    let frame = world.grid.frame();
    let room_m = world.robot.footprint.circumscribed_radius_m() + 1.5 * frame.resolution_m;
    let field = world.geometry.clearance();
    let distance = |cell| (frame.center(cell) - pose.position).norm();
    let nearest = |fits: &dyn Fn(Cell) -> bool| {
        let fitting = (0..frame.len()).map(|index| frame.cell(index)).filter(|&cell| fits(cell));
        fitting.min_by(|&a, &b| distance(a).total_cmp(&distance(b)))
    };
    // In a narrow place it fits in some directions only.
    let fits_somehow = |cell: Cell| {
        let at = |turn: u8| Pose::at(frame.center(cell), Heading::new(f64::from(turn) * TURN_RAD));
        (0..TURNS).any(|turn| world.geometry.is_free(at(turn)))
    };
    match nearest(&|cell| field.at(cell) > room_m).or_else(|| nearest(&fits_somehow)) {
        Some(cell) => {
            let point = frame.center(cell);
            format!(
                "the nearest place with room is ({:.2}, {:.2}), {:.2} m away",
                point.x,
                point.y,
                distance(cell)
            )
        }
        None => "the map has no place with room for it".to_owned(),
    }
}

/// What the solver is busy with; a new phase ends the one before.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Phase {
    /// Predicting critical regions.
    Regions,
    /// Building the diagram and synthesising options.
    Abstraction,
    /// A* over options.
    Search,
    /// The guides that the search asked for.
    Guide,
    /// Learning the policies of this many options.
    Learn(usize),
    /// Running the whole plan, and repairing weak options.
    Verify,
    /// Finished.
    Done,
}

/// Watches the solver and may stop it. `()` watches nothing.
pub trait Monitor: Sync {
    /// A phase begins.
    fn phase(&self, _phase: Phase) {}
    /// The training of an option took a step; several options may train at once.
    fn trained(&self, _option: &GuidedOption, _progress: &Progress<'_>) {}
    /// The training of an option was evaluated; one that goes on tells its evaluations again.
    fn evaluated(&self, _option: &GuidedOption, _point: &TrainingPoint) {}
    /// An option was learnt.
    fn learnt(&self, _option: &GuidedOption, _learnt: &LearntPolicy) {}
    /// Asked often; true ends the search as soon as possible. What was learnt is kept.
    fn should_stop(&self) -> bool {
        false
    }
}

impl Monitor for () {}

/// A monitor, on one option.
pub(crate) struct OptionMonitor<'a> {
    pub(crate) monitor: &'a dyn Monitor,
    pub(crate) option: &'a GuidedOption,
    pub(crate) file: Option<&'a TrainingFile>,
}

impl LearningMonitor for OptionMonitor<'_> {
    fn should_stop(&self) -> bool {
        self.monitor.should_stop() || self.file.is_some_and(TrainingFile::has_failed)
    }

    fn trained(&self, progress: &Progress<'_>) {
        self.monitor.trained(self.option, progress);
    }

    fn evaluated(&self, point: &TrainingPoint) {
        self.monitor.evaluated(self.option, point);
    }

    fn training_file(&self) -> Option<&TrainingFile> {
        self.file
    }
}
