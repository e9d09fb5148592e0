//! Following a guide fast where it may be and slowly where it must.

use serde::{Deserialize, Serialize};
use sharp_guide::GuidePath;
use sharp_sim::{NoiseModel, RobotModel};
use sharp_space::{Heading, Pose};

use crate::percept::{Tracker, Workspace};
use crate::policy::{Follower, GuideView, PolarWaypoint, Rule};

/// The distance between two looks along the path, metres: the spacing of its poses.
const LOOK_STEP_M: f64 = 0.25;

/// Speed by the place on the path.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpeedRule {
    /// Fastest, as a share of the robot's top speed.
    pub cruise: f64,
    /// Slowest, as a share of the robot's top speed.
    pub slow: f64,
    /// Room at the robot's sides at which it drives slowest, and from which on it cruises, metres.
    pub room_m: [f64; 2],
    /// Turn of the path over the distance looked ahead at which the robot drives slowest, radians.
    pub turn_rad: f64,
    /// Heading error at which the robot drives slowest, radians.
    pub heading_rad: f64,
    /// How far ahead room and turn are judged, metres.
    pub ahead_m: f64,
}

impl SpeedRule {
    /// How freely the robot may drive at each quarter of a metre of `route`, from 0 (slowest) to 1.
    pub(crate) fn along(&self, workspace: &Workspace, route: &GuidePath) -> Vec<f64> {
        let view = GuideView { guide: route, next: None };
        let count = (route.length_m() / LOOK_STEP_M) as usize + 1;
        (0..=count).map(|i| self.ease(workspace, &view, i as f64 * LOOK_STEP_M)).collect()
    }

    /// How freely the robot may drive `arc_m` along its guide, from 0 (slowest) to 1.
    fn ease(&self, workspace: &Workspace, view: &GuideView<'_>, arc_m: f64) -> f64 {
        let field = workspace.checker.field();
        let (mut least_m, mut turn_rad) = (f64::INFINITY, 0.0);
        let mut before: Option<Heading> = None;
        for step in 0..=(self.ahead_m / LOOK_STEP_M).ceil() as usize {
            let ahead = view.ahead(arc_m + step as f64 * LOOK_STEP_M);
            least_m = least_m.min(field.sample(ahead.position));
            turn_rad += before.map_or(0.0, |before| before.turn_to(ahead.heading).abs());
            before = Some(ahead.heading);
        }
        let room_m = least_m - workspace.robot.footprint.inscribed_radius_m();
        let [tight_m, roomy_m] = self.room_m;
        ((room_m - tight_m) / (roomy_m - tight_m)).min(1.0 - turn_rad / self.turn_rad).clamp(0.0, 1.0)
    }

    /// The speed of a robot that looks along `heading` at a place of its path with the given `ease`,
    /// as a share of its top speed.
    fn speed(&self, ease: f64, tangent: Heading, heading: Heading) -> f64 {
        let error_rad = tangent.turn_to(heading).abs();
        let ease = ease.min(1.0 - error_rad / self.heading_rad).max(0.0);
        self.slow + (self.cruise - self.slow) * ease
    }
}

/// Follows a guide path fast where it may be and slowly where it must: where room is scarce, before
/// bends and while the robot looks elsewhere.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PacedFollower {
    /// Where to.
    pub rule: Rule,
    /// How fast.
    pub speed: SpeedRule,
    /// Share of the pull, as it is believed so far, that the direction makes up for.
    pub trim: f64,
}

impl PacedFollower {
    /// What did best on generated maps under noise like `noise` (see `docs/algorithms/baselines.md`).
    #[must_use]
    pub fn tuned(robot: &RobotModel, noise: &NoiseModel) -> Self {
        let is_harsh = noise.slip_max > 0.4 || noise.gain_sd > 0.25 || noise.waypoint_sd_m > 0.075;
        let is_biased = noise.drift_bias_radps > 0.0 || noise.delay_s > 0.0;
        match (robot.can_turn_in_place(), is_harsh, is_biased) {
            (true, true, _) => TURNING_HARSH,
            (true, false, _) => TURNING,
            (false, true, _) => STEERING_HARSH,
            (false, false, true) => STEERING_BIASED,
            (false, false, false) => STEERING,
        }
    }

    /// The paced followers worth trying for `robot`: the tuned ones, and some that make other trades.
    #[must_use]
    pub fn candidates(robot: &RobotModel) -> Vec<Self> {
        let rules = [
            Rule::Pursuit { look_ahead_m: 0.5 },
            Rule::Pursuit { look_ahead_m: 0.3 },
            Rule::Field { look_ahead_m: 0.4, softness_m: 0.4 },
            Rule::Field { look_ahead_m: 0.15, softness_m: 0.2 },
        ];
        let paces = [(1.0, 0.3), (0.8, 0.15), (0.5, 0.1)];
        let (tuned, base) = if robot.can_turn_in_place() {
            (&[TURNING, TURNING_HARSH][..], TURNING)
        } else {
            (&[STEERING, STEERING_BIASED, STEERING_HARSH][..], STEERING)
        };
        let paced = |rule, (cruise, slow)| {
            let speed = SpeedRule { cruise, slow, ..base.speed };
            Self { rule, speed, trim: 0.5 }
        };
        let others = paces.into_iter().flat_map(|pace| rules.map(|rule| paced(rule, pace)));
        tuned.iter().copied().chain(others).collect()
    }

    /// The next waypoint of a robot at `pose` whose projection onto its guide is `tracker`.
    #[must_use]
    pub fn waypoint(
        &self,
        workspace: &Workspace,
        pose: &Pose,
        tracker: &Tracker,
        view: &GuideView<'_>,
    ) -> PolarWaypoint {
        let ease = self.speed.ease(workspace, view, tracker.arc_m);
        self.eased(&workspace.robot, pose, tracker, (view, ease))
    }

    /// The same along a whole route whose eases [`SpeedRule::along`] has told.
    pub(crate) fn along(
        &self,
        robot: &RobotModel,
        pose: &Pose,
        tracker: &Tracker,
        (route, eases): (&GuidePath, &[f64]),
    ) -> PolarWaypoint {
        let place = (tracker.arc_m / LOOK_STEP_M) as usize;
        let view = GuideView { guide: route, next: None };
        self.eased(robot, pose, tracker, (&view, eases[place.min(eases.len() - 1)]))
    }

    fn eased(
        &self,
        robot: &RobotModel,
        pose: &Pose,
        tracker: &Tracker,
        (view, ease): (&GuideView<'_>, f64),
    ) -> PolarWaypoint {
        let speed_mps = self.speed.speed(ease, tracker.tangent, pose.heading) * robot.max_speed_mps;
        Follower { rule: self.rule, speed_mps }.waypoint(robot, pose, tracker, view)
    }
}

const TURNING: PacedFollower = PacedFollower {
    rule: Rule::Pursuit { look_ahead_m: 0.3 },
    speed: SpeedRule {
        cruise: 0.8,
        slow: 0.15,
        room_m: [0.15, 0.6],
        turn_rad: 2.0,
        heading_rad: 0.5,
        ahead_m: 1.5,
    },
    trim: 0.5,
};

const TURNING_HARSH: PacedFollower = PacedFollower {
    rule: Rule::Field { look_ahead_m: 0.15, softness_m: 0.2 },
    speed: SpeedRule {
        cruise: 0.8,
        slow: 0.1,
        room_m: [0.15, 0.95],
        turn_rad: 1.2,
        heading_rad: 0.3,
        ahead_m: 0.75,
    },
    trim: 0.3,
};

const STEERING: PacedFollower = PacedFollower {
    rule: Rule::Field { look_ahead_m: 0.4, softness_m: 0.4 },
    speed: SpeedRule {
        cruise: 0.7,
        slow: 0.2,
        room_m: [0.1, 0.6],
        turn_rad: 2.0,
        heading_rad: 2.0,
        ahead_m: 0.75,
    },
    trim: 1.0,
};

const STEERING_BIASED: PacedFollower = PacedFollower {
    rule: Rule::Field { look_ahead_m: 0.4, softness_m: 0.3 },
    speed: SpeedRule {
        cruise: 0.5,
        slow: 0.25,
        room_m: [0.1, 0.4],
        turn_rad: 0.8,
        heading_rad: 2.0,
        ahead_m: 0.75,
    },
    trim: 0.5,
};

const STEERING_HARSH: PacedFollower = PacedFollower {
    rule: Rule::Field { look_ahead_m: 0.4, softness_m: 0.3 },
    speed: SpeedRule {
        cruise: 0.5,
        slow: 0.2,
        room_m: [0.1, 1.3],
        turn_rad: 0.8,
        heading_rad: 1.0,
        ahead_m: 0.75,
    },
    trim: 0.7,
};

#[cfg(test)]
mod tests {
    use sharp_options::OptionKind;

    use super::*;
    use crate::drawn::{HALL, straight, world};

    #[test]
    fn haste_ends_where_room_ends_before_bends_and_while_the_robot_looks_elsewhere() {
        let (workspace, _) = world(HALL, OptionKind::Centroid);
        let (middle, wall) = (straight((1.0, 2.0), (9.0, 2.0)), straight((1.0, 0.85), (9.0, 0.85)));
        let bend = straight((5.0, 2.0), (5.0, 3.0));
        for follower in PacedFollower::candidates(&workspace.robot) {
            let speed_mps = |guide, next, heading| {
                let pose = Pose::new(4.9, GuidePath::start(guide).position.y, heading);
                let tracker = Tracker::start(guide, &pose);
                follower.waypoint(&workspace, &pose, &tracker, &GuideView { guide, next }).speed_mps
            };
            let (to_bend, slow) = (straight((4.0, 2.0), (5.0, 2.0)), follower.speed.slow);
            let free_mps = speed_mps(&middle, None, 0.0);
            assert!((free_mps - follower.speed.cruise).abs() < 1e-9, "{follower:?} in the clear: {free_mps}");
            assert!(speed_mps(&wall, None, 0.0) < 0.6 * free_mps, "{follower:?} along a wall");
            let bend_mps = speed_mps(&to_bend, Some(&bend), 0.0);
            assert!(bend_mps < 0.7 * free_mps, "{follower:?} before a bend: {bend_mps}");
            assert!((speed_mps(&middle, None, 1.2) - slow).abs() < 1e-9, "{follower:?} looks elsewhere");
        }
    }

    #[test]
    fn a_route_is_paced_like_a_guide() {
        let (workspace, _) = world(HALL, OptionKind::Centroid);
        let route = straight((1.0, 1.0), (9.0, 3.0));
        let follower = PacedFollower::tuned(&workspace.robot, &NoiseModel::harsh());
        let eases = follower.speed.along(&workspace, &route);
        let pose = Pose::at(route.pose_at(2.0).position, route.pose_at(2.0).heading);
        let tracker = Tracker { arc_m: 2.0, ..Tracker::start(&route, &pose) };
        let along = follower.along(&workspace.robot, &pose, &tracker, (&route, &eases));
        let view = GuideView { guide: &route, next: None };
        assert_eq!(along, follower.waypoint(&workspace, &pose, &tracker, &view));
    }
}
