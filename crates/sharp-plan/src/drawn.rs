//! Drawn worlds for the tests: maps with regions by hand, their legs and plans of followers.

use std::sync::Arc;

use sharp_guide::GuidePath;
use sharp_options::{OptionKind, OptionSet, OptionSettings};
use sharp_rbvd::{Rbvd, RbvdSettings};
use sharp_sim::{NoiseModel, RobotModel};
use sharp_space::{Cell, DistanceField, OccupancyGrid, Pose, Region, RegionId, Seed};

use crate::certify::FAILURE_COST_S;
use crate::learn::{LearningMode, Learnt};
use crate::leg::Leg;
use crate::percept::Workspace;
use crate::plan::Plan;
use crate::planner::{Abstraction, Planner, Query, SearchSettings};
use crate::policy::{Follower, OptionPolicy};
use crate::sharp::{PlannedLeg, Solution};
use crate::stats::Tally;

/// A hall of 10 by 4 m, 0.4 m a cell, with three regions in a row.
pub(crate) const HALL: &str = "
    #########################
    #.......................#
    #.......................#
    #.......................#
    #....0......1......2....#
    #.......................#
    #.......................#
    #.......................#
    #.......................#
    #########################";

/// A block with a corridor of 2 m all around, and a region at each corner.
pub(crate) const RING: &str = "
    #########################
    #.......................#
    #.......................#
    #..0.................1..#
    #.......................#
    #.......................#
    #.....#############.....#
    #.....#############.....#
    #.....#############.....#
    #.......................#
    #.......................#
    #..2.................3..#
    #.......................#
    #.......................#
    #########################";

/// Two rooms without a door.
pub(crate) const SEALED: &str = "
    #####################
    #.........#.........#
    #.........#.........#
    #....0....#....1....#
    #.........#.........#
    #.........#.........#
    #####################";

/// The Husky in `drawing`, 0.4 m a cell; the digits 0, 1, … are regions of one cell.
pub(crate) fn world(drawing: &str, kind: OptionKind) -> (Workspace, Abstraction) {
    let plain: String = drawing.chars().map(|c| if c.is_ascii_digit() { '.' } else { c }).collect();
    let grid = OccupancyGrid::from_ascii(0.4, &plain).expect("a sound drawing");
    let field = DistanceField::new(&grid);
    let rows: Vec<&str> = drawing.lines().map(str::trim).filter(|row| !row.is_empty()).collect();
    let mut marks: Vec<(u32, Cell)> = Vec::new();
    for (row, line) in rows.iter().rev().enumerate() {
        let digits = line.char_indices().filter_map(|(col, c)| Some((c.to_digit(10)?, Cell::new(col, row))));
        marks.extend(digits);
    }
    marks.sort_unstable();
    let region = |&(id, cell)| Region::new(RegionId(id), vec![cell], &field).expect("one cell");
    let regions: Vec<Region> = marks.iter().map(region).collect();
    let workspace = Workspace::new(grid, RobotModel::husky());
    let rbvd = Rbvd::build(&field, &regions, &RbvdSettings::default()).expect("regions in free space");
    let options = OptionSet::synthesize(&rbvd, kind, &OptionSettings::default());
    (workspace, Abstraction { rbvd: Arc::new(rbvd), options: Arc::new(options) })
}

/// Along the [`HALL`], from end to end.
pub(crate) fn along() -> Query {
    Query { start: Pose::new(1.0, 2.2, 0.0), goal: Pose::new(9.0, 2.2, 0.0) }
}

/// The guided legs of the cheapest plan for `query`.
pub(crate) fn legs(workspace: &Workspace, abstraction: &Abstraction, query: Query) -> Vec<Arc<Leg>> {
    let settings = SearchSettings::new(workspace);
    let mut planner =
        Planner::new(workspace, abstraction, settings, query, [], Seed(1)).expect("both ends have a state");
    planner.plan(&|_| None, &()).expect("there is a way")
}

/// A straight guide from `from` to `to`.
pub(crate) fn straight(from: (f64, f64), to: (f64, f64)) -> GuidePath {
    let (dx, dy) = (to.0 - from.0, to.1 - from.1);
    let count = (dx.hypot(dy) / 0.2).ceil();
    let pose = |i: f64| Pose::new(from.0 + dx * i / count, from.1 + dy * i / count, dy.atan2(dx));
    GuidePath::new((0..=count as usize).map(|i| pose(i as f64)).collect(), 0.25).expect("short gaps")
}

/// A policy that follows its guide, as if it had held in all of 100 episodes.
pub(crate) fn followed(workspace: &Workspace) -> Learnt {
    Learnt {
        policy: OptionPolicy::Follower(Follower::cautious(&workspace.robot)),
        verified: Tally { episodes: 100, successes: 100 },
        mean_time_s: 5.0,
        env_steps: 0,
        gradient_steps: 0,
    }
}

/// The plan of followers along the [`HALL`] for options of `kind`.
pub(crate) fn plan(kind: OptionKind) -> Arc<Plan> {
    let (workspace, abstraction) = world(HALL, kind);
    let planned = |leg| PlannedLeg {
        leg,
        learnt: followed(&workspace),
        reused: false,
        on_arrival: Tally { episodes: 100, successes: 100 },
    };
    let solution = Solution {
        query: along(),
        legs: legs(&workspace, &abstraction, along()).into_iter().map(planned).collect(),
        predicted: Tally { episodes: 100, successes: 100 },
        predicted_time_s: 20.0,
    };
    Arc::new(Plan {
        workspace,
        abstraction,
        noise: NoiseModel::none(),
        learning: LearningMode::Fast,
        cost_update: true,
        failure_cost_s: FAILURE_COST_S,
        seed: Seed(1),
        solution,
    })
}
