//! Policies of options: which waypoint comes next (π : X → X of the paper).
//!
//! The base of every policy is a [`Follower`] that looks ahead along the guide path. A learnt policy
//! either corrects the follower in the guide's own frame ([`Correction`], the default) or proposes
//! absolute waypoints from the absolute configuration ([`Form::Absolute`], the paper's).

use serde::{Deserialize, Serialize};
use sharp_guide::GuidePath;
use sharp_rl::{Actor, ActorScratch};
use sharp_sim::RobotModel;
use sharp_space::{Heading, Point, Pose, Vector, trig};

use crate::pace::PacedFollower;
use crate::percept::{Expectation, Percept, Tracker, Workspace, absolute_observation, guide_observation};

/// The slowest that a learnt policy drives, as a share of the top speed: enough to turn on the spot.
const SLOWEST: f64 = 0.05;

/// Share of the pull, as it is believed so far, that followers make up for. Learnt policies feel it themselves.
const TRIM: f64 = 0.5;

/// How a follower chooses its direction.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub enum Rule {
    /// Towards the guide's point this far ahead, metres: robust, but cuts corners.
    Pursuit {
        /// How far along the guide the robot looks, metres.
        look_ahead_m: f64,
    },
    /// Along the guide's tangent a little ahead, turned back towards the guide in proportion to the
    /// distance from it. The guide was certified with the outline along its tangent, so a robot that
    /// keeps the tangent keeps the certified room.
    Field {
        /// How far ahead along the guide the tangent is taken, metres.
        look_ahead_m: f64,
        /// Distance from the guide at which the direction is turned by 45 degrees, metres.
        softness_m: f64,
    },
}

/// Follows a guide path at a constant speed.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Follower {
    /// Where to.
    pub rule: Rule,
    /// How fast, metres per second.
    pub speed_mps: f64,
}

/// A waypoint as the robot sees it.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct PolarWaypoint {
    /// Distance, metres.
    pub reach_m: f64,
    /// Direction against the robot's heading, radians, left positive.
    pub bearing_rad: f64,
    /// Speed at which it is approached, metres per second.
    pub speed_mps: f64,
}

impl PolarWaypoint {
    /// The waypoint in the world of a robot at `pose`.
    #[must_use]
    pub fn to_world(self, pose: &Pose) -> Point {
        let heading = Heading::new(pose.heading.radians() + self.bearing_rad);
        pose.position + heading.unit() * self.reach_m
    }

    /// How a robot at `pose` sees the world point `point`, approached at `speed_mps`.
    #[must_use]
    pub fn of(pose: &Pose, point: Point, speed_mps: f64) -> Self {
        let local = pose.to_local(point);
        Self { reach_m: local.norm(), bearing_rad: trig::atan2(local.y, local.x), speed_mps }
    }
}

impl Follower {
    /// The followers worth trying for `robot`, fastest first (see `docs/algorithms/planning.md`).
    #[must_use]
    pub fn candidates(robot: &RobotModel) -> Vec<Self> {
        let rules = [
            Rule::Pursuit { look_ahead_m: 0.8 },
            Rule::Pursuit { look_ahead_m: 0.5 },
            Rule::Field { look_ahead_m: 0.4, softness_m: 0.8 },
            Rule::Field { look_ahead_m: 0.25, softness_m: 0.5 },
        ];
        let speeds = [1.0, 0.7, 0.5, 0.35].map(|share| share * robot.max_speed_mps);
        speeds.into_iter().flat_map(|speed_mps| rules.map(|rule| Self { rule, speed_mps })).collect()
    }

    /// The follower for legs that were never tried: slow, looking near.
    #[must_use]
    pub fn cautious(robot: &RobotModel) -> Self {
        Self {
            rule: Rule::Field { look_ahead_m: 0.3, softness_m: 0.6 },
            speed_mps: 0.5 * robot.max_speed_mps,
        }
    }

    /// The next waypoint for a robot at `pose` whose projection onto the guide is `tracker`: always
    /// as far away as the robot allows, so that noise in the point is little noise in the direction.
    #[must_use]
    pub fn waypoint(
        &self,
        robot: &RobotModel,
        pose: &Pose,
        tracker: &Tracker,
        view: &GuideView<'_>,
    ) -> PolarWaypoint {
        let bearing_rad = match self.rule {
            Rule::Pursuit { look_ahead_m } => {
                let local = pose.to_local(view.ahead(tracker.arc_m + look_ahead_m).position);
                trig::atan2(local.y, local.x)
            }
            Rule::Field { look_ahead_m, softness_m } => {
                let tangent = view.ahead(tracker.arc_m + look_ahead_m).heading;
                let back = trig::atan2(tracker.cross_track_m, softness_m);
                pose.heading.turn_to(Heading::new(tangent.radians() - back))
            }
        };
        PolarWaypoint { reach_m: robot.waypoint_reach_m, bearing_rad, speed_mps: self.speed_mps }
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
    /// Change of the speed at full action, metres per second.
    pub speed_mps: f64,
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
        /// What the network is told.
        expectation: Expectation,
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
            Self::Guide { expectation, .. } => {
                guide_observation(workspace, percept, tracker, (view, expectation), observation);
            }
            Self::Absolute { .. } => absolute_observation(percept, view.guide, observation),
        }
    }

    /// The waypoint that `action` ∈ [−1, 1]² means.
    #[must_use]
    pub fn waypoint(
        &self,
        robot: &RobotModel,
        pose: &Pose,
        tracker: &Tracker,
        view: &GuideView<'_>,
        action: &[f32],
    ) -> PolarWaypoint {
        let (a, b) = (f64::from(action[0]), f64::from(action[1]));
        match self {
            Self::Guide { base, correction, .. } => {
                let wanted = base.waypoint(robot, pose, tracker, view);
                let speed_mps = wanted.speed_mps + a * correction.speed_mps;
                PolarWaypoint {
                    speed_mps: speed_mps.clamp(SLOWEST * robot.max_speed_mps, robot.max_speed_mps),
                    bearing_rad: wanted.bearing_rad + b * correction.bearing_rad,
                    ..wanted
                }
            }
            Self::Absolute { reach_m } => {
                let point = pose.position + Vector::new(a, b) * *reach_m;
                let seen = PolarWaypoint::of(pose, point, robot.max_speed_mps);
                PolarWaypoint { reach_m: seen.reach_m.min(robot.waypoint_reach_m), ..seen }
            }
        }
    }
}

/// The policy `π_o` of an option.
#[derive(Clone, Debug)]
pub enum OptionPolicy {
    /// A certified follower.
    Follower(Follower),
    /// A certified follower that knows haste and care.
    Paced(PacedFollower),
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
    /// Returns true if decisions depend on what is believed of the robot's slip and pull.
    pub(crate) const fn believes(&self) -> bool {
        match self {
            Self::Follower(_) | Self::Paced(_) => true,
            Self::Learnt { .. } => false,
        }
    }

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
            Self::Follower(follower) => {
                let wanted = follower.waypoint(&workspace.robot, &percept.state.pose, tracker, view);
                trimmed(workspace, percept, wanted, TRIM)
            }
            Self::Paced(paced) => {
                let wanted = paced.waypoint(workspace, &percept.state.pose, tracker, view);
                trimmed(workspace, percept, wanted, paced.trim)
            }
            Self::Learnt { form, actor } => {
                scratch.observation.resize(form.observation_len(), 0.0);
                form.observe(workspace, percept, tracker, view, &mut scratch.observation);
                actor.act_mean(&scratch.observation, &mut scratch.actor, &mut scratch.action);
                form.waypoint(&workspace.robot, &percept.state.pose, tracker, view, &scratch.action)
            }
        }
    }
}

/// `wanted`, with `share` of the pull that the robot is believed to have made up for.
fn trimmed(workspace: &Workspace, percept: &Percept, wanted: PolarWaypoint, share: f64) -> PolarWaypoint {
    percept.belief.map_or(wanted, |belief| belief.trim(&workspace.model, wanted, share).applied(wanted))
}

#[cfg(test)]
mod tests {
    use sharp_options::OptionKind;
    use sharp_sim::{NoiseModel, RobotState};

    use super::*;
    use crate::drawn::{HALL, straight, world};

    const EAST: ((f64, f64), (f64, f64)) = ((0.0, 0.0), (2.0, 0.0));

    fn husky() -> RobotModel {
        RobotModel::husky()
    }

    fn at(pose: Pose, guide: &GuidePath) -> (Pose, Tracker) {
        (pose, Tracker::start(guide, &pose))
    }

    #[test]
    fn a_robot_that_is_pulled_to_the_left_is_steered_to_the_right() {
        let guide = straight((1.0, 2.0), (9.0, 2.0));
        let view = GuideView { guide: &guide, next: None };
        let (workspace, _) = world(HALL, OptionKind::Centroid);
        let mut percept = Percept::first(RobotState::at_rest(Pose::new(2.0, 2.0, 0.0)), &NoiseModel::harsh());
        let tracker = Tracker::start(&guide, &percept.state.pose);
        let policies = [
            OptionPolicy::Follower(Follower::cautious(&husky())),
            OptionPolicy::Paced(PacedFollower::candidates(&husky())[0]),
        ];
        let bearings_rad = |percept: &Percept| {
            let decide = |policy: &OptionPolicy| {
                policy.decide(&workspace, percept, &tracker, &view, &mut DecisionScratch::default())
            };
            policies.each_ref().map(|policy| decide(policy).bearing_rad)
        };
        assert!(bearings_rad(&percept).iter().all(|rad| rad.abs() < 1e-9), "nothing is known yet");
        let command = PolarWaypoint { reach_m: 0.5, bearing_rad: 0.0, speed_mps: 0.5 };
        for _ in 0..20 {
            let percept_before = percept;
            percept = percept.next(&workspace, command, RobotState::rolling(Pose::new(2.2, 2.0, 0.15), 0.5));
            percept.state = percept_before.state;
        }
        for rad in bearings_rad(&percept) {
            assert!(rad < -0.02, "steered by {rad} against a pull of {:?}", percept.belief);
        }
    }

    #[test]
    fn waypoints_survive_the_way_to_the_world_and_back() {
        for heading in [-3.0, -1.0, 0.0, 2.5] {
            let pose = Pose::new(1.5, -2.0, heading);
            for (x, y) in [(2.0, -2.0), (1.0, 3.0), (-4.0, -2.5)] {
                let seen = PolarWaypoint::of(&pose, Point::new(x, y), 0.7);
                let back = seen.to_world(&pose);
                assert!((back - Point::new(x, y)).norm() < 1e-9, "({x}, {y}) from {heading} became {back:?}");
                assert_eq!(seen.speed_mps, 0.7, "the speed is kept");
            }
        }
    }

    #[test]
    fn looking_ahead_runs_on_into_the_next_guide_and_straight_past_the_last() {
        let (guide, next) = (straight(EAST.0, EAST.1), straight((2.0, 0.0), (2.0, 1.0)));
        let alone = GuideView { guide: &guide, next: None };
        let followed = GuideView { guide: &guide, next: Some(&next) };
        for (view, arc_m, x, y) in [
            (alone, 1.5, 1.5, 0.0),
            (alone, 3.0, 3.0, 0.0),
            (followed, 1.5, 1.5, 0.0),
            (followed, 2.5, 2.0, 0.5),
            (followed, 4.0, 2.0, 2.0),
        ] {
            let ahead = view.ahead(arc_m).position;
            assert!((ahead - Point::new(x, y)).norm() < 1e-9, "{arc_m} m ahead lies {ahead:?}");
        }
    }

    #[test]
    fn every_follower_turns_back_to_its_guide() {
        let guide = straight(EAST.0, EAST.1);
        let view = GuideView { guide: &guide, next: None };
        for follower in Follower::candidates(&husky()) {
            let bearing = |y: f64, heading: f64| {
                let (pose, tracker) = at(Pose::new(0.5, y, heading), &guide);
                let waypoint = follower.waypoint(&husky(), &pose, &tracker, &view);
                assert_eq!(waypoint.reach_m, husky().waypoint_reach_m, "{follower:?} keeps its distance");
                assert_eq!(waypoint.speed_mps, follower.speed_mps, "{follower:?} keeps its speed");
                waypoint.bearing_rad
            };
            assert!(bearing(0.0, 0.0).abs() < 1e-9, "{follower:?} swerves on the guide");
            assert!(bearing(0.3, 0.0) < -0.1, "{follower:?} leaves to the left");
            assert!(bearing(-0.3, 0.0) > 0.1, "{follower:?} leaves to the right");
            assert!(bearing(0.0, 1.0) < -0.5, "{follower:?} looks away");
        }
    }

    #[test]
    fn no_correction_is_the_follower_and_a_full_one_stays_within_its_share() {
        let guide = straight(EAST.0, EAST.1);
        let view = GuideView { guide: &guide, next: None };
        let base = Follower::cautious(&husky());
        let form = Form::Guide {
            base,
            correction: Correction { speed_mps: 0.6, bearing_rad: 0.8 },
            expectation: Expectation::default(),
        };
        let (pose, tracker) = at(Pose::new(0.5, 0.2, 0.1), &guide);
        let wanted = base.waypoint(&husky(), &pose, &tracker, &view);
        let corrected = |action: &[f32]| form.waypoint(&husky(), &pose, &tracker, &view, action);
        assert_eq!(corrected(&[0.0, 0.0]), wanted, "no correction");
        for (action, speed_mps, turn) in [([1.0, 1.0], 1.0, 0.8), ([-1.0, -1.0], 0.05, -0.8)] {
            let corrected = corrected(&action);
            assert_eq!(corrected.speed_mps, speed_mps, "the robot's limits bound {action:?}");
            assert!((corrected.bearing_rad - wanted.bearing_rad - turn).abs() < 1e-9, "{action:?}");
        }
    }

    #[test]
    fn absolute_actions_are_displacements_in_the_world() {
        let guide = straight(EAST.0, EAST.1);
        let view = GuideView { guide: &guide, next: None };
        let form = Form::Absolute { reach_m: 0.5 };
        let (pose, tracker) = at(Pose::new(0.5, 0.2, 2.0), &guide);
        for (action, x, y) in [([1.0, 0.0], 1.0, 0.2), ([0.0, -0.4], 0.5, 0.0), ([0.2, 0.2], 0.6, 0.3)] {
            let point = form.waypoint(&husky(), &pose, &tracker, &view, &action).to_world(&pose);
            assert!((point - Point::new(x, y)).norm() < 1e-6, "{action:?} leads to {point:?}");
        }
        let corner = form.waypoint(&husky(), &pose, &tracker, &view, &[1.0, 1.0]);
        assert_eq!(corner.reach_m, husky().waypoint_reach_m, "no waypoint beyond the robot's reach");
    }
}
