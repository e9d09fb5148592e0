//! Drawn worlds for the tests: maps with regions by hand, their guided options and plans of followers.

use std::sync::Arc;

use sharp_drive::{Follower, OptionPolicy, SuccessCount, SuccessEstimate, World};
use sharp_guide::{GuidePath, GuidedOption};
use sharp_options::{OptionKind, OptionSet, OptionSettings};
use sharp_rbvd::{Rbvd, RbvdSettings};
use sharp_sim::{NoiseModel, RobotModel};
use sharp_space::{Cell, DistanceField, OccupancyGrid, Pose, Region, RegionId, Seed, trig};

use crate::abstraction::Abstraction;
use crate::learn::LearntPolicy;
use crate::method::Method;
use crate::plan_file::Plan;
use crate::query::Query;
use crate::search::Search;
use crate::verify::{PlannedOption, Solution};

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
pub(crate) fn world(drawing: &str, kind: OptionKind) -> (World, Abstraction) {
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
    let world = World::new(grid, RobotModel::husky());
    let rbvd = Rbvd::build(&field, &regions, &RbvdSettings::default()).expect("regions in free space");
    let options = OptionSet::synthesize(&rbvd, kind, &OptionSettings::default());
    (world, Abstraction { states: Arc::new(rbvd), options: Arc::new(options) })
}

/// Along the [`HALL`], from end to end.
pub(crate) fn along() -> Query {
    Query { start: Pose::new(1.0, 2.2, 0.0), goal: Pose::new(9.0, 2.2, 0.0) }
}

/// The guided options of the cheapest plan for `query`.
pub(crate) fn options(world: &World, abstraction: &Abstraction, query: Query) -> Vec<Arc<GuidedOption>> {
    let method = Method::fast();
    let search = Search::new(world, abstraction, &method, &NoiseModel::nominal(), query, [], Seed(1));
    search.expect("both ends have a state").plan(&|_| None, &()).expect("there is a way").1
}

/// A straight guide from `from` to `to`.
pub(crate) fn straight(from: (f64, f64), to: (f64, f64)) -> GuidePath {
    let (dx, dy) = (to.0 - from.0, to.1 - from.1);
    let count = (trig::hypot(dx, dy) / 0.2).ceil();
    let pose = |i: f64| Pose::new(from.0 + dx * i / count, from.1 + dy * i / count, trig::atan2(dy, dx));
    GuidePath::new((0..=count as usize).map(|i| pose(i as f64)).collect(), 0.25).expect("short gaps")
}

/// A policy that follows its guide, as if it had succeeded in all of 100 episodes.
pub(crate) fn followed(world: &World) -> LearntPolicy {
    let policy = OptionPolicy::Follower(Follower::cautious(&world.robot));
    let count = SuccessCount { episodes: 100, successes: 100 };
    LearntPolicy::untrained(policy, SuccessEstimate { count, mean_time_s: 5.0 })
}

/// The plan of followers along the [`HALL`] for options of `kind`.
pub(crate) fn plan(kind: OptionKind) -> Arc<Plan> {
    let (world, abstraction) = world(HALL, kind);
    let count = SuccessCount { episodes: 100, successes: 100 };
    let planned = |option| PlannedOption {
        option,
        learnt: followed(&world),
        reused: false,
        on_arrival: count,
        arrival_time_s: 5.0,
    };
    let steps = options(&world, &abstraction, along()).into_iter().map(planned).collect();
    let solution =
        Solution { query: along(), steps, predicted: count, predicted_time_s: 20.0, composed: None };
    let (noise, method, seed) = (NoiseModel::none(), Method::fast(), Seed(1));
    Arc::new(Plan { world, abstraction, noise, method, seed, solution })
}
