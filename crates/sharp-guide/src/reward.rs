//! Rewards: the paper's pseudo-reward (definition 9), and progress along the guide, which learns faster.

use std::fmt::Debug;

use serde::{Deserialize, Serialize};
use sharp_space::Pose;

use crate::guided_option::GuidedOption;
use crate::path::GuidePath;

/// What one action did, as a reward sees it.
#[derive(Clone, Copy, Debug)]
pub struct Transition<'a> {
    /// The option that runs.
    pub option: &'a GuidedOption,
    /// Where the robot is now.
    pub pose: &'a Pose,
    /// How far its projection moved along the guide, metres.
    pub progress_m: f64,
    /// How much its distance from the guide grew, metres.
    pub deviation_m: f64,
    /// What happened besides.
    pub events: StepEvents,
}

/// What a learner is paid for an action. Implement [`reward`](Self::reward).
pub trait Reward: Debug + Send + Sync {
    /// The reward of `transition`; finite.
    fn reward(&self, transition: &Transition<'_>) -> f64;

    /// Returns true if an episode of learning ends when the robot touches an obstacle. The paper lets the robot
    /// bump and go on.
    fn contact_ends(&self) -> bool {
        true
    }

    /// Returns true if an episode of learning in which the robot touched an obstacle is no success, even where it goes on.
    fn contact_fails(&self) -> bool {
        self.contact_ends()
    }
}

/// Where a pose lies as seen from an option: the three cases of definition 9.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Place {
    /// x ∈ β.
    Termination,
    /// Outside every state that the option may use.
    Astray,
    /// On the way.
    Allowed,
}

/// R of Definition 9, and what a contact costs.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PseudoReward {
    /// `r_t`, in the termination set.
    pub success: f64,
    /// `r_p`, astray.
    pub stray: f64,
    /// Added for each step in which the robot touched an obstacle, 0 or less. The paper has no such term: 0. Where there is one
    /// an episode with a contact is no success, though `r_t` is paid.
    pub contact: f64,
    /// Added in the termination set for each radian between the robot's heading and that of the guide's end, 0 or less. The
    /// paper has no such term: 0. The next option begins with the heading with which this one ends.
    pub heading: f64,
}

impl Default for PseudoReward {
    /// The paper's values.
    fn default() -> Self {
        Self { success: 1000.0, stray: -100.0, contact: 0.0, heading: 0.0 }
    }
}

impl PseudoReward {
    /// R(x): `r_t` minus the cost of the heading, `r_p`, or −(d(x, n(x)) + d(n(x), pₙ)) in metres, straight distances both.
    #[must_use]
    pub fn value(&self, guide: &GuidePath, pose: &Pose, place: Place) -> f64 {
        match place {
            Place::Termination => {
                self.success + self.heading * pose.heading.turn_to(guide.end().heading).abs()
            }
            Place::Astray => self.stray,
            Place::Allowed => {
                let nearest = guide.poses()[guide.nearest(pose.position)];
                -(pose.distance_m(&nearest) + nearest.distance_m(&guide.end()))
            }
        }
    }

    /// The same by what happened on the way to `pose`, and what a contact costs.
    fn paid(&self, guide: &GuidePath, pose: &Pose, events: StepEvents) -> f64 {
        let place = match (events.success, events.stray) {
            (true, _) => Place::Termination,
            (false, true) => Place::Astray,
            (false, false) => Place::Allowed,
        };
        let contact = if events.contact { self.contact } else { 0.0 };
        self.value(guide, pose, place) + contact
    }
}

impl Reward for PseudoReward {
    fn reward(&self, transition: &Transition<'_>) -> f64 {
        self.paid(&transition.option.guide, transition.pose, transition.events)
    }

    fn contact_ends(&self) -> bool {
        false
    }

    fn contact_fails(&self) -> bool {
        self.contact != 0.0
    }
}

/// What happened in one step, besides motion.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct StepEvents {
    /// The termination set was reached.
    pub success: bool,
    /// The robot touched an obstacle; [`Reward::contact_ends`] says whether that ends the episode.
    pub contact: bool,
    /// The robot is outside the states of the option: does not end the episode.
    pub stray: bool,
}

/// Progress along the guide as the reward of a step.
///
/// Arc length instead of the paper's straight distance, so that a bend that leads away is not
/// punished; a difference instead of a level, so that no episode gains by ending early.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct ProgressReward {
    /// Per metre of progress.
    pub progress_per_m: f64,
    /// Per metre that the robot moved away from the path sideways.
    pub deviation_per_m: f64,
    /// For every step.
    pub step: f64,
    /// For reaching the termination set.
    pub success: f64,
    /// For touching an obstacle.
    pub contact: f64,
    /// For a step astray.
    pub stray: f64,
}

impl Default for ProgressReward {
    /// Values found in trials: a higher cost of contact makes robots timid, a lower one careless.
    fn default() -> Self {
        Self {
            progress_per_m: 1.0,
            deviation_per_m: -0.2,
            step: -0.02,
            success: 2.0,
            contact: -5.0,
            stray: -0.1,
        }
    }
}

impl ProgressReward {
    /// The reward of a step that moved the foot on the guide by `progress_m` and changed the size of
    /// the cross-track distance by `deviation_m`.
    #[must_use]
    pub fn value(&self, progress_m: f64, deviation_m: f64, events: StepEvents) -> f64 {
        let event = |happened: bool, reward: f64| if happened { reward } else { 0.0 };
        self.progress_per_m * progress_m
            + self.deviation_per_m * deviation_m
            + self.step
            + event(events.success, self.success)
            + event(events.contact, self.contact)
            + event(events.stray, self.stray)
    }
}

impl Reward for ProgressReward {
    fn reward(&self, transition: &Transition<'_>) -> f64 {
        self.value(transition.progress_m, transition.deviation_m, transition.events)
    }
}

#[cfg(test)]
mod tests {
    use sharp_space::trig;

    use super::*;

    fn straight() -> GuidePath {
        GuidePath::new((0..=10).map(|i| Pose::new(f64::from(i), 0.0, 0.0)).collect(), 1.5).unwrap()
    }

    #[test]
    fn the_three_cases_of_definition_9() {
        let (reward, guide, pose) = (PseudoReward::default(), straight(), Pose::new(4.2, 3.0, 1.0));
        assert_eq!(reward.value(&guide, &pose, Place::Termination), 1000.0, "r_t");
        assert_eq!(reward.value(&guide, &pose, Place::Astray), -100.0, "r_p");
        // n(x) is the point at x = 4: 3.0067 m away, then 6 m to the end.
        let expected = -(trig::hypot(0.2, 3.0) + 6.0);
        assert!((reward.value(&guide, &pose, Place::Allowed) - expected).abs() < 1e-12, "on the way");
    }

    #[test]
    fn arriving_with_another_heading_than_the_guide_pays_less() {
        let aligned = PseudoReward { heading: -100.0, ..PseudoReward::default() };
        let value = |heading| aligned.value(&straight(), &Pose::new(9.9, 0.1, heading), Place::Termination);
        assert_eq!(value(0.0), 1000.0);
        assert!((value(-0.5) - 950.0).abs() < 1e-9 && (value(0.5) - 950.0).abs() < 1e-9);
    }

    #[test]
    fn a_contact_fails_where_it_ends_the_episode_or_costs() {
        let paper = PseudoReward::default();
        assert!(!paper.contact_fails() && ProgressReward::default().contact_fails());
        let strict = PseudoReward { contact: -3.0, ..paper };
        assert!(strict.contact_fails() && !strict.contact_ends());
    }

    #[test]
    fn a_contact_costs_beside_what_the_place_pays() {
        let strict = PseudoReward { contact: -3.0, ..PseudoReward::default() };
        let pose = Pose::new(4.0, 0.0, 0.0);
        let events = StepEvents { contact: true, ..StepEvents::default() };
        assert_eq!(strict.paid(&straight(), &pose, StepEvents::default()), -6.0, "six metres are left");
        assert_eq!(strict.paid(&straight(), &pose, events), -9.0, "and the wall");
        let success = StepEvents { success: true, ..events };
        assert_eq!(strict.paid(&straight(), &pose, success), 997.0, "a success at a wall is one");
    }

    #[test]
    fn shaped_reward_adds_its_parts() {
        let reward = ProgressReward::default();
        assert!(
            (reward.value(0.5, 0.1, StepEvents::default()) - (0.5 - 0.02 - 0.02)).abs() < 1e-12,
            "a step"
        );
        let end = StepEvents { success: true, ..StepEvents::default() };
        assert!((reward.value(0.0, 0.0, end) - 1.98).abs() < 1e-12, "success");
        let crash = StepEvents { contact: true, stray: true, ..StepEvents::default() };
        assert!((reward.value(0.0, 0.0, crash) + 5.12).abs() < 1e-12, "contact astray");
    }
}
