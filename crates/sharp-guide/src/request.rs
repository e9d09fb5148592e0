//! What a guide is wanted for, and why there may be none.

use sharp_options::Endpoint;
use sharp_rbvd::StateId;
use sharp_space::{Cell, Heading, Point, Stream};
use thiserror::Error;

use crate::crossing::crossing_heading;
use crate::guided_option::{LegId, OptionSpace};
use crate::inflate::GuideRobot;
use crate::path::GuidePath;
use crate::planner::GuidePlanner;

/// Options whose ends are further apart than this cross their interfaces in the direction with most clearance,
/// metres. On a shorter one two crossing directions would leave no room for the way between them.
const CROSSING_M: f64 = 1.2;

/// One end of a guide.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GuideEnd {
    /// The centre of the endpoint.
    pub position: Point,
    /// At the start, how the robot stands; at the goal, the direction in which it should arrive:
    /// kept where there is room for it.
    pub heading: Option<Heading>,
}

/// What a guide is wanted for.
#[derive(Clone, Copy)]
pub struct GuideRequest<'a> {
    /// The centre of the initiation set.
    pub start: GuideEnd,
    /// The centre of the termination set.
    pub goal: GuideEnd,
    /// The cells of the states that the option may use.
    pub allowed: &'a dyn Fn(Cell) -> bool,
}

impl std::fmt::Debug for GuideRequest<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("GuideRequest")
            .field("start", &self.start)
            .field("goal", &self.goal)
            .finish_non_exhaustive()
    }
}

/// An option before it has a guide.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnguidedOption {
    /// Its name.
    pub id: LegId,
    /// The state it leaves.
    pub from: StateId,
    /// The state it ends in.
    pub to: StateId,
    /// Centre of the initiation set, or the initial configuration's position.
    pub start: Point,
    /// Centre of the termination set, or the goal configuration's position.
    pub end: Point,
    /// The robot's heading, for an option from the initial configuration.
    pub heading: Option<Heading>,
    /// The direction in which it should arrive at a goal that asks for one.
    pub goal_heading: Option<Heading>,
}

impl UnguidedOption {
    /// Plans the guide of the option inside the states that `space` lets it use.
    ///
    /// # Errors
    /// Says why there is no path.
    pub fn plan_guide(
        &self,
        space: &OptionSpace,
        robot: &GuideRobot<'_>,
        planner: &dyn GuidePlanner,
        rng: &mut Stream,
    ) -> Result<GuidePath, NoGuide> {
        let (states, frame) = (&*space.states, space.states.frame());
        let (source, target) = self.id.endpoints(&space.options);
        let (source, target) =
            (source.map(|id| space.options.endpoint(id)), target.map(|id| space.options.endpoint(id)));
        let usable = space.allowed_states(self.id, self.from, self.to);
        let near = |endpoint: Option<&Endpoint>, cell: Cell| {
            endpoint.is_some_and(|endpoint| endpoint.contains(frame.center(cell), states))
        };
        let allowed = |cell: Cell| {
            states.state_of(cell).is_some_and(|state| usable.contains(&state))
                || near(source, cell)
                || near(target, cell)
        };
        let crosses = (self.end - self.start).norm() > CROSSING_M;
        let crossing = |endpoint: Option<&Endpoint>, into| {
            endpoint.filter(|_| crosses).and_then(|end| crossing_heading(robot.geometry, end, into))
        };
        let start_heading = match self.id {
            LegId::First(_) | LegId::Direct => self.heading,
            LegId::Option(option) => crossing(source, option.through().unwrap_or(option.to())),
            LegId::Last(_, state) => crossing(source, state),
        };
        let request = GuideRequest {
            start: GuideEnd { position: self.start, heading: start_heading },
            goal: GuideEnd {
                position: self.end,
                heading: self.goal_heading.or_else(|| crossing(target, self.to)),
            },
            allowed: &allowed,
        };
        planner.plan(&request, robot, rng)
    }
}

/// Why there is no guide.
#[derive(Clone, Debug, Error, PartialEq)]
#[non_exhaustive]
pub enum NoGuide {
    /// No allowed cell near the start has room for the robot.
    #[error("start ({:.2}, {:.2}) has no allowed cell with room for the robot near it", .0.x, .0.y)]
    Start(Point),
    /// No allowed cell near the goal has room for the robot.
    #[error("goal ({:.2}, {:.2}) has no allowed cell with room for the robot near it", .0.x, .0.y)]
    Goal(Point),
    /// Start and goal are the same place.
    #[error("start and goal are both at ({:.2}, {:.2})", .0.x, .0.y)]
    NoLength(Point),
    /// The allowed cells do not join start and goal.
    #[error("no way that the robot can drive lies inside the states that it may use")]
    Unreachable,
    /// The best path found has a place where the outline touches an obstacle.
    #[error("the robot's outline does not fit at ({:.2}, {:.2})", .0.x, .0.y)]
    Footprint(Point),
    /// The best path found has a bend that the robot cannot drive.
    #[error("the bend at ({:.2}, {:.2}) is too sharp for the robot", .0.x, .0.y)]
    Bend(Point),
    /// The best path found leaves the allowed cells.
    #[error("the path leaves the allowed cells at ({:.2}, {:.2})", .0.x, .0.y)]
    Astray(Point),
    /// The robot cannot get from its heading at the start onto the path.
    #[error("the robot cannot turn onto the path at ({:.2}, {:.2})", .0.x, .0.y)]
    LeadIn(Point),
    /// The sampling planner found nothing within its budget.
    #[error("the sampling planner found no path in {iterations} samples")]
    Exhausted {
        /// Samples drawn.
        iterations: usize,
    },
}

impl NoGuide {
    /// Whether a robot with a safety margin need not search where the robot itself failed so: it finds no way, or cannot turn
    /// onto it.
    pub(crate) const fn is_hopeless(&self) -> bool {
        matches!(self, Self::Start(_) | Self::Goal(_) | Self::Unreachable | Self::LeadIn(_))
    }

    /// Whether a way was found that fails more than `reach_m` from `place`: beginning otherwise at `place` would not help.
    #[must_use]
    pub fn is_beyond(&self, place: Point, reach_m: f64) -> bool {
        match self {
            Self::Footprint(at) | Self::Bend(at) | Self::Astray(at) => (at - place).norm() > reach_m,
            _ => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_what_fails_at_a_place_far_away_is_beyond() {
        let (here, there) = (Point::new(1.0, 1.0), Point::new(4.0, 5.0));
        for reason in [NoGuide::Footprint(there), NoGuide::Bend(there), NoGuide::Astray(there)] {
            let is_beyond = [4.9, 5.0, 5.1].map(|reach_m| reason.is_beyond(here, reach_m));
            assert_eq!(is_beyond, [true, false, false], "{reason}: five metres away");
        }
        for reason in [NoGuide::LeadIn(there), NoGuide::Unreachable, NoGuide::Exhausted { iterations: 9 }] {
            assert!(!reason.is_beyond(here, 1.0), "{reason}: says nothing of the place");
        }
    }
}
