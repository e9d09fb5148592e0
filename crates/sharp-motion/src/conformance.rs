//! Conformance suites: what every [`MotionPlanner`] and every [`Sampler`] must keep.

use sharp_space::{CollisionChecker, Footprint, FootprintChecker, OccupancyGrid, Pose, Seed};
use thiserror::Error;

use crate::path::Path;
use crate::planner::MotionPlanner;
use crate::query::{MotionQuery, PathOutcome};
use crate::sampler::Sampler;

/// Two rooms with a door between them, and a third that is closed. Cells of half a metre.
const ROOMS: &str = "
    ##########################
    #........#........#......#
    #........#........#......#
    #.................#......#
    #.................#......#
    #.................#......#
    #........#........#......#
    #........#........#......#
    ##########################";

/// Largest distance between two poses of a path that follow each other, metres and radians.
const JUMP_MAX: f64 = 0.15;
/// Seeds that are tried for each query.
const SEEDS: u64 = 3;

/// A promise of [`MotionPlanner`] that an implementation does not keep.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum PlannerViolation {
    /// No path was found straight ahead through an empty room.
    #[error("no path was found straight ahead through an empty room: {0:?}")]
    OpenRoom(PathOutcome),
    /// A path does not begin at the start or does not end at the goal.
    #[error("the path leads from {start:?} to {end:?}, which are not the ends of {query:?}")]
    Ends {
        /// What was asked.
        query: MotionQuery,
        /// Where the path begins.
        start: Pose,
        /// Where it ends.
        end: Pose,
    },
    /// A pose of a path is in collision.
    #[error("the path holds {0:?}, which is in collision")]
    Collision(Pose),
    /// Two poses of a path that follow each other lie too far apart.
    #[error("the path jumps from {0:?} to {1:?}")]
    Jump(Pose, Pose),
    /// Two answers to one query with one seed differ.
    #[error("the same query and seed gave two different outcomes")]
    NotDeterministic,
    /// A blocked start or goal was not named.
    #[error("{end} is blocked, but the outcome is {found:?}")]
    BlockedEnd {
        /// Which end: "the start" or "the goal".
        end: &'static str,
        /// The outcome.
        found: PathOutcome,
    },
    /// A free start or goal was called blocked.
    #[error("start and goal are free, but the outcome is {0:?}")]
    FreeEnd(PathOutcome),
    /// A path was found into a room without a door.
    #[error("a path was found into a room without a door")]
    ThroughWall,
}

/// A promise of [`Sampler`] that an implementation does not keep.
#[derive(Clone, Debug, PartialEq, Error)]
#[non_exhaustive]
pub enum SamplerViolation {
    /// A sample is not finite.
    #[error("sample {number} is not finite")]
    NotFinite {
        /// Number of the sample, from 0.
        number: usize,
    },
    /// Two samplers with the same stream drew different poses.
    #[error("sample {number} is not the same when the same stream is used again")]
    NotDeterministic {
        /// Number of the sample, from 0.
        number: usize,
    },
}

/// Asks the planner that `build` makes for a map of the suite, for a robot of 0.5 m by 0.3 m.
///
/// A planner need not find every path. It must find one straight ahead through an empty room, and whatever it
/// finds must be right.
///
/// # Errors
/// Returns the first promise of [`MotionPlanner`] that the planner does not keep.
pub fn check_motion_planner<P: MotionPlanner>(
    build: impl Fn(&OccupancyGrid) -> P,
) -> Result<(), PlannerViolation> {
    let grid = OccupancyGrid::from_ascii(0.5, ROOMS).expect("the drawing is sound");
    let robot = Footprint::rectangle(0.25, 0.15).expect("the numbers are in range");
    let (checker, planner) = (FootprintChecker::new(&grid, robot), build(&grid));
    let left = Pose::new(1.5, 2.0, 0.0);
    let straight = MotionQuery { start: left, goal: Pose::new(3.5, 2.0, 0.0) };
    let stay = MotionQuery { start: left, goal: left };
    let through_door = MotionQuery { start: left, goal: Pose::new(8.0, 1.5, 1.0) };
    let closed = MotionQuery { start: left, goal: Pose::new(11.0, 2.0, 0.0) };
    for seed in 0..SEEDS {
        let ask = |query: &MotionQuery| planner.plan(query, &checker, &mut Seed(seed).stream("suite", 0));
        for query in [straight, stay, through_door] {
            let outcome = ask(&query);
            if ask(&query) != outcome {
                return Err(PlannerViolation::NotDeterministic);
            }
            match outcome {
                PathOutcome::Solved(path) => check_path(&path, &query, &checker)?,
                missing if query == straight => return Err(PlannerViolation::OpenRoom(missing)),
                PathOutcome::Exhausted { .. } => {}
                found => return Err(PlannerViolation::FreeEnd(found)),
            }
        }
        if matches!(ask(&closed), PathOutcome::Solved(_)) {
            return Err(PlannerViolation::ThroughWall);
        }
        check_blocked_ends(&straight, ask)?;
    }
    Ok(())
}

fn check_path(
    path: &Path,
    query: &MotionQuery,
    checker: &dyn CollisionChecker,
) -> Result<(), PlannerViolation> {
    let (start, end) = (path.start(), path.end());
    if (start, end) != (query.start, query.goal) {
        return Err(PlannerViolation::Ends { query: *query, start, end });
    }
    if let Some(pose) = path.poses().iter().find(|&&pose| !checker.is_free(pose)) {
        return Err(PlannerViolation::Collision(*pose));
    }
    let jumps = |pair: &&[Pose]| {
        let turn_rad = pair[0].heading.turn_to(pair[1].heading).abs();
        pair[0].distance_m(&pair[1]) > JUMP_MAX || turn_rad > JUMP_MAX
    };
    path.poses().windows(2).find(jumps).map_or(Ok(()), |pair| Err(PlannerViolation::Jump(pair[0], pair[1])))
}

/// Ends in a wall and ends that are nowhere.
fn check_blocked_ends(
    query: &MotionQuery,
    ask: impl Fn(&MotionQuery) -> PathOutcome,
) -> Result<(), PlannerViolation> {
    for blocked in [Pose::new(0.1, 0.1, 0.0), Pose::new(f64::NAN, 1.0, 0.0)] {
        let found = ask(&MotionQuery { start: blocked, ..*query });
        if found != PathOutcome::InvalidStart {
            return Err(PlannerViolation::BlockedEnd { end: "the start", found });
        }
        let found = ask(&MotionQuery { goal: blocked, ..*query });
        if found != PathOutcome::InvalidGoal {
            return Err(PlannerViolation::BlockedEnd { end: "the goal", found });
        }
    }
    Ok(())
}

/// Draws from two samplers that `build` makes, with equal streams.
///
/// # Errors
/// Returns the first promise of [`Sampler`] that the sampler does not keep.
pub fn check_sampler<S: Sampler>(build: impl Fn() -> S) -> Result<(), SamplerViolation> {
    let (mut first, mut second) = (build(), build());
    let [mut stream, mut again] = [(); 2].map(|()| Seed(1).stream("suite", 0));
    for number in 0..1000 {
        let pose = first.sample(&mut stream);
        if !pose.is_finite() {
            return Err(SamplerViolation::NotFinite { number });
        }
        if second.sample(&mut again) != pose {
            return Err(SamplerViolation::NotDeterministic { number });
        }
    }
    Ok(())
}
