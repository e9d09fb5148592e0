//! A planned path and closed-loop tracking: what an engineer would use today.
//!
//! A [`PacedFollower`] steers. The route is planned anew when the robot leaves it or stands still.

use sharp_guide::GuidePath;
use sharp_sim::{NoiseModel, RobotState};

use crate::baseline::observer::Observer;
use crate::baseline::route::{OnRoute, RoutePlanner};
use crate::baseline::{Baseline, Pilot, Readiness, Situation};
use crate::pace::PacedFollower;
use crate::percept::Workspace;
use crate::planner::Query;
use crate::policy::PolarWaypoint;

/// The baseline `track`.
#[derive(Clone, Debug)]
pub struct Track<'a> {
    /// Map and robot.
    pub workspace: &'a Workspace,
    /// Plans anew on the way.
    pub planner: &'a RoutePlanner<'a>,
    /// The problem.
    pub query: Query,
    /// The path of every episode's beginning.
    pub route: GuidePath,
    /// How it is tracked.
    pub settings: PacedFollower,
    /// The noise that the robot expects.
    pub noise: NoiseModel,
}

impl Baseline for Track<'_> {
    fn pilot(&self, _episode: u64) -> Box<dyn Pilot + '_> {
        let on_route = OnRoute::new(self.planner, self.query, self.route.clone(), self.settings.speed);
        let observer = Observer::new(self.workspace, &self.noise);
        Box::new(TrackPilot { baseline: self, on_route, observer })
    }
}

#[derive(Debug)]
struct TrackPilot<'a> {
    baseline: &'a Track<'a>,
    on_route: OnRoute<'a>,
    observer: Observer,
}

impl Pilot for TrackPilot<'_> {
    fn prepare(&mut self, situation: &Situation) -> Readiness {
        self.observer.end(&situation.state, situation.bumped);
        self.on_route.prepare(situation)
    }

    fn decide(&mut self, state: &RobotState) -> PolarWaypoint {
        let (robot, settings) = (&self.baseline.workspace.robot, &self.baseline.settings);
        let wanted = settings.along(robot, &state.pose, &self.on_route.tracker, self.on_route.paced());
        let command = self.observer.trim(wanted, settings.trim).applied(wanted);
        self.observer.begin(state, command);
        command
    }
}
