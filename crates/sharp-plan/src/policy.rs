//! Policies of options: which waypoint comes next (π : X → X of the paper).
//!
//! The base of every policy is a [`Follower`] that looks ahead along the guide path. A learnt policy
//! either corrects the follower in the guide's own frame ([`Correction`], the default) or proposes
//! absolute waypoints from the absolute configuration ([`Form::Absolute`], the paper's).

use serde::{Deserialize, Serialize};
use sharp_guide::GuidePath;
use sharp_rl::{Actor, ActorScratch};
use sharp_sim::RobotModel;
use sharp_space::{Heading, Point, Pose, Vector};

use crate::percept::{Percept, Tracker, Workspace, absolute_observation, guide_observation};

/// Look-ahead pursuit of a guide path.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Follower {
    /// How far along the guide the robot looks, metres.
    pub look_ahead_m: f64,
    /// Distance of the waypoint from the robot, metres; with one waypoint each 0.5 s also the speed.
    pub reach_m: f64,
}

/// A waypoint as the robot sees it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PolarWaypoint {
    /// Distance, metres.
    pub reach_m: f64,
    /// Direction against the robot's heading, radians, left positive.
    pub bearing_rad: f64,
}

impl PolarWaypoint {
    /// The waypoint in the world of a robot at `pose`.
    #[must_use]
    pub fn to_world(self, pose: &Pose) -> Point {
        let heading = Heading::new(pose.heading.radians() + self.bearing_rad);
        pose.position + heading.unit() * self.reach_m
    }

    /// How a robot at `pose` sees the world point `point`.
    #[must_use]
    pub fn of(pose: &Pose, point: Point) -> Self {
        let local = pose.to_local(point);
        Self { reach_m: local.norm(), bearing_rad: local.y.atan2(local.x) }
    }
}

impl Follower {
    /// The followers worth trying for `robot`, fastest first (see `docs/algorithms/options.md`).
    #[must_use]
    pub fn candidates(robot: &RobotModel) -> Vec<Self> {
        let fast = robot.waypoint_reach_m;
        let slow = [1.0, 0.7, 0.5, 0.35].map(|share| share * fast);
        let look_ahead = if robot.can_turn_in_place() { [0.8, 0.5] } else { [0.8, 0.6] };
        slow.iter()
            .flat_map(|&reach_m| look_ahead.map(|look_ahead_m| Self { look_ahead_m, reach_m }))
            .collect()
    }

    /// The follower for legs that were never tried: slow, looking near.
    #[must_use]
    pub fn cautious(robot: &RobotModel) -> Self {
        Self { look_ahead_m: 0.6, reach_m: 0.5 * robot.waypoint_reach_m }
    }

    /// The next waypoint for a robot that has come `tracker.arc_m` along `view.guide`.
    #[must_use]
    pub fn waypoint(&self, pose: &Pose, arc_m: f64, view: &GuideView<'_>) -> PolarWaypoint {
        let seen = PolarWaypoint::of(pose, view.ahead(arc_m + self.look_ahead_m).position);
        PolarWaypoint { reach_m: seen.reach_m.min(self.reach_m), ..seen }
    }
}

/// A guide path and, where it is known, the one that follows it.
#[derive(Clone, Copy, Debug)]
pub struct GuideView<'a> {
    /// The guide of the option that is running.
    pub guide: &'a GuidePath,
    /// The guide of the option after it: looking ahead runs on into it.
    pub next: Option<&'a GuidePath>,
}

impl GuideView<'_> {
    /// The guide's pose `arc_m` metres from its start; past the end, the next guide's pose or the
    /// straight continuation.
    #[must_use]
    pub fn ahead(&self, arc_m: f64) -> Pose {
        let beyond_m = arc_m - self.guide.length_m();
        if beyond_m <= 0.0 {
            return self.guide.pose_at(arc_m);
        }
        match self.next {
            Some(next) if next.length_m() >= beyond_m => next.pose_at(beyond_m),
            Some(next) => extend(next.pose_at(next.length_m()), beyond_m - next.length_m()),
            None => extend(self.guide.pose_at(self.guide.length_m()), beyond_m),
        }
    }
}

fn extend(pose: Pose, by_m: f64) -> Pose {
    Pose::at(pose.to_world(Vector::new(by_m, 0.0)), pose.heading)
}

/// How far a learnt action may move the follower's waypoint.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Correction {
    /// Change of the distance at full action, metres.
    pub reach_m: f64,
    /// Change of the direction at full action, radians.
    pub bearing_rad: f64,
}

/// What a learnt policy sees and what its action means.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub enum Form {
    /// The guide's frame; the action corrects a follower.
    Guide {
        /// The follower that is corrected.
        base: Follower,
        /// What a full action changes.
        correction: Correction,
    },
    /// The paper's: absolute configuration and vector to the nearest guide point; the action is the
    /// displacement to the next point in the world frame, each component in ±`reach_m`.
    Absolute {
        /// Largest displacement along x and along y, metres.
        reach_m: f64,
    },
}

impl Form {
    /// Length of the observation.
    #[must_use]
    pub const fn observation_len(&self) -> usize {
        match self {
            Self::Guide { .. } => crate::percept::GUIDE_OBSERVATION_LEN,
            Self::Absolute { .. } => crate::percept::ABSOLUTE_OBSERVATION_LEN,
        }
    }

    /// Writes what the policy sees into `observation`.
    pub fn observe(
        &self,
        workspace: &Workspace,
        percept: &Percept,
        tracker: &Tracker,
        view: &GuideView<'_>,
        observation: &mut [f32],
    ) {
        match self {
            Self::Guide { .. } => guide_observation(workspace, percept, tracker, view, observation),
            Self::Absolute { .. } => absolute_observation(percept, view.guide, observation),
        }
    }

    /// The waypoint that `action` ∈ [−1, 1]² means.
    #[must_use]
    pub fn waypoint(
        &self,
        robot: &RobotModel,
        pose: &Pose,
        arc_m: f64,
        view: &GuideView<'_>,
        action: &[f32],
    ) -> PolarWaypoint {
        let (a, b) = (f64::from(action[0]), f64::from(action[1]));
        match self {
            Self::Guide { base, correction } => {
                let wanted = base.waypoint(pose, arc_m, view);
                let least = 0.1 * robot.waypoint_reach_m;
                PolarWaypoint {
                    reach_m: (wanted.reach_m + a * correction.reach_m).clamp(least, robot.waypoint_reach_m),
                    bearing_rad: wanted.bearing_rad + b * correction.bearing_rad,
                }
            }
            Self::Absolute { reach_m } => {
                let seen = PolarWaypoint::of(pose, pose.position + Vector::new(a, b) * *reach_m);
                PolarWaypoint { reach_m: seen.reach_m.min(robot.waypoint_reach_m), ..seen }
            }
        }
    }
}

/// The policy π_o of an option.
#[derive(Clone, Debug)]
pub enum OptionPolicy {
    /// A certified follower.
    Follower(Follower),
    /// A policy learnt by soft actor-critic.
    Learnt {
        /// What it sees and what its action means.
        form: Form,
        /// The network.
        actor: Box<Actor>,
    },
}

/// Memory that decisions write into, so that none is allocated.
#[derive(Debug, Default)]
pub struct DecisionScratch {
    observation: Vec<f32>,
    action: [f32; 2],
    actor: ActorScratch,
}

impl OptionPolicy {
    /// The next waypoint; deterministic.
    pub fn decide(
        &self,
        workspace: &Workspace,
        percept: &Percept,
        tracker: &Tracker,
        view: &GuideView<'_>,
        scratch: &mut DecisionScratch,
    ) -> PolarWaypoint {
        match self {
            Self::Follower(follower) => follower.waypoint(&percept.state.pose, tracker.arc_m, view),
            Self::Learnt { form, actor } => {
                scratch.observation.resize(form.observation_len(), 0.0);
                form.observe(workspace, percept, tracker, view, &mut scratch.observation);
                actor.act_mean(&scratch.observation, &mut scratch.actor, &mut scratch.action);
                form.waypoint(&workspace.robot, &percept.state.pose, tracker.arc_m, view, &scratch.action)
            }
        }
    }
}
