//! Speed profiles: fast where there is room and slow before bends, in narrow places and off the guide.

use serde::{Deserialize, Serialize};
use sharp_guide::GuidePath;
use sharp_sim::{NoiseModel, RobotModel};
use sharp_space::{Heading, Pose};

use crate::command::Command;
use crate::follower::{Follower, SteeringRule, compensated};
use crate::policy::Policy;
use crate::presets::PRESETS;
use crate::situation::{GuideProgress, GuideView, Situation};
use crate::world::World;

/// Distance between two samples along the path, metres: the spacing of its poses.
const SAMPLE_M: f64 = 0.25;

/// Speed by the place on the path.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SpeedProfile {
    /// Fastest, as a share of the robot's top speed.
    pub cruise: f64,
    /// Slowest, as a share of the robot's top speed.
    pub slow: f64,
    /// Clearance at the robot's sides at which it drives slowest, and from which on it cruises, metres.
    pub clearance_m: [f64; 2],
    /// Turn of the path over the distance looked ahead at which the robot drives slowest, radians.
    pub turn_rad: f64,
    /// Heading error at which the robot drives slowest, radians.
    pub heading_rad: f64,
    /// How far ahead clearance and turn are judged, metres.
    pub ahead_m: f64,
}

impl SpeedProfile {
    /// The speed scale at each quarter of a metre of `route`, from 0 (slowest) to 1 (cruise).
    #[must_use]
    pub fn along(&self, world: &World, route: &GuidePath) -> Vec<f64> {
        let view = GuideView { current: route, next: None };
        let count = (route.length_m() / SAMPLE_M) as usize + 1;
        (0..=count).map(|i| self.scale(world, &view, i as f64 * SAMPLE_M)).collect()
    }

    /// The time that the profile takes along `guide` when nothing disturbs the robot, seconds.
    #[must_use]
    pub fn time_s(&self, world: &World, guide: &GuidePath) -> f64 {
        let speed = |scale: f64| (self.slow + (self.cruise - self.slow) * scale) * world.robot.max_speed_mps;
        let seconds: f64 = self.along(world, guide).into_iter().map(|scale| SAMPLE_M / speed(scale)).sum();
        // The samples reach beyond the end by less than two of them.
        let count = (guide.length_m() / SAMPLE_M) as usize + 2;
        seconds * guide.length_m() / (count as f64 * SAMPLE_M)
    }

    /// The speed scale `arc_m` along the guide, from 0 (slowest) to 1 (cruise).
    fn scale(&self, world: &World, guide: &GuideView<'_>, arc_m: f64) -> f64 {
        let field = world.geometry.clearance();
        let (mut least_m, mut turn_rad) = (f64::INFINITY, 0.0);
        let mut before: Option<Heading> = None;
        for step in 0..=(self.ahead_m / SAMPLE_M).ceil() as usize {
            let ahead = guide.ahead(arc_m + step as f64 * SAMPLE_M);
            least_m = least_m.min(field.sample(ahead.position));
            turn_rad += before.map_or(0.0, |before| before.turn_to(ahead.heading).abs());
            before = Some(ahead.heading);
        }
        let beside_m = least_m - world.robot.footprint.inscribed_radius_m();
        let [tight_m, roomy_m] = self.clearance_m;
        ((beside_m - tight_m) / (roomy_m - tight_m)).min(1.0 - turn_rad / self.turn_rad).clamp(0.0, 1.0)
    }

    /// The speed, as a share of the top speed, at a place with the given speed `scale` for a robot that looks
    /// along `heading` where the guide runs along `tangent`.
    fn speed(&self, scale: f64, tangent: Heading, heading: Heading) -> f64 {
        let error_rad = tangent.turn_to(heading).abs();
        let scale = scale.min(1.0 - error_rad / self.heading_rad).max(0.0);
        self.slow + (self.cruise - self.slow) * scale
    }
}

/// Follows a guide path with a speed profile.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ProfiledFollower {
    /// Where to.
    pub rule: SteeringRule,
    /// How fast.
    pub speed: SpeedProfile,
    /// Share of the estimated drift that the direction compensates, 0 to 1.
    pub drift_compensation: f64,
}

impl ProfiledFollower {
    /// The one that did best on generated maps under noise like `noise` (`docs/algorithms/baselines.md`).
    #[must_use]
    pub fn tuned(robot: &RobotModel, noise: &NoiseModel) -> Self {
        let is_harsh = noise.slip_max > 0.4 || noise.gain_sd > 0.25 || noise.waypoint_sd_m > 0.075;
        let is_biased = noise.drift_bias_radps > 0.0 || noise.delay_s > 0.0;
        let tuned = &PRESETS.tuned;
        match (robot.can_turn_in_place(), is_harsh, is_biased) {
            (true, true, _) => tuned.turning_harsh,
            (true, false, _) => tuned.turning,
            (false, true, _) => tuned.steering_harsh,
            (false, false, true) => tuned.steering_biased,
            (false, false, false) => tuned.steering,
        }
    }

    /// The tuned ones of robots that move as `robot` does, one for each sort of noise.
    #[must_use]
    pub fn all_tuned(robot: &RobotModel) -> Vec<Self> {
        let tuned = &PRESETS.tuned;
        if robot.can_turn_in_place() {
            vec![tuned.turning, tuned.turning_harsh]
        } else {
            vec![tuned.steering, tuned.steering_biased, tuned.steering_harsh]
        }
    }

    /// The profiled followers that are compared for an option of `robot`: the tuned ones, and some that weigh
    /// speed against clearance differently.
    #[must_use]
    pub fn candidates(robot: &RobotModel) -> Vec<Self> {
        let own = Self::all_tuned(robot);
        let (base, profiled) = (own[0].speed, &PRESETS.profiled);
        let others = profiled.speeds.iter().flat_map(|&(cruise, slow)| {
            let speed = SpeedProfile { cruise, slow, ..base };
            let with = move |&rule| Self { rule, speed, drift_compensation: profiled.drift_compensation };
            profiled.rules.iter().map(with)
        });
        own.into_iter().chain(others).collect()
    }

    /// The next waypoint of a robot at `pose`, without feed-forward.
    #[must_use]
    pub fn waypoint(
        &self,
        world: &World,
        pose: &Pose,
        progress: &GuideProgress,
        guide: &GuideView<'_>,
    ) -> Command {
        let scale = self.speed.scale(world, guide, progress.arc_m);
        self.scaled(&world.robot, pose, progress, (guide, scale))
    }

    /// The same along a whole route whose speed scales are known ([`SpeedProfile::along`]).
    pub(crate) fn along(
        &self,
        robot: &RobotModel,
        pose: &Pose,
        progress: &GuideProgress,
        (route, scales): (&GuidePath, &[f64]),
    ) -> Command {
        let place = (progress.arc_m / SAMPLE_M) as usize;
        let view = GuideView { current: route, next: None };
        self.scaled(robot, pose, progress, (&view, scales[place.min(scales.len() - 1)]))
    }

    fn scaled(
        &self,
        robot: &RobotModel,
        pose: &Pose,
        progress: &GuideProgress,
        (guide, scale): (&GuideView<'_>, f64),
    ) -> Command {
        let speed_mps = self.speed.speed(scale, progress.tangent, pose.heading) * robot.max_speed_mps;
        Follower { rule: self.rule, speed_mps }.waypoint(robot, pose, progress, guide)
    }
}

impl Policy for ProfiledFollower {
    fn decide(&mut self, situation: &Situation<'_>) -> Command {
        let Situation { world, observation, progress, guide } = situation;
        let wanted = self.waypoint(world, &observation.state.pose, progress, guide);
        compensated(world, situation, wanted, self.drift_compensation)
    }
}

/// A [`ProfiledFollower`] on a long route: the profile is computed once, when the route is entered.
#[derive(Clone, Debug)]
pub struct RouteFollower {
    follower: ProfiledFollower,
    scales: Vec<f64>,
}

impl RouteFollower {
    /// A follower that has not entered its route yet.
    #[must_use]
    pub const fn new(follower: ProfiledFollower) -> Self {
        Self { follower, scales: Vec::new() }
    }
}

impl Policy for RouteFollower {
    fn enter(&mut self, situation: &Situation<'_>) {
        self.scales = self.follower.speed.along(situation.world, situation.guide.current);
    }

    fn decide(&mut self, situation: &Situation<'_>) -> Command {
        let Situation { world, observation, progress, guide } = situation;
        let (pose, route) = (&observation.state.pose, (guide.current, &self.scales[..]));
        let wanted = self.follower.along(&world.robot, pose, progress, route);
        compensated(world, situation, wanted, self.follower.drift_compensation)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::test_worlds::{hall, straight};

    #[test]
    fn the_profile_slows_in_narrow_places_before_bends_and_off_the_heading() {
        let world = hall();
        let (middle, wall) = (straight((1.0, 2.0), (9.0, 2.0)), straight((1.0, 0.85), (9.0, 0.85)));
        let bend = straight((5.0, 2.0), (5.0, 3.0));
        for follower in ProfiledFollower::candidates(&world.robot) {
            let speed_mps = |current, next, heading| {
                let pose = Pose::new(4.9, GuidePath::start(current).position.y, heading);
                let progress = GuideProgress::start(current, &pose);
                follower.waypoint(&world, &pose, &progress, &GuideView { current, next }).speed_mps
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
    fn a_route_has_the_profile_of_a_guide() {
        let world = hall();
        let route = straight((1.0, 1.0), (9.0, 3.0));
        let follower = ProfiledFollower::tuned(&world.robot, &NoiseModel::harsh());
        let scales = follower.speed.along(&world, &route);
        let pose = Pose::at(route.pose_at(2.0).position, route.pose_at(2.0).heading);
        let progress = GuideProgress { arc_m: 2.0, ..GuideProgress::start(&route, &pose) };
        let along = follower.along(&world.robot, &pose, &progress, (&route, &scales));
        let view = GuideView { current: &route, next: None };
        assert_eq!(along, follower.waypoint(&world, &pose, &progress, &view));
    }
}
