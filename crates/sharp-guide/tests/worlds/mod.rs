//! Drawn worlds for the tests: maps with regions by hand, and plans of guided options in them.

use std::sync::Arc;

use sharp_guide::{
    ClearanceSearch, Goal, GuideRobot, GuidedOption, InflatedRobot, LegId, OptionSpace, Steering,
    UnguidedOption, inflated_robots,
};
use sharp_options::{AllowedRule, EndpointId, OptionId, OptionKind, OptionSet, OptionSettings};
use sharp_rbvd::{Rbvd, RbvdSettings, StateId};
use sharp_space::{
    Cell, DistanceField, Footprint, FootprintChecker, OccupancyGrid, Point, Pose, Region, RegionId,
    RobotGeometry, Seed,
};

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
#[allow(dead_code, reason = "not every test walks round the block")]
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

/// A problem: where the robot starts, and where it shall go.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Problem {
    pub(crate) start: Pose,
    pub(crate) goal: Point,
}

/// Along the [`HALL`], from end to end.
pub(crate) fn along() -> Problem {
    Problem { start: Pose::new(1.0, 2.2, 0.0), goal: Point::new(9.0, 2.2) }
}

/// A robot of the Husky's size in a drawing, with options between the regions.
#[derive(Debug)]
pub(crate) struct Drawn {
    #[allow(dead_code, reason = "not every test looks at cells")]
    pub(crate) grid: OccupancyGrid,
    geometry: Arc<dyn RobotGeometry>,
    inflated: Vec<InflatedRobot>,
    pub(crate) space: OptionSpace,
}

impl Drawn {
    /// The world of `drawing`, 0.4 m a cell; the digits 0, 1, … are regions of one cell.
    pub(crate) fn new(drawing: &str, kind: OptionKind) -> Self {
        let plain: String = drawing.chars().map(|c| if c.is_ascii_digit() { '.' } else { c }).collect();
        let grid = OccupancyGrid::from_ascii(0.4, &plain).expect("a sound drawing");
        let field = DistanceField::new(&grid);
        let rows: Vec<&str> = drawing.lines().map(str::trim).filter(|row| !row.is_empty()).collect();
        let mut marks: Vec<(u32, Cell)> = Vec::new();
        for (row, line) in rows.iter().rev().enumerate() {
            let digits =
                line.char_indices().filter_map(|(col, c)| Some((c.to_digit(10)?, Cell::new(col, row))));
            marks.extend(digits);
        }
        marks.sort_unstable();
        let region = |&(id, cell)| Region::new(RegionId(id), vec![cell], &field).expect("one cell");
        let regions: Vec<Region> = marks.iter().map(region).collect();
        let states = Rbvd::build(&field, &regions, &RbvdSettings::default()).expect("regions in free space");
        let options = OptionSet::synthesize(&states, kind, &OptionSettings::default());
        let footprint = Footprint::rectangle(0.5, 0.335).expect("a sound outline");
        let geometry: Arc<dyn RobotGeometry> = Arc::new(FootprintChecker::new(&grid, footprint));
        let inflated = inflated_robots(&geometry, 0.0);
        let (states, options) = (Arc::new(states), Arc::new(options));
        Self {
            grid,
            geometry,
            inflated,
            space: OptionSpace { states, options, rule: AllowedRule::default() },
        }
    }

    /// The robot, with its margins.
    pub(crate) fn robot(&self) -> GuideRobot<'_> {
        let (geometry, steering) = (&*self.geometry, Steering::RotateTranslate);
        GuideRobot { geometry, steering, inflated: &self.inflated }
    }

    /// The guided options called `names`, in the words of [`LegId`]'s display, as a plan for `problem`.
    pub(crate) fn plan(&self, names: &[&str], problem: Problem) -> Vec<Arc<GuidedOption>> {
        names.iter().map(|name| Arc::new(self.guided(name, problem))).collect()
    }

    fn guided(&self, name: &str, problem: Problem) -> GuidedOption {
        let option = self.unguided(name, problem);
        let mut rng = Seed(1).stream(&format!("guide {name}"), 0);
        let guide = option
            .plan_guide(&self.space, &self.robot(), &ClearanceSearch::default(), &mut rng)
            .unwrap_or_else(|reason| panic!("{name}: {reason}"));
        let goal = Goal::new(problem.goal, 0.4, self.robot().geometry.clearance());
        GuidedOption::new(&self.space, option.id, (option.from, option.to), guide, goal)
    }

    fn unguided(&self, name: &str, Problem { start, goal }: Problem) -> UnguidedOption {
        let (states, options) = (&*self.space.states, &*self.space.options);
        let state_at = |point: Point| states.state_at(point).expect("a state");
        let center = |id: EndpointId| options.endpoint(id).center;
        let id = self.id(name, state_at(goal));
        let (source, target) = id.endpoints(options);
        let (from, to) = match id {
            LegId::Option(id) => (id.from(), id.to()),
            LegId::Last(_, state) => (state, state_at(goal)),
            LegId::First(_) | LegId::Direct => {
                let from = state_at(start.position);
                let touched = target.iter().flat_map(|&id| &options.endpoint(id).states);
                (from, touched.copied().find(|&state| state != from).unwrap_or(from))
            }
        };
        let heading = source.is_none().then_some(start.heading);
        let (start, end) = (source.map_or(start.position, center), target.map_or(goal, center));
        UnguidedOption { id, from, to, start, end, heading, goal_heading: None }
    }

    fn id(&self, name: &str, goal: StateId) -> LegId {
        let endpoint = |index: &str| index.parse::<u32>().expect("the index of an endpoint");
        match name.split_once(':').expect("a kind and a place") {
            ("first", "goal") => LegId::Direct,
            ("first", index) => LegId::First(endpoint(index)),
            ("last", index) => {
                let states = &self.space.options.endpoint(EndpointId(endpoint(index))).states;
                LegId::Last(endpoint(index), if states.len() > 1 { goal } else { states[0] })
            }
            _ => LegId::Option(self.option_id(name)),
        }
    }

    fn option_id(&self, name: &str) -> OptionId {
        let mut ids = self.space.options.options().iter().map(|spec| spec.id);
        ids.find(|id| id.to_string() == name).expect("an option of the drawing")
    }
}
