//! Drawn worlds for the tests.

use std::sync::Arc;

use sharp_guide::{Goal, GuidePath, GuidedOption, LegId, OptionSpace};
use sharp_options::{AllowedRule, OptionId, OptionKind, OptionSet, OptionSettings};
use sharp_rbvd::{Rbvd, RbvdSettings, StateId};
use sharp_sim::RobotModel;
use sharp_space::{Cell, DistanceField, OccupancyGrid, Point, Pose, Region, RegionId, trig};

use crate::world::World;

/// A hall of 10 by 4 m, 0.4 m a cell.
const HALL: &str = "
    #########################
    #.......................#
    #.......................#
    #.......................#
    #.......................#
    #.......................#
    #.......................#
    #.......................#
    #.......................#
    #########################";

fn grid() -> OccupancyGrid {
    OccupancyGrid::from_ascii(0.4, HALL).expect("a sound drawing")
}

/// The Husky in a hall whose inside reaches from 0.4 to 9.6 m and from 0.4 to 3.6 m.
pub(crate) fn hall() -> World {
    World::new(grid(), RobotModel::husky())
}

/// A straight guide from `from` to `to`.
pub(crate) fn straight(from: (f64, f64), to: (f64, f64)) -> GuidePath {
    let (dx, dy) = (to.0 - from.0, to.1 - from.1);
    let count = (trig::hypot(dx, dy) / 0.2).ceil();
    let pose = |i: f64| Pose::new(from.0 + dx * i / count, from.1 + dy * i / count, trig::atan2(dy, dx));
    GuidePath::new((0..=count as usize).map(|i| pose(i as f64)).collect(), 0.25).expect("short gaps")
}

/// Along the hall from (1, 2.2) to (9, 2.2): `π_0`, two centroid options and `π_{n+1}`, on straight guides.
pub(crate) fn hall_options() -> Vec<Arc<GuidedOption>> {
    let field = DistanceField::new(&grid());
    let cells = [5, 12, 19].map(|col| Cell::new(col, 5));
    let region = |(id, cell)| Region::new(RegionId(id), vec![cell], &field).expect("one cell");
    let regions: Vec<Region> = (0..).zip(cells).map(region).collect();
    let states = Rbvd::build(&field, &regions, &RbvdSettings::default()).expect("regions in free space");
    let options = OptionSet::synthesize(&states, OptionKind::Centroid, &OptionSettings::default());
    let centers = [0, 1, 2].map(|index| options.endpoints()[index].center);
    let (states, options) = (Arc::new(states), Arc::new(options));
    let space = OptionSpace { states, options, rule: AllowedRule::default() };
    let goal = Goal::new(Point::new(9.0, 2.2), 0.4, &field);
    let [s0, s1, s2] = [0, 1, 2].map(StateId);
    let [c0, c1, c2] = centers.map(|center| (center.x, center.y));
    let centroid = |from, to| LegId::Option(OptionId::Centroid { from, to });
    let plan = [
        (LegId::First(0), (s0, s0), straight((1.0, 2.2), c0)),
        (centroid(s0, s1), (s0, s1), straight(c0, c1)),
        (centroid(s1, s2), (s1, s2), straight(c1, c2)),
        (LegId::Last(2, s2), (s2, s2), straight(c2, (9.0, 2.2))),
    ];
    let option = |(id, between, guide)| Arc::new(GuidedOption::new(&space, id, between, guide, goal.clone()));
    plan.into_iter().map(option).collect()
}
