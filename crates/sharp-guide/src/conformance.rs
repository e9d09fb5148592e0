//! Suites that every implementation of this crate's traits must pass, ours and anybody's.

use sharp_space::{
    Cell, Footprint, FootprintChecker, OccupancyGrid, Point, Pose, RobotGeometry, Seed, Stream,
};
use thiserror::Error;

use crate::guided_option::GuidedOption;
use crate::inflate::GuideRobot;
use crate::path::GuidePath;
use crate::planner::GuidePlanner;
use crate::request::{GuideEnd, GuideRequest};
use crate::reward::{Reward, StepEvents, Transition};
use crate::{NoGuide, Steering};

/// How a guide planner breaks its promise.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum GuideViolation {
    /// There is a path, and the planner found none.
    #[error("no guide where there is a way: {0}")]
    Missed(NoGuide),
    /// There is no path, and the planner returned one.
    #[error("a guide through a wall")]
    ThroughWall,
    /// The guide does not begin or end where the request says.
    #[error("the guide runs from ({:.2}, {:.2}) to ({:.2}, {:.2}), which was not asked for", .0.x, .0.y, .1.x, .1.y)]
    Ends(Point, Point),
    /// The outline touches an obstacle.
    #[error("the outline touches an obstacle at ({:.2}, {:.2})", .0.x, .0.y)]
    Contact(Point),
    /// The guide leaves the allowed cells.
    #[error("the guide leaves the allowed cells at ({:.2}, {:.2})", .0.x, .0.y)]
    Astray(Point),
    /// Equal streams give different guides.
    #[error("the same stream gives another guide")]
    Random,
}

/// A hall of 10 by 4 m, a wall across it with a gap of 1.5 m, and a sealed room at its right end.
const HALL: &str = "
    #########################
    #..........#........#...#
    #..........#........#...#
    #..........#........#...#
    #...................#...#
    #...................#...#
    #...................#...#
    #..........#........#...#
    #..........#........#...#
    #########################";

/// Plans in a small hall with a gap: through the gap, inside a part of the cells, and into a sealed room.
///
/// # Errors
/// Says which promise is broken.
pub fn check_guide_planner(planner: &dyn GuidePlanner) -> Result<(), GuideViolation> {
    let grid = OccupancyGrid::from_ascii(0.4, HALL).expect("a sound drawing");
    let footprint = Footprint::rectangle(0.3, 0.2).expect("a sound outline");
    let geometry = FootprintChecker::new(&grid, footprint);
    let robot = GuideRobot::new(&geometry, Steering::RotateTranslate);
    let (left, right, sealed) = (Point::new(1.2, 2.0), Point::new(7.0, 2.0), Point::new(9.0, 2.0));
    let everywhere = |_: Cell| true;
    let upper = |cell: Cell| cell.row >= 3;
    for allowed in [&everywhere, &upper] as [&dyn Fn(Cell) -> bool; 2] {
        let plan = |rng: &mut Stream| {
            let request = GuideRequest { start: end(left), goal: end(right), allowed };
            planner.plan(&request, &robot, rng)
        };
        let guide = plan(&mut Seed(1).stream("guide", 0)).map_err(GuideViolation::Missed)?;
        check_path(&guide, (left, right), &geometry, allowed)?;
        if plan(&mut Seed(1).stream("guide", 0)).as_ref() != Ok(&guide) {
            return Err(GuideViolation::Random);
        }
    }
    let request = GuideRequest { start: end(left), goal: end(sealed), allowed: &|_| true };
    match planner.plan(&request, &robot, &mut Seed(1).stream("guide", 0)) {
        Ok(_) => Err(GuideViolation::ThroughWall),
        Err(_) => Ok(()),
    }
}

const fn end(position: Point) -> GuideEnd {
    GuideEnd { position, heading: None }
}

fn check_path(
    guide: &GuidePath,
    (from, to): (Point, Point),
    geometry: &dyn RobotGeometry,
    allowed: &dyn Fn(Cell) -> bool,
) -> Result<(), GuideViolation> {
    let (start, goal) = (guide.start().position, guide.end().position);
    if (start - from).norm() > 1e-6 || (goal - to).norm() > 1e-6 {
        return Err(GuideViolation::Ends(start, goal));
    }
    let steps = (guide.length_m() / 0.05).ceil() as usize;
    for step in 0..=steps {
        let pose = guide.pose_at(guide.length_m() * step as f64 / steps as f64);
        if !geometry.is_free(pose) {
            return Err(GuideViolation::Contact(pose.position));
        }
    }
    let frame = geometry.clearance().frame();
    let is_allowed = |pose: &&Pose| frame.cell_at(pose.position).is_some_and(allowed);
    let inner = &guide.poses()[1..guide.poses().len() - 1];
    match inner.iter().find(|pose| !is_allowed(pose)) {
        Some(pose) => Err(GuideViolation::Astray(pose.position)),
        None => Ok(()),
    }
}

/// How a reward breaks its promise.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum RewardViolation {
    /// A reward is NaN or infinite.
    #[error("the reward is {0}")]
    NotFinite(f64),
    /// Reaching the termination set pays less than not reaching it.
    #[error("success pays {success}, the same step without success {step}")]
    Success {
        /// Reward with success.
        success: f64,
        /// Reward without.
        step: f64,
    },
    /// The same transition pays differently.
    #[error("the same transition pays {0}, then {1}")]
    Changing(f64, f64),
}

/// Pays transitions along `option`: forwards, backwards, astray, in contact, and at its end.
///
/// # Errors
/// Says which promise is broken.
pub fn check_reward(reward: &dyn Reward, option: &GuidedOption) -> Result<(), RewardViolation> {
    let length_m = option.guide.length_m();
    for step in 0..=20 {
        let pose = option.guide.pose_at(length_m * f64::from(step) / 20.0);
        for (progress_m, deviation_m) in [(0.3, 0.0), (-0.3, 0.2), (0.0, -0.1)] {
            let paid = |events| {
                let transition = Transition { option, pose: &pose, progress_m, deviation_m, events };
                reward.reward(&transition)
            };
            let event = StepEvents::default();
            let [plain, success, contact, stray] = [
                event,
                StepEvents { success: true, ..event },
                StepEvents { contact: true, ..event },
                StepEvents { stray: true, ..event },
            ]
            .map(paid);
            if let Some(&broken) = [plain, success, contact, stray].iter().find(|paid| !paid.is_finite()) {
                return Err(RewardViolation::NotFinite(broken));
            }
            if success < plain {
                return Err(RewardViolation::Success { success, step: plain });
            }
            let again = paid(event);
            if again != plain {
                return Err(RewardViolation::Changing(plain, again));
            }
        }
    }
    Ok(())
}
