//! Legs of a plan: an option, or the special cases `π_0` and `π_{n+1}` at either end.

use std::fmt;
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use sharp_guide::GuidePath;
use sharp_options::{AllowedRule, Endpoint, EndpointId, OptionId, OptionSet};
use sharp_rbvd::{Rbvd, StateId};
use sharp_space::{Cell, GridFrame, OccupancyGrid, Point, Pose};

/// What a leg is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// `π_0`: from the initial configuration to the first option, or straight to the goal.
    First,
    /// One of `o_1 … o_n`.
    Option,
    /// `π_{n+1}`: from the last option to the goal configuration.
    Last,
}

/// Names a leg within a plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum LegId {
    /// From the initial configuration to the endpoint with this index.
    First(u32),
    /// An option.
    Option(OptionId),
    /// From the endpoint with this index, entered from the given state, to the goal configuration.
    Last(u32, StateId),
    /// From the initial to the goal configuration without any option.
    Direct,
}

impl LegId {
    /// What the leg is for.
    #[must_use]
    pub const fn role(&self) -> Role {
        match self {
            Self::First(_) | Self::Direct => Role::First,
            Self::Option(_) => Role::Option,
            Self::Last(..) => Role::Last,
        }
    }
}

impl fmt::Display for LegId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::First(endpoint) => write!(f, "first:{endpoint}"),
            Self::Option(id) => write!(f, "{id}"),
            Self::Last(endpoint, _) => write!(f, "last:{endpoint}"),
            Self::Direct => f.write_str("first:goal"),
        }
    }
}

/// Where a leg ends.
#[derive(Clone, Debug, PartialEq)]
pub enum Target {
    /// An endpoint region β (definitions 3 and 5).
    Endpoint(Endpoint),
    /// The goal configuration, heading free.
    Goal {
        /// Its position.
        point: Point,
        /// How near counts as reached, metres.
        radius_m: f64,
    },
}

impl Target {
    /// Returns true if a robot at `point` has arrived.
    #[must_use]
    pub fn contains(&self, point: Point, rbvd: &Rbvd) -> bool {
        match self {
            Self::Endpoint(endpoint) => endpoint.contains(point, rbvd),
            Self::Goal { point: goal, radius_m } => (point - goal).norm() < *radius_m,
        }
    }

    /// The endpoint, unless it is the goal.
    pub(crate) const fn endpoint(&self) -> Option<&Endpoint> {
        match self {
            Self::Endpoint(endpoint) => Some(endpoint),
            Self::Goal { .. } => None,
        }
    }

    /// Its centre.
    #[must_use]
    pub const fn center(&self) -> Point {
        match self {
            Self::Endpoint(endpoint) => endpoint.center,
            Self::Goal { point, .. } => *point,
        }
    }
}

/// A leg with its guide: what a policy is learnt for and runs in.
#[derive(Clone, Debug)]
pub struct Leg {
    /// Its name.
    pub id: LegId,
    /// The state it leaves.
    pub from: StateId,
    /// The state it ends in.
    pub to: StateId,
    /// The guide path 𝒢 from the centre of its initiation set to that of its termination set.
    pub guide: GuidePath,
    /// Its termination set β.
    pub target: Target,
    /// Where it may be without straying.
    pub allowed: Vec<StateId>,
    /// Its initiation set, where it may be as well; `None` for a leg from a configuration.
    pub source: Option<Endpoint>,
    /// The abstraction it lives in.
    pub rbvd: Arc<Rbvd>,
}

/// Cells this far from a guide can matter to its policy, metres: the reach of its rays and its outline.
const CORRIDOR_M: f64 = 3.0;

/// The goal of a problem: where, and how near is near enough, metres.
pub(crate) type Goal = (Point, f64);

impl Leg {
    /// The leg called `id` from state `from` to state `to` along `guide`.
    pub(crate) fn new(
        (rbvd, options): (&Arc<Rbvd>, &OptionSet),
        id: LegId,
        (from, to): (StateId, StateId),
        guide: GuidePath,
        (point, radius_m): Goal,
    ) -> Self {
        let (source, target) = endpoints(options, id);
        let goal = Target::Goal { point, radius_m };
        Self {
            id,
            from,
            to,
            guide,
            target: target.map_or(goal, |id| Target::Endpoint(options.endpoint(id).clone())),
            allowed: allowed_states(id, from, to),
            source: source.map(|id| options.endpoint(id).clone()),
            rbvd: Arc::clone(rbvd),
        }
    }

    /// Returns true if a robot at `pose` has finished the leg.
    #[must_use]
    pub fn is_done(&self, pose: &Pose) -> bool {
        self.target.contains(pose.position, &self.rbvd)
    }

    /// Returns true if a robot at `pose` is where the leg may be: the complement of the second case
    /// of definition 9. A point without a state (too near to a wall) does not count as straying.
    #[must_use]
    pub fn is_allowed(&self, pose: &Pose) -> bool {
        let state = self.rbvd.state_at(pose.position);
        state.is_none_or(|state| self.allowed.contains(&state))
            || self.source.as_ref().is_some_and(|source| source.contains(pose.position, &self.rbvd))
    }

    /// The hash of all that a policy of the leg and its certificate depend on: the guide, the sets it
    /// joins, and the cells around it, by what they are and whether the leg may use them. Equal in
    /// two maps that differ elsewhere only, whatever their states are called.
    #[must_use]
    pub fn corridor(&self, grid: &OccupancyGrid) -> String {
        let frame = grid.frame();
        let numbers = |pose: &Pose| [pose.position.x, pose.position.y, pose.heading.radians()];
        let mut bytes: Vec<u8> =
            self.guide.poses().iter().flat_map(numbers).flat_map(f64::to_le_bytes).collect();
        bytes.extend(frame.resolution_m.to_le_bytes());
        let center = self.target.center();
        bytes.extend([center.x, center.y].into_iter().flat_map(f64::to_le_bytes));
        for cell in self.cells_around(frame) {
            let point = frame.center(cell);
            let is_source = self.source.as_ref().is_some_and(|source| source.contains(point, &self.rbvd));
            let allowed = self.rbvd.state_of(cell).map_or(2, |state| u8::from(self.allowed.contains(&state)));
            let target = u8::from(self.target.contains(point, &self.rbvd));
            bytes.push(grid.get(cell) as u8 | allowed << 2 | u8::from(is_source) << 4 | target << 5);
        }
        crate::files::hash(&bytes)
    }

    /// The cells of the rectangle around the guide, [`CORRIDOR_M`] wider on each side.
    fn cells_around(&self, frame: &GridFrame) -> impl Iterator<Item = Cell> {
        let reach = CORRIDOR_M / frame.resolution_m;
        let (mut low, mut high) = ([f64::INFINITY; 2], [f64::NEG_INFINITY; 2]);
        for pose in self.guide.poses() {
            let at = frame.to_grid(pose.position);
            low = [low[0].min(at.x - reach), low[1].min(at.y - reach)];
            high = [high[0].max(at.x + reach), high[1].max(at.y + reach)];
        }
        // Negative numbers become 0.
        let range = |axis: usize, size: usize| low[axis] as usize..(high[axis].ceil() as usize).min(size);
        let cols = range(0, frame.width);
        range(1, frame.height).flat_map(move |row| cols.clone().map(move |col| Cell::new(col, row)))
    }

    /// Actions after which the leg counts as failed: ten, and three times what half speed needs.
    #[must_use]
    pub fn horizon_actions(&self, slowest_reach_m: f64) -> u32 {
        10 + (3.0 * self.guide.length_m() / slowest_reach_m).ceil() as u32
    }
}

/// The initiation and termination sets of the leg called `id`, where they are endpoints.
pub(crate) fn endpoints(options: &OptionSet, id: LegId) -> (Option<EndpointId>, Option<EndpointId>) {
    match id {
        LegId::First(endpoint) => (None, Some(EndpointId(endpoint))),
        LegId::Option(id) => {
            options.get(id).map_or((None, None), |s| (Some(s.initiation), Some(s.termination)))
        }
        LegId::Last(endpoint, _) => (Some(EndpointId(endpoint)), None),
        LegId::Direct => (None, None),
    }
}

/// The states that the leg called `id` may use from end to end.
pub(crate) fn allowed_states(id: LegId, from: StateId, to: StateId) -> Vec<StateId> {
    match id {
        LegId::Option(id) => AllowedRule::default().states(id).collect(),
        LegId::First(_) | LegId::Last(..) | LegId::Direct => vec![from, to],
    }
}

#[cfg(test)]
mod tests {
    use sharp_options::OptionKind;
    use sharp_space::Heading;

    use super::*;
    use crate::drawn::{HALL, along, legs, world};

    fn names(kind: OptionKind) -> Vec<String> {
        let (workspace, abstraction) = world(HALL, kind);
        legs(&workspace, &abstraction, along()).iter().map(|leg| leg.id.to_string()).collect()
    }

    #[test]
    fn a_plan_has_a_first_leg_options_and_a_last_leg() {
        assert_eq!(names(OptionKind::Centroid), ["first:0", "c:0-1", "c:1-2", "last:2"]);
        assert_eq!(names(OptionKind::Interface), ["first:0", "i:0-1-2", "last:1"]);
    }

    #[test]
    fn each_leg_begins_where_the_one_before_it_ends() {
        for kind in [OptionKind::Centroid, OptionKind::Interface] {
            let (workspace, abstraction) = world(HALL, kind);
            let legs = legs(&workspace, &abstraction, along());
            for pair in legs.windows(2) {
                let name = format!("{} to {}", pair[0].id, pair[1].id);
                let source = pair[1].source.clone().map(Target::Endpoint);
                assert_eq!(source.as_ref(), Some(&pair[0].target), "{name}: β is not I");
                let arrived = Pose::at(pair[0].target.center(), Heading::default());
                assert!(pair[0].is_done(&arrived), "{name}: the centre of β is in β");
                assert!(pair[1].is_allowed(&arrived), "{name}: arriving is straying");
                assert!(!pair[1].is_done(&arrived), "{name}: over before it begins");
            }
            let last = &legs[legs.len() - 1];
            assert!(last.source.is_some() && last.is_done(&along().goal), "the goal is the last target");
            assert!(!last.is_done(&Pose::new(8.5, 2.2, 0.0)), "half a metre before the goal is not there");
        }
    }

    #[test]
    fn leaving_both_states_is_straying_and_standing_at_a_wall_is_not() {
        let (workspace, abstraction) = world(HALL, OptionKind::Centroid);
        let legs = legs(&workspace, &abstraction, along());
        let option = legs.iter().find(|leg| leg.id.role() == Role::Option).expect("two options");
        assert_eq!(option.allowed, [StateId(0), StateId(1)], "i and j");
        for (x, y, allowed) in [(1.0, 2.0, true), (5.0, 3.0, true), (9.0, 2.0, false), (5.0, 0.1, true)] {
            assert_eq!(option.is_allowed(&Pose::new(x, y, 0.0)), allowed, "at ({x}, {y})");
        }
    }

    #[test]
    fn the_horizon_grows_with_the_guide() {
        let (workspace, abstraction) = world(HALL, OptionKind::Centroid);
        for leg in legs(&workspace, &abstraction, along()) {
            let beyond = f64::from(leg.horizon_actions(0.15)) - leg.guide.length_m() / 0.05;
            assert!((9.99..11.01).contains(&beyond), "{}: {beyond} actions beyond three times", leg.id);
        }
    }
}
