//! Our guide planners and rewards keep the promises of their traits.

mod worlds;

use std::sync::atomic::{AtomicU32, Ordering};

use sharp_guide::conformance::{check_guide_planner, check_reward};
use sharp_guide::{
    ClearanceSearch, GuidePath, GuidePlanner, GuideRequest, GuideRobot, GuideSettings, LearnAndLink, NoGuide,
    PlannerKind, ProgressReward, PseudoReward, Reward, StepEvents, Transition,
};
use sharp_options::OptionKind;
use sharp_space::{Point, Pose, Stream};
use worlds::{Drawn, HALL, along};

#[test]
fn our_guide_planners_conform() {
    let planners: [&dyn GuidePlanner; 2] = [&ClearanceSearch::default(), &LearnAndLink::default()];
    for planner in planners {
        assert_eq!(check_guide_planner(planner), Ok(()), "{planner:?}");
    }
    for planner in [PlannerKind::ClearanceSearch, PlannerKind::LearnAndLink] {
        let named = GuideSettings { planner, ..GuideSettings::default() }.to_planner();
        assert_eq!(check_guide_planner(&*named), Ok(()), "{planner:?} by name");
    }
}

#[test]
fn our_rewards_conform() {
    let option = &Drawn::new(HALL, OptionKind::Centroid).plan(&["c:0-1"], along())[0];
    let rewards: [&dyn Reward; 2] = [&PseudoReward::default(), &ProgressReward::default()];
    for reward in rewards {
        assert_eq!(check_reward(reward, option), Ok(()), "{reward:?}");
    }
}

/// A planner that returns what `spoil` makes of the request and of a sound guide.
#[derive(Debug)]
struct Spoilt(fn(&GuideRequest<'_>, Result<GuidePath, NoGuide>) -> Result<GuidePath, NoGuide>);

impl GuidePlanner for Spoilt {
    fn plan(
        &self,
        request: &GuideRequest<'_>,
        robot: &GuideRobot<'_>,
        rng: &mut Stream,
    ) -> Result<GuidePath, NoGuide> {
        (self.0)(request, ClearanceSearch::default().plan(request, robot, rng))
    }
}

/// The polyline through `corners` with gaps of 0.1 m.
fn polyline(corners: &[Point]) -> GuidePath {
    let pieces = corners.windows(2).flat_map(|pair| {
        let ahead = pair[1] - pair[0];
        let count = (ahead.norm() / 0.1).ceil();
        let heading = sharp_space::Heading::of(ahead);
        (0..count as u32).map(move |i| Pose::at(pair[0] + ahead * (f64::from(i) / count), heading))
    });
    let mut poses: Vec<Pose> = pieces.collect();
    poses.push(Pose::at(corners[corners.len() - 1], poses[poses.len() - 1].heading));
    GuidePath::new(poses, 0.25).expect("a path")
}

#[test]
fn broken_guide_planners_are_found_out() {
    let found = |spoil| check_guide_planner(&Spoilt(spoil)).unwrap_err().to_string();
    assert!(found(|_, _| Err(NoGuide::Unreachable)).starts_with("no guide where there is a way"));
    let short = found(|_, guide| {
        let poses = guide?.poses().to_vec();
        GuidePath::new(poses[..poses.len() - 3].to_vec(), 0.25).map_err(|_| NoGuide::Unreachable)
    });
    assert!(short.contains("which was not asked for"), "{short}");
    // Up into the wall beside the gap, and down again.
    let through = found(|request, _| {
        let (from, to) = (request.start.position, request.goal.position);
        Ok(polyline(&[from, Point::new(4.5, 2.0), Point::new(4.6, 2.5), Point::new(4.9, 2.0), to]))
    });
    assert!(through.starts_with("the outline touches an obstacle"), "{through}");
    // Before the gap it goes down into rows that are not allowed.
    let astray = found(|request, guide| {
        let (from, to) = (request.start.position, request.goal.position);
        let is_asked_for_less = !(request.allowed)(sharp_space::Cell::new(3, 2));
        if guide.is_err() || !is_asked_for_less {
            return guide;
        }
        Ok(polyline(&[from, Point::new(2.0, 1.0), Point::new(3.0, 2.0), to]))
    });
    assert!(astray.starts_with("the guide leaves the allowed cells"), "{astray}");
    let sealed = found(|request, guide| {
        guide.or_else(|_| Ok(polyline(&[request.start.position, request.goal.position])))
    });
    assert_eq!(sealed, "a guide through a wall");
}

#[test]
fn a_planner_that_is_random_by_itself_is_found_out() {
    static CALLS: AtomicU32 = AtomicU32::new(0);
    let planner = Spoilt(|_, guide| {
        let guide = guide?;
        let mut poses = guide.poses().to_vec();
        let middle = poses.len() / 2;
        poses[middle].position.x += 1e-6 * f64::from(CALLS.fetch_add(1, Ordering::Relaxed));
        GuidePath::new(poses, 0.25).map_err(|_| NoGuide::Unreachable)
    });
    let found = check_guide_planner(&planner).unwrap_err().to_string();
    assert_eq!(found, "the same stream gives another guide");
}

/// A reward that pays what the function says of the events.
#[derive(Debug)]
struct Paying(fn(StepEvents) -> f64);

impl Reward for Paying {
    fn reward(&self, transition: &Transition<'_>) -> f64 {
        (self.0)(transition.events)
    }
}

#[test]
fn broken_rewards_are_found_out() {
    static CALLS: AtomicU32 = AtomicU32::new(0);
    let option = &Drawn::new(HALL, OptionKind::Centroid).plan(&["c:0-1"], along())[0];
    let found = |pay| check_reward(&Paying(pay), option).unwrap_err().to_string();
    assert_eq!(found(|events| if events.stray { f64::NAN } else { 0.0 }), "the reward is NaN");
    assert_eq!(found(|events| if events.contact { f64::INFINITY } else { 0.0 }), "the reward is inf");
    let punished = found(|events| if events.success { -1.0 } else { 0.0 });
    assert_eq!(punished, "success pays -1, the same step without success 0");
    let changing =
        found(|events| if events.success { 1e9 } else { f64::from(CALLS.fetch_add(1, Ordering::Relaxed)) });
    assert!(changing.starts_with("the same transition pays 0, then"), "{changing}");
}
