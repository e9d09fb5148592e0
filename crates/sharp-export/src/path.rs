//! The path of a plan as poses in time, and as tables of numbers.

use std::fmt::Write;

use serde_json::{Value, json};
use sharp_drive::{ProfiledFollower, SpeedProfile, World};
use sharp_guide::GuidePath;
use sharp_plan::{Plan, PlannedOption};
use sharp_space::Pose;

use crate::legs::leg;

/// The frame of all poses, as in ROS.
pub(crate) const FRAME: &str = "map";

/// The distance between two values of [`SpeedProfile::along`], metres.
const PROFILE_SPACING_M: f64 = 0.25;

/// A profile that is so many times faster is at the top speed everywhere.
const FASTER_MAX: f64 = 1024.0;
/// Halvings after which the factor of a profile is exact.
const BISECTIONS: u32 = 60;

/// One pose of a path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PathPoint {
    /// The pose, in the frame of the map.
    pub pose: Pose,
    /// Metres from the start of the path.
    pub arc_m: f64,
    /// Seconds from the start.
    pub time_s: f64,
    /// Speed there, metres per second.
    pub speed_mps: f64,
    /// The step of the plan that it belongs to, from 0.
    pub step: usize,
}

/// The path of a plan: the guides of its options, one after the other.
///
/// Times are predictions. Where a leg is slow and where it is fast comes from the speed profile of a follower tuned for
/// the noise of the plan. How long the leg takes comes from the plan: the mean time of its successes when it is
/// entered the way the one before it arrives, scaled so that the path ends at the plan's predicted time. No speed is
/// above the robot's top speed, unless a leg takes less time than its guide at that speed, which is for robots that cut
/// corners.
#[derive(Clone, Debug, PartialEq)]
pub struct PlannedPath {
    /// Its poses; times and arc lengths never fall.
    pub points: Vec<PathPoint>,
}

impl PlannedPath {
    /// The path of `plan`.
    #[must_use]
    pub fn new(plan: &Plan) -> Self {
        let profile = ProfiledFollower::tuned(&plan.world.robot, &plan.noise).speed;
        let steps = &plan.solution.steps;
        let plain_s: Vec<f64> = steps.iter().map(|step| leg_time_s(&plan.world, &profile, step)).collect();
        let (legs_s, predicted_s) = (plain_s.iter().sum::<f64>(), plan.solution.predicted_time_s);
        let stretch = if predicted_s > 0.0 && legs_s > 0.0 { predicted_s / legs_s } else { 1.0 };
        let mut points: Vec<PathPoint> = Vec::new();
        let (mut arc_m, mut time_s) = (0.0, 0.0);
        for (number, (step, leg_s)) in steps.iter().zip(plain_s).enumerate() {
            let guide = &step.option.guide;
            let pace = LegPace::new(&plan.world, &profile, guide, stretch * leg_s);
            if points.last().is_some_and(|last| last.pose.distance_m(&guide.start()) < 1e-6) {
                points.pop();
            }
            points.extend((0..guide.poses().len()).map(|i| PathPoint {
                pose: guide.poses()[i],
                arc_m: arc_m + guide.arc_m(i),
                time_s: time_s + pace.times_s[i],
                speed_mps: pace.speeds_mps[i],
                step: number,
            }));
            arc_m += guide.length_m();
            time_s += stretch * leg_s;
        }
        Self { points }
    }

    /// The path as comma-separated values with a line of names: `x_m,y_m,yaw_rad,arc_m,time_s,speed_mps,option`.
    #[must_use]
    pub fn to_csv(&self, plan: &Plan) -> String {
        let mut text = "x_m,y_m,yaw_rad,arc_m,time_s,speed_mps,option\n".to_owned();
        for point in &self.points {
            let PathPoint { pose, arc_m, time_s, speed_mps, step } = point;
            let option = plan.solution.steps[*step].option.id;
            let (x, y, yaw) = (pose.position.x, pose.position.y, pose.heading.radians());
            writeln!(text, "{x:.6},{y:.6},{yaw:.6},{arc_m:.6},{time_s:.6},{speed_mps:.6},{option}")
                .expect("text takes all that is written");
        }
        text
    }

    /// The path shaped like a `nav_msgs/Path` message, with keys of ours beside those of the message.
    #[must_use]
    pub fn to_json(&self, plan: &Plan) -> String {
        let solution = &plan.solution;
        let composed = solution.composed.as_ref();
        let value = json!({
            "schema": "sharp.path/1",
            "header": header(0.0),
            "poses": self.points.iter().map(|point| stamped_pose(plan, point)).collect::<Vec<_>>(),
            "robot": plan.world.robot.name,
            "goal_tolerance_m": plan.world.robot.goal_tolerance_m,
            "predicted": {
                "success": solution.success(),
                "lower95": composed.map_or_else(|| solution.predicted.lower95(), |odds| odds.lower95),
                "sim_time_s": solution.predicted_time_s,
            },
            "legs": solution.steps.iter().map(leg).collect::<Vec<_>>(),
        });
        value.to_string() + "\n"
    }
}

/// The time of a leg, seconds: measured on arrival, or that of the profile where no arrival succeeded.
fn leg_time_s(world: &World, profile: &SpeedProfile, step: &PlannedOption) -> f64 {
    let is_measured = step.arrival_time_s.is_finite() && step.arrival_time_s > 0.0;
    if is_measured { step.arrival_time_s } else { profile.time_s(world, &step.option.guide) }
}

/// The speed at each pose of a leg's guide, and when the robot is there.
struct LegPace {
    speeds_mps: Vec<f64>,
    times_s: Vec<f64>,
}

impl LegPace {
    /// The profile, faster or slower everywhere by one factor but nowhere above the top speed or a speed limit, so that `guide` takes
    /// `time_s`. Where that cannot be, the robot cuts corners, and one speed above the top is all that fits.
    fn new(world: &World, profile: &SpeedProfile, guide: &GuidePath, time_s: f64) -> Self {
        let profiled = profiled_speeds_mps(world, profile, guide);
        let limits_mps: Vec<f64> = guide.poses().iter().map(|pose| limit_mps(world, pose)).collect();
        let at = |factor: f64| {
            let speeds = profiled.iter().zip(&limits_mps).map(|(speed, limit)| (factor * speed).min(*limit));
            speeds.collect::<Vec<f64>>()
        };
        let (mut slow, mut fast) = (0.0, 1.0);
        while takes_s(guide, &at(fast)) > time_s && fast < FASTER_MAX {
            (slow, fast) = (fast, 2.0 * fast);
        }
        for _ in 0..BISECTIONS {
            let middle = 0.5 * (slow + fast);
            let is_slow = takes_s(guide, &at(middle)) > time_s;
            (slow, fast) = if is_slow { (middle, fast) } else { (slow, middle) };
        }
        let speeds = at(fast);
        let left = takes_s(guide, &speeds) / time_s;
        let speeds_mps: Vec<f64> = speeds.into_iter().map(|speed| speed * left).collect();
        let times_s = times_s(guide, &speeds_mps);
        Self { speeds_mps, times_s }
    }
}

/// The highest speed of the robot at `pose`, metres per second.
fn limit_mps(world: &World, pose: &Pose) -> f64 {
    let limit_mps = world.speed_limits.as_ref().map_or(f64::INFINITY, |limits| limits.at(pose.position));
    world.robot.max_speed_mps.min(limit_mps)
}

/// When a robot with these speeds is at each pose of `guide`, seconds from the first.
fn times_s(guide: &GuidePath, speeds_mps: &[f64]) -> Vec<f64> {
    let mut times_s = vec![0.0];
    for i in 1..guide.poses().len() {
        let gap_m = guide.arc_m(i) - guide.arc_m(i - 1);
        times_s.push(times_s[i - 1] + 2.0 * gap_m / (speeds_mps[i - 1] + speeds_mps[i]));
    }
    times_s
}

fn takes_s(guide: &GuidePath, speeds_mps: &[f64]) -> f64 {
    times_s(guide, speeds_mps).last().copied().unwrap_or(0.0)
}

/// What the profile drives at each pose of `guide`, metres per second; positive.
fn profiled_speeds_mps(world: &World, profile: &SpeedProfile, guide: &GuidePath) -> Vec<f64> {
    let scales = profile.along(world, guide);
    let at = |arc_m: f64| {
        let place = (arc_m / PROFILE_SPACING_M).round() as usize;
        let scale = scales[place.min(scales.len() - 1)];
        (profile.slow + (profile.cruise - profile.slow) * scale) * world.robot.max_speed_mps
    };
    (0..guide.poses().len()).map(|i| at(guide.arc_m(i)).max(1e-3)).collect()
}

fn stamped_pose(plan: &Plan, point: &PathPoint) -> Value {
    let PathPoint { pose, arc_m, time_s, speed_mps, step } = *point;
    let [z, w] = quaternion(&pose);
    json!({
        "header": header(time_s),
        "pose": {
            "position": { "x": pose.position.x, "y": pose.position.y, "z": 0.0 },
            "orientation": { "x": 0.0, "y": 0.0, "z": z, "w": w },
        },
        "yaw_rad": pose.heading.radians(),
        "arc_m": arc_m,
        "time_s": time_s,
        "speed_mps": speed_mps,
        "option": plan.solution.steps[step].option.id.to_string(),
    })
}

fn header(time_s: f64) -> Value {
    let (sec, nanosec) = stamp(time_s);
    json!({ "stamp": { "sec": sec, "nanosec": nanosec }, "frame_id": FRAME })
}

/// Seconds as ROS counts them: whole seconds and nanoseconds.
pub(crate) fn stamp(time_s: f64) -> (i32, u32) {
    let nanos = nanoseconds(time_s);
    ((nanos / 1_000_000_000) as i32, (nanos % 1_000_000_000) as u32)
}

/// Seconds as nanoseconds, 0 or more.
pub(crate) fn nanoseconds(time_s: f64) -> u64 {
    (time_s.max(0.0) * 1e9).round() as u64
}

/// z and w of the quaternion of a heading on the floor.
pub(crate) fn quaternion(pose: &Pose) -> [f64; 2] {
    let (sin, cos) = sharp_space::trig::sin_cos(0.5 * pose.heading.radians());
    [sin, cos]
}
