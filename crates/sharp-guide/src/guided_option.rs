//! Guided options (definition 7): what is learnt, estimated and run.
//!
//! G = ⟨I, β, 𝒢, R⟩: initiation set, termination set, guide path and pseudo-reward. The reward is chosen by the
//! learner ([`Reward`](crate::Reward)); everything else is a [`GuidedOption`]. The two special policies `π_0` and
//! `π_{n+1}` of a plan are guided options as well, with a configuration in place of one of the sets.

use std::fmt;
use std::sync::Arc;

use serde::{Deserialize, Serialize};
use sharp_options::{AllowedRule, Endpoint, EndpointId, OptionId, OptionSet};
use sharp_rbvd::{StateAbstraction, StateId};
use sharp_space::{Cell, GridFrame, OccupancyGrid, Point, Pose};

use crate::departure::Departure;
use crate::goal::Goal;
use crate::path::GuidePath;
use crate::reward::Place;

/// What a guided option is for in a plan.
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

/// Names a guided option within a plan.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub enum LegId {
    /// From the initial configuration to the endpoint with this index.
    First(u32),
    /// An option.
    Option(OptionId),
    /// From the endpoint with this index, where the robot is in the given state or about to enter it, to the goal
    /// configuration.
    Last(u32, StateId),
    /// From the initial to the goal configuration without any option.
    Direct,
}

impl LegId {
    /// What it is for.
    #[must_use]
    pub const fn role(&self) -> Role {
        match self {
            Self::First(_) | Self::Direct => Role::First,
            Self::Option(_) => Role::Option,
            Self::Last(..) => Role::Last,
        }
    }

    /// The initiation and termination sets, where they are endpoints of `options`.
    #[must_use]
    pub fn endpoints(self, options: &OptionSet) -> (Option<EndpointId>, Option<EndpointId>) {
        match self {
            Self::First(endpoint) => (None, Some(EndpointId(endpoint))),
            Self::Option(id) => {
                options.get(id).map_or((None, None), |s| (Some(s.initiation), Some(s.termination)))
            }
            Self::Last(endpoint, _) => (Some(EndpointId(endpoint)), None),
            Self::Direct => (None, None),
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

/// Where a guided option ends.
#[derive(Clone, Debug, PartialEq)]
pub enum Target {
    /// An endpoint region β (definitions 3 and 5).
    Endpoint(Endpoint),
    /// The goal configuration.
    Goal(Goal),
}

impl Target {
    /// Returns true if `point` is at the place where it ends.
    #[must_use]
    pub fn contains(&self, point: Point, states: &dyn StateAbstraction) -> bool {
        match self {
            Self::Endpoint(endpoint) => endpoint.contains(point, states),
            Self::Goal(goal) => goal.contains(point),
        }
    }

    /// The endpoint, unless it is the goal.
    #[must_use]
    pub const fn endpoint(&self) -> Option<&Endpoint> {
        match self {
            Self::Endpoint(endpoint) => Some(endpoint),
            Self::Goal(_) => None,
        }
    }

    /// The goal, unless it is an endpoint.
    #[must_use]
    pub const fn goal(&self) -> Option<&Goal> {
        match self {
            Self::Endpoint(_) => None,
            Self::Goal(goal) => Some(goal),
        }
    }

    /// Its centre.
    #[must_use]
    pub const fn center(&self) -> Point {
        match self {
            Self::Endpoint(endpoint) => endpoint.center,
            Self::Goal(goal) => goal.point,
        }
    }
}

/// The abstraction that guided options live in: states, options, and where an option may go.
#[derive(Clone, Debug)]
pub struct OptionSpace {
    /// The abstract states, hence α.
    pub states: Arc<dyn StateAbstraction>,
    /// The options O.
    pub options: Arc<OptionSet>,
    /// Which states an option may use besides its endpoints.
    pub rule: AllowedRule,
}

impl OptionSpace {
    /// The states that the option called `id`, from state `from` to state `to`, may use from end to end.
    #[must_use]
    pub fn allowed_states(&self, id: LegId, from: StateId, to: StateId) -> Vec<StateId> {
        match id {
            LegId::Option(option) => self
                .options
                .get(option)
                .map_or_else(Vec::new, |spec| self.options.allowed_states(spec, self.rule).collect()),
            LegId::First(_) | LegId::Last(..) => vec![from, to],
            LegId::Direct if from == to && self.rule == AllowedRule::Paper => vec![from],
            LegId::Direct => self.states.states().collect(),
        }
    }
}

/// An option with its guide: what a policy is learnt for and runs in.
#[derive(Clone, Debug)]
pub struct GuidedOption {
    /// Its name.
    pub id: LegId,
    /// The state it leaves.
    pub from: StateId,
    /// The state it ends in.
    pub to: StateId,
    /// The guide path 𝒢 from the centre of its initiation set to that of its termination set.
    pub guide: GuidePath,
    /// What comes before the guide; nothing, unless the start of a plan is a tight place.
    pub departure: Departure,
    /// Its termination set β.
    pub target: Target,
    /// Whether it ends as well where the robot passes its termination set ([`GuidedOption::is_passed`]). So do the options
    /// of a joined plan, whose guides lead on into one another.
    pub ends_in_passing: bool,
    /// The states it may use without straying.
    pub allowed: Vec<StateId>,
    /// Its initiation set I, where it may be as well; `None` for one from a configuration.
    pub source: Option<Endpoint>,
    /// The abstract states.
    pub states: Arc<dyn StateAbstraction>,
}

/// Cells this far from a guide can matter to its policy, metres: the reach of its rays and its outline.
const CORRIDOR_M: f64 = 3.0;
/// So little of the guide is none, metres: sums of lengths are rounded.
const AT_END_M: f64 = 1e-9;
/// A termination set is passed by at most so many times its radius.
const PASSING_FACTOR: f64 = 3.0;
/// Actions that every option may take, however short.
const HORIZON_MIN_ACTIONS: u32 = 10;
/// An option may take so many times the actions that the slowest policy needs.
const HORIZON_FACTOR: f64 = 3.0;
/// Way that the slowest policy covers in an action, metres.
const SLOWEST_REACH_M: f64 = 0.15;

impl GuidedOption {
    /// The option called `id` from state `from` to state `to` along `guide`.
    #[must_use]
    pub fn new(
        space: &OptionSpace,
        id: LegId,
        (from, to): (StateId, StateId),
        guide: GuidePath,
        goal: Goal,
    ) -> Self {
        let endpoint = |id: EndpointId| space.options.endpoint(id).clone();
        let (source, target) = id.endpoints(&space.options);
        Self {
            id,
            from,
            to,
            guide,
            departure: Departure::default(),
            target: target.map_or(Target::Goal(goal), |id| Target::Endpoint(endpoint(id))),
            ends_in_passing: false,
            allowed: space.allowed_states(id, from, to),
            source: source.map(endpoint),
            states: Arc::clone(&space.states),
        }
    }

    /// The same option, left by `departure`.
    #[must_use]
    pub fn with_departure(self, departure: Departure) -> Self {
        Self { departure, ..self }
    }

    /// Returns true if a robot at `pose` has finished the option: x ∈ β.
    #[must_use]
    pub fn is_done(&self, pose: &Pose) -> bool {
        match &self.target {
            Target::Endpoint(endpoint) => endpoint.contains(pose.position, &*self.states),
            Target::Goal(goal) => goal.is_reached(pose),
        }
    }

    /// Returns true if a robot at `pose`, with `remaining_m` of the guide left, has passed the termination set beside it,
    /// where the option `next` may begin as well: the guide is behind it, and it is in a state that `next` may use.
    #[must_use]
    pub fn is_passed(&self, pose: &Pose, remaining_m: f64, next: &Self) -> bool {
        let is_near = || {
            let Target::Endpoint(endpoint) = &self.target else { return false };
            (pose.position - endpoint.center).norm() < PASSING_FACTOR * endpoint.radius_m
        };
        self.ends_in_passing && remaining_m < AT_END_M && is_near() && next.is_allowed(pose)
    }

    /// Returns true if a robot at `pose` is where the option may be: the complement of the second case of
    /// definition 9. A point without a state (too near to a wall) does not count as straying.
    #[must_use]
    pub fn is_allowed(&self, pose: &Pose) -> bool {
        let state = self.states.state_at(pose.position);
        state.is_none_or(|state| self.allowed.contains(&state))
            || self.source.as_ref().is_some_and(|source| source.contains(pose.position, &*self.states))
    }

    /// Which case of definition 9 holds at `pose`.
    #[must_use]
    pub fn place(&self, pose: &Pose) -> Place {
        if self.is_done(pose) {
            Place::Termination
        } else if self.is_allowed(pose) {
            Place::Allowed
        } else {
            Place::Astray
        }
    }

    /// All that a policy of the option and its estimates depend on, as bytes to hash: the guide, the sets it
    /// joins, and the cells around it, by what they are and whether the option may use them. Equal in two maps
    /// that differ elsewhere only, whatever their states are called.
    #[must_use]
    pub fn corridor(&self, grid: &OccupancyGrid) -> Vec<u8> {
        let frame = grid.frame();
        let numbers = |pose: &Pose| [pose.position.x, pose.position.y, pose.heading.radians()];
        let mut bytes: Vec<u8> =
            self.guide.poses().iter().flat_map(numbers).flat_map(f64::to_le_bytes).collect();
        bytes.extend(frame.resolution_m.to_le_bytes());
        let center = self.target.center();
        bytes.extend([center.x, center.y].into_iter().flat_map(f64::to_le_bytes));
        let states = &*self.states;
        for cell in self.cells_around(frame) {
            let point = frame.center(cell);
            let is_source = self.source.as_ref().is_some_and(|source| source.contains(point, states));
            let allowed = states.state_of(cell).map_or(2, |state| u8::from(self.allowed.contains(&state)));
            let target = u8::from(self.target.contains(point, states));
            bytes.push(grid.get(cell) as u8 | allowed << 2 | u8::from(is_source) << 4 | target << 5);
        }
        // Only few options have these; the hashes of all others stay as they were.
        if let Some((heading, tolerance_rad)) = self.target.goal().and_then(|goal| goal.heading) {
            bytes.extend([heading.radians(), tolerance_rad].into_iter().flat_map(f64::to_le_bytes));
        }
        let Departure { back_off_m, careful_m } = self.departure;
        if !self.departure.is_none() {
            bytes.extend([back_off_m, careful_m].into_iter().flat_map(f64::to_le_bytes));
        }
        bytes
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

    /// Actions after which the option counts as failed: ten, and three times what the slowest policy needs.
    #[must_use]
    pub fn horizon_actions(&self) -> u32 {
        HORIZON_MIN_ACTIONS + (HORIZON_FACTOR * self.guide.length_m() / SLOWEST_REACH_M).ceil() as u32
    }
}
