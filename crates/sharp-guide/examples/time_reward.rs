//! A reward of one's own: every action costs its time, and reaching the termination set pays.
//!
//! `cargo run --release -p sharp-guide --example time_reward`

use std::sync::Arc;

use sharp_guide::conformance::check_reward;
use sharp_guide::{Goal, GuidePath, GuidedOption, LegId, OptionSpace, Reward, StepEvents, Transition};
use sharp_options::{AllowedRule, OptionKind, OptionSet, OptionSettings};
use sharp_rbvd::{Rbvd, RbvdSettings, StateId};
use sharp_space::{Cell, DistanceField, OccupancyGrid, Pose, Region, RegionId};

/// Shortest time wins: a learner that maximises it hurries.
#[derive(Debug)]
struct TimeReward {
    /// Time of an action, seconds.
    action_s: f64,
    /// What a contact costs, seconds.
    contact_s: f64,
    /// What success is worth, seconds.
    success_s: f64,
}

impl Reward for TimeReward {
    fn reward(&self, transition: &Transition<'_>) -> f64 {
        let StepEvents { success, contact, .. } = transition.events;
        let lost_s = if contact { self.contact_s } else { 0.0 };
        let won_s = if success { self.success_s } else { 0.0 };
        won_s - lost_s - self.action_s
    }
}

/// Straight through an empty hall with one region in its middle.
fn option() -> GuidedOption {
    let grid = OccupancyGrid::from_ascii(0.5, &["....................."; 6].join("\n")).expect("a drawing");
    let field = DistanceField::new(&grid);
    let region = Region::new(RegionId(0), vec![Cell::new(10, 3)], &field).expect("one cell");
    let states = Rbvd::build(&field, &[region], &RbvdSettings::default()).expect("a diagram");
    let options = OptionSet::synthesize(&states, OptionKind::Interface, &OptionSettings::default());
    let (states, options) = (Arc::new(states), Arc::new(options));
    let space = OptionSpace { states, options, rule: AllowedRule::Paper };
    let poses = (0..=30).map(|i| Pose::new(2.0 + 0.2 * f64::from(i), 1.5, 0.0)).collect();
    let guide = GuidePath::new(poses, 0.25).expect("short gaps");
    let goal = Goal::new(guide.end().position, 0.3, &field);
    GuidedOption::new(&space, LegId::Direct, (StateId(0), StateId(0)), guide, goal)
}

fn main() {
    let (reward, option) = (TimeReward { action_s: 0.5, contact_s: 60.0, success_s: 100.0 }, option());
    assert_eq!(check_reward(&reward, &option), Ok(()));
    let pose = option.guide.end();
    let events = StepEvents { success: true, ..StepEvents::default() };
    let last = Transition { option: &option, pose: &pose, progress_m: 0.1, deviation_m: 0.0, events };
    assert!(option.is_done(&pose), "the guide leads into the termination set");
    assert_eq!(reward.reward(&last), 99.5, "success, less the last action");
}
