//! A path that the robot can drive from end to end, and keeping to it.
//!
//! The ridge planner of `sharp-guide` draws the path over the whole free space and certifies outline
//! and bends; where it cannot, hybrid A* searches.

use sharp_guide::{GuideEnd, GuidePath, GuideRequest, GuideSettings, plan_guide};
use sharp_motion::{HybridSettings, Path, Steering, hybrid_astar};
use sharp_sim::RobotState;
use sharp_space::{Heading, Point, Pose, Seed};

use crate::baseline::{Readiness, Situation, nominal_time_s};
use crate::pace::SpeedRule;
use crate::percept::{Tracker, Workspace};
use crate::planner::Query;
use crate::spare::Spare;

/// A robot further off its path than this gets a new one, metres.
const OFF_ROUTE_M: f64 = 0.5;
/// Actions over which standing still is judged.
const STILL_ACTIONS: u32 = 6;
/// A robot that moved less than this and turned less than [`STILL_TURN_RAD`] stands still, metres.
const STILL_M: f64 = 0.15;
const STILL_TURN_RAD: f64 = 0.3;
/// Actions between two plans: what a new path needs to show its worth.
const PATIENCE_ACTIONS: u32 = 6;

/// Plans routes for one robot in one map.
#[derive(Clone, Debug)]
pub struct RoutePlanner<'a> {
    workspace: &'a Workspace,
}

impl<'a> RoutePlanner<'a> {
    /// A planner for the robot and the map of `workspace`.
    #[must_use]
    pub fn new(workspace: &'a Workspace) -> Self {
        Self { workspace }
    }

    /// A drivable path from `query`'s start to its goal's position, or `None` where there is none.
    #[must_use]
    pub fn plan(&self, query: &Query) -> Option<GuidePath> {
        let goal_radius_m = 0.5 * self.workspace.robot.goal_tolerance_m;
        self.attempts(query.start)
            .find_map(|spare| ridge(spare, query).or_else(|| searched(spare, query, goal_radius_m)))
    }

    /// What a robot at `start` has the room to spare for, the most first.
    pub(crate) fn attempts(&self, start: Pose) -> impl Iterator<Item = &Spare> {
        self.workspace.spares_at(Some(start))
    }
}

/// Along the ridge of clearance.
fn ridge(spare: &Spare, query: &Query) -> Option<GuidePath> {
    let request = GuideRequest {
        start: GuideEnd { position: query.start.position, heading: Some(query.start.heading) },
        goal: GuideEnd { position: query.goal.position, heading: None },
        allowed: &|_| true,
    };
    // No sampling: hybrid A* finds shorter paths, and finds them always.
    let unused = &mut Seed(0).stream("route", 0);
    plan_guide(&request, &spare.checker, &spare.steering, &GuideSettings::default().unsampled(), unused).ok()
}

/// By hybrid A*.
fn searched(spare: &Spare, query: &Query, goal_radius_m: f64) -> Option<GuidePath> {
    let settings = HybridSettings { goal_radius_m, ..HybridSettings::default() };
    let query = sharp_motion::MotionQuery { start: query.start, goal: query.goal };
    let path = hybrid_astar(&query, &spare.checker, &spare.steering, &settings).path()?;
    as_guide(&path, &spare.steering)
}

/// The path as a guide: a car's with its headings; otherwise the corners at which the robot turns in
/// place stay sharp, and headings follow the direction of travel.
fn as_guide(path: &Path, steering: &Steering) -> Option<GuidePath> {
    let spacing_m = GuideSettings::default().spacing_m;
    if matches!(steering, Steering::Dubins { .. }) {
        return GuidePath::new(path.resample(0.99 * spacing_m).poses().to_vec(), spacing_m).ok();
    }
    let mut positions: Vec<Point> = path.poses().iter().map(|pose| pose.position).collect();
    positions.dedup_by(|a, b| (*a - *b).norm() < 1e-9);
    let last = positions.len() - 1;
    let tangent = |i: usize| Heading::of(positions[(i + 1).min(last)] - positions[i.min(last.max(1) - 1)]);
    let poses = (0..=last).map(|i| Pose::at(positions[i], tangent(i))).collect();
    GuidePath::new(poses, spacing_m).ok()
}

/// A robot on its route, which is planned anew when the robot leaves it or stands still.
#[derive(Debug)]
pub(crate) struct OnRoute<'a> {
    planner: &'a RoutePlanner<'a>,
    query: Query,
    pub(crate) route: GuidePath,
    speed: SpeedRule,
    /// How freely the robot may drive along the route.
    ease: Vec<f64>,
    pub(crate) tracker: Tracker,
    /// Where the robot last moved, and the actions since.
    anchor: (Pose, u32),
    /// Actions since the last plan; `None` before the first decision.
    actions: Option<u32>,
}

impl<'a> OnRoute<'a> {
    pub(crate) fn new(
        planner: &'a RoutePlanner<'a>,
        query: Query,
        route: GuidePath,
        speed: SpeedRule,
    ) -> Self {
        let tracker = Tracker::start(&route, &query.start);
        let ease = speed.along(planner.workspace, &route);
        Self { planner, query, route, speed, ease, tracker, anchor: (query.start, 0), actions: None }
    }

    /// The route, and how freely the robot may drive along it.
    pub(crate) fn paced(&self) -> (&GuidePath, &[f64]) {
        (&self.route, &self.ease)
    }

    /// Projects the robot onto its route; a new one is planned from where it is if it has left it.
    pub(crate) fn prepare(&mut self, situation: &Situation) -> Readiness {
        let Situation { state, bumped } = situation;
        let Some(actions) = self.actions else {
            self.actions = Some(0);
            return self.planned();
        };
        self.tracker.update(&self.route, &state.pose);
        self.watch(state);
        self.actions = Some(actions + 1);
        let is_off = self.tracker.cross_track_m.abs() > OFF_ROUTE_M
            || self.tracker.remaining_m < 1e-6
            || self.anchor.1 >= STILL_ACTIONS;
        if !bumped && (!is_off || actions < PATIENCE_ACTIONS) {
            return Readiness::Ready;
        }
        let query = Query { start: state.pose, ..self.query };
        match self.planner.plan(&query) {
            Some(route) => {
                self.ease = self.speed.along(self.planner.workspace, &route);
                self.route = route;
                self.tracker = Tracker::start(&self.route, &state.pose);
                (self.anchor, self.actions) = ((state.pose, 0), Some(0));
                self.planned()
            }
            // The old route may yet lead on, and the robot may come to stand better.
            None => {
                self.actions = Some(0);
                Readiness::Ready
            }
        }
    }

    fn planned(&self) -> Readiness {
        Readiness::Planned {
            nominal_time_s: nominal_time_s(self.planner.workspace, self.route.length_m(), 0.0),
        }
    }

    fn watch(&mut self, state: &RobotState) {
        let (anchor, since) = self.anchor;
        let turned = anchor.heading.turn_to(state.pose.heading).abs() > STILL_TURN_RAD;
        let moved = turned || anchor.distance_m(&state.pose) > STILL_M;
        self.anchor = if moved { (state.pose, 0) } else { (anchor, since + 1) };
    }
}
